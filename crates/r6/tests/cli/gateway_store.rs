//! `r6 gateway` with `--store`, and its subcommands: nothing takes a folder for the store, or the store for a
//! folder.

use r6_testkit::postgres::shared;

use crate::gateway_calls::{gateway, get, token};
use crate::support::r6;

#[test]
fn the_folder_of_a_gateway_with_a_database_is_not_taken_for_the_store() {
    let Some(server) = shared("the_folder_of_a_gateway_with_a_database_is_not_taken_for_the_store") else {
        return;
    };
    let (url, folder) = (server.database(), tempfile::tempdir().unwrap());
    let data = folder.path().join("data").display().to_string();
    let (running, _) = gateway(&data, &["--store", &url, "--robot", "press=127.0.0.1:1"]);
    assert_eq!(running.end("TERM"), Some(0));
    // Nothing in the folder names the database.
    for file in std::fs::read_dir(&data).unwrap().flatten().filter(|file| file.path().is_file()) {
        let text = std::fs::read(file.path()).unwrap();
        let has = |word: &[u8]| text.windows(word.len()).any(|part| part == word);
        assert!(!has(b"postgres:"), "{:?}", file.path());
    }

    let backup = folder.path().join("backup").display().to_string();
    let add = ["user", "--add", "ben", "--role", "viewer"];
    for args in [
        &["token", "--role", "viewer"][..],
        &["token", "--list"],
        &["token", "--revoke", "1"],
        &add,
        &["user", "--list"],
        &["user", "--link", "ben"],
        &["verify"],
        &["backup", "--to", &backup],
        // The gateway itself, without --store.
        &["--listen", "127.0.0.1:0"],
    ] {
        let refused = r6(&[&["gateway"], args, &["--data", &data]].concat());
        assert_eq!(refused.code, 2, "{args:?}: {refused:?}");
        assert!(refused.err.contains("is of a gateway with --store"), "{args:?}: {}", refused.err);
    }
    assert!(!folder.path().join("data/control.db").exists());
    let (running, _) = gateway(&data, &["--store", &url]);
    assert_eq!(running.end("TERM"), Some(0));
}

#[test]
fn a_gateway_with_a_database_refuses_a_folder_with_a_store() {
    let Some(server) = shared("a_gateway_with_a_database_refuses_a_folder_with_a_store") else { return };
    let (url, folder) = (server.database(), tempfile::tempdir().unwrap());
    let data = folder.path().join("data").display().to_string();
    assert!(!token(&data, "admin").is_empty());
    let refused = r6(&["gateway", "--data", &data, "--store", &url, "--listen", "127.0.0.1:0"]);
    assert_eq!(refused.code, 2, "{refused:?}");
    for told in ["users, leases and stops of a gateway without --store", "another folder for --data"] {
        assert!(refused.err.contains(told), "{}", refused.err);
    }
    assert_eq!(r6(&["gateway", "token", "--data", &data, "--list"]).code, 0);
}

#[test]
fn a_link_for_a_user_of_a_database_needs_the_address_of_a_gateway() {
    let Some(server) = shared("a_link_for_a_user_of_a_database_needs_the_address_of_a_gateway") else {
        return;
    };
    let (store, folder) = (server.database(), tempfile::tempdir().unwrap());
    let data = folder.path().join("data").display().to_string();
    let (_running, here) = gateway(&data, &["--store", &store]);
    let (_, problem) = get(&here, "r6_00", "/v1/robots");
    assert!(problem["message"].as_str().unwrap().ends_with("it is of another store"), "{problem}");
    let user = |args: &[&str]| r6(&[&["gateway", "user", "--store", &store], args].concat());
    let add = ["--add", "ben", "--role", "viewer"];
    let refused = user(&add);
    assert_eq!((refused.code, refused.out.as_str()), (2, ""), "{refused:?}");
    assert!(refused.err.contains("such as --url https://"), "{}", refused.err);
    assert_eq!(user(&["--list"]).out.trim(), "", "no user was made");
    let url = ["--url", "https://hall-pc.local:9780/"];
    let added = user(&[&add[..], &url].concat());
    assert!(added.out.starts_with("https://hall-pc.local:9780/setup#"), "{added:?}");
    assert_eq!(user(&["--link", "ben"]).code, 2);
    assert_eq!(user(&[&["--link", "ben"][..], &url].concat()).code, 0);
}
