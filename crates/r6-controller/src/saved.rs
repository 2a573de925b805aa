//! The state that a power cut leaves: the part of a controller's state that its shell saves on disk, as JSON.
//!
//! These survive: programs loaded at the panel, counters, registers written with `savable` 1, tools,
//! workbenches and which of them are in use, stacks, which program is in use (other programs come from their
//! files), and the mode. These do not: alarm, inputs and outputs, the list, speeds and ramps, points of
//! cameras, and registers written with `savable` 0. Such a register gets back its saved value, if it has one.
//! The position of the arm does not survive either: it is at zero again, and homed if the settings say so. A
//! machine that was running comes back in automatic, not running, because nothing may move on its own after a
//! power cut. All of that is chosen, except `savable` (manual 4.2.1 #13, #14).

use std::collections::BTreeMap;
use std::fmt;

use r6_motion::{Frame, Pose};
use r6_proto::OperationMode;
use r6_proto::address::RegisterIndex;
use serde::{Deserialize, Serialize};

use crate::machine::{CounterState, MAX_FRAMES, MAX_STACKS, Machine, Placed, Stack};
use crate::program::{MAX_LOADED_BYTES, MAX_NAME_BYTES, MAX_PROGRAMS, Program};

/// The newest version that is written and read. Version 2 adds `programs`. A state without programs is
/// written as version 1, because older releases can read that without loss.
pub const SAVED_VERSION: u64 = 2;

/// How many counters are read at most; real controllers show a dozen.
pub(crate) const MAX_COUNTERS: usize = 1000;

/// The largest count. A float on the wire is exact up to here; a counter may count further.
pub(crate) const MAX_COUNT: i64 = 1 << 53;

/// The state of a controller after a power cut. A state from [`SavedState::from_json`] is within all bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedState {
    version: u64,
    mode: SavedMode,
    mold: String,
    counters: BTreeMap<u32, SavedCounter>,
    registers: BTreeMap<u16, i64>,
    tool: u32,
    bench: u32,
    tools: BTreeMap<u32, [f64; 6]>,
    benches: BTreeMap<u32, [f64; 6]>,
    stacks: BTreeMap<u32, SavedStack>,
    /// The texts of the programs that were loaded at the panel.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    programs: BTreeMap<String, String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum SavedMode {
    Manual,
    Stop,
    Auto,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedCounter {
    target: i64,
    current: i64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedStack {
    spacing: [f64; 3],
    count: [u32; 3],
}

/// Why a saved state cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SavedError {
    /// A newer release wrote it: it must not be overwritten.
    Newer {
        /// Its version.
        version: u64,
    },
    /// It is not a valid state: cut off, damaged, or not from this program.
    Damaged {
        /// The field, such as `counters.3.current`; `.` for the whole.
        field: String,
        /// What is there, and what is expected.
        problem: String,
    },
}

impl fmt::Display for SavedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Newer { version } => {
                write!(f, "`version` is {version}: a newer r6 wrote it, this one reads up to {SAVED_VERSION}")
            }
            Self::Damaged { field, problem } if field == "." => f.write_str(problem),
            Self::Damaged { field, problem } => write!(f, "`{field}`: {problem}"),
        }
    }
}

impl std::error::Error for SavedError {}

/// The only field that is read from a state of any version.
#[derive(Deserialize)]
struct AnyVersion {
    version: u64,
}

impl SavedState {
    /// Reads a saved state.
    ///
    /// # Errors
    /// [`SavedError`] names the field, its value and what is expected.
    pub fn from_json(text: &str) -> Result<Self, SavedError> {
        let AnyVersion { version } = read(text)?;
        if version > SAVED_VERSION {
            return Err(SavedError::Newer { version });
        }
        if version < 1 {
            return Err(damaged("version", version, &format!("1 to {SAVED_VERSION}")));
        }
        let state: Self = read(text)?;
        state.check()?;
        Ok(state)
    }

    /// The state as JSON that [`Self::from_json`] and people can read.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Maps with whole numbers as keys, texts and finite numbers: JSON has a form for all of them.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    fn check(&self) -> Result<(), SavedError> {
        at_most("counters", self.counters.len(), MAX_COUNTERS)?;
        for (id, counter) in &self.counters {
            for (name, count) in [("target", counter.target), ("current", counter.current)] {
                if !(-MAX_COUNT..=MAX_COUNT).contains(&count) {
                    let wanted = format!("a count from -{MAX_COUNT} to {MAX_COUNT}");
                    return Err(damaged(&format!("counters.{id}.{name}"), count, &wanted));
                }
            }
        }
        for number in self.registers.keys() {
            if RegisterIndex::new(*number).is_none() {
                return Err(damaged("registers", number, "registers 800 to 900"));
            }
        }
        for (field, frames) in [("tools", &self.tools), ("benches", &self.benches)] {
            for (number, offset) in frames {
                below(field, *number, MAX_FRAMES)?;
                if placed(offset).is_none() {
                    let wanted = "six finite numbers within a million, mm and degrees";
                    return Err(damaged(&format!("{field}.{number}"), format!("{offset:?}"), wanted));
                }
            }
        }
        for (field, number) in [("tool", self.tool), ("bench", self.bench)] {
            below(field, number, MAX_FRAMES)?;
        }
        for number in self.stacks.keys() {
            below("stacks", *number, MAX_STACKS)?;
        }
        if self.mold.len() > MAX_NAME_BYTES {
            let wanted = format!("a name of at most {MAX_NAME_BYTES} bytes");
            return Err(damaged("mold", format!("a name of {} bytes", self.mold.len()), &wanted));
        }
        self.check_programs()
    }

    fn check_programs(&self) -> Result<(), SavedError> {
        at_most("programs", self.programs.len(), MAX_PROGRAMS)?;
        let bytes: usize = self.programs.values().map(String::len).sum();
        if bytes > MAX_LOADED_BYTES {
            let wanted = format!("at most {MAX_LOADED_BYTES} bytes");
            return Err(damaged("programs", format!("a text of {bytes} bytes in all"), &wanted));
        }
        for (name, text) in &self.programs {
            Program::read(name, text).map_err(|error| SavedError::Damaged {
                field: format!("programs.{name}"),
                problem: error.to_string(),
            })?;
        }
        Ok(())
    }
}

/// Reads JSON, and names the field of an error.
fn read<'t, T: Deserialize<'t>>(text: &'t str) -> Result<T, SavedError> {
    let mut json = serde_json::Deserializer::from_str(text);
    let whole =
        |error: serde_json::Error| SavedError::Damaged { field: ".".to_owned(), problem: error.to_string() };
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let field = error.path().to_string();
        SavedError::Damaged { field, problem: error.into_inner().to_string() }
    })?;
    json.end().map_err(whole)?;
    Ok(value)
}

fn damaged(field: &str, value: impl fmt::Display, wanted: &str) -> SavedError {
    SavedError::Damaged { field: field.to_owned(), problem: format!("{value} is there; wanted: {wanted}") }
}

fn at_most(field: &str, count: usize, most: usize) -> Result<(), SavedError> {
    if count <= most {
        return Ok(());
    }
    Err(damaged(field, format!("{count} of them"), &format!("at most {most}")))
}

fn below(field: &str, number: u32, end: u32) -> Result<(), SavedError> {
    if number < end {
        return Ok(());
    }
    Err(damaged(field, number, &format!("numbers 0 to {}", end - 1)))
}

fn placed(offset: &[f64; 6]) -> Option<Placed> {
    let frame = Frame::at(&Pose::from_components(*offset)).ok()?;
    Some(Placed { offset: *offset, frame })
}

impl Machine {
    /// The state that a power cut would leave now.
    #[must_use]
    pub fn saved(&self) -> SavedState {
        let offsets = |frames: &BTreeMap<u32, Placed>| {
            frames.iter().map(|(number, placed)| (*number, placed.offset)).collect()
        };
        let counter = |counter: &CounterState| SavedCounter {
            target: counter.target.clamp(-MAX_COUNT, MAX_COUNT),
            current: counter.current.clamp(-MAX_COUNT, MAX_COUNT),
        };
        SavedState {
            version: if self.programs.loaded.is_empty() { 1 } else { SAVED_VERSION },
            mode: self.saved_mode(),
            mold: self.programs.mold.clone(),
            counters: self.counters.iter().map(|(id, state)| (*id, counter(state))).collect(),
            registers: self.registers.saved.iter().map(|(index, value)| (index.number(), *value)).collect(),
            tool: self.frames.tool,
            bench: self.frames.bench,
            tools: offsets(&self.frames.tools),
            benches: offsets(&self.frames.benches),
            stacks: self
                .stacks
                .iter()
                .map(|(number, stack)| (*number, SavedStack { spacing: stack.spacing, count: stack.count }))
                .collect(),
            programs: (*self.programs.loaded).clone(),
        }
    }

    /// A number that changes whenever [`Self::saved`] may have changed. It is cheap enough to compute after
    /// every call.
    #[must_use]
    pub fn saved_mark(&self) -> u64 {
        let kept = [
            self.counters.changes(),
            self.registers.saved.changes(),
            self.frames.tools.changes(),
            self.frames.benches.changes(),
            self.stacks.changes(),
            self.programs.loaded.changes(),
            self.starts,
        ];
        let small = [self.saved_mode() as u64, u64::from(self.frames.tool), u64::from(self.frames.bench)];
        let mut mark = Mark::new();
        kept.into_iter().chain(small).for_each(|number| mark.take(&number.to_le_bytes()));
        mark.take(self.programs.mold.as_bytes());
        mark.0
    }

    /// Takes the state that a power cut left, before the machine is switched on.
    pub(crate) fn restore(&mut self, saved: &SavedState) {
        let frames = |offsets: &BTreeMap<u32, [f64; 6]>| {
            offsets.iter().filter_map(|(number, offset)| Some((*number, placed(offset)?))).collect()
        };
        self.mode = match saved.mode {
            SavedMode::Manual => OperationMode::Manual,
            SavedMode::Stop => OperationMode::Stop,
            SavedMode::Auto => OperationMode::Auto,
        };
        self.restore_programs(&saved.programs);
        // If the file of the saved program was not given this time, the program from the settings stays in
        // use.
        if self.programs.library.named(&saved.mold).is_some() {
            self.programs.mold.clone_from(&saved.mold);
        }
        *self.counters = saved
            .counters
            .iter()
            .map(|(id, counter)| (*id, CounterState { target: counter.target, current: counter.current }))
            .collect();
        let registers = saved.registers.iter();
        *self.registers.saved =
            registers.filter_map(|(number, value)| Some((RegisterIndex::new(*number)?, *value))).collect();
        self.registers.values.clone_from(&self.registers.saved);
        (self.frames.tool, self.frames.bench) = (saved.tool, saved.bench);
        *self.frames.tools = frames(&saved.tools);
        *self.frames.benches = frames(&saved.benches);
        *self.stacks = saved
            .stacks
            .iter()
            .map(|(number, stack)| (*number, Stack { spacing: stack.spacing, count: stack.count }))
            .collect();
    }

    fn saved_mode(&self) -> SavedMode {
        match self.mode {
            OperationMode::Manual => SavedMode::Manual,
            OperationMode::Auto
            | OperationMode::Running
            | OperationMode::SingleStep
            | OperationMode::SingleCycle => SavedMode::Auto,
            OperationMode::Stop | OperationMode::None | OperationMode::Unknown(_) => SavedMode::Stop,
        }
    }
}

/// A hash of bytes (FNV-1a).
struct Mark(u64);

impl Mark {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
