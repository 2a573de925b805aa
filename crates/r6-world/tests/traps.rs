//! Worlds in which one thing goes wrong that deceives a statement about an arm. Each is kept as a plan: the class and the seed say everything.

use r6_world::fault::{CLASSES, Class, PROMISES, Promise};
use r6_world::plan::{Plan, TRAPS};
use r6_world::record::Tally;
use r6_world::report;
use r6_world::world::{self, Outcome};

/// Plans that break a promise with the client as it is. One that holds from now on moves to [`HOLD`].
const BROKEN: [(Class, u64, Promise); 24] = {
    use Class::*;
    use Promise::*;
    [
        // Two looks at an arm that stands for a moment are taken for a stop that had no effect: a taught program, a list.
        (E1, 1, Stopped),
        (E1, 3, Stopped),
        (E1, 14, Stopped),
        (E1, 21, Stopped),
        // A stop waits for the time-outs of the deaf connection; values of a connection that is gone stay fresh.
        (E3, 3, Soon),
        (E3, 4, Soon),
        (E3, 9, Fresh),
        (E3, 16, Fresh),
        // The list was empty when the stop looked, and what was in doubt is taken after it.
        (E4, 1, Stopped),
        (E4, 2, Stopped),
        (E4, 3, Stopped),
        // With a tool nothing shows where a step ends, and an empty list counts as one that was carried out.
        (E5, 16, Whole),
        (E5, 17, Whole),
        // The values, the stand and the end of another robot are taken for one's own.
        (E6, 2, Fresh),
        (E6, 5, Fresh),
        (E6, 4, Meant),
        (E6, 7, Meant),
        (E6, 12, Whole),
        // What had not left when its owner went never does, and nobody is told.
        (E7, 1, Owned),
        (E7, 9, Owned),
        (E8, 1, Owned),
        (E8, 9, Owned),
        // Accepted, never carried out, told as done.
        (P10, 1, Whole),
        (P10, 4, Whole),
    ]
};

/// Plans that hold.
const HOLD: [(Class, u64); 17] = {
    use Class::*;
    [
        (E1, 5),
        (E1, 7),
        (E2, 1),
        (E2, 2),
        (E2, 3),
        (E2, 4),
        (E2, 5),
        (E2, 6),
        (E3, 1),
        (E3, 2),
        (E4, 12),
        (E4, 15),
        (E5, 1),
        (E5, 2),
        (E6, 17),
        (E6, 19),
        (P10, 2),
    ]
};

fn run(class: Class, seed: u64) -> Outcome {
    world::catch_panics();
    world::run_plan(Plan::trapped(class, seed), false)
}

#[test]
fn plans_that_hold_hold() {
    for (class, seed) in HOLD {
        let failure = report::failure(&run(class, seed));
        assert!(failure.is_none(), "{}", failure.unwrap_or_default());
    }
}

/// A list of what is owed: whoever mends a promise sees here which plans it was broken in.
#[test]
fn plans_that_break_a_promise_break_this_one() {
    for (class, seed, promise) in BROKEN {
        let broken = run(class, seed).violation.map(|violation| violation.promise);
        assert_eq!(broken, Some(promise), "{class:?} {seed}: where it holds now, move it to HOLD");
    }
}

#[test]
fn each_trap_is_felt_and_each_statement_is_looked_at() {
    let mut tally = Tally::default();
    let all = BROKEN.map(|(class, seed, _)| (class, seed)).into_iter().chain(HOLD);
    for (class, seed) in all {
        tally.add(&run(class, seed).tally);
    }
    let unfelt = TRAPS.iter().filter(|class| tally.faults[class.index()].strikes == 0);
    assert_eq!(unfelt.collect::<Vec<_>>(), Vec::<&Class>::new(), "of {}", CLASSES.len());
    use Promise::{Fresh, Meant, Owned, Soon, Stopped, Whole};
    let statements = [Stopped, Whole, Fresh, Meant, Owned, Soon];
    let unseen = statements.iter().filter(|promise| tally.checks[promise.index()] == 0);
    assert_eq!(unseen.collect::<Vec<_>>(), Vec::<&Promise>::new(), "of {}", PROMISES.len());
}

/// The same plan gives the same bytes and the same log.
#[test]
fn a_trap_says_everything() {
    for class in TRAPS {
        let (one, again) = (run(class, 22), run(class, 22));
        assert_eq!(one.sum, again.sum, "{class:?}");
    }
}
