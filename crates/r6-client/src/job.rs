//! What handles give to the connection: a request and the place where its answer goes.

use std::sync::Arc;
use std::time::Duration;

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
    /// How many points were taken; only AddPoints tells.
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

/// A request that owns what it sends.
#[derive(Clone, Debug)]
pub(crate) enum Work {
    Query(Arc<[Address]>),
    Command(Command<'static>),
    AddRcc { replace: bool, instructions: Vec<Instruction> },
    AddPoints(Vec<CameraSet>),
    PhotoAnswer(PhotoAnswer),
}

/// What came back.
#[derive(Debug)]
pub(crate) enum Answer {
    /// Each address with its value.
    Values { rows: Rows, on: Answered },
    /// Another number of values than addresses: nobody knows which is which.
    Mismatch { answered: usize, on: Answered },
    /// The controller took it.
    Accepted { accepted: Accepted, on: Answered },
    /// It left; the controller does not answer such a request.
    Left,
}

/// Over which connection a reply came, when it was asked for, and how long it took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Answered {
    pub connection: u64,
    pub asked_at: Instant,
    pub after: Duration,
}

/// On what terms a request may leave. The default: at any time, on any connection.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Terms {
    /// As [`Job::leave_by`].
    pub leave_by: Option<Instant>,
    /// As [`Job::only_on`].
    pub only_on: Option<u64>,
    /// As [`Job::stops_before`], where the caller asked before this was given to the connection.
    pub stops_before: Option<u64>,
}

/// One request on its way.
#[derive(Debug)]
pub(crate) struct Job {
    pub work: Work,
    pub asked_at: Instant,
    /// When it must have left; later it would be a surprise.
    pub leave_by: Option<Instant>,
    /// The number of the connection that it may leave on: what goes on with a motion does not on another.
    pub only_on: Option<u64>,
    /// How many stops had been asked for when the caller asked for this: what can move the arm does not leave after a later one.
    pub stops_before: u64,
    /// When it was put into the output of its connection.
    pub sent_at: Instant,
    /// How the connection ended that it left on, if it did before.
    pub lost: Option<LostReason>,
    /// Whether it is being sent for the second time: a query, over a new connection.
    pub retried: bool,
    /// Whether no caller looks at what it reads before the next command.
    pub background: bool,
    /// Open from when a frame that can move the arm was handed over until its outcome is known.
    pub doubt: Option<Doubt>,
    /// Where the values of its reply go: room of an earlier reply, or none yet.
    pub rows: Rows,
    reply: ReplyTo,
}

impl Work {
    /// What to call it, and what it can do.
    pub fn sent(&self) -> Sent {
        let (word, effect) = match self {
            Self::Query(_) => ("query", Effect::Reads),
            Self::Command(command) => (command.name().word(), command.name().effect()),
            Self::AddRcc { instructions, .. } if instructions.is_empty() => ("AddRCC", Effect::Changes),
            Self::AddRcc { .. } => ("AddRCC", Effect::Moves),
            // A program may wait for nothing but these points.
            Self::AddPoints(_) => ("AddPoints", Effect::Moves),
            Self::PhotoAnswer(_) => ("photo", Effect::Changes),
        };
        Sent { word, effect }
    }

    /// Whether somebody has to have read mode and alarm on a connection that was made anew before it may leave.
    pub fn needs_known_state(&self) -> bool {
        match self {
            Self::Query(_) | Self::PhotoAnswer(_) => false,
            Self::Command(_) | Self::AddRcc { .. } | Self::AddPoints(_) => {
                self.sent().effect != Effect::Stops
            }
        }
    }

    /// Whether it must not reach another robot than the one that is meant: everything but a question.
    pub fn is_for_one_robot(&self) -> bool {
        match self {
            Self::Query(_) => false,
            Self::Command(_) | Self::AddRcc { .. } | Self::AddPoints(_) | Self::PhotoAnswer(_) => true,
        }
    }

    /// Puts it into the session's output. `None` if no reply will come.
    pub fn send(&self, session: &mut ClientSession, now: Instant) -> Result<Option<Ticket>, SendError> {
        let cameras: Vec<CameraPoints<'_>>;
        let request = match self {
            Self::Query(addresses) => Request::Query(addresses),
            Self::Command(command) => Request::Command(command),
            Self::AddRcc { replace, instructions } => Request::AddRcc { empty_list: *replace, instructions },
            Self::AddPoints(sets) => {
                cameras =
                    sets.iter().map(|set| CameraPoints { cam_id: set.cam_id, points: &set.points }).collect();
                Request::AddPoints(&cameras)
            }
            Self::PhotoAnswer(answer) => Request::PhotoAnswer(*answer),
        };
        session.send(now, &request).map(|ticket| request.expects_reply().then_some(ticket))
    }

    /// What the reply says.
    ///
    /// `rows`: room for its values.
    pub fn answer(&self, message: &Message<'_>, on: Answered, rows: Rows) -> Result<Answer, RequestError> {
        let request = self.sent();
        match (self, &message.body) {
            (Self::Query(addresses), Body::QueryReply(reply)) => Ok(values(addresses, reply, on, rows)),
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
                Self::Query(_) | Self::PhotoAnswer(_) => {
                    let answer = reason.unwrap_or_default();
                    OutcomeUnknown::Unclear { request: self.sent(), answer }.into()
                }
            }),
        }
    }
}

/// What a message is, in words: for one that came where another kind was due.
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
            sent_at: Instant::ORIGIN,
            lost: None,
            retried: false,
            background: false,
            doubt: None,
            rows: Rows::new(),
            reply,
        }
    }

    /// Whether the caller does not wait for the answer any more.
    pub fn is_given_up(&self) -> bool {
        self.reply.is_given_up()
    }

    /// Whether nobody waits for the answer any more. A stop is wanted all the same.
    pub fn is_moot(&self) -> bool {
        self.is_given_up() && self.work.sent().effect != Effect::Stops
    }

    /// Whether it must not leave any more.
    pub fn is_overdue(&self, now: Instant) -> bool {
        self.leave_by.is_some_and(|by| now > by)
    }

    /// Whether it can move the arm, and a stop was asked for after it.
    pub fn is_overtaken(&self, stops: u64) -> bool {
        self.work.sent().effect == Effect::Moves && self.stops_before != stops
    }

    /// Gives the answer. A caller that is gone does not need it.
    pub fn finish(mut self, answer: Result<Answer, RequestError>) {
        if let Some(doubt) = self.doubt.take() {
            doubt.settle(&answer);
        }
        self.reply.put(answer);
    }

    /// It did not leave this time; whether it ever did decides what the caller is told.
    pub fn not_sent(self, error: impl Into<RequestError>) {
        let error = match self.lost {
            None => error.into(),
            Some(reason) => OutcomeUnknown::ConnectionLost { request: self.work.sent(), reason }.into(),
        };
        self.finish(Err(error));
    }
}
