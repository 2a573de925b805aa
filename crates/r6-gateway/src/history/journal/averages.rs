//! Averages of days that are over: they are computed in small pieces, so that nothing waits for them.
//!
//! A day that is over is read signal by signal. When all of its averages are on the disk, the day is marked
//! as finished. If the process ends before, the next one computes them all again, with the same result. A
//! value that comes later for such a day lets it be computed anew, unless values of it were removed already.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::Ordering;

use r6_proto::Address;

use super::Journal;
use crate::core::history::averages::{Step, begin_of, hours, pack};
use crate::core::history::buckets::Bucket;
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::history::query::{Question, answer};
use crate::store::StoreError;
use crate::store::history::{AverageRow, DayNote, DayState, HistoryStore, Part};

/// How long after the end of a day its averages are computed. Blocks stay open for ten minutes; then all of
/// the day is in chunks.
const GRACE: i64 = 15 * 60_000_000;

/// The bytes of averages in one transaction. With more of them a transaction would hold up samples.
const MAX_TOGETHER: usize = if cfg!(test) { 4 * 1024 } else { 256 * 1024 };

/// The minutes of a signal that a piece reads. Other work of the thread goes on between two pieces.
const PIECE_MINUTES: usize = 120;

/// What a piece costs besides its samples: a signal has a chunk for each ten minutes at least, and to read
/// the chunks of a piece takes as long as to decode this many samples.
const PIECE: u64 = 16_000;

/// For how long the averages of a day may fail before they are given up, in µs. Then those of later days are
/// computed. A day is tried again each 10 s at the latest.
const MAX_FAILING: i64 = 10 * 60_000_000;

/// For how many days a file that is too old waits for the averages of its day. They count from the start of
/// the process at the earliest.
const MAX_WAIT_DAYS: i64 = 2;

/// What is known of averages, and the day that is being computed.
#[derive(Debug, Default)]
pub(super) struct Averages {
    /// What became of days that are over.
    pub states: BTreeMap<i64, DayNote>,
    /// Whether that was read from the store.
    is_loaded: bool,
    /// Days whose averages cannot be written, until the process ends.
    pub given_up: BTreeSet<i64>,
    /// Since when the averages of a day fail.
    failing: BTreeMap<i64, Micros>,
    /// The day when the limits were looked at last, and the first of the days in which that went on: the
    /// start of the process, unless its clock was set or it did not run for days.
    looked: Option<(i64, i64)>,
    /// Whether to look for a day that is over.
    is_due: bool,
    work: Option<Work>,
    /// A day whose minutes do not fit into the room for averages.
    without_minutes: Option<i64>,
    /// Not even hours fit.
    pub is_off: bool,
}

struct Work {
    day: i64,
    /// Reads the values. It is another hold on the store, so that the files that are written stay open.
    reader: Box<dyn HistoryStore>,
    signals: VecDeque<(RobotName, Address)>,
    /// The minutes of the first signal that are known, and where to read on.
    minutes: Vec<Bucket>,
    next: Option<Micros>,
    /// What is not written yet: minutes and hours.
    rows: [Vec<AverageRow>; 2],
    size: usize,
    /// Something of it could not be read.
    lacks: bool,
    /// A part of the day was removed meanwhile.
    lost_part: bool,
}

impl std::fmt::Debug for Work {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Work").field("day", &self.day).finish_non_exhaustive()
    }
}

impl<S: HistoryStore> Journal<S> {
    /// Reads what became of days, before the first write. If that fails, values are written all the same, and
    /// it is read before the first averages.
    pub(super) fn load_averages(&mut self, today: i64) {
        let looked = self.averages.looked;
        self.averages = Averages { is_due: true, looked, ..Averages::default() };
        if let Err(error) = self.try_load_averages(today) {
            tracing::error!(%error, "it is not known yet of which days there are averages");
        }
    }

    fn try_load_averages(&mut self, today: i64) -> Result<(), StoreError> {
        let first = self.store.parts()?.first().map_or(today, |(part, _)| part.day.min(today));
        if let Some(averages) = self.store.averages() {
            self.averages.states = averages.states(first..=i64::MAX)?;
        }
        self.averages.is_loaded = true;
        Ok(())
    }

    /// Does a piece of the averages of days that are over. Returns what it cost, in samples that were
    /// decoded; `None` if nothing is to be done for now.
    ///
    /// # Errors
    /// [`StoreError`]: the day begins anew when the limits are looked at the next time, or is given up if a
    /// file of averages cannot be read.
    pub fn average(&mut self, time: Micros) -> Result<Option<u64>, StoreError> {
        let is_paused = self.counts.paused.load(Ordering::Relaxed);
        if !self.is_recovered || is_paused || self.has_no_room || self.averages.is_off {
            return Ok(None);
        }
        let Some(mut work) = self.averages.work.take() else { return self.begin_day(time) };
        let day = work.day;
        let done = if work.signals.is_empty() {
            self.finish_day(work).map(|()| Some(PIECE))
        } else {
            let done = self.piece(&mut work, time);
            self.averages.work = done.is_ok().then_some(work);
            done.map(Some)
        };
        if let Err(error) = &done {
            self.note_failure(day, time, error);
        }
        done
    }

    /// A day cannot be averaged. What fails again and again must not hold up later days.
    fn note_failure(&mut self, day: i64, time: Micros, error: &StoreError) {
        let since = self.averages.failing.entry(day).or_insert(time);
        // The clock may have been set back.
        *since = time.min(*since);
        let fails_long = time.0.saturating_sub(since.0) >= MAX_FAILING;
        let is_for_good = matches!(error, StoreError::Unreadable(_)) || fails_long;
        if is_for_good && self.averages.given_up.insert(day) {
            self.counts.given_up_days.fetch_add(1, Ordering::Relaxed);
            tracing::error!(day, "the averages of a day are given up until the next start");
        }
    }

    /// Looks for the oldest day that is over and has no averages.
    fn begin_day(&mut self, time: Micros) -> Result<Option<u64>, StoreError> {
        if !std::mem::take(&mut self.averages.is_due) {
            return Ok(None);
        }
        let Some(mut reader) = self.store.to_average() else { return Ok(None) };
        if !self.averages.is_loaded {
            self.try_load_averages(time.day())?;
        }
        let oldest = self.oldest_with_averages(time.day());
        let parts: Vec<_> = self.store.parts()?.into_iter().map(|(part, _)| part).collect();
        let is_over = |day: i64| begin_of(day.saturating_add(1)).0.saturating_add(GRACE) <= time.0;
        let is_wanted = |day: i64| day >= oldest && is_over(day) && self.lacks_averages(day);
        let Some(day) = parts.iter().map(|part| part.day).find(|day| is_wanted(*day)) else {
            return Ok(None);
        };
        let (mut signals, mut lacks) = (BTreeSet::new(), false);
        for part in parts.into_iter().filter(|part| part.day == day) {
            match reader.signals(part) {
                Ok(found) => signals.extend(found),
                Err(error @ StoreError::Unreadable(_)) => {
                    tracing::error!(%error, ?part, "averages lack what is in a file that cannot be read");
                    lacks = true;
                }
                Err(error) => {
                    self.note_failure(day, time, &error);
                    return Err(error);
                }
            }
        }
        let signals: VecDeque<_> = signals.into_iter().collect();
        tracing::info!(day, signals = signals.len(), "the averages of a day are computed");
        let (minutes, next, rows) = (Vec::new(), None, [Vec::new(), Vec::new()]);
        let lost_part = false;
        self.averages.work =
            Some(Work { day, reader, signals, minutes, next, rows, size: 0, lacks, lost_part });
        Ok(Some(PIECE))
    }

    /// Reads some minutes of one signal.
    fn piece(&mut self, work: &mut Work, time: Micros) -> Result<u64, StoreError> {
        let Some((robot, address)) = work.signals.front().cloned() else { return Ok(0) };
        let (from, end) = (work.next.unwrap_or(begin_of(work.day)), begin_of(work.day.saturating_add(1)));
        let minute = Step::Minute.micros();
        let minutes = |count: i64| Micros(from.0.saturating_add(count.saturating_mul(minute))).min(end);
        let to = minutes(i64::try_from(PIECE_MINUTES).unwrap_or(i64::MAX));
        let question = Question {
            robot: robot.clone(),
            address,
            from,
            to,
            bucket: Some(minute),
            limit: PIECE_MINUTES,
            cursor: None,
        };
        let page = answer(&mut work.reader, &question, Vec::new())?;
        if page.unreadable > 0 || page.is_too_wide {
            work.lacks = true;
            let chunks = page.unreadable;
            tracing::error!(%robot, %address, day = work.day, chunks, "averages lack what cannot be read");
        }
        let cost = page.buckets.iter().map(|bucket| bucket.samples).sum::<u64>() + PIECE;
        work.minutes.extend(page.buckets.into_iter().filter(|bucket| !bucket.is_empty()));
        // A minute that has too much is passed over.
        let next = if page.is_too_wide { minutes(1) } else { page.next.unwrap_or(to) };
        work.next = Some(next).filter(|next| *next < end);
        if work.next.is_some() {
            return Ok(cost);
        }
        let minutes = std::mem::take(&mut work.minutes);
        work.signals.pop_front();
        let oldest = self.oldest_with_minutes(time.day());
        let has_minutes = work.day >= oldest && self.averages.without_minutes != Some(work.day);
        let of_hours = pack(Step::Hour, &hours(work.day, &minutes));
        let of_minutes = pack(Step::Minute, &minutes).filter(|_| has_minutes);
        for (rows, bytes) in work.rows.iter_mut().zip([of_minutes, of_hours]) {
            work.size += bytes.as_ref().map_or(0, Vec::len);
            rows.extend(bytes.map(|bytes| AverageRow { robot: robot.clone(), address, bytes }));
        }
        if work.size >= MAX_TOGETHER {
            self.write_averages(work)?;
        }
        Ok(cost)
    }

    fn write_averages(&mut self, work: &mut Work) -> Result<(), StoreError> {
        self.written = self.written.saturating_add(std::mem::take(&mut work.size) as u64);
        if self.averages.without_minutes == Some(work.day) {
            work.rows[0].clear();
        }
        let Some(averages) = self.store.averages() else { return Ok(()) };
        for (step, rows) in [Step::Minute, Step::Hour].into_iter().zip(&mut work.rows) {
            let rows = std::mem::take(rows);
            if !rows.is_empty() {
                averages.write(step, work.day, &rows)?;
            }
        }
        Ok(())
    }

    fn finish_day(&mut self, mut work: Work) -> Result<(), StoreError> {
        self.write_averages(&mut work)?;
        let had_lost = self.averages.states.get(&work.day).is_some_and(|note| note.lacks);
        let lacks = work.lacks || work.lost_part || had_lost;
        // What is left of it would hide the averages of what was there before.
        let state = if work.lost_part { DayState::Cut } else { DayState::Finished };
        self.set_state(work.day, DayNote { state, lacks })?;
        self.averages.failing.remove(&work.day);
        self.counts.averaged_days.fetch_add(1, Ordering::Relaxed);
        self.averages.is_due = true;
        // The next write looks at the limits: a part of this day may wait to be removed.
        self.written = u64::MAX;
        Ok(())
    }

    fn set_state(&mut self, day: i64, note: DayNote) -> Result<(), StoreError> {
        if self.averages.states.get(&day) != Some(&note)
            && let Some(averages) = self.store.averages()
        {
            averages.set_state(day, note)?;
            self.averages.states.insert(day, note);
        }
        Ok(())
    }

    fn state(&self, day: i64) -> DayState {
        self.averages.states.get(&day).map_or(DayState::Pending, |note| note.state)
    }

    /// Whether averages of a day are still to be computed.
    fn lacks_averages(&self, day: i64) -> bool {
        !matches!(self.state(day), DayState::Finished | DayState::Cut)
            && !self.averages.given_up.contains(&day)
    }

    /// Something is about to be written for a day. If its averages are computed already, they will lack it.
    pub(super) fn reopen(&mut self, day: i64, today: i64) {
        // What was computed before a part went is better than what could be computed now.
        if self.averages.work.as_ref().is_some_and(|work| work.day == day && !work.lost_part) {
            self.averages.work = None;
            self.averages.is_due = true;
        }
        let Some(note) = self.averages.states.get(&day).copied() else { return };
        let note = match note.state {
            DayState::Finished => DayNote { state: DayState::Reopened, ..note },
            // The clock was set back: its values go on.
            DayState::Cut if day >= today => DayState::Reopened.lacking(),
            DayState::Cut => DayState::Cut.lacking(),
            DayState::Pending | DayState::Reopened => return,
        };
        if let Err(error) = self.set_state(day, note) {
            // The values are more important.
            tracing::error!(%error, day, "averages of a day will lack what comes late");
        }
    }

    /// Whether a part that is too old has to stay until the averages of its day are there.
    pub(super) fn waits_for_averages(&self, part: Part, today: i64) -> bool {
        let oldest = self.oldest_with_averages(today);
        let too_old_since = part.day.saturating_add(i64::from(self.settings.keep_days).max(1));
        let waits_since = self.averages.looked.map_or(today, |(_, first)| too_old_since.max(first));
        self.keeps_averages()
            && self.lacks_averages(part.day)
            && (oldest..today).contains(&part.day)
            && today < waits_since.saturating_add(MAX_WAIT_DAYS)
    }

    fn keeps_averages(&self) -> bool {
        self.has_averages && !self.has_no_room && !self.averages.is_off
    }

    /// A part is about to be removed.
    pub(super) fn note_removal(&mut self, part: Part, today: i64) {
        if !self.has_averages {
            return;
        }
        self.let_go(part.day);
        if part.day > today || part.day < self.oldest_with_averages(today) {
            return;
        }
        let lacks = self.averages.states.get(&part.day).is_some_and(|note| note.lacks);
        let note = match self.state(part.day) {
            DayState::Cut => return,
            DayState::Finished => DayNote { state: DayState::Cut, lacks },
            // What came late is in no average.
            DayState::Reopened => DayState::Cut.lacking(),
            DayState::Pending => {
                self.counts.removed_unaveraged.fetch_add(1, Ordering::Relaxed);
                tracing::warn!(
                    ?part,
                    "a file of the history is removed, and no averages of it were computed"
                );
                DayState::Pending.lacking()
            }
        };
        if let Err(error) = self.set_state(part.day, note) {
            tracing::error!(%error, ?part, "it is not noted that values of a day are removed");
        }
    }

    /// Closes the files that are read for averages, so that none that is removed keeps its room. A part of
    /// this day goes: averages of all of it are better than those that could be computed now.
    fn let_go(&mut self, day: i64) {
        let Some(mut work) = self.averages.work.take() else { return };
        let is_of_day = work.day == day;
        let has_averages = is_of_day && self.state(day) != DayState::Pending;
        match self.store.to_average() {
            Some(reader) if !has_averages => {
                work.reader = reader;
                work.lost_part |= is_of_day;
                self.averages.work = Some(work);
            }
            Some(_) | None => self.averages.is_due = true,
        }
    }

    /// Removes averages that are too old, or more than `most` bytes: those of minutes first, and the oldest
    /// first. Returns what is left, in bytes.
    pub(super) fn keep_limits_of_averages(&mut self, today: i64, most: u64) -> Result<u64, StoreError> {
        let (minutes, hours) = (self.oldest_with_minutes(today), self.oldest_with_averages(today));
        let day = self.averages.work.as_ref().map(|work| work.day);
        let Some(averages) = self.store.averages() else { return Ok(0) };
        let files = averages.files()?;
        let mut size: u64 = files.iter().map(|(_, size)| size).sum();
        for (file, bytes) in files {
            let oldest = if file.step == Step::Minute { minutes } else { hours };
            let is_too_old = *file.days().end() < oldest;
            if !is_too_old && size <= most {
                continue;
            }
            tracing::info!(?file, bytes, "the oldest file of averages is removed");
            averages.remove(file)?;
            self.counts.removed_averages.fetch_add(1, Ordering::Relaxed);
            size = size.saturating_sub(bytes);
            if !day.is_some_and(|day| file.days().contains(&day)) {
                continue;
            }
            match file.step {
                // What is computed now is not kept.
                Step::Minute | Step::Hour if is_too_old => self.averages.work = None,
                Step::Minute => {
                    tracing::error!(?file, "there is no room for averages of minutes of this day");
                    self.averages.without_minutes = day;
                }
                Step::Hour => {
                    tracing::error!(?file, "there is no room for averages: none are computed any more");
                    self.averages.is_off = true;
                    self.averages.work = None;
                }
            }
        }
        self.counts.average_bytes.store(size, Ordering::Relaxed);
        Ok(size)
    }

    /// The oldest day whose hours are kept.
    fn oldest_with_averages(&self, today: i64) -> i64 {
        today.saturating_sub(i64::from(self.settings.keep_hours_days).max(1) - 1)
    }

    fn oldest_with_minutes(&self, today: i64) -> i64 {
        today.saturating_sub(i64::from(self.settings.keep_minutes_days).max(1) - 1)
    }

    /// Lets the next call of [`Self::average`] look for a day. The limits are looked at on this day.
    pub(super) fn look_for_days(&mut self, today: i64) {
        self.averages.is_due = true;
        let goes_on = self.averages.looked.filter(|(last, _)| [0, 1].contains(&today.saturating_sub(*last)));
        self.averages.looked = Some((today, goes_on.map_or(today, |(_, first)| first)));
    }
}
