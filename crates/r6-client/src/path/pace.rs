//! How fast the arm works through its list, and whether it can have made all the steps that are gone from the
//! list.
//!
//! The length of a list tells how many steps wait, but not which ones. Between two looks another client may
//! clear the list, and this client may append to it before it looks again. Then the list is as short as if
//! the arm had made the cleared steps. The client does not believe this if the arm would have had to be
//! several times as fast as it was ever seen to be.

use std::time::Duration;

use r6_proto::time::Instant;

/// A pace is believed up to this many times the fastest pace seen, because axes differ and the global speed
/// may change in between. Chosen; `make sim TRAP=E5` and the tests of `path_streaming/honest.rs` hold it from
/// both sides.
const FASTER: f64 = 5.0;

/// The same factor for steps that lead back and forth, where the position of the arm proves nothing.
const NEARLY: f64 = 1.5;

/// What an arm of unknown pace may at most have made in a second: degrees, mm and moves. Chosen: it is far
/// more than steps at usual speeds need, so that nothing is reported too soon.
const POSSIBLE: [f64; 3] = [450.0, 4000.0, 20.0];

/// How much the clocks may differ in one look, seconds.
const CLOCKS: f64 = 0.2;

/// The pace counts as known after this many looks that saw the arm move. One of them must also have seen the
/// list get shorter without becoming empty. Before that the arm may have just begun to move.
const LOOKS: u32 = 3;

/// A smaller change than this, degrees or mm, is not motion, because encoders tremble.
const TREMBLING: f64 = 0.01;

/// The minimum time assumed between two looks.
const SHORTEST: Duration = Duration::from_millis(1);

/// When the values of one look were requested, and when the reply came.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Looked {
    pub asked_at: Instant,
    pub answered_at: Instant,
}

/// The path length of some steps, in several measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Way {
    /// The largest turn of an axis in each step, summed over the steps, degrees.
    pub turn: f64,
    /// The path length of the tool, mm.
    pub tool: f64,
    /// The number of moves of unknown length.
    pub moves: f64,
    /// The turn, with each step divided by its speed (1 at 100 %), so that slow and fast steps count the
    /// same.
    pub turn_at_full: f64,
    /// The path length of the tool, weighted likewise.
    pub tool_at_full: f64,
    /// The time of the waits that depend on time only, seconds.
    pub standing: f64,
}

impl Way {
    /// Creates the path of one turn of an axis at this share of its speed.
    pub fn of_turn(turn: f64, speed: f64) -> Self {
        Self { turn, turn_at_full: turn / speed, ..Self::default() }
    }

    /// Creates the path of one tool move at this share of its speed.
    pub fn of_tool(tool: f64, speed: f64) -> Self {
        Self { tool, tool_at_full: tool / speed, ..Self::default() }
    }

    /// Creates the path of a move of unknown length.
    pub fn of_a_move() -> Self {
        Self { moves: 1.0, ..Self::default() }
    }

    /// Adds two paths that follow each other.
    pub fn and(&self, other: &Self) -> Self {
        self.each(other, |one, other| one + other)
    }

    /// Takes the larger value of both, measure by measure.
    pub fn most(&self, other: &Self) -> Self {
        self.each(other, f64::max)
    }

    fn times(&self, factor: f64) -> Self {
        self.each(self, |one, _| one * factor)
    }

    fn each(&self, other: &Self, both: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            turn: both(self.turn, other.turn),
            tool: both(self.tool, other.tool),
            moves: both(self.moves, other.moves),
            turn_at_full: both(self.turn_at_full, other.turn_at_full),
            tool_at_full: both(self.tool_at_full, other.tool_at_full),
            standing: both(self.standing, other.standing),
        }
    }
}

/// The pace of the arm, as seen so far.
#[derive(Debug)]
pub(super) struct Pace {
    looked: Looked,
    /// The most that was seen per second.
    fastest: Way,
    /// How many looks saw the arm move.
    looks: u32,
    /// Whether the list was seen to get shorter without becoming empty at once.
    stepwise: bool,
}

impl Pace {
    /// Starts when the first list is sent and nothing was seen yet.
    pub fn new(now: Instant) -> Self {
        Self {
            looked: Looked { asked_at: now, answered_at: now },
            fastest: Way::default(),
            looks: 0,
            stepwise: false,
        }
    }

    /// Whether the arm can have made this path between the last look and this one. `to_and_fro`: the steps
    /// lead back and forth, so the position of the arm proves nothing.
    pub fn allows(&self, way: &Way, now: Looked, to_and_fro: bool) -> bool {
        let seconds = self.seconds(now);
        if self.is_known() {
            let most = self.fastest.times(seconds * if to_and_fro { NEARLY } else { FASTER });
            return way.turn_at_full <= most.turn_at_full
                && way.tool_at_full <= most.tool_at_full
                && way.moves <= most.moves;
        }
        let most = POSSIBLE.map(|most| most * seconds);
        [way.turn, way.tool, way.moves].iter().zip(most).all(|(way, most)| *way <= most)
    }

    /// Whether the waits among these steps can have taken as long as they say.
    pub fn allows_standing(&self, way: &Way, now: Looked) -> bool {
        way.standing <= self.seconds(now) + CLOCKS
    }

    /// The maximum time between the two looks, seconds.
    fn seconds(&self, now: Looked) -> f64 {
        (now.answered_at - self.looked.asked_at).as_secs_f64()
    }

    /// Whether the arm was seen to move often enough.
    pub fn is_known(&self) -> bool {
        self.looks >= LOOKS && self.stepwise
    }

    /// Notes that the list got shorter, while steps are left of those that were in it before.
    pub fn goes_stepwise(&mut self) {
        self.stepwise = true;
    }

    /// Notes that the arm made this path between the last look and this one.
    pub fn went(&mut self, way: &Way, now: Looked) {
        let seconds = (now.answered_at - self.looked.answered_at).max(SHORTEST).as_secs_f64();
        self.fastest = self.fastest.most(&way.times(1.0 / seconds));
        let goes_on = way.turn.max(way.tool).max(way.moves) > TREMBLING;
        self.looks = self.looks.saturating_add(u32::from(goes_on));
        self.looked = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A look that took no time, this many seconds after the first list was sent.
    fn look(seconds: u64) -> Looked {
        let at = Instant::ORIGIN + Duration::from_secs(seconds);
        Looked { asked_at: at, answered_at: at }
    }

    /// A turn of 10 degrees at full speed.
    fn turn() -> Way {
        Way::of_turn(10.0, 1.0)
    }

    /// An arm that turned 10 degrees per second during `looks` looks.
    fn seen(looks: u64, stepwise: bool) -> Pace {
        let mut pace = Pace::new(Instant::ORIGIN);
        (1..=looks).for_each(|second| pace.went(&turn(), look(second)));
        if stepwise {
            pace.goes_stepwise();
        }
        pace
    }

    #[test]
    fn the_way_of_a_tool_has_its_length_and_that_at_full_speed() {
        let way = Way::of_tool(10.0, 0.5);
        assert_eq!((way.tool, way.tool_at_full, way.turn, way.moves), (10.0, 20.0, 0.0, 0.0));
    }

    #[test]
    fn a_pace_is_known_after_three_looks_of_which_one_saw_the_list_get_shorter() {
        for (looks, stepwise, known) in
            [(0, true, false), (2, true, false), (3, false, false), (3, true, true)]
        {
            assert_eq!(seen(looks, stepwise).is_known(), known, "{looks} looks, stepwise {stepwise}");
        }
        let mut trembling = seen(2, true);
        trembling.went(&Way::of_turn(0.005, 1.0), look(3));
        assert!(!trembling.is_known());
    }

    #[test]
    fn a_known_pace_allows_five_times_as_much_and_an_unknown_one_what_is_possible() {
        let after =
            |pace: Pace, degrees, to_and_fro| pace.allows(&Way::of_turn(degrees, 1.0), look(4), to_and_fro);
        assert!(after(seen(3, true), 49.0, false) && !after(seen(3, true), 51.0, false));
        assert!(after(seen(3, true), 14.0, true) && !after(seen(3, true), 16.0, true));
        // The list was never seen to get shorter: the arm may have just begun to move.
        assert!(after(seen(3, false), 449.0, false) && !after(seen(3, false), 451.0, false));
    }
}
