//! Scenarios: what happens to a controller by itself, written down so that it happens again.
//!
//! A scenario is a text in TOML or JSON (`docs/SCENARIOS.md`) with a seed and three lists: a timeline of what people, other
//! masters and the mains do (`[[at]]`), inputs that react to outputs (`[[react]]`), and faults with the time in which they are
//! in force (`[[fault]]`). The same scenario, the same settings and the same input give the same bytes.

mod file;
mod run;
mod words;

use std::time::Duration;

use r6_program::Mistakes;

use crate::fault::Fault;
use crate::io::OutputPoint;
use crate::panel::PanelAction;

pub use file::HAPPENINGS;
pub(crate) use run::{LateList, ScenarioRun, Turn};

/// No list of a scenario is longer.
pub const MAX_ENTRIES: usize = 1000;

/// No scenario's text is longer, bytes: three full lists with room to spare.
pub const MAX_TEXT_BYTES: usize = 1024 * 1024;

/// A scenario, ready to run. The default one does nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scenario {
    /// The seed of whatever it leaves open.
    pub seed: u64,
    /// What happens when.
    pub timeline: Vec<Entry>,
    /// Inputs that react to outputs.
    pub reactions: Vec<Reaction>,
    /// What is broken when.
    pub faults: Vec<Window>,
}

/// Something that happens at a time, once or again and again.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// When, since the controller was switched on.
    pub at: Duration,
    /// How much later it may be, drawn anew each time.
    pub spread: Duration,
    /// How long until it happens again; `None`: once.
    pub every: Option<Duration>,
    /// How often it happens; `None`: for ever.
    pub times: Option<u32>,
    /// What.
    pub what: Happening,
}

/// What can happen to a controller.
#[derive(Clone, Debug, PartialEq)]
pub enum Happening {
    /// A person does something at the machine.
    Panel(PanelAction),
    /// A person sets an output at the pendant.
    Output(OutputPoint, bool),
    /// An input goes on and off, so many times, and ends as it is told.
    Bounce(Bounce),
    /// A counter is set at the pendant.
    Counter {
        /// Its number.
        id: u32,
        /// The count it has from now on.
        current: i64,
        /// The count it goes to; `None`: as before.
        target: Option<i64>,
    },
    /// A camera is asked for a photo.
    Photo(i64),
    /// Another master sends this frame; nobody hears the reply.
    Request(Vec<u8>),
    /// The mains fail: nobody is answered, and afterwards the connections that were there are reset.
    PowerCut {
        /// For how long, the time to start anew included.
        off: Duration,
        /// The program it starts with; `None`: the one it had.
        program: Option<String>,
    },
}

/// A contact that bounces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounce {
    /// The input.
    pub input: InputPoint,
    /// How often it changes.
    pub times: u32,
    /// Within which time.
    pub within: Duration,
    /// How it ends.
    pub on: bool,
}

/// One input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputPoint {
    /// Input X: board, point.
    X(u8, u8),
    /// Input of the EU board: point.
    Eu(u8),
}

impl InputPoint {
    /// What a person, or a machine in the cell, does to set it.
    #[must_use]
    pub fn set(self, on: bool) -> PanelAction {
        match self {
            Self::X(board, point) => PanelAction::SetInput { board, point, on },
            Self::Eu(point) => PanelAction::SetEuInput { point, on },
        }
    }
}

/// An input that reacts to an output: a cylinder that arrives, a gripper that closes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaction {
    /// The output, or M point.
    pub when: OutputPoint,
    /// To which of its changes; `None`: to both.
    pub is: Option<bool>,
    /// The input.
    pub then: InputPoint,
    /// How it is set; `None`: like the output.
    pub set: Option<bool>,
    /// How long after the change.
    pub after: Duration,
    /// How much longer it may be, drawn anew each time.
    pub spread: Duration,
}

/// A fault and the time in which it is in force.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// What is broken.
    pub fault: Fault,
    /// From when, since the controller was switched on.
    pub from: Duration,
    /// For how long; `None`: to the end.
    pub lasts: Option<Duration>,
    /// How likely it strikes, 0 to 1, each time it could.
    pub chance: f64,
}

impl Window {
    /// Whether the fault is in force this long after the controller was switched on: from its first moment, up to its last.
    #[must_use]
    pub fn is_in_force(&self, since: Duration) -> bool {
        since >= self.from && self.lasts.is_none_or(|lasts| since < self.from.saturating_add(lasts))
    }
}

impl Scenario {
    /// Whether an entry of the timeline happens again and again.
    pub(crate) fn repeats(&self, number: usize) -> bool {
        self.timeline.get(number).is_some_and(|entry| entry.every.is_some())
    }

    /// The scenario that a text describes.
    ///
    /// # Errors
    /// [`Mistakes`]: all places where the text is wrong, in which entry, and what is due there.
    pub fn read(text: &str) -> Result<Self, Mistakes> {
        file::read(text)
    }
}
