//! The history in memory, for tests. It can fail, and it takes as much room as it is told to.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, MutexGuard};

use r6_proto::Address;

use super::averages::{AskAverages, AverageFile, AverageRow, AverageStore, DayNote};
use super::{Ask, AskEvents, Entry, HistoryStore, KeptEvent, Part, Tail};
use crate::core::history::averages::Step;
use crate::core::history::block::{Chunk, Write};
use crate::core::history::event::Event;
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::store::StoreError;

/// The history in memory. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct MemoryDays(Arc<Mutex<Held>>);

#[derive(Debug, Default)]
struct Held {
    parts: BTreeMap<Part, File>,
    averages: BTreeMap<AverageFile, Averages>,
    begun: BTreeMap<i64, u32>,
    /// How many writes fail from now on.
    failures: u32,
    /// Whether a write that fails is done all the same, as with an error behind the commit.
    fails_after: bool,
}

#[derive(Debug, Default)]
struct File {
    chunks: Vec<(RobotName, Address, Chunk)>,
    tails: BTreeMap<RobotName, Vec<Vec<u8>>>,
    events: Vec<(RobotName, Event)>,
}

#[derive(Debug, Default)]
struct Averages {
    rows: BTreeMap<(RobotName, Address, i64), Vec<u8>>,
    states: BTreeMap<i64, DayNote>,
}

impl MemoryDays {
    /// Lets the next writes fail, before or after they are done.
    pub fn fail(&self, count: u32, after: bool) {
        let mut held = self.held();
        (held.failures, held.fails_after) = (count, after);
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.0.lock().unwrap()
    }
}

impl HistoryStore for MemoryDays {
    fn write(&mut self, day: i64, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        let number = {
            let held = self.held();
            let there = held.parts.keys().filter(|part| part.day == day).map(|part| part.number).max();
            held.begun.get(&day).copied().or(there).unwrap_or(1)
        };
        self.write_part(Part { day, number }, writes)
    }

    fn write_part(&mut self, part: Part, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        let mut held = self.held();
        let fails = held.failures > 0;
        held.failures = held.failures.saturating_sub(1);
        let failure = Err(StoreError::Unavailable("the disk is full".to_owned()));
        if fails && !held.fails_after {
            return failure;
        }
        let file = held.parts.entry(part).or_default();
        for (robot, write) in writes {
            if write.replace_tail {
                file.tails.remove(robot);
            }
            for (address, chunk) in &write.chunks {
                let row = (robot.clone(), *address, chunk.clone());
                if !file.chunks.contains(&row) {
                    file.chunks.push(row);
                }
            }
            if let Some(tail) = &write.tail {
                file.tails.entry(robot.clone()).or_default().push(tail.clone());
            }
            for event in &write.events {
                let row = (robot.clone(), event.clone());
                if !file.events.contains(&row) {
                    file.events.push(row);
                }
            }
        }
        if fails { failure } else { Ok(()) }
    }

    fn begin_part(&mut self, day: i64) -> Result<(), StoreError> {
        let mut held = self.held();
        let there = held.parts.keys().filter(|part| part.day == day).map(|part| part.number).max();
        let number = held.begun.get(&day).copied().or(there).unwrap_or(1) + 1;
        held.begun.insert(day, number);
        Ok(())
    }

    fn tails(&mut self, part: Part) -> Result<Vec<Tail>, StoreError> {
        let held = self.held();
        let tails = held.parts.get(&part).into_iter().flat_map(|file| file.tails.clone());
        Ok(tails.map(|(robot, rows)| Tail { part, robot, rows }).collect())
    }

    fn entries(&mut self, part: Part, ask: Ask<'_>, most: usize) -> Result<Vec<Entry>, StoreError> {
        let held = self.held();
        let chunks = held.parts.get(&part).into_iter().flat_map(|file| &file.chunks);
        let fits = |(_, (robot, address, chunk)): &(i64, &(RobotName, Address, Chunk))| {
            let first = chunk.summary.first;
            robot == ask.robot && *address == ask.address && first >= ask.from && first < ask.to
        };
        let entries = (1..).zip(chunks).filter(fits);
        let entry =
            |(row, chunk): (i64, &(_, _, Chunk))| Entry { part, row, summary: chunk.2.summary.clone() };
        let mut entries: Vec<_> = entries.map(entry).collect();
        entries.sort_by_key(|entry| (entry.summary.first, entry.row));
        entries.truncate(most);
        Ok(entries)
    }

    fn last_entry(&mut self, part: Part, ask: Ask<'_>) -> Result<Option<Entry>, StoreError> {
        let entries = self.entries(part, ask, usize::MAX)?;
        Ok(entries.into_iter().max_by_key(|entry| entry.summary.last))
    }

    fn bytes(&mut self, part: Part, rows: &[i64]) -> Result<Vec<Option<Vec<u8>>>, StoreError> {
        let held = self.held();
        let file = held.parts.get(&part);
        let bytes = |row: &i64| Some(file?.chunks.get(usize::try_from(*row - 1).ok()?)?.2.bytes.clone());
        Ok(rows.iter().map(bytes).collect())
    }

    fn events(&mut self, part: Part, ask: AskEvents<'_>, most: usize) -> Result<Vec<KeptEvent>, StoreError> {
        let held = self.held();
        let events = held.parts.get(&part).into_iter().flat_map(|file| &file.events);
        let kept = (1..).zip(events).filter(|(row, (robot, event))| {
            robot == ask.robot && (event.time, *row) > ask.after && event.time < ask.to
        });
        let kept = kept.map(|(row, (_, event))| KeptEvent {
            part,
            row,
            time: event.time,
            event: Some(event.clone()),
        });
        let mut kept: Vec<_> = kept.collect();
        kept.sort_by_key(|kept| (kept.time, kept.row));
        kept.truncate(most);
        Ok(kept)
    }

    fn last_seen(&mut self, part: Part) -> Result<Vec<(RobotName, Micros)>, StoreError> {
        let held = self.held();
        let chunks = held.parts.get(&part).into_iter().flat_map(|file| &file.chunks);
        let mut seen = BTreeMap::new();
        for (robot, _, chunk) in chunks {
            let last = seen.entry(robot.clone()).or_insert(chunk.summary.last);
            *last = chunk.summary.last.max(*last);
        }
        Ok(seen.into_iter().collect())
    }

    fn parts(&mut self) -> Result<Vec<(Part, u64)>, StoreError> {
        let size = |file: &File| {
            let chunks = file.chunks.iter().map(|(_, _, chunk)| chunk.bytes.len() + 100).sum::<usize>();
            let events = file.events.iter().map(|(_, event)| event.encode().0.len() + 50).sum::<usize>();
            (chunks + events + file.tails.values().flatten().map(Vec::len).sum::<usize>()) as u64
        };
        Ok(self.held().parts.iter().map(|(part, file)| (*part, size(file))).collect())
    }

    fn free_bytes(&mut self) -> Option<u64> {
        None
    }

    fn remove(&mut self, part: Part) -> Result<(), StoreError> {
        self.held().parts.remove(&part);
        Ok(())
    }

    fn signals(&mut self, part: Part) -> Result<Vec<(RobotName, Address)>, StoreError> {
        let held = self.held();
        let chunks = held.parts.get(&part).into_iter().flat_map(|file| &file.chunks);
        let signals: BTreeSet<_> = chunks.map(|(robot, address, _)| (robot.clone(), *address)).collect();
        Ok(signals.into_iter().collect())
    }

    fn averages(&mut self) -> Option<&mut dyn AverageStore> {
        Some(self)
    }

    fn to_average(&self) -> Option<Box<dyn HistoryStore>> {
        Some(Box::new(self.clone()))
    }
}

impl AverageStore for MemoryDays {
    fn write(&mut self, step: Step, day: i64, rows: &[AverageRow]) -> Result<(), StoreError> {
        let mut held = self.held();
        let fails = held.failures > 0;
        held.failures = held.failures.saturating_sub(1);
        if fails {
            return Err(StoreError::Unavailable("the disk is full".to_owned()));
        }
        let file = held.averages.entry(AverageFile::of(step, day)).or_default();
        for AverageRow { robot, address, bytes } in rows {
            file.rows.insert((robot.clone(), *address, day), bytes.clone());
        }
        Ok(())
    }

    fn read(&mut self, file: AverageFile, ask: AskAverages<'_>) -> Result<Vec<(i64, Vec<u8>)>, StoreError> {
        let held = self.held();
        let AskAverages { robot, address, from, to } = ask;
        let rows = held.averages.get(&file).into_iter().flat_map(|file| &file.rows);
        let fits = |(of, on, day): &(RobotName, Address, i64)| {
            of == robot && *on == address && (from..=to).contains(day)
        };
        Ok(rows.filter(|(key, _)| fits(key)).map(|((.., day), bytes)| (*day, bytes.clone())).collect())
    }

    fn set_state(&mut self, day: i64, note: DayNote) -> Result<(), StoreError> {
        let mut held = self.held();
        held.averages.entry(AverageFile::of(Step::Hour, day)).or_default().states.insert(day, note);
        Ok(())
    }

    fn states(&mut self, days: RangeInclusive<i64>) -> Result<BTreeMap<i64, DayNote>, StoreError> {
        let held = self.held();
        let all = held.averages.values().flat_map(|file| &file.states);
        Ok(all.filter(|(day, _)| days.contains(day)).map(|(day, note)| (*day, *note)).collect())
    }

    fn files(&mut self) -> Result<Vec<(AverageFile, u64)>, StoreError> {
        let size = |file: &Averages| file.rows.values().map(|bytes| bytes.len() as u64 + 50).sum::<u64>() + 1;
        Ok(self.held().averages.iter().map(|(file, of)| (*file, size(of))).collect())
    }

    fn remove(&mut self, file: AverageFile) -> Result<(), StoreError> {
        self.held().averages.remove(&file);
        Ok(())
    }
}
