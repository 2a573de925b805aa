//! What happens at a virtual controller, as data. In words, which only people read, it is in `event/english.rs` and `event/chinese.rs`.

mod chinese;
mod english;

use std::fmt;
use std::time::Duration;

use r6_proto::{AxisIndex, Language, OperationMode, RequestType, printable};
use serde::{Serialize, Serializer};

use crate::fault::{Fault, IgnoredStop, TaskFault};
use crate::panel::Refused;
use crate::scenario::Happening;

/// The longest text within an event, and the longest line: a hostile peer's words are quoted, but not without end.
const MAX_CHARS: usize = 400;

/// How much an event matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// A change of state.
    Info,
    /// Something that a peer should do otherwise, or that is broken.
    Warning,
}

/// A text that comes from elsewhere: a peer's words, or why something failed. On one line, and no longer than 400 characters.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Detail(String);

impl Detail {
    /// This text, escaped as `r6_proto::printable` does and cut.
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

/// Something that happened at a controller, or in what surrounds it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// As many connections are served as the firmware serves: this one is not answered.
    TooManyConnections {
        /// How many are served.
        limit: usize,
    },
    /// What came is no message that a controller knows; it is not answered.
    NotUnderstood {
        /// What is wrong with it.
        problem: Detail,
    },
    /// Something in a message is odd; the message is dealt with all the same.
    Odd {
        /// What, with the nearest right word.
        problem: Detail,
    },
    /// An instruction has no `oneshot`.
    WithoutOneshot {
        /// Which of the list, from 1.
        instruction: u32,
        /// Whether it stays in the list once it has run.
        stays: bool,
    },
    /// So many more oddities of one message are not told.
    MoreOfTheKind {
        /// How many.
        count: usize,
    },
    /// A reply came, and a controller asks nothing.
    ReplyCame,
    /// A request has another `dsID` than its kind has. Told once for each connection.
    WrongDsId {
        /// The request.
        #[serde(serialize_with = "as_text")]
        request: RequestType,
        /// What was sent; `None`: no `dsID`.
        sent: Option<Detail>,
        /// What should have been sent, in the long and the short form.
        right: [&'static str; 2],
    },
    /// A request without a type is not answered.
    WithoutType {
        /// What it was taken for.
        #[serde(serialize_with = "as_text")]
        request: RequestType,
        /// Whether it was carried out.
        done: bool,
    },
    /// A request that the dispatcher refused because of one of its fields.
    Refused {
        /// The request.
        #[serde(serialize_with = "as_text")]
        request: RequestType,
        /// Why.
        why: Detail,
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
        why: Detail,
    },
    /// A command was answered with ok although its arguments are wrong, as this firmware does; nothing was done.
    CommandWithoutEffect {
        /// What is wrong with the arguments.
        why: Detail,
    },
    /// A stop was answered and not carried out: a fault.
    StopIgnored {
        /// What stops: a command, or `AddRCC`.
        request: Detail,
        /// How.
        #[serde(serialize_with = "as_debug")]
        how: IgnoredStop,
    },
    /// A list was taken.
    ListTaken {
        /// How many instructions it has.
        instructions: usize,
        /// Whether it replaced the one that was there.
        replaced: bool,
        /// Whether it goes into the list of instructions; otherwise it was answered with ok, and nothing was done.
        done: bool,
    },
    /// A list was taken, and answered with err all the same, as one unit was seen to do.
    ListAnsweredErr {
        /// How many instructions it has.
        instructions: usize,
    },
    /// A list is taken later, and not answered: a fault.
    ListComesLate {
        /// How much later.
        #[serde(serialize_with = "as_seconds")]
        after: Duration,
    },
    /// A list that came before is taken now: a fault.
    LateListTaken {
        /// How many instructions it has.
        instructions: usize,
    },
    /// A list that came before could not be taken.
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
    /// A list is longer than the firmware takes.
    ListTooLong {
        /// Bytes of its frame.
        bytes: usize,
        /// Whether the connection is reset; otherwise the list is neither executed nor answered.
        reset: bool,
    },
    /// A camera answered a photo request.
    PhotoAnswered {
        /// The camera.
        camera: i64,
        /// What it answered.
        ret: i64,
    },
    /// A camera was asked for a photo.
    PhotoRequested {
        /// The camera.
        camera: i64,
    },
    /// A camera should be asked for a photo, and there is no connection for it.
    PhotoLost {
        /// The camera.
        camera: i64,
        /// Whether the camera is dialled and away; otherwise no connection can be its.
        away: bool,
    },
    /// A connection that was opened to one camera speaks as another.
    CameraSpeaksAsAnother {
        /// As which it was dialled.
        dialled: i64,
        /// As which it speaks.
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
    /// Points of cameras are lost from now on: nobody uses them.
    PointsLost {
        /// How many wait.
        limit: usize,
    },
    /// More warnings of a connection were left out than are told.
    WarningsLeftOut {
        /// How many.
        count: u64,
        /// How many are told within a second.
        told: u32,
    },
    /// Nobody read the log in time.
    EventsDropped {
        /// How many events are lost.
        count: u64,
    },

    /// The mode changed.
    ModeChanged {
        /// To which.
        #[serde(serialize_with = "as_text")]
        mode: OperationMode,
        /// Why.
        why: ModeReason,
    },
    /// Single cycle was pressed.
    SingleCycle,
    /// Single step was pressed.
    SingleStep,
    /// The stop button was pressed: the program ends with this cycle.
    EndsWithCycle,
    /// An alarm was raised.
    AlarmRaised {
        /// Its number.
        alarm: u32,
        /// Why.
        why: AlarmCause,
    },
    /// The alarm was cleared.
    AlarmCleared {
        /// Its number.
        alarm: u32,
    },
    /// The emergency stop was released.
    EmergencyStopReleased,
    /// An axis is moved by hand.
    MovedByHand {
        /// The axis.
        #[serde(serialize_with = "as_text")]
        axis: AxisIndex,
        /// How far, degrees, or mm where it slides.
        by: f64,
        /// How fast, percent.
        percent: f64,
    },
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
    /// A program that was loaded before has the name of one that was given at the start, which counts.
    ProgramGivenAtStart {
        /// Its name.
        name: Detail,
    },
    /// A program that was loaded before is not there now.
    ProgramGone {
        /// Its name.
        name: Detail,
        /// Why.
        why: Detail,
    },
    /// A curve is not executed, as on real controllers: no linear move was before it.
    CurveNotExecuted {
        /// Which step.
        step: Detail,
    },
    /// The arm stands at its point for a while: a fault.
    Dwells {
        /// How long.
        #[serde(serialize_with = "as_seconds")]
        rest: Duration,
    },

    /// The scenario has something happen.
    Happens {
        /// What.
        #[serde(serialize_with = "as_text")]
        what: Happening,
    },
    /// The scenario would have something happen, and it did not.
    DidNotHappen {
        /// What.
        #[serde(serialize_with = "as_text")]
        what: Happening,
        /// Why.
        why: DidNot,
    },
    /// An input of the scenario does not follow its output: too many are about to change.
    InputDoesNotFollow,
    /// Repetitions of the scenario were left out: too many at once.
    HappeningsLeftOut {
        /// How many.
        count: u64,
    },
    /// A fault of the scenario begins.
    FaultBegins {
        /// Which.
        #[serde(serialize_with = "as_text")]
        fault: Fault,
    },
    /// A fault of the scenario ends.
    FaultEnds {
        /// Which.
        #[serde(serialize_with = "as_text")]
        fault: Fault,
    },
    /// The mains are back.
    MainsAreBack,
    /// The program that a power cut should have left could not be chosen.
    ProgramNotChosen {
        /// Why.
        #[serde(serialize_with = "as_text")]
        why: Refused,
    },
    /// A fault struck this connection, or one of its replies.
    Struck {
        /// Which.
        #[serde(serialize_with = "as_text")]
        fault: Fault,
    },
    /// A request is not answered: a fault.
    NotAnswered {
        /// Which.
        #[serde(serialize_with = "task_as_text")]
        fault: TaskFault,
    },
    /// A query is answered with values of before: a fault.
    OldValues {
        /// Which.
        #[serde(serialize_with = "task_as_text")]
        fault: TaskFault,
    },

    /// The program that serves the controller tells of sockets, cameras and files.
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
        /// Why they are made all the same.
        why: Detail,
    },
    /// Connections are taken again.
    TakesAgain,
    /// A connection that was asked for cannot be accepted; it is tried again until it can.
    CannotAccept {
        /// Why: most likely too many files are open.
        why: Detail,
    },
    /// Connections are accepted again.
    AcceptsAgain,
    /// Few connections can wait to be accepted.
    ShortQueue {
        /// Why it could not be made longer.
        why: Detail,
    },
    /// The port cannot be opened again.
    CannotListen {
        /// Where.
        address: Detail,
        /// Why.
        why: Detail,
    },
    /// A connection to a camera was made.
    CameraConnected {
        /// Which.
        camera: Detail,
    },
    /// The connection to a camera has ended.
    CameraLost {
        /// Which.
        camera: Detail,
        /// How.
        how: Detail,
    },
    /// A camera cannot be reached; it is tried again until it is there.
    CameraUnreachable {
        /// Which.
        camera: Detail,
        /// Why.
        why: Detail,
    },
    /// The state cannot be written: nothing that changes it is acknowledged meanwhile.
    StateNotWritten {
        /// Why.
        why: Detail,
    },
    /// The state can be written again.
    StateWritten {
        /// The file.
        path: Detail,
    },
    /// The last state was not kept.
    LastStateLost {
        /// Why.
        why: Detail,
    },
    /// Somebody who watches notes something down.
    Note {
        /// What.
        text: Detail,
    },
}

/// Why the mode changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ModeReason {
    /// The program was started.
    Started,
    /// Somebody turned the key.
    KeyTurned,
    /// `actionStop`.
    ActionStop,
    /// `actionPause`.
    ActionPause,
    /// The stop button.
    StopButton,
    /// An alarm.
    Alarm,
    /// One step was to be run.
    SingleStep,
    /// One step was to be run, and there is none.
    SingleStepWithoutStep,
    /// The program has ended.
    ProgramEnded,
    /// The program has nothing to run.
    ProgramIsEmpty,
}

/// Why an alarm was raised.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "cause", rename_all = "snake_case")]
pub enum AlarmCause {
    /// No heartbreak came for too long.
    NoHeartbreak {
        /// For how long, seconds.
        seconds: f64,
    },
    /// Somebody raised it at the panel.
    Panel,
    /// A list was replaced while the arm moved.
    ListReplacedInMotion,
    /// The arm was moved by hand to its soft limit.
    MovedToLimit,
    /// This firmware raises it after `actionStop`.
    ActionStop,
    /// The emergency stop was pressed.
    EmergencyStop {
        /// The mode that the machine is in now.
        #[serde(serialize_with = "as_text")]
        mode: OperationMode,
    },
    /// A step waited for longer than it may.
    WaitedTooLong {
        /// Seconds.
        limit: f64,
        /// What the alarm means.
        meaning: Detail,
    },
    /// A step could not be carried out.
    Step {
        /// Which step; `None` where an arm in motion goes on with several.
        step: Option<Detail>,
        /// Why.
        why: Detail,
    },
    /// Something else.
    Other {
        /// What.
        why: Detail,
    },
}

/// Why something of a scenario did not happen.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "because", rename_all = "snake_case")]
pub enum DidNot {
    /// The machine refused it.
    Refused {
        /// Why.
        #[serde(serialize_with = "as_text")]
        why: Refused,
    },
    /// Too many inputs are about to change.
    TooManyInputs,
    /// There are too many counters.
    TooManyCounters {
        /// How many there are.
        limit: usize,
    },
}

/// Why a list is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListRefusal {
    /// Nobody knows this action.
    UnknownAction(i64),
    /// This firmware does not know one of the actions.
    UnsupportedAction,
    /// The instruction list has no room for so many.
    NoRoom,
    /// It would have replaced the list while the arm moves: alarm 200.
    InMotion,
    /// No program waits for remote commands.
    NotArmed,
    /// A program that takes it could not be started.
    NotStarted(&'static str),
    /// The list is full: a fault.
    ListFull,
    /// An instruction in the middle was not taken: a fault.
    InTheMiddle,
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

    /// How many instructions of a list were taken by this; `None` if it is something else.
    #[must_use]
    pub fn instructions_taken(&self) -> Option<usize> {
        match self {
            Self::ListTaken { instructions, .. }
            | Self::ListAnsweredErr { instructions }
            | Self::LateListTaken { instructions } => Some(*instructions),
            _ => None,
        }
    }

    /// Whether an AddRCC is what this tells of.
    #[must_use]
    pub fn is_about_a_list(&self) -> bool {
        match self {
            Self::ListRefused { .. } | Self::ListIgnored { .. } | Self::ListTooLong { .. } => true,
            Self::Refused { request, .. } => *request == RequestType::AddRcc,
            other => other.instructions_taken().is_some(),
        }
    }

    /// In words, on one line.
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
