//! Where the history is, and what opens it.

use std::path::PathBuf;

use r6_proto::Address;

use super::{Ask, AskEvents, AverageStore, Days, Entry, HistoryStore, KeptEvent, Part, Tail};
use crate::core::history::block::Write;
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::core::owner::Claim;
use crate::store::StoreError;
use crate::store::postgres::Database;
use crate::store::postgres::history::PostgresDays;
use crate::store::postgres::session::Hand;

/// Where the history is.
#[derive(Clone, Debug)]
pub enum Place {
    /// In a folder.
    Folder(PathBuf),
    /// In a database.
    Database {
        /// Which one.
        database: Database,
        /// Who writes.
        hand: Hand,
    },
}

impl Place {
    /// The history, to write. `max_bytes` is what it may take.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn to_write(&self, max_bytes: u64) -> Result<Box<dyn HistoryStore>, StoreError> {
        Ok(match self {
            Self::Folder(folder) => Box::new(Days::to_write(folder, max_bytes)),
            Self::Database { database, hand } => Box::new(PostgresDays::new(database, *hand)?),
        })
    }

    /// The history for a reader, which never writes.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn to_read(&self) -> Result<Box<dyn HistoryStore>, StoreError> {
        Ok(match self {
            Self::Folder(folder) => Box::new(Days::to_read(folder)),
            Self::Database { database, .. } => Box::new(PostgresDays::new(database, Hand::Reader)?),
        })
    }
}

impl HistoryStore for Box<dyn HistoryStore> {
    fn write(&mut self, day: i64, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        (**self).write(day, writes)
    }

    fn write_part(&mut self, part: Part, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        (**self).write_part(part, writes)
    }

    fn begin_part(&mut self, day: i64) -> Result<(), StoreError> {
        (**self).begin_part(day)
    }

    fn tails(&mut self, part: Part) -> Result<Vec<Tail>, StoreError> {
        (**self).tails(part)
    }

    fn entries(&mut self, part: Part, ask: Ask<'_>, most: usize) -> Result<Vec<Entry>, StoreError> {
        (**self).entries(part, ask, most)
    }

    fn last_entry(&mut self, part: Part, ask: Ask<'_>) -> Result<Option<Entry>, StoreError> {
        (**self).last_entry(part, ask)
    }

    fn bytes(&mut self, part: Part, rows: &[i64]) -> Result<Vec<Option<Vec<u8>>>, StoreError> {
        (**self).bytes(part, rows)
    }

    fn events(&mut self, part: Part, ask: AskEvents<'_>, most: usize) -> Result<Vec<KeptEvent>, StoreError> {
        (**self).events(part, ask, most)
    }

    fn last_seen(&mut self, part: Part) -> Result<Vec<(RobotName, Micros)>, StoreError> {
        (**self).last_seen(part)
    }

    fn parts(&mut self) -> Result<Vec<(Part, u64)>, StoreError> {
        (**self).parts()
    }

    fn free_bytes(&mut self) -> Option<u64> {
        (**self).free_bytes()
    }

    fn hold(&mut self, claims: &[Claim]) {
        (**self).hold(claims);
    }

    fn may_remove(&self) -> bool {
        (**self).may_remove()
    }

    fn is_behind(&self, newest: Part) -> bool {
        (**self).is_behind(newest)
    }

    fn remove(&mut self, part: Part) -> Result<(), StoreError> {
        (**self).remove(part)
    }

    fn signals(&mut self, part: Part) -> Result<Vec<(RobotName, Address)>, StoreError> {
        (**self).signals(part)
    }

    fn averages(&mut self) -> Option<&mut dyn AverageStore> {
        (**self).averages()
    }

    fn to_average(&self) -> Option<Box<dyn HistoryStore>> {
        (**self).to_average()
    }
}
