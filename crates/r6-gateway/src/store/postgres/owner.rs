//! The rows that say which gateways there are, and which robots each of them owns.
//!
//! `gateway` has a row for each start of a gateway, with the number that it drew and its beats. `owner` has
//! a row for each robot that was ever owned, and one with the name '' for the hall: its fence only grows.
//! All times are those of the server's clock.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Notify;
use tokio_postgres::types::ToSql;
use tokio_postgres::{Client, Row};

use super::arms::{self, Tied};
use super::session::{Durable, Hand, connect, connect_hearing, name_of_gateway};
use super::{Database, signed, unsigned};
use crate::core::owner::{Claim, EXPIRES, Life, Owned, Seen, SeenGateway, SeenOwner};
use crate::peers::Door;
use crate::store::{StoreError, StoredRobot};

/// How long one question about the rows may take. A beat that takes longer is made anew over another
/// connection.
const WITHIN: Duration = Duration::from_millis(600);

/// For how many days the row of a gateway stays that has nothing, and gives no sign of life. A process that
/// was frozen for longer registers again.
const FORGOTTEN_AFTER: i32 = 1;

/// The channel on which gateways say that a look shows something new. It carries nothing else, and a look
/// comes in its time without that, too.
const CHANNEL: &str = "r6_gateway_look";

/// What a look sees.
#[derive(Clone, Debug, Default)]
pub struct Looked {
    /// The rows.
    pub seen: Seen,
    /// How to find each gateway.
    pub doors: BTreeMap<u64, Door>,
    /// What the file of each gateway says of the robots, as a hash.
    pub files: BTreeMap<u64, String>,
    /// The robots that were added over the API.
    pub robots: Vec<StoredRobot>,
    /// Where the last owners reached what they had.
    pub addresses: BTreeMap<Owned, String>,
    /// The server's clock, in milliseconds.
    pub time: Option<u64>,
}

/// What a gateway wants: each robot with the address at which it would reach it. The hall has none.
pub type Wanted = BTreeMap<Owned, Option<String>>;

/// What became of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Taken {
    /// What the gateway owns now.
    pub claims: Vec<Claim>,
    /// What it does not get, because an arm has one name.
    pub tied: BTreeMap<Owned, Tied>,
}

/// The rows, over a connection of their own: no write waits for a beat, and no beat for a write.
pub struct OwnerRows {
    database: Database,
    client: Option<Client>,
    /// Told when another gateway says that a look shows something new.
    look_soon: Option<Arc<Notify>>,
}

impl std::fmt::Debug for OwnerRows {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OwnerRows").field("database", &self.database).finish_non_exhaustive()
    }
}

impl OwnerRows {
    /// Of this database. It connects when it is used.
    #[must_use]
    pub fn new(database: Database) -> Self {
        Self { database, client: None, look_soon: None }
    }

    /// The same. This is told when a gateway has let go of something, or a robot came or went.
    #[must_use]
    pub fn hearing(database: Database, look_soon: Arc<Notify>) -> Self {
        Self { look_soon: Some(look_soon), ..Self::new(database) }
    }

    /// Makes a row for this gateway, which is alive then and owns nothing. Rows that tell nothing any more
    /// go.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn register(&mut self, own: u64, door: &Door, file: &str) -> Result<(), StoreError> {
        let name = super::plain(&door.url);
        self.ask(async |client| {
            client
                .execute(
                    "DELETE FROM gateway WHERE (beat_at IS NULL
                     OR beat_at < clock_timestamp() - make_interval(days => $1))
                     AND NOT EXISTS (SELECT 1 FROM owner WHERE owner.gateway = gateway.id)",
                    &[&FORGOTTEN_AFTER],
                )
                .await?;
            client
                .execute(
                    "INSERT INTO gateway (id, name, key, certificate, file, beat, beat_at)
                     VALUES ($1, $2, $3, $4, $5, 0, clock_timestamp())",
                    &[&signed(own), &name, &door.key, &door.certificate, &file],
                )
                .await?;
            Ok(())
        })
        .await
    }

    /// What the rows say, all of one moment.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn look(&mut self) -> Result<Looked, StoreError> {
        self.ask(async |client| {
            client.batch_execute("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY").await?;
            let gateways = client
                .query(
                    "SELECT id, name, beat, beat_at IS NULL,
                     beat_at <= clock_timestamp() - make_interval(secs => $1), key, certificate,
                     (extract(epoch FROM clock_timestamp()) * 1000)::bigint, beat_at > clock_timestamp(),
                     file FROM gateway",
                    &[&EXPIRES.as_secs_f64()],
                )
                .await?;
            let owners = client.query("SELECT robot, fence, gateway, address FROM owner", &[]).await?;
            let robots = super::robots::all(client).await?;
            client.batch_execute("COMMIT").await?;
            let mut looked = Looked { robots, ..Looked::default() };
            for row in &gateways {
                let number = unsigned(row.try_get(0)?);
                let door = Door { url: row.try_get(1)?, key: row.try_get(5)?, certificate: row.try_get(6)? };
                looked.doors.insert(number, door);
                looked.time = Some(unsigned(row.try_get(7)?));
                looked.files.extend(row.try_get::<_, Option<String>>(9)?.map(|file| (number, file)));
                looked.seen.gateways.insert(number, seen_gateway(row)?);
            }
            for row in &owners {
                // A name that is not valid is of no robot that this gateway can have.
                let Some(owned) = Owned::of_text(row.try_get(0)?) else { continue };
                let gateway = row.try_get::<_, Option<i64>>(2)?.map(unsigned);
                let address: Option<String> = row.try_get(3)?;
                looked.addresses.extend(address.map(|address| (owned.clone(), address)));
                looked.seen.owners.insert(owned, SeenOwner { fence: unsigned(row.try_get(1)?), gateway });
            }
            Ok(looked)
        })
        .await
    }

    /// Makes this gateway the owner of these, as far as their rows are still as they were seen, and says that
    /// it lives. Returns what it owns now. Transactions of an owner before that are under way come to their
    /// end first; none begins after this. If that owner has not been heard of for too long, its transactions
    /// are cut: the process may have frozen in the middle of one, and the server would wait for its rows as
    /// long as the process is there.
    ///
    /// # Errors
    /// [`StoreError`]: what it owns is not known.
    pub async fn take(&mut self, own: u64, wanted: &Wanted, seen: &Seen) -> Result<Taken, StoreError> {
        // By the owners before, in the order of their numbers, so that two that take wait and do not block
        // each other.
        let mut groups = BTreeMap::<Option<u64>, Vec<(&Owned, u64)>>::new();
        for owned in wanted.keys() {
            let row = seen.owners.get(owned);
            let before = row.and_then(|row| row.gateway).filter(|gateway| *gateway != own);
            groups.entry(before).or_default().push((owned, row.map_or(0, |row| row.fence)));
        }
        self.ask(async |client| {
            client.batch_execute("BEGIN").await?;
            let placed = wanted.iter().filter_map(|(owned, at)| Some((owned, at.as_deref()?)));
            let tied = arms::tied(client, own, &placed.collect::<Vec<_>>(), seen).await?;
            let mut claims = Vec::new();
            for (before, mut group) in groups {
                group.retain(|(owned, _)| !tied.contains_key(*owned));
                if let Some(before) = before
                    && !is_over(client, before, seen).await?
                {
                    continue;
                }
                claims.extend(take(client, own, before, &group, wanted).await?);
            }
            // Others count from this beat: no gateway takes what was just taken. It comes last, so that
            // beats do not wait for the rows of the robots.
            let lives = client
                .execute(
                    "UPDATE gateway SET beat = beat + 1, beat_at = clock_timestamp()
                     WHERE id = $1 AND beat_at IS NOT NULL",
                    &[&signed(own)],
                )
                .await?;
            let end = if lives > 0 { "COMMIT" } else { "ROLLBACK" };
            client.batch_execute(end).await?;
            Ok(if lives > 0 { Taken { claims, tied } } else { Taken::default() })
        })
        .await
    }

    /// Says that this gateway lives, which certificate it has now, and what its file says. Returns what it
    /// owns, with the fences; `None` if its row is gone: then it has to register again.
    ///
    /// # Errors
    /// [`StoreError`]: it is not known whether the beat is there.
    pub async fn beat(
        &mut self,
        own: u64,
        certificate: Option<&str>,
        file: &str,
    ) -> Result<Option<BTreeMap<Owned, u64>>, StoreError> {
        self.ask(async |client| {
            let changed = client
                .execute(
                    "UPDATE gateway SET beat = beat + 1, beat_at = clock_timestamp(), certificate = $2,
                     file = $3 WHERE id = $1 AND beat_at IS NOT NULL",
                    &[&signed(own), &certificate, &file],
                )
                .await?;
            if changed == 0 {
                return Ok(None);
            }
            // A statement of its own: it sees what was taken while the one before waited for the row.
            let rows =
                client.query("SELECT robot, fence FROM owner WHERE gateway = $1", &[&signed(own)]).await?;
            let mut owned = BTreeMap::new();
            for row in &rows {
                if let Some(of) = Owned::of_text(row.try_get(0)?) {
                    owned.insert(of, unsigned(row.try_get(1)?));
                }
            }
            Ok(Some(owned))
        })
        .await
    }

    /// Gives something back, so that others need not wait.
    ///
    /// # Errors
    /// [`StoreError`]: then they wait.
    pub async fn release(&mut self, own: u64, claim: &Claim) -> Result<(), StoreError> {
        let released = self.ask(async |client| {
            let change = "UPDATE owner SET gateway = NULL WHERE robot = $1 AND fence = $2 AND gateway = $3";
            let of: [&(dyn ToSql + Sync); 3] = [&claim.of.as_str(), &signed(claim.fence), &signed(own)];
            Ok(client.execute(change, &of).await?)
        });
        if released.await? > 0 {
            self.say_look_again().await;
        }
        Ok(())
    }

    /// Says that this gateway has ended. What it still owns is free.
    ///
    /// # Errors
    /// [`StoreError`]: then others wait.
    pub async fn end(&mut self, own: u64) -> Result<(), StoreError> {
        self.ask(async |client| {
            client
                .execute("UPDATE gateway SET beat = beat + 1, beat_at = NULL WHERE id = $1", &[&signed(own)])
                .await?;
            Ok(())
        })
        .await?;
        self.say_look_again().await;
        Ok(())
    }

    /// Tells the gateways that a look shows something new. What that is, is committed.
    async fn say_look_again(&mut self) {
        let said = self.ask(async |client| {
            say_look_again(client).await;
            Ok(())
        });
        if let Err(error) = said.await {
            tracing::debug!(%error, "the other gateways look in their time");
        }
    }

    async fn connected(&self) -> Result<Client, StoreError> {
        let Some(look_soon) = self.look_soon.clone() else {
            return connect(&self.database, Hand::Shell, Durable::Always).await;
        };
        let heard = move || look_soon.notify_one();
        let client = connect_hearing(&self.database, Hand::Shell, Durable::Always, heard).await?;
        // A pooler between can refuse that, or give what is said to another session. Then a look comes in its
        // time.
        if let Err(error) = client.batch_execute(&format!("LISTEN {CHANNEL}")).await {
            tracing::debug!(%error, "the store does not tell of changes");
        }
        Ok(client)
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
                None => self.connected().await?,
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

/// Tells the gateways that a look shows something new. Not within the transaction that changed it: the server
/// lets transactions that notify commit one after the other.
pub async fn say_look_again(client: &Client) {
    if let Err(error) = client.batch_execute(&format!("NOTIFY {CHANNEL}")).await {
        tracing::debug!(%error, "the other gateways look in their time");
    }
}

/// Whether what this gateway owns may be taken. If it may, the gateway says nothing more before the end of
/// this transaction.
pub async fn is_over(client: &Client, gateway: u64, seen: &Seen) -> Result<bool, StoreError> {
    let Some(SeenGateway { beat, .. }) = seen.gateways.get(&gateway) else {
        // Rows go that own nothing alone, so it was removed by hand.
        let row = client.query_opt("SELECT 1 FROM gateway WHERE id = $1", &[&signed(gateway)]).await?;
        return Ok(row.is_none());
    };
    let row = client
        .query_opt(
            "SELECT 1 FROM gateway WHERE id = $1 AND (beat_at IS NULL
             OR (beat = $2 AND (beat_at <= clock_timestamp() - make_interval(secs => $3)
                 OR beat_at > clock_timestamp()))) FOR UPDATE",
            &[&signed(gateway), &signed(*beat), &EXPIRES.as_secs_f64()],
        )
        .await?;
    Ok(row.is_some())
}

/// Takes what has this owner, with these fences.
async fn take(
    client: &Client,
    own: u64,
    before: Option<u64>,
    group: &[(&Owned, u64)],
    wanted: &Wanted,
) -> Result<Vec<Claim>, StoreError> {
    let names: Vec<_> = group.iter().map(|(owned, _)| owned.as_str()).collect();
    let fences: Vec<_> = group.iter().map(|(_, fence)| signed(*fence)).collect();
    let addresses: Vec<_> = group.iter().map(|(owned, _)| wanted.get(*owned)?.as_deref()).collect();
    if let Some(before) = before {
        end_sessions(client, before, &names).await?;
    }
    client
        .execute(
            "INSERT INTO owner (robot, fence, gateway) SELECT unnest($1::text[]), 0, NULL
             ON CONFLICT DO NOTHING",
            &[&names],
        )
        .await?;
    // This lock waits for each transaction that relies on one of the fences, and lets none begin.
    client.query("SELECT 1 FROM owner WHERE robot = ANY($1) ORDER BY robot FOR UPDATE", &[&names]).await?;
    let rows = client
        .query(
            "UPDATE owner SET fence = owner.fence + 1, gateway = $3, address = wanted.address
             FROM unnest($1::text[], $2::bigint[], $5::text[]) AS wanted (robot, fence, address)
             WHERE owner.robot = wanted.robot AND owner.fence = wanted.fence
             AND (owner.gateway IS NULL OR owner.gateway = $3 OR owner.gateway = $4)
             RETURNING owner.robot, owner.fence",
            &[&names, &fences, &signed(own), &before.map(signed), &addresses],
        )
        .await?;
    let mut claims = Vec::new();
    for row in &rows {
        let of = Owned::of_text(row.try_get(0)?);
        claims.extend(of.map(|of| (of, row.try_get(1))));
    }
    claims.into_iter().map(|(of, fence)| Ok(Claim { of, fence: unsigned(fence?) })).collect()
}

/// Ends the sessions of a gateway if some of these rows are locked. Without the right to do so, as another
/// user of the database, they are waited for.
pub async fn end_sessions(client: &Client, gateway: u64, names: &[&str]) -> Result<(), StoreError> {
    let free =
        client.query("SELECT 1 FROM owner WHERE robot = ANY($1) FOR UPDATE SKIP LOCKED", &[&names]).await?;
    if free.len() < names.len() {
        client
            .execute(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
                 WHERE datname = current_database() AND usename = current_user AND application_name = $1",
                &[&name_of_gateway(gateway)],
            )
            .await?;
        tracing::warn!(gateway, "transactions of a gateway that is silent were cut");
    }
    Ok(())
}

fn seen_gateway(row: &Row) -> Result<SeenGateway, StoreError> {
    let (is_ended, is_expired): (bool, Option<bool>) = (row.try_get(3)?, row.try_get(4)?);
    let is_ahead = row.try_get::<_, Option<bool>>(8)?;
    let life = match (is_ended, is_expired, is_ahead) {
        (true, _, _) => Life::Ended,
        (false, Some(true), _) => Life::Expired,
        (false, _, Some(true)) => Life::Ahead,
        (false, _, _) => Life::Alive,
    };
    Ok(SeenGateway { beat: unsigned(row.try_get(2)?), life })
}
