//! Taught programs (molds): what runs on the controller itself, between and around what a PC sends.
//!
//! A program is a text in TOML or JSON (`docs/PROGRAMS.md`): a list of steps, most of them the instructions that AddRCC
//! sends, and those that only a taught program has: waits for remote commands, photos, points, stacks, counters,
//! registers, jumps and calls.

mod read;
mod words;

use r6_proto::RegisterIndex;
use r6_proto::io_point::IoPoint;
use r6_proto::message::Action;
use r6_proto::message::instruction::{Coordinates, Manner, Wait, WaitSource};

use crate::Mistakes;
use crate::form::{self, Table};

pub use read::step_words;

/// How many tools and workbenches there are: 0 to 31. Chosen; the manual names no number.
pub const MAX_FRAMES: u32 = 32;

/// How many stacks there are: 0 to 31. Chosen; the manual names no number.
pub const MAX_STACKS: u32 = 32;

/// No program has more steps. The longest taught programs have some hundred.
pub const MAX_STEPS: usize = 1000;

/// No program's text is longer, bytes: a thousand steps with room to spare.
pub const MAX_TEXT_BYTES: usize = 256 * 1024;

/// No name of a program is longer, bytes: `curMold` is answered in one small frame.
pub const MAX_NAME_BYTES: usize = 64;

/// Whether a text is meant as a taught program: a document with `step` and without `instruction`. It may be wrong
/// in other ways.
#[must_use]
pub fn is_taught(text: &str) -> bool {
    // Reading a long list of instructions twice would take time.
    let may_be = text.len() <= MAX_TEXT_BYTES || text.contains("[[step]]");
    let has = |document: &Table, key| document.value(key).is_some();
    may_be && {
        let (document, _) = form::parse(text);
        has(&document, "step") && !["instruction", "instructions"].iter().any(|key| has(&document, key))
    }
}

/// A program, ready to run. The default one has no name and no steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    name: String,
    text: String,
    steps: Vec<Step>,
    stacks: Vec<(u32, Stack)>,
    counters: Vec<(u32, CounterState)>,
    hint: Option<String>,
}

/// A stack (palletising pattern).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stack {
    /// Spacing in X, Y, Z, mm.
    pub spacing: [f64; 3],
    /// Count in X, Y, Z.
    pub count: [u32; 3],
}

/// A counter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CounterState {
    /// The count it goes to.
    pub target: i64,
    /// The count it has.
    pub current: i64,
}

/// One step.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// What AddRCC could send too: moves, outputs, path speed, stop on signal, workbench, waits for a time.
    Instruction(Action),
    /// A wait for a point.
    Wait {
        /// What for.
        wait: Wait,
        /// A single cycle goes on without it: it is itself the sign to begin.
        skip_in_single_cycle: bool,
        /// Where to go on when the time is over; without it that is an alarm.
        or_else: Option<usize>,
    },
    /// An output or M point of a further board is set.
    Set {
        /// Which.
        point: IoPoint,
        /// To what.
        on: bool,
    },
    /// A move to the place that six registers tell, each × 1000 (path from address: base 800, length 6).
    MoveToRegisters {
        /// The first register.
        first: RegisterIndex,
        /// They tell a pose, not axes.
        pose: bool,
        /// How it goes there.
        manner: Manner,
    },
    /// Takes the oldest point of a camera, waiting for one.
    TakePoint {
        /// The camera.
        camera: i64,
        /// Only points of this template.
        model: Option<i64>,
        /// For how long, seconds; for ever without it.
        limit: Option<f64>,
        /// Where to go on at once when there is none; without it, it waits.
        or_else: Option<usize>,
    },
    /// A linear move to the point that was taken.
    MoveToPoint {
        /// So many mm above it.
        above: f64,
        /// How it goes there.
        manner: Manner,
    },
    /// A linear move to the place in a stack that a counter tells.
    MoveToStack {
        /// The stack.
        stack: u32,
        /// The counter: its current value is the place, from 0.
        counter: u32,
        /// The pose of the first place.
        first: Coordinates,
        /// So many mm above the place.
        above: f64,
        /// How it goes there.
        manner: Manner,
    },
    /// A wait until one of some registers is written.
    WaitForRegisters {
        /// The first register.
        first: RegisterIndex,
        /// How many.
        count: u16,
        /// For how long, seconds; for ever without it.
        limit: Option<f64>,
    },
    /// A photo is asked for.
    Photo(Photo),
    /// An alarm is raised.
    Alarm {
        /// Its number.
        number: u32,
    },
    /// Another tool.
    Tool(u32),
    /// A counter is changed.
    Counter {
        /// The counter.
        id: u32,
        /// How.
        change: Change,
    },
    /// A register is changed.
    Register {
        /// The register.
        register: RegisterIndex,
        /// How.
        change: Change,
    },
    /// Remote commands are waited for and carried out until none is left (pendant action 1004).
    Remote,
    /// A place to jump to; does nothing.
    Label,
    /// Goes on at another step.
    Jump(usize),
    /// Goes on at another step if something is so.
    If {
        /// What.
        condition: Condition,
        /// Where.
        to: usize,
    },
    /// Another program, then the next step.
    Call(String),
    /// Back to the program that called, or the end.
    Return,
    /// The end of the cycle, from any depth of calls.
    End,
}

/// A photo that a program asks for (manual 5.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photo {
    /// The camera.
    pub camera: i64,
    /// How long it waits for the answer, seconds; it does not wait without it.
    pub limit: Option<f64>,
    /// How often it asks at most.
    pub tries: u32,
    /// The alarm when every try was in vain.
    pub alarm: u32,
}

/// How a counter or register changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// To this value.
    To(i64),
    /// By so much.
    By(i64),
}

/// What an `if` asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// Whether a point is on, or off.
    Point(WaitSource, bool),
    /// Whether a counter compares so.
    Counter(u32, Compare),
    /// Whether a counter has reached its target, which is above 0.
    CounterReached(u32),
    /// Whether a register compares so.
    Register(RegisterIndex, Compare),
    /// Whether a camera has sent a point that nobody took, of any template or one.
    Points(i64, Option<i64>),
    /// Whether a counter is beyond the last place of a stack.
    StackFull {
        /// The stack.
        stack: u32,
        /// The counter.
        counter: u32,
    },
}

/// A comparison with a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compare {
    /// Not below it.
    AtLeast(i64),
    /// Below it.
    Below(i64),
    /// It.
    Equals(i64),
}

impl Compare {
    /// Whether `value` compares so.
    #[must_use]
    pub const fn holds(self, value: i64) -> bool {
        match self {
            Self::AtLeast(than) => value >= than,
            Self::Below(than) => value < than,
            Self::Equals(than) => value == than,
        }
    }
}

impl Program {
    /// The program that a text in TOML or JSON describes; a text that begins with `{` is JSON.
    ///
    /// # Errors
    /// [`Mistakes`]: all places where the text is wrong, in which step, and what is due there.
    pub fn read(name: &str, text: &str) -> Result<Self, Mistakes> {
        read::program(name, text)
    }

    /// What its author should know: which spellings of the text are older ones.
    #[must_use]
    pub fn hint(&self) -> Option<&str> {
        self.hint.as_deref()
    }

    /// Its name: what `curMold` tells.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text it was read from.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Its steps.
    #[must_use]
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The counters it brings along: number, counter.
    #[must_use]
    pub fn counters(&self) -> &[(u32, CounterState)] {
        &self.counters
    }

    /// The stacks it brings along: number, stack.
    #[must_use]
    pub fn stacks(&self) -> &[(u32, Stack)] {
        &self.stacks
    }

    /// The programs it calls.
    pub fn calls(&self) -> impl Iterator<Item = &str> {
        self.steps.iter().filter_map(|step| match step {
            Step::Call(name) => Some(name.as_str()),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests;
