//! Blends the corner between two moves.
//!
//! The second move begins before the first has ended. The overlap grows with the level. It is a fraction of
//! the time of a change of speed: three fifths at level 1, almost all of it at level 9. Neither move overlaps
//! for more than half its time, so that a third move cannot join. The corner cuts at most half of either
//! path.

use super::limits::stays_within;
use super::{Conditions, Move, Movement, Stroke, Tail, sum};
use crate::error::PlanError;
use crate::path::Path;

/// The overlap of level 0 as a fraction of a change of speed, and what each level adds. Fitted to the times
/// of one path at levels 0, 1, 3, 6 and 9 (reported, unit A).
const SHARE_AT_0: f64 = 0.55;
const SHARE_PER_LEVEL: f64 = 0.045;

/// Half of a path, and a margin for rounding.
const HALF: f64 = 0.5 + 1e-9;

/// How often the overlap is halved before the corner is not blended at all.
const TRIES: u32 = 5;

/// A blend level, 0 (the arm stops there) to 9 (`smooth`, manual 6.1.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Blend(u8);

impl Blend {
    /// The largest level.
    pub const MOST: Self = Self(9);

    /// This level; 9 for a larger one.
    #[must_use]
    pub const fn new(level: u8) -> Self {
        if level < 9 { Self(level) } else { Self::MOST }
    }

    /// The level, 0 to 9.
    #[must_use]
    pub const fn level(self) -> u8 {
        self.0
    }

    /// The overlap of two moves as a fraction of a change of speed, 0 to 1.
    #[must_use]
    pub fn share(self) -> f64 {
        if self.0 == 0 { 0.0 } else { SHARE_AT_0 + SHARE_PER_LEVEL * f64::from(self.0) }
    }
}

impl Movement {
    /// When the next move may begin at the earliest. `None` if it has to wait for the end: at level 0, if the
    /// movement halts, if its path has no length, and while the last corner is still being blended.
    #[must_use]
    pub fn corner(&self, blend: Blend) -> Option<f64> {
        let alone = self.second.is_none() && !self.pace.stops() && self.first.profile.end() > 0.0;
        (alone && blend.level() > 0).then(|| {
            self.pace.when((self.first.ends() - overlap(&self.first, blend)).max(self.tail_ends()))
        })?
    }

    /// The same movement with a second move. The second begins at `at`, or as soon after as the corner
    /// allows, and continues from the end of the first. The time of the movement is not reset.
    ///
    /// If an axis might leave its limits at the corner, the corner is blended less, and finally not at all:
    /// the second move then begins after the first has ended. Errors as in [`Movement::plan`]; also
    /// [`PlanError::NotFinite`] if a corner is still being blended or the movement halts.
    pub fn join(
        &self,
        at: f64,
        order: &Move,
        conditions: &Conditions,
        blend: Blend,
    ) -> Result<Self, PlanError> {
        if self.second.is_some() || self.pace.stops() {
            return Err(PlanError::NotFinite);
        }
        let mut second = Stroke::plan(&self.model, &self.first.end(), order, conditions, 0.0)?;
        let (end, now) = (self.first.ends(), self.pace.time(at));
        let overlap = overlap(&self.first, blend).min(overlap(&second, blend)).min(end - now);
        let overlap = overlap.min(end - self.tail_ends());
        for overlap in (0..TRIES).map(|halved| overlap / f64::from(1_u32 << halved)).chain([0.0]) {
            // A movement that was halted at its very end may resume only after that.
            second.starts = (end - overlap.max(0.0)).max(now) + order.delay;
            if overlap <= 0.0 || self.corner_is_allowed(&second) {
                break;
            }
        }
        Ok(Self { second: Some(second), ..self.clone() })
    }

    /// When the first of two moves ends; `None` if there is only one, or the movement halts before.
    #[must_use]
    pub fn first_ends(&self) -> Option<f64> {
        self.second.as_ref().and_then(|_| self.pace.when(self.first.ends()))
    }

    /// Only the second of two moves, after the first has ended; the time is not reset. A single move stays
    /// the same.
    #[must_use]
    pub fn without_first(&self) -> Self {
        let mut next = self.clone();
        if let Some(second) = next.second.take() {
            next.first = second;
            next.tail = None;
        }
        next
    }

    /// When the motion that this movement took over from has come to rest. No corner is blended before that.
    fn tail_ends(&self) -> f64 {
        self.tail.as_ref().map_or(0.0, Tail::ends)
    }

    /// Whether the corner before `second` is allowed: it cuts at most half of either path, and no axis can
    /// leave its soft limits.
    ///
    /// Between two axis paths the first condition is enough: each axis is then between its positions at the
    /// start, the corner and the end. Otherwise the axes are sampled often enough that none can be outside in
    /// between.
    fn corner_is_allowed(&self, second: &Stroke) -> bool {
        let left = 1.0 - self.first.part(second.starts);
        if left.max(second.part(self.first.ends())) > HALF {
            return false;
        }
        if let (Path::Axis(_), Path::Axis(_)) = (&*self.first.path, &*second.path) {
            return true;
        }
        let corner = self.first.end();
        let (from, to) = (second.starts, self.first.ends());
        // No axis is faster than in the faster of the two moves.
        let fastest = self.first.axis_speed().max(second.axis_speed());
        stays_within(&self.model, from, to, fastest, |time| {
            sum(&self.first.at(time), &second.at(time), &corner).axes
        })
    }
}

impl Stroke {
    /// The fraction of its path that is done at `time`, 0 to 1.
    fn part(&self, time: f64) -> f64 {
        self.profile.at(time - self.starts).position / self.profile.end()
    }

    /// The largest fraction of its full speed that any axis can have in this move.
    pub(super) fn axis_speed(&self) -> f64 {
        self.profile.fastest() / self.path.top_speed()
    }
}

/// How long this move may overlap with a neighbouring one, as far as this move is concerned.
fn overlap(stroke: &Stroke, blend: Blend) -> f64 {
    let change = stroke.profile.shortest_change();
    (blend.share() * change).min(stroke.profile.duration() / 2.0)
}

#[cfg(test)]
mod tests;
