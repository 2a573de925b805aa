//! A guard: an envelope that lists are checked against before any step is sent.
//!
//! It compares numbers with numbers and is not a protective measure (docs/SAFETY.md).

mod arc;
pub(crate) mod violation;
mod walk;

use r6_proto::axis::{AXES, AxisIndex};
use r6_proto::message::Instruction;

pub use crate::guard::violation::{Checked, Violation};
use crate::guard::walk::Walk;
use crate::units::position::AxisUnits;
use crate::units::{AxisCoordinate, Degrees, Millimetres, MillimetresPerSecond, Percent};

/// Limits for lists. A limit that is not set is not checked. Limits in the wrong order, the lowest above the
/// highest, let nothing pass, and the error says so.
///
/// Speeds are those of the list, before the global speed. Axis limits apply to the targets of axis moves, and
/// the workspace to those of linear and curve moves, because the client has no model of the arm to convert
/// between them. If both matter, allow only one kind of move ([`Self::only`]). A straight line between two
/// points of the workspace does not leave it; of a curve the whole arc is checked.
///
/// An unknown value counts as beyond the limit: a step length from an unknown place, a workspace in another
/// work frame. While an input is watched that stops the motion (action 52), a move may end anywhere on its
/// way. The start of the next one is then unknown.
///
/// ```
/// use r6_client::units::{AxisPosition, Degrees, Percent};
/// use r6_client::{AxisIndex, Envelope, Motion};
///
/// let first = AxisIndex::ALL[0];
/// let envelope = Envelope::new()
///     .speed_cap(Percent::new(20.0)?)
///     .axis_limits(first, Degrees(-90.0), Degrees(90.0));
/// let motion = Motion::new().axis_move(AxisPosition::degrees([95.0]), Percent::new(10.0)?);
/// let beyond = envelope.check_motion(&motion).unwrap_err();
/// assert_eq!(beyond.to_string(), "step 1: J1 goes to 95 deg, outside of -90 to 90 deg");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelope {
    speed_cap: Option<Percent>,
    path_speed_cap: Option<MillimetresPerSecond>,
    axis_limits: [Option<(AxisCoordinate, AxisCoordinate)>; AXES],
    workspace: Option<[(Millimetres, Millimetres); 3]>,
    largest_axis_step: Option<Degrees>,
    largest_distance: Option<Millimetres>,
    only: Option<Vec<i64>>,
    /// Further envelopes that have to be passed, too. Their own `also` is empty, and each occurs once.
    also: Vec<Envelope>,
}

/// The position of the arm before the first step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub axes: [Option<f64>; AXES],
    pub pose: [Option<f64>; AXES],
}

/// Further facts that the check of a list depends on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reckoning {
    /// A tool or a workbench was set that may differ from that of the limits.
    pub frame_is_unknown: bool,
    /// An input may stop any move.
    pub may_be_cut: bool,
}

impl Envelope {
    /// An envelope that allows everything.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Limits the speed of moves. A move at the path speed is checked against [`Self::path_speed_cap`]
    /// instead. Without that cap it counts as beyond, because the client cannot convert mm/s to percent for
    /// sure.
    #[must_use]
    pub fn speed_cap(mut self, cap: Percent) -> Self {
        self.speed_cap = Some(cap);
        self
    }

    /// Limits the path speed (action 51). A move at the path speed in a list that does not set it is beyond
    /// the limit: an earlier list may have set any.
    #[must_use]
    pub fn path_speed_cap(mut self, cap: MillimetresPerSecond) -> Self {
        self.path_speed_cap = Some(cap);
        self
    }

    /// Limits the targets of this axis in axis moves: degrees, or millimetres for an axis that slides; the
    /// lowest first. A target in the other unit is beyond the limit ([`Checked::Unit`]). An axis without
    /// limits in millimetres counts as a turning axis.
    #[must_use]
    pub fn axis_limits<T: Into<AxisCoordinate>>(mut self, axis: AxisIndex, lowest: T, highest: T) -> Self {
        if let Some(slot) = self.axis_limits.get_mut(axis.index()) {
            *slot = Some((lowest.into(), highest.into()));
        }
        self
    }

    /// Limits linear and curve moves to this box: X, Y, Z, each from its lowest to its highest, in the work
    /// frame in use.
    #[must_use]
    pub fn workspace(mut self, lowest: [Millimetres; 3], highest: [Millimetres; 3]) -> Self {
        let ([x, y, z], [to_x, to_y, to_z]) = (lowest, highest);
        self.workspace = Some([(x, to_x), (y, to_y), (z, to_z)]);
        self
    }

    /// Limits how far an axis move turns an axis, from the present position and from target to target.
    #[must_use]
    pub fn largest_axis_step(mut self, largest: Degrees) -> Self {
        self.largest_axis_step = Some(largest);
        self
    }

    /// Limits the distance from start to end of linear and curve moves, and of each sliding axis.
    #[must_use]
    pub fn largest_distance(mut self, largest: Millimetres) -> Self {
        self.largest_distance = Some(largest);
        self
    }

    /// Allows only these actions, by their numbers: 4 axis move, 10 linear move, 17 curve move, 51 path
    /// speed, 52 stop on a signal, 100 wait, 200 output, 204 outputs of a board, 800 workbench.
    #[must_use]
    pub fn only(mut self, actions: impl IntoIterator<Item = i64>) -> Self {
        self.only = Some(actions.into_iter().collect());
        self
    }

    /// Combines two envelopes: a list has to pass this one and the other, each separately.
    #[must_use]
    pub fn and(mut self, mut other: Self) -> Self {
        let others = std::mem::take(&mut other.also);
        for one in std::iter::once(other).chain(others) {
            // Adding the same guard again and again does not lengthen the check.
            if !self.all().any(|known| known.same_bounds(&one)) {
                self.also.push(one);
            }
        }
        self
    }

    fn same_bounds(&self, other: &Self) -> bool {
        let alone = |envelope: &Self| Self { also: Vec::new(), ..envelope.clone() };
        alone(self) == alone(other)
    }

    /// This envelope, and the further ones that have to be passed, too.
    fn all(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.also)
    }

    /// Refuses limits in the wrong order: they are a mistake, probably swapped.
    fn in_order(&self) -> Result<(), Violation> {
        let wrong = |what, limit| Err(Violation { step: 0, what, value: None, limit });
        for (axis, limits) in AxisIndex::ALL.into_iter().zip(self.axis_limits) {
            let Some((lowest, highest)) = limits else { continue };
            let slides = matches!(lowest, AxisCoordinate::Millimetres(_));
            if slides != matches!(highest, AxisCoordinate::Millimetres(_)) {
                return wrong(Checked::Unit(axis, slides), (lowest.value(), highest.value()));
            }
            let (lowest, highest) = (lowest.value(), highest.value());
            // A range with NaN is empty.
            if (lowest..=highest).is_empty() {
                return wrong(Checked::Axis(axis, slides), (lowest, highest));
            }
        }
        for (axis, (lowest, highest)) in AxisIndex::ALL.into_iter().zip(self.workspace.into_iter().flatten())
        {
            if (lowest.value()..=highest.value()).is_empty() {
                return wrong(Checked::Place(axis), (lowest.value(), highest.value()));
            }
        }
        Ok(())
    }

    /// Checks a motion, without the step from the present position to the first target. If the motion
    /// repeats, the step from the last target back to the first is checked, too.
    ///
    /// # Errors
    /// [`Violation`]: the first step that goes beyond. A motion with a wrong step is not checked:
    /// [`crate::Robot::run`] refuses it.
    pub fn check_motion(&self, motion: &crate::Motion) -> Result<(), Violation> {
        let steps = motion.instructions().unwrap_or_default();
        self.all().try_for_each(|envelope| {
            envelope.in_order()?;
            let mut walk = Walk::new(envelope, Reckoning::default());
            walk.start_is_open = true;
            walk.list(steps, motion.units())
        })
    }

    /// Whether the check needs the present position.
    pub(crate) fn needs_start(&self) -> bool {
        self.all().any(|envelope| {
            envelope.largest_axis_step.is_some()
                || envelope.largest_distance.is_some()
                || envelope.workspace.is_some()
        })
    }

    /// Checks a list that begins with the arm at `from`. Steps without an entry in `units` were given as bare
    /// numbers.
    pub(crate) fn check(
        &self,
        steps: &[Instruction],
        units: &[AxisUnits],
        from: Option<Start>,
        reckoning: Reckoning,
    ) -> Result<(), Violation> {
        self.all().try_for_each(|envelope| {
            envelope.in_order()?;
            let mut walk = Walk::new(envelope, reckoning);
            if let Some(Start { axes, pose }) = from {
                walk.axes = axes;
                walk.pose = pose;
            }
            walk.list(steps, units)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::AxisPosition;

    #[test]
    fn a_list_that_repeats_is_measured_from_its_end_to_its_beginning() {
        let slow = Percent::new(5.0).unwrap();
        let once = [0.0, 20.0, 40.0]
            .iter()
            .fold(crate::Motion::new(), |motion, to| motion.axis_move(AxisPosition::degrees([*to]), slow));
        let envelope = Envelope::new().largest_axis_step(Degrees(30.0));
        assert_eq!(envelope.check_motion(&once), Ok(()));
        let violation = envelope.check_motion(&once.clone().repeat()).unwrap_err();
        assert_eq!(violation.to_string(), "step 1: J1 goes 40 deg in one step, more than 30 deg");
        let from = Some(Start { axes: [Some(0.0); AXES], pose: [None; AXES] });
        let round = once.repeat();
        let steps = round.instructions().unwrap();
        assert_eq!(envelope.check(steps, round.units(), from, Reckoning::default()), Err(violation));
    }

    #[test]
    fn violations_are_the_same_when_all_of_them_is() {
        let one = Violation { step: 1, what: Checked::Speed, value: Some(f64::NAN), limit: (0.0, 20.0) };
        assert_eq!(one, one);
        for other in [
            Violation { step: 2, ..one },
            Violation { what: Checked::Distance, ..one },
            Violation { value: Some(50.0), ..one },
            Violation { limit: (0.0, 30.0), ..one },
            Violation { limit: (1.0, 20.0), ..one },
        ] {
            assert_ne!(one, other);
        }
    }
}
