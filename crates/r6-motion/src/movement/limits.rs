//! Checks whether the sum of two motions stays within the soft limits.

use crate::axes::Axes;
use crate::robot_model::RobotModel;

/// At how many instants the axes are checked.
const LOOKS: u32 = 64;

/// Whether no axis can leave its soft limits between two times, if no axis is faster than this fraction of
/// its full speed. The axes are sampled often enough that none can be outside in between.
pub(super) fn stays_within(
    model: &RobotModel,
    from: f64,
    to: f64,
    fastest: f64,
    axes_at: impl Fn(f64) -> Axes,
) -> bool {
    let step = (to - from).max(0.0) / f64::from(LOOKS);
    (0..=LOOKS).all(|look| {
        let axes = axes_at(from + step * f64::from(look));
        axes.arm().into_iter().zip(&model.axes).all(|(degrees, figures)| {
            let between = figures.max_speed * fastest * step / 2.0;
            figures.soft.contains(degrees - between) && figures.soft.contains(degrees + between)
        })
    })
}
