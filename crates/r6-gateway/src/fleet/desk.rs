//! The alarms of one robot, and what the store has of them.

use std::sync::{Mutex, MutexGuard, PoisonError};

use r6_api::gateway::AuditRecord;
use tokio::sync::Mutex as AsyncMutex;

use crate::core::alarms::{Alarms, Saved};
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::problem::Problem;
use crate::store::{Keeper, StoreError};

/// The alarms of one robot.
#[derive(Debug)]
pub struct Desk {
    held: Mutex<Held>,
    /// Locked while they are saved, so that an older state never overwrites a newer one.
    saving: AsyncMutex<()>,
}

#[derive(Debug)]
struct Held {
    alarms: Alarms,
    /// What the store has.
    stored: Saved,
}

impl Desk {
    /// The alarms as they were saved.
    pub fn new(saved: Saved) -> Self {
        let held = Held { alarms: Alarms::new(saved.clone()), stored: saved };
        Self { held: Mutex::new(held), saving: AsyncMutex::default() }
    }

    /// Uses the alarms. What changes is saved with the next [`Self::save`].
    pub fn with<T>(&self, act: impl FnOnce(&mut Alarms) -> T) -> T {
        act(&mut self.held().alarms)
    }

    /// Forgets what is too old at this time. Returns whether there is something to save.
    pub fn tidy(&self, now: Micros) -> bool {
        let mut held = self.held();
        held.alarms.forget(now);
        held.alarms.saved() != &held.stored
    }

    /// Saves the alarms, if they changed.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn save(&self, keeper: &Keeper, robot: &RobotName) -> Result<(), StoreError> {
        let _turn = self.saving.lock().await;
        let saved = {
            let held = self.held();
            if held.alarms.saved() == &held.stored {
                return Ok(());
            }
            held.alarms.saved().clone()
        };
        keeper.save_alarms(robot.clone(), saved.clone(), Vec::new()).await?;
        self.held().stored = saved;
        Ok(())
    }

    /// Changes the alarms once that is on the disk, with its record. Without a record, nothing changes. `act`
    /// may be called twice: readings come meanwhile.
    ///
    /// # Errors
    /// As `act`; `store_unavailable`: nothing was changed.
    pub async fn change<T>(
        &self,
        keeper: &Keeper,
        robot: &RobotName,
        act: impl Fn(&mut Alarms) -> Result<(T, Option<AuditRecord>), Problem>,
    ) -> Result<T, Problem> {
        let _turn = self.saving.lock().await;
        let mut changed = self.with(|alarms| alarms.clone());
        let (told, record) = act(&mut changed)?;
        let Some(record) = record else { return Ok(told) };
        keeper.save_alarms(robot.clone(), changed.saved().clone(), vec![record]).await?;
        let mut held = self.held();
        held.stored = changed.saved().clone();
        // It may have been forgotten meanwhile. Then there is nothing to change.
        drop(act(&mut held.alarms));
        Ok(told)
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use r6_api::gateway::Deed;
    use r6_proto::time::Instant;

    use super::*;
    use crate::core::alarms::Acknowledged;
    use crate::store::Sqlite;

    #[tokio::test]
    async fn what_is_read_while_a_change_is_saved_is_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let keeper = Keeper::start(Sqlite::open(folder.path()).unwrap()).unwrap();
        let robot = RobotName::new("press").unwrap();
        let desk = Desk::new(Saved::default());
        let read = |time, code| {
            let at = Instant::from_nanos(u64::try_from(time).unwrap());
            desk.with(|alarms| alarms.read(at, Micros(time), code, true));
        };
        read(1, 7);
        let record = AuditRecord {
            time: String::new(),
            actor: String::new(),
            source: None,
            robot: None,
            deed: Deed::GatewayStarted { url: None },
        };
        let by = Acknowledged { by: "anna".to_owned(), at: Micros(2), comment: None };
        let first = std::cell::Cell::new(true);
        let changed = desk.change(&keeper, &robot, |alarms| {
            if first.replace(false) {
                // The alarm ends while the change goes to the disk. `alarms` is a copy by now.
                read(3, 0);
            }
            let is_new = alarms.acknowledge(1, &by).unwrap();
            Ok((is_new, Some(record.clone())))
        });
        assert!(changed.await.unwrap());
        assert!(desk.tidy(Micros(4)), "the end is not on the disk yet");
        desk.save(&keeper, &robot).await.unwrap();
        assert!(!desk.tidy(Micros(4)));
        let saved = keeper.alarms(robot).await.unwrap();
        assert_eq!((saved.active.is_none(), saved.ended[0].acknowledged.clone()), (true, Some(by)));
    }
}
