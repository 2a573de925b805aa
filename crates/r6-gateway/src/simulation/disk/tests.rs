//! The oldest entries of the audit log go, on a disk with room and on a full disk.

use r6_api::gateway::Deed;

use super::*;
use crate::auditor::{self, AuditSettings, Auditor};
use crate::core::chain::{Broken, Hash};
use crate::core::head::{Head, Kind, Signer};
use crate::store::Keeper;

const MOST: u64 = 1_000;

fn signer(byte: u8) -> Signer {
    Signer::of_seed([byte; 32]).unwrap()
}

/// A disk with 2500 entries, the first about its key, and the auditor of its gateway.
fn full_log() -> (Disk, Auditor) {
    let disk = Disk::new(1).unwrap();
    let mut store = disk.mount();
    auditor::begin(&mut store, &signer(7)).unwrap();
    let record =
        Author::shell("2026-01-01T00:00:00.000000Z".to_owned()).record(Deed::GatewayStarted { url: None });
    store.append(&vec![record; 2_499]).unwrap();
    let keeper = Keeper::in_task(store, || Duration::ZERO);
    (disk, Auditor::new(keeper, signer(7), AuditSettings { max_entries: MOST }))
}

#[tokio::test]
async fn a_log_without_its_oldest_entries_is_whole_with_the_rightful_head_alone() {
    let (disk, auditor) = full_log();
    assert_eq!((disk.verify(), disk.removed()), (Ok(2_500), Ok(0)));
    auditor.remove_old().await.unwrap();
    assert_eq!((disk.verify(), disk.removed()), (Ok(2_500), Ok(1_500)));
    // More is removed, with the head of another key, and with that of another entry.
    let entry = disk.platter().store.entries(1_599, 1).unwrap().remove(0);
    let head = |hash: Hash| Head { kind: Kind::Cut, number: 1_600, hash, time: "now".to_owned() };
    disk.platter().store.cut(1_600, &signer(8).sign(&head(entry.hash))).unwrap();
    assert_eq!(disk.verify(), Err(VerifyError::OtherKey { what: "the head of the removed entries" }));
    disk.platter().store.cut(1_600, &signer(7).sign(&head(Hash::ORIGIN))).unwrap();
    let broken = VerifyError::Store(Broken::Changed { number: 1_601 }.into());
    assert_eq!(disk.verify(), Err(broken));
    // The rightful key, and more than a gateway removes.
    disk.platter().store.cut(1_600, &signer(7).sign(&head(entry.hash))).unwrap();
    let Err(VerifyError::Changed(why)) = disk.verify() else { panic!("{:?}", disk.verify()) };
    assert!(why.contains("900 entries are left"), "{why}");
}

#[tokio::test]
async fn a_full_disk_loses_no_entry_and_the_removal_goes_on_once_there_is_room() {
    for fullness in [Fullness::Nothing, Fullness::NoPages] {
        let (disk, auditor) = full_log();
        disk.fill(fullness).unwrap();
        // Without a new page, it may go as far as it can.
        let removed = auditor.remove_old().await;
        assert!(removed.is_err() || fullness == Fullness::NoPages, "{removed:?}");
        assert_eq!(disk.verify(), Ok(2_500), "{fullness:?}");
        assert!(disk.removed().unwrap() <= 1_500);
        disk.fill(Fullness::HasRoom).unwrap();
        auditor.remove_old().await.unwrap();
        assert_eq!((disk.verify(), disk.removed()), (Ok(2_500), Ok(1_500)), "{fullness:?}");
    }
}
