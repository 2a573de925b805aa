//! Which gateway owns the robots of a store: the times of it, without I/O.
//!
//! The owner writes a beat each [`BEAT`] into the store, and counts from the *start* of its last good one, on
//! a clock that goes on while the machine sleeps: no new move after [`NO_MOVES`], our lists are stopped at
//! [`STOP_LISTS`], the connections are closed at [`CLOSE`]. Another gateway looks each [`LOOK`], more often
//! while beats are missing. It takes the robots at [`EXPIRES`] by the store's clock, if it has seen the same
//! beat for [`WATCHED`] by its own: then a clock of the store that is set cannot take robots from an owner
//! that lives. A fence that only grows tells one owner from the next.

use std::time::Duration;

use r6_proto::time::Instant;

/// How often the owner says that it lives.
pub const BEAT: Duration = Duration::from_millis(500);

/// After this time without a good beat, the owner permits no command and no list any more.
pub const NO_MOVES: Duration = Duration::from_millis(1_000);

/// After this time it stops the lists that it feeds.
pub const STOP_LISTS: Duration = Duration::from_millis(1_500);

/// After this time it has no connection to a robot any more.
pub const CLOSE: Duration = Duration::from_millis(2_000);

/// After this time by the store's clock another gateway may take the robots.
pub const EXPIRES: Duration = Duration::from_millis(3_000);

/// For how long another gateway has to have seen the same beat, by its own clock.
pub const WATCHED: Duration = Duration::from_millis(2_500);

/// How often others look.
pub const LOOK: Duration = Duration::from_millis(500);

/// After this time with the same beat, by the clock of the gateway that looks, beats are missing.
pub const MISSING: Duration = Duration::from_millis(1_500);

/// How often others look while beats are missing: the robots are without a gateway until one of them takes
/// them.
pub const LOOK_CLOSELY: Duration = Duration::from_millis(100);

/// What the owner may do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Everything.
    Owns,
    /// Nothing that changes or moves; stops.
    NoMoves,
    /// It stops its lists, and ends.
    StopLists,
    /// Nothing: another gateway may have the robots.
    Over,
}

/// The time of one owner, from its first beat to its last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reign {
    good: Instant,
    is_over: bool,
}

impl Reign {
    /// The store gave the robots to this gateway. It was asked at this time.
    #[must_use]
    pub fn begin(asked: Instant) -> Self {
        Self { good: asked, is_over: false }
    }

    /// The store took the beat that was sent at `sent`. The answer came now. An answer that comes after the
    /// end brings nothing back: others may have seen the end.
    pub fn beaten(&mut self, sent: Instant, now: Instant) {
        if self.phase(now) < Phase::StopLists {
            self.good = self.good.max(sent);
        } else {
            self.is_over = true;
        }
    }

    /// The store has another fence: another gateway has the robots, or an old copy of the store answers.
    pub fn refused(&mut self) {
        self.is_over = true;
    }

    /// What the owner may do now.
    #[must_use]
    pub fn phase(&self, now: Instant) -> Phase {
        let age = now.since(self.good);
        if self.is_over || age >= CLOSE {
            Phase::Over
        } else if age >= STOP_LISTS {
            Phase::StopLists
        } else if age >= NO_MOVES {
            Phase::NoMoves
        } else {
            Phase::Owns
        }
    }

    /// For how long this phase lasts at least, if no beat comes.
    #[must_use]
    pub fn left(&self, now: Instant) -> Option<Duration> {
        let end = match self.phase(now) {
            Phase::Owns => NO_MOVES,
            Phase::NoMoves => STOP_LISTS,
            Phase::StopLists => CLOSE,
            Phase::Over => return None,
        };
        Some((self.good + end).since(now))
    }
}

/// What the row of the owner says, by the store's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowState {
    /// The last owner gave the robots back, or there was none.
    Free,
    /// Its last beat is younger than [`EXPIRES`].
    Alive,
    /// It is not.
    Expired,
}

/// The row as it was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// The fence of the owner.
    pub fence: u64,
    /// The number of its last beat.
    pub beat: u64,
    /// What the store says of its time.
    pub state: RowState,
}

/// What a gateway that owns nothing does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It looks again.
    Wait,
    /// It takes the robots, if the row is still the same.
    Take,
    /// The store has a lower fence than before: an old copy of it answers. Nothing is taken.
    Behind {
        /// The highest fence that was seen.
        highest: u64,
    },
}

/// What a gateway that owns nothing has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watch {
    highest: u64,
    /// The last beat that was seen, and since when.
    beat: Option<(u64, u64, Instant)>,
}

impl Watch {
    /// This gateway had this fence itself.
    pub fn had(&mut self, fence: u64) {
        self.highest = self.highest.max(fence);
        self.beat = None;
    }

    /// How long to wait before the next look.
    #[must_use]
    pub fn pause(&self, now: Instant) -> Duration {
        match self.beat {
            Some((_, _, since)) if now.since(since) >= MISSING => LOOK_CLOSELY,
            _ => LOOK,
        }
    }

    /// The row was seen. `now` is when the answer came, so that no beat seems to be known for longer than it
    /// is.
    pub fn look(&mut self, now: Instant, seen: Seen) -> Verdict {
        if seen.fence < self.highest {
            return Verdict::Behind { highest: self.highest };
        }
        self.highest = seen.fence;
        let since = match self.beat {
            Some((fence, beat, since)) if (fence, beat) == (seen.fence, seen.beat) => since,
            _ => now,
        };
        self.beat = Some((seen.fence, seen.beat, since));
        match seen.state {
            RowState::Free => Verdict::Take,
            RowState::Expired if now.since(since) >= WATCHED => Verdict::Take,
            RowState::Expired | RowState::Alive => Verdict::Wait,
        }
    }
}

#[cfg(test)]
mod tests;
