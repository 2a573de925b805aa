//! The store of the history: chunks, tails and events, in a file or more for each day, and averages of days
//! ([`averages`]).
//!
//! [`HistoryStore`] is the contract; every implementation passes the same tests (`history/contract.rs`). The
//! history has files of its own, so that nothing that is written for a command waits behind samples.

mod average_files;
pub mod averages;
#[cfg(test)]
mod contract;
mod days;
mod file;
#[cfg(test)]
mod memory;
mod place;
mod table;

use r6_proto::Address;

use super::StoreError;
use crate::core::history::block::{Summary, Write};
use crate::core::history::event::Event;
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::core::owner::Claim;

pub use averages::{AskAverages, AverageFile, AverageRow, AverageStore, DayNote, DayState};
pub use days::{Days, file_names, is_file_name};
#[cfg(test)]
pub use memory::MemoryDays;
pub use place::Place;

/// One file: a part of a day.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Part {
    /// The day: days since 1970, UTC.
    pub day: i64,
    /// The number of the part, from 1.
    pub number: u32,
}

/// A chunk in the store, without its bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its file.
    pub part: Part,
    /// Its row there.
    pub row: i64,
    /// What is in it.
    pub summary: Summary,
}

/// The tail of a robot in a file: what was in its open blocks when the process ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Tail {
    /// The file.
    pub part: Part,
    /// The robot.
    pub robot: RobotName,
    /// Its rows, oldest first.
    pub rows: Vec<Vec<u8>>,
}

/// Chunks of one signal.
#[derive(Clone, Copy, Debug)]
pub struct Ask<'a> {
    /// The robot.
    pub robot: &'a RobotName,
    /// The signal.
    pub address: Address,
    /// Only chunks that begin at this time or later,
    pub from: Micros,
    /// and before this one.
    pub to: Micros,
}

/// Events of one robot.
#[derive(Clone, Copy, Debug)]
pub struct AskEvents<'a> {
    /// The robot.
    pub robot: &'a RobotName,
    /// Only events behind this time and row,
    pub after: (Micros, i64),
    /// and before this time.
    pub to: Micros,
}

/// An event in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeptEvent {
    /// Its file.
    pub part: Part,
    /// Its row there, from 1.
    pub row: i64,
    /// When it was seen.
    pub time: Micros,
    /// The event; `None` if it cannot be read.
    pub event: Option<Event>,
}

/// A place for chunks, tails and events. What a method wrote survives the end of the process when it returns;
/// whether it survives a power cut, too, is not promised.
pub trait HistoryStore: Send {
    /// Writes into the newest part of a day, all or nothing. A chunk or an event that is there already stays
    /// once.
    ///
    /// # Errors
    /// [`StoreError`]: nothing was written, or that is unknown.
    fn write(&mut self, day: i64, writes: &[(RobotName, Write)]) -> Result<(), StoreError>;

    /// The same, into a part that has a tail of the robot: makes chunks of the tail.
    ///
    /// # Errors
    /// [`StoreError`].
    fn write_part(&mut self, part: Part, writes: &[(RobotName, Write)]) -> Result<(), StoreError>;

    /// Lets the next write of this day begin a new part. All tails of the day have to be gone.
    ///
    /// # Errors
    /// [`StoreError`].
    fn begin_part(&mut self, day: i64) -> Result<(), StoreError>;

    /// All tails of a part.
    ///
    /// # Errors
    /// [`StoreError`].
    fn tails(&mut self, part: Part) -> Result<Vec<Tail>, StoreError>;

    /// The chunks of a signal in a part, in the order of their begins: the first `most`.
    ///
    /// # Errors
    /// [`StoreError`].
    fn entries(&mut self, part: Part, ask: Ask<'_>, most: usize) -> Result<Vec<Entry>, StoreError>;

    /// The chunk of a signal that ends last, of those that begin in this range.
    ///
    /// # Errors
    /// [`StoreError`].
    fn last_entry(&mut self, part: Part, ask: Ask<'_>) -> Result<Option<Entry>, StoreError>;

    /// The bytes of chunks of one part; `None` for a chunk that is not there any more.
    ///
    /// # Errors
    /// [`StoreError`].
    fn bytes(&mut self, part: Part, rows: &[i64]) -> Result<Vec<Option<Vec<u8>>>, StoreError>;

    /// The events of a robot in a part, in the order of their times and rows: the first `most`.
    ///
    /// # Errors
    /// [`StoreError`].
    fn events(&mut self, part: Part, ask: AskEvents<'_>, most: usize) -> Result<Vec<KeptEvent>, StoreError>;

    /// For each robot with chunks in a part, when its last sample was read, as far as its newest chunk of
    /// each signal says.
    ///
    /// # Errors
    /// [`StoreError`].
    fn last_seen(&mut self, part: Part) -> Result<Vec<(RobotName, Micros)>, StoreError>;

    /// All parts, oldest first, with their size on the disk in bytes, files beside them included.
    ///
    /// # Errors
    /// [`StoreError`].
    fn parts(&mut self) -> Result<Vec<(Part, u64)>, StoreError>;

    /// How much room its disk has; `None` if that is not known.
    fn free_bytes(&mut self) -> Option<u64>;

    /// What is written from now on about these robots belongs to these terms. A store that others share
    /// writes about no other robots, without an error: their owners do.
    fn hold(&mut self, _claims: &[Claim]) {}

    /// Whether parts that are too many are removed here: of gateways that share a store, one does it.
    fn may_remove(&self) -> bool {
        true
    }

    /// Whether another gateway has begun a newer part of the day than the part that is written here.
    fn is_behind(&self, _newest: Part) -> bool {
        false
    }

    /// Removes a part with all that is in it.
    ///
    /// # Errors
    /// [`StoreError`].
    fn remove(&mut self, part: Part) -> Result<(), StoreError>;

    /// The signals of which a part has chunks, and maybe others. None in a store without averages, which does
    /// not need them.
    ///
    /// # Errors
    /// [`StoreError`].
    fn signals(&mut self, _part: Part) -> Result<Vec<(RobotName, Address)>, StoreError> {
        Ok(Vec::new())
    }

    /// The averages of days; `None` if this store keeps none.
    fn averages(&mut self) -> Option<&mut dyn AverageStore> {
        None
    }

    /// Another hold on the same history, which only reads: the values of a day, to compute its averages.
    /// `None` if this store keeps none.
    fn to_average(&self) -> Option<Box<dyn HistoryStore>> {
        None
    }
}
