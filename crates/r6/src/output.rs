//! What people and programs see: lines, tables, JSON.
//!
//! Threads write to stdout and stderr (`queue.rs`) and keep the error if a write fails. Nothing here ends the
//! program or panics, because a motion may be under way; `ending.rs` turns the error into an exit code.

pub mod alarm;
pub mod ending;
pub mod hall;
pub mod hall_screen;
pub mod panel;
pub mod plot;
pub mod problem;
pub mod queue;
pub mod readings;
pub mod screen;
pub mod status;
pub mod table;

use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use r6_proto::printable;
use serde::Serialize;

use self::queue::{LineQueue, WhenFull};

/// How long a line for stdout waits for the lines of stderr, or the other way round, so that a terminal shows
/// both in order. It is longer than an active reader takes, and too short to delay a stop.
const IN_ORDER_WITHIN: Duration = Duration::from_millis(50);

/// The queues of stdout and stderr. There is one pair for each run of r6.
static OUTPUT: OnceLock<Output> = OnceLock::new();

struct Output {
    out: LineQueue,
    err: LineQueue,
    /// Whether a request that can change the machine may have left.
    acts: AtomicBool,
}

/// Starts the threads that write.
///
/// # Errors
/// The system cannot start a thread.
pub fn begin() -> io::Result<()> {
    let out = LineQueue::start(|bytes| {
        let mut out = io::stdout().lock();
        out.write_all(bytes).and_then(|()| out.flush())
    })?;
    let err = LineQueue::start(|bytes| io::stderr().write_all(bytes))?;
    // This is called once; a second value would be ignored.
    let _ = OUTPUT.set(Output { out, err, acts: AtomicBool::new(false) });
    Ok(())
}

/// The queue of stdout, for lines that are dropped if the reader is too slow.
pub fn lines() -> LineQueue {
    OUTPUT.get().map(|output| output.out.clone()).unwrap_or_default()
}

/// Prints one line (or several) to stdout.
pub fn line(text: impl std::fmt::Display) {
    bytes(format!("{}\n", clean(&text.to_string())).as_bytes());
}

/// Escapes all control characters except the end of a line, so that the text of a peer or a file cannot
/// control the terminal. Text of a peer must be escaped before it becomes part of a line ([`printable`]), so
/// that it cannot end that line.
pub fn clean(text: &str) -> String {
    text.split('\n').map(|line| printable(line).to_string()).collect::<Vec<_>>().join("\n")
}

/// A time of a gateway (RFC 3339, UTC) without its parts of a second.
pub fn to_the_second(time: &str) -> String {
    match time.split_once('.') {
        Some((seconds, _)) if time.ends_with('Z') => format!("{seconds}Z"),
        _ => time.to_owned(),
    }
}

/// Writes to stdout.
pub fn bytes(bytes: &[u8]) {
    let Some(output) = OUTPUT.get() else { return };
    output.err.flush_within(IN_ORDER_WITHIN);
    // Code that supervises an arm must not wait for a reader.
    let when_full = if has_acted() { WhenFull::Exceed } else { WhenFull::Wait };
    output.out.push(bytes.to_vec(), when_full);
}

/// Prints a value as one line of JSON.
pub fn json(value: &impl Serialize) {
    print_json(serde_json::to_string(value));
}

/// Prints a value as JSON over several lines.
pub fn json_pretty(value: &impl Serialize) {
    print_json(serde_json::to_string_pretty(value));
}

/// Prints a value as one line of JSON that a later line replaces. If many lines wait already, it is dropped
/// and counted.
pub fn passing_json(value: &impl Serialize) {
    let Some(output) = OUTPUT.get() else { return };
    match serde_json::to_string(value) {
        Ok(text) => output.out.push(format!("{}\n", escaped_json(&text)).into_bytes(), WhenFull::DropJson),
        Err(error) => note(format_args!("r6: this cannot be written as JSON: {error}")),
    }
}

fn print_json(text: serde_json::Result<String>) {
    match text {
        Ok(text) => bytes(format!("{}\n", escaped_json(&text)).as_bytes()),
        Err(error) => note(format_args!("r6: this cannot be written as JSON: {error}")),
    }
}

/// Escapes the characters in JSON text that can control a terminal. Those that JSON itself does not escape
/// occur only in strings, where `\u` escapes keep the meaning.
fn escaped_json(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        let shown = printable(character.encode_utf8(&mut [0; 4])).to_string();
        if character == '\n' || shown.chars().eq([character]) {
            escaped.push(character);
        } else {
            // All of these are in the basic multilingual plane: one UTF-16 unit.
            escaped.push_str(&format!("\\u{:04x}", u32::from(character)));
        }
    }
    escaped
}

/// `1 line`, `2 lines`, `0 lines`.
pub fn counted(count: usize, word: &str) -> String {
    if count == 1 { format!("1 {word}") } else { format!("{count} {word}s") }
}

/// `1 entry`, `2 entries`.
pub fn entries(count: u64) -> String {
    if count == 1 { "1 entry".to_owned() } else { format!("{count} entries") }
}

/// `1 instruction`, `2 instructions`.
pub fn instructions(count: usize) -> String {
    counted(count, "instruction")
}

/// The line printed in place of lines that were dropped.
pub fn lost_lines(lost: u64) -> String {
    if lost == 1 { "(1 line was lost)".to_owned() } else { format!("({lost} lines were lost)") }
}

/// Whether stdout is a terminal.
pub fn is_terminal() -> bool {
    io::stdout().is_terminal()
}

/// Whether a stream shows colours: it is a terminal, and `NO_COLOR` is not set (<https://no-color.org>).
pub fn has_colours(stream: &impl IsTerminal) -> bool {
    let unwanted = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    stream.is_terminal() && !unwanted
}

/// Prints a text of this program on stderr unchanged, colours included.
pub fn note_as_it_is(text: &str) {
    let Some(output) = OUTPUT.get() else { return };
    output.err.push(text.as_bytes().to_vec(), WhenFull::Exceed);
}

/// Prints a line for people on stderr, so that it never mixes with what programs read.
pub fn note(text: impl std::fmt::Display) {
    let Some(output) = OUTPUT.get() else { return };
    output.out.flush_within(IN_ORDER_WITHIN);
    output.err.push(format!("{}\n", clean(&text.to_string())).into_bytes(), WhenFull::Exceed);
}

/// Overwrites the current line of stderr, which must be a terminal. Does nothing if stderr still has text to
/// write.
pub fn rewrite_line(text: impl std::fmt::Display) {
    let Some(output) = OUTPUT.get() else { return };
    if output.err.flush_within(Duration::ZERO) {
        output.err.push(format!("\r{text}").into_bytes(), WhenFull::Drop);
    }
}

/// Clears the current line of stderr if that is a terminal.
pub fn clear_line() {
    let Some(output) = OUTPUT.get() else { return };
    if io::stderr().is_terminal() {
        let mut escape = Vec::new();
        let line = crossterm::terminal::Clear(crossterm::terminal::ClearType::CurrentLine);
        // Writing to memory cannot fail.
        let _ = crossterm::queue!(escape, line, crossterm::cursor::MoveToColumn(0));
        output.err.push(escape, WhenFull::Exceed);
    }
}

/// Notes that a request that changes or moves the machine may have left. From now on no line waits for a
/// reader. If stdout cannot be written, the run ends with "outcome unknown".
pub fn acts() {
    if let Some(output) = OUTPUT.get() {
        output.acts.store(true, Ordering::Relaxed);
    }
}

/// Whether a request that changes or moves the machine may have left.
pub fn has_acted() -> bool {
    OUTPUT.get().is_some_and(|output| output.acts.load(Ordering::Relaxed))
}

/// Whether everything so far is written, or still going to a slow reader. Waits up to
/// [`queue::FLUSH_WITHIN`].
pub fn is_written() -> bool {
    let Some(output) = OUTPUT.get() else { return true };
    output.out.flush();
    output.out.failure().is_none()
}

/// Waits until everything so far is written, however slow the reader is, or cannot be written.
pub async fn settled() {
    let Some(output) = OUTPUT.get() else { return };
    if !output.out.flush_within(IN_ORDER_WITHIN) {
        while !output.out.flush_within(Duration::ZERO) {
            tokio::time::sleep(IN_ORDER_WITHIN).await;
        }
    }
}

/// Waits until stdout cannot be written. Never returns while it can.
pub async fn fails() {
    match OUTPUT.get() {
        Some(output) => output.out.fails().await,
        None => std::future::pending().await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_a_thing_has_no_s() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "line")), ["0 lines", "1 line", "2 lines"]);
        assert_eq!([0, 1, 2].map(entries), ["0 entries", "1 entry", "2 entries"]);
        assert_eq!([1, 2].map(lost_lines), ["(1 line was lost)", "(2 lines were lost)"]);
    }

    #[test]
    fn a_peer_cannot_steer_the_terminal() {
        assert_eq!(clean("a\u{1b}[2Jb\r\nc\u{9b}d"), "a\\u{1b}[2Jb\\r\nc\\u{9b}d");
        assert_eq!(clean("模号"), "模号");
    }

    #[test]
    fn json_means_the_same_and_steers_no_terminal() {
        let value = serde_json::json!({ "模\u{9b}": "a\u{1b}[2J\u{202e}\r\n\u{7f}\\\"字😀" });
        for text in [serde_json::to_string(&value), serde_json::to_string_pretty(&value)] {
            let escaped = escaped_json(&text.unwrap());
            assert_eq!(serde_json::from_str::<serde_json::Value>(&escaped).unwrap(), value);
            assert_eq!(clean(&escaped), escaped);
            assert!(escaped.contains('模') && escaped.contains('😀'), "{escaped}");
        }
    }
}
