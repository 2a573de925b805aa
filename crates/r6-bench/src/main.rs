//! How fast `r6` is beside others: ratios, both sides measured in turns in one run on one core.
//!
//! ```text
//! make bench                     all rows; the table also goes to docs/BENCHMARKS.md, and what the README quotes of it to the README
//! make bench ARGS="round-trip"   the rows with this in their name; the file stays as it is
//! ```

mod measure;
mod report;
mod rows;
mod serve;

use std::env;
use std::process::ExitCode;

/// Where the table of all rows goes.
const PAGE: &str = "docs/BENCHMARKS.md";

/// The page that quotes some of them.
const README: &str = "README.md";

fn main() -> ExitCode {
    if let Some(served) = serve::asked() {
        return served;
    }
    let wanted: Vec<String> = env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    if let Err(error) = measure::pin() {
        eprintln!("this process cannot be kept on one core ({error}); ratios of two cores are none");
        return ExitCode::FAILURE;
    }
    let chosen = |name: &str| wanted.is_empty() || wanted.iter().any(|word| name.contains(word.as_str()));
    let rows: Vec<_> = rows::ALL.iter().filter(|(name, _)| chosen(name)).collect();
    if rows.is_empty() {
        let names: Vec<_> = rows::ALL.iter().map(|(name, _)| *name).collect();
        eprintln!("no row is called {}; there are: {}", wanted.join(", "), names.join(", "));
        return ExitCode::from(2);
    }
    let mut table = Vec::new();
    for (name, row) in rows {
        eprintln!("{name} …");
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

/// Writes the page, and what is quoted of it.
fn write(table: &[report::Row]) -> Result<(), (&'static str, std::io::Error)> {
    std::fs::write(PAGE, report::page(table)).map_err(|error| (PAGE, error))?;
    let readme = std::fs::read_to_string(README).map_err(|error| (README, error))?;
    std::fs::write(README, report::quoted(&readme, table)).map_err(|error| (README, error))
}
