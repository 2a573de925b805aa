//! Commands with an `Idempotency-Key`.

use super::*;
use crate::store::commands::{KEPT, KEPT_AT_LEAST, KeptCommand, MAX_KEYS, NewCommand, Noted};

fn new_command(caller: &str, key: &str, now: u64) -> NewCommand {
    let (caller, key) = (caller.to_owned(), key.to_owned());
    NewCommand { caller, key, hash: [7; 32], now, intent: intent() }
}

fn begin(store: &mut dyn Store, new: &NewCommand) -> u64 {
    match store.begin_command(new).unwrap() {
        Noted::New(number) => number,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_key_writes_one_intent_and_keeps_its_answer_with_the_outcome() {
    on_each(|store| {
        store.append(&[record(Deed::GatewayStarted { url: None })]).unwrap();
        let new = new_command("token 1", "a", 1_000);
        let number = begin(store, &new);
        let open = KeptCommand { intent: number, hash: [7; 32], answer: None, ended: false };
        let other = NewCommand { hash: [8; 32], ..new.clone() };
        assert_eq!(store.begin_command(&other).unwrap(), Noted::Known(open.clone()));
        assert_eq!(store.command_of_key("token 1", "a", 1_000).unwrap(), Some(open.clone()));
        assert_eq!(store.command_of_key("token 1", "a", 1_001).unwrap(), None, "it is too old");
        assert_eq!(store.command_of_key("token 2", "a", 0).unwrap(), None, "each caller has its own keys");
        assert_eq!(store.command_of_key("token 1", "b", 0).unwrap(), None);
        assert_eq!(store.open_intents().unwrap(), [(number, Some("press".to_owned()))]);

        store.end_command(number, "{}", &outcome(number)).unwrap();
        let done = KeptCommand { answer: Some("{}".to_owned()), ended: true, ..open.clone() };
        assert_eq!(store.begin_command(&new).unwrap(), Noted::Known(done));
        let second = begin(store, &new_command("token 2", "a", 1_000));
        // What a start writes for a command that it finds without its outcome.
        store.append(&[outcome(second)]).unwrap();
        let lost = KeptCommand { intent: second, ended: true, ..open };
        assert_eq!(store.command_of_key("token 2", "a", 0).unwrap(), Some(lost));
        assert_eq!(numbers(store, 0, 100), [1, 2, 3, 4, 5], "a known key writes nothing");
        assert!(head(store).is_ok() && store.open_intents().unwrap().is_empty());
    });
}

#[test]
fn keys_go_after_a_day() {
    on_each(|store| {
        begin(store, &new_command("anna", "old", 1_000));
        begin(store, &new_command("anna", "edge", 1_000 + KEPT));
        assert!(store.command_of_key("anna", "old", 0).unwrap().is_some(), "a day is not over");
        begin(store, &new_command("anna", "later", 1_001 + KEPT));
        assert_eq!(store.command_of_key("anna", "old", 0).unwrap(), None);
        begin(store, &new_command("anna", "old", 1_001 + KEPT));
    });
}

#[test]
fn the_oldest_keys_make_room_but_not_within_the_time_for_which_they_are_kept_for_certain() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Sqlite::open(folder.path()).unwrap();
    begin(&mut store, &new_command("anna", "first", 1_000));
    // As many as may be kept, without a turn of the disk for each.
    let raw = rusqlite::Connection::open(folder.path().join("control.db")).unwrap();
    let more = MAX_KEYS - 1;
    raw.execute_batch(&format!(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {more})
         INSERT INTO command (intent, caller, key, hash, made)
         SELECT 1000000 + i, 'anna', 'key ' || i, hash, made FROM n, (SELECT hash, made FROM command LIMIT 1)"
    ))
    .unwrap();
    drop(raw);
    let early = new_command("anna", "early", 999 + KEPT_AT_LEAST);
    assert_eq!(store.begin_command(&early), Ok(Noted::Full));
    assert!(store.command_of_key("anna", "first", 0).unwrap().is_some());
    begin(&mut store, &NewCommand { now: 1_000 + KEPT_AT_LEAST, ..early });
    assert_eq!(store.command_of_key("anna", "first", 0).unwrap(), None);
    assert!(store.command_of_key("anna", "key 1", 0).unwrap().is_some(), "one made room for one");
}
