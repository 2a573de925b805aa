//! How near a point is to the straight way of a step, in the coordinates that the step is told in.

/// Below this, degrees or mm, a difference between two reads is no direction.
const NO_DIRECTION: f64 = 1e-3;

/// How near a point is to a way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    pub length: f64,
    pub distance: f64,
    /// Whether the arm goes along it, and not back; an arm that stands agrees with every way.
    pub agrees: bool,
}

/// Sums over the coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// Way times way.
    ww: f64,
    /// From the start of the way to the point, squared.
    pp: f64,
    /// That times the way.
    pw: f64,
    /// The last motion times the way.
    mw: f64,
    /// The last motion squared.
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
