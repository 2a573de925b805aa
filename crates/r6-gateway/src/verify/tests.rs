//! Logs that were changed, cut off, shortened and restored.

use r6_api::gateway::{AuditRecord, CommandOutcome, Deed, Role};

use super::*;
use crate::auditor::{self, AuditSettings, Auditor, open_key};
use crate::store::Keeper;

fn record(deed: Deed) -> AuditRecord {
    let (time, actor) = ("2026-01-01T00:00:00.000000Z".to_owned(), "gateway".to_owned());
    AuditRecord { time, actor, source: None, robot: None, deed }
}

fn started(count: usize) -> Vec<AuditRecord> {
    vec![record(Deed::GatewayStarted { url: None }); count]
}

/// An auditor of a folder with this many entries; the first one tells of its key.
async fn folder(entries: usize, max_entries: u64) -> (tempfile::TempDir, Auditor, Keeper) {
    let folder = tempfile::tempdir().unwrap();
    let (auditor, keeper) = start(folder.path(), max_entries).unwrap();
    keeper.append(started(entries - 1)).await.unwrap();
    (folder, auditor, keeper)
}

/// What the start of a gateway does with the audit log of its folder.
fn start(folder: &Path, max_entries: u64) -> Result<(Auditor, Keeper), StoreError> {
    let mut store = Sqlite::open(folder)?;
    let signer = open_key(folder)?;
    auditor::begin(&mut store, &signer)?;
    let keeper = Keeper::start(store).unwrap();
    Ok((Auditor::new(keeper.clone(), signer, AuditSettings { max_entries }), keeper))
}

/// What a gateway of version 5 of the tables left: a log without heads.
fn make_old(folder: &Path) {
    change(
        folder,
        "DROP TABLE camera; DROP TABLE command; DROP TABLE audit_head; ALTER TABLE seat DROP COLUMN stopped_by; PRAGMA user_version = 5",
    );
}

fn change(folder: &Path, sql: &str) {
    rusqlite::Connection::open(folder.join("control.db")).unwrap().execute_batch(sql).unwrap();
}

fn changed(verified: Result<Verified, VerifyError>) -> String {
    let Err(VerifyError::Changed(why)) = verified else { panic!("{verified:?}") };
    why
}

#[tokio::test]
async fn a_log_that_was_cut_off_or_rewritten_is_found_with_a_head_that_was_kept() {
    let (folder, auditor, keeper) = folder(5, 1_000).await;
    let path = folder.path();
    auditor.put_head().await.unwrap();
    let (_, note) = auditor.head().await.unwrap();
    let keys = [auditor.key()];
    keeper.append(started(2)).await.unwrap();
    let verified = verify(path, &keys, Some(&note)).unwrap();
    assert_eq!((verified.entries, verified.stored.unwrap().number, verified.kept.unwrap().number), (7, 5, 5));
    // As the API gives it, and as an editor of another system leaves it.
    let answer = serde_json::json!({ "number": 5, "note": note }).to_string();
    for text in [answer, note.replace('\n', "\r\n")] {
        assert_eq!(verify(path, &[], Some(&text)).unwrap().kept.unwrap().number, 5);
    }

    // Its end is cut off, and the stored head with it: only the kept one tells.
    change(path, "DELETE FROM audit WHERE number > 4");
    assert!(changed(verify(path, &[], None)).contains("the stored head"));
    change(path, "DELETE FROM audit_head WHERE what = 'end'");
    assert_eq!(verify(path, &[], None).unwrap().entries, 4);
    let why = changed(verify(path, &[], Some(&note)));
    assert!(why.contains("the kept head") && why.contains("its end was cut off"), "{why}");

    // It goes on with other entries, whose hashes fit. The gateway that runs knows what it signed.
    let lost = Err(StoreError::Broken(Broken::Head { number: 5 }));
    assert_eq!(auditor.head().await.map(drop), lost);
    keeper.append(vec![record(Deed::GatewayEnded { url: None })]).await.unwrap();
    assert_eq!(verify(path, &[], None).unwrap().entries, 5);
    assert!(changed(verify(path, &[], Some(&note))).contains("rewritten"));
    assert_eq!(auditor.put_head().await, lost, "no newer head hides it");
}

#[tokio::test]
async fn a_log_that_was_cut_off_or_rewritten_while_the_gateway_was_off_does_not_start() {
    let (folder, auditor, keeper) = folder(5, 1_000).await;
    let path = folder.path();
    auditor.put_head().await.unwrap();
    drop((auditor, keeper));
    let broken = |path: &Path| match start(path, 1_000) {
        Err(StoreError::Broken(broken)) => broken,
        other => panic!("{other:?}"),
    };
    change(
        path,
        "CREATE TABLE old AS SELECT number, body, hash FROM audit; DELETE FROM audit WHERE number > 4",
    );
    assert_eq!(broken(path), Broken::Head { number: 5 });
    change(
        path,
        "INSERT INTO audit (number, body, hash) SELECT 5, body, zeroblob(32) FROM old WHERE number = 5",
    );
    assert_eq!(broken(path), Broken::Head { number: 5 });
    change(path, "DELETE FROM audit");
    assert_eq!(broken(path), Broken::Head { number: 5 });
    change(path, "INSERT INTO audit (number, body, hash) SELECT * FROM old WHERE number > 1");
    assert_eq!(broken(path), Broken::Missing { wanted: 1, found: 2 });
    change(path, "INSERT INTO audit (number, body, hash) SELECT * FROM old WHERE number = 1");
    change(path, "UPDATE audit_head SET text = replace(text, 'end ', 'cut ') WHERE what = 'end'");
    assert_eq!(broken(path), Broken::Signature(Unfit::Forged));
    change(path, "DELETE FROM audit_head WHERE what = 'key'");
    assert_eq!(broken(path), Broken::Signature(Unfit::OtherKey));
    change(path, "DELETE FROM audit_head");
    assert!(start(path, 1_000).is_ok(), "without heads nothing tells");
}

#[tokio::test]
async fn a_head_of_another_key_and_what_is_no_head_are_refused() {
    let (one, auditor, _keeper) = folder(3, 1_000).await;
    let (_other, stranger, _strangers) = folder(3, 1_000).await;
    auditor.put_head().await.unwrap();
    let (_, note) = stranger.head().await.unwrap();
    let other_key = |what| Err(VerifyError::OtherKey { what });
    assert_eq!(verify(one.path(), &[], Some(&note)), other_key("the kept head"));
    assert_eq!(verify(one.path(), &[stranger.key()], None), other_key("the stored head"));
    // Both keys are known: the entry is another one all the same.
    let both = [auditor.key(), stranger.key()];
    assert!(changed(verify(one.path(), &both, Some(&note))).contains("is not that of the kept head"));
    let (_, own) = auditor.head().await.unwrap();
    let forged = own.replacen("\n3\n", "\n2\n", 1);
    assert!(changed(verify(one.path(), &[], Some(&forged))).contains("it was changed"));
    for text in ["", "{}", "{\"note\":\"\"}", "letter"] {
        assert_eq!(verify(one.path(), &[], Some(text)), Err(VerifyError::NoHead), "{text}");
    }
    // A head of the end does not stand for removed entries.
    change(one.path(), "UPDATE audit_head SET what = 'cut' WHERE what = 'end'");
    assert!(changed(verify(one.path(), &[], None)).contains("for something else"));
    change(one.path(), "UPDATE audit_head SET what = 'end' WHERE what = 'cut'");
    change(one.path(), "DELETE FROM audit_head WHERE what = 'key'");
    assert_eq!(verify(one.path(), &[], None), Err(VerifyError::NoKey));
    std::fs::write(one.path().join("audit.key"), "no key").unwrap();
    assert!(open_key(one.path()).is_err(), "it is not replaced");
}

#[tokio::test]
async fn another_key_is_told_by_the_log_and_signs_what_the_one_before_signed() {
    let (folder, auditor, keeper) = folder(1_500, 1_000).await;
    let path = folder.path();
    auditor.remove_old().await.unwrap();
    auditor.put_head().await.unwrap();
    let (old, (_, note)) = (auditor.key(), auditor.head().await.unwrap());
    drop((auditor, keeper));
    // The same key: nothing is told.
    let (auditor, keeper) = start(path, 1_000).unwrap();
    assert_eq!(keeper.ends().await.unwrap().last, 1_500);
    drop((auditor, keeper));

    std::fs::remove_file(path.join("audit.key")).unwrap();
    let (auditor, keeper) = start(path, 1_000).unwrap();
    let new = auditor.key();
    let told = keeper.entries(1_500, 10).await.unwrap();
    let body = format!(r#""what":"audit_key","key":"{new}""#);
    assert!(told.len() == 1 && told[0].body.contains(&body), "{told:?}");
    auditor.put_head().await.unwrap();
    let verified = verify(path, &[], None).unwrap();
    assert_eq!((verified.removed, verified.entries), (500, 1_001));
    assert_eq!((verified.key, verified.stored.unwrap().number), (Some(new.to_string()), 1_501));
    // Heads of before are checked with both keys.
    assert_eq!(
        verify(path, &[old], Some(&note)),
        Err(VerifyError::OtherKey { what: "the head of the removed entries" })
    );
    assert_eq!(verify(path, &[old, new], Some(&note)).unwrap().kept.unwrap().number, 1_500);
    // A process that ended between the file of a key and the store begins with this key.
    drop((auditor, keeper));
    std::fs::remove_file(path.join("audit.key")).unwrap();
    let made = open_key(path).unwrap().key();
    assert_eq!(start(path, 1_000).unwrap().0.key(), made);
    assert_eq!(verify(path, &[made], None).unwrap().entries, 1_002);
}

#[tokio::test]
async fn the_oldest_entries_go_up_to_the_first_open_command_and_the_rest_is_whole() {
    let (folder, auditor, keeper) = folder(2_200, 1_000).await;
    let path = folder.path();
    let intent = Deed::CommandIntent { command: "clearAlarm".to_owned(), lease: 1 };
    assert_eq!(keeper.append(vec![record(intent)]).await, Ok(2_201));
    keeper.append(started(1_299)).await.unwrap();
    let (_, early) = auditor.head().await.unwrap();
    auditor.remove_old().await.unwrap();
    let verified = verify(path, &[], Some(&early)).unwrap();
    assert_eq!((verified.removed, verified.entries), (2_200, 1_300), "the command has no outcome yet");
    assert_eq!(verified.stored.unwrap().number, 3_500, "it is not about an entry that can go");
    let (outcome, detail) = (CommandOutcome::Accepted, String::new());
    keeper.append(vec![record(Deed::CommandOutcome { intent: 2_201, outcome, detail })]).await.unwrap();
    auditor.remove_old().await.unwrap();
    let verified = verify(path, &[], Some(&early)).unwrap();
    assert_eq!((verified.removed, verified.entries), (2_501, 1_000));

    // More comes between two looks than is kept.
    keeper.append(started(1_500)).await.unwrap();
    auditor.remove_old().await.unwrap();
    assert_eq!(verify(path, &[], None).unwrap().removed, 4_001);
    let old = VerifyError::Removed { number: 3_500, removed: 4_001 };
    assert_eq!(verify(path, &[], Some(&early)), Err(old));
    assert!(auditor.head().await.is_ok(), "what was signed is still known");

    // The head of the cut is what the chain begins with.
    change(path, "DELETE FROM audit WHERE number = (SELECT min(number) FROM audit)");
    let missing = Err(VerifyError::Store(Broken::Missing { wanted: 4_002, found: 4_003 }.into()));
    assert_eq!(verify(path, &[], None), missing);
    change(path, "DELETE FROM audit");
    assert!(changed(verify(path, &[], None)).contains("its end was cut off"));
    change(path, "DELETE FROM audit_head WHERE what = 'end'");
    assert_eq!(verify(path, &[], None), Err(VerifyError::Store(Broken::Head { number: 4_001 }.into())));
}

#[tokio::test]
async fn a_kept_head_is_never_taken_from_the_head_of_the_removed_entries() {
    let (folder, auditor, keeper) = folder(1_000, 1_000).await;
    let path = folder.path();
    let (_, kept) = auditor.head().await.unwrap();
    keeper.append(started(1_000)).await.unwrap();
    auditor.remove_old().await.unwrap();
    // Exactly the entries up to that of the kept head were removed.
    let removed = VerifyError::Removed { number: 1_000, removed: 1_000 };
    assert_eq!(verify(path, &[], Some(&kept)), Err(removed));
    // A person with the folder signs that more was removed, up to an entry of their choice.
    let hash = keeper.entries(1_499, 1).await.unwrap().remove(0).hash;
    let cut = Head { kind: Kind::Cut, number: 1_500, hash, time: "now".to_owned() };
    keeper.cut(1_500, open_key(path).unwrap().sign(&cut)).await.unwrap();
    let why = changed(verify(path, &[], None));
    assert!(why.contains("500 entries are left"), "{why}");
}

#[tokio::test]
async fn entries_that_were_changed_are_not_removed() {
    let (folder, auditor, keeper) = folder(2_500, 1_000).await;
    let path = folder.path();
    change(path, "UPDATE audit SET body = replace(body, 'started', 'ended') WHERE number = 1200");
    let changed = Err(StoreError::Broken(Broken::Changed { number: 1_200 }));
    assert_eq!(auditor.remove_old().await, changed);
    let ends = keeper.ends().await.unwrap();
    assert_eq!((ends.first, ends.last), (1_001, 2_500), "whole batches before it may go");
    assert_eq!(verify(path, &[], None), changed.map(|()| unreachable!()).map_err(VerifyError::Store));
}

#[tokio::test]
async fn a_log_of_an_older_r6_gets_a_key_and_heads() {
    let (folder, auditor, keeper) = folder(3, 1_000).await;
    let path = folder.path();
    drop((auditor, keeper));
    std::fs::remove_file(path.join("audit.key")).unwrap();
    make_old(path);
    let verified = verify(path, &[], None).unwrap();
    assert_eq!((verified.entries, verified.key, verified.stored), (3, None, None));
    let (auditor, keeper) = start(path, 1_000).unwrap();
    auditor.put_head().await.unwrap();
    let verified = verify(path, &[auditor.key()], None).unwrap();
    assert_eq!((verified.entries, verified.stored.unwrap().number), (4, 4));
    drop(keeper);
}

#[tokio::test]
async fn what_others_append_while_entries_are_removed_stays() {
    let (folder, auditor, keeper) = folder(4_000, 1_000).await;
    let path = folder.path();
    // `r6 gateway token` is another process.
    let made = std::thread::spawn({
        let path = path.to_owned();
        move || {
            (0..20).for_each(|_| drop(crate::make_token(&path, Role::Viewer, None, String::new()).unwrap()))
        }
    });
    auditor.remove_old().await.unwrap();
    made.join().unwrap();
    auditor.remove_old().await.unwrap();
    let verified = verify(path, &[], None).unwrap();
    assert_eq!((verified.removed, verified.entries), (3_020, 1_000));
    drop(keeper);
}

#[cfg(unix)]
#[test]
fn the_key_is_made_once_and_its_owner_alone_reads_it() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let key = open_key(folder.path()).unwrap().key();
    assert_eq!(open_key(folder.path()).unwrap().key(), key);
    let file = std::fs::metadata(folder.path().join("audit.key")).unwrap();
    assert_eq!(file.permissions().mode() & 0o777, 0o600);
}
