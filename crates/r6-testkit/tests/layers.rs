//! The crates of this workspace keep to their layers, and a crate that does not is found.

use std::fs;
use std::path::Path;

use r6_testkit::layers::{self, Layer, RULES};
use serde_json::json;

#[test]
fn every_crate_keeps_to_its_layer() {
    let violations = layers::violations(&layers::metadata());
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}

#[test]
fn every_rule_is_about_a_crate_of_this_workspace() {
    let metadata: serde_json::Value = serde_json::from_str(&layers::metadata()).unwrap();
    let packages: Vec<_> =
        metadata["packages"].as_array().unwrap().iter().map(|package| &package["name"]).collect();
    for rule in RULES {
        assert!(packages.contains(&&json!(rule.package)), "there is no crate `{}` any more", rule.package);
    }
}

#[test]
fn every_pure_crate_bans_clocks_sockets_and_threads() {
    for rule in RULES.iter().filter(|rule| rule.layer == Layer::Pure) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(rule.package).join("clippy.toml");
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        for banned in
            ["std::time::Instant::now", "std::net::TcpStream", "std::thread::spawn", "std::fs::File"]
        {
            assert!(text.contains(banned), "{} does not ban {banned}", path.display());
        }
    }
}

/// The violations of a made-up workspace with one crate that has one dependency.
fn violations(package: &str, dependency: &str, kind: Option<&str>) -> Vec<String> {
    let dependency = json!({"name": dependency, "kind": kind, "req": "*"});
    let metadata = json!({"packages": [{"name": package, "dependencies": [dependency]}]});
    layers::violations(&metadata.to_string())
}

#[test]
fn forbidden_edges_are_reported() {
    let edges = [
        ("r6-proto", "r6-controller"),
        ("r6-proto", "r6-testkit"),
        ("r6-proto", "tokio"),
        ("r6-proto", "async-io"),
        ("r6-controller", "r6-sim"),
        ("r6-controller", "socket2"),
        ("r6-controller", "rand"),
        ("r6-client", "r6-sim"),
        ("r6-client", "r6-controller"),
        ("r6-sim", "r6-client"),
        ("r6-testkit", "r6-proto"),
        ("r6", "r6-testkit"),
    ];
    for (package, dependency) in edges {
        for kind in [None, Some("build")] {
            let found = violations(package, dependency, kind);
            assert_eq!(found.len(), 1, "{package} -> {dependency} ({kind:?}): {found:?}");
            assert!(
                found[0].starts_with(&format!("`{package}` depends on `{dependency}`: ")),
                "{}",
                found[0]
            );
        }
    }
}

#[test]
fn allowed_edges_are_not_reported() {
    let edges = [
        ("r6-proto", "encoding_rs", None),
        ("r6-controller", "r6-proto", None),
        ("r6-client", "r6-proto", None),
        ("r6-client", "tokio", None),
        ("r6-client", "r6-sim", Some("dev")),
        ("r6-proto", "r6-testkit", Some("dev")),
        ("r6-sim", "r6-controller", None),
        ("r6", "r6-sim", None),
    ];
    for (package, dependency, kind) in edges {
        assert_eq!(violations(package, dependency, kind), Vec::<String>::new(), "{package} -> {dependency}");
    }
}

#[test]
fn a_crate_without_a_rule_is_reported() {
    assert_eq!(
        violations("r6-newcomer", "serde", None),
        ["`r6-newcomer` has no rule: add one to layers::RULES"]
    );
}

#[test]
fn a_path_dependency_without_a_rule_is_reported() {
    let dependency = json!({"name": "r6-newcomer", "kind": null, "path": "crates/r6-newcomer"});
    let metadata = json!({"packages": [{"name": "r6", "dependencies": [dependency]}]});
    let found = layers::violations(&metadata.to_string());
    assert_eq!(found, ["`r6` depends on `r6-newcomer`: its rule does not allow this crate"]);
}
