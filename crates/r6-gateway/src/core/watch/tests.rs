use proptest::prelude::*;
use r6_proto::message::reading::Counter;

use super::*;

const PERIOD: Duration = Duration::from_millis(100);
/// 2.5 periods are less than a live value stays fresh.
const LATE_MS: u64 = 1_600;
/// How long each reply takes.
const TOOK_MS: u64 = 40;
const PARTS: Address = Address::Counter(4);

fn at(ms: u64) -> Instant {
    Instant::ORIGIN + Duration::from_millis(ms)
}

fn watcher() -> Watcher {
    Watcher::new(|_| PERIOD, Some(PARTS), Before::Never)
}

fn counter(current: i64) -> Reading {
    Reading::Counter(Counter { id: 4, target: 0, current, name: None })
}

/// A poll at this time over this connection; the time of day is `offset` µs ahead.
fn poll(
    watcher: &mut Watcher,
    ms: u64,
    connection: u64,
    offset: i64,
    values: &[(Address, Reading)],
) -> Vec<Event> {
    let time = time(ms, offset);
    let of = |(address, reading): &'_ (Address, Reading)| (*address, reading.clone());
    let owned: Vec<_> = values.iter().map(of).collect();
    let values: Vec<_> = owned
        .iter()
        .map(|(address, reading)| Value {
            address: *address,
            reading: Some(reading),
            by: at(ms + TOOK_MS),
            at: at(ms),
            time,
        })
        .collect();
    watcher.take(connection, &values)
}

fn time(ms: u64, offset: i64) -> Micros {
    Micros(i64::try_from(ms).unwrap() * 1000 + offset)
}

fn seen(events: &[Event]) -> Vec<Observed> {
    events.iter().map(|event| event.observed.clone()).collect()
}

#[test]
fn an_alarm_begins_and_ends_with_the_time_in_between() {
    let mut watcher = watcher();
    let mut one =
        |ms, code| seen(&poll(&mut watcher, ms, 1, 0, &[(Address::CurAlarm, Reading::Integer(code))]));
    assert_eq!(one(0, 42), [], "its begin was not seen");
    assert_eq!(one(100, 0), [Observed::AlarmEnded { code: 42, lasted_ms: None }]);
    assert_eq!(one(200, 7), [Observed::AlarmBegan { code: 7 }]);
    assert_eq!(one(300, 7), []);
    let next = [Observed::AlarmEnded { code: 7, lasted_ms: Some(350) }, Observed::AlarmBegan { code: 130 }];
    assert_eq!(one(550, 130), next);
    assert_eq!(one(600, -1), [], "no alarm has such a number");
}

#[test]
fn a_value_of_an_earlier_connection_is_nothing() {
    let mut watcher = watcher();
    let mode = |mode| [(Address::CurMode, Reading::Integer(mode))];
    assert_eq!(poll(&mut watcher, 0, 5, 0, &mode(2)), []);
    let events = poll(&mut watcher, 100, 6, 0, &mode(7));
    let unseen = Observed::Unseen { from: Some(time(0, 0)), to: time(100, 0), because: UnseenBecause::Link };
    assert_eq!(seen(&events), [Observed::LinkLost {}, Observed::LinkBack {}, unseen]);
    assert_eq!(poll(&mut watcher, 150, 5, 0, &mode(2)), [], "a late reply of the connection before");
    assert_eq!(poll(&mut watcher, 90, 6, 0, &mode(2)), [], "a reply that was overtaken");
    assert_eq!(seen(&poll(&mut watcher, 200, 6, 0, &mode(3))), [Observed::ModeChanged { from: 7, to: 3 }]);
}

#[test]
fn a_robot_that_is_lost_is_told_once_and_begins_anew() {
    let mut watcher = watcher();
    let mode = |mode| [(Address::CurMode, Reading::Integer(mode))];
    assert_eq!(watcher.look(at(9_000), time(9_000, 0)), None, "it was never read");
    assert_eq!(poll(&mut watcher, 10_000, 1, 0, &mode(2)), []);
    assert_eq!(watcher.look(at(10_000 + LATE_MS), Micros(0)), None);
    let lost = watcher.look(at(10_001 + LATE_MS), Micros(7));
    assert_eq!(lost, Some(Event::new(Micros(7), Observed::LinkLost {})));
    assert_eq!(watcher.look(at(20_000), Micros(8)), None);
    let because = UnseenBecause::Link;
    let unseen = Observed::Unseen { from: Some(time(10_000, 0)), to: time(21_000, 0), because };
    assert_eq!(seen(&poll(&mut watcher, 21_000, 1, 0, &mode(7))), [Observed::LinkBack {}, unseen]);
    assert_eq!(poll(&mut watcher, 21_100, 1, 0, &mode(7)), []);
}

#[test]
fn a_late_answer_brings_the_link_back_behind_its_loss() {
    let mut watcher = watcher();
    let mode = |mode| [(Address::CurMode, Reading::Integer(mode))];
    assert_eq!(poll(&mut watcher, 10_000, 1, 0, &mode(2)), []);
    let lost = watcher.look(at(13_000), time(13_000, 0)).unwrap();
    assert_eq!((lost.time, lost.true_time), (time(13_000, 0), None));
    // It was asked for before the loss was noticed.
    let events = poll(&mut watcher, 12_000, 1, 0, &mode(7));
    let because = UnseenBecause::Link;
    let unseen = Observed::Unseen { from: Some(time(10_000, 0)), to: time(12_000, 0), because };
    assert_eq!(seen(&events), [Observed::LinkBack {}, unseen]);
    for event in &events {
        assert_eq!((event.time, event.true_time), (lost.time, Some(time(12_000, 0))));
    }
    let next = poll(&mut watcher, 13_100, 1, 0, &mode(2));
    assert_eq!((next[0].time, next[0].true_time), (time(13_100, 0), None));
}

#[test]
fn what_was_not_seen_before_the_start_is_told() {
    for (before, from) in [(Before::Seen(Some(Micros(5))), Some(Micros(5))), (Before::Seen(None), None)] {
        let mut watcher = Watcher::new(|_| PERIOD, None, before);
        let events = poll(&mut watcher, 100, 1, 0, &[(Address::CurMode, Reading::Integer(7))]);
        let unseen = Observed::Unseen { from, to: time(100, 0), because: UnseenBecause::Start };
        assert_eq!(seen(&events), [unseen]);
    }
}

#[test]
fn a_value_that_is_missing_for_long_begins_anew_and_that_is_told_once() {
    let mut watcher = watcher();
    let mode = [(Address::CurMode, Reading::Integer(2))];
    let both = |code, name: &str| {
        [
            mode[0].clone(),
            (Address::CurAlarm, Reading::Integer(code)),
            (Address::CurMold, Reading::Text(name.into())),
        ]
    };
    poll(&mut watcher, 0, 1, 0, &both(0, "a"));
    for step in 1..40 {
        let events = poll(&mut watcher, step * 100, 1, 0, &mode);
        assert_eq!(events, [], "values that are missing for some polls are no gap yet");
    }
    let events = poll(&mut watcher, 4_000, 1, 0, &both(7, "b"));
    let because = UnseenBecause::Unread;
    assert_eq!(seen(&events), [Observed::Unseen { from: Some(time(0, 0)), to: time(4_000, 0), because }]);
}

#[test]
fn a_robot_that_is_read_seldom_is_lost_when_its_mode_does_not_come() {
    let minute = Duration::from_secs(60);
    let half = Duration::from_millis(500);
    let period = |address| if address == Address::CurMode { half } else { minute };
    let mut watcher = Watcher::new(period, None, Before::Never);
    let mode = [(Address::CurMode, Reading::Integer(7))];
    let alarm = |code| (Address::CurAlarm, Reading::Integer(code));
    poll(&mut watcher, 0, 1, 0, &[mode[0].clone(), alarm(0)]);
    for step in 1..=120 {
        let events = poll(&mut watcher, step * 500, 1, 0, &mode);
        assert_eq!(events, [], "the alarm is not due yet");
    }
    let events = poll(&mut watcher, 60_200, 1, 0, &[alarm(7)]);
    assert_eq!(seen(&events), [Observed::AlarmBegan { code: 7 }]);
    assert_eq!(watcher.look(at(62_100), Micros(0)), None);
    assert!(watcher.look(at(62_300), Micros(0)).is_some(), "2 s after the last reading");
}

#[test]
fn another_robot_is_not_seen_until_it_is_accepted() {
    let mut watcher = watcher();
    let mode = |mode| [(Address::CurMode, Reading::Integer(mode))];
    let because = UnseenBecause::AnotherRobot;
    assert_eq!(watcher.replaced(at(50), time(50, 0)), None, "nothing was seen before");
    assert_eq!(poll(&mut watcher, 100, 1, 0, &mode(7)), []);
    let unseen = Observed::Unseen { from: Some(time(100, 0)), to: time(200, 0), because };
    assert_eq!(watcher.replaced(at(200), time(200, 0)), Some(Event::new(time(200, 0), unseen)));
    assert_eq!(watcher.replaced(at(300), time(300, 0)), None, "it is told once");
    assert_eq!(watcher.look(at(9_000), Micros(0)), None, "the link is not lost");
    // Accepted, over the same connection.
    let unseen = Observed::Unseen { from: Some(time(100, 0)), to: time(400, 0), because };
    assert_eq!(seen(&poll(&mut watcher, 400, 1, 0, &mode(2))), [unseen]);
    assert_eq!(seen(&poll(&mut watcher, 500, 1, 0, &mode(7))), [Observed::ModeChanged { from: 2, to: 7 }]);
    // After a restart it is still there, and was never seen.
    let mut watcher = Watcher::new(|_| PERIOD, None, Before::Seen(Some(Micros(5))));
    let unseen = Observed::Unseen { from: Some(Micros(5)), to: time(200, 0), because };
    assert_eq!(watcher.replaced(at(200), time(200, 0)), Some(Event::new(time(200, 0), unseen)));
    let unseen = Observed::Unseen { from: Some(Micros(5)), to: time(300, 0), because };
    assert_eq!(seen(&poll(&mut watcher, 300, 1, 0, &mode(2))), [unseen]);
}

#[test]
fn parts_are_counted_and_a_reset_is_not_a_part() {
    let mut watcher = watcher();
    let mut one = |ms, total| seen(&poll(&mut watcher, ms, 1, 0, &[(PARTS, counter(total))]));
    assert_eq!(one(0, 373_266), []);
    assert_eq!(one(100, 373_268), [Observed::Parts { counter: 4, added: 2, total: 373_268 }]);
    assert_eq!(one(200, 3), [Observed::PartsReset { counter: 4, from: 373_268, to: 3 }]);
    assert_eq!(one(300, 4), [Observed::Parts { counter: 4, added: 1, total: 4 }]);
    assert_eq!(one(400, i64::MIN), [Observed::PartsReset { counter: 4, from: 4, to: i64::MIN }]);
    assert_eq!(one(500, i64::MAX), [Observed::PartsReset { counter: 4, from: i64::MIN, to: i64::MAX }]);
}

/// One step of a random history.
#[derive(Clone, Debug)]
enum Step {
    /// A poll, and how many ms it comes after the last step. Each value may be missing.
    Poll(u64, Option<i64>, Option<i64>, Option<i64>, Option<u8>),
    Look(u64),
    /// The connection is a new one from here on.
    Reconnect,
    /// Somebody sets the clock on, or back, by this number of µs.
    SetClock(i64),
    /// Readings are lost.
    Miss,
    /// A reply of an earlier connection comes.
    Late(i64),
}

fn any_step() -> impl Strategy<Value = Step> {
    let gap = prop_oneof![8 => 20..400_u64, 1 => 1_500..1_700_u64, 1 => 400..90_000_u64];
    let maybe = |values: std::ops::Range<i64>| prop::option::weighted(0.9, values);
    prop_oneof![
        20 => (gap.clone(), maybe(0..4), maybe(0..3), maybe(-3..4), prop::option::weighted(0.9, 0..3_u8))
            .prop_map(|(gap, mode, alarm, parts, program)| Step::Poll(gap, mode, alarm, parts, program)),
        4 => gap.prop_map(Step::Look),
        1 => Just(Step::Reconnect),
        1 => (-90_000_000_000_i64..90_000_000_000).prop_map(Step::SetClock),
        1 => Just(Step::Miss),
        1 => (0..9_i64).prop_map(Step::Late),
    ]
}

/// What the test itself knows of one value: the time of its last reading that counts, and the value.
type Known<T> = Option<(u64, T)>;

/// The value before, if this reading follows it. Sets `gap` if there was one before that it does not follow.
fn follows<T: Clone>(known: &mut Known<T>, ms: u64, next: &T, gap: &mut bool) -> Option<T> {
    let before = known.replace((ms, next.clone()))?;
    let follows = ms - before.0 <= LATE_MS;
    *gap |= !follows;
    follows.then_some(before.1)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    /// Events are exactly the differences between readings that follow each other, and each gap is told.
    #[test]
    fn events_are_what_changed_between_readings_that_follow_each_other(
        steps in prop::collection::vec(any_step(), 1..80),
    ) {
        let mut watcher = watcher();
        let (mut ms, mut connection, mut offset) = (1_000_000_u64, 5_u64, 3_600_000_000_i64);
        let (mut mode, mut alarm, mut parts): (Known<i64>, Known<i64>, Known<i64>) = (None, None, None);
        let mut program: Known<String> = None;
        let mut last: Option<(u64, u64, Micros)> = None;
        let (mut told_lost, mut missed) = (false, false);
        for step in steps {
            match step {
                Step::Reconnect => connection += 1,
                Step::SetClock(by) => offset += by,
                Step::Miss => {
                    watcher.miss();
                    missed = true;
                }
                Step::Late(value) => {
                    let values = [(Address::CurMode, Reading::Integer(value)), (PARTS, counter(value))];
                    // Without a reading over this connection, the other one is the present one.
                    if last.is_some_and(|(_, of, _)| of == connection) {
                        prop_assert_eq!(poll(&mut watcher, ms + 1, connection - 1, offset, &values), vec![]);
                    }
                }
                Step::Look(gap) => {
                    ms += gap;
                    let event = watcher.look(at(ms), time(ms, offset));
                    let is_overdue = last.is_some_and(|(read, ..)| ms - read > LATE_MS);
                    prop_assert_eq!(event.is_some(), is_overdue && !told_lost);
                    told_lost |= is_overdue;
                }
                Step::Poll(gap, new_mode, new_alarm, new_parts, new_program) => {
                    ms += gap;
                    let mut values = vec![(Address::IsMoving, Reading::Flag(true))];
                    values.extend(new_mode.map(|mode| (Address::CurMode, Reading::Integer(mode))));
                    values.extend(new_alarm.map(|alarm| (Address::CurAlarm, Reading::Integer(alarm))));
                    values.extend(new_parts.map(|parts| (PARTS, counter(parts))));
                    let name = new_program.map(|number| format!("p{number}"));
                    values.extend(name.clone().map(|name| (Address::CurMold, Reading::Text(name))));
                    let events = poll(&mut watcher, ms, connection, offset, &values);

                    let is_new = last.is_some_and(|(_, of, _)| of != connection);
                    let is_late = last.is_some_and(|(read, ..)| ms - read > LATE_MS);
                    let is_gap = is_new || is_late || told_lost || (missed && last.is_some());
                    if is_gap {
                        (mode, alarm, parts, program) = (None, None, None, None);
                    }
                    let mut expected = Vec::new();
                    let mut unread = false;
                    if let Some(new) = new_mode
                        && let Some(from) = follows(&mut mode, ms, &new, &mut unread).filter(|from| *from != new)
                    {
                        expected.push(Observed::ModeChanged { from, to: new });
                    }
                    let mut codes = (0, 0);
                    if let Some(new) = new_alarm
                        && let Some(from) = follows(&mut alarm, ms, &new, &mut unread).filter(|from| *from != new)
                    {
                        codes = (from, new);
                    }
                    if let Some(to) = &name
                        && let Some(from) = follows(&mut program, ms, to, &mut unread).filter(|from| from != to)
                    {
                        expected.push(Observed::ProgramChanged { from, to: to.clone() });
                    }
                    if let Some(new) = new_parts
                        && let Some(from) = follows(&mut parts, ms, &new, &mut unread).filter(|from| *from != new)
                    {
                        expected.push(if new > from {
                            Observed::Parts { counter: 4, added: (new - from).unsigned_abs(), total: new }
                        } else {
                            Observed::PartsReset { counter: 4, from, to: new }
                        });
                    }
                    let mut told = Vec::new();
                    let (mut alarms, mut gaps, mut links) = ((0, 0), Vec::new(), Vec::new());
                    for event in events {
                        prop_assert_eq!(event.true_time.unwrap_or(event.time), time(ms, offset));
                        match event.observed {
                            Observed::AlarmEnded { code, lasted_ms } => {
                                alarms.0 = i64::from(code);
                                prop_assert!(lasted_ms.is_none_or(|lasted| lasted <= ms - 1_000_000));
                            }
                            Observed::AlarmBegan { code } => alarms.1 = i64::from(code),
                            Observed::Unseen { from, to, because } => gaps.push((from, to, because)),
                            link @ (Observed::LinkLost {} | Observed::LinkBack {}) => links.push(link),
                            other => told.push(other),
                        }
                    }
                    prop_assert_eq!(told, expected);
                    prop_assert_eq!(alarms, codes);
                    prop_assert_eq!(gaps.len(), usize::from(is_gap) + usize::from(unread), "{:?}", gaps);
                    if is_gap {
                        let from = last.map(|(_, _, time)| time);
                        prop_assert_eq!((gaps[0].0, gaps[0].1), (from, time(ms, offset)));
                    }
                    let back = is_new || told_lost;
                    let wanted: Vec<_> = (is_new && !told_lost).then_some(Observed::LinkLost {}).into_iter()
                        .chain(back.then_some(Observed::LinkBack {})).collect();
                    prop_assert_eq!(links, wanted);
                    last = Some((ms, connection, time(ms, offset)));
                    (told_lost, missed) = (false, false);
                }
            }
        }
    }

    /// A machine with cycles of random lengths is polled at random times: no cycle is claimed that did not
    /// end, and each time is that of the cycle that ended. The mode is read more often than the cycle, and a
    /// stop that no reading of the mode saw may look like an end.
    #[test]
    fn no_cycle_is_claimed_that_did_not_end(
        runs in prop::collection::vec(
            (100..9_000_u64, 1..6_usize, prop::option::of(0..100_u64), 200..9_000_u64),
            1..12,
        ),
        polls in prop::collection::vec(
            (prop_oneof![4 => 50..400_u64, 1 => 400..1_500_u64], prop::bool::weighted(0.6), 0..=TOOK_MS),
            400,
        ),
    ) {
        // When each cycle begins, when it ends or is broken off, and whether it ends.
        let (mut cycles, mut stops, mut now) = (Vec::new(), Vec::new(), 500_u64);
        for (length, count, broken_off, pause) in runs {
            for number in 0..count {
                // It is broken off at any time, most often just before its end.
                let broken_off = broken_off.filter(|_| number + 1 == count);
                let cut = broken_off.map(|before| if before < 80 { before + 1 } else { length * before / 200 });
                let end = now + length.saturating_sub(cut.unwrap_or(0)).max(1);
                cycles.push((now, end, cut.is_none()));
                now = end;
                if cut.is_some() {
                    stops.push((end, end + pause));
                }
            }
            now += pause;
        }
        let mut watcher = watcher();
        // `ms` is when a value was read; it was asked for before, and the reply came later.
        let (mut ms, mut before, mut claimed, mut unseen) = (0, 0, 0, 0);
        for (gap, has_cycle, late) in polls {
            let last_mode = ms;
            ms += gap;
            // Nothing was read of the mode while the machine stood.
            let is_unseen = |(end, begin): &&(u64, u64)| *end > last_mode && *begin <= ms;
            unseen += stops.iter().filter(is_unseen).count() as u64;
            let present = cycles.iter().find(|(begin, end, _)| (*begin..*end).contains(&ms));
            let ended = |from: u64, to: u64| {
                cycles.iter().filter(move |(_, end, is_whole)| *is_whole && *end > from && *end <= to)
            };
            let last = ended(0, ms).next_back().map_or(0, |(begin, end, _)| end - begin);
            let current = present.map_or(0, |(begin, ..)| ms - begin);
            let seconds = |ms: u64| Reading::Decimal(Duration::from_millis(ms).as_secs_f64());
            let mode = if present.is_some() { 7 } else { 2 };
            let mut values = vec![(Address::CurMode, Reading::Integer(mode))];
            if has_cycle {
                values.extend([(Address::LastCycle, seconds(last)), (Address::CurCycle, seconds(current))]);
            }
            let asked = ms + 1_000 - late;
            for event in poll(&mut watcher, asked, 1, 0, &values) {
                let Observed::CycleDone { count, at_least, ms: took, at } = event.observed else { continue };
                let real = ended(before, ms).count() as u64;
                prop_assert!(count <= real + unseen, "{} of {} at {}: {:?}", count, real, ms, cycles);
                prop_assert_eq!(took.is_none(), at_least);
                if let Some(took) = took && unseen == 0 {
                    prop_assert_eq!(real, 1);
                    let (begin, end, _) = ended(before, ms).next().unwrap();
                    prop_assert_eq!(took, end - begin);
                    prop_assert!(at >= time(*end + 1_000, 0) && at <= time(asked + TOOK_MS, 0));
                }
                claimed += count;
            }
            if has_cycle {
                (before, unseen) = (ms, 0);
            }
        }
        let polled: u64 = ms;
        let real = cycles.iter().filter(|(_, end, is_whole)| *is_whole && *end <= polled).count();
        prop_assert!(claimed <= (real + stops.len()) as u64);
    }
}
