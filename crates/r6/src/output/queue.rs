//! Lines that a thread of its own writes, so that a reader who stops reading stops nothing but the lines.

use std::collections::VecDeque;
use std::io::Write;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Lines that wait to be written. A burst of a busy second fits; lines are at most a few kilobytes long, so that the
/// queue stays within a few megabytes.
const MOST_WAITING: usize = 1024;

/// How long the end of the program waits for the last lines: longer than any reader who reads, and hardly noticed.
pub const FLUSH_WITHIN: Duration = Duration::from_millis(500);

/// Where lines wait for the thread that writes them. Clones are the same queue. Adding a line never waits: when
/// 1024 lines wait already, it is dropped and counted, and a line in its place says how many were lost.
#[derive(Clone, Debug, Default)]
pub struct LineQueue {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    entries: VecDeque<Entry>,
    /// How many of the entries are text.
    texts: usize,
    /// The thread writes what it took out last.
    writing: bool,
}

#[derive(Debug)]
enum Entry {
    Text(Vec<u8>),
    /// So many lines were dropped here.
    Lost(u64),
}

impl LineQueue {
    /// A queue, and the thread that hands its lines to `write` in order. The thread lives as long as the program.
    pub fn start(write: impl FnMut(&[u8]) + Send + 'static) -> std::io::Result<Self> {
        let queue = Self::default();
        let shared = Arc::clone(&queue.shared);
        std::thread::Builder::new().name("lines".to_owned()).spawn(move || shared.write_all(write))?;
        Ok(queue)
    }

    /// Adds one line (or several that belong together) without its end.
    pub fn line(&self, text: impl std::fmt::Display) {
        self.push(format!("{}\n", super::clean(&text.to_string())).into_bytes());
    }

    /// Adds bytes that are complete lines.
    fn push(&self, bytes: Vec<u8>) {
        let mut state = self.shared.lock();
        if state.texts < MOST_WAITING {
            state.texts += 1;
            state.entries.push_back(Entry::Text(bytes));
        } else {
            state.lose(1);
        }
        drop(state);
        self.shared.changed.notify_all();
    }

    /// Says in its place that lines were lost before they came here.
    pub fn lose(&self, count: u64) {
        self.shared.lock().lose(count);
        self.shared.changed.notify_all();
    }

    /// Waits until everything is written, or for [`FLUSH_WITHIN`] where nobody reads.
    pub fn flush(&self) {
        let busy = |state: &mut State| state.writing || !state.entries.is_empty();
        drop(self.shared.changed.wait_timeout_while(self.shared.lock(), FLUSH_WITHIN, busy));
    }
}

impl Write for LineQueue {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.push(bytes.to_vec());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl State {
    fn lose(&mut self, count: u64) {
        match self.entries.back_mut() {
            Some(Entry::Lost(lost)) => *lost = lost.saturating_add(count),
            Some(Entry::Text(_)) | None => self.entries.push_back(Entry::Lost(count)),
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Whoever panicked with the lock left whole entries.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_all(&self, mut write: impl FnMut(&[u8])) {
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
                Entry::Lost(1) => b"(1 line was lost)\n".to_vec(),
                Entry::Lost(lost) => format!("{}\n", super::lost_lines(lost)).into_bytes(),
            };
            drop(state);
            write(&bytes);
            self.lock().writing = false;
            self.changed.notify_all();
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
        })
        .unwrap();
        queue.line("first");
        begins.recv().unwrap();
        // The thread is stuck with the first line: this many more wait, and the rest is lost.
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
        // From then on every line counts again.
        queue.line("late\u{1b}");
        go_on.send(()).unwrap();
        assert_eq!(lines.recv().unwrap(), "late\u{FFFD}\n");
    }

    #[test]
    fn a_flush_waits_for_the_last_line() {
        let (written, lines) = mpsc::channel();
        let queue = LineQueue::start(move |bytes| written.send(bytes.len()).unwrap()).unwrap();
        for _ in 0..100 {
            queue.line("abc");
        }
        queue.flush();
        assert_eq!(lines.try_iter().collect::<Vec<_>>(), vec![4; 100]);
    }
}
