//! The row that says which gateway owns the robots.
//!
//! Its fence only grows. All times in it are those of the server's clock.

use std::time::Duration;

use tokio_postgres::{Client, Row};

use super::session::{Durable, Hand, connect, name_of_owner};
use super::{Database, signed, unsigned};
use crate::core::owner::{EXPIRES, RowState, Seen};
use crate::store::StoreError;

/// How long one question about the row may take. A beat that takes longer is made anew over another
/// connection.
const WITHIN: Duration = Duration::from_millis(600);

/// The row of the owner, over a connection of its own: no write waits for a beat, and no beat for a write.
pub struct OwnerRow {
    database: Database,
    client: Option<Client>,
}

impl std::fmt::Debug for OwnerRow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OwnerRow").field("database", &self.database).finish_non_exhaustive()
    }
}

impl OwnerRow {
    /// Of this database. It connects when it is used.
    #[must_use]
    pub fn new(database: Database) -> Self {
        Self { database, client: None }
    }

    /// What the row says, and the name of the gateway in it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn look(&mut self) -> Result<(Seen, String), StoreError> {
        self.ask(async |client| {
            let row = client
                .query_one(
                    "SELECT fence, beat, beat_at IS NULL,
                     beat_at <= clock_timestamp() - make_interval(secs => $1), gateway FROM owner",
                    &[&EXPIRES.as_secs_f64()],
                )
                .await?;
            Ok((seen(&row)?, row.try_get(4)?))
        })
        .await
    }

    /// Makes this gateway the owner, if the row is still as it was seen. Returns its fence. Transactions of
    /// the owner before that are under way come to their end first; none begins after this. If that owner has
    /// not been heard of for too long, its transactions are cut: the process may have frozen in the middle of
    /// one, and the server would wait for its rows as long as the process is there.
    ///
    /// # Errors
    /// [`StoreError`]: whether it is the owner is not known.
    pub async fn take(&mut self, seen: Seen, gateway: &str) -> Result<Option<u64>, StoreError> {
        let gateway = super::plain(gateway);
        self.ask(async |client| {
            client.batch_execute("BEGIN").await?;
            if seen.state == RowState::Expired {
                end_sessions(client, seen.fence).await?;
            }
            // This lock waits for each transaction that relies on the fence, and lets none begin.
            client.query("SELECT 1 FROM owner FOR UPDATE", &[]).await?;
            let row = client
                .query_opt(
                    "UPDATE owner SET fence = fence + 1, beat = beat + 1, gateway = $3,
                     beat_at = clock_timestamp()
                     WHERE fence = $1 AND beat = $2
                     AND (beat_at IS NULL OR beat_at <= clock_timestamp() - make_interval(secs => $4))
                     RETURNING fence",
                    &[&signed(seen.fence), &signed(seen.beat), &gateway, &EXPIRES.as_secs_f64()],
                )
                .await?;
            client.batch_execute("COMMIT").await?;
            Ok(row.map(|row| row.try_get(0)).transpose()?.map(unsigned))
        })
        .await
    }

    /// Says that this gateway lives. `false`: another fence is there, so it owns nothing any more.
    ///
    /// # Errors
    /// [`StoreError`]: it is not known whether the beat is there.
    pub async fn beat(&mut self, fence: u64) -> Result<bool, StoreError> {
        self.ask(async |client| {
            let changed = client
                .execute(
                    "UPDATE owner SET beat = beat + 1, beat_at = clock_timestamp()
                     WHERE fence = $1 AND beat_at IS NOT NULL",
                    &[&signed(fence)],
                )
                .await?;
            Ok(changed > 0)
        })
        .await
    }

    /// Gives the robots back, so that others need not wait.
    ///
    /// # Errors
    /// [`StoreError`]: then they wait.
    pub async fn release(&mut self, fence: u64) -> Result<(), StoreError> {
        self.ask(async |client| {
            client
                .execute(
                    "UPDATE owner SET beat = beat + 1, beat_at = NULL WHERE fence = $1",
                    &[&signed(fence)],
                )
                .await?;
            Ok(())
        })
        .await
    }

    /// Asks over the connection, which is made anew after a failure.
    async fn ask<T>(
        &mut self,
        work: impl AsyncFnOnce(&Client) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let before = self.client.take().filter(|client| !client.is_closed());
        let job = async {
            let client = match before {
                Some(client) => client,
                None => connect(&self.database, Hand::Shell, Durable::Always).await?,
            };
            work(&client).await.map(|done| (done, client))
        };
        match tokio::time::timeout(WITHIN, job).await {
            Ok(done) => {
                let (done, client) = done?;
                self.client = Some(client);
                Ok(done)
            }
            Err(_elapsed) => Err(StoreError::Unavailable(format!(
                "{} did not answer within {} ms",
                self.database,
                WITHIN.as_millis()
            ))),
        }
    }
}

/// Ends the sessions of an owner that hold the lock on its row. Without the right to do so, as another user
/// of the database, they are waited for.
async fn end_sessions(client: &Client, fence: u64) -> Result<(), StoreError> {
    let free = client.query("SELECT 1 FROM owner FOR UPDATE SKIP LOCKED", &[]).await?;
    if free.is_empty() {
        client
            .execute(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
                 WHERE datname = current_database() AND usename = current_user AND application_name = $1",
                &[&name_of_owner(fence)],
            )
            .await?;
        tracing::warn!(fence, "transactions of the owner before, which is silent, were cut");
    }
    Ok(())
}

fn seen(row: &Row) -> Result<Seen, StoreError> {
    let (is_free, is_expired): (bool, Option<bool>) = (row.try_get(2)?, row.try_get(3)?);
    let state = match (is_free, is_expired) {
        (true, _) => RowState::Free,
        (false, Some(true)) => RowState::Expired,
        (false, _) => RowState::Alive,
    };
    Ok(Seen { fence: unsigned(row.try_get(0)?), beat: unsigned(row.try_get(1)?), state })
}
