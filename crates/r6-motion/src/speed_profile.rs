//! Speed along one number, with bounded jerk.
//!
//! The number is measured in seconds at full speed. A path that takes two seconds at full speed has length
//! two, the speed along it is a fraction of full speed, and full speed is 1. So one profile serves axes,
//! lines and curves.
//!
//! The requested speed changes at instants: up at the start, down at the end, and wherever the global speed
//! was changed in between. The real speed is the sum of these jumps, each made smooth ([`SmoothStep`]). So a
//! change of speed takes the same time whatever its size, and a short path keeps its ramps and stays below
//! the requested speed. The end is met because the areas under the jumps add up to the length.

mod peaks;
mod smooth_step;

pub use peaks::Peaks;
pub use smooth_step::{FILTER_SECONDS, S_CURVE, SmoothStep, StepState};

/// The longest move, in seconds: beyond it a double no longer resolves a microsecond. The slowest sensible
/// move, a full turn at 0.1 % of 0.1 %, takes 23 days.
const LONGEST: f64 = 1e9;

/// The times from rest to full speed and from full speed to rest, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramps {
    acceleration: f64,
    deceleration: f64,
}

impl Ramps {
    /// The shortest ramp, in seconds: shorter than any drive can do. A smaller value, or zero, would be a
    /// jump in speed.
    pub const SHORTEST: f64 = 0.001;
    /// The longest ramp, in seconds.
    pub const LONGEST: f64 = 60.0;

    /// Ramps of these times in seconds, each 0.001 to 60; `None` otherwise (`modifyAccDec` gives both × 1000,
    /// manual 4.2.1).
    #[must_use]
    pub fn new(acceleration: f64, deceleration: f64) -> Option<Self> {
        let fits = |seconds| (Self::SHORTEST..=Self::LONGEST).contains(&seconds);
        (fits(acceleration) && fits(deceleration)).then_some(Self { acceleration, deceleration })
    }

    /// Seconds from rest to full speed.
    #[must_use]
    pub const fn acceleration(self) -> f64 {
        self.acceleration
    }

    /// Seconds from full speed to rest.
    #[must_use]
    pub const fn deceleration(self) -> f64 {
        self.deceleration
    }
}

impl Default for Ramps {
    /// 0.250 s for both (reported, unit B).
    fn default() -> Self {
        Self { acceleration: 0.250, deceleration: 0.250 }
    }
}

/// The shortest time between two changes of speed, as a fraction of the duration of one; a later change
/// waits. A change is dropped after it has been over for as long as it took. So at most 200 are stored,
/// however often the speed is changed and however long the ramps are.
const CLOSEST_CHANGES: f64 = 0.01;

/// A position on the path, with speed and acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileState {
    /// The position in seconds at full speed.
    pub position: f64,
    /// The speed as a fraction of full speed.
    pub speed: f64,
    /// The change of that fraction per second.
    pub acceleration: f64,
}

/// A change of speed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    /// When it is requested, in seconds from the start.
    at: f64,
    /// By how much, as a fraction of full speed.
    by: f64,
    step: SmoothStep,
}

impl Change {
    fn ends(&self) -> f64 {
        self.at + self.step.width()
    }
}

/// A profile from rest at 0 to rest at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    end: f64,
    ramps: Ramps,
    /// The sum of the changes that are over: their position at time 0, and their speed.
    settled: (f64, f64),
    /// The changes in time order.
    changes: Vec<Change>,
    /// The change to rest.
    last: Change,
}

impl Profile {
    /// Plans a profile from rest at 0 to rest at `end`, no faster than `top`.
    ///
    /// If the ramps up and down differ so much that the path is over before the slower one takes effect, it
    /// goes more slowly. `None` if a number is not finite, `end` is below zero, `top` is not above zero, or
    /// the duration exceeds 1e9 seconds.
    #[must_use]
    pub fn plan(end: f64, top: f64, ramps: Ramps) -> Option<Self> {
        if !(end.is_finite() && end >= 0.0 && top.is_finite() && top > 0.0) {
            return None;
        }
        let (up, down) = (SmoothStep::of(ramps.acceleration), SmoothStep::of(ramps.deceleration));
        let uneven = (up.lag() - down.lag()).abs();
        let top = if top * uneven > end { end / uneven } else { top };
        let last = if top > 0.0 { end / top + up.lag() - down.lag() } else { 0.0 };
        let profile = Self {
            end,
            ramps,
            settled: (0.0, 0.0),
            changes: vec![Change { at: 0.0, by: top, step: up }],
            last: Change { at: last, by: -top, step: down },
        };
        (profile.duration() <= LONGEST).then_some(profile)
    }

    /// The same with another `top` from `at` on, which may lie ahead by up to the duration of a change. The
    /// result is not valid for times before `at`.
    ///
    /// Nothing changes if the rest of the path is too short: the change to rest has already been requested,
    /// or would have to be before the change to `top` takes effect. `None` as for [`Profile::plan`].
    #[must_use]
    pub fn with_top(&self, at: f64, top: f64) -> Option<Self> {
        if !(top.is_finite() && top > 0.0) {
            return None;
        }
        if at <= 0.0 {
            return Self::plan(self.end, top, self.ramps);
        }
        let mut next = self.clone();
        next.settle(at);
        // A change without any effect so far is replaced.
        let waiting = next.changes.pop_if(|change| change.at >= at);
        let apart = |change: &Change| CLOSEST_CHANGES * change.step.width();
        let soonest = next.changes.last().map_or(at, |change| at.max(change.at + apart(change)));
        let at = waiting.map_or(soonest, |change| change.at);
        let by = top - next.asked_speed();
        let (up, down) = (SmoothStep::of(self.ramps.acceleration), SmoothStep::of(self.ramps.deceleration));
        let slower = if up.width() > down.width() { up } else { down };
        // All changes on the way are alike and slow, so that none overtakes an earlier one.
        next.changes.push(Change { at, by, step: slower });
        let last = next.time_of_last(top, &down);
        let overtaken = last < at || next.changes.iter().any(|change| last + down.width() < change.ends());
        if self.last.at <= at || overtaken {
            return Some(self.clone());
        }
        next.last = Change { at: last, by: -top, step: down };
        (next.duration() <= LONGEST).then_some(next)
    }

    /// When the change to rest has to be requested so that the profile ends at `end`.
    fn time_of_last(&self, top: f64, down: &SmoothStep) -> f64 {
        let behind: f64 = self.changes.iter().map(|change| change.by * (change.at + change.step.lag())).sum();
        (self.end - self.settled.0 + behind) / top - down.lag()
    }

    /// The requested speed before the change to rest.
    fn asked_speed(&self) -> f64 {
        self.settled.1 + self.changes.iter().map(|change| change.by).sum::<f64>()
    }

    /// An upper bound of the speed, as a fraction of full speed.
    #[must_use]
    pub fn fastest(&self) -> f64 {
        let mut asked = self.settled.1;
        self.changes.iter().fold(asked, |fastest, change| {
            asked += change.by;
            fastest.max(asked)
        })
    }

    /// Drops changes that were over some time before `at`.
    fn settle(&mut self, at: f64) {
        let (position, speed) = &mut self.settled;
        self.changes.retain(|change| {
            let over = change.ends() + change.step.width() <= at;
            if over {
                *position -= change.by * (change.at + change.step.lag());
                *speed += change.by;
            }
            !over
        });
    }

    /// The duration in seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        let nowhere = self.end <= 0.0;
        let ends = self.changes.iter().map(Change::ends).fold(self.last.ends(), f64::max);
        if nowhere { 0.0 } else { ends }
    }

    /// The position at the end.
    #[must_use]
    pub const fn end(&self) -> f64 {
        self.end
    }

    /// The shortest duration of a change of speed, in seconds: the shorter ramp and the filter.
    #[must_use]
    pub fn shortest_change(&self) -> f64 {
        SmoothStep::of(self.ramps.acceleration.min(self.ramps.deceleration)).width()
    }

    /// The state `seconds` after the start. Before that it is the start. From [`Profile::duration`] on it is
    /// rest at exactly the end. NaN counts as the start.
    #[must_use]
    pub fn at(&self, seconds: f64) -> ProfileState {
        if seconds >= self.duration() {
            return ProfileState { position: self.end, speed: 0.0, acceleration: 0.0 };
        }
        let t = if seconds > 0.0 { seconds } else { 0.0 };
        let (behind, speed) = self.settled;
        let mut state = ProfileState { position: behind + speed * t, speed, acceleration: 0.0 };
        for change in self.changes.iter().chain([&self.last]) {
            let step = change.step.at(t - change.at);
            state.position += change.by * step.area;
            state.speed += change.by * step.height;
            state.acceleration += change.by * step.slope;
        }
        // For rounding only; `clamp` would panic on a caller's NaN.
        ProfileState {
            position: state.position.max(0.0).min(self.end),
            speed: state.speed.max(0.0),
            acceleration: state.acceleration,
        }
    }
}

#[cfg(test)]
mod tests;
