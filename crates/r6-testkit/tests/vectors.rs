//! Tests that every file in `vectors/` can be read and follows the rules of `vectors/README.md`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use r6_testkit::{transcript, vector};

#[test]
fn every_vector_can_be_read() {
    let vectors = vector::all();
    assert!(!vectors.is_empty());
    for vector in vectors {
        assert!(!vector.source.is_empty(), "{} has no source", vector.stem);
        let kind = vector.decoded["kind"].as_str();
        assert!(kind.is_some() || vector.decodable().is_none(), "{} has no decoded.kind", vector.stem);
        assert_ne!(
            vector.printed.as_deref().map(str::as_bytes),
            Some(&*vector.frame),
            "{} repeats its frame",
            vector.stem
        );
        assert_eq!(vector::load(&vector.stem), vector);
    }
}

#[test]
fn every_stem_is_an_identifier_that_begins_with_its_folder() {
    let messages = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vectors/messages");
    let mut seen = BTreeSet::new();
    for folder in fs::read_dir(messages).unwrap().map(|entry| entry.unwrap().path()) {
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        for file in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            let stem = file.file_stem().unwrap().to_str().unwrap().to_owned();
            assert_eq!(file.extension().unwrap(), "json", "{}", file.display());
            assert!(stem.starts_with(&format!("{name}_")), "{}", file.display());
            let plain =
                |symbol: char| symbol.is_ascii_lowercase() || symbol.is_ascii_digit() || symbol == '_';
            assert!(stem.chars().all(plain), "{} is no identifier in lower snake case", file.display());
            seen.insert(stem);
        }
    }
    let loaded: BTreeSet<_> = vector::all().into_iter().map(|vector| vector.stem).collect();
    assert_eq!(seen, loaded, "the loader and the folders disagree");
}

#[test]
fn every_transcript_can_be_read() {
    let transcripts = transcript::all();
    assert!(!transcripts.is_empty());
    for transcript in transcripts {
        assert!(!transcript.about.is_empty(), "{} does not say what it shows", transcript.stem);
        assert_eq!(transcript::load(&transcript.stem), transcript);
    }
}

#[test]
#[should_panic(expected = "no vector `nowhere` below vectors/messages/; there are: ")]
fn a_missing_vector_is_named() {
    vector::load("nowhere");
}

#[test]
#[should_panic(expected = "no transcript `nowhere` in vectors/transcripts/; there are: ")]
fn a_missing_transcript_is_named() {
    transcript::load("nowhere");
}
