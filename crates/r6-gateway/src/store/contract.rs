//! What every store does: one suite for all.

use r6_api::gateway::{AuditRecord, CommandOutcome, Deed, RobotIdentity, Role};

use super::{Keeper, Memory, NewToken, Sqlite, Store, StoredRobot};
use crate::core::chain::{Broken, Hash, Verifier};
use crate::core::name::RobotName;
use crate::core::role::Grant;
use crate::core::seat::Saved;

/// Runs a test on a new store of each kind.
fn on_each(test: impl Fn(&mut dyn Store)) {
    test(&mut Memory::default());
    let folder = tempfile::tempdir().unwrap();
    test(&mut Sqlite::open(folder.path()).unwrap());
}

fn record(deed: Deed) -> AuditRecord {
    let (time, actor) = ("2026-01-01T00:00:00.000000Z".to_owned(), "1 (test)".to_owned());
    AuditRecord { time, actor, source: None, robot: Some("press".to_owned()), deed }
}

fn intent() -> AuditRecord {
    record(Deed::CommandIntent { command: "clearAlarm".to_owned(), lease: 1 })
}

fn outcome(intent: u64) -> AuditRecord {
    record(Deed::CommandOutcome { intent, outcome: CommandOutcome::Accepted, detail: String::new() })
}

fn token(byte: u8, only: Option<&str>) -> NewToken {
    let only = only.map(|name| RobotName::new(name).unwrap());
    NewToken { hash: [byte; 32], grant: Grant { role: Role::Engineer, only }, name: format!("token {byte}") }
}

fn head(store: &mut dyn Store) -> Result<(u64, Hash), Broken> {
    let mut verifier = Verifier::default();
    for entry in store.entries(0, 1000).unwrap() {
        verifier.check(entry.number, &entry.body, entry.hash)?;
    }
    Ok(verifier.head())
}

fn numbers(store: &mut dyn Store, after: u64, most: usize) -> Vec<u64> {
    store.entries(after, most).unwrap().into_iter().map(|entry| entry.number).collect()
}

#[test]
fn entries_are_numbered_chained_and_read_in_pages() {
    on_each(|store| {
        assert_eq!(store.append(&[record(Deed::GatewayStarted {})]), Ok(1));
        assert_eq!(store.append(&[intent(), outcome(2), intent()]), Ok(2));
        assert_eq!(store.append(&[]), Ok(5));
        assert_eq!(numbers(store, 0, 2), [1, 2]);
        assert_eq!(numbers(store, 2, 1000), [3, 4]);
        assert!(numbers(store, 4, 1000).is_empty());
        assert_eq!(head(store).unwrap().0, 4);
        let entries = store.entries(0, 10).unwrap();
        assert_eq!(serde_json::from_str::<AuditRecord>(&entries[1].body).unwrap(), intent());
    });
}

#[test]
fn a_command_without_its_outcome_is_known() {
    on_each(|store| {
        assert_eq!(store.open_intents(), Ok(vec![]));
        store.append(&[intent(), intent(), intent()]).unwrap();
        store.append(&[outcome(2)]).unwrap();
        let press = Some("press".to_owned());
        assert_eq!(store.open_intents(), Ok(vec![(1, press.clone()), (3, press)]));
        store.append(&[outcome(3), outcome(1)]).unwrap();
        assert_eq!(store.open_intents(), Ok(vec![]));
    });
}

#[test]
fn tokens_are_added_revoked_and_audited() {
    on_each(|store| {
        let time = "2026-01-01T00:00:00.000000Z";
        assert_eq!(store.add_token(&token(1, None), time), Ok(1));
        assert_eq!(store.add_token(&token(2, Some("press")), time), Ok(2));
        let known = store.tokens().unwrap();
        assert_eq!((known[0].number, known[0].hash, known[0].name.as_str()), (1, [1; 32], "token 1"));
        assert_eq!(known[1].grant, token(2, Some("press")).grant);
        assert_eq!(store.revoke_token(2, time), Ok(true));
        assert_eq!(store.revoke_token(2, time), Ok(false));
        assert_eq!(store.revoke_token(9, time), Ok(false));
        assert_eq!(store.tokens().unwrap().len(), 1);
        assert_eq!(store.add_token(&token(3, None), time), Ok(3), "numbers are not used again");
        let told = store.entries(0, 10).unwrap();
        let deeds = told.iter().map(|entry| serde_json::from_str::<AuditRecord>(&entry.body).unwrap().deed);
        let deeds: Vec<_> = deeds.collect();
        assert!(matches!(&deeds[1], Deed::TokenMade { token: 2, only: Some(only), .. } if only == "press"));
        assert_eq!(deeds[2], Deed::TokenRevoked { token: 2 });
        assert!(told.iter().all(|entry| !entry.body.contains("0101")), "no hash of a token");
        assert_eq!(head(store).unwrap().0, 4);
    });
}

#[test]
fn a_seat_is_kept_and_its_number_never_falls() {
    on_each(|store| {
        let (press, saw) = (RobotName::new("press").unwrap(), RobotName::new("saw").unwrap());
        assert_eq!(store.seat(&press), Ok(Saved::default()));
        let identity = RobotIdentity { axis_count: Some(6), ..RobotIdentity::default() };
        let saved = Saved { number: 7, stopped: true, identity: Some(identity) };
        store.save_seat(&press, &saved).unwrap();
        assert_eq!(store.seat(&press), Ok(saved.clone()));
        let cleared = Saved { stopped: false, identity: None, ..saved };
        store.save_seat(&press, &cleared).unwrap();
        assert_eq!((store.seat(&press), store.seat(&saw)), (Ok(cleared), Ok(Saved::default())));
    });
}

#[test]
fn robots_are_put_replaced_removed_and_audited() {
    on_each(|store| {
        let robot = |name: &str, address: &str| StoredRobot {
            name: RobotName::new(name).unwrap(),
            address: address.to_owned(),
            period_ms: 100,
            read: vec!["Addr-800".to_owned()],
        };
        let (saw, press) = (robot("saw", "10.0.0.1"), robot("press", "10.0.0.2"));
        store.put_robot(&saw, &record(Deed::RobotRemoved {})).unwrap();
        store.put_robot(&press, &record(Deed::RobotRemoved {})).unwrap();
        assert_eq!(store.robots(), Ok(vec![press, saw.clone()]));
        let moved = robot("press", "10.0.0.3:9761");
        store.put_robot(&moved, &record(Deed::RobotRemoved {})).unwrap();
        assert_eq!(store.robots(), Ok(vec![moved.clone(), saw.clone()]));
        store.save_seat(&saw.name, &Saved { number: 3, ..Saved::default() }).unwrap();
        store.remove_robot(&saw.name, &[record(Deed::RobotRemoved {})]).unwrap();
        store.remove_robot(&saw.name, &[]).unwrap();
        assert_eq!(store.robots(), Ok(vec![moved]));
        assert_eq!(store.seat(&saw.name).unwrap().number, 3, "the numbers of its leases go on");
        assert_eq!(head(store).unwrap().0, 4);
    });
}

#[test]
fn a_file_keeps_everything_and_two_writers_share_it() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    assert!(Sqlite::open_existing(&data).is_err());
    let mut one = Sqlite::open(&data).unwrap();
    let mut other = Sqlite::open(&data).unwrap();
    for number in 0..10 {
        assert_eq!(one.append(&[intent()]), Ok(2 * number + 1));
        assert_eq!(other.append(&[outcome(2 * number + 1)]), Ok(2 * number + 2));
    }
    drop((one, other));
    let mut again = Sqlite::open_existing(&data).unwrap();
    assert_eq!(head(&mut again).unwrap().0, 20);
    #[cfg(unix)]
    for entry in std::fs::read_dir(&data).unwrap() {
        use std::os::unix::fs::PermissionsExt;
        let entry = entry.unwrap();
        let mode = entry.metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{:?} is for its owner alone", entry.path());
    }
}

#[test]
fn a_file_that_was_changed_is_found() {
    let changes = [
        "UPDATE audit SET body = replace(body, 'clearAlarm', 'startButton') WHERE number = 2",
        "DELETE FROM audit WHERE number = 2",
        "UPDATE audit SET number = CASE number WHEN 2 THEN 99 ELSE 2 END WHERE number IN (2, 3)",
        "UPDATE audit SET hash = zeroblob(32) WHERE number = 3",
    ];
    for change in changes {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Sqlite::open(folder.path()).unwrap();
        store.append(&[intent(), intent(), intent(), intent()]).unwrap();
        assert!(head(&mut store).is_ok());
        let raw = rusqlite::Connection::open(folder.path().join("control.db")).unwrap();
        raw.execute_batch(change).unwrap();
        assert!(head(&mut store).is_err(), "{change}");
    }
}

#[tokio::test]
async fn appends_of_many_callers_each_get_their_own_number() {
    let folder = tempfile::tempdir().unwrap();
    let keeper = Keeper::start(Sqlite::open(folder.path()).unwrap()).unwrap();
    let appends = (0..200).map(|_| keeper.append(vec![intent(), intent()]));
    let mut numbers: Vec<_> =
        futures_util::future::join_all(appends).await.into_iter().map(Result::unwrap).collect();
    numbers.sort_unstable();
    assert_eq!(numbers, (0..200).map(|at| 2 * at + 1).collect::<Vec<_>>());
    assert_eq!(keeper.entries(0, 1000).await.unwrap().len(), 400);
}
