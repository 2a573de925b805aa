//! The open blocks of all robots, and their way to the disk.
//!
//! It knows no clock and no thread: the recorder calls it.

mod averages;
mod retention;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use r6_api::gateway::{Gap, UnseenBecause};
use r6_proto::Address;
use r6_proto::time::Instant;

use averages::Averages;

use super::HistorySettings;
use super::counts::{HistoryCounts, RobotCounts};
use super::recorder::Batch;
use crate::core::history::block::{OpenBlocks, Write};
use crate::core::history::event::{Event, Observed};
use crate::core::history::sample::{Interval, Micros, Sample, State};
use crate::core::history::{tail, turns};
use crate::core::name::RobotName;
use crate::core::owner::Claim;
use crate::core::watch::Before;
use crate::store::StoreError;
#[cfg(feature = "simulation")]
use crate::store::history::Days;
use crate::store::history::{HistoryStore, Part, Tail};

/// How much is written in one transaction, in bytes, so that the write-ahead log stays small.
const MAX_TOGETHER: usize = 1024 * 1024;

/// This share of the memory of samples is for events that wait for the disk: four megabytes hold some ten
/// thousand.
const EVENT_SHARE: usize = 16;

/// In how many files to look when a robot was read last: those of today and yesterday, in general.
const SEEN_PARTS: usize = 3;

/// Of how many robots it is known when they were read last: more than a gateway has, for those that were
/// removed.
const MAX_SEEN: usize = 4_096;

/// One robot. It is forgotten when all of its samples are in chunks on the disk.
#[derive(Debug)]
struct Robot {
    blocks: OpenBlocks,
    counts: Arc<RobotCounts>,
    /// The time of the last poll that was taken in.
    time: Micros,
    /// Since when samples of a signal are lost.
    lost: BTreeMap<Address, Micros>,
    /// Events that are not on the disk.
    events: Vec<Event>,
    /// Since when events are lost.
    events_lost: Option<Micros>,
}

impl Robot {
    /// What is to be written now, by day, earlier days first.
    fn writes(&self) -> BTreeMap<i64, Write> {
        let mut writes = self.blocks.writes();
        for event in &self.events {
            writes.entry(event.time.day()).or_default().events.push(event.clone());
        }
        writes
    }

    /// What [`Self::writes`] said was written, and nothing was taken in since.
    fn written(&mut self) {
        self.blocks.written();
        self.events.clear();
        self.counts.keep_until(self.time);
    }

    fn is_done(&self) -> bool {
        let has_events = !self.events.is_empty() || self.events_lost.is_some();
        self.blocks.is_empty() && self.lost.is_empty() && !has_events
    }
}

/// The open blocks of all robots.
#[derive(Debug)]
pub struct Journal<S> {
    store: S,
    settings: HistorySettings,
    counts: Arc<HistoryCounts>,
    robots: BTreeMap<RobotName, Robot>,
    /// The memory of all blocks, in bytes.
    size: usize,
    /// The memory of all events, in bytes.
    events_size: usize,
    /// Whether the tails of an earlier process were made to chunks.
    is_recovered: bool,
    /// The robots whose tails are made to chunks; `None`: all of them.
    taken_over: Option<BTreeSet<RobotName>>,
    /// When each robot was read last.
    seen: BTreeMap<RobotName, Micros>,
    /// Where the last event of each robot stands.
    last_events: BTreeMap<RobotName, Micros>,
    /// Whether there are files that were not looked through for that.
    has_older: bool,
    /// How much was written since the size of the files was looked at.
    written: u64,
    /// Whether the disk had too little room when it was looked at last.
    has_no_room: bool,
    averages: Averages,
    /// Whether the store keeps averages.
    has_averages: bool,
}

/// A journal of the history in this folder, for a simulated past.
#[cfg(feature = "simulation")]
pub fn of_folder(folder: &std::path::Path, settings: HistorySettings) -> Journal<Days> {
    let store = Days::to_write(folder, settings.max_bytes);
    Journal::new(store, settings, Arc::default())
}

impl<S: HistoryStore> Journal<S> {
    /// Nothing is open.
    pub fn new(mut store: S, settings: HistorySettings, counts: Arc<HistoryCounts>) -> Self {
        let (robots, has_averages) = (BTreeMap::new(), store.averages().is_some());
        Self {
            store,
            settings,
            counts,
            robots,
            size: 0,
            events_size: 0,
            is_recovered: false,
            taken_over: None,
            seen: BTreeMap::new(),
            last_events: BTreeMap::new(),
            has_older: false,
            // The limits are looked at before the first write.
            written: u64::MAX,
            has_no_room: false,
            averages: Averages::default(),
            has_averages,
        }
    }

    /// Nothing is open, and this gateway owns no robot yet.
    pub fn shared(self) -> Self {
        Self { taken_over: Some(BTreeSet::new()), ..self }
    }

    /// This gateway owns these from now on. What it had of them is of an earlier term, and the tails in the
    /// store are of the owner before.
    pub fn take_over(&mut self, claims: &[Claim]) {
        self.store.hold(claims);
        for robot in claims.iter().filter_map(|claim| claim.of.robot()) {
            self.robots.remove(robot);
            self.seen.remove(robot);
            self.last_events.remove(robot);
            self.taken_over.get_or_insert_default().insert(robot.clone());
        }
        self.is_recovered = false;
    }

    /// Takes in what was read of a robot.
    pub fn take(&mut self, now: Instant, batch: Batch) {
        let Batch { robot, time, samples, events, counts } = batch;
        self.note_seen(&robot, time);
        let mut last_event = self.last_events.get(&robot).copied();
        let is_full = self.size >= self.settings.memory && self.counts.paused.load(Ordering::Relaxed);
        let name = robot.clone();
        let entry = self.robots.entry(robot);
        let robot = entry.or_insert_with(|| Robot {
            blocks: OpenBlocks::default(),
            counts: Arc::clone(&counts),
            time,
            lost: BTreeMap::new(),
            events: Vec::new(),
            events_lost: None,
        });
        robot.counts = counts;
        let most = self.settings.memory / EVENT_SHARE;
        let gap = robot.events_lost.take_if(|_| self.events_size < most).map(|from| {
            let because = UnseenBecause::Lost;
            Event::new(time, Observed::Unseen { from: Some(from), to: time, because })
        });
        for event in gap.into_iter().chain(events) {
            let event = turns::behind(last_event, event);
            last_event = Some(event.time);
            if self.events_size >= most {
                robot.counts.lose_events(1);
                robot.events_lost.get_or_insert(event.time);
                continue;
            }
            robot.counts.keep_events(1);
            self.events_size += event.size();
            robot.events.push(event);
        }
        if let Some(last) = last_event {
            if self.last_events.len() >= MAX_SEEN && !self.last_events.contains_key(&name) {
                self.last_events.pop_first();
            }
            self.last_events.insert(name, last);
        }
        if is_full {
            robot.counts.lose(samples.len() as u64);
            for (address, _, sample) in samples {
                robot.lost.entry(address).or_insert(sample.time);
            }
            return;
        }
        let before = robot.blocks.size();
        robot.time = time;
        robot.counts.keep(samples.len());
        for (address, interval, sample) in samples {
            if let Some(since) = robot.lost.remove(&address) {
                let gap = Sample { time: since.min(sample.time), state: State::Gap(Gap::Lost) };
                robot.blocks.push(now, address, interval, gap);
            }
            robot.blocks.push(now, address, interval, sample);
        }
        self.size = (self.size + robot.blocks.size()).saturating_sub(before);
        if self.size >= self.settings.memory {
            self.seal_largest();
        }
    }

    /// Seals the robots that take the most memory, until a quarter of it is free or nothing is left to seal.
    fn seal_largest(&mut self) {
        let mut sizes: Vec<_> = self.robots.iter_mut().map(|(_, robot)| &mut robot.blocks).collect();
        sizes.sort_by_key(|blocks| std::cmp::Reverse(blocks.size()));
        for blocks in sizes {
            if self.size < self.settings.memory / 4 * 3 {
                break;
            }
            let before = blocks.size();
            blocks.seal_all();
            self.size = (self.size + blocks.size()).saturating_sub(before);
        }
    }

    /// Seals all blocks: what comes next does not fit to them.
    pub fn seal_all(&mut self) {
        self.robots.values_mut().for_each(|robot| robot.blocks.seal_all());
        self.size = self.robots.values().map(|robot| robot.blocks.size()).sum();
    }

    /// Writes everything that is not on the disk yet, and keeps the limits.
    ///
    /// # Errors
    /// [`StoreError`]: what was not written stays in memory, and the next call tries again.
    pub fn flush(&mut self, now: Instant, time: Micros) -> Result<(), StoreError> {
        let flushed = self.try_flush(now, time);
        self.counts.paused.store(flushed.is_err(), Ordering::Relaxed);
        self.size = self.robots.values().map(|robot| robot.blocks.size()).sum();
        self.events_size = self.robots.values().flat_map(|robot| &robot.events).map(Event::size).sum();
        flushed
    }

    /// When a robot was read last, in this process or before.
    pub fn last_seen(&mut self, now: Instant, time: Micros, robot: &RobotName) -> Before {
        if let Err(error) = self.make_ready(now, time) {
            tracing::error!(%error, %robot, "it is not known when the robot was read last");
            return Before::Seen(None);
        }
        match self.seen.get(robot) {
            Some(seen) => Before::Seen(Some(*seen)),
            None if self.has_older => Before::Seen(None),
            None => Before::Never,
        }
    }

    fn note_seen(&mut self, robot: &RobotName, time: Micros) {
        // Nothing was read yet.
        if time == Micros::default() {
            return;
        }
        if let Some(seen) = self.seen.get_mut(robot) {
            *seen = time;
            return;
        }
        if self.seen.len() >= MAX_SEEN {
            self.seen.pop_first();
            self.has_older = true;
        }
        self.seen.insert(robot.clone(), time);
    }

    /// Takes over what an earlier process left.
    fn make_ready(&mut self, now: Instant, time: Micros) -> Result<(), StoreError> {
        if self.is_recovered {
            return Ok(());
        }
        self.recover(now, time)?;
        let parts = self.store.parts()?;
        self.has_older |= parts.len() > SEEN_PARTS;
        for (part, _) in parts.into_iter().rev().take(SEEN_PARTS) {
            match self.store.last_seen(part) {
                // What this process has read is newer, and so is what a later part says.
                Ok(seen) => seen.into_iter().for_each(|(robot, seen)| {
                    if !self.seen.contains_key(&robot) {
                        self.note_seen(&robot, seen);
                    }
                }),
                Err(StoreError::Unreadable(_)) => self.has_older = true,
                Err(error) => return Err(error),
            }
        }
        self.load_averages(time.day());
        self.is_recovered = true;
        self.taken_over.as_mut().map(BTreeSet::clear);
        Ok(())
    }

    fn try_flush(&mut self, now: Instant, time: Micros) -> Result<(), StoreError> {
        self.make_ready(now, time)?;
        self.keep_limits(time)?;
        self.robots.values_mut().for_each(|robot| robot.blocks.seal_old(now));
        let names: Vec<_> = self.robots.keys().cloned().collect();
        let mut names = names.into_iter().peekable();
        while names.peek().is_some() {
            self.write_some(&mut names, time)?;
        }
        self.robots.retain(|_, robot| !robot.is_done());
        Ok(())
    }

    /// Writes the robots that fit into one transaction.
    fn write_some(
        &mut self,
        names: &mut impl Iterator<Item = RobotName>,
        time: Micros,
    ) -> Result<(), StoreError> {
        self.keep_limits(time)?;
        let mut days = BTreeMap::<i64, Vec<(RobotName, Write)>>::new();
        let (mut size, mut together) = (0, Vec::new());
        while size < MAX_TOGETHER
            && let Some(name) = names.next()
        {
            let Some(robot) = self.robots.get(&name) else { continue };
            for (day, write) in robot.writes() {
                size += write.events.iter().map(Event::size).sum::<usize>();
                size += write.tail.as_ref().map_or(0, Vec::len);
                size += write.chunks.iter().map(|(_, chunk)| chunk.bytes.len()).sum::<usize>();
                days.entry(day).or_default().push((name.clone(), write));
            }
            together.push(name);
        }
        self.written = self.written.saturating_add(size as u64);
        days.keys().for_each(|day| self.reopen(*day, time.day()));
        let written = days.into_iter().try_for_each(|(day, writes)| self.store.write(day, &writes));
        for name in &together {
            let Some(robot) = self.robots.get_mut(name) else { continue };
            match written {
                Ok(()) => robot.written(),
                Err(_) => robot.blocks.failed(),
            }
        }
        if let Err(StoreError::Unreadable(_)) = &written {
            // The file of the day is broken: the next attempt writes all that is in memory into another one.
            self.seal_all();
            self.store.begin_part(time.day())?;
        }
        written
    }

    /// Makes chunks of the tails that an earlier process left.
    fn recover(&mut self, now: Instant, time: Micros) -> Result<(), StoreError> {
        for (part, _) in self.store.parts()? {
            let tails = match self.store.tails(part) {
                Ok(tails) => tails,
                Err(error @ StoreError::Unreadable(_)) => {
                    tracing::error!(%error, ?part, "a file of the history cannot be read: it is left alone");
                    if part.day == time.day() {
                        self.store.begin_part(part.day)?;
                    }
                    continue;
                }
                Err(error) => return Err(error),
            };
            let is_ours =
                |found: &Tail| self.taken_over.as_ref().is_none_or(|robots| robots.contains(&found.robot));
            for found in tails.into_iter().filter(is_ours).collect::<Vec<_>>() {
                if found.rows.iter().any(|row| tail::is_later(row)) {
                    tracing::error!(robot = %found.robot, ?part, "a newer r6 wrote samples: they are left to it");
                    // What is written from now on removes the tails of its own part.
                    if part.day == time.day() {
                        self.store.begin_part(part.day)?;
                    }
                    continue;
                }
                let samples = self.read_tail(part, &found.robot, &found.rows);
                let mut blocks = OpenBlocks::default();
                for (address, interval, sample) in samples {
                    blocks.push(now, address, interval, sample);
                }
                blocks.seal_all();
                let chunks = blocks.writes().into_values().flat_map(|write| write.chunks).collect();
                let write = Write { chunks, replace_tail: true, ..Write::default() };
                self.store.write_part(part, &[(found.robot, write)])?;
            }
        }
        Ok(())
    }

    fn read_tail(&self, part: Part, robot: &RobotName, rows: &[Vec<u8>]) -> Vec<(Address, Interval, Sample)> {
        let mut all = Vec::new();
        for row in rows {
            match tail::decode(row) {
                Ok(signals) => {
                    for (address, decoded) in signals {
                        let samples = decoded.samples.into_iter();
                        all.extend(samples.map(|sample| (address, decoded.interval, sample)));
                    }
                }
                Err(error) => {
                    self.counts.unreadable.fetch_add(1, Ordering::Relaxed);
                    tracing::error!(%robot, ?part, %error, "samples that were not in a chunk yet are lost");
                }
            }
        }
        all
    }

    /// The samples of a signal that are not in a chunk on the disk.
    pub fn open(&self, robot: &RobotName, address: Address) -> Vec<(Interval, Vec<Sample>)> {
        let open = self.robots.get(robot).map(|robot| robot.blocks.samples(address));
        // Only a fault of the codec could make bytes that it cannot read.
        open.and_then(Result::ok).unwrap_or_default()
    }

    /// Writes everything as chunks, so that no tail is left: a day is about to begin a new part.
    fn seal_for_part(&mut self, today: i64) -> Result<(), StoreError> {
        self.seal_all();
        let names: BTreeSet<_> = self.robots.keys().cloned().collect();
        for name in names {
            let writes = self.robots.get(&name).map(Robot::writes).unwrap_or_default();
            writes.keys().for_each(|day| self.reopen(*day, today));
            let Some(robot) = self.robots.get_mut(&name) else { continue };
            for (day, write) in writes {
                if let Err(error) = self.store.write(day, &[(name.clone(), write)]) {
                    robot.blocks.failed();
                    return Err(error);
                }
            }
            robot.written();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
