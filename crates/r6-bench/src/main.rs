//! Compares the speed of `r6` with others: ratios, with both sides measured in turns, in one run on one core.
//! Only the delays of the gateway are measured on all cores.
//!
//! ```text
//! make bench                     all rows; writes docs/BENCHMARKS.md and the quoted figures of README.md
//! make bench ARGS="round-trip"   the rows with this in their name; writes no file
//! ```
//!
//! # A ratio
//!
//! `rows.rs` lists the rows. Each is a file of `rows/` that sets up both sides. `measure.rs` lets the sides
//! take turns on one core, and drops disturbed rounds. `report.rs` writes `docs/BENCHMARKS.md` with its goals
//! and reasons. A server that must not share a process with what is measured is this program again
//! (`serve.rs`). The frames of the codec rows are those of `cargo bench -p r6-proto`
//! (`r6-proto/benches/codec`).

mod measure;
mod report;
mod rows;
mod serve;

use std::env;
use std::process::ExitCode;

const USAGE: &str = "usage: r6-bench [ROW...]    rows with one of these words in their name; without any, all of them, in some minutes, which writes
                           docs/BENCHMARKS.md and the figures of README.md. The machine has to be quiet.";

/// The page with the table of all rows.
const PAGE: &str = "docs/BENCHMARKS.md";

/// The page that quotes some rows.
const README: &str = "README.md";

fn main() -> ExitCode {
    if let Some(served) = serve::asked() {
        return served;
    }
    let wanted: Vec<String> = env::args().skip(1).collect();
    let names: Vec<_> = rows::ALL.iter().map(|(name, _)| *name).collect();
    if wanted.iter().any(|word| word == "--help" || word == "-h") {
        println!("{USAGE}\nRows: {}", names.join(", "));
        return ExitCode::SUCCESS;
    }
    if let Some(word) = wanted.iter().find(|word| !names.iter().any(|name| name.contains(word.as_str()))) {
        eprintln!("no row is called {word}; there are: {}", names.join(", "));
        return ExitCode::from(2);
    }
    if let Err(error) = measure::pin() {
        eprintln!("this process cannot be kept on one core ({error}); ratios of two cores are none");
        return ExitCode::FAILURE;
    }
    let chosen = |name: &str| wanted.is_empty() || wanted.iter().any(|word| name.contains(word.as_str()));
    let rows: Vec<_> = rows::ALL.iter().filter(|(name, _)| chosen(name)).collect();
    let mut table = Vec::new();
    let count = rows.len();
    for ((name, row), number) in rows.into_iter().zip(1..) {
        eprintln!("{name} ({number} of {count}) …");
        table.extend(row());
    }
    if wanted.is_empty()
        && let Err((page, error)) = write(&table)
    {
        eprintln!("{page} cannot be written: {error}; run this from the root of the repository");
        return ExitCode::FAILURE;
    }
    print!("{}\n{}", report::table(&table), report::reasons(&table));
    ExitCode::SUCCESS
}

/// Writes the page, and the figures quoted from it.
fn write(table: &[report::Row]) -> Result<(), (&'static str, std::io::Error)> {
    let before = std::fs::read_to_string(PAGE).unwrap_or_default();
    std::fs::write(PAGE, report::page(table, &before)).map_err(|error| (PAGE, error))?;
    let readme = std::fs::read_to_string(README).map_err(|error| (README, error))?;
    std::fs::write(README, report::quoted(&readme, table)).map_err(|error| (README, error))
}
