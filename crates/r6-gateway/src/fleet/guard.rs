//! The limits that each list of a robot is checked against before it is sent.

use r6_api::gateway::{GuardRange, RobotGuard};
use r6_client::units::{AxisCoordinate, Degrees, Millimetres, MillimetresPerSecond, Percent};
use r6_client::{AxisIndex, Envelope};

/// Limits of lists, as the client checks them and as the API tells them. They compare numbers with numbers,
/// and protect no people (`docs/SAFETY.md`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Guard {
    envelope: Envelope,
    told: RobotGuard,
}

impl Guard {
    /// Without limits.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The highest speed of moves, before the global speed.
    #[must_use]
    pub fn max_speed(mut self, cap: Percent) -> Self {
        self.told.max_speed = Some(cap.value());
        self.limited(|envelope| envelope.speed_cap(cap))
    }

    /// The highest path speed.
    #[must_use]
    pub fn max_path_speed(mut self, cap: MillimetresPerSecond) -> Self {
        self.told.max_path_speed = Some(cap.value());
        self.limited(|envelope| envelope.path_speed_cap(cap))
    }

    /// How far an axis move turns an axis at most.
    #[must_use]
    pub fn max_axis_step(mut self, largest: Degrees) -> Self {
        self.told.max_axis_step = Some(largest.0);
        self.limited(|envelope| envelope.largest_axis_step(largest))
    }

    /// How far a move of the tool goes at most.
    #[must_use]
    pub fn max_distance(mut self, largest: Millimetres) -> Self {
        self.told.max_distance = Some(largest.0);
        self.limited(|envelope| envelope.largest_distance(largest))
    }

    /// The range of an axis in axis moves, the lowest value first, both in one unit.
    #[must_use]
    pub fn axis(mut self, axis: AxisIndex, lowest: AxisCoordinate, highest: AxisCoordinate) -> Self {
        let unit = if matches!(lowest, AxisCoordinate::Millimetres(_)) { "mm" } else { "deg" };
        let of = format!("J{}", axis.index() + 1);
        let (low, high) = (lowest.value(), highest.value());
        self.told.axes.push(GuardRange { of, unit: unit.to_owned(), lowest: low, highest: high });
        self.limited(|envelope| envelope.axis_limits(axis, lowest, highest))
    }

    /// The ranges of X, Y and Z in mm, the lowest value first, in the work frame in use; `None` is no limit.
    #[must_use]
    pub fn workspace(mut self, ranges: [Option<(f64, f64)>; 3]) -> Self {
        let told = ["x", "y", "z"].into_iter().zip(ranges).filter_map(|(of, range)| {
            let (lowest, highest) = range?;
            Some(GuardRange { of: of.to_owned(), unit: "mm".to_owned(), lowest, highest })
        });
        self.told.workspace = told.collect();
        let ranges = ranges.map(|range| range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY)));
        let [lowest, highest] = [ranges.map(|(low, _)| low), ranges.map(|(_, high)| high)];
        self.limited(|envelope| envelope.workspace(lowest.map(Millimetres), highest.map(Millimetres)))
    }

    /// What the client checks.
    #[must_use]
    pub fn envelope(&self) -> &Envelope {
        &self.envelope
    }

    /// What the API tells.
    pub(crate) fn told(&self) -> &RobotGuard {
        &self.told
    }

    fn limited(mut self, limit: impl FnOnce(Envelope) -> Envelope) -> Self {
        self.envelope = limit(self.envelope);
        self
    }
}
