//! Which gateway owns which robot of a store: the times and the shares, without I/O.
//!
//! Each gateway writes a beat each [`BEAT`] into the store. With it, it learns what the store says that it
//! owns. For each of these robots it counts from the *start* of its last good beat, on a clock that goes on
//! while the machine sleeps: no new move after [`NO_MOVES`], our lists are stopped at [`STOP_LISTS`], the
//! connection is closed at [`CLOSE`] ([`Reign`]: one for each robot). Others look each [`LOOK`], more often
//! while beats are missing ([`Watch`]). They take the robots of a gateway at [`EXPIRES`] by the store's
//! clock, if they have seen the same beat for [`WATCHED`] by their own: then a clock of the store that is
//! set cannot take robots from an owner that lives. A fence for each robot, which only grows, tells one
//! owner from the next.
//!
//! A robot without an owner goes to the gateway that lives and has the fewest ([`Watch::look`]). A gateway
//! that has two more than another one gives robots at rest to it ([`Watch::surplus`]).

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::time::Duration;

use r6_proto::time::Instant;

use super::name::RobotName;

/// How often a gateway says that it lives.
pub const BEAT: Duration = Duration::from_millis(500);

/// After this time without a good beat, the owner permits no command and no list any more.
pub const NO_MOVES: Duration = Duration::from_millis(1_000);

/// After this time it stops the lists that it feeds.
pub const STOP_LISTS: Duration = Duration::from_millis(1_500);

/// After this time it has no connection to the robot any more.
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

/// For how long a robot without an owner is left to the gateway that has the fewest: that one may be frozen,
/// or may not know the robot. With [`EXPIRES`] and a look, a robot is taken within 4.2 s all the same.
pub const GRACE: Duration = Duration::from_millis(1_000);

/// A gateway is given robots of others once it has lived for so long: a gateway that comes and goes gets
/// nothing. It is longer than [`EXPIRES`], so that what has no owner is taken first.
pub const SETTLED: Duration = Duration::from_secs(5);

/// What one gateway owns at a time.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owned {
    /// What one gateway does for all: it signs the heads of the audit log, removes what is too old, changes
    /// the settings, and adds robots.
    Hall,
    /// A robot.
    Robot(RobotName),
}

impl Owned {
    /// How the store calls it: no robot has an empty name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        match self {
            Self::Hall => "",
            Self::Robot(name) => name.as_str(),
        }
    }

    /// What the store calls so.
    #[must_use]
    pub fn of_text(text: &str) -> Option<Self> {
        if text.is_empty() { Some(Self::Hall) } else { RobotName::new(text).map(Self::Robot) }
    }

    /// The robot, if it is one.
    #[must_use]
    pub fn robot(&self) -> Option<&RobotName> {
        match self {
            Self::Hall => None,
            Self::Robot(name) => Some(name),
        }
    }
}

impl fmt::Display for Owned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hall => f.write_str("the hall"),
            Self::Robot(name) => name.fmt(f),
        }
    }
}

/// What a gateway owns in one term. Each of its writes about it carries this.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Claim {
    /// What it owns.
    pub of: Owned,
    /// The fence of the term.
    pub fence: u64,
}

/// What the owner may do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Everything.
    Owns,
    /// Nothing that changes or moves; stops.
    NoMoves,
    /// It stops its lists, and ends.
    StopLists,
    /// Nothing: another gateway may have the robot.
    Over,
}

/// The time of one owner of one robot, from when it took it to its last beat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reign {
    good: Instant,
    is_over: bool,
}

impl Reign {
    /// The store gave the robot to this gateway. It was asked at this time.
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

    /// The store has another fence: another gateway has the robot, or an old copy of the store answers.
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

/// What the row of a gateway says, by the store's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// It ended in order, or its row is gone.
    Ended,
    /// Its last beat is younger than [`EXPIRES`].
    Alive,
    /// It is not.
    Expired,
    /// Its last beat is in the future: the clock was set back. Whether it lives, the next beats show.
    Ahead,
}

/// A gateway as it was seen in the store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeenGateway {
    /// The number of its last beat.
    pub beat: u64,
    /// What the store says of its time.
    pub life: Life,
}

/// The row of a robot as it was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeenOwner {
    /// The fence of the last owner.
    pub fence: u64,
    /// The owner; `None` if it gave the robot back.
    pub gateway: Option<u64>,
}

/// All rows of one moment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// The gateways, by their numbers.
    pub gateways: BTreeMap<u64, SeenGateway>,
    /// What has, or had, an owner.
    pub owners: BTreeMap<Owned, SeenOwner>,
}

impl Seen {
    fn life(&self, gateway: u64) -> Life {
        self.gateways.get(&gateway).map_or(Life::Ended, |seen| seen.life)
    }

    /// How many robots each gateway has that lives.
    fn counts(&self) -> BTreeMap<u64, usize> {
        let alive = self.gateways.iter().filter(|(_, seen)| seen.life == Life::Alive);
        let mut counts: BTreeMap<_, _> = alive.map(|(number, _)| (*number, 0)).collect();
        for (owned, owner) in &self.owners {
            if let (Owned::Robot(_), Some(gateway)) = (owned, owner.gateway)
                && let Some(count) = counts.get_mut(&gateway)
            {
                *count += 1;
            }
        }
        counts
    }
}

/// What a gateway is, knows and has, for its look at the rows.
#[derive(Clone, Copy, Debug)]
pub struct Own<'a> {
    /// Its number.
    pub number: u64,
    /// All that there is to own, as far as it knows. Gateways of one hall know the same.
    pub known: &'a BTreeSet<Owned>,
    /// What it owns now, and what it lets go of and has not done with.
    pub held: &'a BTreeSet<Owned>,
    /// What it leaves to others for now.
    pub shunned: &'a BTreeSet<Owned>,
    /// For what it knows, other names of the same arm.
    pub rivals: &'a BTreeMap<Owned, Vec<Owned>>,
}

/// What a gateway takes next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It takes these, if the rows are still the same; none, most of the time.
    Take(Vec<Owned>),
    /// The store has a lower fence than before: an old copy of it answers. Nothing is taken.
    Behind {
        /// What has the lower fence.
        of: Owned,
        /// The highest fence that was seen.
        highest: u64,
    },
}

/// What a gateway has seen of the others.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Watch {
    /// The highest fences. There is one for each robot that there ever was.
    highest: BTreeMap<Owned, u64>,
    gateways: BTreeMap<u64, Watched>,
    /// Since when something can be taken.
    free: BTreeMap<Owned, Instant>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Watched {
    /// The last beat that was seen, and since when.
    beat: u64,
    since: Instant,
    /// Since when it was alive at each look.
    alive: Option<Instant>,
    /// Whether it has something that this gateway knows.
    is_owner: bool,
}

impl Watch {
    /// This gateway had this claim itself.
    pub fn had(&mut self, claim: &Claim) {
        let highest = self.highest.entry(claim.of.clone()).or_default();
        *highest = claim.fence.max(*highest);
    }

    /// How long to wait before the next look.
    #[must_use]
    pub fn pause(&self, now: Instant) -> Duration {
        let is_missing = |seen: &Watched| seen.is_owner && now.since(seen.since) >= MISSING;
        if !self.free.is_empty() || self.gateways.values().any(is_missing) { LOOK_CLOSELY } else { LOOK }
    }

    /// The rows were seen. `now` is when the answer came, so that no beat seems to be known for longer than
    /// it is.
    pub fn look(&mut self, now: Instant, seen: &Seen, own: Own<'_>) -> Verdict {
        for (owned, owner) in &seen.owners {
            let highest = self.highest.entry(owned.clone()).or_default();
            if owner.fence < *highest {
                return Verdict::Behind { of: owned.clone(), highest: *highest };
            }
            *highest = owner.fence;
        }
        // No row ever goes.
        if let Some((of, highest)) = self.highest.iter().find(|(of, _)| !seen.owners.contains_key(*of)) {
            return Verdict::Behind { of: of.clone(), highest: *highest };
        }
        self.note_gateways(now, seen, own);
        let mut counts = seen.counts();
        let mut taken = Vec::new();
        let mut free = BTreeMap::new();
        for owned in own.known {
            let has_arm =
                |name: &Owned| own.held.contains(name) || !self.is_free(now, seen, own.number, name);
            // An arm has one name: it is taken under the next one when no gateway has it under the last.
            if has_arm(owned) || own.rivals.get(owned).is_some_and(|names| names.iter().any(has_arm)) {
                continue;
            }
            let since = self.free.get(owned).copied().unwrap_or(now);
            free.insert(owned.clone(), since);
            // Others see it as owned by this gateway, so they leave it alone.
            let was_own = seen.owners.get(owned).is_some_and(|owner| owner.gateway == Some(own.number));
            // All gateways that see the same rows come to the same one.
            let fewest = counts.iter().min_by_key(|(number, count)| (**count, **number));
            let fewest = fewest.map(|(number, _)| *number);
            if let (Some(fewest), Owned::Robot(_)) = (fewest, owned) {
                counts.entry(fewest).and_modify(|count| *count += 1);
            }
            let is_due = was_own || fewest == Some(own.number) || now.since(since) >= GRACE;
            if is_due && !own.shunned.contains(owned) {
                taken.push(owned.clone());
            }
        }
        self.free = free;
        // A gateway whose own beats are late takes nothing.
        let is_alive = seen.life(own.number) == Life::Alive;
        Verdict::Take(if is_alive { taken } else { Vec::new() })
    }

    /// How many robots this gateway gives to others, so that none has two more than another one. Only those
    /// that have lived for [`SETTLED`] are given some, and only while nothing is free.
    #[must_use]
    pub fn surplus(&self, now: Instant, seen: &Seen, number: u64) -> usize {
        if !self.free.is_empty() {
            return 0;
        }
        let counts = seen.counts();
        let Some(own) = counts.get(&number) else { return 0 };
        let is_settled = |number: &u64| {
            let watched = self.gateways.get(number).and_then(|watched| watched.alive);
            watched.is_some_and(|alive| now.since(alive) >= SETTLED)
        };
        let others = counts.iter().filter(|(other, _)| **other != number && is_settled(other));
        let missing = others.map(|(_, count)| own.saturating_sub(*count) / 2);
        missing.max().unwrap_or(0)
    }

    fn note_gateways(&mut self, now: Instant, seen: &Seen, own: Own<'_>) {
        let known = seen.owners.iter().filter(|(owned, _)| own.known.contains(owned));
        let owners: BTreeSet<_> = known.filter_map(|(_, owner)| owner.gateway).collect();
        let note = |(number, seen): (&u64, &SeenGateway)| {
            let before = self.gateways.get(number);
            let since = before.filter(|before| before.beat == seen.beat).map_or(now, |before| before.since);
            let is_alive = seen.life == Life::Alive;
            let alive = is_alive.then(|| before.and_then(|before| before.alive).unwrap_or(now));
            let is_owner = *number != own.number && owners.contains(number);
            (*number, Watched { beat: seen.beat, since, alive, is_owner })
        };
        self.gateways = seen.gateways.iter().map(note).collect();
    }

    /// Whether something can be taken.
    fn is_free(&self, now: Instant, seen: &Seen, number: u64, owned: &Owned) -> bool {
        let Some(SeenOwner { gateway: Some(gateway), .. }) = seen.owners.get(owned) else { return true };
        // What it had itself, and let go of.
        if *gateway == number {
            return true;
        }
        match seen.life(*gateway) {
            Life::Ended => true,
            Life::Alive => false,
            Life::Expired | Life::Ahead => {
                let watched = self.gateways.get(gateway);
                watched.is_some_and(|watched| now.since(watched.since) >= WATCHED)
            }
        }
    }
}

#[cfg(test)]
mod tests;
