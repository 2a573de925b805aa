//! A scenario under way: what is due next, what is in force now.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::time::Instant;

use super::{Bounce, Happening, InputPoint, Scenario};
use crate::fault::Fault;
use crate::io::Io;
use crate::random::Random;

/// How many reactions may be under way at once: an output that flutters while its input takes its time to follow does not fill
/// the memory. Beyond, changes are not followed.
const MAX_UNDER_WAY: usize = 10_000;

/// A scenario under way.
#[derive(Clone, Debug)]
pub(crate) struct ScenarioRun {
    scenario: Arc<Scenario>,
    random: Random,
    started: Instant,
    /// What comes, by its time and the order in which it was planned.
    queue: BTreeMap<(Instant, u64), Due>,
    planned: u64,
    /// How the outputs stood that reactions watch.
    seen: Vec<bool>,
}

#[derive(Clone, Debug)]
enum Due {
    /// An entry of the timeline: its number, when it would be without its spread, how often it has happened.
    Entry(usize, Instant, u32),
    /// An input that follows, or bounces: it is on its way already.
    Input(InputPoint, bool),
    /// A fault begins or ends.
    Edge,
    /// The mains are back.
    Power,
}

/// What a scenario has to say.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Turn {
    /// Something happens.
    Happens(Happening),
    /// A fault begins or ends.
    FaultsChange,
    /// The mains are back.
    PowerIsBack,
}

impl ScenarioRun {
    pub fn new(scenario: Arc<Scenario>, seed: u64, now: Instant) -> Self {
        let mut run = Self {
            random: Random::new(scenario.seed.wrapping_add(seed)),
            started: now,
            queue: BTreeMap::new(),
            planned: 0,
            seen: vec![false; scenario.reactions.len()],
            scenario: Arc::clone(&scenario),
        };
        for (number, entry) in scenario.timeline.iter().enumerate() {
            run.plan_entry(number, now + entry.at, 0);
        }
        for window in &scenario.faults {
            let begins = now + window.from;
            run.plan(begins, Due::Edge);
            if let Some(lasts) = window.lasts {
                run.plan(begins + lasts, Due::Edge);
            }
        }
        run
    }

    fn plan(&mut self, at: Instant, due: Due) {
        self.queue.insert((at, self.planned), due);
        self.planned += 1;
    }

    fn plan_entry(&mut self, number: usize, at: Instant, happened: u32) {
        let Some(entry) = self.scenario.timeline.get(number) else { return };
        let later = self.random.up_to(entry.spread);
        self.plan(at + later, Due::Entry(number, at, happened));
    }

    /// When something is due next.
    pub fn next_due(&self) -> Option<Instant> {
        self.queue.keys().next().map(|(at, _)| *at)
    }

    /// When the next input follows that is on its way already: others wait for it, as for a move.
    pub fn next_under_way(&self) -> Option<Instant> {
        self.queue.iter().find(|(_, due)| matches!(due, Due::Input(..))).map(|((at, _), _)| *at)
    }

    /// Whether any input reacts to outputs.
    pub fn reacts(&self) -> bool {
        !self.scenario.reactions.is_empty()
    }

    /// What is due at this time, one after the other.
    pub fn take(&mut self, now: Instant) -> Option<Turn> {
        loop {
            let first = self.queue.first_entry().filter(|first| first.key().0 <= now)?;
            match first.remove() {
                Due::Input(input, on) => return Some(Turn::Happens(Happening::Panel(input.set(on)))),
                Due::Edge => return Some(Turn::FaultsChange),
                Due::Power => return Some(Turn::PowerIsBack),
                Due::Entry(number, at, happened) => {
                    let Some(entry) = self.scenario.timeline.get(number) else { continue };
                    let (what, every, times) = (entry.what.clone(), entry.every, entry.times);
                    if let Some(every) = every
                        && times.is_none_or(|times| happened + 1 < times)
                    {
                        self.plan_entry(number, at + every, happened.saturating_add(1));
                    }
                    return Some(Turn::Happens(what));
                }
            }
        }
    }

    /// Has a contact bounce from now on.
    pub fn bounce(&mut self, now: Instant, bounce: &Bounce) {
        let step = bounce.within / bounce.times.max(1);
        for change in 0..bounce.times {
            let on = bounce.on == ((bounce.times - change) % 2 == 1);
            self.plan(now + step * change, Due::Input(bounce.input, on));
        }
    }

    /// The mains are back after this time.
    pub fn power_is_back(&mut self, at: Instant) {
        self.plan(at, Due::Power);
    }

    /// Plans how inputs follow what has changed of the outputs; whether all of it found room.
    pub fn react(&mut self, now: Instant, io: &Io) -> bool {
        let scenario = Arc::clone(&self.scenario);
        let mut room = true;
        for (number, reaction) in scenario.reactions.iter().enumerate() {
            let on = io.is_set(reaction.when);
            let Some(seen) = self.seen.get_mut(number) else { continue };
            if std::mem::replace(seen, on) == on || reaction.is.is_some_and(|is| is != on) {
                continue;
            }
            if self.queue.len() >= MAX_UNDER_WAY {
                room = false;
                continue;
            }
            let after = reaction.after + self.random.up_to(reaction.spread);
            self.plan(now + after, Due::Input(reaction.then, reaction.set.unwrap_or(on)));
        }
        room
    }

    /// The faults in force at this time, each with its chance.
    pub fn in_force(&self, now: Instant) -> impl Iterator<Item = (&Fault, f64)> {
        let since = now.since(self.started);
        let over = move |window: &super::Window| {
            window.lasts.is_some_and(|lasts: Duration| since >= window.from + lasts)
        };
        let windows = self.scenario.faults.iter().filter(move |window| since >= window.from && !over(window));
        windows.map(|window| (&window.fault, window.chance))
    }

    /// Whatever the scenario leaves open.
    pub fn random(&mut self) -> &mut Random {
        &mut self.random
    }
}
