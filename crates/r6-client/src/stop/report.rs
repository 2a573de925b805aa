//! The report of a stop.

use std::fmt;
use std::time::Duration;

use r6_proto::message::Command;
use r6_proto::{OperationMode, printable};

use crate::error::{Invalid, NotSent, OutcomeUnknown};
use crate::evidence::Observation;
use crate::evidence::standstill::StandProof;
use crate::identity::Identity;
use crate::job::Work;

/// The result of a stop.
#[derive(Clone, Debug, PartialEq)]
pub struct StopReport {
    /// Whether it is proved that the arm stands ([`Self::proof`]).
    pub confirmed: bool,
    /// What proves it.
    pub proof: Option<StandProof>,
    /// The last means that was sent before the standstill was proved, or before the time was up.
    pub means: Option<StopMeans>,
    /// How many stops were sent, of all means together.
    pub attempts: u32,
    /// The time until the standstill was first proved, or until the client gave up. Clearing the list comes
    /// after it, and so do further stops while a frame is in doubt.
    pub took: Duration,
    /// The robot of this report; `None` if its identity was not read.
    pub robot: Option<Identity>,
    /// The number of the connection over which all values of this report were read. A second connection
    /// ([`SecondConnection::Used`]) counts its own numbers, from 0. They cannot be compared with those of the
    /// first.
    pub connection: u64,
    /// The result of a second connection, if the first answer was late.
    pub second: Option<SecondConnection>,
    /// `isMoving` at the end.
    pub moving: Option<bool>,
    /// `curMode` at the end.
    pub mode: Option<OperationMode>,
    /// `curAlarm` at the end; 42 after a stop is usual on some firmware (reported, unit B).
    pub alarm: Option<i64>,
    /// `RemoteCmdLen` at the end.
    pub list_length: Option<i64>,
    /// What happened to the instructions that were left.
    pub list: ListAfterStop,
    /// Set if frames that can move the arm were unanswered when the stop began: what happened to them. `None`
    /// without such frames.
    pub doubt: Option<DoubtAfterStop>,
}

/// A means of stopping, in the order in which the client tries them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopMeans {
    /// The command `actionStop`.
    ActionStop,
    /// The command `stopButton`.
    StopButton,
    /// The command `actionPause`.
    ActionPause,
    /// The command `AddRCC` with an empty instruction list, which replaces the present list.
    ClearList,
}

impl StopMeans {
    /// The order in which the client tries them, because: real arms stop at once with the first; `stopButton`
    /// was seen not to stop a linear move, `actionPause` once had no effect (reported, unit B); an empty list
    /// raises an alarm while the arm moves (reported, unit A).
    pub const IN_ORDER: [Self; 4] = [Self::ActionStop, Self::StopButton, Self::ActionPause, Self::ClearList];

    /// The means with this number. After the last one the first follows again.
    pub(super) fn nth(number: usize) -> Self {
        let [first, ..] = Self::IN_ORDER;
        Self::IN_ORDER.into_iter().cycle().nth(number % Self::IN_ORDER.len()).unwrap_or(first)
    }

    /// The word for it on the wire.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::ActionStop => "actionStop",
            Self::StopButton => "stopButton",
            Self::ActionPause => "actionPause",
            Self::ClearList => "AddRCC",
        }
    }

    pub(super) fn work(self) -> Work {
        match self {
            Self::ActionStop => Work::Command(Command::ActionStop),
            Self::StopButton => Work::Command(Command::StopButton),
            Self::ActionPause => Work::Command(Command::ActionPause),
            Self::ClearList => Work::AddRcc { replace: true, instructions: Vec::new() },
        }
    }
}

/// The result of a second connection, which a stop opens when the first answer takes longer than 300 ms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SecondConnection {
    /// It answered, and all values of the report were read over it.
    Used,
    /// It answered too, but the report is about the first connection.
    Answered,
    /// It was opened, but nothing came back over it.
    Silent,
    /// It was still opening when the first connection answered.
    Opening,
    /// It could not be opened.
    NotMade(NotSent),
    /// The client did not open it: the handle accepts any controller that dials, and this controller is not
    /// identified yet. The next one might be another robot.
    Unidentified,
}

impl SecondConnection {
    /// Its word, for programs.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Used => "used",
            Self::Answered => "answered",
            Self::Silent => "silent",
            Self::Opening => "opening",
            Self::NotMade(_) => "not_made",
            Self::Unidentified => "unidentified",
        }
    }
}

/// Frames that can move the arm and had no answer when a stop began. A controller may accept them late.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DoubtAfterStop {
    /// Whether one of them is still unanswered and may still be carried out.
    pub still_open: bool,
    /// The result of clearing the list once more after that.
    pub cleared: ListAfterStop,
}

/// What happened to the instruction list after a stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ListAfterStop {
    /// The controller reported that it was empty.
    WasEmpty,
    /// It was cleared, and the controller answered ok.
    Cleared,
    /// The controller refused to clear it. Contains the reason, if the controller gave one.
    Refused(Option<String>),
    /// The request to clear it was sent, but its outcome is not known.
    Unknown(OutcomeUnknown),
    /// The client did not try to clear it.
    NotTried(NotTried),
}

impl ListAfterStop {
    /// Its word, for programs.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::WasEmpty => "was_empty",
            Self::Cleared => "cleared",
            Self::Refused(_) => "refused",
            Self::Unknown(_) => "unknown",
            Self::NotTried(_) => "not_tried",
        }
    }
}

/// Why the client did not try to clear the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotTried {
    /// It is not proved that the arm stands. Replacing the list of a moving arm raises an alarm.
    NotStanding,
    /// The controller accepts no instructions in this mode.
    Mode(OperationMode),
    /// It could not be sent.
    NotSent(NotSent),
    /// It cannot be sent with the settings of this handle.
    Invalid(Invalid),
}

impl StopReport {
    /// Takes in the values that were read last.
    pub(super) fn see(&mut self, seen: &Observation) {
        self.moving = seen.values.moving;
        self.mode = seen.values.mode;
        self.alarm = seen.values.alarm;
        self.list_length = seen.values.list_length;
    }

    /// Whether this read shows a running machine although the report says that it stands.
    pub(super) fn is_contradicted_by(&self, seen: &Observation) -> bool {
        let runs = seen.values.mode.is_some_and(OperationMode::may_run);
        match self.proof {
            Some(StandProof::NotRunning(_)) => runs || seen.values.moving == Some(true),
            Some(StandProof::EmptyList(_)) => {
                seen.values.moving == Some(true) || seen.values.list_length.is_some_and(|length| length > 0)
            }
            None => false,
        }
    }

    /// Removes the proof, because the machine was seen to run after it.
    pub(super) fn disprove(&mut self) {
        self.proof = None;
        self.confirmed = false;
    }
}

impl fmt::Display for StopReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.took.as_secs_f64();
        let sent = match self.attempts {
            1 => "sent once".to_owned(),
            times => format!("sent {times} times"),
        };
        let by = self.means.map_or("nothing", StopMeans::word);
        match self.proof {
            Some(StandProof::NotRunning(_)) => write!(f, "the arm stands ({seconds:.2} s, {sent}, by {by})")?,
            Some(StandProof::EmptyList(stood)) => write!(
                f,
                "the arm stands ({seconds:.2} s, {sent}): it has been at rest with an empty list for {:.1} s, but the \
                 controller is still in a mode in which a program of the pendant may move it",
                stood.as_secs_f64()
            )?,
            None => write!(
                f,
                "NOT CONFIRMED: it is not proved that the arm stands after {seconds:.2} s ({sent}, last {by}): use the \
                 emergency stop, then look at the pendant; last seen: {}",
                match self.moving {
                    Some(true) => "moving",
                    Some(false) => "not moving, but it may go on",
                    None => "whether it moves cannot be read",
                }
            )?,
        }
        match self.mode {
            Some(mode) => write!(f, "; mode {mode}")?,
            None => f.write_str("; mode not known")?,
        }
        match self.alarm {
            Some(0) => {}
            Some(alarm) => write!(f, "; alarm {alarm}")?,
            None => f.write_str("; alarm not known")?,
        }
        match (&self.list, self.list_length) {
            // The state counts, not the answer.
            (ListAfterStop::Cleared, Some(1..)) => {
                f.write_str("; the clearing of the list was accepted, but")?
            }
            (list, Some(length)) if length != 0 => write!(f, "; {list};")?,
            (list, _) => write!(f, "; {list}")?,
        }
        if let Some(length) = self.list_length.filter(|length| *length != 0) {
            write!(
                f,
                " {length} {} still in the list and may run at the next start: clear it before that",
                if length == 1 { "instruction is" } else { "instructions are" }
            )?;
        }
        if let Some(doubt) = &self.doubt {
            write!(f, "; {doubt}")?;
        }
        match &self.second {
            Some(second) => write!(f, "; {second}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for SecondConnection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the first answer was late; a second connection ")?;
        match self {
            Self::Used => f.write_str("was opened: it answered, and all of this was read over it"),
            Self::Answered => f.write_str("was opened: it answered, too"),
            Self::Silent => f.write_str("was opened: nothing came back over it"),
            Self::Opening => f.write_str("was being opened: the first one answered before it was there"),
            Self::NotMade(error) => write!(f, "could not be made ({error})"),
            Self::Unidentified => f.write_str(
                "was not opened: this controller has not said who it is yet, and another robot may dial next",
            ),
        }
    }
}

impl fmt::Display for DoubtAfterStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.still_open {
            return write!(
                f,
                "a frame that can move the arm is still unanswered and may be carried out yet: stay away from the arm; then {}",
                self.cleared
            );
        }
        write!(
            f,
            "one frame that can move the arm had no answer, so the stop waited until the controller could no longer carry it out; then {}",
            self.cleared
        )
    }
}

impl fmt::Display for ListAfterStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WasEmpty => f.write_str("the instruction list is empty"),
            Self::Cleared => f.write_str("the instruction list was cleared"),
            Self::Refused(Some(reason)) => {
                write!(f, "the instruction list was not cleared, refused: {}", printable(reason))
            }
            Self::Refused(None) => {
                f.write_str("the instruction list was not cleared, refused without a reason")
            }
            Self::Unknown(unknown) => {
                write!(f, "whether the instruction list was cleared is not known: {unknown}")
            }
            Self::NotTried(NotTried::NotStanding) => f.write_str("the instruction list was left as it is"),
            Self::NotTried(NotTried::Mode(mode)) => {
                write!(f, "the instruction list was left as it is, because nothing is taken in mode {mode}")
            }
            Self::NotTried(NotTried::NotSent(error)) => {
                write!(f, "the instruction list was not cleared: {error}")
            }
            Self::NotTried(NotTried::Invalid(error)) => {
                write!(f, "the instruction list was not cleared: {error}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(length: i64) -> StopReport {
        StopReport {
            confirmed: true,
            proof: Some(StandProof::NotRunning(OperationMode::Stop)),
            means: Some(StopMeans::ActionStop),
            attempts: 1,
            took: Duration::from_millis(120),
            robot: None,
            connection: 0,
            second: None,
            moving: Some(false),
            mode: Some(OperationMode::Stop),
            alarm: Some(0),
            list_length: Some(length),
            list: ListAfterStop::Refused(None),
            doubt: None,
        }
    }

    #[test]
    fn what_is_left_in_the_list_is_counted() {
        let text = |length| report(length).to_string();
        assert!(!text(0).contains("still in the list"), "{}", text(0));
        assert!(text(1).contains("; 1 instruction is still in the list and"), "{}", text(1));
        assert!(text(2).contains("; 2 instructions are still in the list and"), "{}", text(2));
        let answered = StopReport { list: ListAfterStop::Cleared, ..report(3) }.to_string();
        assert!(
            answered.contains("clearing of the list was accepted, but 3 instructions are still"),
            "{answered}"
        );
        assert!(!answered.contains("was cleared"), "{answered}");
    }

    #[test]
    fn what_is_not_proved_says_so_first_and_names_the_emergency_stop() {
        let unproved = StopReport { confirmed: false, proof: None, ..report(3) }.to_string();
        assert!(unproved.starts_with("NOT CONFIRMED: "), "{unproved}");
        assert!(unproved.contains("use the emergency stop"), "{unproved}");
    }
}
