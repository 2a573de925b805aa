//! A thousand calls, many of which are cancelled at random.

use std::time::Duration;

use r6_client::callback::Call;
use r6_client::{Address, Command, RequestError, Robot};
use r6_testkit::hostile::{Character, Kind};
use tokio::sync::oneshot;

use crate::world::World;

const CALLS: usize = 1000;

/// The maximum number of calls at the same time.
const AT_ONCE: usize = 40;

/// The addresses queried, and the values that must come back: the position of the arm.
const ASKED: [(&str, f64); 6] = [
    ("world-0", 500.0),
    ("world-1", 0.0),
    ("world-2", 800.0),
    ("axis-0", 0.0),
    ("axis-3", 0.0),
    ("world-5", 0.0),
];

/// A number generator with a fixed sequence (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        usize::try_from((mixed ^ (mixed >> 31)) % limit as u64).unwrap()
    }
}

type Answer = Result<Vec<Option<f64>>, RequestError>;

struct Waiting {
    call: Call,
    told: oneshot::Receiver<Answer>,
    expected: Vec<Option<f64>>,
}

fn ask(world: &World, robot: &Robot, numbers: &mut Numbers) -> Waiting {
    let robot = robot.clone();
    if numbers.below(4) == 0 {
        let (call, told) =
            world.begin(async move { robot.command(Command::ClearAlarm).await.map(|_accepted| vec![]) });
        return Waiting { call, told, expected: vec![] };
    }
    let asked: Vec<_> = (0..=numbers.below(4)).map(|_| ASKED[numbers.below(ASKED.len())]).collect();
    let expected = asked.iter().map(|(_, value)| Some(*value)).collect();
    let addresses: Vec<_> = asked.iter().map(|(name, _)| Address::parse(name).unwrap()).collect();
    let (call, told) = world.begin(async move {
        let result = robot.query(&addresses).await?;
        Ok(addresses.iter().map(|address| result.decimal(*address)).collect())
    });
    Waiting { call, told, expected }
}

fn judge(told: Answer, expected: &[Option<f64>], seed: u64) {
    match told {
        Ok(values) => assert_eq!(values, expected, "seed {seed}"),
        Err(error) => panic!("seed {seed}: {error}"),
    }
}

fn run(seed: u64) {
    let (mut world, robot) = World::new(Character::default());
    let asked = robot.clone();
    world.call(async move { asked.status().await }).unwrap();
    let mut numbers = Numbers(seed);
    let mut waiting: Vec<Waiting> = Vec::new();
    let (mut begun, mut cancelled, mut answered) = (0, 0, 0);
    while begun < CALLS || !waiting.is_empty() {
        if begun < CALLS && waiting.len() < AT_ONCE && numbers.below(2) == 0 {
            waiting.push(ask(&world, &robot, &mut numbers));
            begun += 1;
        }
        if !waiting.is_empty() && numbers.below(4) == 0 {
            let given_up = waiting.swap_remove(numbers.below(waiting.len()));
            given_up.call.cancel();
            cancelled += 1;
        }
        if numbers.below(8) == 0 {
            // For a while the link accepts only a few bytes at a time.
            world.line().own().room = [1, 5, 100, usize::MAX][numbers.below(4)];
        }
        if begun == CALLS {
            world.line().own().room = usize::MAX;
        }
        world.turn();
        let mut at = 0;
        while at < waiting.len() {
            match waiting[at].told.try_recv() {
                Ok(told) => {
                    judge(told, &waiting.swap_remove(at).expected, seed);
                    answered += 1;
                }
                Err(oneshot::error::TryRecvError::Empty) => at += 1,
                Err(oneshot::error::TryRecvError::Closed) => panic!("seed {seed}: a call was given up"),
            }
        }
    }
    assert_eq!(cancelled + answered, CALLS, "seed {seed}");
    assert!(cancelled > 100 && answered > 100, "seed {seed}: {cancelled} cancelled, {answered} answered");
    // A call that was cancelled after it was sent is answered too, and the next call gets its own answer.
    world.pass(Duration::from_millis(100));
    let last = ask(&world, &robot, &mut numbers);
    judge(world.end(last.told), &last.expected, seed);
    let quality = robot.link_quality();
    assert_eq!((quality.timeouts, quality.reconnects), (0, 0), "seed {seed}");
    for kind in [Kind::Query, Kind::Command] {
        assert!(world.arrived(kind).iter().all(|entry| entry.answered.is_some()), "seed {seed}");
    }
}

#[test]
fn what_is_cancelled_at_random_leaves_the_others_their_own_answers() {
    for seed in 0..8 {
        run(seed);
    }
}
