//! Averages of days that are over: what they say, and what becomes of them.

use super::*;
use crate::core::history::averages::{DAY, Step, begin_of};
use crate::core::history::buckets::Bucket;
use crate::history::query::{Averaged, Used, answer_with_averages};
use crate::store::history::{AverageFile, DayState, Days};

/// The first day of these tests, which is followed by others.
pub(super) const FIRST: i64 = 20_782;
pub(super) const MODE: Address = Address::CurMode;
pub(super) const MINUTE: i64 = 60 * SECOND;
pub(super) const HOUR: i64 = 3_600 * SECOND;

pub(super) fn at(day: i64, second: i64) -> i64 {
    begin_of(day).0 + second * SECOND
}

/// Numbers of two signals, every 7 s from 20:00 of the first day to 04:00 of the second, with gaps.
pub(super) fn fill<S: HistoryStore>(journal: &mut Journal<S>) {
    let counts = Arc::<RobotCounts>::default();
    for number in 0..4_114 {
        let time = at(FIRST, 20 * 3_600) + number * 7 * SECOND;
        let state = match number % 50 {
            0 => State::Gap(Gap::Stale),
            _ => State::Decimal(f64::from(i32::try_from(number * number % 1_013).unwrap()) / 8.0),
        };
        let second = Sample { time: Micros(time), state };
        let samples = vec![(MODE, whole(time, number % 97)), (Address::Origin, second)];
        journal.take(Instant::ORIGIN, batch_of(Interval::USUAL, samples, &counts));
        if number % 100 == 0 {
            journal.flush(Instant::ORIGIN, Micros(time)).unwrap();
        }
    }
    journal.seal_all();
    journal.flush(Instant::ORIGIN, Micros(at(FIRST + 1, 4 * 3_600))).unwrap();
}

pub(super) fn question(from: i64, to: i64, bucket: Option<i64>) -> Question {
    Question { bucket, ..ask(Address::Origin, from, to) }
}

pub(super) fn read<S: HistoryStore>(store: &mut S, question: &Question) -> Answer {
    let answer = answer_with_averages(store, question, Vec::new()).unwrap();
    assert_eq!((answer.unreadable, answer.is_too_wide), (0, false));
    answer
}

/// Whether buckets are the same, up to the rounding of sums.
fn assert_same(one: &[Bucket], other: &[Bucket]) {
    assert_eq!(one.len(), other.len());
    for (one, other) in one.iter().zip(other) {
        let is_near = match (one.mean, other.mean) {
            (Some(one), Some(other)) => (one - other).abs() < 1e-9,
            (one, other) => one == other,
        };
        assert!(is_near, "{one:?} {other:?}");
        assert_eq!(Bucket { mean: other.mean, ..one.clone() }, *other);
    }
}

/// A store with the averages of the first day, without its values; and what the values said of a range.
fn averaged<S: HistoryStore>(store: S, before: &[Question]) -> (Journal<S>, Vec<Answer>) {
    let mut journal = journal(store, settings());
    fill(&mut journal);
    let of_values = before.iter().map(|question| answer(&mut journal.store, question, Vec::new()).unwrap());
    let of_values = of_values.collect();
    average_all(&mut journal, at(FIRST + 1, 4 * 3_600));
    assert_eq!(journal.averages.states, BTreeMap::from([(FIRST, DayState::Finished.whole())]));
    journal.note_removal(Part { day: FIRST, number: 1 }, FIRST + 1);
    journal.store.remove(Part { day: FIRST, number: 1 }).unwrap();
    (journal, of_values)
}

#[test]
fn averages_say_what_the_values_said() {
    let day = (begin_of(FIRST).0, begin_of(FIRST + 1).0);
    let questions = [
        question(day.0, day.1, Some(MINUTE)),
        question(day.0, day.1, Some(HOUR)),
        question(day.0 + 30 * MINUTE, day.1 - MINUTE, Some(5 * MINUTE)),
        question(day.0, day.1, Some(6 * HOUR)),
        question(day.0 - DAY, day.1, Some(2 * DAY)),
    ];
    let folder = tempfile::tempdir().unwrap();
    check(MemoryDays::default(), &questions);
    check(Days::to_write(folder.path(), 1 << 30), &questions);

    fn check<S: HistoryStore>(store: S, questions: &[Question]) {
        let (mut journal, of_values) = averaged(store, questions);
        for (question, of_values) in questions.iter().zip(of_values) {
            let answer = read(&mut journal.store, question);
            assert_same(&answer.buckets, &of_values.buckets);
            let hours = question.bucket.unwrap() % HOUR == 0;
            let told = Averaged {
                from: question.from.max(begin_of(FIRST)),
                to: question.to,
                step: if hours { Step::Hour } else { Step::Minute },
                used: Used::Exact,
            };
            assert_eq!(answer.averages, [told]);
            assert!(answer.buckets.iter().any(|bucket| bucket.samples > 5), "there is something");
        }
    }
}

#[test]
fn a_range_goes_on_from_averages_to_values() {
    let (from, to) = (at(FIRST, 21 * 3_600), at(FIRST + 1, 3 * 3_600));
    let widths = [MINUTE, 7 * MINUTE, HOUR, 4 * HOUR];
    let questions = widths.map(|width| question(from, to, Some(width)));
    let (mut journal, of_values) = averaged(MemoryDays::default(), &questions);
    let midnight = begin_of(FIRST + 1);
    for (question, of_values) in questions.iter().zip(of_values) {
        let whole = read(&mut journal.store, question);
        assert_eq!((whole.averages[0].from, whole.averages[0].to), (Micros(from), midnight));
        assert_eq!(whole.averages[0].used, Used::Exact);
        assert_eq!(whole.buckets.len(), of_values.buckets.len());
        for (one, other) in whole.buckets.iter().zip(&of_values.buckets) {
            // What counted from before midnight until the first sample of the next day went with its day.
            assert!(other.good - one.good <= 7 * SECOND, "{one:?} {other:?}");
            assert_eq!((one.start, one.samples), (other.start, other.samples));
            if one.good == other.good {
                assert_same(std::slice::from_ref(one), std::slice::from_ref(other));
            }
        }
        for limit in [1, 3] {
            let mut page = Question { limit, ..question.clone() };
            let (mut buckets, mut told) = (Vec::new(), Vec::new());
            loop {
                let answer = read(&mut journal.store, &page);
                assert!(answer.buckets.len() <= limit);
                buckets.extend(answer.buckets);
                told.extend(answer.averages);
                page.cursor = answer.next;
                if answer.next.is_none() {
                    break;
                }
            }
            assert_same(&buckets, &whole.buckets);
            assert_eq!((told[0].from, told.last().unwrap().to), (Micros(from), midnight));
        }
    }
}

#[test]
fn edges_within_averages_are_told_and_no_sample_is_made_of_one() {
    let (mut journal, _) = averaged(MemoryDays::default(), &[]);
    let (from, to) = (at(FIRST, 21 * 3_600), at(FIRST, 22 * 3_600));
    let whole = read(&mut journal.store, &question(from, to, Some(HOUR))).buckets;
    for (from, width) in [(from + 1, 10 * MINUTE), (from, 90 * SECOND)] {
        let answer = read(&mut journal.store, &question(from, to, Some(width)));
        assert_eq!(answer.averages.len(), 1);
        assert_eq!((answer.averages[0].step, answer.averages[0].used), (Step::Minute, Used::ByBegin));
        let lost = u64::from(from % HOUR != 0) * 9;
        let samples: u64 = answer.buckets.iter().map(|bucket| bucket.samples).sum();
        assert!(whole[0].samples - samples <= lost, "{samples} of {}", whole[0].samples);
    }
    for bucket in [None, Some(MINUTE - 1_000), Some(SECOND)] {
        let answer = read(&mut journal.store, &Question { limit: 10_000, ..question(from, to, bucket) });
        let told = Averaged { from: Micros(from), to: Micros(to), step: Step::Minute, used: Used::No };
        assert_eq!(answer.averages, [told], "{bucket:?}");
        assert_eq!(answer.samples, []);
        assert!(answer.buckets.iter().all(Bucket::is_empty));
    }
    // A day whose minutes are gone too.
    journal.store.averages().unwrap().remove(AverageFile::of(Step::Minute, FIRST)).unwrap();
    for (from, bucket, used) in [
        (from, Some(HOUR), Used::Exact),
        (from + MINUTE, Some(HOUR), Used::ByBegin),
        (from, Some(30 * MINUTE), Used::No),
        (from, None, Used::No),
    ] {
        let answer = read(&mut journal.store, &question(from, to + HOUR, bucket));
        assert_eq!((answer.averages[0].step, answer.averages[0].used), (Step::Hour, used), "{bucket:?}");
        assert_eq!(answer.buckets.iter().any(|bucket| !bucket.is_empty()), used != Used::No);
    }
    // A signal and a robot that had no values.
    let other = Question { address: Address::CurAlarm, ..question(from, to, Some(HOUR)) };
    assert_eq!(read(&mut journal.store, &other).averages, []);
}

#[test]
fn values_that_come_late_are_averaged_too_unless_others_are_gone() {
    let store = MemoryDays::default();
    let counts = Arc::<RobotCounts>::default();
    let mut journal = journal(store, settings());
    fill(&mut journal);
    let now = at(FIRST + 1, 4 * 3_600);
    average_all(&mut journal, now);
    let of_hour = question(at(FIRST, 10 * 3_600), at(FIRST, 11 * 3_600), Some(HOUR));
    let late = |journal: &mut Journal<MemoryDays>, second: i64| {
        let time = at(FIRST, 10 * 3_600 + second);
        journal.take(Instant::ORIGIN, batch(vec![(Address::Origin, whole(time, 5))], &counts));
        journal.seal_all();
        journal.flush(Instant::ORIGIN, Micros(now)).unwrap();
    };
    late(&mut journal, 0);
    assert_eq!(journal.averages.states[&FIRST], DayState::Reopened.whole());
    let averages = journal.store.averages().unwrap();
    assert_eq!(
        averages.states(0..=FIRST).unwrap()[&FIRST],
        DayState::Reopened.whole(),
        "the next process knows it"
    );
    average_all(&mut journal, now);
    assert_eq!(journal.averages.states[&FIRST], DayState::Finished.whole());

    let part = Part { day: FIRST, number: 1 };
    journal.note_removal(part, FIRST + 1);
    journal.store.remove(part).unwrap();
    assert_eq!(read(&mut journal.store, &of_hour).buckets[0].samples, 1);
    // The other values are gone: averages of this one alone would be wrong.
    late(&mut journal, 60);
    average_all(&mut journal, now);
    assert_eq!(journal.averages.states[&FIRST], DayState::Cut.lacking());
    let whole_day = question(at(FIRST, 0), at(FIRST + 1, 0), Some(HOUR));
    let answer = read(&mut journal.store, &whole_day);
    assert_eq!((answer.buckets[10].samples, answer.buckets[21].samples), (1, 514));
    assert_eq!(answer.averages[0].used, Used::Incomplete, "the late one is in no average");
    // Samples are told as far as there are some.
    let answer = read(&mut journal.store, &question(at(FIRST, 0), at(FIRST + 1, 0), None));
    assert_eq!(answer.samples.len(), 2, "the late one, and the end of it");
    assert_eq!(answer.averages[0].used, Used::No);
}

#[test]
fn a_day_that_is_too_old_waits_for_its_averages_and_not_for_ever() {
    let limits = HistorySettings { keep_days: 1, ..settings() };
    let mut journal = journal(MemoryDays::default(), limits);
    fill(&mut journal);
    let look = |journal: &mut Journal<MemoryDays>, day: i64, second: i64| {
        journal.look_at_limits(Micros(at(day, second))).unwrap();
        journal.store.parts().unwrap().iter().filter(|(part, _)| part.day == FIRST).count()
    };
    assert_eq!(look(&mut journal, FIRST + 1, 60), 1, "its averages are not there");
    average_all(&mut journal, at(FIRST + 1, 14 * 60));
    assert_eq!(look(&mut journal, FIRST + 1, 14 * 60), 1, "something of it may still come");
    average_all(&mut journal, at(FIRST + 1, 15 * 60));
    assert_eq!(look(&mut journal, FIRST + 1, 15 * 60), 0);
    let removed = |journal: &Journal<MemoryDays>| {
        let of = |count: &std::sync::atomic::AtomicU64| count.load(Ordering::Relaxed);
        (of(&journal.counts.removed), of(&journal.counts.removed_unaveraged))
    };
    assert_eq!((removed(&journal), journal.averages.states[&FIRST]), ((1, 0), DayState::Cut.whole()));
    // A day that is never averaged goes all the same.
    assert_eq!(journal.store.parts().unwrap().len(), 1);
    for day in [FIRST + 2, FIRST + 3] {
        journal.look_at_limits(Micros(at(day, 0))).unwrap();
        assert_eq!(journal.store.parts().unwrap().len(), 1);
    }
    journal.look_at_limits(Micros(at(FIRST + 4, 0))).unwrap();
    assert_eq!(journal.store.parts().unwrap().len(), 0);
    assert_eq!(removed(&journal), (2, 1));
}

#[test]
fn averages_go_when_they_are_too_old() {
    let limits = HistorySettings { keep_minutes_days: 2, keep_hours_days: 40, ..settings() };
    let mut journal = journal(MemoryDays::default(), limits);
    fill(&mut journal);
    average_all(&mut journal, at(FIRST + 2, 3_600));
    let files = |journal: &mut Journal<MemoryDays>, day: i64| {
        journal.look_at_limits(Micros(at(day, 3_600))).unwrap();
        let files = journal.store.averages().unwrap().files().unwrap();
        files.into_iter().map(|(file, _)| (file.step, file.first)).collect::<Vec<_>>()
    };
    // The first day was too old for minutes when it was averaged.
    assert_eq!(files(&mut journal, FIRST + 2), [(Step::Minute, FIRST + 1), (Step::Hour, 20_758)]);
    assert_eq!(files(&mut journal, FIRST + 3), [(Step::Hour, 20_758)]);
    // 40 days after the last day of the month.
    assert_eq!(files(&mut journal, 20_787 + 39).len(), 1);
    assert_eq!(files(&mut journal, 20_787 + 40), []);
}

#[test]
fn a_disk_that_fails_delays_averages_and_changes_nothing_in_them() {
    let mut journal = journal(MemoryDays::default(), settings());
    fill(&mut journal);
    let now = Micros(at(FIRST + 1, 4 * 3_600));
    journal.store.fail(1, false);
    journal.look_for_days(FIRST + 1);
    let mut failed = 0;
    for _ in 0..20 {
        failed += u32::from(journal.average(now).is_err());
    }
    assert_eq!((failed, journal.averages.states.len()), (1, 0), "it is left alone until the next look");
    average_all(&mut journal, now.0);
    assert_eq!(journal.averages.states[&FIRST], DayState::Finished.whole());
    // Nothing is computed while the history pauses.
    journal.averages.states.clear();
    journal.counts.paused.store(true, Ordering::Relaxed);
    average_all(&mut journal, now.0);
    assert!(journal.averages.states.is_empty());
}

#[test]
fn files_of_averages_that_cannot_be_read_or_made_stop_no_values() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("hours-2026-11.db"), vec![7; 9_000]).unwrap();
    std::fs::create_dir(folder.path().join("minutes-2026-11-25.db")).unwrap();
    let limits = HistorySettings { keep_days: 1, ..settings() };
    let mut journal = journal(Days::to_write(folder.path(), 1 << 30), limits);
    fill(&mut journal);
    let now = Micros(at(FIRST + 1, 4 * 3_600));
    let mut failed = 0;
    for _ in 0..100 {
        journal.look_for_days(FIRST + 1);
        failed += u32::from(journal.average(now).is_err());
        journal.flush(Instant::ORIGIN, now).unwrap();
    }
    assert!(failed > 0 && journal.averages.states.is_empty());
    assert_eq!(journal.counts.given_up_days.load(Ordering::Relaxed), 1);
    // The days stay for a while, and then they go.
    for day in FIRST + 1..=FIRST + 4 {
        journal.look_at_limits(Micros(at(day, 5 * 3_600))).unwrap();
    }
    assert_eq!(journal.counts.removed_unaveraged.load(Ordering::Relaxed), 2);
    assert!(journal.store.parts().unwrap().is_empty());
    let answer = answer_with_averages(&mut journal.store, &question(at(FIRST, 0), now.0, None), Vec::new());
    assert_eq!(answer.unwrap().unreadable, 1);
}
