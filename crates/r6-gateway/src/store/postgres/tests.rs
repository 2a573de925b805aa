//! What a database alone does: fences, the row of the owner, versions of tables. `store/contract.rs` has what
//! all stores do.

use r6_api::gateway::{AuditRecord, Deed};
use r6_testkit::postgres::{Server, shared};

use super::owner::OwnerRow;
use super::*;
use crate::core::chain::Verifier;
use crate::core::owner::{RowState, Seen};
use crate::core::role::Grant;

fn started() -> AuditRecord {
    let (time, actor) = ("2026-01-01T00:00:00.000000Z".to_owned(), "gateway".to_owned());
    AuditRecord { time, actor, source: None, robot: None, deed: Deed::GatewayStarted {} }
}

fn author() -> Author {
    Author::shell("2026-01-01T00:00:00.000000Z".to_owned())
}

fn token(byte: u8) -> NewToken {
    let grant = Grant { role: r6_api::gateway::Role::Viewer, only: None };
    NewToken { hash: [byte; 32], grant, name: "a\0b".to_owned() }
}

/// A database with the tables, on the server of all tests.
fn database(test: &str) -> Option<(Server, String, Database)> {
    let server = shared(test)?;
    let url = server.database();
    let database = Database::parse(&url).unwrap();
    drop(Postgres::open(&database, Hand::Shell).unwrap());
    Some((server, url, database))
}

#[test]
fn a_write_with_an_old_fence_is_refused_and_changes_nothing() {
    let Some((server, url, database)) = database("the test of fences") else { return };
    server.sql(&url, "UPDATE r6_gateway.owner SET fence = 4, beat_at = now()");
    let mut owner = Postgres::open(&database, Hand::Owner(4)).unwrap();
    assert_eq!(owner.append(&[started()]), Ok(1));
    server.sql(&url, "UPDATE r6_gateway.owner SET fence = 5");
    let refused = Err(StoreError::NotOwner);
    assert_eq!(owner.append(&[started()]), refused);
    assert_eq!(owner.append(&[]), refused, "as it is asked whether the store can be written");
    assert_eq!(owner.add_token(&token(1), &author()).map(drop), Err(StoreError::NotOwner));
    assert_eq!(
        owner.save_seat(&RobotName::new("saw").unwrap(), &Saved::default()),
        Err(StoreError::NotOwner)
    );
    let mut history = history::PostgresDays::new(&database, Hand::Owner(4)).unwrap();
    let written = crate::store::history::HistoryStore::write(&mut history, 0, &[]);
    assert_eq!(written, Err(StoreError::NotOwner));
    // It still reads.
    assert_eq!(owner.entries(0, 9).unwrap().len(), 1);
    let mut next = Postgres::open(&database, Hand::Owner(5)).unwrap();
    assert_eq!(next.append(&[started()]), Ok(2));
}

#[test]
fn a_reader_writes_nothing_and_the_command_line_writes_beside_the_owner() {
    let Some((server, url, database)) = database("the test of readers") else { return };
    server.sql(&url, "UPDATE r6_gateway.owner SET fence = 1, beat_at = now()");
    let mut owner = Postgres::open(&database, Hand::Owner(1)).unwrap();
    let mut shell = Postgres::open(&database, Hand::Shell).unwrap();
    for number in 0..5 {
        assert_eq!(owner.append(&[started()]), Ok(2 * number + 1));
        assert_eq!(shell.add_token(&token(u8::try_from(number).unwrap()), &author()), Ok(number as i64 + 1));
    }
    let mut reader = Postgres::open_to_read(&database).unwrap();
    reader.hold_still().unwrap();
    assert_eq!(reader.tokens().unwrap()[0].name, "a\u{fffd}b");
    owner.append(&[started()]).unwrap();
    let mut verifier = Verifier::default();
    for entry in reader.entries(0, 1000).unwrap() {
        verifier.check(entry.number, &entry.body, entry.hash).unwrap();
    }
    assert_eq!(verifier.head().0, 10, "all that it reads is of one moment");
    assert_eq!(reader.append(&[started()]), Err(StoreError::NotOwner));
    assert!(Postgres::open_to_read(&Database::parse(&server.database()).unwrap()).is_err(), "no tables");
}

#[test]
fn tables_of_a_newer_version_are_left_alone() {
    let Some((server, url, database)) = database("the test of versions") else { return };
    server.sql(&url, "UPDATE r6_gateway.version SET tables = 1000");
    let is_newer = |error: StoreError| error.to_string().contains("newer r6");
    assert!(Postgres::open(&database, Hand::Shell).is_err_and(is_newer));
    assert!(Postgres::open_to_read(&database).is_err_and(is_newer));
}

#[test]
fn a_server_that_can_lose_what_it_acknowledged_is_told() {
    let Some((server, url, database)) = database("the test of settings") else { return };
    let told = look_at_server(&database).unwrap();
    assert!(told.len() == 2 && told[0].contains("fsync is off"), "{told:?}");
    // What a session of the store commits is durable, whatever is usual in the database.
    let name = server.sql(&url, "SELECT current_database()");
    server.sql(&url, &format!("ALTER DATABASE {name} SET synchronous_commit = off"));
    let setting = |durable| {
        let mut session = Session::new(database.clone(), Hand::Shell, durable).unwrap();
        session
            .bare(async |client| {
                let row = client.query_one("SELECT current_setting('synchronous_commit')", &[]).await?;
                Ok(row.try_get::<_, String>(0)?)
            })
            .unwrap()
    };
    assert_eq!((setting(Durable::Always), setting(Durable::Soon)), ("on".to_owned(), "off".to_owned()));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_robots_go_from_one_gateway_to_the_next_with_a_higher_fence() {
    let made = tokio::task::spawn_blocking(|| database("the test of the owner")).await.unwrap();
    let Some((server, url, database)) = made else { return };
    let (mut one, mut other) = (OwnerRow::new(database.clone()), OwnerRow::new(database));
    let (free, _) = one.look().await.unwrap();
    assert_eq!(free, Seen { fence: 0, beat: 0, state: RowState::Free });
    assert_eq!(one.take(free, "one").await, Ok(Some(1)));
    assert_eq!(other.take(free, "other").await, Ok(None), "the row is another by now");
    let (alive, name) = other.look().await.unwrap();
    assert_eq!((alive.fence, alive.state, name.as_str()), (1, RowState::Alive, "one"));
    assert_eq!(other.take(alive, "other").await, Ok(None), "it lives");
    assert_eq!(one.beat(1).await, Ok(true));
    assert!(other.look().await.unwrap().0.beat > alive.beat);

    server.sql(&url, "UPDATE r6_gateway.owner SET beat_at = now() - interval '3.1 seconds'");
    let (expired, _) = other.look().await.unwrap();
    assert_eq!(expired.state, RowState::Expired);
    assert_eq!(other.take(expired, "other").await, Ok(Some(2)));
    assert_eq!(one.beat(1).await, Ok(false), "its fence is old");
    one.release(1).await.unwrap();
    assert_eq!(other.look().await.unwrap().0.state, RowState::Alive, "it gives back what is not its own");
    other.release(2).await.unwrap();
    assert_eq!(one.look().await.unwrap().0.state, RowState::Free);
    assert_eq!(other.beat(2).await, Ok(false), "it gave them back");
}

#[test]
fn a_session_connects_again_after_the_server_ended_it() {
    let Some((server, url, database)) = database("the test of lost connections") else { return };
    let mut store = Postgres::open(&database, Hand::Shell).unwrap();
    assert_eq!(store.append(&[started()]), Ok(1));
    let ended = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity
                 WHERE pid <> pg_backend_pid() AND datname = current_database()";
    for number in 2..5 {
        server.sql(&url, ended);
        assert_eq!(store.append(&[started()]), Ok(number));
    }
}
