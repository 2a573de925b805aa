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
    kept: Mutex<VecDeque<Kept>>,
    last: watch::Sender<u64>,
}

/// What is kept of one number.
#[derive(Clone, Debug)]
struct Kept {
    id: u64,
    /// `None`: another gateway may have told of events that did not come.
    event: Option<Event>,
    /// Whether it is about a robot of another gateway.
    is_far: bool,
}

impl Default for News {
    fn default() -> Self {
        Self { kept: Mutex::default(), last: watch::Sender::new(0) }
    }
}

impl News {
    /// Adds an event.
    pub fn add(&self, time: String, robot: &str, happened: Happened) {
        self.push(Some((time, robot, happened)), false);
    }

    /// Adds an event of a robot of another gateway, as that one tells it.
    pub fn add_far(&self, time: String, robot: &str, happened: Happened) {
        self.push(Some((time, robot, happened)), true);
    }

    /// Notes that events of robots of another gateway may be missing here.
    pub fn lose_far(&self) {
        self.push(None, true);
    }

    fn push(&self, event: Option<(String, &str, Happened)>, is_far: bool) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let id = *self.last.borrow() + 1;
        let event =
            event.map(|(time, robot, happened)| Event { id, time, robot: robot.to_owned(), happened });
        kept.push_back(Kept { id, event, is_far });
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
    fn kept_after(&self, id: u64) -> Result<Option<Kept>, u64> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(oldest) = kept.front().map(|kept| kept.id) else { return Ok(None) };
        if id + 1 < oldest {
            return Err(oldest);
        }
        let at = usize::try_from(id + 1 - oldest).unwrap_or(usize::MAX);
        Ok(kept.get(at).cloned())
    }
}

/// What a reader of events gets next.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// Events were missed. Those that are kept follow.
    Lost,
    /// The next event.
    Event(Event),
}

/// How far a reader of events has read.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    at: u64,
    is_lost: bool,
    /// Whether events of robots of other gateways are left out.
    own_only: bool,
}

impl Reading {
    /// A reader of what happens from now on.
    pub fn from_now(news: &News) -> Self {
        Self { at: *news.last.borrow(), is_lost: false, own_only: false }
    }

    /// A reader that has everything up to this event. `None`: it has events of another start of the gateway.
    pub fn after(news: &News, id: Option<u64>) -> Self {
        match id {
            Some(at) if at <= *news.last.borrow() => Self { at, is_lost: false, own_only: false },
            // Of an earlier start of the gateway, or from the future: tell all that is kept.
            _ => Self { at: 0, is_lost: true, own_only: false },
        }
    }

    /// The same, without events of robots of other gateways: they tell of them.
    pub fn of_own(self) -> Self {
        Self { own_only: true, ..self }
    }

    /// The last event that the reader got.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// What comes next; `None` if nothing has happened since.
    pub fn next(&mut self, news: &News) -> Option<Told> {
        if std::mem::take(&mut self.is_lost) {
            return Some(Told::Lost);
        }
        loop {
            match news.kept_after(self.at) {
                Err(oldest) => {
                    self.at = oldest.saturating_sub(1);
                    return Some(Told::Lost);
                }
                Ok(kept) => {
                    let Kept { id, event, is_far } = kept?;
                    self.at = id;
                    if !(is_far && self.own_only) {
                        return Some(event.map_or(Told::Lost, Told::Event));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn events_are_numbered_and_a_late_reader_is_told() {
        let news = News::default();
        let after = |id| news.kept_after(id).map(|kept| kept.map(|kept| kept.id));
        assert_eq!(after(0), Ok(None));
        for _ in 0..=KEPT {
            news.add("now".to_owned(), "press", Happened::LinkUp {});
        }
        assert_eq!(after(0), Err(2), "the first is gone");
        assert_eq!(after(1), Ok(Some(2)));
        assert_eq!(after(KEPT as u64), Ok(Some(KEPT as u64 + 1)));
        assert_eq!(after(KEPT as u64 + 1), Ok(None));
        assert_eq!(*news.watch().borrow(), KEPT as u64 + 1);
    }

    #[test]
    fn another_gateway_is_told_only_of_robots_that_it_does_not_tell_of() {
        let news = News::default();
        let (mut all, mut own) = (Reading::from_now(&news), Reading::from_now(&news).of_own());
        news.add_far("now".to_owned(), "saw", Happened::LinkUp {});
        news.add("now".to_owned(), "press", Happened::LinkUp {});
        news.lose_far();
        let robot = |told: Option<Told>| match told {
            Some(Told::Event(event)) => event.robot,
            told => panic!("{told:?}"),
        };
        assert_eq!((robot(all.next(&news)), robot(all.next(&news))), ("saw".to_owned(), "press".to_owned()));
        assert_eq!(all.next(&news), Some(Told::Lost), "the other gateway may have told more");
        assert_eq!((robot(own.next(&news)), own.next(&news)), ("press".to_owned(), None));
    }

    proptest! {
        /// A reader that is slow, or that comes back with the id of any event, gets every event once and in
        /// order, or is told that some are missing.
        #[test]
        fn no_event_is_missed_without_a_word(
            acts in prop::collection::vec((0..5_u8, 0..700_u64), 1..40),
        ) {
            let news = News::default();
            let mut reading = Reading::from_now(&news);
            let (mut mine, mut added) = (0, 0);
            for (act, many) in acts {
                match act {
                    0 | 1 => for _ in 0..many {
                        news.add(String::new(), "press", Happened::LinkUp {});
                        added += 1;
                    },
                    2 => {
                        // It comes back with an id that may be of the future.
                        let id = (mine + many).saturating_sub(300);
                        reading = Reading::after(&news, Some(id));
                        if id > added {
                            prop_assert_eq!(reading.next(&news), Some(Told::Lost));
                            mine = reading.next(&news).map_or(0, |told| match told {
                                Told::Event(event) => event.id,
                                Told::Lost => reading.at(),
                            });
                        } else {
                            mine = id;
                        }
                    }
                    _ => for _ in 0..many {
                        match reading.next(&news) {
                            None => prop_assert_eq!(mine, added),
                            Some(Told::Lost) => mine = reading.at(),
                            Some(Told::Event(event)) => {
                                prop_assert_eq!(event.id, mine + 1);
                                mine = event.id;
                            }
                        }
                    },
                }
            }
        }
    }
}
