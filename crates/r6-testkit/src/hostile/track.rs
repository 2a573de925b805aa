//! Where an arm was at which time.

use std::time::Duration;

use super::AXES;

/// `world-n` minus `axis-n`: the machine is a gantry.
pub const WORLD_OFFSET: [f64; AXES] = [500.0, 0.0, 800.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// A move in a straight line at a constant speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub begin: Duration,
    pub end: Duration,
    pub from: [f64; AXES],
    pub to: [f64; AXES],
}

impl Leg {
    /// The position at `time`, which may be outside the leg.
    pub(super) fn at(&self, time: Duration) -> [f64; AXES] {
        let length = self.end.saturating_sub(self.begin).as_secs_f64();
        if time >= self.end || length == 0.0 {
            return self.to;
        }
        let part = time.saturating_sub(self.begin).as_secs_f64() / length;
        std::array::from_fn(|axis| {
            let (from, to) = (value(&self.from, axis), value(&self.to, axis));
            from + (to - from) * part
        })
    }

    /// The leg up to `time`, which must be within it.
    pub(super) fn cut(&self, time: Duration) -> Self {
        Self { end: time, to: self.at(time), ..*self }
    }
}

fn value(axes: &[f64; AXES], axis: usize) -> f64 {
    axes.get(axis).copied().unwrap_or(0.0)
}

/// All legs of an arm in order of time.
#[derive(Clone, Debug)]
pub(super) struct Track {
    start: [f64; AXES],
    legs: Vec<Leg>,
}

impl Track {
    pub(super) fn new(start: [f64; AXES]) -> Self {
        Self { start, legs: Vec::new() }
    }

    pub(super) fn push(&mut self, leg: Leg) {
        self.legs.push(leg);
    }

    /// Cuts the last leg short at `time`.
    pub(super) fn cut(&mut self, time: Duration) {
        if let Some(last) = self.legs.last_mut().filter(|last| time < last.end) {
            *last = last.cut(time);
        }
    }

    /// Where the axes were at `time`.
    pub(super) fn position_at(&self, time: Duration) -> [f64; AXES] {
        self.legs.iter().rev().find(|leg| leg.begin <= time).map_or(self.start, |leg| leg.at(time))
    }

    /// How far each axis moved from `since` to `until`, with both directions added up.
    pub(super) fn path(&self, since: Duration, until: Duration) -> [f64; AXES] {
        let mut path = [0.0; AXES];
        for leg in self.legs.iter().filter(|leg| leg.end > since && leg.begin < until) {
            let (from, to) = (leg.at(since.max(leg.begin)), leg.at(until.min(leg.end)));
            for ((way, from), to) in path.iter_mut().zip(from).zip(to) {
                *way += (to - from).abs();
            }
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leg(begin: u64, end: u64, from: f64, to: f64) -> Leg {
        let at = |j1| std::array::from_fn(|axis| if axis == 0 { j1 } else { 0.0 });
        Leg { begin: Duration::from_secs(begin), end: Duration::from_secs(end), from: at(from), to: at(to) }
    }

    #[test]
    fn positions_and_ways_are_those_of_the_legs() {
        let mut track = Track::new([0.0; AXES]);
        track.push(leg(1, 3, 0.0, 20.0));
        track.push(leg(5, 6, 20.0, 10.0));
        let j1 = |tenths: u64| track.position_at(Duration::from_millis(tenths * 100))[0];
        assert_eq!([j1(0), j1(20), j1(40), j1(55), j1(90)], [0.0, 10.0, 20.0, 15.0, 10.0]);
        let way = |since, until| track.path(Duration::from_secs(since), Duration::from_secs(until))[0];
        assert_eq!([way(0, 9), way(2, 9), way(3, 5), way(6, 9), way(0, 2)], [30.0, 20.0, 0.0, 0.0, 10.0]);
    }

    #[test]
    fn a_leg_that_is_cut_ends_where_it_was() {
        let mut track = Track::new([0.0; AXES]);
        track.push(leg(0, 2, 0.0, 20.0));
        track.cut(Duration::from_secs(1));
        assert_eq!(track.position_at(Duration::from_secs(5))[0], 10.0);
        assert_eq!(track.path(Duration::ZERO, Duration::from_secs(5))[0], 10.0);
    }
}
