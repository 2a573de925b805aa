//! Events in English.

use std::fmt;

use super::{AlarmCause, DidNot, Event, ListRefusal, ModeReason, ShellEvent};
use crate::fault::{Fault, IgnoredStop};

/// An event, shown in English.
pub(super) struct In<'e>(pub &'e Event);

impl fmt::Display for In<'_> {
    #[expect(clippy::too_many_lines, reason = "a table: a sentence for each event")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Event::TooManyConnections { limit } => {
                write!(f, "{limit} connections are served already: this one will not be answered")
            }
            Event::NotUnderstood { problem } => write!(f, "{problem}; not answered"),
            Event::Odd { problem } => problem.fmt(f),
            Event::WithoutOneshot { instruction, stays } => {
                let taken = match stays {
                    true => "0: it stays, and the list runs again and again",
                    false => "1: it is removed once it has run",
                };
                write!(f, "instruction {instruction} has no `oneshot`: taken as {taken}")
            }
            Event::MoreOfTheKind { count } => write!(f, "and {count} more of the kind"),
            Event::ReplyCame => f.write_str("a reply came, but a controller asks nothing; not answered"),
            Event::WrongDsId { request, sent, right } => {
                write!(f, "{request}: ")?;
                match sent {
                    None => f.write_str("no `dsID`")?,
                    Some(sent) => write!(f, "`dsID` is `{sent}`")?,
                }
                match right {
                    [long, short] if long == short => write!(f, ", and should be `{long}`")?,
                    [long, short] => write!(f, ", and should be `{long}` or `{short}`")?,
                }
                f.write_str(": a real controller may not answer; not told again on this connection")
            }
            Event::WithoutType { request, done } => {
                let what = if *done { "carried out, not answered" } else { "not answered" };
                write!(f, "{request} without `reqType`: {what}")
            }
            Event::Refused { request, why } => write!(f, "{request} refused: {why}"),
            Event::CommandAccepted { command, arguments, done } => {
                command.fmt(f)?;
                arguments.iter().try_for_each(|argument| write!(f, " {argument}"))?;
                not_done(f, *done)
            }
            Event::CommandRefused { command, why } => write!(f, "command {command} refused: {why}"),
            Event::CommandWithoutEffect { why } => write!(f, "answered ok, but nothing was done: {why}"),
            Event::StopIgnored { request, how } => {
                let told = match how {
                    IgnoredStop::Err => "err",
                    IgnoredStop::Ok | IgnoredStop::Every => "ok",
                };
                write!(f, "{request}: answered {told} and not carried out (fault stop-ignored)")
            }
            Event::ListTaken { instructions, replaced, done } => {
                let how = if *replaced { "replaced" } else { "appended to" };
                match instructions {
                    1 => write!(f, "AddRCC: 1 instruction, list {how}")?,
                    count => write!(f, "AddRCC: {count} instructions, list {how}")?,
                }
                not_done(f, *done)
            }
            Event::ListAnsweredErr { instructions } => write!(
                f,
                "AddRCC: {instructions} instructions answered err, and executed: a linear move stands behind a path speed (actions 51, \
                 10), as reported of one unit"
            ),
            Event::ListComesLate { after } => {
                write!(f, "a list is taken {after:?} later, and not answered: fault late-list")
            }
            Event::LateListTaken { instructions } => {
                write!(f, "AddRCC: {instructions} instructions, late (fault late-list)")
            }
            Event::LateListNotTaken { why } => write!(f, "a late list is not taken: {why}"),
            Event::ListRefused { why } => write!(f, "AddRCC refused: {why}"),
            Event::ListIgnored { why } => write!(f, "AddRCC neither executed nor answered: {why}"),
            Event::ListTooLong { bytes, reset: true } => {
                write!(f, "AddRCC of {bytes} bytes: the connection is reset, as real controllers do")
            }
            Event::ListTooLong { bytes, reset: false } => write!(
                f,
                "AddRCC of {bytes} bytes: neither executed nor answered, as real controllers do; send fewer instructions in one \
                 list and append the rest"
            ),
            Event::PhotoAnswered { camera, ret } => write!(f, "camera {camera} answers: ret {ret}"),
            Event::PhotoRequested { camera } => write!(f, "photo requested from camera {camera}"),
            Event::PhotoLost { camera, away } => {
                let why = if *away { "the camera is not connected" } else { "no camera is connected" };
                write!(f, "photo requested from camera {camera}, but {why}: the request is lost")
            }
            Event::CameraSpeaksAsAnother { dialled, speaks_as } => {
                write!(f, "the camera that was dialled as camera {dialled} speaks as camera {speaks_as}")
            }
            Event::PointsTaken { camera, points, waiting } => {
                let plural = if *points == 1 { "point" } else { "points" };
                write!(f, "AddPoints: camera {camera} sent {points} {plural}, {waiting} wait for a program")
            }
            Event::PointsCleared { points } => write!(f, "{points} points of cameras were removed"),
            Event::PointsLost { limit } => {
                write!(
                    f,
                    "old points are lost from now on: {limit} wait already, and programs take fewer than come"
                )
            }
            Event::WarningsLeftOut { count, told } => {
                write!(f, "{count} more warnings were left out: {told} within a second are told")
            }
            Event::EventsDropped { count } => {
                write!(f, "{count} lines were dropped: they were not read in time")
            }
            Event::ModeChanged { mode, why } => write!(f, "{mode}: {}", reason(*why)),
            Event::SingleCycle => f.write_str("single cycle"),
            Event::SingleStep => f.write_str("single step"),
            Event::EndsWithCycle => f.write_str("stop button: ends with this cycle"),
            Event::AlarmRaised { alarm, why } => write!(f, "alarm {alarm}: {why}"),
            Event::AlarmCleared { alarm } => write!(f, "alarm {alarm} cleared"),
            Event::EmergencyStopReleased => f.write_str("emergency stop released"),
            Event::MovedByHand { axis, by, percent } => {
                write!(f, "by hand: {axis} by {by} at {percent} %")
            }
            Event::HeldByHand { axis, up, percent } => {
                let sign = if *up { '+' } else { '-' };
                write!(f, "by hand: {axis}{sign} at {percent} %, as long as the button is held")
            }
            Event::NotHeldAnyMore => {
                f.write_str("by hand: the button was not seen pressed any more, so the axis stops")
            }
            Event::Homing => f.write_str("homing"),
            Event::Homed => f.write_str("homed"),
            Event::ProgramLoaded { name, steps } => write!(f, "program `{name}` was loaded: {steps} steps"),
            Event::ProgramGivenAtStart { name } => write!(
                f,
                "program `{name}` was given at the start and runs in place of the program that was loaded at the panel, which is kept"
            ),
            Event::ProgramGone { name, why } => {
                write!(f, "program `{name}` was loaded at the panel, but is not there now: {why}")
            }
            Event::CurveNotExecuted { step } => write!(
                f,
                "{step}: not executed, as on real controllers: no linear move (action 10) was before it since the list was replaced \
                 or the program began"
            ),
            Event::Dwells { rest } => write!(f, "the arm stands for {rest:?} at its point (fault dwell)"),
            Event::Happens { what } => write!(f, "scenario: {what}"),
            Event::DidNotHappen { what, why } => {
                write!(f, "scenario: {what}: ")?;
                match why {
                    DidNot::Refused { why } => fmt::Display::fmt(why, f),
                    DidNot::TooManyInputs => f.write_str(TOO_MANY),
                    DidNot::TooManyCounters { limit } => write!(f, "there are {limit} already"),
                }
            }
            Event::InputDoesNotFollow => write!(f, "scenario: an input does not follow: {TOO_MANY}"),
            Event::HappeningsLeftOut { count } => {
                write!(f, "scenario: {count} happenings were left out: too many at once")
            }
            Event::FaultBegins { fault } => write!(f, "scenario: fault {fault} begins"),
            Event::FaultEnds { fault } => write!(f, "scenario: fault {fault} ends"),
            Event::MainsAreBack => f.write_str("scenario: the mains are back"),
            Event::ProgramNotChosen { why } => write!(f, "scenario: {why}"),
            Event::Struck { fault: fault @ Fault::Link(_) } => {
                write!(f, "the connection was struck by fault {fault}")
            }
            Event::Struck { fault } => write!(f, "a reply was struck by fault {fault}"),
            Event::NotAnswered { fault } => write!(f, "not answered: fault {}", Fault::Task(*fault)),
            Event::OldValues { fault } => {
                write!(f, "answered with old values: fault {}", Fault::Task(*fault))
            }
            Event::Shell(event) => shell(f, event),
        }
    }
}

const TOO_MANY: &str = "too many inputs are about to change already";

fn not_done(f: &mut fmt::Formatter<'_>, done: bool) -> fmt::Result {
    f.write_str(if done { "" } else { ": answered ok and not carried out (fault not-executed)" })
}

fn reason(why: ModeReason) -> &'static str {
    match why {
        ModeReason::Started => "started",
        ModeReason::KeyTurned => "the key was turned",
        ModeReason::ActionStop => "actionStop",
        ModeReason::ActionPause => "actionPause",
        ModeReason::StopButton => "stop button",
        ModeReason::Alarm => "alarm",
        ModeReason::SingleStep => "single step",
        ModeReason::SingleStepWithoutStep => "single step: nothing to run",
        ModeReason::ProgramEnded => "the program has ended",
        ModeReason::ProgramIsEmpty => "the program has ended: nothing to run",
    }
}

impl fmt::Display for AlarmCause {
    /// In English.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AlarmCause::NoHeartbreak { seconds } => write!(f, "no heartbreak for {seconds} s"),
            AlarmCause::Panel => f.write_str("raised at the panel"),
            AlarmCause::Scenario => f.write_str("raised by the scenario"),
            AlarmCause::ListReplacedInMotion => f.write_str("AddRCC replaced the list in mid-motion"),
            AlarmCause::MovedToLimit => f.write_str("moved by hand to the soft limit"),
            AlarmCause::ActionStop => f.write_str("actionStop"),
            AlarmCause::EmergencyStop { mode } => write!(f, "emergency stop, {mode}"),
            AlarmCause::WaitedTooLong { limit, meaning } => write!(f, "{meaning}: its limit is {limit} s"),
            AlarmCause::Step { step: Some(step), why } => write!(f, "{step}: {why}"),
            AlarmCause::Step { step: None, why } => fmt::Display::fmt(why, f),
            AlarmCause::Other { why } => fmt::Display::fmt(why, f),
        }
    }
}

impl fmt::Display for ListRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UnknownAction(action) => return write!(f, "action {action} is not known"),
            Self::UnsupportedAction => "this firmware does not know one of the actions",
            Self::NoRoom => "the instruction list has no room for so many instructions",
            Self::InMotion => "the list was replaced in mid-motion: alarm 200",
            Self::NotArmed => {
                "no program waits for remote commands: the mode is not 7, an alarm is present, or another program than `remote` is \
                 in use, which does something else now"
            }
            Self::NotStarted(why) => why.reason(),
            Self::ListFull => "the instruction list is full",
            Self::InTheMiddle => "an instruction in the middle of the list was not taken",
        })
    }
}

fn shell(f: &mut fmt::Formatter<'_>, event: &ShellEvent) -> fmt::Result {
    match event {
        ShellEvent::Refuses => f.write_str("connections are refused"),
        ShellEvent::GivesNoAnswer => f.write_str("attempts to connect get no answer"),
        ShellEvent::DoesNotServe { why } => {
            write!(f, "connections are not served, but they are made: {why}")
        }
        ShellEvent::TakesAgain => f.write_str("connections are taken again"),
        ShellEvent::CannotAccept { why } => {
            write!(f, "a connection cannot be accepted: {why}; it is tried until it can")
        }
        ShellEvent::AcceptsAgain => f.write_str("connections can be accepted again"),
        ShellEvent::ShortQueue { why } => write!(f, "few connections can wait to be accepted: {why}"),
        ShellEvent::CannotListen { address, why } => {
            write!(f, "cannot listen on {address} again: {why}; it is tried until it can")
        }
        ShellEvent::CameraConnected { camera } => write!(f, "connected to {camera}"),
        ShellEvent::CameraLost { camera, how } => write!(f, "{camera} is lost: {how}"),
        ShellEvent::CameraUnreachable { camera, why } => {
            write!(f, "{camera} cannot be reached: {why}; it is tried again until it is there")
        }
        ShellEvent::StateNotWritten { why } => {
            write!(f, "{why}; nothing that changes the state is acknowledged until it can be written")
        }
        ShellEvent::StateWritten { path } => write!(f, "{path} can be written again"),
        ShellEvent::LastStateLost { why } => write!(f, "the last state was not kept: {why}"),
        ShellEvent::Note { text } => fmt::Display::fmt(text, f),
    }
}
