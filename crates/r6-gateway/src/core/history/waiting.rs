//! Events that wait because the thread of the history takes nothing for the moment.

use r6_api::gateway::UnseenBecause;

use super::event::{Event, Observed};
use super::sample::Micros;

/// How many events of one robot wait: some minutes of an arm that works.
pub const MAX_WAITING: usize = 256;

/// The events of one robot that were not handed over.
#[derive(Clone, Debug, Default)]
pub struct Waiting {
    events: Vec<Event>,
    /// Since when events are lost that were not told of.
    lost_from: Option<Micros>,
    /// The begin of the gap at the end of what was taken last.
    told_from: Option<Micros>,
}

impl Waiting {
    /// Takes in what happened. Returns how many events are lost, because too many wait.
    #[must_use]
    pub fn note(&mut self, events: Vec<Event>) -> usize {
        let mut lost = 0;
        for event in events {
            if self.events.len() < MAX_WAITING && self.lost_from.is_none() {
                self.events.push(event);
            } else {
                self.lost_from.get_or_insert(event.time);
                lost += 1;
            }
        }
        lost
    }

    /// Whether there is nothing to hand over.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.events.is_empty() && self.lost_from.is_none()
    }

    /// How many events wait.
    #[must_use]
    pub fn count(&self) -> usize {
        self.events.len()
    }

    /// What to hand over now, at this time. If events were lost, an event at the end says so.
    #[must_use]
    pub fn take(&mut self, now: Micros) -> Vec<Event> {
        let mut events = std::mem::take(&mut self.events);
        self.told_from = self.lost_from.take();
        if let Some(from) = self.told_from {
            let (to, because) = (now.max(from), UnseenBecause::Lost);
            events.push(Event::new(to, Observed::Unseen { from: Some(from), to, because }));
        }
        events
    }

    /// What was taken last could not be handed over.
    pub fn put_back(&mut self, mut events: Vec<Event>) {
        // What says that events were lost is made anew, up to the time when it is handed over. Others may say
        // so too, of readings.
        if let Some(from) = self.told_from.take() {
            events.pop();
            self.lost_from = Some(from);
        }
        self.events = events;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_gap_of_readings_that_comes_back_is_an_event_like_others() {
        let mut waiting = Waiting::default();
        let (from, because) = (Some(Micros(1)), UnseenBecause::Lost);
        let gap = Event::new(Micros(2), Observed::Unseen { from, to: Micros(2), because });
        assert_eq!(waiting.note(vec![gap.clone()]), 0);
        let taken = waiting.take(Micros(3));
        waiting.put_back(taken);
        let later = Event::new(Micros(4), Observed::LinkLost {});
        assert_eq!(waiting.note(vec![later.clone()]), 0, "nothing was lost of the events");
        assert_eq!(waiting.take(Micros(5)), [gap, later]);
    }

    proptest! {
        /// Each event is handed over once and in order, or counted as lost and covered by a gap that is told.
        #[test]
        fn no_event_is_lost_without_a_word(
            steps in prop::collection::vec((0..200_usize, any::<bool>(), prop::bool::weighted(0.3)), 1..30),
        ) {
            let mut waiting = Waiting::default();
            let (mut time, mut noted, mut lost, mut got) = (0, 0, 0, Vec::new());
            for (count, hands_over, works) in steps.into_iter().chain([(0, true, true)]) {
                let events = (0..count).map(|_| {
                    time += 1;
                    Event::new(Micros(time), Observed::LinkLost {})
                });
                lost += waiting.note(events.collect());
                noted += count;
                prop_assert!(waiting.events.len() <= MAX_WAITING);
                if hands_over {
                    time += 1;
                    let events = waiting.take(Micros(time));
                    prop_assert!(waiting.is_empty());
                    if works { got.extend(events) } else { waiting.put_back(events) }
                }
            }
            prop_assert!(waiting.is_empty());
            prop_assert!(got.windows(2).all(|pair| pair[0].time <= pair[1].time));
            let (mut known, mut covered) = (0, 0);
            for event in &got {
                match event.observed {
                    Observed::Unseen { from: Some(from), to, .. } => {
                        prop_assert_eq!(event.time, to);
                        covered += usize::try_from(to.0 - from.0).unwrap();
                    }
                    _ => known += 1,
                }
            }
            prop_assert_eq!(known + lost, noted);
            prop_assert!(covered >= lost, "{} of {}", covered, lost);
        }
    }
}
