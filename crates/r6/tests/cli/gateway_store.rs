//! `r6 gateway` with `--store`, and its subcommands: nothing takes a folder for the store, or the store for a
//! folder.

use r6_testkit::postgres::shared;

use crate::gateway_calls::gateway;
use crate::support::r6;

#[test]
fn a_link_for_a_user_of_a_database_needs_the_address_of_a_gateway() {
    let Some(server) = shared("a_link_for_a_user_of_a_database_needs_the_address_of_a_gateway") else {
        return;
    };
    let (store, folder) = (server.database(), tempfile::tempdir().unwrap());
    let data = folder.path().join("data").display().to_string();
    let (_running, _) = gateway(&data, &["--store", &store]);
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
