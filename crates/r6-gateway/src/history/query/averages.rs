//! Answers where the values of days are gone and their averages are left.
//!
//! Values are in charge where they are there. Buckets of the other days are made of averages: of hours if all
//! edges lie on full hours, otherwise of minutes as long as these are kept. Samples are never made of
//! averages: the answer says where there are some.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::{Answer, Question, answer as of_values};
use crate::core::history::averages::{Step, begin_of, unpack};
use crate::core::history::buckets::Bucket;
use crate::core::history::sample::Micros;
use crate::core::history::wide::Wide;
use crate::history::recorder::Open;
use crate::store::StoreError;
use crate::store::history::{AskAverages, AverageFile, DayNote, DayState, HistoryStore, Part};

/// The most averages that one answer reads: the minutes of 347 days. The answer is a page, and says where it
/// goes on.
const MAX_AVERAGES: usize = 500_000;

/// The most runs of days with values that one answer reads, each of which may be a million samples. There is
/// one in general: the newest days.
const MAX_RUNS: usize = 8;

/// Where the values of a signal are gone, and averages are left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Averaged {
    /// The begin.
    pub from: Micros,
    /// The end, which does not belong to it.
    pub to: Micros,
    /// How wide the averages are that were used, or the narrowest that are there.
    pub step: Step,
    /// What was done with them.
    pub used: Used,
}

/// What was done with averages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Used {
    /// The buckets are those that the values would have given.
    Exact,
    /// Edges of buckets lie within averages: each average counts in the bucket in which it begins.
    ByBegin,
    /// The averages lack values of the day, and so do the buckets. Edges of buckets may lie within averages,
    /// too.
    Incomplete,
    /// They are not in the answer: it has samples, or buckets that are narrower than the averages.
    No,
}

/// The averages of a signal on a day whose values are gone.
struct Left {
    has_minutes: bool,
    hours: Vec<u8>,
    /// Whether they lack values of the day.
    lacks: bool,
}

/// Answers a question out of values, and out of averages where the values are gone.
///
/// # Errors
/// [`StoreError`].
pub fn answer<S: HistoryStore>(store: &mut S, question: &Question, open: Open) -> Result<Answer, StoreError> {
    if store.averages().is_none() {
        return of_values(store, question, open);
    }
    let before = parts(store)?;
    let answer = attempt(store, question, &before, open.clone())?;
    let now = parts(store)?;
    if before.is_subset(&now) {
        return Ok(answer);
    }
    // Values were removed while they were read. Their averages are there.
    attempt(store, question, &now, open)
}

fn parts<S: HistoryStore>(store: &mut S) -> Result<BTreeSet<Part>, StoreError> {
    Ok(store.parts()?.into_iter().map(|(part, _)| part).collect())
}

/// Answers with the values of these parts.
fn attempt<S: HistoryStore>(
    store: &mut S,
    question: &Question,
    parts: &BTreeSet<Part>,
    open: Open,
) -> Result<Answer, StoreError> {
    let begin = question.cursor.unwrap_or(question.from);
    let mut unreadable = 0;
    let mut answer = match question.bucket {
        Some(width) if width >= Step::Minute.micros() => {
            let to = page_end(question, begin, width);
            let left = left(store, question, begin..to, parts, &mut unreadable)?;
            if left.is_empty() {
                of_values(store, question, open)?
            } else {
                let page = Page { question, begin, width, left, unreadable: 0, cut: None, told: Vec::new() };
                page.answer(store, &open)?
            }
        }
        Some(_) | None => {
            let mut answer = of_values(store, question, open)?;
            let end = answer.next.unwrap_or(question.to);
            let left = left(store, question, begin..end, parts, &mut unreadable)?;
            for (day, left) in left {
                let step = if left.has_minutes { Step::Minute } else { Step::Hour };
                tell(&mut answer.averages, day, begin..end, step, Used::No);
            }
            answer
        }
    };
    answer.unreadable += unreadable;
    Ok(answer)
}

/// Where a page of buckets of this width ends at the latest.
fn page_end(question: &Question, begin: Micros, width: i64) -> Micros {
    let most = i64::try_from(question.limit).unwrap_or(i64::MAX);
    Micros(begin.0.saturating_add(most.saturating_mul(width))).min(question.to)
}

/// The days of the range that have lost values, some or all, if there are averages of the signal. Values
/// themselves answer for the other days.
fn left<S: HistoryStore>(
    store: &mut S,
    question: &Question,
    range: Range<Micros>,
    parts: &BTreeSet<Part>,
    unreadable: &mut u64,
) -> Result<BTreeMap<i64, Left>, StoreError> {
    let (first, last) = (range.start.day(), Micros(range.end.0.saturating_sub(1)).day());
    let Some(averages) = store.averages() else { return Ok(BTreeMap::new()) };
    let files = averages.files()?.into_iter().map(|(file, _)| file);
    let files = files.filter(|file| *file.days().end() >= first && file.first <= last);
    let (hours, minutes): (Vec<_>, Vec<_>) = files.partition(|file| file.step == Step::Hour);
    if hours.is_empty() {
        return Ok(BTreeMap::new());
    }
    let minutes: BTreeSet<_> = minutes.into_iter().map(|file| file.first).collect();
    let states = averages.states(first..=last)?;
    let ask = AskAverages { robot: &question.robot, address: question.address, from: first, to: last };
    let is_whole = |note: &DayNote| !note.lacks && note.state != DayState::Pending;
    let mut left = BTreeMap::new();
    for file in hours {
        match averages.read(file, ask) {
            Ok(rows) => left.extend(rows.into_iter().map(|(day, hours)| {
                let lacks = !states.get(&day).is_some_and(is_whole);
                (day, Left { has_minutes: minutes.contains(&day), hours, lacks })
            })),
            Err(StoreError::Unreadable(what)) => {
                tracing::error!(?file, what, "a file of averages cannot be read");
                *unreadable += 1;
            }
            Err(error) => return Err(error),
        }
    }
    let with_values: BTreeSet<_> = parts.iter().map(|part| part.day).collect();
    // Averages take the place of what is left of the values of a day, but never of those that still come.
    let newest = with_values.last().copied();
    let is_cut = |day: &i64| states.get(day).is_some_and(|note| note.state == DayState::Cut);
    left.retain(|day, _| !with_values.contains(day) || (is_cut(day) && Some(*day) < newest));
    Ok(left)
}

/// Adds a day to what is told of averages.
fn tell(told: &mut Vec<Averaged>, day: i64, range: Range<Micros>, step: Step, used: Used) {
    let from = begin_of(day).max(range.start);
    let to = begin_of(day.saturating_add(1)).min(range.end);
    if from >= to {
        return;
    }
    match told.last_mut() {
        Some(last) if last.to == from && (last.step, last.used) == (step, used) => last.to = to,
        _ => told.push(Averaged { from, to, step, used }),
    }
}

/// A page of buckets.
struct Page<'q> {
    question: &'q Question,
    begin: Micros,
    width: i64,
    left: BTreeMap<i64, Left>,
    unreadable: u64,
    /// Until when all is known, if there is too much to read.
    cut: Option<Micros>,
    told: Vec<Averaged>,
}

impl Page<'_> {
    fn answer<S: HistoryStore>(mut self, store: &mut S, open: &Open) -> Result<Answer, StoreError> {
        let question = self.question;
        let to = page_end(question, self.begin, self.width);
        let mut wide = Wide::new(self.begin, self.width);
        let days: Vec<i64> = self.left.keys().copied().filter(|day| begin_of(*day) < to).collect();
        let (mut at, mut read, mut runs) = (self.begin, 0, 0);
        for day in days {
            let day_begin = begin_of(day).max(self.begin);
            if at < day_begin {
                runs += 1;
                self.values(store, open, at..day_begin, &mut wide)?;
            }
            let step = self.step(day);
            read += step.map_or(0, Step::in_a_day);
            if self.cut.is_none() && (read > MAX_AVERAGES || runs > MAX_RUNS) {
                self.cut = Some(day_begin);
            }
            if self.cut.is_some() {
                break;
            }
            self.averages(store, day, step, to, &mut wide)?;
            at = begin_of(day.saturating_add(1)).min(to);
        }
        if self.cut.is_none() && at < to {
            self.values(store, open, at..to, &mut wide)?;
        }
        let known = self.cut.map_or(to, |cut| cut.min(to));
        let mut answer = Answer { unreadable: self.unreadable, ..Answer::default() };
        answer.buckets = wide.finish(known);
        let width = self.width;
        let end = |bucket: &Bucket| Micros(bucket.start.0.saturating_add(width));
        if self.cut.is_some() {
            answer.buckets.retain(|bucket| end(bucket) <= known);
            answer.is_too_wide = answer.buckets.is_empty();
        }
        answer.next = answer.buckets.last().map(end).filter(|end| *end < question.to);
        let known = answer.next.unwrap_or(known);
        for averaged in self.told.into_iter().filter(|averaged| averaged.from < known) {
            answer.averages.push(Averaged { to: averaged.to.min(known), ..averaged });
        }
        Ok(answer)
    }

    /// Takes in a run of values. Buckets end at the edges of those of the page, so the first one may be
    /// short.
    fn values<S: HistoryStore>(
        &mut self,
        store: &mut S,
        open: &Open,
        run: Range<Micros>,
        wide: &mut Wide,
    ) -> Result<(), StoreError> {
        let within = run.start.0.saturating_sub(self.begin.0).rem_euclid(self.width);
        let edge = Micros(run.start.0.saturating_add(self.width - within)).min(run.end);
        for (from, to) in [(run.start, edge), (edge, run.end)] {
            if from >= to || self.cut.is_some() {
                continue;
            }
            let width = self.width.min(to.0.saturating_sub(from.0));
            let bucket = Some(width);
            let question =
                Question { from, to, bucket, limit: usize::MAX, cursor: None, ..self.question.clone() };
            let answer = of_values(store, &question, open.clone())?;
            self.unreadable += answer.unreadable;
            self.cut = if answer.is_too_wide { Some(from) } else { answer.next };
            for bucket in answer.buckets {
                let width = width.min(to.0.saturating_sub(bucket.start.0));
                wide.add(bucket, width);
            }
        }
        Ok(())
    }

    /// Which averages of a day are used; `None` if all that are left are wider than the buckets.
    fn step(&self, day: i64) -> Option<Step> {
        let has_minutes = self.left.get(&day).is_some_and(|left| left.has_minutes);
        if self.is_exact(day, Step::Hour) {
            return Some(Step::Hour);
        }
        let fits = self.width >= Step::Hour.micros();
        if has_minutes { Some(Step::Minute) } else { fits.then_some(Step::Hour) }
    }

    /// Whether all edges of buckets on this day are edges of averages.
    fn is_exact(&self, day: i64, step: Step) -> bool {
        let is_edge = |micros: i64| micros.rem_euclid(step.micros()) == 0;
        let ends_later = self.question.to >= begin_of(day.saturating_add(1));
        is_edge(self.begin.0) && is_edge(self.width) && (ends_later || is_edge(self.question.to.0))
    }

    /// Takes in the averages of a day.
    fn averages<S: HistoryStore>(
        &mut self,
        store: &mut S,
        day: i64,
        step: Option<Step>,
        to: Micros,
        wide: &mut Wide,
    ) -> Result<(), StoreError> {
        let Some(left) = self.left.remove(&day) else { return Ok(()) };
        let hours = |unreadable: &mut u64| {
            let read = unpack(Step::Hour, day, &left.hours);
            self::readable(read, unreadable)
        };
        let minutes = match step {
            Some(Step::Minute) => self.minutes(store, day)?,
            Some(Step::Hour) | None => None,
        };
        let (step, used, buckets) = match (step, minutes) {
            (None, _) => (Step::Hour, Used::No, Vec::new()),
            (Some(_), Some(minutes)) => (Step::Minute, self.used(day, Step::Minute, left.lacks), minutes),
            // The file of minutes was removed meanwhile, or has nothing of this signal.
            (Some(Step::Minute), None) if self.width < Step::Hour.micros() => {
                (Step::Hour, Used::No, Vec::new())
            }
            (Some(_), None) => {
                (Step::Hour, self.used(day, Step::Hour, left.lacks), hours(&mut self.unreadable))
            }
        };
        for bucket in buckets.into_iter().filter(|bucket| bucket.start < to) {
            wide.add(bucket, step.micros());
        }
        tell(&mut self.told, day, self.begin..to, step, used);
        Ok(())
    }

    fn used(&self, day: i64, step: Step, lacks: bool) -> Used {
        match (lacks, self.is_exact(day, step)) {
            (true, _) => Used::Incomplete,
            (false, true) => Used::Exact,
            (false, false) => Used::ByBegin,
        }
    }

    /// The minutes of a day; `None` if there are none of this signal.
    fn minutes<S: HistoryStore>(
        &mut self,
        store: &mut S,
        day: i64,
    ) -> Result<Option<Vec<Bucket>>, StoreError> {
        let Some(averages) = store.averages() else { return Ok(None) };
        let Question { robot, address, .. } = self.question;
        let ask = AskAverages { robot, address: *address, from: day, to: day };
        match averages.read(AverageFile::of(Step::Minute, day), ask) {
            Ok(rows) => {
                let bytes = rows.into_iter().next().map(|(_, bytes)| bytes);
                Ok(bytes.map(|bytes| readable(unpack(Step::Minute, day, &bytes), &mut self.unreadable)))
            }
            Err(StoreError::Unreadable(what)) => {
                tracing::error!(day, what, "a file of averages cannot be read");
                self.unreadable += 1;
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

/// Nothing instead of averages that cannot be read, which are counted.
fn readable(
    read: Result<Vec<Bucket>, crate::core::history::codec::BadChunk>,
    unreadable: &mut u64,
) -> Vec<Bucket> {
    read.unwrap_or_else(|error| {
        tracing::error!(%error, "averages of a day cannot be read");
        *unreadable += 1;
        Vec::new()
    })
}
