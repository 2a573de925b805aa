//! One connection to the server, for callers that wait: it is made when it is needed, and again after it was
//! lost.

use std::error::Error as _;
use std::future::poll_fn;
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use tokio_postgres::{AsyncMessage, Client, NoTls, SimpleQueryMessage};

use super::database::Database;
use crate::core::owner::Claim;
use crate::store::StoreError;

/// How long one job may take, from the connection to the answer: what hangs longer counts as failed, and
/// whether it was done is not known.
const LONGEST: Duration = Duration::from_secs(15);

/// What a session is for, and with it what it may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    /// It reads.
    Reader,
    /// The command line: it adds tokens and users beside the gateways, and needs no fence.
    Shell,
    /// The gateway with this number. What it writes about robots carries their fences.
    Gateway(u64),
}

/// What is promised of a commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durable {
    /// It survives a power cut of the server.
    Always,
    /// It survives the end of this process. The server may write it a moment later.
    Soon,
}

/// A connection that is there when it is needed.
pub struct Session {
    database: Database,
    hand: Hand,
    durable: Durable,
    /// `None` only while the session is dropped.
    runtime: Option<Runtime>,
    client: Option<Client>,
    /// Whether a transaction of several jobs is open.
    holds: bool,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session").field("hand", &self.hand).finish_non_exhaustive()
    }
}

impl Session {
    /// A session that has no connection yet.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`]: the system gives no runtime.
    pub fn new(database: Database, hand: Hand, durable: Durable) -> Result<Self, StoreError> {
        let runtime = Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| StoreError::Unavailable(format!("no runtime: {error}")))?;
        Ok(Self { database, hand, durable, runtime: Some(runtime), client: None, holds: false })
    }

    /// Reads, all of one moment.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn read<T>(
        &mut self,
        work: impl AsyncFnOnce(&Client) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        if self.holds {
            return self.run(None, work, "");
        }
        self.run(Some(Begin::Read), work, "COMMIT")
    }

    /// Writes, all or nothing, if all of these claims still hold. `lock` says which others wait meanwhile.
    ///
    /// # Errors
    /// [`StoreError::NotOwner`] if one of them does not. Other [`StoreError`]s: nothing was written, or that
    /// is unknown.
    pub fn write<T, E: From<StoreError>>(
        &mut self,
        claims: &[Claim],
        lock: Lock,
        work: impl AsyncFnOnce(&Client) -> Result<T, E>,
    ) -> Result<T, E> {
        match self.hand {
            Hand::Reader => Err(StoreError::NotOwner.into()),
            Hand::Shell | Hand::Gateway(_) => self.run(Some(Begin::Write(claims, lock)), work, "COMMIT"),
        }
    }

    /// Makes everything that is read from now on of one moment, while others write.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn hold_still(&mut self) -> Result<(), StoreError> {
        self.run(Some(Begin::Read), async |_| Ok::<_, StoreError>(()), "")?;
        self.holds = true;
        Ok(())
    }

    /// Does something without a transaction around it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn bare<T>(
        &mut self,
        work: impl AsyncFnOnce(&Client) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        self.run(None, work, "")
    }

    fn run<T, E: From<StoreError>>(
        &mut self,
        begin: Option<Begin<'_>>,
        work: impl AsyncFnOnce(&Client) -> Result<T, E>,
        end: &str,
    ) -> Result<T, E> {
        let Some(runtime) = &self.runtime else { return Err(StoreError::Closed.into()) };
        let (database, durable, hand, holds) = (&self.database, self.durable, self.hand, self.holds);
        let before = self.client.take();
        let job = async {
            let client = match before {
                Some(client) if !client.is_closed() => client,
                // What was read before is of another moment.
                _ if holds => return (Err(StoreError::Closed.into()), None),
                _ => match connect(database, hand, durable).await {
                    Ok(client) => client,
                    Err(error) => return (Err(error.into()), None),
                },
            };
            match start(client, begin, database, hand, durable).await {
                Ok(client) => {
                    let done = match work(&client).await {
                        Ok(done) if end.is_empty() => Ok(done),
                        Ok(done) => {
                            client.batch_execute(end).await.map(|()| done).map_err(|error| of(&error).into())
                        }
                        Err(error) => Err(error),
                    };
                    // After a failure, what the server thinks of this connection does not matter any more.
                    let is_clean = match &done {
                        Ok(_) => true,
                        Err(_) if begin.is_some() => client.batch_execute("ROLLBACK").await.is_ok(),
                        Err(_) => false,
                    };
                    (done, is_clean.then_some(client))
                }
                Err((error, client)) => (Err(error.into()), client),
            }
        };
        match runtime.block_on(async { tokio::time::timeout(LONGEST, job).await }) {
            Ok((done, client)) => {
                self.client = client;
                done
            }
            Err(_elapsed) => {
                let told = format!("the server did not answer within {} s", LONGEST.as_secs());
                Err(StoreError::Unavailable(told).into())
            }
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.client = None;
        // The last handle may be dropped in a task, which must not wait for a runtime.
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// What a transaction that writes keeps others from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lock {
    /// From appending to the audit log: one writer after the other reads its last entry. It holds up no
    /// reader.
    Log,
    /// From removing partitions of the history: it writes into them.
    History,
    /// From using the history: partitions come or go.
    Partitions,
}

impl Lock {
    fn text(self) -> &'static str {
        match self {
            // Not of the table: VACUUM and ANALYZE of that would be waited for, or cut.
            Self::Log => "SELECT 1 WHERE pg_advisory_xact_lock(9761, 0)::text = 'locked'",
            // All at once and in one order, so that no two wait for each other.
            Self::History => "LOCK TABLE chunk, tail, event IN ROW EXCLUSIVE MODE",
            Self::Partitions => "LOCK TABLE chunk, tail, event IN ACCESS EXCLUSIVE MODE",
        }
    }
}

/// How a transaction begins.
#[derive(Clone, Copy, Debug)]
enum Begin<'c> {
    Read,
    /// With these claims.
    Write(&'c [Claim], Lock),
}

impl Begin<'_> {
    /// The lock on the row of a robot lets no other gateway become its owner before the end of this
    /// transaction.
    fn text(self) -> String {
        match self {
            Self::Read => "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY".to_owned(),
            Self::Write([], lock) => format!("BEGIN; {}", lock.text()),
            Self::Write(claims, lock) => {
                // A name is of letters, digits and `-`, or empty.
                let pairs = claims.iter().map(|claim| format!("('{}', {})", claim.of.as_str(), claim.fence));
                let pairs = pairs.collect::<Vec<_>>().join(", ");
                format!(
                    "BEGIN; SELECT fence FROM owner WHERE (robot, fence) IN ({pairs}) ORDER BY robot
                     FOR KEY SHARE; {}",
                    lock.text()
                )
            }
        }
    }

    /// How many rows it has to see, so that all claims hold.
    fn claims(self) -> usize {
        match self {
            Self::Read => 0,
            Self::Write(claims, _) => claims.len(),
        }
    }
}

/// Begins. A connection that was lost since the last job is made again: nothing was done over it yet.
async fn start(
    client: Client,
    begin: Option<Begin<'_>>,
    database: &Database,
    hand: Hand,
    durable: Durable,
) -> Result<Client, (StoreError, Option<Client>)> {
    let Some(begin) = begin else { return Ok(client) };
    let (client, told) = match client.simple_query(&begin.text()).await {
        Err(error) if is_gone(&error) => {
            let client = connect(database, hand, durable).await.map_err(|error| (error, None))?;
            let told = client.simple_query(&begin.text()).await;
            (client, told)
        }
        told => (client, told),
    };
    let told = match told {
        Ok(told) => told,
        Err(error) => return Err((of(&error), None)),
    };
    let rows = told.iter().filter(|message| matches!(message, SimpleQueryMessage::Row(_))).count();
    if rows < begin.claims() {
        let is_clean = client.batch_execute("ROLLBACK").await.is_ok();
        return Err((StoreError::NotOwner, is_clean.then_some(client)));
    }
    Ok(client)
}

/// Whether the connection was lost, or the server has ended it: it was told to, it starts again, or it was
/// killed. What was asked for was not done.
fn is_gone(error: &tokio_postgres::Error) -> bool {
    error.code().is_none_or(|code| code.code().starts_with("57P"))
}

/// How the server calls the sessions of the gateway with this number. Who takes its robots ends them by it.
pub fn name_of_gateway(number: u64) -> String {
    format!("r6-gateway {number}")
}

/// Connects, and makes the session what it is for.
///
/// A process that freezes within a transaction must not hold its locks: the server ends it after 2 s,
/// before others may take its robots. It does not while it waits for rows of a COPY, so who takes them ends
/// these sessions (`owner.rs`).
pub async fn connect(database: &Database, hand: Hand, durable: Durable) -> Result<Client, StoreError> {
    connect_hearing(database, hand, durable, || ()).await
}

/// The same. `heard` is called whenever a session notifies a channel that this one listens to.
pub async fn connect_hearing(
    database: &Database,
    hand: Hand,
    durable: Durable,
    heard: impl Fn() + Send + 'static,
) -> Result<Client, StoreError> {
    let mut config = database.config().clone();
    if let Hand::Gateway(number) = hand {
        config.application_name(name_of_gateway(number));
    }
    let (client, mut connection) = config.connect(NoTls).await.map_err(|error| named(database, &error))?;
    tokio::spawn(async move {
        loop {
            match poll_fn(|context| connection.poll_message(context)).await {
                Some(Ok(AsyncMessage::Notification(_))) => heard(),
                Some(Ok(AsyncMessage::Notice(notice))) => tracing::info!("the store says: {notice}"),
                Some(Ok(_)) => {}
                Some(Err(error)) => return tracing::debug!(%error, "a connection to the store ended"),
                None => return,
            }
        }
    });
    let commit = match durable {
        // A server that waits for its standby, too, goes on to do so.
        Durable::Always => {
            "SELECT set_config('synchronous_commit', CASE WHEN current_setting('synchronous_commit') IN
             ('off', 'local') THEN 'on' ELSE current_setting('synchronous_commit') END, false);"
        }
        Durable::Soon => "SET synchronous_commit = off;",
    };
    let idle = if hand == Hand::Reader { "60s" } else { "2s" };
    let settings = format!(
        "SET search_path = {schema}; SET client_min_messages = warning; SET timezone = 'UTC'; {commit}
         SET statement_timeout = '12s'; SET lock_timeout = '5s';
         SET idle_in_transaction_session_timeout = '{idle}';",
        schema = super::tables::SCHEMA,
    );
    client.batch_execute(&settings).await.map_err(|error| named(database, &error))?;
    Ok(client)
}

/// An error of the connection, with the name of the database.
fn named(database: &Database, error: &tokio_postgres::Error) -> StoreError {
    StoreError::Unavailable(format!("{database}: {}", text(error)))
}

/// An error of the server or of the connection.
pub fn of(error: &tokio_postgres::Error) -> StoreError {
    StoreError::Unavailable(text(error))
}

impl From<tokio_postgres::Error> for StoreError {
    fn from(error: tokio_postgres::Error) -> Self {
        of(&error)
    }
}

/// What the server says, or why it says nothing.
fn text(error: &tokio_postgres::Error) -> String {
    if let Some(told) = error.as_db_error() {
        return told.message().to_owned();
    }
    match error.source() {
        Some(source) => format!("{error}: {source}"),
        None => error.to_string(),
    }
}
