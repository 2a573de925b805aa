//! The settings of the hall: those of the file, or those that were stored over the API.

use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{Deed, HallSettings, ManagedBy};
use sha2::{Digest, Sha256};
use tokio::sync::Mutex as AsyncMutex;

use crate::core::hall::{Hall, Mistake, is_no_place};
use crate::core::library::{Condition, Tag, Unfit};
use crate::outage::Outage;
use crate::problem::Problem;
use crate::store::{Author, Keeper, StoreError, StoredSettings};

/// How often the settings are read again, if another gateway may change them.
const REFRESH: Duration = Duration::from_secs(1);

/// Settings that hold.
#[derive(Clone, Debug)]
pub struct Known {
    /// The time zone and the shifts.
    pub hall: Hall,
    /// Which settings these are.
    pub tag: Tag,
    /// Where they can be changed.
    pub managed_by: ManagedBy,
}

/// The settings of a gateway.
#[derive(Debug)]
pub struct Settings {
    keeper: Keeper,
    held: RwLock<Held>,
    /// Locked while they are changed: one change at a time.
    changing: AsyncMutex<()>,
}

#[derive(Debug)]
struct Held {
    /// What the file says, if it says something.
    of_file: Option<Arc<Known>>,
    stored: Arc<Known>,
}

impl Settings {
    /// The settings of the file, if it has any, and those of the store.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn read(keeper: Keeper, file: Option<Hall>) -> Result<Self, StoreError> {
        let stored = read(&keeper).await?;
        let held = Held { of_file: file.map(of_file), stored: Arc::new(stored) };
        Ok(Self { keeper, held: RwLock::new(held), changing: AsyncMutex::default() })
    }

    /// Reads what is stored again: another gateway may have changed it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn refresh(&self) -> Result<(), StoreError> {
        let _turn = self.changing.lock().await;
        let stored = Arc::new(read(&self.keeper).await?);
        self.held.write().unwrap_or_else(PoisonError::into_inner).stored = stored;
        Ok(())
    }

    /// Reads what is stored again and again, for as long as it is polled.
    pub async fn keep_fresh(&self) {
        let mut outage = Outage::default();
        loop {
            tokio::time::sleep(REFRESH).await;
            outage.note("the settings cannot be read", &self.refresh().await);
        }
    }

    /// The settings that hold now.
    pub fn now(&self) -> Arc<Known> {
        let held = self.held.read().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(held.of_file.as_ref().unwrap_or(&held.stored))
    }

    /// Makes the settings of the file these. Without, those that were stored hold.
    pub fn set_file(&self, file: Option<Hall>) {
        self.held.write().unwrap_or_else(PoisonError::into_inner).of_file = file.map(of_file);
    }

    /// Stores settings over this handle. They are on the disk and in the audit log before they hold.
    ///
    /// # Errors
    /// `managed_by_file`, `bad_value` with every mistake, `needs_if_match`, `not_this_version`,
    /// `store_unavailable`.
    pub async fn put(
        &self,
        wanted: HallSettings,
        condition: &Condition,
        by: &Author,
        keeper: &Keeper,
    ) -> Result<Arc<Known>, Problem> {
        let _turn = self.changing.lock().await;
        let now = self.now();
        if now.managed_by == ManagedBy::File {
            let message = "the file of the gateway has the time zone and the shifts: change them there";
            return Err(Problem::new(Code::ManagedByFile, message));
        }
        condition.check(Some(now.tag)).map_err(unfit)?;
        let hall = Hall::new(wanted).map_err(|wrong| Problem::new(Code::BadValue, listed(&wrong)))?;
        let new = known(hall, now.tag.version + 1, ManagedBy::Api);
        let HallSettings { time_zone, shifts } = new.hall.settings().clone();
        let deed = Deed::SettingsChanged { version: new.tag.version, time_zone, shifts };
        let stored = StoredSettings { version: new.tag.version, text: text(&new.hall) };
        keeper.put_settings(stored, by.record(deed)).await?;
        let new = Arc::new(new);
        self.held.write().unwrap_or_else(PoisonError::into_inner).stored = Arc::clone(&new);
        Ok(new)
    }
}

/// The settings of a store.
async fn read(keeper: &Keeper) -> Result<Known, StoreError> {
    Ok(match keeper.settings().await? {
        None => known(Hall::usual(), 0, ManagedBy::Api),
        Some(StoredSettings { version, text }) => {
            let unreadable = |what: String| StoreError::Unreadable(format!("the settings: {what}"));
            let mut settings: HallSettings =
                serde_json::from_str(&text).map_err(|error| unreadable(error.to_string()))?;
            if is_no_place(&settings.time_zone) {
                let zone = std::mem::replace(&mut settings.time_zone, "UTC".to_owned());
                tracing::error!(
                    zone,
                    "the time zone of the hall has no rules: it is UTC until an admin chooses one"
                );
            }
            let hall = Hall::new(settings).map_err(|mistakes| unreadable(listed(&mistakes)))?;
            known(hall, version, ManagedBy::Api)
        }
    })
}

fn of_file(hall: Hall) -> Arc<Known> {
    Arc::new(known(hall, 0, ManagedBy::File))
}

fn known(hall: Hall, version: u64, managed_by: ManagedBy) -> Known {
    let hash = Sha256::digest(text(&hall)).into();
    Known { hall, tag: Tag { version, hash }, managed_by }
}

fn text(hall: &Hall) -> String {
    // Our own types always become JSON.
    serde_json::to_string(hall.settings()).unwrap_or_default()
}

/// All mistakes in one sentence.
fn listed(mistakes: &[Mistake]) -> String {
    mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn unfit(unfit: Unfit) -> Problem {
    match unfit {
        Unfit::NeedsIfMatch => {
            Problem::new(Code::NeedsIfMatch, "send `If-Match` with the `ETag` of the settings that you read")
        }
        Unfit::NotThisVersion => {
            let message = "the settings were changed: read them again, and look at what changed";
            Problem::new(Code::NotThisVersion, message)
        }
    }
}
