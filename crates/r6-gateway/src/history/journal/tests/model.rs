//! Whatever happens, a query answers as a plain list of the samples would.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::core::history::buckets::{Bucket, Buckets};
use crate::store::history::Days;

#[derive(Clone, Debug)]
enum Step {
    /// A sample of a signal, and how many µs it comes after the last one; now and then it is late.
    Sample(usize, i64, i64),
    /// Many samples at once.
    Burst(usize, i64, u16),
    Flush,
    SealAll,
    /// The next writes fail, before or after they are done.
    Fail(u32, bool),
    /// The process ends without order, and another one begins.
    Restart,
    /// A large day begins another part.
    Part,
}

const SIGNALS: [Address; 3] = [Address::CurMode, Address::IsMoving, Address::Origin];

fn any_step() -> impl Strategy<Value = Step> {
    let gap = prop_oneof![6 => 1_i64..2_000_000, 2 => 1_i64..90_000_000, 1 => -400_000_000_i64..0];
    prop_oneof![
        10 => (0..3_usize, gap, -5_i64..5).prop_map(|(signal, gap, value)| Step::Sample(signal, gap, value)),
        2 => (0..3_usize, 1_i64..500_000, 1_u16..700).prop_map(|(s, gap, count)| Step::Burst(s, gap, count)),
        6 => Just(Step::Flush),
        1 => Just(Step::SealAll),
        1 => (1_u32..3, any::<bool>()).prop_map(|(count, after)| Step::Fail(count, after)),
        1 => Just(Step::Restart),
        1 => Just(Step::Part),
    ]
}

type Samples = BTreeMap<i64, State>;

/// What is known of each signal: all samples, and those that were acknowledged.
struct Model {
    all: Vec<Samples>,
    safe: Vec<Samples>,
    time: i64,
}

/// A value of a signal: whole numbers, decimals and texts, and of each a gap now and then.
fn state(signal: usize, value: i64) -> State {
    match (signal, value) {
        (_, 4) => State::Gap(Gap::Stale),
        (0, _) => State::Integer(value),
        (1, _) => State::Decimal(value as f64 / 8.0),
        (_, _) => State::Text(value.to_string().into()),
    }
}

impl Model {
    fn add(&mut self, signal: usize, gap: i64, value: i64) -> Option<Sample> {
        let time = self.time + gap;
        self.time = self.time.max(time);
        // Two samples of one time are one.
        if self.all[signal].contains_key(&time) {
            return None;
        }
        let state = state(signal, value);
        self.all[signal].insert(time, state.clone());
        Some(Sample { time: Micros(time), state })
    }
}

fn check<S: HistoryStore>(store: &mut S, journal: Option<&Journal<S>>, model: &mut Model) {
    for (signal, address) in SIGNALS.into_iter().enumerate() {
        let open = journal.map_or(Vec::new(), |journal| journal.open(&press(), address));
        let seen = all(store, address, open);
        assert!(seen.windows(2).all(|pair| pair[0].time < pair[1].time), "{seen:?}");
        let seen: Samples = seen.into_iter().map(|sample| (sample.time.0, sample.state)).collect();
        match journal {
            Some(_) => assert_eq!(seen, model.all[signal], "{address}"),
            None => {
                for (time, state) in &model.safe[signal] {
                    assert_eq!(seen.get(time), Some(state), "{address}: an acknowledged sample is lost");
                }
                let known = seen.iter().all(|(time, state)| model.all[signal].get(time) == Some(state));
                assert!(known, "{address}: a sample came from nowhere");
                model.all[signal] = seen;
            }
        }
    }
}

/// Buckets and pages say the same as one list.
fn check_queries<S: HistoryStore>(store: &mut S, journal: &Journal<S>, width: i64, limit: usize) {
    let address = SIGNALS[0];
    let open = || journal.open(&press(), address);
    let (from, to) = (BASE - 500 * SECOND, BASE + 7_000 * SECOND);
    let question = ask(address, from, to);
    let whole = answer(store, &question, open()).unwrap();
    let mut expected = Buckets::new(Micros(from), Micros(to), width, usize::MAX);
    let before = all(store, address, open());
    before.into_iter().for_each(|sample| expected.sample(Interval::LONGEST, sample));
    let expected = expected.finish();

    let (mut samples, mut buckets): (Vec<Sample>, Vec<Bucket>) = Default::default();
    let mut page = Question { limit, ..question.clone() };
    loop {
        let answered = answer(store, &page, open()).unwrap();
        assert!(answered.samples.len() <= limit + 1);
        samples.extend(answered.samples);
        page.cursor = answered.next;
        if page.cursor.is_none() {
            break;
        }
    }
    assert_eq!(samples, whole.samples);
    let mut page = Question { limit, bucket: Some(width), ..question };
    loop {
        let answered = answer(store, &page, open()).unwrap();
        buckets.extend(answered.buckets);
        page.cursor = answered.next;
        if page.cursor.is_none() {
            break;
        }
    }
    assert_eq!(buckets.len(), expected.len());
    for (seen, expected) in buckets.iter().zip(&expected) {
        let of = |bucket: &Bucket| (bucket.start, bucket.good, bucket.samples, bucket.range);
        assert_eq!(of(seen), of(expected));
        assert_eq!(
            seen.last.as_ref().and_then(State::number),
            expected.last.as_ref().and_then(State::number)
        );
        let close = match (seen.mean, expected.mean) {
            (Some(seen), Some(expected)) => (seen - expected).abs() < 1e-6,
            (seen, expected) => seen == expected,
        };
        assert!(close, "{seen:?} {expected:?}");
    }
}

fn play<S: HistoryStore>(steps: Vec<Step>, mut new: impl FnMut() -> S, fail: impl Fn(u32, bool), width: i64) {
    let counts = Arc::<RobotCounts>::default();
    let mut running = journal(new(), settings());
    let mut model = Model { all: vec![Samples::new(); 3], safe: vec![Samples::new(); 3], time: BASE };
    let mut now = Instant::ORIGIN;
    for step in steps {
        now += std::time::Duration::from_millis(100);
        match step {
            Step::Sample(signal, gap, value) => {
                let sample = model.add(signal, gap, value);
                let samples = sample.map(|sample| (SIGNALS[signal], sample)).into_iter().collect();
                running.take(now, batch(samples, &counts));
            }
            Step::Burst(signal, gap, count) => {
                let samples = (0..count).filter_map(|at| model.add(signal, gap, i64::from(at % 100)));
                let samples = samples.map(|sample| (SIGNALS[signal], sample)).collect();
                running.take(now, batch(samples, &counts));
            }
            Step::Flush => {
                if running.flush(now, Micros(model.time)).is_ok() {
                    model.safe.clone_from(&model.all);
                }
            }
            Step::SealAll => running.seal_all(),
            Step::Fail(count, after) => fail(count, after),
            Step::Restart => {
                fail(0, false);
                drop(running);
                running = journal(new(), settings());
                running.flush(now, Micros(model.time)).unwrap();
                check(&mut new(), None, &mut model);
                model.safe.clone_from(&model.all);
            }
            Step::Part => {
                if running.seal_for_part(Micros(model.time).day()).is_ok() {
                    model.safe.clone_from(&model.all);
                    running.store.begin_part(Micros(model.time).day()).unwrap();
                }
            }
        }
    }
    check(&mut new(), Some(&running), &mut model);
    check_queries(&mut new(), &running, width, 7);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    #[test]
    fn memory_answers_as_a_list(
        steps in prop::collection::vec(any_step(), 1..60),
        width in 5_000_000_i64..900_000_000,
    ) {
        let store = MemoryDays::default();
        play(steps, || store.clone(), |count, after| store.fail(count, after), width);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn files_answer_as_a_list(
        steps in prop::collection::vec(any_step(), 1..40),
        width in 5_000_000_i64..900_000_000,
    ) {
        let folder = tempfile::tempdir().unwrap();
        play(steps, || Days::to_write(folder.path(), 1 << 30), |_, _| {}, width);
    }
}
