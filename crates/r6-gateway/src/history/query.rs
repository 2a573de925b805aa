//! Queries over the history: samples or buckets of one signal in a range of time.
//!
//! A query first reads which chunks there are, then the bytes of those that it needs, a few at a time: no
//! transaction on a file lasts longer than that. A chunk that is within one bucket is not even read: its row
//! has its sum.
//!
//! Where the values of a day are gone, buckets are made of its averages ([`averages`]).

mod averages;
mod events;
mod production;
mod series;

use std::sync::Arc;
use std::time::Duration;

use r6_proto::Address;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::recorder::Open;
use crate::core::history::block::MAX_SPAN;
use crate::core::history::buckets::{Bucket, Buckets};
use crate::core::history::codec;
use crate::core::history::merge::Merge;
use crate::core::history::sample::{Interval, Micros, Sample};
use crate::core::name::RobotName;
use crate::store::StoreError;
use crate::store::history::{Ask, Entry, HistoryStore, Part, Place};
use series::Series;

#[cfg(test)]
pub use averages::answer as answer_with_averages;
pub use averages::{Averaged, Used};
#[cfg(test)]
pub use events::answer as events_of;
pub use events::{EventAnswer, EventPlace, EventQuestion};
pub use production::{Opens, ProductionAnswer, ProductionQuestion};

/// How many queries read at once. Each takes a thread and some megabytes.
const MAX_QUERIES: usize = 4;

/// The most chunks that one answer looks at: two megabytes of their rows.
const MAX_ENTRIES: usize = 20_000;

/// The most chunks whose bytes one answer reads: a million samples, some hundredths of a second.
const MAX_DECODED: usize = 2_048;

/// How many chunks are read in one go.
const TOGETHER: usize = 32;

/// For how long a value counts at most: 2.5 hours, of a signal that is read once an hour.
const LONGEST_HELD: Duration = Duration::from_secs(9_000);

/// What is asked for.
#[derive(Clone, Debug)]
pub struct Question {
    /// The robot.
    pub robot: RobotName,
    /// The signal.
    pub address: Address,
    /// The begin of the range.
    pub from: Micros,
    /// Its end, which does not belong to it.
    pub to: Micros,
    /// The width of the buckets in µs; `None` for samples.
    pub bucket: Option<i64>,
    /// How many samples or buckets at most.
    pub limit: usize,
    /// Where to read on.
    pub cursor: Option<Micros>,
}

/// What there is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// The samples.
    pub samples: Vec<Sample>,
    /// The buckets.
    pub buckets: Vec<Bucket>,
    /// Where to read on.
    pub next: Option<Micros>,
    /// How many chunks and files cannot be read.
    pub unreadable: u64,
    /// Whether not even one bucket could be told: it has too many chunks.
    pub is_too_wide: bool,
    /// Where the values are gone and averages are left, in the order of time.
    pub averages: Vec<Averaged>,
}

/// Reads the history.
#[derive(Debug)]
pub struct Reader {
    place: Place,
    permits: Arc<Semaphore>,
}

impl Reader {
    /// The history in this place.
    pub fn new(place: Place) -> Self {
        Self { place, permits: Arc::new(Semaphore::new(MAX_QUERIES)) }
    }

    /// Leave to ask; `None` if too many queries are under way.
    pub fn permit(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.permits).try_acquire_owned().ok()
    }

    /// The events of a robot, read in a thread of its own.
    pub async fn events(
        &self,
        permit: OwnedSemaphorePermit,
        question: EventQuestion,
    ) -> Result<EventAnswer, StoreError> {
        self.work(permit, move |store| events::answer(store, &question)).await
    }

    /// Figures of production in several ranges of one robot, in the order of time, computed in a thread of
    /// its own.
    pub async fn production(
        &self,
        permit: OwnedSemaphorePermit,
        questions: Vec<ProductionQuestion>,
        open: Opens,
    ) -> Result<Vec<ProductionAnswer>, StoreError> {
        self.work(permit, move |store| production::answers(store, &questions, &open)).await
    }

    /// Answers in a thread of its own. `open` are the samples that are not in the files; they are asked for
    /// first, so that none is missed that goes to the disk meanwhile.
    pub async fn answer(
        &self,
        permit: OwnedSemaphorePermit,
        question: Question,
        open: Open,
    ) -> Result<Answer, StoreError> {
        self.work(permit, move |store| averages::answer(store, &question, open)).await
    }

    async fn work<T: Send + 'static>(
        &self,
        permit: OwnedSemaphorePermit,
        work: impl FnOnce(&mut Box<dyn HistoryStore>) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        let place = self.place.clone();
        let work = tokio::task::spawn_blocking(move || {
            let _permit = permit;
            work(&mut place.to_read()?)
        });
        work.await.unwrap_or(Err(StoreError::Closed))
    }
}

/// Answers a question out of values alone.
///
/// # Errors
/// [`StoreError`].
pub fn answer<S: HistoryStore>(store: &mut S, question: &Question, open: Open) -> Result<Answer, StoreError> {
    let begin = question.cursor.unwrap_or(question.from);
    let Found { entries, cut, unreadable } = find(store, question, begin)?;
    let entries = needed(entries, begin);
    let open_first = open.iter().flat_map(|(_, samples)| samples.iter().map(|sample| sample.time)).min();
    let plan = Plan::of(&entries, question, begin, open_first);
    // The end of what is known completely.
    let cut = [cut, plan.cut].into_iter().flatten().min();
    let to = cut.map_or(question.to, |cut| cut.min(question.to));
    let mut answer = Answer { unreadable, ..Answer::default() };
    let mut sink = Sink::new(question, begin, to);
    let mut merge = Merge::default();
    open.into_iter().for_each(|(interval, samples)| merge.add(interval, samples));
    let mut at = 0;
    while let Some(entry) = entries.get(at)
        && entry.summary.first < to
        && !sink.is_full()
    {
        merge.before(entry.summary.first).for_each(|(interval, sample)| sink.push(interval, sample));
        if plan.is_skipped(at) {
            sink.summary(entry);
            at += 1;
            continue;
        }
        let run = plan.run(&entries, at);
        let rows: Vec<_> = run.iter().map(|entry| entry.row).collect();
        let all = match store.bytes(entry.part, &rows) {
            Err(StoreError::Unreadable(_)) => {
                answer.unreadable += rows.len() as u64;
                Vec::new()
            }
            Err(_) if !store.parts()?.iter().any(|(there, _)| *there == entry.part) => Vec::new(),
            all => all?,
        };
        for (entry, bytes) in run.iter().zip(all) {
            merge.before(entry.summary.first).for_each(|(interval, sample)| sink.push(interval, sample));
            // A chunk that is gone was removed meanwhile.
            match bytes.as_deref().map(codec::decode) {
                Some(Ok(decoded)) => merge.add(decoded.interval, decoded.samples),
                Some(Err(error)) => {
                    answer.unreadable += 1;
                    tracing::error!(robot = %question.robot, part = ?entry.part, row = entry.row, %error,
                        "a chunk of the history cannot be read");
                }
                None => {}
            }
        }
        at += run.len().max(1);
    }
    merge.before(to).for_each(|(interval, sample)| sink.push(interval, sample));
    sink.finish(&mut answer, question, to);
    Ok(answer)
}

/// The chunks of a range.
struct Found {
    entries: Vec<Entry>,
    /// If there are too many: until when they are all there.
    cut: Option<Micros>,
    /// How many files cannot be read.
    unreadable: u64,
}

fn find<S: HistoryStore>(store: &mut S, question: &Question, begin: Micros) -> Result<Found, StoreError> {
    let Question { robot, address, to, .. } = question;
    let overlap = begin.before(MAX_SPAN);
    let earliest = overlap.before(LONGEST_HELD);
    let days = earliest.day()..=Micros(to.0.saturating_sub(1)).day();
    let parts: Vec<_> = store.parts()?.into_iter().map(|(part, _)| part).collect();
    let parts: Vec<_> = parts.into_iter().filter(|part| days.contains(&part.day)).collect();
    let (mut entries, mut cut, mut unreadable) = (Vec::new(), None::<Micros>, 0);
    for part in parts.iter().filter(|part| part.day >= overlap.day()) {
        let is_cut_before = cut.is_some_and(|cut| cut.day() < part.day);
        if is_cut_before {
            break;
        }
        let ask = Ask { robot, address: *address, from: overlap, to: *to };
        let mut found =
            unless_gone(store, *part, &mut unreadable, |store| store.entries(*part, ask, MAX_ENTRIES))?;
        if entries.len() + found.len() >= MAX_ENTRIES {
            found.truncate(MAX_ENTRIES.saturating_sub(entries.len()).max(1));
            let last = found.last().map(|entry| entry.summary.first);
            cut = [cut, last].into_iter().flatten().min();
        }
        entries.extend(found);
    }
    entries.retain(|entry| cut.is_none_or(|cut| entry.summary.first < cut));
    // The value at the begin may come from a chunk that ended long before.
    for part in parts.iter().filter(|part| part.day <= overlap.day()) {
        let ask = Ask { robot, address: *address, from: earliest, to: overlap };
        entries.extend(unless_gone(store, *part, &mut unreadable, |store| {
            Ok(store.last_entry(*part, ask)?.into_iter().collect())
        })?);
    }
    entries.sort_by_key(|entry| (entry.summary.first, entry.part, entry.row));
    Ok(Found { entries, cut, unreadable })
}

/// A part may be removed at any time. Then it has nothing. A part that another program changed is counted.
fn unless_gone<S: HistoryStore, T>(
    store: &mut S,
    part: Part,
    unreadable: &mut u64,
    read: impl FnOnce(&mut S) -> Result<Vec<T>, StoreError>,
) -> Result<Vec<T>, StoreError> {
    match read(store) {
        Err(StoreError::Unreadable(what)) => {
            tracing::error!(?part, what, "a file of the history cannot be read");
            *unreadable += 1;
            Ok(Vec::new())
        }
        Err(_) if !store.parts()?.iter().any(|(there, _)| *there == part) => Ok(Vec::new()),
        read => read,
    }
}

/// Leaves out chunks that end before the begin, except the last of them.
fn needed(entries: Vec<Entry>, begin: Micros) -> Vec<Entry> {
    let before = entries.iter().map(|entry| entry.summary.last).filter(|last| *last < begin).max();
    let is_needed = |entry: &Entry| entry.summary.last >= begin || Some(entry.summary.last) == before;
    entries.into_iter().filter(is_needed).collect()
}

/// Which chunks have to be read.
struct Plan {
    skipped: Vec<bool>,
    cut: Option<Micros>,
}

impl Plan {
    fn of(entries: &[Entry], question: &Question, begin: Micros, open_first: Option<Micros>) -> Self {
        let mut plan = Self { skipped: Vec::with_capacity(entries.len()), cut: None };
        let (mut last_before, mut decoded) = (None::<Micros>, 0);
        for (at, entry) in entries.iter().enumerate() {
            let chunk = &entry.summary;
            let next = entries.get(at + 1).map(|next| next.summary.first);
            let next = [next, open_first].into_iter().flatten().min();
            let is_alone = last_before.is_none_or(|last| last < chunk.first)
                && next.is_some_and(|next| chunk.last < next && next < question.to);
            let is_in_one = question.bucket.is_some_and(|width| {
                let bucket = |time: Micros| time.0.saturating_sub(begin.0).div_euclid(width.max(1));
                next.is_some_and(|next| bucket(chunk.first) == bucket(next))
            });
            let has_numbers = chunk.range.is_some() && chunk.sum.is_finite();
            let is_skipped = is_alone && is_in_one && has_numbers && chunk.first >= begin;
            if !is_skipped {
                decoded += 1;
                if decoded > MAX_DECODED {
                    plan.cut = Some(chunk.first);
                    break;
                }
            }
            plan.skipped.push(is_skipped);
            last_before = last_before.max(Some(chunk.last));
        }
        plan
    }

    fn is_skipped(&self, at: usize) -> bool {
        self.skipped.get(at).copied().unwrap_or(false)
    }

    /// The chunks from here on that are read in one go: those of one part that are not skipped.
    fn run<'e>(&self, entries: &'e [Entry], at: usize) -> &'e [Entry] {
        let rest = entries.get(at..).unwrap_or_default();
        let part = rest.first().map(|entry| entry.part);
        let fits = |(entry, number): &(&Entry, usize)| {
            Some(entry.part) == part && !self.is_skipped(*number) && *number < self.skipped.len()
        };
        let len = rest.iter().zip(at..).take(TOGETHER).take_while(fits).count();
        rest.get(..len.max(1)).unwrap_or_default()
    }
}

/// What becomes of the samples.
enum Sink {
    Samples(Series),
    Buckets(Buckets),
}

impl Sink {
    fn new(question: &Question, begin: Micros, to: Micros) -> Self {
        match question.bucket {
            None => Self::Samples(Series::new(begin, to, question.limit, question.cursor.is_none())),
            Some(width) => Self::Buckets(Buckets::new(begin, to, width, question.limit)),
        }
    }

    fn push(&mut self, interval: Interval, sample: Sample) {
        match self {
            Self::Samples(series) => series.push(interval, sample),
            Self::Buckets(buckets) => buckets.sample(interval, sample),
        }
    }

    fn summary(&mut self, entry: &Entry) {
        match self {
            // Only the plan of buckets skips chunks.
            Self::Samples(_) => {}
            Self::Buckets(buckets) => buckets.summary(&entry.summary),
        }
    }

    fn is_full(&self) -> bool {
        match self {
            Self::Samples(series) => series.is_full(),
            Self::Buckets(buckets) => buckets.is_full(),
        }
    }

    fn finish(self, answer: &mut Answer, question: &Question, to: Micros) {
        let is_cut = to < question.to;
        match self {
            Self::Samples(series) => {
                let next;
                (answer.samples, next) = series.finish();
                answer.next = next.or(is_cut.then_some(to));
            }
            Self::Buckets(buckets) => {
                let width = question.bucket.unwrap_or_default();
                answer.buckets = buckets.finish();
                let end = |bucket: &Bucket| Micros(bucket.start.0.saturating_add(width));
                if is_cut {
                    answer.buckets.retain(|bucket| end(bucket) <= to);
                    answer.is_too_wide = answer.buckets.is_empty();
                }
                answer.next = answer.buckets.last().map(end).filter(|end| *end < question.to);
            }
        }
    }
}
