//! Trapezoidal speed along one number.
//!
//! The number counts seconds at full speed: a path that takes two seconds at full speed is two long, the
//! speed along it is a fraction of full speed, and full speed is 1. So one profile serves axes, lines and
//! curves. A jerk-limited profile would take this one's place behind the same four questions: duration, end,
//! where, how fast.

/// No move lasts longer, seconds: beyond it a double no longer resolves a microsecond. The slowest sensible
/// move, a full turn at 0.1 % of 0.1 %, takes 23 days.
const LONGEST: f64 = 1e9;

/// Times to reach full speed from rest and to come to rest from it, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramps {
    acceleration: f64,
    deceleration: f64,
}

impl Ramps {
    /// Shorter than any drive can do, seconds; a smaller value, or zero, would be a jump in speed.
    pub const SHORTEST: f64 = 0.001;
    /// Longer than anyone waits, seconds.
    pub const LONGEST: f64 = 60.0;

    /// Ramps of these many seconds, each 0.001 to 60; `None` otherwise (`modifyAccDec` gives both × 1000,
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
    /// 0.250 s both ways (reported, unit B).
    fn default() -> Self {
        Self { acceleration: 0.250, deceleration: 0.250 }
    }
}

/// A place on the path and the speed there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// How far along, seconds at full speed.
    pub position: f64,
    /// How fast, as a fraction of full speed.
    pub speed: f64,
}

/// A [`PathPoint`] and what it will be next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileState {
    /// How far along, seconds at full speed.
    pub position: f64,
    /// How fast, as a fraction of full speed.
    pub speed: f64,
    /// Change of that fraction per second.
    pub acceleration: f64,
}

/// One change of speed to the top, a stretch at the top, and one change to rest at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    start: PathPoint,
    end: f64,
    top: f64,
    /// Signed: below zero when the start is faster than the top.
    first_acceleration: f64,
    first_seconds: f64,
    cruise_seconds: f64,
    last_deceleration: f64,
    last_seconds: f64,
}

impl Profile {
    /// From a moving or resting start to rest at `end`, never faster than `top` once below it.
    ///
    /// A start faster than `top` slows down to it first. A start too fast to stop before `end` with the given
    /// ramps slows down harder, just enough to stop there. `None` when a number is not finite, the start lies
    /// beyond the end or moves backwards, `top` is not above zero, or the whole would last beyond all sense.
    #[must_use]
    pub fn plan(start: PathPoint, end: f64, top: f64, ramps: Ramps) -> Option<Self> {
        let way = end - start.position;
        let usable = way.is_finite() && way >= 0.0 && start.speed.is_finite() && start.speed >= 0.0;
        if !(usable && top.is_finite() && top > 0.0) {
            return None;
        }
        let (up, down) = (1.0 / ramps.acceleration, 1.0 / ramps.deceleration);
        let profile = if start.speed * start.speed >= 2.0 * down * way {
            Self::straight_to_rest(start, end)
        } else if start.speed > top {
            Self::through_top(start, end, top, -down, down)
        } else {
            let highest = ((2.0 * way + start.speed * start.speed / up) / (1.0 / up + 1.0 / down)).sqrt();
            Self::through_top(start, end, top.min(highest).max(start.speed), up, down)
        };
        (profile.duration() <= LONGEST).then_some(profile)
    }

    /// Comes to rest evenly in `seconds`, or at `end` if that comes first.
    ///
    /// Seconds that are not above zero, or not finite, stop at once.
    #[must_use]
    pub fn stop_from(at: PathPoint, end: f64, seconds: f64) -> Self {
        let wanted = if seconds.is_finite() { at.speed * seconds.max(0.0) / 2.0 } else { 0.0 };
        Self::straight_to_rest(at, (at.position + wanted).min(end).max(at.position))
    }

    /// Evenly to rest at `end`; at once when there is no way to go or no speed.
    fn straight_to_rest(start: PathPoint, end: f64) -> Self {
        let way = end - start.position;
        let moves = way > 0.0 && start.speed > 0.0;
        Self {
            start,
            end,
            top: start.speed,
            first_acceleration: 0.0,
            first_seconds: 0.0,
            cruise_seconds: 0.0,
            last_deceleration: if moves { start.speed * start.speed / (2.0 * way) } else { 0.0 },
            last_seconds: if moves { 2.0 * way / start.speed } else { 0.0 },
        }
    }

    fn through_top(start: PathPoint, end: f64, top: f64, first: f64, down: f64) -> Self {
        let first_seconds = (top - start.speed) / first;
        let first_way = (top + start.speed) / 2.0 * first_seconds;
        let last_seconds = top / down;
        let cruise_way = end - start.position - first_way - top * last_seconds / 2.0;
        Self {
            start,
            end,
            top,
            first_acceleration: first,
            first_seconds,
            cruise_seconds: (cruise_way / top).max(0.0),
            last_deceleration: down,
            last_seconds,
        }
    }

    /// How long it takes, seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.first_seconds + self.cruise_seconds + self.last_seconds
    }

    /// Where it comes to rest.
    #[must_use]
    pub const fn end(&self) -> f64 {
        self.end
    }

    /// The state `seconds` after the start: the start before it, rest at exactly the end from
    /// [`Profile::duration`] on. What is no number counts as the start.
    #[must_use]
    pub fn at(&self, seconds: f64) -> ProfileState {
        let left = self.duration() - seconds;
        if left <= 0.0 {
            return ProfileState { position: self.end, speed: 0.0, acceleration: 0.0 };
        }
        let t = if seconds > 0.0 { seconds } else { 0.0 };
        let left = left.min(self.duration());
        let state = if left <= self.last_seconds {
            ProfileState {
                position: self.end - self.last_deceleration * left * left / 2.0,
                speed: self.last_deceleration * left,
                acceleration: -self.last_deceleration,
            }
        } else if t < self.first_seconds {
            ProfileState {
                position: self.start.position + (self.start.speed + self.first_acceleration * t / 2.0) * t,
                speed: self.start.speed + self.first_acceleration * t,
                acceleration: self.first_acceleration,
            }
        } else {
            let since = t - self.first_seconds;
            let first_way = (self.start.speed + self.top) / 2.0 * self.first_seconds;
            ProfileState {
                position: self.start.position + first_way + self.top * since,
                speed: self.top,
                acceleration: 0.0,
            }
        };
        // Rounding only; `clamp` would panic on a caller's NaN.
        ProfileState { position: state.position.max(self.start.position).min(self.end), ..state }
    }
}

#[cfg(test)]
mod tests;
