//! The store in a PostgreSQL database, which several gateways can share.
//!
//! Each robot is owned by one gateway at a time ([`owner`]): each transaction about a robot asks first
//! whether its fence still holds. All gateways write about users, tokens and programs, and so does the
//! command line.
//!
//! [`session`]: the connection. `tables`: the tables. The other files have what their tables are about.

mod arms;
mod audit;
mod cameras;
mod commands;
mod database;
pub mod history;
pub mod owner;
mod password_file;
mod points;
mod programs;
mod robots;
mod runs;
pub mod session;
mod tables;
#[cfg(test)]
mod tests;
mod users;
mod versions;

use r6_api::gateway::{AuditRecord, Run};

use self::session::{Durable, Hand, Lock, Session};
use self::tables::{FOUNDATION, TABLES};
use super::commands::{KeptCommand, NewCommand, Noted};
use super::runs::{Begun, KeptRun, NewRun};
use super::versions::Named;
use super::{
    Author, Ends, Entry, Heads, Kept, KeptPoint, LibraryError, Link, NewGrant, NewPoint, NewToken,
    NewVersion, Store, StoreError, StoredRobot, StoredSettings, StoredUser, Token, UserChange,
};
use crate::core::account::Decided;
use crate::core::alarms;
use crate::core::camera::CameraGrant;
use crate::core::library::{Condition, ProgramName};
use crate::core::name::RobotName;
use crate::core::owner::Claim;
use crate::core::point::PointName;
use crate::core::seat::Saved;

pub use database::Database;

/// The oldest version of the server: it has all that the tables and the transactions need.
const OLDEST_SERVER: i32 = 130_000;

/// A store in a database.
#[derive(Debug)]
pub struct Postgres {
    session: Session,
    /// What the next write is about.
    claims: Vec<Claim>,
}

impl Postgres {
    /// Opens the store of a database, and makes the tables that are missing. What may be written depends on
    /// the hand.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    pub fn open(database: &Database, hand: Hand) -> Result<Self, StoreError> {
        make_tables(database)?;
        let session = Session::new(database.clone(), hand, Durable::Always)?;
        Ok(Self { session, claims: Vec::new() })
    }

    /// Opens the store of a database to read it. Nothing is made.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] without its tables, or if they are of a newer r6.
    pub fn open_to_read(database: &Database) -> Result<Self, StoreError> {
        let mut session = Session::new(database.clone(), Hand::Reader, Durable::Always)?;
        let version = session.bare(async |client| version(client).await)?;
        let missing = || StoreError::Unavailable(format!("{database} has no store of a gateway"));
        if version.ok_or_else(missing)? > TABLES.len() {
            return Err(newer(database));
        }
        Ok(Self { session, claims: Vec::new() })
    }

    /// Opens the store for the gateway with this number. Its tables are there.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    pub fn of_gateway(database: &Database, number: u64) -> Result<Self, StoreError> {
        let session = Session::new(database.clone(), Hand::Gateway(number), Durable::Always)?;
        Ok(Self { session, claims: Vec::new() })
    }

    /// Writes under the present claims.
    fn write<T, E: From<StoreError>>(
        &mut self,
        work: impl AsyncFnOnce(&tokio_postgres::Client) -> Result<T, E>,
    ) -> Result<T, E> {
        self.session.write(&self.claims, Lock::Log, work)
    }

    /// Makes everything that is read from now on of one moment, while others write.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn hold_still(&mut self) -> Result<(), StoreError> {
        self.session.hold_still()
    }

    /// Tells the gateways that something changed which a look shows. It is committed: those that do not hear
    /// this see it with their next look.
    fn say_look_again(&mut self) {
        let said = self.session.bare(async |client| {
            owner::say_look_again(client).await;
            Ok(())
        });
        if let Err(error) = said {
            tracing::debug!(%error, "the other gateways look in their time");
        }
    }
}

/// Makes the tables that are missing.
fn make_tables(database: &Database) -> Result<(), StoreError> {
    let mut session = Session::new(database.clone(), Hand::Shell, Durable::Always)?;
    session.bare(async |client| {
        // A user without the right to make a schema can use the schema that is there.
        if version(client).await? == Some(TABLES.len()) {
            return Ok(());
        }
        client.batch_execute("BEGIN").await?;
        client.batch_execute(FOUNDATION).await?;
        let has = version(client).await?.unwrap_or(0);
        let missing = TABLES.get(has..).ok_or_else(|| newer(database))?;
        for tables in missing {
            client.batch_execute(tables).await?;
        }
        let now = i32::try_from(TABLES.len()).unwrap_or(i32::MAX);
        client
            .execute(
                "INSERT INTO version (one, tables) VALUES (1, $1) ON CONFLICT (one) DO UPDATE SET tables = $1",
                &[&now],
            )
            .await?;
        client.batch_execute("COMMIT").await?;
        Ok(())
    })
}

fn newer(database: &Database) -> StoreError {
    StoreError::Unavailable(format!("the store in {database} is of a newer r6"))
}

/// How many of the versions of tables there are; `None` without a store.
async fn version(client: &tokio_postgres::Client) -> Result<Option<usize>, StoreError> {
    let there = client.query_one("SELECT to_regclass('version') IS NOT NULL", &[]).await?;
    if !there.try_get::<_, bool>(0)? {
        return Ok(None);
    }
    let row = client.query_opt("SELECT tables FROM version", &[]).await?;
    let Some(row) = row else { return Ok(None) };
    Ok(usize::try_from(row.try_get::<_, i32>(0)?).ok())
}

/// What is wrong with the server, for people. It is refused if it is too old, or if it cannot be written.
///
/// # Errors
/// [`StoreError::Unavailable`]: it is refused.
pub fn look_at_server(database: &Database) -> Result<Vec<String>, StoreError> {
    let mut session = Session::new(database.clone(), Hand::Shell, Durable::Always)?;
    session.bare(async |client| {
        let row = client
            .query_one(
                "SELECT current_setting('server_version_num')::integer, pg_is_in_recovery(),
                 current_setting('fsync') = 'off', current_setting('full_page_writes') = 'off',
                 (SELECT count(*) FROM pg_stat_replication WHERE sync_state = 'async') > 0",
                &[],
            )
            .await?;
        if row.try_get::<_, i32>(0)? < OLDEST_SERVER {
            return Err(StoreError::Unavailable(format!("{database}: it has to be PostgreSQL 13 or newer")));
        }
        if row.try_get(1)? {
            let told = format!("{database} is a standby, which cannot be written: name the primary");
            return Err(StoreError::Unavailable(told));
        }
        let found = [
            (2, "fsync is off: a power cut of the server can lose the audit log, stops that hold and the owner"),
            (3, "full_page_writes is off: a power cut of the server can break the store"),
            (
                4,
                "it has an asynchronous standby: do not make it the primary, because it can miss what was \
                 acknowledged, and with it which gateway owns the robots. Use a synchronous one",
            ),
        ];
        let mut told = Vec::new();
        for (at, what) in found {
            if row.try_get(at)? {
                told.push(format!("{database}: {what}"));
            }
        }
        Ok(told)
    })
}

/// A number of ours as PostgreSQL has it, which knows signed numbers only. No number of ours gets that large.
fn signed(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

/// A number of the tables. They have no negative numbers.
fn unsigned(number: i64) -> u64 {
    u64::try_from(number).unwrap_or(0)
}

/// Text that PostgreSQL can keep: it has no NUL.
fn plain(text: &str) -> String {
    text.replace('\0', "\u{fffd}")
}

impl Store for Postgres {
    fn hold(&mut self, claims: &[Claim]) {
        self.claims = claims.to_vec();
    }

    fn tie(&mut self, robots: &[(RobotName, String)], leaving: &[RobotName]) -> Result<(), StoreError> {
        self.write(async |client| arms::tie(client, robots, leaving).await)
    }

    fn append(&mut self, records: &[AuditRecord]) -> Result<u64, StoreError> {
        self.write(async |client| {
            if records.is_empty() {
                // To see whether the server takes something, something has to be written.
                client.execute("SELECT pg_current_xact_id()", &[]).await?;
            }
            audit::append(client, records).await
        })
    }

    /// The server has synchronised what it confirms.
    fn settle(&mut self) -> Result<(), StoreError> {
        Ok(())
    }

    fn entries(&mut self, after: u64, most: usize) -> Result<Vec<Entry>, StoreError> {
        self.session.read(async |client| audit::entries(client, after, most).await)
    }

    fn ends(&mut self) -> Result<Ends, StoreError> {
        self.session.read(audit::ends)
    }

    fn heads(&mut self) -> Result<Heads, StoreError> {
        self.session.read(audit::heads)
    }

    fn put_key(&mut self, key: &str, cut: Option<&str>, record: &AuditRecord) -> Result<(), StoreError> {
        self.write(async |client| {
            audit::put_key(client, key, cut).await?;
            audit::append(client, std::slice::from_ref(record)).await?;
            Ok(())
        })
    }

    fn put_head(&mut self, note: &str) -> Result<(), StoreError> {
        self.write(async |client| audit::put(client, "end", note).await)
    }

    fn cut(&mut self, until: u64, note: &str) -> Result<(), StoreError> {
        self.write(async |client| audit::cut(client, until, note).await)
    }

    fn open_intents(&mut self) -> Result<Vec<(u64, Option<String>)>, StoreError> {
        self.session.read(audit::open_intents)
    }

    fn add_token(&mut self, token: &NewToken, author: &Author) -> Result<i64, StoreError> {
        self.write(async |client| users::add_token(client, token, author).await)
    }

    fn revoke_token(&mut self, number: i64, author: &Author) -> Result<bool, StoreError> {
        self.write(async |client| users::revoke_token(client, number, author).await)
    }

    fn tokens(&mut self) -> Result<Vec<Token>, StoreError> {
        self.session.read(users::tokens)
    }

    fn cameras(&mut self, of: Option<&RobotName>) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
        self.session.read(async |client| match of {
            Some(_) => cameras::all(client, of).await,
            None => cameras::of_all(client).await,
        })
    }

    fn grant_camera(&mut self, new: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        self.write(async |client| cameras::give(client, new, author).await)
    }

    fn revoke_camera(&mut self, grant: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        self.write(async |client| cameras::revoke(client, grant, author).await)
    }

    fn users(&mut self) -> Result<Vec<StoredUser>, StoreError> {
        self.session.read(users::all)
    }

    fn change_user(&mut self, change: &UserChange, author: &Author) -> Result<(Decided, u64), StoreError> {
        self.write(async |client| users::change(client, change, author).await)
    }

    fn put_link(&mut self, link: &Link, author: &Author) -> Result<(), StoreError> {
        self.write(async |client| users::put_link(client, link, author).await)
    }

    fn link(&mut self, hash: &[u8; 32], now: u64) -> Result<Option<Link>, StoreError> {
        let link = self.session.read(async |client| users::link(client, hash).await)?;
        Ok(link.filter(|link| link.is_valid(now)))
    }

    fn remove_setup_link(&mut self) -> Result<(), StoreError> {
        self.write(async |client| {
            client.execute("DELETE FROM link WHERE \"user\" = ''", &[]).await?;
            Ok(())
        })
    }

    fn seat(&mut self, robot: &RobotName) -> Result<Saved, StoreError> {
        self.session.read(async |client| robots::seat(client, robot).await)
    }

    fn save_seat(&mut self, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
        self.write(async |client| robots::save_seat(client, robot, saved).await)
    }

    fn alarms(&mut self, robot: &RobotName) -> Result<alarms::Saved, StoreError> {
        self.session.read(async |client| robots::alarms(client, robot).await)
    }

    fn save_alarms(
        &mut self,
        robot: &RobotName,
        saved: &alarms::Saved,
        records: &[AuditRecord],
    ) -> Result<(), StoreError> {
        self.write(async |client| {
            robots::save_alarms(client, robot, saved).await?;
            audit::append(client, records).await?;
            Ok(())
        })
    }

    fn settings(&mut self) -> Result<Option<StoredSettings>, StoreError> {
        self.session.read(robots::settings)
    }

    fn put_settings(&mut self, settings: &StoredSettings, record: &AuditRecord) -> Result<(), StoreError> {
        self.write(async |client| {
            robots::put_settings(client, settings).await?;
            audit::append(client, std::slice::from_ref(record)).await?;
            Ok(())
        })
    }

    fn robots(&mut self) -> Result<Vec<StoredRobot>, StoreError> {
        self.session.read(robots::all)
    }

    fn put_robot(&mut self, robot: &StoredRobot, record: &AuditRecord) -> Result<(), StoreError> {
        self.write(async |client| {
            robots::put(client, robot).await?;
            if let Ok(address) = r6_client::address_with_port(&robot.address) {
                arms::tie(client, &[(robot.name.clone(), address)], &[]).await?;
            }
            audit::append(client, std::slice::from_ref(record)).await?;
            Ok::<_, StoreError>(())
        })?;
        self.say_look_again();
        Ok(())
    }

    fn remove_robot(&mut self, name: &RobotName, records: &[AuditRecord]) -> Result<(), StoreError> {
        self.write(async |client| {
            robots::remove(client, name).await?;
            audit::append(client, records).await?;
            Ok::<_, StoreError>(())
        })?;
        self.say_look_again();
        Ok(())
    }

    fn programs(&mut self) -> Result<Vec<Kept>, StoreError> {
        self.session.read(programs::latest)
    }

    fn program_versions(&mut self, name: &ProgramName) -> Result<Vec<Kept>, StoreError> {
        self.session.read(async |client| programs::versions(client, name).await)
    }

    fn program(
        &mut self,
        name: &ProgramName,
        version: Option<u64>,
    ) -> Result<Option<(Kept, String)>, StoreError> {
        self.session.read(async |client| programs::one(client, name, version).await)
    }

    fn put_program(&mut self, new: &NewVersion, condition: &Condition) -> Result<Kept, LibraryError> {
        self.write(async |client| programs::put(client, new, condition).await)
    }

    fn remove_program(
        &mut self,
        name: &ProgramName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        self.write(async |client| versions::remove(client, Named::Program(name), condition, by).await)
    }

    fn points(&mut self) -> Result<Vec<KeptPoint>, StoreError> {
        self.session.read(points::latest)
    }

    fn point_versions(&mut self, name: &PointName) -> Result<Vec<KeptPoint>, StoreError> {
        self.session.read(async |client| points::versions(client, name).await)
    }

    fn put_point(&mut self, new: &NewPoint, condition: &Condition) -> Result<KeptPoint, LibraryError> {
        self.write(async |client| points::put(client, new, condition).await)
    }

    fn remove_point(
        &mut self,
        name: &PointName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        self.write(async |client| versions::remove(client, Named::Point(name), condition, by).await)
    }

    fn begin_run(&mut self, new: &NewRun) -> Result<Begun, StoreError> {
        self.write(async |client| runs::begin(client, new).await)
    }

    fn run_of_key(&mut self, caller: &str, key: &str, since: u64) -> Result<Option<KeptRun>, StoreError> {
        self.session.read(async |client| runs::by_key(client, caller, key, since).await)
    }

    fn run(&mut self, robot: &RobotName, id: u64) -> Result<Option<KeptRun>, StoreError> {
        self.session.read(async |client| runs::one(client, robot, id).await)
    }

    fn runs(&mut self, robot: &RobotName, before: u64, most: usize) -> Result<Vec<Run>, StoreError> {
        self.session.read(async |client| runs::of_robot(client, robot, before, most).await)
    }

    fn open_runs(&mut self) -> Result<Vec<Run>, StoreError> {
        self.session.read(runs::open)
    }

    fn answer_run(&mut self, id: u64, answer: &str) -> Result<(), StoreError> {
        self.write(async |client| runs::answer(client, id, answer).await)
    }

    fn kept(&mut self, robots: &[RobotName]) -> Result<Vec<(Saved, alarms::Saved)>, StoreError> {
        // All questions are sent at once: a hall of robots must not wait for hundreds of answers in turn.
        self.session.read(async |client| {
            let one = |robot| async move {
                futures_util::future::try_join(robots::seat(client, robot), robots::alarms(client, robot))
                    .await
            };
            futures_util::future::try_join_all(robots.iter().map(one)).await
        })
    }

    fn end_runs(&mut self, ends: &[(Run, AuditRecord)]) -> Result<(), StoreError> {
        if ends.is_empty() {
            return Ok(());
        }
        self.write(async |client| {
            for (run, record) in ends {
                runs::end(client, run, true, std::slice::from_ref(record)).await?;
            }
            Ok(())
        })
    }

    fn end_run(&mut self, run: &Run, owed: bool, records: &[AuditRecord]) -> Result<(), StoreError> {
        self.write(async |client| runs::end(client, run, owed, records).await)
    }

    fn owed_stops(&mut self) -> Result<Vec<RobotName>, StoreError> {
        self.session.read(runs::owed)
    }

    fn forget_owed_stop(&mut self, robot: &RobotName) -> Result<(), StoreError> {
        self.write(async |client| runs::forget_owed_stop(client, robot).await)
    }

    fn begin_command(&mut self, new: &NewCommand) -> Result<Noted, StoreError> {
        self.write(async |client| commands::begin(client, new).await)
    }

    fn command_of_key(
        &mut self,
        caller: &str,
        key: &str,
        since: u64,
    ) -> Result<Option<KeptCommand>, StoreError> {
        self.session.read(async |client| commands::by_key(client, caller, key, since).await)
    }

    fn end_command(&mut self, intent: u64, answer: &str, outcome: &AuditRecord) -> Result<(), StoreError> {
        self.write(async |client| commands::end(client, intent, answer, outcome).await)
    }
}
