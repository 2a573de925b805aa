//! Tests that every target has a corpus, a program for libFuzzer, a test, and a row in the documentation.

use std::fs;

use r6_fuzz::{TARGETS, corpus, ledger, words};

fn read(path: &str) -> String {
    let path = corpus::folder().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn every_target_has_a_corpus_a_program_a_test_and_a_row() {
    let manifest = read("Cargo.toml");
    let tests = read("../crates/r6-fuzz/tests/corpus.rs");
    let page = read("../docs/RELIABILITY.md");
    let programs = fs::read_dir(corpus::folder().join("fuzz_targets")).unwrap().count();
    assert_eq!(programs, TARGETS.len(), "tools/fuzz takes each file of fuzz_targets for a target");
    for (name, _) in TARGETS {
        assert!(!corpus::files("corpus", name).is_empty(), "fuzz/corpus/{name} is empty");
        let program = read(&format!("fuzz_targets/{name}.rs"));
        assert!(
            program.contains(&format!("r6_fuzz::{name}::run(bytes)")),
            "fuzz_targets/{name}.rs runs another"
        );
        assert!(
            manifest.contains(&format!("path = \"fuzz_targets/{name}.rs\"")),
            "fuzz/Cargo.toml lacks {name}"
        );
        assert!(tests.contains(&format!("replay(\"{name}\")")), "no test replays {name}");
        assert!(ledger::rows().iter().any(|row| row.target == *name), "fuzz/ledger.tsv lacks {name}");
        assert!(page.contains(&format!("\n| `{name}` |")), "docs/RELIABILITY.md has no row for {name}");
    }
}

#[test]
fn every_folder_is_of_a_target() {
    for kind in ["corpus", "regressions"] {
        let Ok(entries) = fs::read_dir(corpus::folder().join(kind)) else { continue };
        for entry in entries.flatten().filter(|entry| entry.path().is_dir()) {
            let name = entry.file_name().to_string_lossy().into_owned();
            assert!(r6_fuzz::target(&name).is_some(), "fuzz/{kind}/{name} is of no target");
        }
    }
}

#[test]
fn every_regression_has_a_row() {
    let page = read("../docs/RELIABILITY.md");
    for (name, _) in TARGETS {
        for file in corpus::files("regressions", name) {
            let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            assert!(
                page.contains(&format!("`{name}/{file}`")),
                "docs/RELIABILITY.md does not tell of {name}/{file}"
            );
        }
    }
}

#[test]
fn the_dictionary_is_up_to_date() {
    assert!(
        read("words.dict") == words::dictionary(),
        "fuzz/words.dict is old: cargo run -p r6-fuzz -- words"
    );
}

#[test]
fn the_page_shows_the_ledger() {
    let page = read("../docs/RELIABILITY.md");
    assert_eq!(
        ledger::shown(&page).as_deref(),
        Some(&*page),
        "docs/RELIABILITY.md shows other figures than the ledger has"
    );
}
