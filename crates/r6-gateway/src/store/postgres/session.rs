//! One connection to the server, for callers that wait: it is made when it is needed, and again after it was
//! lost.

use std::error::Error as _;
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use tokio_postgres::{Client, NoTls, SimpleQueryMessage};

use super::database::Database;
use crate::store::StoreError;

/// How long one job may take, from the connection to the answer: what hangs longer counts as failed, and
/// whether it was done is not known.
const LONGEST: Duration = Duration::from_secs(15);

/// What a session is for, and with it what it may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    /// It reads.
    Reader,
    /// The command line: it adds tokens and users beside the owner, and needs no fence.
    Shell,
    /// The gateway that owns the robots, with its fence.
    Owner(u64),
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

    /// Writes, all or nothing, if the fence of this session still holds. Others that write wait.
    ///
    /// # Errors
    /// [`StoreError::NotOwner`] if it does not. Other [`StoreError`]s: nothing was written, or that is
    /// unknown.
    pub fn write<T, E: From<StoreError>>(
        &mut self,
        work: impl AsyncFnOnce(&Client) -> Result<T, E>,
    ) -> Result<T, E> {
        match self.hand {
            Hand::Reader => Err(StoreError::NotOwner.into()),
            Hand::Shell => self.run(Some(Begin::Write(None)), work, "COMMIT"),
            Hand::Owner(fence) => self.run(Some(Begin::Write(Some(fence))), work, "COMMIT"),
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
        begin: Option<Begin>,
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

/// How a transaction begins.
#[derive(Clone, Copy, Debug)]
enum Begin {
    Read,
    /// With this fence.
    Write(Option<u64>),
}

impl Begin {
    /// The lock on the row of the owner lets no other gateway become the owner before the end of this
    /// transaction, and does not hold up the beats. The lock on the log lets one writer after the other read
    /// its last entry. It holds up no reader.
    fn text(self) -> String {
        let lock = "LOCK TABLE audit IN SHARE ROW EXCLUSIVE MODE";
        match self {
            Self::Read => "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY".to_owned(),
            Self::Write(None) => format!("BEGIN; {lock}"),
            Self::Write(Some(fence)) => {
                format!("BEGIN; SELECT fence FROM owner WHERE fence = {fence} FOR KEY SHARE; {lock}")
            }
        }
    }
}

/// Begins. A connection that was lost since the last job is made again: nothing was done over it yet.
async fn start(
    client: Client,
    begin: Option<Begin>,
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
    let has_row = told.iter().any(|message| matches!(message, SimpleQueryMessage::Row(_)));
    if matches!(begin, Begin::Write(Some(_))) && !has_row {
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

/// How the server calls the sessions of the owner with this fence. The next owner ends them by it.
pub fn name_of_owner(fence: u64) -> String {
    format!("r6-gateway owner {fence}")
}

/// Connects, and makes the session what it is for.
///
/// A process that freezes within a transaction must not hold its locks: the server ends it after 2 s,
/// before others may take the robots. It does not while it waits for rows of a COPY, so the next owner ends
/// these sessions (`owner.rs`).
pub async fn connect(database: &Database, hand: Hand, durable: Durable) -> Result<Client, StoreError> {
    let mut config = database.config().clone();
    if let Hand::Owner(fence) = hand {
        config.application_name(name_of_owner(fence));
    }
    let (client, connection) = config.connect(NoTls).await.map_err(|error| named(database, &error))?;
    tokio::spawn(async move {
        if let Err(error) = connection.await {
            tracing::debug!(%error, "a connection to the store ended");
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
