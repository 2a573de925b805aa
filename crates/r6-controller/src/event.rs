//! Events at a virtual controller, as data. `event/english.rs` and `event/chinese.rs` turn them into text for
//! people.
//!
//! Each thing that happens is one event with fields. `log.rs` keeps events until they are read, and limits
//! how much one connection can log. Events at sockets, cameras and files are [`ShellEvent`]s, which `r6-sim`
//! reports. `r6 sim` (`r6/src/cmd/sim.rs`) prints events; tests and `r6-world` match on them.

mod cause;
mod chinese;
mod english;
mod reason;

use std::fmt;
use std::time::Duration;

use r6_proto::alarm::AlarmCode;
use r6_proto::{AxisIndex, Language, OperationMode, RequestType, printable};
use serde::{Serialize, Serializer};

use crate::fault::{Fault, IgnoredStop, TaskFault};
use crate::panel::Refused;
use crate::scenario::Happening;
pub use cause::{AlarmCause, DidNot, ListRefusal, ModeReason};
pub use reason::{AtStep, Reason};

/// The longest text in an event, and the longest line, in characters. A hostile peer's words are quoted, so
/// they need a bound.
const MAX_CHARS: usize = 400;

/// How much an event matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// A change of state.
    Info,
    /// The peer should do something differently, or something is broken.
    Warning,
}

/// A text from elsewhere: a peer's words, or why something failed. It is on one line, and at most 400
/// characters long.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Detail(String);

impl Detail {
    /// The text, escaped with `r6_proto::printable` and cut.
    pub fn of(text: impl fmt::Display) -> Self {
        Self(cut(printable(&text.to_string()).to_string()))
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Detail {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Cuts a line that is too long.
fn cut(text: String) -> String {
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => text.split_at(end).0.to_owned() + "…",
        None => text,
    }
}

/// Something that happened at a controller, or around it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// This connection is not answered: as many connections are served as the firmware serves.
    TooManyConnections {
        /// How many are served.
        limit: usize,
    },
    /// A message was not understood; it is not answered.
    NotUnderstood {
        /// What is wrong with it.
        problem: Reason,
    },
    /// Something in a message is odd; the message is handled nevertheless.
    Odd {
        /// What is odd, with the nearest known word.
        problem: Reason,
    },
    /// An instruction has no `oneshot`.
    WithoutOneshot {
        /// Its number in the list, from 1.
        instruction: u32,
        /// Whether it stays in the list after it has run.
        stays: bool,
    },
    /// More oddities of the same message, which are not logged one by one.
    MoreOfTheKind {
        /// How many.
        count: usize,
    },
    /// A reply came, but a controller sends no requests that need one.
    ReplyCame,
    /// A request has a `dsID` that does not belong to its type. Logged once per connection.
    WrongDsId {
        /// The request.
        #[serde(serialize_with = "as_text")]
        request: RequestType,
        /// What was sent; `None` if it has no `dsID`.
        sent: Option<Detail>,
        /// What should have been sent, in the long and the short form.
        right: [&'static str; 2],
    },
    /// A request without a type is not answered.
    WithoutType {
        /// The type of request it was taken for.
        #[serde(serialize_with = "as_text")]
        request: RequestType,
        /// Whether it was carried out.
        done: bool,
    },
    /// The dispatcher refused a request because of one of its fields.
    Refused {
        /// The request.
        #[serde(serialize_with = "as_text")]
        request: RequestType,
        /// Why.
        why: Reason,
    },
    /// A command was answered with ok.
    CommandAccepted {
        /// Its word.
        command: Detail,
        /// Its arguments, as sent.
        arguments: Vec<Detail>,
        /// Whether it was carried out.
        done: bool,
    },
    /// A command was refused.
    CommandRefused {
        /// Its word.
        command: Detail,
        /// Why.
        why: Reason,
    },
    /// A command was answered with ok, as this firmware does, although its arguments are wrong. Nothing was
    /// done.
    CommandWithoutEffect {
        /// What is wrong with the arguments.
        why: Reason,
    },
    /// A stop was answered but not carried out: a fault.
    StopIgnored {
        /// The stop: a command, or `AddRCC`.
        request: Detail,
        /// Which kind of the fault.
        #[serde(serialize_with = "as_debug")]
        how: IgnoredStop,
    },
    /// A list was taken.
    ListTaken {
        /// How many instructions it has.
        instructions: usize,
        /// Whether it replaced the list that was there.
        replaced: bool,
        /// Whether it went into the instruction list. If not, it was answered with ok, and nothing was done.
        done: bool,
    },
    /// A list was taken but answered with err, as one unit was seen to do.
    ListAnsweredErr {
        /// How many instructions it has.
        instructions: usize,
    },
    /// A list is taken later and not answered: a fault.
    ListComesLate {
        /// The delay, in seconds.
        #[serde(serialize_with = "as_seconds")]
        after: Duration,
    },
    /// A list that came earlier is taken now: a fault.
    LateListTaken {
        /// How many instructions it has.
        instructions: usize,
    },
    /// A list that came earlier could not be taken.
    LateListNotTaken {
        /// Why.
        #[serde(serialize_with = "as_text")]
        why: ListRefusal,
    },
    /// A list was refused.
    ListRefused {
        /// Why.
        #[serde(serialize_with = "as_text")]
        why: ListRefusal,
    },
    /// A list was neither executed nor answered.
    ListIgnored {
        /// Why.
        #[serde(serialize_with = "as_text")]
        why: ListRefusal,
    },
    /// A list is longer than the firmware accepts.
    ListTooLong {
        /// Length of its frame in bytes.
        bytes: usize,
        /// Whether the connection is reset; otherwise the list is neither executed nor answered.
        reset: bool,
    },
    /// A camera answered a photo request.
    PhotoAnswered {
        /// The camera.
        camera: i64,
        /// The `ret` it answered.
        ret: i64,
    },
    /// A camera was asked for a photo.
    PhotoRequested {
        /// The camera.
        camera: i64,
    },
    /// A photo request could not be sent: no connection belongs to the camera.
    PhotoLost {
        /// The camera.
        camera: i64,
        /// Whether the shell dials the camera and it is not connected; otherwise no connection can belong to
        /// it.
        away: bool,
    },
    /// A connection that was opened to one camera speaks as another.
    CameraSpeaksAsAnother {
        /// The `camID` it was dialled as.
        dialled: i64,
        /// The `camID` it speaks as.
        speaks_as: i64,
    },
    /// A camera sent points (`AddPoints`).
    PointsTaken {
        /// The camera.
        camera: i64,
        /// How many it sent.
        points: usize,
        /// How many points of all cameras wait for a program now.
        waiting: usize,
    },
    /// The points that waited for a program were removed at the panel.
    PointsCleared {
        /// How many.
        points: usize,
    },
    /// Points from cameras are lost from now on, because no program uses them.
    PointsLost {
        /// How many points wait.
        limit: usize,
    },
    /// Warnings of a connection were left out: there were more within a second than the log takes.
    WarningsLeftOut {
        /// How many.
        count: u64,
        /// How many the log takes within a second.
        told: u32,
    },
    /// Events were lost, because the log was not read in time.
    EventsDropped {
        /// How many events are lost.
        count: u64,
    },

    /// The mode changed.
    ModeChanged {
        /// The new mode.
        #[serde(serialize_with = "as_text")]
        mode: OperationMode,
        /// Why.
        why: ModeReason,
    },
    /// Single cycle was pressed.
    SingleCycle,
    /// Single step was pressed.
    SingleStep,
    /// The stop button was pressed: the program ends after this cycle.
    EndsWithCycle,
    /// An alarm was raised.
    AlarmRaised {
        /// Its number.
        #[serde(serialize_with = "as_number")]
        alarm: AlarmCode,
        /// Why.
        why: AlarmCause,
    },
    /// The alarm was cleared.
    AlarmCleared {
        /// Its number.
        #[serde(serialize_with = "as_number")]
        alarm: AlarmCode,
    },
    /// The emergency stop was released.
    EmergencyStopReleased,
    /// An axis is moved by hand.
    MovedByHand {
        /// The axis.
        #[serde(serialize_with = "as_text")]
        axis: AxisIndex,
        /// How far, in degrees, or mm on a linear axis.
        by: f64,
        /// How fast, in percent.
        percent: f64,
    },
    /// An axis is moved by hand as long as a button is held.
    HeldByHand {
        /// The axis.
        #[serde(serialize_with = "as_text")]
        axis: AxisIndex,
        /// Whether its position grows.
        up: bool,
        /// How fast, in percent.
        percent: f64,
    },
    /// The button was not seen pressed any more, so the move by hand ends.
    NotHeldAnyMore,
    /// The machine is being homed.
    Homing,
    /// The machine is homed.
    Homed,
    /// A program was loaded.
    ProgramLoaded {
        /// Its name.
        name: Detail,
        /// How many steps it has.
        steps: usize,
    },
    /// A program loaded at the panel has the same name as one given at the start. The latter is used.
    ProgramGivenAtStart {
        /// Its name.
        name: Detail,
    },
    /// A program that was loaded earlier is no longer available.
    ProgramGone {
        /// Its name.
        name: Detail,
        /// Why.
        why: Detail,
    },
    /// A curve is not executed, as on real controllers, because no linear move came before it.
    CurveNotExecuted {
        /// Which step.
        step: AtStep,
    },
    /// The arm rests at its point for a while: a fault.
    Dwells {
        /// How long.
        #[serde(serialize_with = "as_seconds")]
        rest: Duration,
    },

    /// The scenario does something.
    Happens {
        /// What it does.
        #[serde(serialize_with = "as_text")]
        what: Happening,
    },
    /// The scenario was to do something, but it failed.
    DidNotHappen {
        /// What it was to do.
        #[serde(serialize_with = "as_text")]
        what: Happening,
        /// Why.
        why: DidNot,
    },
    /// An input of the scenario does not follow its output: too many changes are pending.
    InputDoesNotFollow,
    /// Repetitions of the scenario were left out, because there were too many at once.
    HappeningsLeftOut {
        /// How many.
        count: u64,
    },
    /// A fault of the scenario begins.
    FaultBegins {
        /// The fault.
        #[serde(serialize_with = "as_text")]
        fault: Fault,
    },
    /// A fault of the scenario ends.
    FaultEnds {
        /// The fault.
        #[serde(serialize_with = "as_text")]
        fault: Fault,
    },
    /// The mains are back.
    MainsAreBack,
    /// The program that the power cut was to leave chosen could not be chosen.
    ProgramNotChosen {
        /// Why.
        #[serde(serialize_with = "as_text")]
        why: Refused,
    },
    /// A fault struck this connection, or one of its replies.
    Struck {
        /// The fault.
        #[serde(serialize_with = "as_text")]
        fault: Fault,
    },
    /// A request is not answered: a fault.
    NotAnswered {
        /// The fault.
        #[serde(serialize_with = "task_as_text")]
        fault: TaskFault,
    },
    /// A query is answered with old values: a fault.
    OldValues {
        /// The fault.
        #[serde(serialize_with = "task_as_text")]
        fault: TaskFault,
    },

    /// The shell reports something about sockets, cameras or files.
    Shell(ShellEvent),
}

/// What happens around a controller: at its sockets, cameras and files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "what", rename_all = "snake_case")]
pub enum ShellEvent {
    /// Connections are refused.
    Refuses,
    /// Attempts to connect get no answer.
    GivesNoAnswer,
    /// Connections are made, but not served.
    DoesNotServe {
        /// Why they are made nevertheless.
        why: Detail,
    },
    /// Connections are taken again.
    TakesAgain,
    /// A connection cannot be accepted; the shell tries until it can.
    CannotAccept {
        /// Why: most likely because too many files are open.
        why: Detail,
    },
    /// Connections are accepted again.
    AcceptsAgain,
    /// Only few connections can wait to be accepted.
    ShortQueue {
        /// Why the queue could not be made longer.
        why: Detail,
    },
    /// The port cannot be opened again.
    CannotListen {
        /// Its address.
        address: Detail,
        /// Why.
        why: Detail,
    },
    /// A connection to a camera was made.
    CameraConnected {
        /// The camera.
        camera: Detail,
    },
    /// The connection to a camera has ended.
    CameraLost {
        /// The camera.
        camera: Detail,
        /// How it ended.
        how: Detail,
    },
    /// A camera cannot be reached; the shell tries until it can.
    CameraUnreachable {
        /// The camera.
        camera: Detail,
        /// Why.
        why: Detail,
    },
    /// The state cannot be written. Until it can, nothing that changes the state is acknowledged.
    StateNotWritten {
        /// Why.
        why: Detail,
    },
    /// The state can be written again.
    StateWritten {
        /// The file.
        path: Detail,
    },
    /// The last state was not saved.
    LastStateLost {
        /// Why.
        why: Detail,
    },
    /// A note from an observer.
    Note {
        /// The note.
        text: Detail,
    },
}

impl Event {
    /// How much it matters.
    #[must_use]
    pub fn level(&self) -> Level {
        match self {
            Self::CommandAccepted { .. }
            | Self::CommandWithoutEffect { .. }
            | Self::StopIgnored { .. }
            | Self::ListTaken { .. }
            | Self::ListComesLate { .. }
            | Self::LateListTaken { .. }
            | Self::PhotoAnswered { .. }
            | Self::PhotoRequested { .. }
            | Self::PointsTaken { .. }
            | Self::PointsCleared { .. }
            | Self::PointsLost { .. }
            | Self::ModeChanged { .. }
            | Self::SingleCycle
            | Self::SingleStep
            | Self::EndsWithCycle
            | Self::AlarmRaised { .. }
            | Self::AlarmCleared { .. }
            | Self::EmergencyStopReleased
            | Self::MovedByHand { .. }
            | Self::HeldByHand { .. }
            | Self::NotHeldAnyMore
            | Self::Homing
            | Self::Homed
            | Self::ProgramLoaded { .. }
            | Self::ProgramGivenAtStart { .. }
            | Self::ProgramGone { .. }
            | Self::CurveNotExecuted { .. }
            | Self::Dwells { .. }
            | Self::Happens { .. }
            | Self::MainsAreBack
            | Self::Struck { .. }
            | Self::NotAnswered { .. }
            | Self::OldValues { .. } => Level::Info,
            Self::TooManyConnections { .. }
            | Self::NotUnderstood { .. }
            | Self::Odd { .. }
            | Self::WithoutOneshot { .. }
            | Self::MoreOfTheKind { .. }
            | Self::ReplyCame
            | Self::WrongDsId { .. }
            | Self::WithoutType { .. }
            | Self::Refused { .. }
            | Self::CommandRefused { .. }
            | Self::ListAnsweredErr { .. }
            | Self::LateListNotTaken { .. }
            | Self::ListRefused { .. }
            | Self::ListIgnored { .. }
            | Self::ListTooLong { .. }
            | Self::PhotoLost { .. }
            | Self::CameraSpeaksAsAnother { .. }
            | Self::WarningsLeftOut { .. }
            | Self::EventsDropped { .. }
            | Self::DidNotHappen { .. }
            | Self::InputDoesNotFollow
            | Self::HappeningsLeftOut { .. }
            | Self::FaultBegins { .. }
            | Self::FaultEnds { .. }
            | Self::ProgramNotChosen { .. } => Level::Warning,
            Self::Shell(event) => event.level(),
        }
    }

    /// How many instructions of a list were taken with this event; `None` for other events.
    #[must_use]
    pub fn instructions_taken(&self) -> Option<usize> {
        match self {
            Self::ListTaken { instructions, .. }
            | Self::ListAnsweredErr { instructions }
            | Self::LateListTaken { instructions } => Some(*instructions),
            _ => None,
        }
    }

    /// Whether the event is about an AddRCC.
    #[must_use]
    pub fn is_about_a_list(&self) -> bool {
        match self {
            Self::ListRefused { .. } | Self::ListIgnored { .. } | Self::ListTooLong { .. } => true,
            Self::Refused { request, .. } => *request == RequestType::AddRcc,
            other => other.instructions_taken().is_some(),
        }
    }

    /// The event in words, on one line.
    #[must_use]
    pub fn text(&self, language: Language) -> String {
        let text = match language {
            Language::English => english::In(self).to_string(),
            Language::Chinese => chinese::In(self).to_string(),
        };
        cut(printable(&text).to_string())
    }
}

impl ShellEvent {
    fn level(&self) -> Level {
        match self {
            Self::Refuses
            | Self::GivesNoAnswer
            | Self::TakesAgain
            | Self::AcceptsAgain
            | Self::CameraConnected { .. }
            | Self::StateWritten { .. }
            | Self::Note { .. } => Level::Info,
            Self::DoesNotServe { .. }
            | Self::CannotAccept { .. }
            | Self::ShortQueue { .. }
            | Self::CannotListen { .. }
            | Self::CameraLost { .. }
            | Self::CameraUnreachable { .. }
            | Self::StateNotWritten { .. }
            | Self::LastStateLost { .. } => Level::Warning,
        }
    }
}

impl fmt::Display for Event {
    /// In English.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(Language::English))
    }
}

fn as_number<S: Serializer>(alarm: &AlarmCode, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_u32(alarm.0)
}

fn as_text<T: fmt::Display, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(value)
}

fn as_debug<T: fmt::Debug, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(&format_args!("{value:?}"))
}

fn task_as_text<S: Serializer>(fault: &TaskFault, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(&Fault::Task(*fault))
}

fn as_seconds<S: Serializer>(time: &Duration, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(time.as_secs_f64())
}
