//! Worlds with a single fault that deceives a statement about an arm. Each is stored as a plan: the class and
//! the seed determine everything.

use r6_world::fault::{CLASSES, Class, PROMISES, Promise};
use r6_world::plan::{Plan, TRAPS};
use r6_world::record::Tally;
use r6_world::report;
use r6_world::world::{self, Outcome};

/// Plans that must hold.
const HOLD: [(Class, u64); 47] = {
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
        // The following plans broke a promise with an earlier client.
        //
        // Stopped: two reads of an arm that stood for a while counted as proof of a standstill.
        (E1, 1),
        (E1, 3),
        (E1, 14),
        (E1, 21),
        // Soon: the stop waited for the timeouts of the deaf connection.
        (E3, 3),
        (E3, 4),
        // Fresh: values of an ended connection stayed fresh.
        (E3, 9),
        (E3, 16),
        // Stopped: the controller took a list after the stop had read an empty list.
        (E4, 1),
        (E4, 2),
        (E4, 3),
        // Whole, by an earlier check: the list was cleared when the arm had almost reached its target.
        (E5, 16),
        (E5, 17),
        // Gapless: another client cleared the list, this one appended to it, and the cleared steps counted as
        // executed. 43 breaks it if `PathProgress` trusts every length of the list (`make breaks`); the
        // others broke it with an earlier client.
        (E5, 37),
        (E5, 43),
        (E5, 88),
        (E5, 243),
        (E5, 294),
        (E5, 359),
        // Fresh, Meant, Whole: the client took another robot for its own.
        (E6, 2),
        (E6, 5),
        (E6, 4),
        (E6, 7),
        (E6, 12),
        // Owned: the rest of a motion without an owner was never sent.
        (E7, 1),
        (E7, 9),
        (E8, 1),
        (E8, 9),
        // Whole: accepted steps counted as executed.
        (P10, 1),
        (P10, 4),
    ]
};

fn run(class: Class, seed: u64) -> Outcome {
    world::catch_panics();
    world::run_plan(Plan::trapped(class, seed), false)
}

#[test]
fn plans_that_hold_hold() {
    for (class, seed) in HOLD {
        let outcome = run(class, seed);
        let failure = report::failure(&outcome);
        assert!(failure.is_none(), "{}", failure.unwrap_or_default());
    }
}

#[test]
fn each_trap_is_felt_and_each_statement_is_looked_at() {
    let mut tally = Tally::default();
    for (class, seed) in HOLD {
        tally.add(&run(class, seed).tally);
    }
    let unfelt = TRAPS.iter().filter(|class| tally.faults[class.index()].strikes == 0);
    assert_eq!(unfelt.collect::<Vec<_>>(), Vec::<&Class>::new(), "of {}", CLASSES.len());
    use Promise::{Fresh, Gapless, Meant, Owned, Soon, Stopped, Whole};
    let statements = [Stopped, Whole, Gapless, Fresh, Meant, Owned, Soon];
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
