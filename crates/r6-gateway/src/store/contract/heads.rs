//! Signed heads of the audit log, and the removal of its oldest entries.

use super::*;
use crate::core::retention::BATCH;
use crate::store::{Ends, Heads};

#[test]
fn the_ends_of_the_log_are_known() {
    on_each(|store| {
        assert_eq!(store.ends(), Ok(Ends { first: 0, last: 0, hash: Hash::ORIGIN, open: None }));
        store.append(&[record(Deed::GatewayStarted { url: None }), intent(), intent(), outcome(2)]).unwrap();
        let (last, hash) = head(store).unwrap();
        assert_eq!(store.ends(), Ok(Ends { first: 1, last, hash, open: Some(3) }));
        store.append(&[outcome(3)]).unwrap();
        assert_eq!(store.ends().unwrap().open, None);
        // Later commands cannot be removed next, so they are not looked for.
        let many = vec![record(Deed::GatewayStarted { url: None }); usize::try_from(BATCH).unwrap()];
        store.append(&many).unwrap();
        store.append(&[intent()]).unwrap();
        assert_eq!(store.ends().unwrap().open, None);
    });
}

#[test]
fn a_newer_head_takes_the_place_of_the_one_before() {
    on_each(|store| {
        assert_eq!(store.heads(), Ok(Heads::default()));
        store.put_head("first").unwrap();
        store.put_head("second").unwrap();
        assert_eq!(store.heads(), Ok(Heads { end: Some("second".to_owned()), ..Heads::default() }));
    });
}

#[test]
fn another_key_takes_the_place_of_the_one_before_with_what_it_signed() {
    on_each(|store| {
        let text = |text: &str| Some(text.to_owned());
        let told = record(Deed::AuditKey { key: "one".to_owned() });
        store.put_key("one", None, &told).unwrap();
        assert_eq!(store.heads(), Ok(Heads { key: text("one"), ..Heads::default() }));
        store.append(&[intent()]).unwrap();
        store.put_head("of one").unwrap();
        store.cut(1, "of one").unwrap();
        store.put_key("two", Some("of two"), &told).unwrap();
        let heads = Heads { key: text("two"), end: None, cut: text("of two") };
        assert_eq!(store.heads(), Ok(heads));
        let entries = store.entries(0, 10).unwrap();
        assert_eq!(entries.iter().map(|entry| entry.number).collect::<Vec<_>>(), [2, 3]);
        assert!(entries[1].body.contains("audit_key"), "{entries:?}");
        store.put_key("three", None, &told).unwrap();
        assert_eq!(store.heads().unwrap().cut, text("of two"), "it stays as it is");
    });
}

#[test]
fn the_oldest_entries_are_removed_and_the_rest_goes_on() {
    on_each(|store| {
        store.append(&[intent(), outcome(1), intent(), outcome(3)]).unwrap();
        let third = store.entries(2, 1).unwrap().remove(0);
        store.put_head("end").unwrap();
        store.cut(3, "three are gone").unwrap();
        let (end, cut) = (Some("end".to_owned()), Some("three are gone".to_owned()));
        let heads = Heads { key: None, end, cut };
        assert_eq!(store.heads(), Ok(heads.clone()));
        assert_eq!(numbers(store, 0, 10), [4]);
        assert_eq!(store.append(&[intent()]), Ok(5), "no number is used again");
        let ends = store.ends().unwrap();
        assert_eq!((ends.first, ends.last, ends.open), (4, 5, Some(5)));
        let mut verifier = Verifier::after(3, third.hash);
        for entry in store.entries(0, 10).unwrap() {
            verifier.check(entry.number, &entry.body, entry.hash).unwrap();
        }
        assert_eq!(verifier.head(), (5, ends.hash));
        // The newest entry stays: the next one is chained to it.
        store.cut(5, "all are gone").unwrap();
        assert_eq!((store.heads(), numbers(store, 0, 10)), (Ok(heads), vec![4, 5]));
    });
}
