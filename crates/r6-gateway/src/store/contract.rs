//! What every store does: one suite for all.

mod cameras;
mod commands;
mod heads;
mod points;
mod programs;
mod runs;

use r6_api::gateway::{
    ActedBy, AuditRecord, CommandOutcome, Deed, GuardWanted, PollGroup, ProgramType, RobotIdentity, Role,
    Run, RunEnd, RunState,
};

use self::programs::version;
use super::postgres::session::Hand;
use super::postgres::{Database, Postgres};
use super::runs::{Begun, KEPT, KeptRun, MAX_RUNS_OF_ONE, NewRun};
use super::{
    Author, Keeper, Kept, LibraryError, Link, Memory, NewToken, NewVersion, Sqlite, Store, StoreError,
    StoredRobot, StoredSettings, UserChange,
};
use crate::core::account::{Decided, Denied, PasswordHash, UserName, Wish};
use crate::core::alarms;
use crate::core::chain::{Broken, Hash, Verifier};
use crate::core::history::sample::Micros;
use crate::core::library::{Condition, MAX_PROGRAMS, MAX_VERSIONS, ProgramName, Tag, Unfit};
use crate::core::name::RobotName;
use crate::core::role::{Grant, GrantRobots};
use crate::core::seat::Saved;
use crate::expiry::Expiry;

/// Runs a test on a new store of each kind.
fn on_each(test: impl Fn(&mut dyn Store)) {
    test(&mut Memory::default());
    let folder = tempfile::tempdir().unwrap();
    test(&mut Sqlite::open(folder.path()).unwrap());
    on_postgres(|database| {
        test(&mut Postgres::open(database, Hand::Shell).unwrap());
    });
}

/// Runs a test on a new database.
pub fn on_postgres(test: impl Fn(&Database)) {
    let name = std::thread::current().name().unwrap_or("a test").to_owned();
    if let Some(server) = r6_testkit::postgres::shared(&name) {
        test(&Database::parse(&server.database()).unwrap());
    }
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
    let robots = only.map(|names| GrantRobots::read(names).unwrap());
    let expires = (byte == 2).then_some(Expiry(1_900_000_000));
    NewToken {
        hash: [byte; 32],
        grant: Grant { role: Role::Engineer, robots },
        name: format!("token {byte}"),
        expires,
    }
}

fn author() -> Author {
    let time = "2026-01-01T00:00:00.000000Z".to_owned();
    Author { time, actor: "anna".to_owned(), source: Some("10.0.0.1:5000".to_owned()) }
}

fn change(name: &str, wish: Wish) -> UserChange {
    UserChange { name: UserName::new(name).unwrap(), wish, link: None, if_stamp: None }
}

fn password(text: &str) -> PasswordHash {
    PasswordHash(format!("$argon2id$0101{text}"))
}

/// Robots with roles of their own.
const EACH: &str = "press,saw=viewer,*=operator";

fn grant(role: Role, only: Option<&str>) -> Grant {
    Grant { role, robots: only.map(|names| GrantRobots::read(names).unwrap()) }
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
        assert_eq!(store.append(&[record(Deed::GatewayStarted { url: None })]), Ok(1));
        assert_eq!(store.append(&[intent(), outcome(2), intent()]), Ok(2));
        assert_eq!(store.append(&[]), Ok(5));
        assert_eq!(numbers(store, 0, 2), [1, 2]);
        assert_eq!(numbers(store, 2, 1000), [3, 4]);
        assert!(numbers(store, 4, 1000).is_empty());
        assert!(numbers(store, u64::MAX, 1000).is_empty());
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
        let author = &author();
        assert_eq!(store.add_token(&token(1, None), author), Ok(1));
        assert_eq!(store.add_token(&token(2, Some(EACH)), author), Ok(2));
        let known = store.tokens().unwrap();
        assert_eq!((known[0].number, known[0].hash, known[0].name.as_str()), (1, [1; 32], "token 1"));
        assert_eq!(known[1].grant, token(2, Some(EACH)).grant);
        assert_eq!((known[0].expires, known[1].expires), (None, Some(Expiry(1_900_000_000))));
        assert_eq!(store.revoke_token(2, author), Ok(true));
        assert_eq!(store.revoke_token(2, author), Ok(false));
        assert_eq!(store.revoke_token(9, author), Ok(false));
        assert_eq!(store.tokens().unwrap().len(), 1);
        assert_eq!(store.add_token(&token(3, None), author), Ok(3), "numbers are not used again");
        let told = store.entries(0, 10).unwrap();
        let deeds = told.iter().map(|entry| serde_json::from_str::<AuditRecord>(&entry.body).unwrap().deed);
        let deeds: Vec<_> = deeds.collect();
        let at = "2030-03-17T17:46:40.000000Z";
        let made = matches!(&deeds[1], Deed::TokenMade { token: 2, only: Some(only), expires_at: Some(expires_at), .. }
            if only == EACH && expires_at == at);
        assert!(made, "{deeds:?}");
        assert_eq!(deeds[2], Deed::TokenRevoked { token: 2 });
        assert!(told.iter().all(|entry| !entry.body.contains("0101")), "no hash of a token");
        assert_eq!(head(store).unwrap().0, 4);
    });
}

#[test]
fn users_are_made_changed_removed_and_audited() {
    on_each(|store| {
        let by = &author();
        let put = |role, only, password| {
            let robots = Some(grant(role, only).robots);
            Wish::Put { role, robots, disabled: Some(false), password }
        };
        let made = store.change_user(&change("ben", put(Role::Engineer, Some(EACH), None)), by).unwrap();
        assert!(matches!(made, (Decided::Made(_), 1)));
        let first = change("anna", Wish::FirstAdmin(password("a")));
        assert!(matches!(store.change_user(&first, by), Ok((Decided::Made(_), 2))));
        let users = store.users().unwrap();
        let told: Vec<_> = users.iter().map(|user| (user.account.name.as_str(), user.stamp)).collect();
        assert_eq!(told, [("anna", 2), ("ben", 1)]);
        assert_eq!(users[0].account.password, Some(password("a")));
        assert_eq!(users[1].account.grant, grant(Role::Engineer, Some(EACH)));

        // The last admin stays.
        let denied = Err(StoreError::Denied(Denied::LastAdmin));
        for wish in [Wish::Remove, Wish::Disable, put(Role::Viewer, None, None)] {
            assert_eq!(store.change_user(&change("anna", wish), by), denied);
        }
        assert_eq!(store.users().unwrap(), users);

        let same = put(Role::Engineer, Some(EACH), None);
        assert_eq!(store.change_user(&change("ben", same), by), Ok((Decided::Same, 0)));
        let changed = store.change_user(&change("ben", put(Role::Admin, None, Some(password("b")))), by);
        assert!(matches!(changed, Ok((Decided::Changed(_), 3))));
        let late = UserChange { if_stamp: Some(1), ..change("ben", Wish::Password(password("c"))) };
        assert_eq!(store.change_user(&late, by), Err(StoreError::UserChanged));
        let in_time = UserChange { if_stamp: Some(3), ..late };
        assert!(matches!(store.change_user(&in_time, by), Ok((Decided::Changed(_), 4))));
        assert_eq!(store.change_user(&change("anna", Wish::Remove), by), Ok((Decided::Removed, 5)));
        let [ben] = &store.users().unwrap()[..] else { panic!("one user is left") };
        assert_eq!((ben.account.password.clone(), &ben.created), (Some(password("c")), &by.time));

        let entries = store.entries(0, 10).unwrap();
        let records = entries.iter().map(|entry| serde_json::from_str::<AuditRecord>(&entry.body).unwrap());
        let records: Vec<_> = records.collect();
        assert!(records.iter().all(|record| record.actor == "anna" && record.source == by.source));
        assert!(
            matches!(&records[2].deed, Deed::UserChanged { user, new_password: true, .. } if user == "ben")
        );
        assert!(matches!(&records[4].deed, Deed::UserRemoved { user } if user == "anna"));
        assert!(entries.iter().all(|entry| !entry.body.contains("argon2")), "no hash of a password");
        assert_eq!(head(store).unwrap().0, 5);
    });
}

#[test]
fn a_link_is_used_once_within_its_hour_for_its_user() {
    on_each(|store| {
        let by = &author();
        let link = |byte, user: Option<&str>, made| Link {
            hash: [byte; 32],
            user: user.map(|user| UserName::new(user).unwrap()),
            made,
        };
        let with = |byte, now, change| UserChange { link: Some(([byte; 32], now)), ..change };
        let first = |name| change(name, Wish::FirstAdmin(password(name)));
        let void = Err(StoreError::LinkVoid);

        store.put_link(&link(1, None, 1_000), by).unwrap();
        store.put_link(&link(2, None, 1_000), by).unwrap();
        assert_eq!(store.link(&[1; 32], 1_000), Ok(None), "a newer one took its place");
        assert_eq!(store.link(&[2; 32], 4_599), Ok(Some(link(2, None, 1_000))));
        assert_eq!((store.link(&[2; 32], 4_600), store.link(&[2; 32], 900)), (Ok(None), Ok(None)));
        assert_eq!(store.change_user(&with(1, 1_000, first("anna")), by), void);
        assert_eq!(store.change_user(&with(2, 4_600, first("anna")), by), void);
        assert!(matches!(store.change_user(&with(2, 4_599, first("anna")), by), Ok((Decided::Made(_), _))));
        assert_eq!(store.change_user(&with(2, 4_599, first("ben")), by), void, "it was used");
        let denied = |denied| Err(StoreError::Denied(denied));
        assert_eq!(store.put_link(&link(3, None, 1_000), by), denied(Denied::HasAdmin));
        assert_eq!(store.put_link(&link(3, Some("ben"), 1_000), by), denied(Denied::NoSuchUser));

        let add = |name| change(name, Wish::Add(grant(Role::Viewer, None)));
        store.change_user(&add("ben"), by).unwrap();
        store.put_link(&link(4, Some("ben"), 1_000), by).unwrap();
        let set = |name| change(name, Wish::Password(password("new")));
        for foreign in [set("anna"), first("cem"), change("ben", Wish::Remove)] {
            assert_eq!(store.change_user(&with(4, 1_000, foreign), by), void);
        }
        assert!(store.change_user(&with(4, 1_000, set("ben")), by).is_ok());
        assert_eq!(store.change_user(&with(4, 1_000, set("ben")), by), void);

        // Another password and the end of the user end the link.
        let other = change("ben", Wish::Password(password("other")));
        for end in [other, change("ben", Wish::Remove)] {
            store.put_link(&link(5, Some("ben"), 1_000), by).unwrap();
            store.change_user(&end, by).unwrap();
            assert_eq!(store.link(&[5; 32], 1_000), Ok(None));
        }
    });
}

#[test]
fn a_file_from_before_there_were_users_gets_their_tables() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Sqlite::open(folder.path()).unwrap();
    store.append(&[intent()]).unwrap();
    drop(store);
    let raw = rusqlite::Connection::open(folder.path().join("control.db")).unwrap();
    raw.execute_batch(
        "DROP TABLE camera; DROP TABLE command; DROP TABLE audit_head; ALTER TABLE seat DROP COLUMN stopped_by; DROP TABLE run; DROP TABLE user; DROP TABLE link; DROP TABLE alarm; DROP TABLE hall;
         PRAGMA user_version = 2",
    )
    .unwrap();
    let mut store = Sqlite::open_existing(folder.path()).unwrap();
    assert_eq!((store.users(), head(&mut store).unwrap().0), (Ok(Vec::new()), 1));
    raw.execute_batch("PRAGMA user_version = 1000").unwrap();
    assert!(matches!(Sqlite::open_existing(folder.path()), Err(StoreError::Unavailable(_))));
}

#[test]
fn a_seat_is_kept_and_its_number_never_falls() {
    on_each(|store| {
        let (press, saw) = (RobotName::new("press").unwrap(), RobotName::new("saw").unwrap());
        assert_eq!(store.seat(&press), Ok(Saved::default()));
        let identity = RobotIdentity { axis_count: Some(6), ..RobotIdentity::default() };
        let stopped_by = Some(ActedBy { by: "token 1 (r6 up)".to_owned(), at: author().time });
        let saved = Saved { number: 7, stopped: true, stopped_by, identity: Some(identity) };
        store.save_seat(&press, &saved).unwrap();
        assert_eq!(store.seat(&press), Ok(saved.clone()));
        let cleared = Saved { stopped: false, stopped_by: None, identity: None, ..saved };
        store.save_seat(&press, &cleared).unwrap();
        assert_eq!((store.seat(&press), store.seat(&saw)), (Ok(cleared), Ok(Saved::default())));
    });
}

#[test]
fn alarms_are_kept_with_their_records_or_not_at_all() {
    on_each(|store| {
        let (press, saw) = (RobotName::new("press").unwrap(), RobotName::new("saw").unwrap());
        assert_eq!(store.alarms(&press), Ok(alarms::Saved::default()));
        let acknowledged =
            alarms::Acknowledged {
                by: "anna".to_owned(), at: Micros(9), comment: Some("\"部\"".to_owned())
            };
        let alarm = alarms::Alarm {
            id: 5,
            code: 7,
            since: Micros(5),
            begin_seen: true,
            until: None,
            end_seen: false,
            acknowledged: Some(acknowledged),
        };
        let ended =
            alarms::Alarm { until: Some(Micros(4)), end_seen: true, acknowledged: None, ..alarm.clone() };
        let (by, reason) = ("ben".to_owned(), "worn".to_owned());
        let shelf = alarms::Shelf { code: 7, by, at: Micros(6), until: Micros(8), reason };
        let saved = alarms::Saved {
            last_id: 5,
            active: Some(alarm),
            ended: vec![ended],
            shelves: vec![shelf],
            is_replaced: true,
        };
        let comment = None;
        let deed = Deed::AlarmAcknowledged { alarm: 5, code: 7, comment };
        store.save_alarms(&press, &saved, &[record(deed.clone())]).unwrap();
        assert_eq!(store.alarms(&press), Ok(saved.clone()));
        assert_eq!(store.alarms(&saw), Ok(alarms::Saved::default()));
        let later = alarms::Saved { active: None, ..saved };
        store.save_alarms(&press, &later, &[]).unwrap();
        assert_eq!(store.alarms(&press), Ok(later.clone()));
        let told: Vec<_> = store.entries(0, 10).unwrap();
        assert_eq!(told.len(), 1);
        assert_eq!(serde_json::from_str::<AuditRecord>(&told[0].body).unwrap().deed, deed);
        // A robot that is removed and added again has its numbers.
        store.remove_robot(&press, &[]).unwrap();
        assert_eq!(store.alarms(&press), Ok(later));
    });
}

#[test]
fn a_restore_forgets_what_was_acknowledged_and_shelved() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Sqlite::open(folder.path()).unwrap();
    let press = RobotName::new("press").unwrap();
    store.save_alarms(&press, &alarms::Saved { last_id: 5, ..Default::default() }, &[]).unwrap();
    store.stop_all(&record(Deed::GatewayStarted { url: None })).unwrap();
    assert_eq!(store.alarms(&press), Ok(alarms::Saved::default()));
}

#[test]
fn settings_are_put_replaced_and_audited() {
    on_each(|store| {
        assert_eq!(store.settings(), Ok(None));
        for version in 1..=2 {
            let new = StoredSettings { version, text: format!("{{\"of\":{version}}}") };
            let deed = Deed::SettingsChanged { version, time_zone: "UTC".to_owned(), shifts: Vec::new() };
            store.put_settings(&new, &record(deed)).unwrap();
            assert_eq!(store.settings(), Ok(Some(new)));
        }
        let told = store.entries(0, 10).unwrap();
        assert!(told.len() == 2 && told[1].body.contains("\"settings_changed\",\"version\":2"), "{told:?}");
    });
}

fn group() -> PollGroup {
    PollGroup { period_ms: 20, read: vec!["Addr-801".to_owned()], keep: false, deadband: Some(0.5) }
}

fn guard() -> Option<Box<GuardWanted>> {
    Some(Box::new(GuardWanted { max_speed: Some(12.5), ..GuardWanted::default() }))
}

#[test]
fn robots_are_put_replaced_removed_and_audited() {
    on_each(|store| {
        let robot = |name: &str, address: &str| StoredRobot {
            name: RobotName::new(name).unwrap(),
            address: address.to_owned(),
            period_ms: 100,
            read: vec!["Addr-800".to_owned()],
            groups: (name == "press").then(group).into_iter().collect(),
            model: (name == "saw").then(|| "BRTIRUS0707A".to_owned()),
            parts: (name == "saw").then(|| "counter-3".to_owned()),
            guard: (name == "saw").then(guard).flatten(),
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

#[test]
fn a_file_of_the_first_version_gets_all_new_tables() {
    let folder = tempfile::tempdir().unwrap();
    let robot = |model: Option<&str>| StoredRobot {
        name: RobotName::new("saw").unwrap(),
        address: "10.0.0.1".to_owned(),
        period_ms: 100,
        read: Vec::new(),
        groups: Vec::new(),
        model: model.map(str::to_owned),
        parts: model.map(|_| "counter-3".to_owned()),
        guard: model.and_then(|_| guard()),
    };
    let mut store = Sqlite::open(folder.path()).unwrap();
    store.put_robot(&robot(None), &record(Deed::RobotRemoved {})).unwrap();
    drop(store);
    // As r6 wrote it before there were programs.
    let raw = rusqlite::Connection::open(folder.path().join("control.db")).unwrap();
    let before =
        "DROP TABLE camera; DROP TABLE command; DROP TABLE audit_head; ALTER TABLE seat DROP COLUMN stopped_by; DROP TABLE run; DROP TABLE user; DROP TABLE link; DROP TABLE program;
                  DROP TABLE alarm; DROP TABLE hall;
                  ALTER TABLE robot DROP COLUMN model; DROP TABLE poll_groups; DROP TABLE robot_more; DROP TABLE token_end; PRAGMA user_version = 1;";
    raw.execute_batch(before).unwrap();
    drop(raw);
    let mut store = Sqlite::open(folder.path()).unwrap();
    assert_eq!(store.robots(), Ok(vec![robot(None)]));
    store.put_program(&version("pick", "a"), &Condition::default()).unwrap();
    store.put_robot(&robot(Some("BRTIRUS0707A")), &record(Deed::RobotRemoved {})).unwrap();
    drop(store);
    let mut store = Sqlite::open_existing(folder.path()).unwrap();
    assert_eq!(store.robots(), Ok(vec![robot(Some("BRTIRUS0707A"))]));
    assert_eq!(store.programs().unwrap().len(), 1);
    assert_eq!(head(&mut store).unwrap().0, 3);
}
