//! Scenarios: events that happen to a controller, written down so that they can be repeated.
//!
//! A scenario is a text in TOML or JSON (`docs/SCENARIOS.md`) with a seed and three lists: a timeline of what
//! operators, other masters and the mains do (`[[at]]`), inputs that react to outputs (`[[react]]`), and
//! faults with the time in which they are in force (`[[fault]]`). The same scenario, settings and input give
//! the same bytes.
//!
//! - `scenario/file.rs` reads the text.
//! - `scenario/run.rs` knows what is due next, and draws what the text leaves open.
//! - `controller/advance.rs` lets time pass from one due event to the next, of the machine and of the
//!   scenario. It works the same way without a scenario.
//! - `controller/scenario.rs` does what the scenario says: power cuts in `controller/scenario/power.rs`,
//!   requests while a fault is in force in `controller/scenario/broken.rs`.

mod file;
mod run;
mod words;

use std::time::Duration;

use r6_program::Mistakes;
use r6_program::form::{Fields, Found};

use crate::fault::Fault;
use crate::io::OutputPoint;
use crate::panel::PanelAction;

pub use file::HAPPENINGS;
pub(crate) use run::{LateList, MAX_GIVEN, ScenarioRun, Turn};

/// The most entries of each list of a scenario.
pub const MAX_ENTRIES: usize = 1000;

/// The longest text of a scenario, in bytes: three full lists with room to spare.
pub const MAX_TEXT_BYTES: usize = 1024 * 1024;

/// A scenario, ready to run. The default does nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scenario {
    /// The seed of its random values.
    pub seed: u64,
    /// The events and their times.
    pub timeline: Vec<Entry>,
    /// Inputs that react to outputs.
    pub reactions: Vec<Reaction>,
    /// The faults and their times.
    pub faults: Vec<Window>,
}

/// An event at a time, once or repeated.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// When, since the controller was switched on.
    pub at: Duration,
    /// How much later it may happen, drawn again each time.
    pub spread: Duration,
    /// The time between repetitions; `None` if it happens once.
    pub every: Option<Duration>,
    /// How often it happens; `None` for no limit.
    pub times: Option<u32>,
    /// What happens.
    pub what: Happening,
}

/// What can happen to a controller.
#[derive(Clone, Debug, PartialEq)]
pub enum Happening {
    /// An operator does something at the machine.
    Panel(PanelAction),
    /// An operator sets an output at the pendant.
    Output(OutputPoint, bool),
    /// An input changes several times, and ends at a given level.
    Bounce(Bounce),
    /// An operator sets a counter at the pendant.
    Counter {
        /// Its number.
        id: u32,
        /// Its new count.
        current: i64,
        /// Its new target; `None` to keep the target.
        target: Option<i64>,
    },
    /// A camera is asked for a photo.
    Photo(i64),
    /// Another master sends this frame; it does not read the reply.
    Request(Vec<u8>),
    /// The mains fail: nothing is answered, and when the mains are back, the old connections are reset.
    PowerCut {
        /// How long, including the time to start again.
        off: Duration,
        /// The program it starts with; `None` for the one it had.
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
    /// The time in which it changes.
    pub within: Duration,
    /// Its level at the end.
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
    /// The action of an operator, or of a machine in the cell, that sets it.
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
    /// The change that counts: to on or to off; `None` for both.
    pub is: Option<bool>,
    /// The input that reacts.
    pub then: InputPoint,
    /// The new level of the input; `None` for the level of the output.
    pub set: Option<bool>,
    /// The delay after the change.
    pub after: Duration,
    /// How much longer the delay may be, drawn again each time.
    pub spread: Duration,
}

/// A fault and the time in which it is in force.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// The fault.
    pub fault: Fault,
    /// The beginning, since the controller was switched on.
    pub from: Duration,
    /// The duration; `None` for no end.
    pub lasts: Option<Duration>,
    /// How likely it strikes each time it can, 0 to 1.
    pub chance: f64,
}

impl Window {
    /// Whether the fault is in force this long after the controller was switched on: from its beginning
    /// (included) to its end (excluded).
    #[must_use]
    pub fn is_in_force(&self, since: Duration) -> bool {
        since >= self.from && self.lasts.is_none_or(|lasts| since < self.from.saturating_add(lasts))
    }
}

impl Scenario {
    /// Whether an entry of the timeline repeats.
    pub(crate) fn repeats(&self, number: usize) -> bool {
        self.timeline.get(number).is_some_and(|entry| entry.every.is_some())
    }

    /// Reads a scenario from a text.
    ///
    /// # Errors
    /// [`Mistakes`]: all places where the text is wrong, in which entry, and what is expected there.
    pub fn read(text: &str) -> Result<Self, Mistakes> {
        file::read(text)
    }

    /// Reads the lists `at`, `react` and `fault` of a table of another file. The caller finishes the table,
    /// and sets the seed. `label` is the prefix of each mistake, which is noted in `found`.
    #[must_use]
    pub fn of_table(table: &Fields<'_>, label: &str, found: &mut Found<'_>) -> Self {
        file::lists(table, label, found)
    }
}
