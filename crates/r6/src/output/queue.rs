//! A queue of lines that a separate thread writes. A slow reader delays only the lines, and a failed write
//! does not end the program.

use std::collections::VecDeque;
use std::fmt;
use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::Notify;

/// How many lines may wait. The lines of a busy second fit. Lines are at most a few kilobytes long, so the
/// queue stays within a few megabytes.
const MOST_WAITING: usize = 1024;

/// How many unwritten pieces are kept. These are the last ones: what a command says at its end.
const MOST_UNWRITTEN: usize = 4;

/// How long the end of the program waits for the last lines after a signal: longer than an active reader
/// takes, and hardly noticeable.
pub const FLUSH_WITHIN: Duration = Duration::from_millis(500);

/// What happens to a line if [`MOST_WAITING`] lines wait already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// The caller waits until there is room.
    Wait,
    /// The line is added all the same. For the few lines that are printed while an arm moves and must not be
    /// lost.
    Exceed,
    /// The line is dropped and counted, and a line in its place says how many were lost.
    Drop,
    /// As [`WhenFull::Drop`]; the line in its place is a JSON object.
    DropJson,
}

/// The first failed write. After it nothing more is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unwritten {
    /// The system's kind of error.
    pub kind: io::ErrorKind,
    /// The system's message.
    pub why: String,
}

impl fmt::Display for Unwritten {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it cannot be written: {}", self.why)
    }
}

/// A queue of lines for the thread that writes them. Clones share the queue.
#[derive(Clone, Debug, Default)]
pub struct LineQueue {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    failed: Notify,
}

#[derive(Debug, Default)]
struct State {
    entries: VecDeque<Entry>,
    /// How many of the entries are text.
    texts: usize,
    /// Whether the thread is writing the entry it took last.
    writing: bool,
    failure: Option<Unwritten>,
    /// The last unwritten pieces.
    unwritten: VecDeque<Vec<u8>>,
}

#[derive(Debug)]
enum Entry {
    Text(Vec<u8>),
    /// The number of lines that were dropped here.
    Lost {
        count: u64,
        json: bool,
    },
}

impl LineQueue {
    /// Starts a queue and the thread that passes its lines to `write` in order. The thread lives as long as
    /// the program.
    pub fn start(write: impl FnMut(&[u8]) -> io::Result<()> + Send + 'static) -> io::Result<Self> {
        let queue = Self::default();
        let shared = Arc::clone(&queue.shared);
        std::thread::Builder::new().name("lines".to_owned()).spawn(move || shared.write_all(write))?;
        Ok(queue)
    }

    /// Adds one line (or several that belong together) without its end. If the queue is full, it is dropped.
    pub fn line(&self, text: impl fmt::Display) {
        self.push(format!("{}\n", super::clean(&text.to_string())).into_bytes(), WhenFull::Drop);
    }

    /// Adds bytes that are complete lines.
    pub fn push(&self, bytes: Vec<u8>, when_full: WhenFull) {
        let mut state = self.shared.lock();
        if when_full == WhenFull::Wait {
            let full = |state: &mut State| state.texts >= MOST_WAITING && state.failure.is_none();
            let waited = self.shared.changed.wait_while(state, full);
            state = waited.unwrap_or_else(PoisonError::into_inner);
        }
        if state.failure.is_some() {
            state.keep_unwritten(bytes);
            return;
        }
        match when_full {
            WhenFull::Drop | WhenFull::DropJson if state.texts >= MOST_WAITING => {
                state.lose(1, when_full == WhenFull::DropJson);
            }
            WhenFull::Wait | WhenFull::Exceed | WhenFull::Drop | WhenFull::DropJson => {
                state.texts += 1;
                state.entries.push_back(Entry::Text(bytes));
            }
        }
        drop(state);
        self.shared.changed.notify_all();
    }

    /// Adds a line that says that lines were lost before they reached this queue.
    pub fn lose(&self, count: u64) {
        self.shared.lock().lose(count, false);
        self.shared.changed.notify_all();
    }

    /// Waits until everything is written or cannot be written, at most for [`FLUSH_WITHIN`].
    pub fn flush(&self) {
        self.flush_within(FLUSH_WITHIN);
    }

    /// Waits until everything is written or cannot be written, at most for `most`. Returns whether nothing
    /// waits any more.
    pub fn flush_within(&self, most: Duration) -> bool {
        let busy = |state: &mut State| state.is_busy();
        let waited = self.shared.changed.wait_timeout_while(self.shared.lock(), most, busy);
        !waited.unwrap_or_else(PoisonError::into_inner).0.is_busy()
    }

    /// The failed write, if there was one.
    pub fn failure(&self) -> Option<Unwritten> {
        self.shared.lock().failure.clone()
    }

    /// The last unwritten pieces, as text.
    pub fn unwritten(&self) -> String {
        let state = self.shared.lock();
        state.unwritten.iter().map(|bytes| String::from_utf8_lossy(bytes)).collect()
    }

    /// Waits until a write fails.
    pub async fn fails(&self) {
        loop {
            let mut failed = std::pin::pin!(self.shared.failed.notified());
            // From here on no failure is missed.
            failed.as_mut().enable();
            if self.failure().is_some() {
                return;
            }
            failed.await;
        }
    }
}

impl Write for LineQueue {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.push(bytes.to_vec(), WhenFull::Drop);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl State {
    fn is_busy(&self) -> bool {
        self.failure.is_none() && (self.writing || !self.entries.is_empty())
    }

    fn lose(&mut self, more: u64, as_json: bool) {
        match self.entries.back_mut() {
            Some(Entry::Lost { count, json }) if *json == as_json => *count = count.saturating_add(more),
            Some(Entry::Text(_) | Entry::Lost { .. }) | None => {
                self.entries.push_back(Entry::Lost { count: more, json: as_json });
            }
        }
    }

    fn keep_unwritten(&mut self, bytes: Vec<u8>) {
        if self.unwritten.len() >= MOST_UNWRITTEN {
            self.unwritten.pop_front();
        }
        self.unwritten.push_back(bytes);
    }

    /// Keeps the last unwritten pieces and drops the queue: nothing more is written.
    fn fail(&mut self, bytes: Vec<u8>, error: &io::Error) {
        self.keep_unwritten(bytes);
        for entry in std::mem::take(&mut self.entries) {
            if let Entry::Text(bytes) = entry {
                self.keep_unwritten(bytes);
            }
        }
        self.texts = 0;
        self.failure = Some(Unwritten { kind: error.kind(), why: error.to_string() });
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // A thread that panicked with the lock left complete entries.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_all(&self, mut write: impl FnMut(&[u8]) -> io::Result<()>) {
        loop {
            let mut state = self
                .changed
                .wait_while(self.lock(), |state| state.entries.is_empty())
                .unwrap_or_else(PoisonError::into_inner);
            let Some(entry) = state.entries.pop_front() else { continue };
            state.writing = true;
            let bytes = match entry {
                Entry::Text(bytes) => {
                    state.texts -= 1;
                    bytes
                }
                Entry::Lost { count, json: true } => {
                    format!("{{\"event\":\"lost\",\"lines\":{count}}}\n").into_bytes()
                }
                Entry::Lost { count, json: false } => format!("{}\n", super::lost_lines(count)).into_bytes(),
            };
            drop(state);
            let written = write(&bytes);
            let mut state = self.lock();
            state.writing = false;
            if let Err(error) = &written {
                state.fail(bytes, error);
            }
            drop(state);
            self.changed.notify_all();
            if written.is_err() {
                self.failed.notify_waiters();
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn what_nobody_reads_is_dropped_and_counted() {
        let (begun, begins) = mpsc::channel();
        let (go_on, gate) = mpsc::channel::<()>();
        let (written, lines) = mpsc::channel();
        let queue = LineQueue::start(move |bytes| {
            begun.send(()).unwrap();
            gate.recv().unwrap();
            written.send(String::from_utf8(bytes.to_vec()).unwrap()).unwrap();
            Ok(())
        })
        .unwrap();
        queue.line("first");
        begins.recv().unwrap();
        // The thread is blocked in the first line: this many more wait, and the rest is lost.
        for number in 0..MOST_WAITING + 5 {
            queue.line(number);
        }
        queue.lose(2);
        for _ in 0..MOST_WAITING + 2 {
            go_on.send(()).unwrap();
        }
        let got: Vec<_> = lines.iter().take(MOST_WAITING + 2).collect();
        assert_eq!(got[0], "first\n");
        assert_eq!(got[MOST_WAITING], format!("{}\n", MOST_WAITING - 1));
        assert_eq!(got[MOST_WAITING + 1], "(7 lines were lost)\n");
        // After that no line is dropped.
        queue.line("late\u{1b}");
        go_on.send(()).unwrap();
        assert_eq!(lines.recv().unwrap(), "late\\u{1b}\n");
    }

    #[test]
    fn a_flush_waits_for_the_last_line() {
        let (written, lines) = mpsc::channel();
        let queue = LineQueue::start(move |bytes| {
            written.send(bytes.len()).unwrap();
            Ok(())
        })
        .unwrap();
        for _ in 0..100 {
            queue.line("abc");
        }
        queue.flush();
        assert_eq!(lines.try_iter().collect::<Vec<_>>(), vec![4; 100]);
    }

    #[test]
    fn the_first_failure_is_kept_and_nothing_is_written_behind_it() {
        let (written, lines) = mpsc::channel();
        let queue = LineQueue::start(move |bytes| {
            written.send(bytes.to_vec()).unwrap();
            if bytes == b"two\n" { Err(io::ErrorKind::StorageFull.into()) } else { Ok(()) }
        })
        .unwrap();
        for line in ["one", "two", "three"] {
            queue.line(line);
        }
        queue.flush();
        assert_eq!(queue.failure().map(|failure| failure.kind), Some(io::ErrorKind::StorageFull));
        // After the failure no caller waits.
        for _ in 0..2 * MOST_WAITING {
            queue.push(b"four\n".to_vec(), WhenFull::Wait);
        }
        assert!(queue.flush_within(Duration::ZERO));
        assert_eq!(lines.iter().collect::<Vec<_>>(), [b"one\n", b"two\n"]);
        assert_eq!(queue.unwritten(), "four\n".repeat(MOST_UNWRITTEN), "the last ones are kept");
    }

    #[tokio::test]
    async fn a_failure_wakes_whoever_waits_for_it() {
        let queue = LineQueue::start(|_| Err(io::ErrorKind::BrokenPipe.into())).unwrap();
        let waiting = tokio::spawn({
            let queue = queue.clone();
            async move { queue.fails().await }
        });
        queue.line("one");
        waiting.await.unwrap();
        // It also returns at once after the failure.
        queue.fails().await;
    }
}
