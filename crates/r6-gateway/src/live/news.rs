//! The log of events that streams read from.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use r6_api::gateway::{Event, Happened};
use tokio::sync::watch;

/// How many events are kept, each of some hundred bytes. A reader that missed more of them gets a reset.
const KEPT: usize = 1_000;

/// The last events of all robots.
#[derive(Debug)]
pub struct News {
    kept: Mutex<VecDeque<Event>>,
    last: watch::Sender<u64>,
}

impl Default for News {
    fn default() -> Self {
        Self { kept: Mutex::default(), last: watch::Sender::new(0) }
    }
}

impl News {
    /// Adds an event.
    pub fn add(&self, time: String, robot: &str, happened: Happened) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let id = *self.last.borrow() + 1;
        kept.push_back(Event { id, time, robot: robot.to_owned(), happened });
        if kept.len() > KEPT {
            kept.pop_front();
        }
        self.last.send_replace(id);
    }

    /// The number of the last event, and how to wait for the next one.
    pub fn watch(&self) -> watch::Receiver<u64> {
        self.last.subscribe()
    }

    /// The event after this one.
    ///
    /// # Errors
    /// The number of the oldest event that is kept: events in between are not kept any more.
    pub fn after(&self, id: u64) -> Result<Option<Event>, u64> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(oldest) = kept.front().map(|event| event.id) else { return Ok(None) };
        if id + 1 < oldest {
            return Err(oldest);
        }
        let at = usize::try_from(id + 1 - oldest).unwrap_or(usize::MAX);
        Ok(kept.get(at).cloned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_numbered_and_a_late_reader_is_told() {
        let news = News::default();
        assert_eq!(news.after(0), Ok(None));
        for _ in 0..=KEPT {
            news.add("now".to_owned(), "press", Happened::LinkUp {});
        }
        assert_eq!(news.after(0), Err(2), "the first is gone");
        assert_eq!(news.after(1).unwrap().unwrap().id, 2);
        assert_eq!(news.after(KEPT as u64).unwrap().unwrap().id, KEPT as u64 + 1);
        assert_eq!(news.after(KEPT as u64 + 1), Ok(None));
        assert_eq!(*news.watch().borrow(), KEPT as u64 + 1);
    }
}
