//! The signed heads of the audit log over HTTP, at the end, and after a restore.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_gateway::{Gateway, GatewayError, PublicKey, VerifyError, verify};
use serde_json::Value;

use crate::support::{call, settings};

/// The head that the gateway gives. It knows a token that was just made after a moment.
async fn head(gateway: SocketAddr, token: &str) -> (Value, PublicKey, String) {
    let begun = Instant::now();
    loop {
        let (status, head) = call(gateway, token, "GET", "/v1/audit/head", None).await;
        if status == 200 {
            let key = PublicKey::parse(head["key"].as_str().unwrap()).unwrap();
            let note = head["note"].as_str().unwrap().to_owned();
            return (head, key, note);
        }
        assert!(begun.elapsed() < Duration::from_secs(20), "{head}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn a_head_that_was_fetched_proves_the_log_until_its_end_is_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let engineer = r6_gateway::make_token(&data, Role::Engineer, None, String::new()).unwrap().1;
    let gateway = Gateway::start(settings(&data, Vec::new())).await.unwrap();
    // What was given out is stored, so that the next start knows it too. The gateway also signs by itself: if
    // it did so between the two looks, it is asked again.
    let control = rusqlite::Connection::open(data.join("control.db")).unwrap();
    let mut tries = 0;
    let (told, key, note) = loop {
        let given = head(gateway.address(), &engineer).await;
        let stored: String = control
            .query_row("SELECT text FROM audit_head WHERE what = 'end'", [], |row| row.get(0))
            .unwrap();
        if stored == given.2 {
            break given;
        }
        tries += 1;
        assert!(tries < 3, "{stored} is stored, and {} was given out", given.2);
    };
    drop(control);
    // A token, the key and a start.
    assert_eq!(told["number"].as_u64(), Some(3), "{told}");
    let (_, audit) = call(gateway.address(), &engineer, "GET", "/v1/audit?after=1", None).await;
    let entry = &audit["entries"][0];
    assert_eq!((&entry["what"], &entry["key"]), (&Value::from("audit_key"), &told["key"]), "{audit}");
    assert_eq!(audit["entries"][1]["hash"], told["hash"]);
    gateway.shutdown().await.unwrap();
    let verified = verify(&data, &[key], Some(&note)).unwrap();
    assert_eq!((verified.entries, verified.kept.unwrap().number), (4, 3));
    assert_eq!(verified.stored.unwrap().number, 4, "the end is signed");

    // The heads are in a backup, and the secret key is not.
    let (to, new) = (folder.path().join("backup"), folder.path().join("new"));
    assert!(r6_gateway::backup(&data, &to, false, |_| ()).unwrap().problems.is_empty());
    assert!(!to.join("audit.key").exists());
    assert_eq!(verify(&to, &[key], Some(&note)).unwrap().stored.unwrap().number, 4);
    let refused = Gateway::start(settings(&to, Vec::new())).await.unwrap_err();
    assert!(matches!(&refused, GatewayError::IsBackup(folder) if *folder == to), "{refused}");
    assert!(!to.join("lock").exists(), "nothing was written there");
    assert!(r6_gateway::restore(&new, &to, |_| ()).unwrap().problems.is_empty());
    let verified = verify(&new, &[key], Some(&note)).unwrap();
    assert_eq!((verified.entries, verified.stored), (5, None), "what is restored is signed anew");

    // The restored gateway and the first one both go on: each with its own key.
    let restored = Gateway::start(settings(&new, Vec::new())).await.unwrap();
    let (_, second, of_second) = head(restored.address(), &engineer).await;
    restored.shutdown().await.unwrap();
    assert_ne!(second, key);
    let first = Gateway::start(settings(&data, Vec::new())).await.unwrap();
    let (_, same, later) = head(first.address(), &engineer).await;
    first.shutdown().await.unwrap();
    assert_eq!(same, key);
    assert!(verify(&data, &[key], Some(&later)).is_ok());
    assert!(verify(&new, &[second], Some(&of_second)).is_ok());
    // The restored log has what was signed before the backup. It does not have what came after.
    assert_eq!(verify(&new, &[key], Some(&note)), Err(VerifyError::OtherKey { what: "the stored head" }));
    assert!(verify(&new, &[key, second], Some(&note)).is_ok());
    let lost = verify(&new, &[key, second], Some(&later)).unwrap_err().to_string();
    assert!(lost.contains("the log was rewritten") && lost.contains("restored from a backup"), "{lost}");
}

#[tokio::test]
async fn a_gateway_whose_log_was_cut_off_does_not_start() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path();
    Gateway::start(settings(data, Vec::new())).await.unwrap().shutdown().await.unwrap();
    let control = rusqlite::Connection::open(data.join("control.db")).unwrap();
    control.execute("DELETE FROM audit WHERE number = (SELECT max(number) FROM audit)", []).unwrap();
    drop(control);
    let refused = Gateway::start(settings(data, Vec::new())).await.unwrap_err().to_string();
    assert!(refused.contains("the audit log is broken") && refused.contains("cut off"), "{refused}");
    // A backup of it says so. What is restored of that goes on, and its log says so too.
    let (to, new) = (data.join("backup"), data.join("new"));
    assert_eq!(r6_gateway::backup(data, &to, false, |_| ()).unwrap().problems.len(), 1);
    assert_eq!(r6_gateway::restore(&new, &to, |_| ()).unwrap().problems.len(), 1);
    Gateway::start(settings(&new, Vec::new())).await.unwrap().shutdown().await.unwrap();
    assert!(verify(&new, &[], None).is_ok());
}
