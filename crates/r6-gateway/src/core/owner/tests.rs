//! The sums: whatever is late, lost or frozen, no gateway takes the robots before the last owner has let go.

use proptest::prelude::*;

use super::*;

const START: Instant = Instant::ORIGIN;

fn at(millis: u64) -> Instant {
    START + Duration::from_millis(millis)
}

#[test]
fn an_owner_without_beats_lets_go_step_by_step() {
    let reign = Reign::begin(START);
    let phases = [0, 999, 1_000, 1_499, 1_500, 1_999, 2_000].map(|millis| reign.phase(at(millis)));
    use Phase::{NoMoves, Over, Owns, StopLists};
    assert_eq!(phases, [Owns, Owns, NoMoves, NoMoves, StopLists, StopLists, Over]);
    assert_eq!(reign.left(at(400)), Some(Duration::from_millis(600)));
    assert_eq!(reign.left(at(2_000)), None);
}

#[test]
fn a_beat_counts_from_its_start_and_brings_nothing_back() {
    let mut reign = Reign::begin(START);
    reign.beaten(at(500), at(1_400));
    assert_eq!(reign.phase(at(1_499)), Phase::Owns);
    assert_eq!(reign.phase(at(1_500)), Phase::NoMoves, "not from when the answer came");
    // An answer to an earlier beat does not set it back.
    reign.beaten(at(300), at(1_501));
    assert_eq!(reign.phase(at(1_502)), Phase::NoMoves);
    reign.beaten(at(1_990), at(2_100));
    assert_eq!(reign.phase(at(2_100)), Phase::Over, "its lists were being stopped already");
    let mut refused = Reign::begin(START);
    refused.refused();
    assert_eq!(refused.phase(START), Phase::Over);
}

fn seen(fence: u64, beat: u64, state: RowState) -> Seen {
    Seen { fence, beat, state }
}

#[test]
fn robots_are_taken_when_they_are_free_or_after_the_same_beat_for_long() {
    let mut watch = Watch::default();
    assert_eq!(watch.look(START, seen(1, 5, RowState::Alive)), Verdict::Wait);
    // The store's clock was set.
    assert_eq!(watch.look(at(500), seen(1, 5, RowState::Expired)), Verdict::Wait);
    assert_eq!(watch.look(at(1_000), seen(1, 6, RowState::Expired)), Verdict::Wait, "it lives");
    assert_eq!(watch.look(at(3_499), seen(1, 6, RowState::Expired)), Verdict::Wait);
    assert_eq!(watch.look(at(3_500), seen(1, 6, RowState::Expired)), Verdict::Take);
    assert_eq!(watch.look(at(3_501), seen(1, 7, RowState::Free)), Verdict::Take);
    assert_eq!(watch.look(at(9_000), seen(1, 7, RowState::Alive)), Verdict::Wait);
}

#[test]
fn an_old_copy_of_the_store_gives_the_robots_to_none() {
    let mut watch = Watch::default();
    watch.had(9);
    assert_eq!(watch.look(START, seen(8, 5, RowState::Free)), Verdict::Behind { highest: 9 });
    assert_eq!(watch.look(START, seen(9, 5, RowState::Free)), Verdict::Take);
}

/// One beat of the owner: how long it waits before it sends, how long the way to the store takes, and the way
/// back; `None` if it or its answer is lost.
#[derive(Clone, Debug)]
struct Beat {
    pause: u64,
    there: Option<u64>,
    back: Option<u64>,
}

fn beats() -> impl Strategy<Value = Vec<Beat>> {
    let way = || prop_oneof![8 => (0..300_u64).prop_map(Some), 2 => (300..4_000_u64).prop_map(Some), 1 => Just(None)];
    let pause = prop_oneof![9 => 300..700_u64, 1 => 700..6_000_u64];
    let beat = (pause, way(), way()).prop_map(|(pause, there, back)| Beat { pause, there, back });
    prop::collection::vec(beat, 0..12)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn no_gateway_takes_robots_that_another_still_has(
        beats in beats(),
        // When the other gateway looks first, and the ways of its questions.
        first in 0..3_000_u64,
        looks in prop::collection::vec((0..400_u64, 0..400_u64), 150),
        // When somebody sets the clock of the store, and by how much.
        set_at in 0..15_000_u64,
        set_by in prop_oneof![Just(0_i64), -5_000..5_000_i64],
    ) {
        let clock = |time: u64| i64::try_from(time).unwrap() + if time >= set_at { set_by } else { 0 };
        // What the store takes, and what the owner hears of it.
        let (mut taken, mut heard) = (vec![0_u64], Vec::new());
        let mut sent = 0;
        for beat in &beats {
            sent += beat.pause;
            let Some(there) = beat.there else { continue };
            taken.push(sent + there);
            if let Some(back) = beat.back {
                heard.push((sent + there + back, sent));
            }
        }
        taken.sort_unstable();
        heard.sort_unstable();
        let mut reign = Reign::begin(START);
        for (answered, sent) in heard {
            if reign.phase(at(answered)) == Phase::Over {
                break;
            }
            reign.beaten(at(sent), at(answered));
        }
        let over = reign.good + CLOSE;
        prop_assert_eq!(reign.phase(over), Phase::Over);
        let mut watch = Watch::default();
        let mut time = first;
        let mut take = None;
        for (there, back) in looks {
            let asked = time + there;
            let beat = taken.iter().filter(|taken| **taken <= asked).count();
            let last = taken[beat.max(1) - 1];
            let is_old = clock(asked) - clock(last) >= i64::try_from(EXPIRES.as_millis()).unwrap();
            let state = if is_old { RowState::Expired } else { RowState::Alive };
            let answered = asked + back;
            if watch.look(at(answered), seen(1, beat as u64, state)) == Verdict::Take {
                // The store looks again when it is taken.
                let taking = answered + there;
                let now = taken.iter().filter(|taken| **taken <= taking).count();
                if now == beat {
                    take = Some(taking);
                    break;
                }
            }
            let pause = u64::try_from(watch.pause(at(answered)).as_millis()).unwrap();
            time = answered.max(time + pause);
        }
        if let Some(take) = take {
            prop_assert!(over <= at(take), "the owner lets go at {over:?}, and another takes at {take} ms");
        }
    }

    #[test]
    fn robots_of_an_owner_that_was_killed_are_taken_soon_after_its_beat_expired(
        phase in 0..500_u64,
        ways in prop::collection::vec(0..30_u64, 40),
    ) {
        // Its last beat was at 0. Others have looked all the time before.
        let mut watch = Watch::default();
        watch.look(at(0), seen(1, 8, RowState::Alive));
        let mut time = phase;
        let mut take = None;
        for way in ways {
            let state = if time >= 3_000 { RowState::Expired } else { RowState::Alive };
            if watch.look(at(time + way), seen(1, 9, state)) == Verdict::Take {
                take = Some(time + way);
                break;
            }
            time += way + u64::try_from(watch.pause(at(time + way)).as_millis()).unwrap();
        }
        // It expires at 3 s. A look is at most 100 ms later, and its way takes up to 30 ms.
        prop_assert!(take.is_some_and(|take| (3_000..3_160).contains(&take)), "{take:?}");
    }
}
