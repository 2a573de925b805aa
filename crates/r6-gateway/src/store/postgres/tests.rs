//! What a database alone does: fences, the row of the owner, versions of tables. `store/contract.rs` has what
//! all stores do.

use std::sync::Arc;
use std::time::Duration;

use r6_api::gateway::{AuditRecord, Deed};
use r6_testkit::postgres::{Server, shared};

use super::arms::Tied;
use super::owner::{OwnerRows, Wanted};
use super::*;
use crate::core::camera::Camera;
use crate::core::chain::Verifier;
use crate::core::owner::{Life, Owned, SeenOwner};
use crate::core::role::Grant;
use crate::peers::Door;
use crate::store::Keeper;

fn started() -> AuditRecord {
    let (time, actor) = ("2026-01-01T00:00:00.000000Z".to_owned(), "gateway".to_owned());
    AuditRecord { time, actor, source: None, robot: None, deed: Deed::GatewayStarted { url: None } }
}

fn author() -> Author {
    Author::shell("2026-01-01T00:00:00.000000Z".to_owned())
}

fn token(byte: u8) -> NewToken {
    let grant = Grant { role: r6_api::gateway::Role::Viewer, robots: None };
    NewToken { hash: [byte; 32], grant, name: "a\0b".to_owned(), expires: None }
}

/// A database with the tables, on the server of all tests.
fn database(test: &str) -> Option<(Server, String, Database)> {
    let server = shared(test)?;
    let url = server.database();
    let database = Database::parse(&url).unwrap();
    drop(Postgres::open(&database, Hand::Shell).unwrap());
    Some((server, url, database))
}

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

fn robot(of: &str) -> Owned {
    Owned::Robot(name(of))
}

/// These, wherever they are.
fn wanted(owned: &[Owned]) -> Wanted {
    owned.iter().map(|owned| (owned.clone(), None)).collect()
}

/// This robot, at this address.
fn placed(of: &str, address: &str) -> Wanted {
    [(robot(of), Some(address.to_owned()))].into()
}

fn door(url: &str) -> Door {
    Door { url: url.to_owned(), ..Door::default() }
}

fn claim(of: &str, fence: u64) -> Claim {
    Claim { of: robot(of), fence }
}

/// Makes gateway 1 the owner of this robot, with this fence.
fn own(server: &Server, url: &str, robot: &str, fence: u64) {
    server.sql(
        url,
        &format!(
            "INSERT INTO r6_gateway.owner VALUES ('{robot}', {fence}, 1)
             ON CONFLICT (robot) DO UPDATE SET fence = {fence}"
        ),
    );
}

#[test]
fn a_write_with_an_old_fence_is_refused_and_changes_nothing() {
    let Some((server, url, database)) = database("the test of fences") else { return };
    own(&server, &url, "saw", 4);
    own(&server, &url, "press", 7);
    let mut owner = Postgres::of_gateway(&database, 1).unwrap();
    owner.hold(&[claim("saw", 4), claim("press", 7)]);
    assert_eq!(owner.append(&[started()]), Ok(1));
    own(&server, &url, "saw", 5);
    let refused = Err(StoreError::NotOwner);
    assert_eq!(owner.append(&[started()]), refused, "one of the two is another gateway's");
    owner.hold(&[claim("saw", 4)]);
    assert_eq!(owner.append(&[started()]), refused);
    assert_eq!(owner.append(&[]), refused, "as it is asked whether the store can be written");
    assert_eq!(owner.save_seat(&name("saw"), &Saved::default()), Err(StoreError::NotOwner));
    let camera = Camera::new(0).unwrap();
    let grant = NewGrant { robot: name("saw"), camera, token: 1 };
    assert_eq!(owner.grant_camera(&grant, &author()), Err(StoreError::NotOwner));
    assert_eq!(owner.revoke_camera(&grant, &author()), Err(StoreError::NotOwner));
    // It still reads, and writes what is about the other robot, and about none.
    assert_eq!(owner.entries(0, 9).unwrap().len(), 1);
    owner.hold(&[claim("press", 7)]);
    assert_eq!(owner.append(&[started()]), Ok(2));
    owner.hold(&[]);
    assert_eq!(owner.add_token(&token(1), &author()), Ok(1));
    let mut next = Postgres::of_gateway(&database, 2).unwrap();
    next.hold(&[claim("saw", 5)]);
    assert_eq!(next.append(&[started()]), Ok(4));
}

#[test]
fn records_that_share_a_commit_with_those_of_a_lost_robot_are_kept() {
    let Some((server, url, database)) = database("the test of one commit") else { return };
    own(&server, &url, "saw", 4);
    own(&server, &url, "press", 7);
    let keeper = Keeper::start(Postgres::of_gateway(&database, 1).unwrap()).unwrap();
    let (lost, kept) = (keeper.under(claim("saw", 3)), keeper.under(claim("press", 7)));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        // They wait behind this one, and come together.
        let first = keeper.work(|_| {
            std::thread::sleep(std::time::Duration::from_millis(100));
            Ok(())
        });
        let one = |keeper: Keeper| async move { keeper.append(vec![started()]).await };
        let all = [kept.clone(), lost.clone(), kept.clone(), keeper.clone(), lost].map(one);
        let (_, told) = tokio::join!(first, futures_util::future::join_all(all));
        let refused = Err(StoreError::NotOwner);
        assert_eq!(told, [Ok(1), refused.clone(), Ok(2), Ok(3), refused]);
        keeper.end().await.unwrap();
    });
}

#[test]
fn the_history_of_a_robot_is_written_by_its_owner_alone() {
    use crate::store::history::HistoryStore as _;
    let Some((server, url, database)) = database("the test of fences of the history") else { return };
    own(&server, &url, "saw", 4);
    own(&server, &url, "press", 7);
    let write = || crate::core::history::block::Write { tail: Some(vec![1, 2]), ..Default::default() };
    let both = || [(name("press"), write()), (name("saw"), write())];
    let mut history = history::PostgresDays::new(&database, Hand::Gateway(1)).unwrap();
    let robots = || {
        let part = crate::store::history::Part { day: 0, number: 1 };
        let mut reader = history::PostgresDays::new(&database, Hand::Reader).unwrap();
        reader.tails(part).map(|tails| tails.iter().map(|tail| tail.robot.to_string()).collect::<Vec<_>>())
    };
    assert_eq!(history.write(0, &both()), Ok(()), "it owns none of them");
    assert_eq!(history.parts().unwrap(), [], "so nothing is there");
    history.hold(&[claim("press", 7), claim("saw", 4)]);
    assert_eq!(history.write(0, &both()), Ok(()));
    assert_eq!(robots().unwrap(), ["press", "saw"]);
    own(&server, &url, "saw", 5);
    server.sql(&url, "DELETE FROM r6_gateway.tail");
    assert_eq!(history.write(0, &both()), Ok(()));
    assert_eq!(robots().unwrap(), ["press"], "another gateway has the saw");
    assert!(!history.may_remove(), "it does not own the hall");
}

#[test]
fn a_reader_writes_nothing_and_the_command_line_writes_beside_the_owner() {
    let Some((server, url, database)) = database("the test of readers") else { return };
    own(&server, &url, "saw", 1);
    let mut owner = Postgres::of_gateway(&database, 1).unwrap();
    owner.hold(&[claim("saw", 1)]);
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
fn two_gateways_give_no_two_robots_one_address() {
    let Some((_server, _url, database)) = database("the test of addresses") else { return };
    let mut store = Postgres::of_gateway(&database, 1).unwrap();
    let robot = |of: &str, address: &str| StoredRobot {
        name: name(of),
        address: address.to_owned(),
        period_ms: 100,
        read: Vec::new(),
        groups: Vec::new(),
        model: None,
        parts: None,
        guard: None,
    };
    assert_eq!(store.put_robot(&robot("saw", "10.0.0.1"), &started()), Ok(()));
    let taken = Err(StoreError::AddressTaken(name("saw")));
    assert_eq!(store.put_robot(&robot("press", "10.0.0.1:9760"), &started()), taken);
    assert_eq!(store.put_robot(&robot("saw", "10.0.0.1:9760"), &started()), Ok(()));
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
async fn gateways_hear_at_once_that_something_is_free_or_a_robot_came() {
    let made = tokio::task::spawn_blocking(|| database("the test of words between gateways")).await.unwrap();
    let Some((_server, _url, database)) = made else { return };
    let heard = Arc::new(tokio::sync::Notify::new());
    let (mut one, mut other) =
        (OwnerRows::new(database.clone()), OwnerRows::hearing(database.clone(), Arc::clone(&heard)));
    one.register(1, &door("one"), "file").await.unwrap();
    let none = other.look().await.unwrap();
    let claims = one.take(1, &wanted(&[robot("press")]), &none.seen).await.unwrap().claims;
    one.beat(1, None, "file").await.unwrap();
    let quiet = tokio::time::timeout(Duration::from_millis(300), heard.notified()).await;
    assert!(quiet.is_err(), "beats say nothing");
    let hears = async |what: &str| {
        let word = tokio::time::timeout(Duration::from_secs(5), heard.notified()).await;
        assert!(word.is_ok(), "{what}");
    };
    one.release(1, &claims[0]).await.unwrap();
    hears("a robot is free").await;
    one.end(1).await.unwrap();
    hears("a gateway has ended").await;
    let store = tokio::task::spawn_blocking(move || Postgres::of_gateway(&database, 2).unwrap());
    let mut store = store.await.unwrap();
    let saw = StoredRobot {
        name: RobotName::new("saw").unwrap(),
        address: "10.0.0.1".to_owned(),
        period_ms: 100,
        read: Vec::new(),
        groups: Vec::new(),
        model: None,
        parts: None,
        guard: None,
    };
    let record = AuditRecord { deed: Deed::RobotRemoved {}, ..started() };
    let put = tokio::task::spawn_blocking(move || {
        store.put_robot(&saw, &record).unwrap();
        (store, saw.name, record)
    });
    let (mut store, name, record) = put.await.unwrap();
    hears("a robot was added").await;
    tokio::task::spawn_blocking(move || store.remove_robot(&name, &[record]).unwrap()).await.unwrap();
    hears("a robot was removed").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_goes_from_one_gateway_to_the_next_with_a_higher_fence() {
    let made = tokio::task::spawn_blocking(|| database("the test of the owner")).await.unwrap();
    let Some((server, url, database)) = made else { return };
    let (mut one, mut other) = (OwnerRows::new(database.clone()), OwnerRows::new(database));
    one.register(1, &door("one"), "file").await.unwrap();
    other.register(2, &door("other"), "file").await.unwrap();
    let both = [robot("press"), robot("saw")];
    let none = one.look().await.unwrap();
    assert_eq!((none.seen.owners.len(), none.doors.len()), (0, 2));
    assert_eq!(one.take(1, &wanted(&both[..1]), &none.seen).await.unwrap().claims, [claim("press", 1)]);
    let taken = other.take(2, &wanted(&both), &none.seen).await.unwrap().claims;
    assert_eq!(taken, [claim("saw", 1)], "the row of the other one is another by now");
    let alive = other.look().await.unwrap();
    assert_eq!(alive.seen.owners[&robot("press")], SeenOwner { fence: 1, gateway: Some(1) });
    assert_eq!((alive.seen.gateways[&1].life, alive.doors[&1].url.as_str()), (Life::Alive, "one"));
    assert_eq!(other.take(2, &wanted(&both[..1]), &alive.seen).await.unwrap().claims, [], "it lives");
    assert_eq!(one.beat(1, None, "file").await.unwrap(), Some([(robot("press"), 1)].into()));
    assert!(other.look().await.unwrap().seen.gateways[&1].beat > alive.seen.gateways[&1].beat);

    let silent = "UPDATE r6_gateway.gateway SET beat_at = now() - interval '3.1 seconds' WHERE id = 1";
    server.sql(&url, silent);
    let expired = other.look().await.unwrap();
    assert_eq!(expired.seen.gateways[&1].life, Life::Expired);
    one.beat(1, None, "file").await.unwrap();
    assert_eq!(
        other.take(2, &wanted(&both[..1]), &expired.seen).await.unwrap().claims,
        [],
        "it has just said that it lives"
    );
    server.sql(&url, silent);
    let expired = other.look().await.unwrap();
    assert_eq!(other.take(2, &wanted(&both[..1]), &expired.seen).await.unwrap().claims, [claim("press", 2)]);
    assert_eq!(
        one.beat(1, None, "file").await.unwrap(),
        Some([].into()),
        "it learns with its beat that it has it no more"
    );
    one.release(1, &claim("press", 1)).await.unwrap();
    let seen = other.look().await.unwrap().seen;
    assert_eq!(seen.owners[&robot("press")].gateway, Some(2), "it gives back what is not its own");
    other.release(2, &claim("press", 2)).await.unwrap();
    let seen = one.look().await.unwrap().seen;
    assert_eq!(seen.owners[&robot("press")], SeenOwner { fence: 2, gateway: None });
    // What a gateway has let go of without giving it back, it takes anew.
    assert_eq!(other.take(2, &wanted(&both[1..]), &seen).await.unwrap().claims, [claim("saw", 2)]);
    other.end(2).await.unwrap();
    assert_eq!(other.beat(2, None, "file").await.unwrap(), None, "it has ended");
    let seen = one.look().await.unwrap().seen;
    assert_eq!(other.take(2, &wanted(&both), &seen).await.unwrap().claims, [], "and takes nothing any more");
    let taken = one.take(1, &wanted(&both), &seen).await.unwrap().claims;
    assert_eq!(taken.len(), 2, "what a gateway that ended had is free at once: {taken:?}");
    // Rows of gateways that ended and have nothing go.
    one.register(3, &door("three"), "file").await.unwrap();
    assert_eq!(one.look().await.unwrap().doors.into_keys().collect::<Vec<_>>(), [1, 3]);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_arm_is_not_taken_under_another_name_while_it_has_an_owner_or_was_stopped() {
    let made = tokio::task::spawn_blocking(|| database("the test of one arm under two names")).await.unwrap();
    let Some((server, url, database)) = made else { return };
    let (mut one, mut other) = (OwnerRows::new(database.clone()), OwnerRows::new(database));
    one.register(1, &door("one"), "file").await.unwrap();
    other.register(2, &door("other"), "file").await.unwrap();
    let (press, same) = (placed("press", "10.0.0.1:9760"), placed("saw", "10.0.0.1:9760"));
    let none = one.look().await.unwrap().seen;
    // At once, before either is there.
    let (first, second) = tokio::join!(one.take(1, &press, &none), other.take(2, &same, &none));
    let (first, second) = (first.unwrap(), second.unwrap());
    assert_eq!(first.claims.len() + second.claims.len(), 1, "{first:?} {second:?}");
    let (had, mut owner, wants, mut next, next_number, next_wants) = match first.claims.is_empty() {
        false => (claim("press", 1), one, press, other, 2, same),
        true => (claim("saw", 1), other, same, one, 1, press),
    };
    let name = had.of.robot().unwrap().clone();
    let wanted_next = next_wants.keys().next().unwrap().clone();
    let looked = next.look().await.unwrap();
    assert_eq!(looked.addresses[&had.of], "10.0.0.1:9760");
    let refused = next.take(next_number, &next_wants, &looked.seen).await.unwrap();
    assert_eq!(refused.tied, [(wanted_next.clone(), Tied::Owned(name.clone()))].into());
    // The owner gives it back, and it was stopped.
    owner.release(3 - next_number, &had).await.unwrap();
    server.sql(
        &url,
        &format!(
            "INSERT INTO r6_gateway.seat (robot, lease_number, stopped) VALUES ('{name}', 1, true),
             ('{}', 1, false)",
            wanted_next.as_str()
        ),
    );
    let seen = next.look().await.unwrap().seen;
    let refused = next.take(next_number, &next_wants, &seen).await.unwrap();
    assert_eq!(
        (refused.claims, refused.tied.get(&wanted_next)),
        (vec![], Some(&Tied::Stopped(name.clone())))
    );
    let elsewhere = placed(name.as_str(), "10.0.0.2:9760");
    let refused = next.take(next_number, &elsewhere, &seen).await.unwrap();
    assert_eq!(refused.tied.get(&had.of), Some(&Tied::Moved("10.0.0.1:9760".to_owned())));
    assert_eq!(
        owner.take(3 - next_number, &wants, &seen).await.unwrap().claims.len(),
        1,
        "under its own name"
    );
    // The stop was cleared, and the owner is silent.
    server.sql(
        &url,
        &format!(
            "UPDATE r6_gateway.seat SET stopped = false; UPDATE r6_gateway.gateway
             SET beat_at = now() - interval '3.1 seconds' WHERE id = {}",
            3 - next_number
        ),
    );
    let seen = next.look().await.unwrap().seen;
    let taken = next.take(next_number, &next_wants, &seen).await.unwrap();
    assert_eq!((taken.claims.len(), taken.tied.len()), (1, 0));
    let of_owner = owner.beat(3 - next_number, None, "file").await.unwrap();
    assert_eq!(of_owner, Some([].into()), "it learns that it has the arm no more");
}

#[test]
fn upkeep_of_the_server_holds_no_entry_of_the_log_up() {
    let Some((server, url, database)) = database("the test of upkeep") else { return };
    // As VACUUM, ANALYZE and CREATE INDEX CONCURRENTLY lock the table.
    std::thread::scope(|scope| {
        scope.spawn(|| {
            server.sql(
                &url,
                "BEGIN; LOCK TABLE r6_gateway.audit IN SHARE UPDATE EXCLUSIVE MODE; SELECT pg_sleep(3); COMMIT",
            )
        });
        std::thread::sleep(std::time::Duration::from_millis(500));
        let mut store = Postgres::open(&database, Hand::Shell).unwrap();
        let begun = std::time::Instant::now();
        assert_eq!(store.append(&[started()]), Ok(1));
        assert!(begun.elapsed() < std::time::Duration::from_secs(1), "{:?}", begun.elapsed());
    });
}

#[test]
fn entries_of_several_writers_have_one_number_each() {
    let Some((_server, _url, database)) = database("the test of several writers") else { return };
    let mut numbers = std::thread::scope(|scope| {
        let write = || {
            let mut store = Postgres::open(&database, Hand::Shell).unwrap();
            (0..50).map(|_| store.append(&[started()]).unwrap()).collect::<Vec<_>>()
        };
        let writers: Vec<_> = (0..4).map(|_| scope.spawn(write)).collect();
        writers.into_iter().flat_map(|writer| writer.join().unwrap()).collect::<Vec<_>>()
    });
    numbers.sort_unstable();
    assert_eq!(numbers, (1..=200).collect::<Vec<_>>());
}

#[test]
fn the_gateway_of_an_older_version_has_let_go_before_its_robots_can_be_taken() {
    let Some((server, url, database)) = database("the test of an older version") else { return };
    // As version 2 made it, with an owner that lives.
    server.sql(
        &url,
        "SET search_path = r6_gateway; UPDATE version SET tables = 2; DROP TABLE camera; DROP TABLE point; DROP TABLE gateway; ALTER TABLE robot DROP COLUMN poll_groups; ALTER TABLE robot DROP COLUMN more; ALTER TABLE token DROP COLUMN expires;
         DROP INDEX run_robot;
         DROP TABLE owner;
         CREATE TABLE owner (one integer, fence bigint, beat bigint, gateway text, beat_at timestamptz);
         INSERT INTO owner VALUES (1, 7, 9, 'old', now())",
    );
    // To read it changes nothing.
    let mut reader = Postgres::open_to_read(&database).unwrap();
    assert_eq!((reader.cameras(None), reader.robots()), (Ok(Vec::new()), Ok(Vec::new())));
    drop(reader);
    let begun = std::time::Instant::now();
    let mut store = Postgres::open(&database, Hand::Shell).unwrap();
    assert!(begun.elapsed() >= std::time::Duration::from_millis(3_500), "{:?}", begun.elapsed());
    assert_eq!(server.sql(&url, "SELECT count(*) FROM r6_gateway.owner"), "0");
    assert_eq!(store.cameras(None), Ok(Vec::new()));
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
