//! What a client of a raw port asks for: its frames are read, and those whose meaning our own encoding could
//! change are refused.

use r6_proto::dialect::Addressing;
use r6_proto::message::{Action, AddPoints, AddRcc, ExtraKind, PhotoAnswer};
use r6_proto::request::CameraPoints;
use r6_proto::{Address, Body, Command, Effect, Message, Request, RequestType};

use super::meaning;
use crate::core::camera::{Camera, MAX_POINTS};
use crate::core::order::Order;

/// How many addresses a query may have: more than any client asks for at once. A longer one gets no reply.
pub const MAX_ADDRESSES: usize = 128;

/// What a client asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Asked {
    /// These values: the addresses that the table knows, in their order.
    Query(Vec<Address>),
    /// A command that stops or pauses.
    Stop(Command<'static>),
    /// A command or a list that changes or moves, or what a camera sends.
    Order(Order),
    /// Something that the gateway does not send on.
    Refused {
        /// What it was.
        request: String,
        /// Why not, for people.
        reason: String,
    },
}

/// What a message asks for; `None` if a controller would not answer it, and the gateway does nothing.
pub fn asked(message: &Message<'_>) -> Option<Asked> {
    let refused =
        |request: &str, reason: String| Some(Asked::Refused { request: request.to_owned(), reason });
    let asked = match &message.body {
        Body::Query(query) => {
            let known: Vec<_> = query.resolved().filter_map(|(_, address)| address.ok()).collect();
            (known.len() <= MAX_ADDRESSES).then_some(Asked::Query(known))
        }
        Body::Command(words) => match words.read_owned() {
            Ok(command) if command.name().effect() == Effect::Stops => Some(Asked::Stop(command)),
            // It is not known which of the two a controller reads.
            Ok(command) if message.extras().any(|extra| extra.kind == ExtraKind::DuplicateKey) => {
                refused(command.name().word(), "a key of the request stands twice".to_owned())
            }
            Ok(command) => Some(Asked::Order(command.into())),
            Err(error) => refused(&excerpt(&words.word()), error.to_string()),
        },
        Body::AddRcc(rcc) => match list(message, rcc) {
            Ok(list) => Some(Asked::Order(list)),
            Err(reason) => refused("AddRCC", reason),
        },
        Body::AddPoints(sets) => match points(message, sets) {
            Ok(points) => Some(Asked::Order(points)),
            Err(reason) => refused("AddPoints", reason),
        },
        Body::PhotoAnswer(answer) => match photo(message, *answer) {
            Ok(answer) => Some(Asked::Order(answer)),
            Err(reason) => refused("photo", reason),
        },
        Body::Rejected(rejection) => match rejection.request {
            RequestType::Query => Some(Asked::Query(Vec::new())),
            RequestType::Command | RequestType::AddPoints | RequestType::AddRcc => {
                refused(rejection.request.word(), rejection.error.to_string())
            }
            RequestType::Heartbreak | RequestType::Photo => None,
        },
        Body::Heartbreak
        | Body::Unknown(_)
        | Body::QueryReply(_)
        | Body::CommandReply(_)
        | Body::Photo(_) => None,
    };
    // A request without a type gets no reply (manual 5.2, 6), so its sender would not learn that it was
    // refused. Only a stop is carried out.
    asked.filter(|asked| message.header.type_word.is_some() || matches!(asked, Asked::Stop(_)))
}

/// The list of an AddRCC, if it means the same in our own encoding, on whatever firmware.
fn list(message: &Message<'_>, rcc: &AddRcc<'_>) -> Result<Order, String> {
    let Some(replace) = rcc.empty_list else { return Err("`emptyList` is missing".to_owned()) };
    if rcc.shape_2020 {
        return Err("the gateway does not send the shape of 2020 (`dsData`): use `instructions`".to_owned());
    }
    if let Some(index) = rcc.without_oneshot.first() {
        return Err(format!("instruction {} has no `oneshot`, which firmware reads in two ways", index + 1));
    }
    for (number, step) in (1..).zip(rcc.instructions) {
        if let Action::Unknown(unknown) = &step.action {
            return Err(format!(
                "instruction {number} has the action {}, which is not known",
                unknown.number()
            ));
        }
    }
    has_each_key_once(message)?;
    let request = Request::AddRcc { empty_list: replace, instructions: rcc.instructions };
    let mut ours = Vec::new();
    request.encode(&Addressing::default(), &mut ours).map_err(|error| error.to_string())?;
    match meaning::change(message.frame(), &ours) {
        Some(change) => Err(change),
        None => Ok(Order::List { replace, steps: rcc.instructions.to_vec() }),
    }
}

/// The points of an AddPoints, if they mean the same in our own encoding.
fn points(message: &Message<'_>, sets: &AddPoints<'_>) -> Result<Order, String> {
    let mut sets = sets.sets();
    let (Some((cam_id, points)), None) = (sets.next(), sets.next()) else {
        return Err("a request has the points of one camera: one set in `dsData`".to_owned());
    };
    let camera = camera(cam_id)?;
    if points.len() > MAX_POINTS {
        return Err(format!("a request has at most {MAX_POINTS} points"));
    }
    has_each_key_once(message)?;
    let request = [CameraPoints { cam_id, points }];
    let mut ours = Vec::new();
    let encoded = Request::AddPoints(&request).encode(&Addressing::default(), &mut ours);
    encoded.map_err(|error| error.to_string())?;
    match meaning::change_of_points(message.frame(), &ours) {
        Some(change) => Err(change),
        None => Ok(Order::Points { camera, points: points.to_vec() }),
    }
}

/// The answer to a photo, if it is known what it means.
fn photo(message: &Message<'_>, answer: PhotoAnswer) -> Result<Order, String> {
    has_each_key_once(message)?;
    let taken = match answer.ret {
        0 => false,
        1 => true,
        other => {
            return Err(format!("`ret` is {other}: 1 says that there is a picture, 0 that there is not"));
        }
    };
    Ok(Order::Photo { camera: camera(answer.cam_id)?, taken })
}

fn camera(cam_id: i64) -> Result<Camera, String> {
    Camera::new(cam_id).ok_or_else(|| format!("`camID` is {cam_id}, and not {}", Camera::WANTED))
}

/// It is not known which of two values of one key a controller reads, and comparisons see only one.
fn has_each_key_once(message: &Message<'_>) -> Result<(), String> {
    match message.extras().find(|extra| extra.kind == ExtraKind::DuplicateKey) {
        Some(extra) => Err(format!("`{}` in {}: {}", excerpt(&extra.key.text()), extra.place, extra.kind)),
        None => Ok(()),
    }
}

fn excerpt(word: &str) -> String {
    word.chars().take(48).collect()
}
