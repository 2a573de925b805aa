//! A running scenario: what is due next, and which faults are in force.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use r6_proto::message::Instruction;
use r6_proto::time::Instant;

use super::{Bounce, Happening, InputPoint, Scenario, Window};
use crate::fault::Fault;
use crate::io::Io;
use r6_traffic::random::Random;

/// How many reactions may be pending at once. The bound keeps an output that changes fast, with a slow input,
/// from filling the memory. Beyond it, changes are not followed.
const MAX_UNDER_WAY: usize = 10_000;

/// How many faults can be given at once while it runs: each of the words once, and some to spare.
pub(crate) const MAX_GIVEN: usize = 40;

/// Separates a scenario's random numbers from the machine's.
const OWN_NUMBERS: u64 = 0x5ce7_a210;

/// A running scenario.
#[derive(Clone, Debug)]
pub(crate) struct ScenarioRun {
    scenario: Arc<Scenario>,
    random: Random,
    started: Instant,
    /// What is due, by time and by the order of planning.
    queue: BTreeMap<(Instant, u64), Due>,
    planned: u64,
    /// The state of each reaction: the last seen level of the output, and the latest time planned for the
    /// input.
    seen: Vec<(bool, Instant)>,
    /// The faults that were given while it runs, by their numbers, which go on behind those of the scenario.
    given: BTreeMap<usize, Window>,
    next_given: usize,
}

#[derive(Clone, Debug)]
enum Due {
    /// An entry of the timeline: its number, its time without the spread, how often it has happened.
    Entry(usize, Instant, u32),
    /// An input follows an output. This is already under way.
    Input(InputPoint, bool),
    /// An input bounces.
    Bounce(InputPoint, bool),
    /// A fault begins or ends.
    Edge,
    /// The mains are back.
    Power,
    /// A list that came earlier is taken.
    List(LateList),
}

/// A list that is taken later than it came.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LateList {
    /// Whether it replaces the list that is there at that time.
    pub replace: bool,
    /// Its instructions.
    pub steps: Vec<Instruction>,
}

/// Something that the scenario does.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Turn {
    /// An event of the timeline happens.
    Happens(Happening),
    /// An input follows an output.
    Follows(InputPoint, bool),
    /// An input bounces.
    Bounces(InputPoint, bool),
    /// A fault begins or ends.
    FaultsChange,
    /// The mains are back.
    PowerIsBack,
    /// A list that came earlier is taken.
    ListIsTaken(LateList),
}

impl ScenarioRun {
    pub fn new(scenario: Arc<Scenario>, seed: u64, now: Instant) -> Self {
        let mut run = Self {
            // Keeps these draws separate from the machine's, which come from the same seed.
            random: Random::new(scenario.seed.wrapping_add(seed) ^ OWN_NUMBERS),
            started: now,
            queue: BTreeMap::new(),
            planned: 0,
            seen: vec![(false, now); scenario.reactions.len()],
            given: BTreeMap::new(),
            next_given: scenario.faults.len(),
            scenario: Arc::clone(&scenario),
        };
        for (number, entry) in scenario.timeline.iter().enumerate() {
            run.plan_entry(number, now + entry.at, 0);
        }
        let ends = |window: &Window| window.lasts.map(|lasts| window.from + lasts);
        let edges = scenario.faults.iter().flat_map(|window| [Some(window.from), ends(window)]);
        // All faults that begin or end at one time need only one entry.
        for edge in edges.flatten().collect::<BTreeSet<_>>() {
            run.plan(now + edge, Due::Edge);
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

    /// When the next entry is due.
    pub fn next_due(&self) -> Option<Instant> {
        self.queue.keys().next().map(|(at, _)| *at)
    }

    /// When the next input change is due that is already under way. Others wait for it, as for a move.
    pub fn next_under_way(&self) -> Option<Instant> {
        self.queue
            .iter()
            .find(|(_, due)| matches!(due, Due::Input(..) | Due::Bounce(..)))
            .map(|((at, _), _)| *at)
    }

    /// Whether any input reacts to outputs.
    pub fn reacts(&self) -> bool {
        !self.scenario.reactions.is_empty()
    }

    /// Takes the next entry that is due at this time.
    pub fn take(&mut self, now: Instant) -> Option<Turn> {
        loop {
            let first = self.queue.first_entry().filter(|first| first.key().0 <= now)?;
            match first.remove() {
                Due::Input(input, on) => return Some(Turn::Follows(input, on)),
                Due::Bounce(input, on) => return Some(Turn::Bounces(input, on)),
                Due::Edge => return Some(Turn::FaultsChange),
                Due::Power => return Some(Turn::PowerIsBack),
                Due::List(list) => return Some(Turn::ListIsTaken(list)),
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

    /// Skips the repetitions up to now, and returns how many there were.
    pub fn catch_up(&mut self, now: Instant) -> u64 {
        let overdue = |(at, _): &(Instant, u64), due: &mut Due| {
            *at <= now && matches!(due, Due::Entry(number, ..) if self.scenario.repeats(*number))
        };
        let overdue: Vec<_> = self.queue.extract_if(.., overdue).collect();
        let mut skipped = 0;
        for (_, due) in overdue {
            let Due::Entry(number, at, happened) = due else { continue };
            let Some(entry) = self.scenario.timeline.get(number) else { continue };
            let Some(every) = entry.every.filter(|every| !every.is_zero()) else { continue };
            let missed = now.since(at).as_nanos() / every.as_nanos() + 1;
            let left = entry.times.map_or(u32::MAX, |times| times.saturating_sub(happened));
            let missed = u32::try_from(missed).unwrap_or(u32::MAX).min(left);
            skipped += u64::from(missed);
            if missed < left {
                self.plan_entry(number, at + every * missed, happened + missed);
            }
        }
        skipped
    }

    /// Plans the bounces of a contact. Returns false if there was not enough room.
    pub fn bounce(&mut self, now: Instant, bounce: &Bounce) -> bool {
        let step = bounce.within / bounce.times.max(1);
        for change in 0..bounce.times {
            if self.queue.len() >= MAX_UNDER_WAY {
                return false;
            }
            let on = bounce.on == ((bounce.times - change) % 2 == 1);
            self.plan(now + step * change, Due::Bounce(bounce.input, on));
        }
        true
    }

    /// Plans that a list is taken at this time. Without room the list is lost.
    pub fn take_later(&mut self, at: Instant, list: LateList) {
        if self.queue.len() < MAX_UNDER_WAY {
            self.plan(at, Due::List(list));
        }
    }

    /// Drops the lists that were to be taken later, because the mains fail.
    pub fn lose_lists(&mut self) {
        self.queue.retain(|_, due| !matches!(due, Due::List(_)));
    }

    /// Plans that the mains are back at this time, or later if they already fail for longer.
    pub fn power_is_back(&mut self, at: Instant) {
        let planned = self.queue.iter().find(|(_, due)| matches!(due, Due::Power)).map(|(key, _)| *key);
        if planned.is_some_and(|(planned, _)| planned >= at) {
            return;
        }
        if let Some(planned) = planned {
            self.queue.remove(&planned);
        }
        self.plan(at, Due::Power);
    }

    /// Plans how inputs follow the outputs that have changed. Returns false if there was not enough room.
    pub fn react(&mut self, now: Instant, io: &Io) -> bool {
        let scenario = Arc::clone(&self.scenario);
        let mut room = true;
        for (number, reaction) in scenario.reactions.iter().enumerate() {
            let on = io.is_set(reaction.when);
            let Some((seen, last)) = self.seen.get_mut(number) else { continue };
            if std::mem::replace(seen, on) == on || reaction.is.is_some_and(|is| is != on) {
                continue;
            }
            if self.queue.len() >= MAX_UNDER_WAY {
                room = false;
                continue;
            }
            // Whatever the spread, the input ends at the level for the last change of the output.
            let due = (now + reaction.after + self.random.up_to(reaction.spread)).max(*last);
            *last = due;
            self.plan(due, Due::Input(reaction.then, reaction.set.unwrap_or(on)));
        }
        room
    }

    /// The numbers of the faults in force at this time.
    pub fn in_force(&self, now: Instant) -> Vec<usize> {
        let since = now.since(self.started);
        let windows = self.scenario.faults.iter().enumerate();
        let windows = windows.chain(self.given.iter().map(|(number, window)| (*number, window)));
        windows.filter(|(_, window)| window.is_in_force(since)).map(|(number, _)| number).collect()
    }

    /// A fault and its chance.
    pub fn fault(&self, number: usize) -> Option<(&Fault, f64)> {
        self.window(number).map(|window| (&window.fault, window.chance))
    }

    fn window(&self, number: usize) -> Option<&Window> {
        self.scenario.faults.get(number).or_else(|| self.given.get(&number))
    }

    /// Gives it a fault from now on. Returns its number, or `None` if there are [`MAX_GIVEN`].
    pub fn give(
        &mut self,
        now: Instant,
        fault: Fault,
        chance: f64,
        lasts: Option<Duration>,
    ) -> Option<usize> {
        if self.given.len() >= MAX_GIVEN {
            return None;
        }
        let number = self.next_given;
        self.next_given += 1;
        let window = Window { fault, from: now.since(self.started), lasts, chance };
        self.given.insert(number, window);
        if let Some(lasts) = lasts {
            self.plan(now + lasts, Due::Edge);
        }
        Some(number)
    }

    /// Ends a fault now.
    pub fn end_fault(&mut self, now: Instant, number: usize) {
        let since = now.since(self.started);
        let end = |window: &mut Window| window.lasts = Some(since.saturating_sub(window.from));
        if let Some(window) = self.given.get_mut(&number) {
            end(window);
        } else if let Some(window) = Arc::make_mut(&mut self.scenario).faults.get_mut(number) {
            end(window);
        }
    }

    /// Forgets the given faults that are over. Numbers are not used again.
    pub fn forget_given(&mut self, now: Instant) {
        let since = now.since(self.started);
        self.given.retain(|_, window| window.is_in_force(since));
    }

    /// For how long a fault is in force from now on; `None` if its end is not planned.
    pub fn left(&self, now: Instant, number: usize) -> Option<Duration> {
        let window = self.window(number)?;
        Some(window.from.saturating_add(window.lasts?).saturating_sub(now.since(self.started)))
    }

    /// The random numbers of the scenario.
    pub fn random(&mut self) -> &mut Random {
        &mut self.random
    }
}
