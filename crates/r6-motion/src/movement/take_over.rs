//! Takes over to another target without a stop.
//!
//! The old motion comes to rest on its path while the new move gains speed, and the motions of each axis are
//! added. So the speed does not jump, and no axis is faster than in the faster of the two. The new path
//! begins where the old motion comes to rest, and the arm is on it from then on.

use super::limits::stays_within;
use super::{Conditions, Move, Movement, Stroke, StrokeState, since_start, sum};
use crate::axes::Axes;
use crate::error::PlanError;
use crate::speed_profile::SmoothStep;

/// How many earlier movements may still be coming to rest. A target that changes 20 times a second leaves
/// about twenty that are not [`NEGLIGIBLE`] yet.
const MAX_TAILS: usize = 64;

/// An earlier motion with less than this left counts as at rest, in degrees: a tenth of the allowed error at
/// the end.
const NEGLIGIBLE: f64 = 1e-10;

/// A movement that comes to rest after another has taken over.
#[derive(Clone, Debug)]
pub(super) struct Tail {
    movement: Box<Movement>,
    /// The axes where it comes to rest.
    pub(super) rest: Axes,
}

impl Tail {
    /// When it rests, in the time of the movement that took over.
    pub(super) fn ends(&self) -> f64 {
        self.movement.pace.settles()
    }

    pub(super) fn at(&self, time: f64) -> StrokeState {
        self.movement.moving_at(time)
    }

    /// The same without the earlier movements that have come to rest; `None` if it rests itself.
    fn pruned(mut self, now: f64, end: f64) -> Option<Self> {
        let movement = &mut self.movement;
        if let Some(inner) = movement.tail.take() {
            let (inner_now, inner_end) = (movement.pace.time(now), movement.pace.time(end));
            let (place, left) = (inner.at(inner_now).axes, inner.at(inner_end).axes);
            if furthest(&place, &left) > NEGLIGIBLE {
                movement.tail = inner.pruned(inner_now, inner_end);
            } else {
                // The rest position loses what the removed movement added.
                self.rest = moved(&self.rest, &left, &inner.rest);
            }
        }
        (now < self.ends()).then_some(self)
    }

    /// How many movements are coming to rest, this one included.
    fn count(&self) -> usize {
        1 + self.movement.tail.as_ref().map_or(0, Self::count)
    }
}

impl Movement {
    /// Goes to another target from `at` on without a stop. The new movement counts its own time from there.
    ///
    /// `None` if the arm has to stop first: this movement is halting, an axis might leave its soft limits
    /// meanwhile, or 64 movements are still coming to rest. Errors as in [`Movement::plan`].
    pub fn take_over(
        &self,
        at: f64,
        order: &Move,
        conditions: &Conditions,
    ) -> Result<Option<Self>, PlanError> {
        let at = since_start(at);
        if self.pace.stops() {
            return Ok(None);
        }
        let mut halting = self.clone();
        halting.pace = self.pace.to(at, 0.0, Some(SmoothStep::of(conditions.ramps.acceleration())));
        let (now, end) = (halting.pace.time(0.0), halting.pace.time(halting.pace.settles()));
        halting.tail = self.tail.clone().and_then(|tail| tail.pruned(now, end));
        let rest = halting.state_at(f64::INFINITY).axes;
        let tail = Tail { movement: Box::new(halting), rest };
        let mut first = Stroke::plan(&self.model, &rest, order, conditions, 0.0)?;
        // A path of no length takes no time: the move ends when the old motion rests.
        first.starts = first.starts.max(tail.ends() - first.profile.duration());
        if tail.count() > MAX_TAILS {
            return Ok(None);
        }
        let fastest = self.axis_speed().max(first.axis_speed());
        let allowed = stays_within(&self.model, 0.0, tail.ends(), fastest, |time| {
            sum(&tail.at(time), &first.at(time), &rest).axes
        });
        let next = Self {
            model: self.model.clone(),
            first,
            second: None,
            tail: Some(tail),
            pace: super::Pace::EVEN,
        };
        Ok(allowed.then_some(next))
    }

    /// The largest fraction of its full speed that any axis can have in it.
    fn axis_speed(&self) -> f64 {
        let told = self.second.iter().map(Stroke::axis_speed).fold(self.first.axis_speed(), f64::max);
        self.tail.as_ref().map_or(told, |tail| told.max(tail.movement.axis_speed()))
    }
}

/// The largest difference of one axis between two positions, in degrees or mm.
fn furthest(one: &Axes, other: &Axes) -> f64 {
    one.arm().into_iter().zip(other.arm()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// `axes` moved by the difference from `from` to `to`.
fn moved(axes: &Axes, from: &Axes, to: &Axes) -> Axes {
    let mut arm = axes.arm();
    for (slot, (from, to)) in arm.iter_mut().zip(from.arm().into_iter().zip(to.arm())) {
        *slot += to - from;
    }
    axes.with_arm(arm)
}

#[cfg(test)]
mod tests;
