//! The jobs that handles give to the connection: a request and the place for its answer.

use std::sync::Arc;
use std::time::Duration;

use crate::conditions::Permission;
use crate::doubt::Doubt;
use crate::error::{Effect, OutcomeUnknown, Refused, RequestError, Sent};
use crate::pushed::LostReason;
use crate::query::result::{NoReading, Rows};
use crate::reply::ReplyTo;
use r6_proto::address::Address;
use r6_proto::client::{ClientSession, SendError, Ticket};
use r6_proto::message::command::Outcome;
use r6_proto::message::{
    Body, Command, CommandReply, Instruction, Message, PhotoAnswer, Point, QueryReply, Reading,
};
use r6_proto::request::{CameraPoints, Request};
use r6_proto::time::Instant;

/// The controller accepted the request. This does not mean that the arm moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Accepted {
    /// How long the reply took.
    pub after: Duration,
    /// How many points were taken; only the reply to AddPoints has this.
    pub points: Option<u64>,
}

/// The points that one camera found.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSet {
    /// `camID`.
    pub cam_id: i64,
    /// Its points.
    pub points: Vec<Point>,
}

/// A request that owns its data.
#[derive(Clone, Debug)]
pub(crate) enum Work {
    Query(Arc<[Address]>),
    /// A query whose values are handed on as the controller wrote them.
    RawQuery(Arc<[Address]>),
    Command(Command<'static>),
    AddRcc {
        replace: bool,
        instructions: Vec<Instruction>,
    },
    AddPoints(Vec<CameraSet>),
    PhotoAnswer(PhotoAnswer),
}

/// What came back for a request.
#[derive(Debug)]
pub(crate) enum Answer {
    /// Each address with its value.
    Values { rows: Rows, on: Answered },
    /// The number of values differs from that of the addresses, so they cannot be matched.
    Mismatch { answered: usize, on: Answered },
    /// The values as the controller wrote them, however many there are.
    Raw { values: Vec<Vec<u8>>, on: Answered },
    /// The controller accepted the request.
    Accepted { accepted: Accepted, on: Answered },
    /// The request was sent; the controller does not answer requests of this kind.
    Left,
}

/// The connection that a reply came over, when the request was made, and how long the reply took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Answered {
    pub connection: u64,
    pub asked_at: Instant,
    pub after: Duration,
}

/// The conditions for sending a request. The default: at any time, on any connection.
#[derive(Clone, Debug, Default)]
pub(crate) struct Terms {
    /// As [`Job::leave_by`].
    pub leave_by: Option<Instant>,
    /// As [`Job::only_on`].
    pub only_on: Option<u64>,
    /// As [`Job::stops_before`], if the caller asked before the job was given to the connection.
    pub stops_before: Option<u64>,
    /// As [`Job::permission`].
    pub permission: Option<Permission>,
}

/// A request under way.
#[derive(Debug)]
pub(crate) struct Job {
    pub work: Work,
    pub asked_at: Instant,
    /// The latest time to send it; later it would be a surprise.
    pub leave_by: Option<Instant>,
    /// The only connection it may be sent on, by number: a motion does not continue on another one.
    pub only_on: Option<u64>,
    /// How many stops had been asked for when the caller asked for this. A request that can move the arm is
    /// not sent after a later stop.
    pub stops_before: u64,
    /// It is sent only while this stands.
    pub permission: Option<Permission>,
    /// When it was put into the output of its connection.
    pub sent_at: Instant,
    /// How an earlier connection ended that this was sent on, if there was one.
    pub lost: Option<LostReason>,
    /// Whether it is sent for the second time: a query, over a new connection.
    pub retried: bool,
    /// Whether its values are not looked at by a caller before the next command.
    pub background: bool,
    /// Set when a frame that can move the arm is handed over, until its outcome is known.
    pub doubt: Option<Doubt>,
    /// Storage for the values of its reply, reused from an earlier reply if there was one.
    pub rows: Rows,
    reply: ReplyTo,
}

impl Work {
    /// The addresses of a query.
    pub fn asked(&self) -> Option<&[Address]> {
        match self {
            Self::Query(addresses) | Self::RawQuery(addresses) => Some(addresses),
            Self::Command(_) | Self::AddRcc { .. } | Self::AddPoints(_) | Self::PhotoAnswer(_) => None,
        }
    }

    /// The request's word and its effect. They do not depend on the points of cameras.
    pub fn sent(&self) -> Sent {
        let request = self.request(&[]);
        Sent { word: request.word(), effect: request.effect() }
    }

    /// The request. `cameras`: the points of [`Self::AddPoints`].
    fn request<'a>(&'a self, cameras: &'a [CameraPoints<'a>]) -> Request<'a> {
        match self {
            Self::Query(addresses) | Self::RawQuery(addresses) => Request::Query(addresses),
            Self::Command(command) => Request::Command(command),
            Self::AddRcc { replace, instructions } => Request::AddRcc { empty_list: *replace, instructions },
            Self::AddPoints(_) => Request::AddPoints(cameras),
            Self::PhotoAnswer(answer) => Request::PhotoAnswer(*answer),
        }
    }

    /// Whether a caller has to read mode and alarm after a reconnect before this may be sent.
    pub fn needs_known_state(&self) -> bool {
        match self {
            Self::Query(_) | Self::RawQuery(_) | Self::PhotoAnswer(_) => false,
            Self::Command(_) | Self::AddRcc { .. } | Self::AddPoints(_) => {
                self.sent().effect != Effect::Stops
            }
        }
    }

    /// Whether it must reach only the expected robot: everything but a query.
    pub fn is_for_one_robot(&self) -> bool {
        match self {
            Self::Query(_) | Self::RawQuery(_) => false,
            Self::Command(_) | Self::AddRcc { .. } | Self::AddPoints(_) | Self::PhotoAnswer(_) => true,
        }
    }

    /// Writes the request to the session's output. `None` if it gets no reply.
    pub fn send(&self, session: &mut ClientSession, now: Instant) -> Result<Option<Ticket>, SendError> {
        let cameras: Vec<_> = match self {
            Self::AddPoints(sets) => {
                sets.iter().map(|set| CameraPoints { cam_id: set.cam_id, points: &set.points }).collect()
            }
            Self::Query(_)
            | Self::RawQuery(_)
            | Self::Command(_)
            | Self::AddRcc { .. }
            | Self::PhotoAnswer(_) => Vec::new(),
        };
        let request = self.request(&cameras);
        session.send(now, &request).map(|ticket| request.expects_reply().then_some(ticket))
    }

    /// Evaluates the reply.
    ///
    /// `rows`: storage for its values.
    pub fn answer(&self, message: &Message<'_>, on: Answered, rows: Rows) -> Result<Answer, RequestError> {
        let request = self.sent();
        match (self, &message.body) {
            (Self::Query(addresses), Body::QueryReply(reply)) => Ok(values(addresses, reply, on, rows)),
            (Self::RawQuery(_), Body::QueryReply(reply)) => Ok(Answer::Raw {
                values: reply.values.iter().map(|value| value.wire().to_vec()).collect(),
                on,
            }),
            (_, Body::CommandReply(reply)) => self.verdict(reply, on),
            (_, Body::Rejected(rejection)) => {
                Err(OutcomeUnknown::Unreadable { request, error: rejection.error.clone() }.into())
            }
            (_, body) => {
                let answer = kind_of(body).to_owned();
                Err(OutcomeUnknown::Unclear { request, answer }.into())
            }
        }
    }

    fn verdict(&self, reply: &CommandReply<'_>, on: Answered) -> Result<Answer, RequestError> {
        let accepted = |points| Answer::Accepted { accepted: Accepted { after: on.after, points }, on };
        match reply.outcome() {
            Outcome::Ok => Ok(accepted(None)),
            Outcome::Points(points) => Ok(accepted(Some(points))),
            Outcome::Unclear(answer) => Err(OutcomeUnknown::Unclear { request: self.sent(), answer }.into()),
            Outcome::Refused(reason) => Err(match self {
                Self::Command(command) => Refused::Command { command: command.name(), reason }.into(),
                Self::AddRcc { .. } => Refused::InstructionList { reason }.into(),
                Self::AddPoints(_) => Refused::Points { reason }.into(),
                Self::Query(_) | Self::RawQuery(_) | Self::PhotoAnswer(_) => {
                    let answer = reason.unwrap_or_default();
                    OutcomeUnknown::Unclear { request: self.sent(), answer }.into()
                }
            }),
        }
    }
}

/// Names the kind of a message that arrived in place of another kind.
fn kind_of(body: &Body<'_>) -> &'static str {
    match body {
        Body::Query(_) => "a query",
        Body::QueryReply(_) => "a reply to a query",
        Body::Command(_) => "a command",
        Body::CommandReply(_) => "a reply to a command",
        Body::Heartbreak => "a heartbreak",
        Body::Photo(_) => "a request for a photo",
        Body::PhotoAnswer(_) => "an answer to a photo",
        Body::AddPoints(_) => "points of a camera",
        Body::AddRcc(_) => "an instruction list",
        Body::Unknown(_) => "a message of an unknown type",
        Body::Rejected(_) => "a message that cannot be read",
    }
}

fn values(addresses: &[Address], reply: &QueryReply<'_>, on: Answered, mut rows: Rows) -> Answer {
    match reply.aligned(addresses.len()) {
        Ok(values) => {
            rows.clear();
            rows.extend(addresses.iter().zip(values.iter()).map(|(address, value)| {
                (*address, Reading::of(*address, value).map_err(NoReading::Unreadable))
            }));
            Answer::Values { rows, on }
        }
        Err(mismatch) => Answer::Mismatch { answered: mismatch.answered, on },
    }
}

impl Job {
    pub fn new(work: Work, asked_at: Instant, reply: ReplyTo) -> Self {
        Self {
            work,
            asked_at,
            leave_by: None,
            only_on: None,
            stops_before: 0,
            permission: None,
            sent_at: Instant::ORIGIN,
            lost: None,
            retried: false,
            background: false,
            doubt: None,
            rows: Rows::new(),
            reply,
        }
    }

    /// Whether the caller no longer waits for the answer.
    pub fn is_given_up(&self) -> bool {
        self.reply.is_given_up()
    }

    /// Whether the job can be dropped, because its caller gave it up. A stop is never dropped.
    pub fn is_moot(&self) -> bool {
        self.is_given_up() && self.work.sent().effect != Effect::Stops
    }

    /// Whether it is too late to send it.
    pub fn is_overdue(&self, now: Instant) -> bool {
        self.leave_by.is_some_and(|by| now > by)
    }

    /// Whether its permission was withdrawn. A stop needs none.
    pub fn is_withdrawn(&self) -> bool {
        self.permission.as_ref().is_some_and(Permission::is_withdrawn)
            && self.work.sent().effect != Effect::Stops
    }

    /// Whether it can move the arm and a stop was asked for after it.
    pub fn is_overtaken(&self, stops: u64) -> bool {
        self.work.sent().effect == Effect::Moves && self.stops_before != stops
    }

    /// Gives the answer to the caller, if it still waits.
    pub fn finish(mut self, answer: Result<Answer, RequestError>) {
        if let Some(doubt) = self.doubt.take() {
            doubt.settle(&answer);
        }
        self.reply.put(answer);
    }

    /// The request was not sent this time. The caller's error depends on whether it was sent before.
    pub fn not_sent(self, error: impl Into<RequestError>) {
        let error = match self.lost {
            None => error.into(),
            Some(reason) => OutcomeUnknown::ConnectionLost { request: self.work.sent(), reason }.into(),
        };
        self.finish(Err(error));
    }
}
