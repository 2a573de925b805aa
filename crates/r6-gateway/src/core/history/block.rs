//! The samples of one robot that are not in a chunk on the disk yet.
//!
//! They are in open blocks, one for each signal. A block is sealed, that is made to a chunk, when it has 512
//! samples, spans ten minutes, or must not go on: another day, a sample that is earlier than the last one,
//! too much memory. The tail of a robot on the disk always has exactly its open blocks: after a seal it is
//! written anew, otherwise it grows by a row.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::time::Duration;

use r6_proto::address::{Address, AddressMap, Walk};
use r6_proto::time::Instant;

use super::codec::{self, MAX_SAMPLES, Times};
use super::event::Event;
use super::sample::{Interval, Micros, Sample};
use super::series::Series;
use super::tail;

/// The longest time that a chunk spans, so that a reader knows how far back one can begin. It is also how
/// long a block stays open.
pub const MAX_SPAN: Duration = Duration::from_secs(600);

/// How many rows the tail of a robot has before it is written anew as one row: about a minute.
const MAX_TAIL_ROWS: usize = 256;

/// If one block of a robot is full, the others with at least this number of samples are sealed too: the tail
/// has to be written anew once for all of them.
const ALSO_SEALED: usize = MAX_SAMPLES / 2;

/// What a reader has to know of a chunk to pass over its bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The time of its first sample.
    pub first: Micros,
    /// The time of its last sample.
    pub last: Micros,
    /// How many samples it has.
    pub count: u32,
    /// The interval of its signal.
    pub interval: Interval,
    /// The smallest and the largest number, if it has any.
    pub range: Option<(f64, f64)>,
    /// The number of the last sample; `None` for a gap or a text.
    pub last_number: Option<f64>,
    /// The sum over the time from the first to the last sample: number times µs.
    pub sum: f64,
    /// How many µs of this time had a value.
    pub good: i64,
}

/// A chunk: samples of one signal that never change any more.
#[derive(Clone, Debug, PartialEq)]
pub struct Chunk {
    /// What is in it.
    pub summary: Summary,
    /// Its bytes, as [`codec`] writes them.
    pub bytes: Vec<u8>,
}

impl Summary {
    /// Of these samples; `None` without any.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "a chunk spans minutes, as µs far below 2^53")]
    pub fn of(interval: Interval, samples: &[Sample]) -> Option<Self> {
        let (first, last) = (samples.first()?, samples.last()?);
        let (mut sum, mut good) = (0.0, 0_i64);
        for pair in samples.windows(2) {
            let [sample, next] = pair else { continue };
            if sample.state.gap().is_some() {
                continue;
            }
            let until = next.time.min(interval.held_until(sample.time));
            let held = until.0.saturating_sub(sample.time.0).max(0);
            good = good.saturating_add(held);
            sum += sample.state.number().unwrap_or_default() * held as f64;
        }
        let numbers = samples.iter().filter_map(|sample| sample.state.number());
        let range = numbers.fold(None, |range: Option<(f64, f64)>, number| {
            Some(range.map_or((number, number), |(min, max)| (min.min(number), max.max(number))))
        });
        Some(Self {
            first: first.time,
            last: last.time,
            count: u32::try_from(samples.len()).unwrap_or(u32::MAX),
            interval,
            range,
            last_number: last.state.number(),
            sum,
            good,
        })
    }
}

/// Makes chunks of samples. `times` has the bytes of the last times, for the next signal with the same ones.
#[must_use]
pub fn chunks(times: &mut Times, interval: Interval, mut samples: &[Sample]) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    while !samples.is_empty() {
        let (bytes, count) = codec::encode(times, interval, samples);
        let (sealed, rest) = samples.split_at(count.clamp(1, samples.len()));
        chunks.extend(Summary::of(interval, sealed).map(|summary| Chunk { summary, bytes }));
        samples = rest;
    }
    chunks
}

#[derive(Debug)]
struct Block {
    interval: Interval,
    samples: Series,
    /// How many of them are in the tail on the disk.
    written: usize,
    opened: Instant,
}

/// What is to be written of a robot into the file of one day: all of it or nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Write {
    /// New chunks.
    pub chunks: Vec<(Address, Chunk)>,
    /// Whether the rows of its tail are removed first.
    pub replace_tail: bool,
    /// A new row of its tail.
    pub tail: Option<Vec<u8>>,
    /// New events.
    pub events: Vec<Event>,
}

/// The open blocks of one robot.
#[derive(Debug, Default)]
pub struct OpenBlocks {
    blocks: AddressMap<Block>,
    /// Samples come in the order of their addresses in general.
    walk: Walk,
    /// The day of all open samples.
    day: i64,
    /// Chunks that are not written yet.
    sealed: Vec<(Address, Chunk)>,
    /// The days whose files have rows of the tail, or may have some.
    tails: BTreeSet<i64>,
    tail_rows: usize,
    /// Whether the tail has to be written anew.
    replace: bool,
    /// The memory of samples and chunks, in bytes.
    size: usize,
}

impl OpenBlocks {
    /// Takes in a sample.
    pub fn push(&mut self, now: Instant, address: Address, interval: Interval, sample: Sample) {
        let day = sample.time.day();
        if day != self.day {
            self.seal_all();
            self.day = day;
        }
        let first = sample.time;
        let new = || Block { interval, samples: Series::new(first), written: 0, opened: now };
        let mut block = self.blocks.walk_to_or_insert(&mut self.walk, address, new);
        if !block.fits(interval, &sample) {
            self.seal(&mut Times::default(), address);
            block = self.blocks.walk_to_or_insert(&mut self.walk, address, new);
        }
        let before = block.samples.size();
        block.samples.push(sample);
        self.size = (self.size + block.samples.size()).saturating_sub(before);
        if block.samples.len() >= MAX_SAMPLES {
            self.seal_if(|block| block.samples.len() >= ALSO_SEALED);
        }
    }

    /// Seals the blocks that have been open for too long.
    pub fn seal_old(&mut self, now: Instant) {
        self.seal_if(|block| now.since(block.opened) >= MAX_SPAN);
    }

    /// Seals all blocks.
    pub fn seal_all(&mut self) {
        self.seal_if(|_| true);
    }

    fn seal_if(&mut self, is: impl Fn(&Block) -> bool) {
        let due: Vec<_> =
            self.blocks.iter().filter(|(_, block)| is(block)).map(|(address, _)| address).collect();
        let mut times = Times::default();
        due.into_iter().for_each(|address| self.seal(&mut times, address));
    }

    fn seal(&mut self, times: &mut Times, address: Address) {
        let Some(block) = self.blocks.remove(address) else { return };
        let freed = block.samples.size();
        let chunks = chunks(times, block.interval, &block.samples.from(0));
        let taken: usize = chunks.iter().map(|chunk| chunk.bytes.len() + size_of::<Chunk>()).sum();
        self.size = self.size.saturating_sub(freed) + taken;
        self.replace = true;
        self.sealed.extend(chunks.into_iter().map(|chunk| (address, chunk)));
    }

    /// What is to be written now, by day, earlier days first.
    #[must_use]
    pub fn writes(&self) -> BTreeMap<i64, Write> {
        let mut writes = BTreeMap::<i64, Write>::new();
        for (address, chunk) in &self.sealed {
            let write = writes.entry(chunk.summary.first.day()).or_default();
            write.chunks.push((*address, chunk.clone()));
        }
        let replace = self.replace || self.tail_rows >= MAX_TAIL_ROWS;
        if replace {
            for day in &self.tails {
                writes.entry(*day).or_default().replace_tail = true;
            }
        }
        let first_of = |block: &Block| if replace { 0 } else { block.written };
        let count =
            self.blocks.iter().map(|(_, block)| block.samples.len().saturating_sub(first_of(block))).sum();
        let mut samples = Vec::with_capacity(count);
        let mut rows = Vec::with_capacity(self.blocks.len());
        for (address, block) in self.blocks.iter() {
            let begin = samples.len();
            block.samples.append_to(&mut samples, first_of(block));
            if samples.len() > begin {
                rows.push((address, block.interval, begin..samples.len()));
            }
        }
        if !rows.is_empty() {
            let of_row = |(address, interval, range): (_, _, Range<usize>)| {
                (address, interval, samples.get(range).unwrap_or_default())
            };
            writes.entry(self.day).or_default().tail = Some(tail::encode(rows.into_iter().map(of_row)));
        }
        writes
    }

    /// What [`Self::writes`] said was written, and nothing was pushed since.
    pub fn written(&mut self) {
        let replaced = self.replace || self.tail_rows >= MAX_TAIL_ROWS;
        if replaced {
            self.tails.clear();
            self.tail_rows = 0;
        }
        let mut has_tail = false;
        for (_, block) in self.blocks.iter_mut() {
            has_tail |= replaced || block.written < block.samples.len();
            block.written = block.samples.len();
        }
        if has_tail && !self.blocks.is_empty() {
            self.tails.insert(self.day);
            self.tail_rows += 1;
        }
        let chunks = self.sealed.drain(..);
        let freed: usize = chunks.map(|(_, chunk)| chunk.bytes.len() + size_of::<Chunk>()).sum();
        self.size = self.size.saturating_sub(freed);
        self.replace = false;
    }

    /// Writing failed: it is not known what is on the disk.
    pub fn failed(&mut self) {
        self.tails.extend([self.day]);
        self.tails.extend(self.sealed.iter().map(|(_, chunk)| chunk.summary.first.day()));
        self.replace = true;
    }

    /// The samples of a signal that are not in a chunk on the disk, in the order in which they came.
    ///
    /// # Errors
    /// [`codec::BadChunk`], which would be a fault of the codec.
    pub fn samples(&self, address: Address) -> Result<Vec<(Interval, Vec<Sample>)>, codec::BadChunk> {
        let sealed = self.sealed.iter().filter(|(of, _)| *of == address);
        let sealed = sealed
            .map(|(_, chunk)| codec::decode(&chunk.bytes).map(|decoded| (decoded.interval, decoded.samples)));
        let open = self.blocks.get(address).map(|block| Ok((block.interval, block.samples.from(0))));
        sealed.chain(open).collect()
    }

    /// The memory that it takes, in bytes.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Whether there is nothing to write and nothing open.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty() && self.sealed.is_empty() && self.tails.is_empty()
    }
}

impl Block {
    fn fits(&self, interval: Interval, sample: &Sample) -> bool {
        interval == self.interval
            && sample.time >= self.samples.last()
            && sample.time < self.samples.first().after(MAX_SPAN)
            && codec::is_of_one_kind(self.samples.kind(), sample)
    }
}

#[cfg(test)]
mod tests;
