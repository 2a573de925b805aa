//! Logs of the program itself, on stderr.

use std::io::{IsTerminal, Write};

use clap::Args;
use tracing_subscriber::EnvFilter;

use crate::output::queue::LineQueue;

/// How much the program tells about itself.
#[derive(Debug, Args)]
pub struct LogArgs {
    /// Log to stderr: -v what happens, -vv more, -vvv every frame
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = "Global options")]
    verbose: u8,
}

/// Begins to log. With a full screen on the terminal nothing is logged, for it would be written across the screen.
/// The lines go through a queue, so that nothing waits where nobody reads stderr; flush it at the end.
pub fn begin(args: &LogArgs, has_screen: bool) -> std::io::Result<LineQueue> {
    let level = match args.verbose {
        // What a virtual controller says is printed by `r6 sim` and `r6 up` themselves.
        0 => "warn,r6_sim=error",
        1 => "info",
        2 => "debug",
        3.. => "trace",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let filter = if has_screen { EnvFilter::new("off") } else { filter };
    // A log that cannot be written is no reason to end.
    let queue = LineQueue::start(|bytes| drop(std::io::stderr().write_all(bytes)))?;
    let writer = queue.clone();
    // Colours are for a terminal, and for who wants them there (https://no-color.org).
    let unwanted = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let colours = std::io::stderr().is_terminal() && !unwanted;
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(colours)
        .with_writer(move || writer.clone())
        .init();
    Ok(queue)
}
