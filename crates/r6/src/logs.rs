//! Logs of the program itself, on stderr.

use std::io::Write;

use clap::Args;
use r6_proto::printable;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

use crate::exit::Failure;
use crate::output;
use crate::output::queue::LineQueue;

/// How much the program logs.
#[derive(Debug, Args)]
pub struct LogArgs {
    /// Log to stderr: -v what happens, -vv more, -vvv every frame
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = "Global options")]
    verbose: u8,
}

/// The variable of the environment that says how the log is written.
const FORMAT: &str = "R6_LOG_FORMAT";

/// How the log is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// For people.
    Text,
    /// An object of JSON a line, for programs that collect logs.
    Json,
}

impl Format {
    /// The format that the environment names.
    ///
    /// # Errors
    /// The name is not that of a format.
    pub fn of_environment() -> Result<Self, Failure> {
        let asked = std::env::var_os(FORMAT).unwrap_or_default();
        match asked.to_str() {
            Some("" | "text") => Ok(Self::Text),
            Some("json") => Ok(Self::Json),
            _ => Err(Failure::usage(format!(
                "{FORMAT} is `{}`, but has to be text or json",
                printable(&asked.to_string_lossy())
            ))),
        }
    }
}

/// What a program logs that was not asked for more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usual {
    /// Warnings, and a line for each thing that a gateway does.
    Full,
    /// Warnings only: the program says itself what happens.
    Warnings,
    /// Nothing, whatever was asked for: there is a full screen on the terminal, and lines would destroy it.
    Nothing,
}

/// Starts the log. The lines go through a queue, so that the program does not wait for a slow reader of
/// stderr. Flush the queue at the end.
/// With `traces`, the spans of a gateway are sent to its collector, too.
pub fn begin(
    args: &LogArgs,
    usual: Usual,
    format: Format,
    #[cfg(feature = "otel")] traces: Option<&r6_traces::Traces>,
) -> std::io::Result<LineQueue> {
    let level = match args.verbose {
        // `r6 sim` and `r6 up` print the log of a virtual controller themselves.
        0 if usual == Usual::Warnings => "warn,r6_sim=error,r6_gateway=error",
        0 => "warn,r6_sim=error,r6_gateway=info",
        1 => "info",
        2 => "debug",
        3.. => "trace",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let filter = if usual == Usual::Nothing { EnvFilter::new("off") } else { filter };
    // A log line that cannot be written does not end the program.
    let queue = LineQueue::start(|bytes| std::io::stderr().write_all(bytes))?;
    let colours = format == Format::Text && output::has_colours(&std::io::stderr());
    let records = Records { queue: queue.clone(), format, colours };
    let lines = tracing_subscriber::fmt::layer().with_ansi(colours).with_writer(move || records.clone());
    let lines = match format {
        Format::Text => lines.with_filter(filter).boxed(),
        Format::Json => lines.json().flatten_event(true).with_filter(filter).boxed(),
    };
    let subscriber = tracing_subscriber::registry().with(lines);
    #[cfg(feature = "otel")]
    let subscriber = subscriber.with(traces.map(|traces| traces.layer(r6_gateway::traces::TARGET)));
    subscriber.init();
    Ok(queue)
}

/// Receives whole log records and writes each as one line. Text of a peer in a record cannot begin another
/// line.
#[derive(Clone, Debug)]
struct Records {
    queue: LineQueue,
    format: Format,
    /// Whether the subscriber writes colours.
    colours: bool,
}

impl Write for Records {
    fn write(&mut self, record: &[u8]) -> std::io::Result<usize> {
        let line = match self.format {
            Format::Text => one_line(record, self.colours),
            Format::Json => ascii(record),
        };
        self.queue.write_all(&line)?;
        Ok(record.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Escapes the control characters of a record, except the final end of line and, with colours, the colour
/// sequences.
fn one_line(record: &[u8], colours: bool) -> Vec<u8> {
    let text = String::from_utf8_lossy(record);
    let (text, end) = text.strip_suffix('\n').map_or((&*text, ""), |text| (text, "\n"));
    let mut pieces = text.split('\u{1b}');
    let mut line = printable(pieces.next().unwrap_or_default()).to_string();
    for piece in pieces {
        line.push_str(if colours && switches_colour(piece) { "\u{1b}" } else { r"\u{1b}" });
        line.push_str(&printable(piece).to_string());
    }
    line.push_str(end);
    line.into_bytes()
}

/// Writes what is not ASCII in a line of JSON, and the character DEL, as the escapes of JSON: so no text of a
/// peer can turn the writing on a terminal around. The escapes of JSON itself keep a record on one line.
fn ascii(record: &[u8]) -> Vec<u8> {
    let mut line = Vec::with_capacity(record.len());
    for character in String::from_utf8_lossy(record).chars() {
        if character.is_ascii() && character != '\u{7f}' {
            line.push(character as u8);
            continue;
        }
        for unit in character.encode_utf16(&mut [0; 2]) {
            line.extend(format!("\\u{unit:04x}").bytes());
        }
    }
    line
}

/// Whether the text, after an escape character, is a colour sequence: `[`, digits and semicolons, `m`.
fn switches_colour(text: &str) -> bool {
    let numbers =
        text.strip_prefix('[').map(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';'));
    numbers.is_some_and(|rest| rest.starts_with('m'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_as_json_is_the_same_in_ascii() {
        let text = "no\r\nREADY \u{202e}\u{7f}\u{9b}2J é 机 😀 \\u00e9 \"";
        let record = format!("{}\n", serde_json::json!({ "message": text, "机": 1 }));
        let line = ascii(record.as_bytes());
        assert!(line.iter().all(|byte| (b' '..=b'~').contains(byte) || *byte == b'\n'), "{line:?}");
        assert_eq!(line.iter().filter(|byte| **byte == b'\n').count(), 1);
        let read: serde_json::Value = serde_json::from_slice(&line).unwrap();
        assert_eq!((&read["message"], &read["机"]), (&text.into(), &1.into()));
    }

    #[test]
    fn a_record_is_one_line() {
        let record = "\u{1b}[32mINFO\u{1b}[0m refused: no\r\nREADY\u{1b}[2J\n".as_bytes();
        let shown = |colours| String::from_utf8(one_line(record, colours)).unwrap();
        assert_eq!(shown(true), "\u{1b}[32mINFO\u{1b}[0m refused: no\\r\\nREADY\\u{1b}[2J\n");
        assert!(!shown(false).contains('\u{1b}'), "{}", shown(false));
    }
}
