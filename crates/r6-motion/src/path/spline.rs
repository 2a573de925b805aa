//! One stretch of a tool path for the axes: a cubic through two points with a given slope at each.

use crate::axes::ARM_AXES;

/// A position on the path with its axes and their slopes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    /// Seconds at full speed from the start of the path.
    pub(super) position: f64,
    /// Axis positions in degrees.
    pub(super) arm: [f64; ARM_AXES],
    /// Slopes in degrees per second at full speed.
    pub(super) slope: [f64; ARM_AXES],
}

/// The part between two nodes; the second is farther along.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch<'a> {
    pub(super) from: &'a Node,
    pub(super) to: &'a Node,
}

/// One axis on a stretch, as `a·u³ + b·u² + c·u + d` for u from 0 to 1.
#[derive(Clone, Copy, Debug)]
struct Cubic {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
}

impl Cubic {
    fn value(self, u: f64) -> f64 {
        ((self.a * u + self.b) * u + self.c) * u + self.d
    }

    fn slope(self, u: f64) -> f64 {
        (3.0 * self.a * u + 2.0 * self.b) * u + self.c
    }

    /// The smallest and the largest value between u = 0 and 1.
    fn range(self) -> (f64, f64) {
        let ends = [self.value(0.0), self.value(1.0)];
        let turns = self.turning_points().map(|u| self.value(u.clamp(0.0, 1.0)));
        let all = ends.into_iter().chain(turns);
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    }

    /// The largest absolute slope between u = 0 and 1.
    fn steepest(self) -> f64 {
        let ends = self.slope(0.0).abs().max(self.slope(1.0).abs());
        let bend = -self.b / (3.0 * self.a);
        if (0.0..=1.0).contains(&bend) { ends.max(self.slope(bend).abs()) } else { ends }
    }

    /// Where the slope is 0; missing ones read 0.
    fn turning_points(self) -> [f64; 2] {
        // 3a u² + 2b u + c = 0, in a form that keeps its precision for small a.
        let root = (self.b * self.b - 3.0 * self.a * self.c).max(0.0).sqrt();
        let q = -(self.b + root.copysign(self.b));
        [q / (3.0 * self.a), self.c / q].map(|u| if u.is_finite() { u } else { 0.0 })
    }
}

impl Stretch<'_> {
    fn length(&self) -> f64 {
        self.to.position - self.from.position
    }

    fn cubics(&self) -> [Cubic; ARM_AXES] {
        let h = self.length();
        let ends = self.from.arm.into_iter().zip(self.to.arm);
        let slopes = self.from.slope.into_iter().zip(self.to.slope);
        let mut cubics = [Cubic { a: 0.0, b: 0.0, c: 0.0, d: 0.0 }; ARM_AXES];
        for (cubic, ((p, q), (m, n))) in cubics.iter_mut().zip(ends.zip(slopes)) {
            *cubic = Cubic {
                a: 2.0 * (p - q) + h * (m + n),
                b: 3.0 * (q - p) - h * (2.0 * m + n),
                c: h * m,
                d: p,
            };
        }
        cubics
    }

    /// Axes and slopes at a position between the nodes; exactly those of a node at its position.
    pub(super) fn at(&self, position: f64) -> ([f64; ARM_AXES], [f64; ARM_AXES]) {
        let h = self.length();
        let u = (position - self.from.position) / h;
        if u >= 1.0 {
            return (self.to.arm, self.to.slope);
        }
        if u <= 0.0 {
            return (self.from.arm, self.from.slope);
        }
        let cubics = self.cubics();
        (cubics.map(|cubic| cubic.value(u)), cubics.map(|cubic| cubic.slope(u) / h))
    }

    /// The smallest and the largest angle of every axis on the stretch.
    pub(super) fn ranges(&self) -> [(f64, f64); ARM_AXES] {
        self.cubics().map(Cubic::range)
    }

    /// The largest absolute slope of every axis on the stretch.
    pub(super) fn steepest(&self) -> [f64; ARM_AXES] {
        let h = self.length();
        self.cubics().map(|cubic| cubic.steepest() / h)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn node(position: f64, arm: f64, slope: f64) -> Node {
        Node { position, arm: [arm; ARM_AXES], slope: [slope; ARM_AXES] }
    }

    #[test]
    fn a_cubic_is_met_exactly() {
        let f = |t: f64| 2.0 * t * t * t - 3.0 * t * t + 4.0 * t - 5.0;
        let g = |t: f64| 6.0 * t * t - 6.0 * t + 4.0;
        let (from, to) = (node(0.5, f(0.5), g(0.5)), node(2.0, f(2.0), g(2.0)));
        let stretch = Stretch { from: &from, to: &to };
        for t in [0.5, 0.7, 1.3, 2.0] {
            let ([value, ..], [slope, ..]) = stretch.at(t);
            assert!((value - f(t)).abs() < 1e-12 && (slope - g(t)).abs() < 1e-12, "{t}: {value} {slope}");
        }
    }

    proptest! {
        #[test]
        fn range_and_steepest_hold_and_are_met(
            p in -100.0..100.0, q in -100.0..100.0, m in -300.0..300.0, n in -300.0..300.0,
            straight in any::<bool>(),
        ) {
            // A straight stretch has no cubic part: the formulas have to handle that.
            let (m, n) = if straight { ((q - p) / 0.3, (q - p) / 0.3) } else { (m, n) };
            let (from, to) = (node(1.0, p, m), node(1.3, q, n));
            let stretch = Stretch { from: &from, to: &to };
            let [(low, high), ..] = stretch.ranges();
            let [steepest, ..] = stretch.steepest();
            let (mut least, mut most, mut fastest) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
            for step in 0..=1000 {
                let ([value, ..], [slope, ..]) = stretch.at(1.0 + 0.3 * f64::from(step) / 1000.0);
                (least, most, fastest) = (least.min(value), most.max(value), fastest.max(slope.abs()));
            }
            prop_assert!(low <= least + 1e-9 && most <= high + 1e-9, "{least}..{most} in {low}..{high}");
            prop_assert!(least - low < 1e-2 && high - most < 1e-2, "{least}..{most} in {low}..{high}");
            prop_assert!(fastest <= steepest + 1e-9 && steepest - fastest < 1.0, "{fastest} {steepest}");
        }
    }
}
