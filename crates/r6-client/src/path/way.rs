//! How near a point is to the straight line of a step, in the coordinates of the step.

/// A difference between two reads below this, degrees or mm, shows no direction.
const NO_DIRECTION: f64 = 1e-3;

/// The relation of a point to the line of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    pub length: f64,
    pub distance: f64,
    /// Whether the arm moves along the line and not back. An arm that stands agrees with every line.
    pub agrees: bool,
}

/// Sums over all coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// Line times line: the squared length.
    ww: f64,
    /// The squared distance from the start of the line to the point.
    pp: f64,
    /// Scalar product of the point, seen from the start, and the line.
    pw: f64,
    /// Scalar product of the last motion and the line.
    mw: f64,
    /// The last motion, squared.
    mm: f64,
}

impl Sums {
    pub fn add(&mut self, way: f64, from_start: f64, motion: f64) {
        self.ww += way * way;
        self.pp += from_start * from_start;
        self.pw += from_start * way;
        self.mw += motion * way;
        self.mm += motion * motion;
    }

    pub fn way(self) -> Way {
        let share = if self.ww > 0.0 { (self.pw / self.ww).clamp(0.0, 1.0) } else { 0.0 };
        let squared = self.pp - 2.0 * share * self.pw + share * share * self.ww;
        Way {
            length: self.ww.sqrt(),
            distance: squared.max(0.0).sqrt(),
            agrees: self.mm.sqrt() < NO_DIRECTION || self.mw >= 0.0,
        }
    }
}
