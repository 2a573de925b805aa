//! How fast the arm works through its list, and whether it can have made all the steps that are gone from it.
//!
//! The length of a list tells how many steps wait, not which. Between two looks another client may clear the list, and this one may append
//! to it before it looks again. Then the list is as short as if the arm had made the steps that were cleared. It cannot have made them in
//! that time, unless it was many times as fast as it ever was.

use std::time::Duration;

use tokio::time::Instant;

use super::progress::Looked;

/// A speed is believed up to this many times the fastest that was seen: the speed of the steps, and the speed of the whole machine, may
/// change in between (fitted to `make sim TRAP=E5`).
const FASTER: f64 = 4.0;

/// What is always believed in a second: an arm that was seen at a crawl may go on at a usual speed. Degrees, mm, moves.
const ALWAYS: Way = Way { turn: 100.0, tool: 1000.0, moves: 20.0 };

/// The pace is known once the arm was seen to go on so many times, and its list to get shorter step by step: before, it may just have begun
/// to move. A virtual controller whose clock jumps is never seen to do that.
const LOOKS: u32 = 5;

/// Less than this, degrees or mm, is no motion: encoders tremble.
const TREMBLING: f64 = 0.01;

/// Two looks are not taken to be closer than this.
const SHORTEST: Duration = Duration::from_millis(1);

/// The way of some steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Way {
    /// The largest turn of an axis in each step, summed, degrees.
    pub turn: f64,
    /// The way of the tool, mm.
    pub tool: f64,
    /// Moves whose length is not known.
    pub moves: f64,
}

impl Way {
    /// Both ways, one after the other.
    pub fn and(&self, other: &Self) -> Self {
        Self { turn: self.turn + other.turn, tool: self.tool + other.tool, moves: self.moves + other.moves }
    }

    /// What both have at least.
    pub fn least(&self, other: &Self) -> Self {
        Self {
            turn: self.turn.min(other.turn),
            tool: self.tool.min(other.tool),
            moves: self.moves.min(other.moves),
        }
    }
}

/// How fast the arm was seen to go.
#[derive(Debug)]
pub(super) struct Pace {
    looked: Looked,
    /// The most in a second.
    fastest: Way,
    /// How many looks saw it go on.
    looks: u32,
    /// Whether the list was seen to get shorter, and not at once empty.
    stepwise: bool,
}

impl Pace {
    /// Nothing was seen yet; the first list leaves now.
    pub fn new(now: Instant) -> Self {
        Self {
            looked: Looked { asked_at: now, answered_at: now },
            fastest: Way::default(),
            looks: 0,
            stepwise: false,
        }
    }

    /// Whether the arm can have gone this way between the last look and this one.
    pub fn allows(&self, way: &Way, now: Looked) -> bool {
        // The two are at most this far apart.
        let seconds = (now.answered_at - self.looked.asked_at).as_secs_f64();
        let fits = |way: f64, seen: f64, always: f64| way <= seconds * (seen * FASTER).max(always);
        fits(way.turn, self.fastest.turn, ALWAYS.turn)
            && fits(way.tool, self.fastest.tool, ALWAYS.tool)
            && fits(way.moves, self.fastest.moves, ALWAYS.moves)
    }

    /// Whether the arm was seen to go on often enough.
    pub fn is_known(&self) -> bool {
        self.looks >= LOOKS && self.stepwise
    }

    /// The list was seen to get shorter, and steps are left of what was in it before.
    pub fn goes_stepwise(&mut self) {
        self.stepwise = true;
    }

    /// The arm went this way between the last look and this one.
    pub fn went(&mut self, way: &Way, now: Looked) {
        let seconds = (now.answered_at - self.looked.answered_at).max(SHORTEST).as_secs_f64();
        let faster = |seen: f64, way: f64| seen.max(way / seconds);
        self.fastest = Way {
            turn: faster(self.fastest.turn, way.turn),
            tool: faster(self.fastest.tool, way.tool),
            moves: faster(self.fastest.moves, way.moves),
        };
        let goes_on = way.turn.max(way.tool).max(way.moves) > TREMBLING;
        self.looks = self.looks.saturating_add(u32::from(goes_on));
        self.looked = now;
    }
}
