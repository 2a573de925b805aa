//! Comments and pages are easy to read: short lines, and none of the words that make sentences hard.

use std::fs;
use std::path::{Path, PathBuf};

/// No line of a comment is longer, columns: what a reader sees beside a second file.
const LONGEST_COMMENT: usize = 110;

/// Words whose sentences had to be read twice. Write who does it: the client, the controller, the caller.
const RIDDLES: [&str; 5] = ["whoever", "is none", "one that", "as told", "nobody"];

/// How many lines may have such a word: where each was read and found plain in its place.
const PLAIN_IN_ITS_PLACE: usize = 50;

/// Folders that hold what was built or fetched.
const NOT_OURS: [&str; 5] = ["target", ".git", ".venv", "node_modules", "mutants.out"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// The files of the repository with this ending, and their texts.
fn files(ending: &str) -> Vec<(PathBuf, String)> {
    let (mut found, mut folders) = (Vec::new(), vec![root()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.extend((!NOT_OURS.contains(&name.as_str())).then_some(path));
            } else if path.extension().is_some_and(|found| found == ending) {
                let text = fs::read_to_string(&path).unwrap();
                found.push((path.strip_prefix(root()).unwrap().to_owned(), text));
            }
        }
    }
    found.sort();
    found
}

/// Whether a text has this word, or these words, with no letter beside them.
fn has_word(text: &str, word: &str) -> bool {
    let is_apart = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric() && c != '_');
    text.match_indices(word).any(|(at, _)| {
        is_apart(text[..at].chars().next_back()) && is_apart(text[at + word.len()..].chars().next())
    })
}

#[test]
fn no_comment_is_longer_than_a_line() {
    let sources = files("rs");
    assert!(sources.len() > 400, "{} files: is this looking in the right place?", sources.len());
    let lines = sources.iter().flat_map(|(path, text)| (1..).zip(text.lines()).map(move |line| (path, line)));
    let comments = lines.filter(|(_, (_, line))| line.trim_start().starts_with("//"));
    let long: Vec<_> = comments
        .map(|(path, (number, line))| (path, number, line.chars().count()))
        .filter(|(_, _, columns)| *columns > LONGEST_COMMENT)
        .map(|(path, number, columns)| format!("{}:{number}: {columns} columns", path.display()))
        .collect();
    assert!(long.is_empty(), "comments have {LONGEST_COMMENT} columns at most:\n{}", long.join("\n"));
}

#[test]
fn words_that_make_riddles_are_rare() {
    let mut found = Vec::new();
    for (path, text) in [files("rs"), files("md")].concat() {
        for (number, line) in (1..).zip(text.lines()) {
            let lower = line.to_lowercase();
            if RIDDLES.iter().any(|word| has_word(&lower, word)) {
                found.push(format!("{}:{number}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(found.len() <= PLAIN_IN_ITS_PLACE, "{} lines:\n{}", found.len(), found.join("\n"));
}

#[test]
fn a_word_is_found_apart_from_letters() {
    assert!(has_word("nobody is there", "nobody") && has_word("(one that", "one that"));
    assert!(!has_word("nobody_is_asked", "nobody") && !has_word("this nonexistent", "is none"));
}
