//! Axis moves: every axis moves evenly, and all arrive together.

use crate::axes::{ARM_AXES, Axes, AxisNumber, MoveMask};
use crate::error::PlanError;
use crate::path::PathAxes;
use crate::robot_model::RobotModel;

/// Every axis moves evenly from start to target, all at the same time (`action` 4, manual 6.1.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisPath {
    start: Axes,
    end: Axes,
    length: f64,
    slope: [f64; ARM_AXES],
}

impl AxisPath {
    /// Plans a path from the present axes to `target`; masked-out axes, and J7 and J8, stay.
    ///
    /// It is an error if an axis in the mask has a target outside its soft limits. An axis that is outside
    /// and does not move is no error, so that an arm can be brought back one axis at a time.
    pub fn plan(model: &RobotModel, start: &Axes, target: &Axes, mask: MoveMask) -> Result<Self, PlanError> {
        let mask = model.own_axes(mask);
        let end = mask.pick(start.arm(), target.arm());
        let outside =
            AxisNumber::ARM.into_iter().zip(end).zip(&model.axes).find_map(|((axis, end), figures)| {
                figures.soft.beyond(end).filter(|_| mask.has(axis.index())).map(|side| (axis, side))
            });
        if let Some((axis, side)) = outside {
            return Err(PlanError::OutsideLimits { axis, side });
        }
        let mut way = end;
        let mut length: f64 = 0.0;
        for ((way, start), axis) in way.iter_mut().zip(start.arm()).zip(&model.axes) {
            *way -= start;
            length = length.max(way.abs() / axis.max_speed);
        }
        let slope = if length > 0.0 { way.map(|way| way / length) } else { [0.0; ARM_AXES] };
        Ok(Self { start: *start, end: start.with_arm(end), length, slope })
    }

    /// The length in seconds at full speed of the slowest axis.
    #[must_use]
    pub const fn length(&self) -> f64 {
        self.length
    }

    /// The axes at a position on the path: the start before it, exactly the end from its length on.
    #[must_use]
    pub fn at(&self, position: f64) -> PathAxes {
        if position >= self.length {
            return PathAxes { axes: self.end, slope: self.slope };
        }
        let along = position.max(0.0);
        let mut arm = self.start.arm();
        for (axis, slope) in arm.iter_mut().zip(self.slope) {
            *axis += slope * along;
        }
        PathAxes { axes: self.start.with_arm(arm), slope: self.slope }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::error::LimitSide;
    use crate::kinematics::tests::{arm_in_limits, model};

    #[test]
    fn the_slowest_axis_sets_the_length() {
        let target = Axes::of_arm([22.08, 27.0, -37.5, 30.8, 90.0, -34.2]).unwrap();
        let path = AxisPath::plan(model(), &Axes::ZERO, &target, MoveMask::SIX).unwrap();
        assert!((path.length() - 0.3).abs() < 1e-12, "J5 takes longest: {}", path.length());
        let [.., j5, _] = path.at(0.1).slope;
        assert!((j5 - 300.0).abs() < 1e-9, "{j5}");
    }

    #[test]
    fn masked_out_axes_stay_and_are_not_judged() {
        let start = Axes::new([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]).unwrap();
        let target = Axes::new([10.0, 999.0, 10.0, 999.0, 10.0, 999.0, 10.0, 10.0]).unwrap();
        let path = AxisPath::plan(model(), &start, &target, MoveMask(0b1101_0101)).unwrap();
        assert_eq!(path.at(path.length()).axes.degrees(), &[10.0, 2.0, 10.0, 4.0, 10.0, 6.0, 7.0, 8.0]);
    }

    #[test]
    fn a_target_outside_names_axis_and_end() {
        let target = Axes::of_arm([0.0, 0.0, 0.0, 0.0, 0.0, -340.001]).unwrap();
        let error = AxisPath::plan(model(), &Axes::ZERO, &target, MoveMask::SIX).unwrap_err();
        assert_eq!(error, PlanError::OutsideLimits { axis: AxisNumber::ARM[5], side: LimitSide::Minus });
    }

    #[test]
    fn an_arm_outside_its_limits_can_come_back() {
        let start = Axes::of_arm([170.0, 80.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let path = AxisPath::plan(model(), &start, &Axes::ZERO, MoveMask(0b1)).unwrap();
        assert_eq!(path.at(9.0).axes.arm(), [0.0, 80.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn nowhere_to_go_is_a_path_of_no_length() {
        let path = AxisPath::plan(model(), &Axes::ZERO, &Axes::ZERO, MoveMask::SIX).unwrap();
        assert_eq!((path.length(), path.at(0.0).slope), (0.0, [0.0; 6]));
    }

    proptest! {
        #[test]
        fn axes_stay_between_start_and_end_and_below_their_speed(
            start in arm_in_limits(), target in arm_in_limits(), part in 0.0..1.0,
        ) {
            let target = Axes::of_arm(target).unwrap();
            let from = Axes::of_arm(start).unwrap();
            let path = AxisPath::plan(model(), &from, &target, MoveMask::SIX).unwrap();
            let here = path.at(path.length() * part);
            for (n, axis) in model().axes.iter().enumerate() {
                let (a, b) = (start[n], target.arm()[n]);
                prop_assert!((a.min(b) - 1e-9..=a.max(b) + 1e-9).contains(&here.axes.arm()[n]));
                prop_assert!(here.slope[n].abs() <= axis.max_speed * (1.0 + 1e-12));
            }
            prop_assert_eq!(path.at(path.length()).axes, target);
        }
    }
}
