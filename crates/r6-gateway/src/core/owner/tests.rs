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

/// The number of the gateway that looks.
const ME: u64 = 9;

static NO_RIVALS: BTreeMap<Owned, Vec<Owned>> = BTreeMap::new();

fn robot(name: &str) -> Owned {
    Owned::Robot(RobotName::new(name).unwrap())
}

fn robots(count: usize) -> BTreeSet<Owned> {
    (0..count).map(|number| robot(&format!("r{number:02}"))).collect()
}

/// The gateway that looks lives, and has nothing. Gateway 1 had `press`.
fn seen(fence: u64, beat: u64, life: Life) -> Seen {
    let me = SeenGateway { beat: 1, life: Life::Alive };
    Seen {
        gateways: [(1, SeenGateway { beat, life }), (ME, me)].into(),
        owners: [(robot("press"), SeenOwner { fence, gateway: Some(1) })].into(),
    }
}

fn look(watch: &mut Watch, now: Instant, seen: &Seen, known: &BTreeSet<Owned>) -> Verdict {
    let none = BTreeSet::new();
    watch.look(now, seen, Own { number: ME, known, held: &none, shunned: &none, rivals: &NO_RIVALS })
}

/// Whether `press` is taken.
fn takes(watch: &mut Watch, now: Instant, seen: &Seen) -> bool {
    let press = BTreeSet::from([robot("press")]);
    look(watch, now, seen, &press) == Verdict::Take(vec![robot("press")])
}

#[test]
fn robots_are_taken_when_they_are_free_or_after_the_same_beat_for_long() {
    let mut watch = Watch::default();
    assert!(!takes(&mut watch, START, &seen(1, 5, Life::Alive)));
    // The store's clock was set.
    assert!(!takes(&mut watch, at(500), &seen(1, 5, Life::Expired)));
    assert!(!takes(&mut watch, at(1_000), &seen(1, 6, Life::Expired)), "it lives");
    assert!(!takes(&mut watch, at(3_499), &seen(1, 6, Life::Expired)));
    assert!(takes(&mut watch, at(3_500), &seen(1, 6, Life::Expired)));
    assert!(takes(&mut watch, at(3_501), &seen(1, 7, Life::Ended)));
    // It was set back.
    let mut back = Watch::default();
    assert!(!takes(&mut back, at(0), &seen(1, 5, Life::Ahead)));
    assert!(!takes(&mut back, at(2_000), &seen(1, 6, Life::Ahead)), "it lives");
    assert!(!takes(&mut back, at(4_499), &seen(1, 6, Life::Ahead)));
    assert!(takes(&mut back, at(4_500), &seen(1, 6, Life::Ahead)), "it does not");
    assert!(!takes(&mut watch, at(9_000), &seen(1, 7, Life::Alive)));
    let mut free = seen(1, 7, Life::Alive);
    free.owners.insert(robot("press"), SeenOwner { fence: 1, gateway: None });
    assert!(!takes(&mut watch, at(9_001), &free), "it was given back, and the other gateway has no more");
    assert!(takes(&mut watch, at(10_001), &free), "which does not take it");
    free.owners.clear();
    free.gateways.remove(&1);
    assert!(takes(&mut Watch::default(), START, &free), "no gateway had it yet");
}

#[test]
fn a_gateway_whose_own_beats_are_late_takes_nothing() {
    let mut late = seen(1, 5, Life::Ended);
    late.gateways.insert(ME, SeenGateway { beat: 1, life: Life::Expired });
    assert!(!takes(&mut Watch::default(), START, &late));
    late.gateways.remove(&ME);
    assert!(!takes(&mut Watch::default(), START, &late));
}

#[test]
fn what_a_gateway_had_and_let_go_of_it_takes_anew() {
    let mut own = seen(4, 5, Life::Alive);
    own.owners.insert(robot("press"), SeenOwner { fence: 4, gateway: Some(ME) });
    let known = BTreeSet::from([robot("press")]);
    let none = BTreeSet::new();
    let mut watch = Watch::default();
    let held = Own { number: ME, known: &known, held: &known, shunned: &none, rivals: &NO_RIVALS };
    assert_eq!(watch.look(START, &own, held), Verdict::Take(Vec::new()), "it has it, or lets go of it still");
    assert!(takes(&mut watch, at(1), &own));
    let shunned = Own { held: &none, shunned: &known, ..held };
    assert_eq!(watch.look(at(2), &own, shunned), Verdict::Take(Vec::new()));
}

#[test]
fn an_old_copy_of_the_store_gives_nothing_to_anybody() {
    let mut watch = Watch::default();
    watch.had(&Claim { of: robot("press"), fence: 9 });
    let behind = Verdict::Behind { of: robot("press"), highest: 9 };
    let all = BTreeSet::from([robot("press"), robot("saw")]);
    assert_eq!(look(&mut watch, START, &seen(8, 5, Life::Ended), &all), behind, "the other robot neither");
    let mut without = seen(9, 5, Life::Ended);
    without.owners.clear();
    assert_eq!(look(&mut watch, START, &without, &all), behind, "it is from before the robot was owned");
    let taken = Verdict::Take(vec![robot("press"), robot("saw")]);
    assert_eq!(look(&mut watch, START, &seen(9, 5, Life::Ended), &all), taken);
}

#[test]
fn free_robots_go_to_the_gateways_that_have_the_fewest() {
    let known = robots(7);
    let alive = SeenGateway { beat: 1, life: Life::Alive };
    let mut seen = Seen { gateways: [(3, alive), (ME, alive)].into(), ..Seen::default() };
    let owner = |gateway| SeenOwner { fence: 1, gateway };
    // Gateway 3 has one, and a gateway that was killed had the rest.
    seen.owners.insert(robot("r00"), owner(Some(3)));
    let none = BTreeSet::new();
    let held = BTreeSet::from([robot("r00")]);
    let share = |seen: &Seen, number| {
        let held = if number == 3 { &held } else { &none };
        let own = Own { number, known: &known, held, shunned: &none, rivals: &NO_RIVALS };
        let Verdict::Take(taken) = Watch::default().look(START, seen, own) else { panic!() };
        taken
    };
    let (three, nine) = (share(&seen, 3), share(&seen, ME));
    assert_eq!(nine, [robot("r01"), robot("r03"), robot("r05")]);
    assert_eq!(three, [robot("r02"), robot("r04"), robot("r06")], "each goes to one of them");

    // Gateway 3 takes none: it is frozen, or does not know them.
    let mut watch = Watch::default();
    let own = Own { number: ME, known: &known, held: &none, shunned: &none, rivals: &NO_RIVALS };
    watch.look(START, &seen, own);
    assert_eq!(watch.pause(START), LOOK_CLOSELY, "until each has an owner");
    seen.owners.extend(nine.iter().map(|robot| (robot.clone(), owner(Some(ME)))));
    let held: BTreeSet<_> = nine.into_iter().collect();
    let own = Own { held: &held, ..own };
    assert_eq!(watch.look(at(999), &seen, own), Verdict::Take(Vec::new()));
    assert_eq!(watch.look(at(1_000), &seen, own), Verdict::Take(three));
}

#[test]
fn a_gateway_gives_robots_to_one_that_has_two_less_and_has_lived_for_a_while() {
    let known = robots(6);
    let alive = SeenGateway { beat: 1, life: Life::Alive };
    let owner = |gateway| SeenOwner { fence: 1, gateway: Some(gateway) };
    let mut seen = Seen { gateways: [(ME, alive)].into(), ..Seen::default() };
    seen.owners.extend(known.iter().map(|robot| (robot.clone(), owner(ME))));
    seen.owners.insert(Owned::Hall, owner(ME));
    let mut watch = Watch::default();
    let mut surplus = |time, seen: &Seen| {
        let none = BTreeSet::new();
        watch.look(
            at(time),
            seen,
            Own { number: ME, known: &known, held: &known, shunned: &none, rivals: &NO_RIVALS },
        );
        watch.surplus(at(time), seen, ME)
    };
    assert_eq!(surplus(0, &seen), 0, "there is no other");
    seen.gateways.insert(3, alive);
    assert_eq!(surplus(500, &seen), 0);
    assert_eq!(surplus(5_499, &seen), 0);
    assert_eq!(surplus(5_500, &seen), 3, "the hall does not count");
    seen.gateways.insert(3, SeenGateway { beat: 2, life: Life::Expired });
    assert_eq!(surplus(6_000, &seen), 0);
    seen.gateways.insert(3, SeenGateway { beat: 3, life: Life::Alive });
    assert_eq!(surplus(6_500, &seen), 0, "it begins anew");
    assert_eq!(surplus(11_500, &seen), 3);
    seen.owners.extend(known.iter().take(2).map(|robot| (robot.clone(), owner(3))));
    assert_eq!(surplus(12_000, &seen), 1);
    seen.owners.insert(robot("r02"), owner(3));
    assert_eq!(surplus(12_500, &seen), 0);
    seen.owners.extend(known.iter().map(|robot| (robot.clone(), owner(ME))));
    seen.gateways.insert(3, SeenGateway { beat: 4, life: Life::Alive });
    seen.owners.insert(robot("r05"), SeenOwner { fence: 1, gateway: None });
    let none = BTreeSet::new();
    let own = Own { number: ME, known: &known, held: &none, shunned: &known, rivals: &NO_RIVALS };
    watch.look(at(13_000), &seen, own);
    assert_eq!(watch.surplus(at(13_000), &seen, ME), 0, "what has no owner comes first");
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
            let life = if is_old { Life::Expired } else { Life::Alive };
            let answered = asked + back;
            if takes(&mut watch, at(answered), &seen(1, beat as u64, life)) {
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
        takes(&mut watch, at(0), &seen(1, 8, Life::Alive));
        let mut time = phase;
        let mut take = None;
        for way in ways {
            let life = if time >= 3_000 { Life::Expired } else { Life::Alive };
            if takes(&mut watch, at(time + way), &seen(1, 9, life)) {
                take = Some(time + way);
                break;
            }
            time += way + u64::try_from(watch.pause(at(time + way)).as_millis()).unwrap();
        }
        // It expires at 3 s. A look is at most 100 ms later, and its way takes up to 30 ms.
        prop_assert!(take.is_some_and(|take| (3_000..3_160).contains(&take)), "{take:?}");
    }
}

#[test]
fn an_arm_with_another_name_is_free_once_nobody_has_it_under_the_last() {
    let (known, none): (BTreeSet<_>, _) = ([robot("new")].into(), BTreeSet::new());
    let rivals: BTreeMap<_, _> = [(robot("new"), vec![robot("press")])].into();
    let own = Own { number: ME, known: &known, held: &none, shunned: &none, rivals: &rivals };
    let mut watch = Watch::default();
    let take = Verdict::Take(vec![robot("new")]);
    assert_eq!(watch.look(at(0), &seen(1, 1, Life::Alive), own), Verdict::Take(Vec::new()));
    assert_eq!(watch.look(at(500), &seen(1, 1, Life::Expired), own), Verdict::Take(Vec::new()));
    assert_eq!(watch.look(at(3_000), &seen(1, 1, Life::Expired), own), take, "it was silent for long enough");
    assert_eq!(watch.look(at(3_500), &seen(1, 1, Life::Ended), own), take);
    let held: BTreeSet<_> = [robot("press")].into();
    let ending = Own { held: &held, ..own };
    assert_eq!(
        watch.look(at(4_000), &seen(1, 1, Life::Ended), ending),
        Verdict::Take(Vec::new()),
        "it lets go of it"
    );
}
