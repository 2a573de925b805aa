//! Runs the corpus, the regressions and random changes of both through every target.

use std::sync::LazyLock;

use r6_fuzz::mutation::{below, mutate};
use r6_fuzz::{corpus, seeds, target, words};
use r6_traffic::random::Random;

/// How many changed inputs each target runs, the same on every machine: as many as take a few seconds on a
/// quiet one. `make fuzz` does more.
const CHANGES: [(&str, usize); 8] = [
    ("frames", 20_000),
    ("messages", 20_000),
    ("client_session", 16_000),
    ("server_session", 20_000),
    ("controller", 6_000),
    ("files", 20_000),
    ("saved_state", 20_000),
    ("panel", 5_000),
];

static WORDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(words::all);

/// Runs all files of the target, and its number of changed inputs. It prints an input that breaks a promise.
fn replay(name: &str) {
    let (_, run) = target(name).unwrap_or_else(|| panic!("there is no target {name}"));
    let files: Vec<_> =
        ["corpus", "regressions"].into_iter().flat_map(|kind| corpus::files(kind, name)).collect();
    assert!(!files.is_empty(), "{name} has no corpus");
    let mut inputs = Vec::new();
    for file in &files {
        let bytes = corpus::read(file);
        tried(name, run, &bytes, &file.display().to_string());
        inputs.push(bytes);
    }
    tried(name, run, &[], "no bytes at all");
    let (_, changes) = CHANGES.into_iter().find(|(known, _)| *known == name).expect("a number of changes");
    let mut random = Random::new(0x5EED);
    for number in 0..changes {
        let (one, other) = (below(&mut random, inputs.len()), below(&mut random, inputs.len()));
        let mutated = mutate(&inputs[one], &inputs[other], &WORDS, &mut random);
        tried(name, run, &mutated, &format!("change {number} of {}", files[one].display()));
    }
}

fn tried(name: &str, run: fn(&[u8]), bytes: &[u8], what: &str) {
    let outcome = std::panic::catch_unwind(|| run(bytes));
    if let Err(panic) = outcome {
        eprintln!("{name} broke on {what}: b\"{}\"", bytes.escape_ascii());
        if let Ok(folder) = std::env::var("R6_FUZZ_KEEP") {
            let sum =
                bytes.iter().fold(0_u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)));
            let _ = std::fs::write(format!("{folder}/{name}-{sum:08x}"), bytes);
        }
        std::panic::resume_unwind(panic);
    }
}

#[test]
fn frames() {
    replay("frames");
}

#[test]
fn messages() {
    replay("messages");
}

#[test]
fn client_session() {
    replay("client_session");
}

#[test]
fn server_session() {
    replay("server_session");
}

#[test]
fn controller() {
    replay("controller");
}

#[test]
fn files() {
    replay("files");
}

#[test]
fn saved_state() {
    replay("saved_state");
}

#[test]
fn panel() {
    replay("panel");
}

#[test]
fn no_corpus_is_large() {
    for (name, _) in r6_fuzz::TARGETS {
        let files = corpus::files("corpus", name);
        let bytes: usize = files.iter().map(|file| corpus::read(file).len()).sum();
        assert!(files.len() <= seeds::MOST_FILES, "{name} has {} files", files.len());
        assert!(bytes <= seeds::MOST_BYTES, "{name} has {bytes} bytes");
    }
}
