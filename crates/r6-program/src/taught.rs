//! Taught programs (molds), which run on the controller itself, before, between and after the instructions of
//! a PC.
//!
//! A program is a text in TOML or JSON (`docs/PROGRAMS.md`): a list of steps. Most steps are the instructions
//! that AddRCC sends. Other steps exist only in taught programs: waits for remote commands, photos, points,
//! stacks, counters, registers, jumps and calls.

mod read;
mod words;

use r6_proto::RegisterIndex;
use r6_proto::alarm::AlarmCode;
use r6_proto::io_point::IoPoint;
use r6_proto::message::Action;
use r6_proto::message::instruction::{Coordinates, Manner, Wait, WaitSource};

use crate::Mistakes;

pub(crate) use read::each_reads;
pub use read::step_words;

/// The number of tools and workbenches: 0 to 31. We chose this limit, because the manual gives none.
pub const MAX_FRAMES: u32 = 32;

/// The number of stacks: 0 to 31. We chose this limit, because the manual gives none.
pub const MAX_STACKS: u32 = 32;

/// The maximum number of steps of a program. The longest taught programs have some hundred.
pub const MAX_STEPS: usize = 1000;

/// The maximum length of a program's text, in bytes: enough for more than a thousand steps.
pub const MAX_TEXT_BYTES: usize = 256 * 1024;

/// The maximum length of a program's name, in bytes, because the reply with `curMold` is one small frame.
pub const MAX_NAME_BYTES: usize = 64;

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
    /// The target count.
    pub target: i64,
    /// The current count.
    pub current: i64,
}

/// One step.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// An instruction that AddRCC could send too: moves, outputs, path speed, stop on signal, workbench,
    /// waits for a time.
    Instruction(Action),
    /// A wait for a point.
    Wait {
        /// The point, the condition and the limit.
        wait: Wait,
        /// A single cycle skips the wait, because the cycle itself is the signal to begin.
        skip_in_single_cycle: bool,
        /// The step to continue at when the time is over. Without it, the timeout raises an alarm.
        or_else: Option<usize>,
    },
    /// Sets an output or M point of a further board.
    Set {
        /// The point.
        point: IoPoint,
        /// Its new state.
        on: bool,
    },
    /// A move to the place given by six registers, each × 1000 (path from address: base 800, length 6).
    MoveToRegisters {
        /// The first register.
        first: RegisterIndex,
        /// Whether the registers hold a pose, not axes.
        pose: bool,
        /// Speed, delay, blend level and frames of the move.
        manner: Manner,
    },
    /// Takes the oldest point of a camera. It waits if no point has arrived yet.
    TakePoint {
        /// The camera.
        camera: i64,
        /// Takes only points of this template.
        model: Option<i64>,
        /// How long to wait, in seconds; for ever without it.
        limit: Option<f64>,
        /// The step to continue at if there is no point now. Without it, the step waits.
        or_else: Option<usize>,
    },
    /// A linear move to the last taken point.
    MoveToPoint {
        /// Height above the point, mm.
        above: f64,
        /// Speed, delay, blend level and frames of the move.
        manner: Manner,
    },
    /// A linear move to the place in a stack given by a counter.
    MoveToStack {
        /// The stack.
        stack: u32,
        /// The counter. Its current value is the number of the place, from 0.
        counter: u32,
        /// The pose of the first place.
        first: Coordinates,
        /// Height above the place, mm.
        above: f64,
        /// Speed, delay, blend level and frames of the move.
        manner: Manner,
    },
    /// Waits until one of several registers is written.
    WaitForRegisters {
        /// The first register.
        first: RegisterIndex,
        /// The number of registers.
        count: u16,
        /// How long to wait, in seconds; for ever without it.
        limit: Option<f64>,
    },
    /// Requests a photo.
    Photo(Photo),
    /// Raises an alarm.
    Alarm {
        /// Its number.
        number: AlarmCode,
    },
    /// Switches to another tool.
    Tool(u32),
    /// Changes a counter.
    Counter {
        /// The counter.
        id: u32,
        /// The change.
        change: Change,
    },
    /// Changes a register.
    Register {
        /// The register.
        register: RegisterIndex,
        /// The change.
        change: Change,
    },
    /// Waits for remote commands and executes them until none is left (pendant action 1004).
    Remote,
    /// A target of jumps. It does nothing.
    Label,
    /// Continues at another step.
    Jump(usize),
    /// Continues at another step if a condition holds.
    If {
        /// The condition.
        condition: Condition,
        /// The step.
        to: usize,
    },
    /// Runs another program, then continues with the next step.
    Call(String),
    /// Returns to the calling program, or ends the cycle.
    Return,
    /// Ends the cycle from any depth of calls.
    End,
}

/// A photo request of a program (manual 5.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photo {
    /// The camera.
    pub camera: i64,
    /// How long it waits for the answer, in seconds. Without it, it does not wait.
    pub limit: Option<f64>,
    /// The maximum number of requests.
    pub tries: u32,
    /// The alarm if no request succeeds.
    pub alarm: AlarmCode,
}

/// How a counter or register changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Sets this value.
    To(i64),
    /// Adds this value.
    By(i64),
}

/// The condition of an `if`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// Whether a point is on (`true`) or off (`false`).
    Point(WaitSource, bool),
    /// Whether the comparison holds for a counter.
    Counter(u32, Compare),
    /// Whether a counter has reached its target, which is above 0.
    CounterReached(u32),
    /// Whether the comparison holds for a register.
    Register(RegisterIndex, Compare),
    /// Whether a camera has sent a point that is not yet taken, of any template or of one template.
    Points(i64, Option<i64>),
    /// Whether a counter is past the last place of a stack.
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
    /// At least this number.
    AtLeast(i64),
    /// Below this number.
    Below(i64),
    /// Equal to this number.
    Equals(i64),
}

impl Compare {
    /// Whether the comparison holds for `value`.
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
    /// Reads a program from a text in TOML or JSON. A text that begins with `{` is JSON.
    ///
    /// # Errors
    /// [`Mistakes`]: all wrong places of the text, with the step and what is valid there.
    pub fn read(name: &str, text: &str) -> Result<Self, Mistakes> {
        read::program(name, text)
    }

    /// A hint for its author: old spellings in the text.
    #[must_use]
    pub fn hint(&self) -> Option<&str> {
        self.hint.as_deref()
    }

    /// Its name, as `curMold` reports it.
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

    /// The counters that it defines: number, counter.
    #[must_use]
    pub fn counters(&self) -> &[(u32, CounterState)] {
        &self.counters
    }

    /// The stacks that it defines: number, stack.
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
