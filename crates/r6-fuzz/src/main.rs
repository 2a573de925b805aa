//! Runs single inputs through a target, and writes the seeds for `fuzz/`.

use std::path::Path;
use std::process::ExitCode;

use r6_fuzz::ledger::{self, Row};
use r6_fuzz::{TARGETS, corpus, seeds, target, words};

const USAGE: &str =
    "usage: r6-fuzz TARGET FILE...     runs the files, one after the other, through the target
       r6-fuzz targets            names the targets
       r6-fuzz seeds              writes fuzz/corpus from vectors, transcripts, examples and programs
       r6-fuzz words              writes fuzz/words.dict
       r6-fuzz page               writes fuzz/ledger.tsv into docs/RELIABILITY.md
       r6-fuzz record TARGET SECONDS EXECUTIONS COVERAGE FINDINGS COMMIT DAY
                                  adds a run to fuzz/ledger.tsv and docs/RELIABILITY.md";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["targets"] => TARGETS.iter().for_each(|(name, _)| println!("{name}")),
        ["page"] => ledger::show(),
        ["words"] => write(&corpus::folder().join("words.dict"), words::dictionary().as_bytes()),
        ["seeds"] => {
            for (name, _) in TARGETS {
                for (file, bytes) in seeds::of(name) {
                    write(&corpus::folder().join("corpus").join(name).join(file), &bytes);
                }
            }
        }
        ["record", name, figures @ .., code, day] if target(name).is_some() => {
            let figures: Vec<u64> = figures.iter().filter_map(|figure| figure.parse().ok()).collect();
            let [seconds, executions, coverage, findings] = figures[..] else {
                eprintln!("{USAGE}");
                return ExitCode::from(2);
            };
            ledger::record(Row {
                target: (*name).to_owned(),
                seconds,
                executions,
                coverage,
                findings,
                code: (*code).to_owned(),
                day: (*day).to_owned(),
            });
        }
        [name, files @ ..] if !files.is_empty() => {
            let Some((_, run)) = target(name) else {
                let names: Vec<_> = TARGETS.iter().map(|(name, _)| *name).collect();
                eprintln!("there is no target `{name}`; there are: {}", names.join(", "));
                return ExitCode::from(2);
            };
            for file in files {
                let bytes = match std::fs::read(file) {
                    Ok(bytes) => bytes,
                    Err(error) => {
                        eprintln!("{file}: {error}");
                        return ExitCode::from(2);
                    }
                };
                println!("{name}: {file} ({} bytes)", bytes.len());
                run(&bytes);
                println!("{name}: every promise holds");
            }
        }
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

fn write(path: &Path, bytes: &[u8]) {
    let folder = path.parent().unwrap_or(path);
    let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(path, bytes));
    written.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}
