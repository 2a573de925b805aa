//! Worlds with a gateway: some dozens must hold; `make sim` runs a thousand.

use r6_world::fault::{CLASSES, Class, PROMISES, Promise};
use r6_world::plan::Plan;
use r6_world::record::Tally;
use r6_world::report;
use r6_world::world::{self, Outcome};

/// The classes that worlds with a gateway have. T1 and T2 are not counted there.
const FELT: [Class; 15] = {
    use Class::{C4, G1, G5, G6, G10, G13, P10, S1, S4, S5, T3, T4, T5, T7, T8};
    [G1, G5, G6, G10, G13, S1, S4, S5, T3, T4, T5, T7, T8, C4, P10]
};

/// Worlds that see breaks of `breaks.toml` which the first ones do not see: in 38 and 49 a command is not
/// acknowledged while its lease goes on, in 59 several robots are stopped at once. And worlds in which
/// something was mended: in 117 a robot is stopped while the disk is full, in 445 a person starts an arm
/// that is just being stopped, in 677 an admin takes a lease that the disk does not have yet.
const SEE: [u64; 6] = [38, 49, 59, 117, 445, 677];

fn run(seed: u64) -> Outcome {
    world::catch_panics();
    world::run_plan(Plan::with_gateway(seed), false)
}

fn hold(seeds: impl IntoIterator<Item = u64>) -> Tally {
    let mut tally = Tally::default();
    for seed in seeds {
        let outcome = run(seed);
        let failure = report::failure(&outcome);
        assert!(failure.is_none(), "{}", failure.unwrap_or_default());
        tally.add(&outcome.tally);
    }
    tally
}

#[test]
fn worlds_with_a_gateway_hold_and_every_fault_of_them_is_felt() {
    let tally = hold(1..=24);
    let unfelt = FELT.iter().filter(|class| tally.faults[class.index()].strikes == 0);
    assert_eq!(unfelt.collect::<Vec<_>>(), Vec::<&Class>::new(), "of {}", CLASSES.len());
    use Promise::{I4, I5, I6, I7, I8, I10, I12, Meant, Once, Recovery};
    let promises = [I4, I5, I6, I7, I8, I10, I12, Meant, Once, Recovery];
    let unseen = promises.iter().filter(|promise| tally.checks[promise.index()] < 20);
    assert_eq!(unseen.collect::<Vec<_>>(), Vec::<&Promise>::new(), "of {}", PROMISES.len());
}

#[test]
fn worlds_with_a_gateway_that_see_a_break_hold() {
    hold(SEE);
}

/// The same seed gives the same bytes on every wire, the same answers and the same log.
#[test]
fn a_seed_of_a_gateway_says_everything() {
    for seed in [1, 2, 3, 4] {
        let (one, again) = (run(seed), run(seed));
        assert_eq!(one.sum, again.sum, "seed {seed}");
    }
    assert_ne!(run(1).sum, run(2).sum);
}
