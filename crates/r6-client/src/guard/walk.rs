//! Checks a list against an envelope, step by step.

use r6_proto::axis::{AXES, AxisIndex, AxisMask};
use r6_proto::message::instruction::{Action, Coordinates, Instruction, Manner};

use crate::guard::arc::arc_extremes;
use crate::guard::violation::{Checked, Violation};
use crate::guard::{Envelope, Reckoning};
use crate::units::position::AxisUnits;
use crate::units::{AxisCoordinate, Degrees, Millimetres};

/// The state of the check of one list, step by step.
pub(super) struct Walk<'e> {
    envelope: &'e Envelope,
    /// The present step, counted from 1.
    step: usize,
    /// The axes where the step begins, as far as they are known.
    pub axes: [Option<f64>; AXES],
    pub pose: [Option<f64>; AXES],
    /// Whether the list may begin anywhere. Then the length of the first move is not checked.
    pub start_is_open: bool,
    other_frame: bool,
    /// Whether the frame was changed before this list.
    frame_is_unknown: bool,
    /// Whether an input may stop any move. Then the end of a move is not known.
    may_be_cut: bool,
    path_speed: bool,
}

impl<'e> Walk<'e> {
    pub fn new(envelope: &'e Envelope, reckoning: Reckoning) -> Self {
        Self {
            envelope,
            step: 0,
            axes: [None; AXES],
            pose: [None; AXES],
            start_is_open: false,
            other_frame: false,
            frame_is_unknown: reckoning.frame_is_unknown,
            may_be_cut: reckoning.may_be_cut,
            path_speed: false,
        }
    }
}

impl Walk<'_> {
    /// Checks a list from its beginning to its end. If it repeats, also checks a second round, starting where
    /// the first ends. Steps beyond the end of `units` count as given in bare numbers.
    pub fn list(&mut self, steps: &[Instruction], units: &[AxisUnits]) -> Result<(), Violation> {
        let rounds = if steps.iter().any(|step| !step.oneshot) { 2 } else { 1 };
        for _ in 0..rounds {
            self.step = 0;
            let units = units.iter().copied().chain(std::iter::repeat(AxisUnits::default()));
            steps.iter().zip(units).try_for_each(|(step, units)| self.step(step, units))?;
        }
        Ok(())
    }

    fn step(&mut self, instruction: &Instruction, units: AxisUnits) -> Result<(), Violation> {
        self.step += 1;
        let number = instruction.action.number();
        if self.envelope.only.as_ref().is_some_and(|only| !only.contains(&number)) {
            return Err(self.beyond(Checked::Action(number), None, (0.0, 0.0)));
        }
        match &instruction.action {
            Action::AxisMove(step) => {
                self.speed(&step.manner, false)?;
                self.axis_move(&step.target, moved(&step.manner, step.target.given()), units)
            }
            Action::LinearMove(step) => {
                self.speed(&step.manner, true)?;
                self.frames(&step.manner)?;
                self.tool_move(&step.target, moved(&step.manner, step.target.given()), None)
            }
            Action::CurveMove(curve) => {
                self.speed(&curve.manner, true)?;
                self.frames(&curve.manner)?;
                let given = curve.end.given().and(curve.middle.given());
                self.tool_move(&curve.end, moved(&curve.manner, given), Some(&curve.middle))
            }
            Action::PathSpeed(speed) => {
                self.path_speed = speed.in_use;
                match (self.envelope.path_speed_cap, speed.speed) {
                    (Some(cap), told) if speed.in_use && !told.is_some_and(|told| told <= cap.value()) => {
                        Err(self.beyond(Checked::PathSpeed, told, (0.0, cap.value())))
                    }
                    (Some(_) | None, _) => Ok(()),
                }
            }
            Action::Workbench(_) | Action::Unknown(_) => {
                self.other_frame = true;
                Ok(())
            }
            Action::StopOnSignal(stop) => {
                self.may_be_cut = stop.in_use;
                Ok(())
            }
            Action::Wait(_) | Action::Output(_) | Action::BoardOutput(_) => Ok(()),
        }
    }

    fn beyond(&self, what: Checked, value: Option<f64>, limit: (f64, f64)) -> Violation {
        Violation { step: self.step, what, value, limit }
    }

    fn speed(&self, manner: &Manner, along_path: bool) -> Result<(), Violation> {
        let (cap, path_cap) = (self.envelope.speed_cap, self.envelope.path_speed_cap);
        match (manner.speed, cap, path_cap) {
            // Only the step that sets a path speed is compared with its limit. Where no step of this list
            // does, an earlier list or a taught program may have set any.
            (None, _, Some(path_cap)) if along_path && !self.path_speed => {
                Err(self.beyond(Checked::PathSpeed, None, (0.0, path_cap.value())))
            }
            (None, _, Some(_)) if along_path => Ok(()),
            (_, None, _) => Ok(()),
            (Some(speed), Some(cap), _) if speed <= cap.value() => Ok(()),
            (speed, Some(cap), _) => Err(self.beyond(Checked::Speed, speed, (0.0, cap.value()))),
        }
    }

    /// Checks the frames of a move. Positions in another frame, or of another tool, cannot be compared.
    fn frames(&self, manner: &Manner) -> Result<(), Violation> {
        if self.envelope.workspace.is_none() && self.envelope.largest_distance.is_none() {
            return Ok(());
        }
        if self.other_frame || manner.tool.is_some() || manner.coord.is_some() {
            return Err(self.beyond(Checked::Frame, None, (0.0, 0.0)));
        }
        if self.frame_is_unknown {
            return Err(self.beyond(Checked::FrameUnknown, None, (0.0, 0.0)));
        }
        Ok(())
    }

    fn axis_move(&mut self, target: &Coordinates, mask: AxisMask, units: AxisUnits) -> Result<(), Violation> {
        for axis in mask.axes() {
            let (Some(to), at) = (target.at(axis), axis.index()) else { continue };
            let limits = self.envelope.axis_limits.get(at).copied().flatten();
            self.unit(axis, limits, units)?;
            if let Some((lowest, highest)) = limits
                && !(lowest.value()..=highest.value()).contains(&to)
            {
                return Err(self.beyond(
                    Checked::Axis(axis, slides(limits)),
                    Some(to),
                    (lowest.value(), highest.value()),
                ));
            }
            let largest = if slides(limits) {
                self.envelope.largest_distance.map(Millimetres::value)
            } else {
                self.envelope.largest_axis_step.map(Degrees::value)
            };
            if let Some(largest) = largest {
                let by = self.axes.get(at).copied().flatten().map(|from| (to - from).abs());
                // NaN is not within the limit either.
                if !by.map_or(self.start_is_open, |by| by <= largest) {
                    return Err(self.beyond(Checked::AxisStep(axis, slides(limits)), by, (0.0, largest)));
                }
            }
            if let Some(slot) = self.axes.get_mut(at) {
                *slot = Some(to).filter(|_| !self.may_be_cut);
            }
        }
        self.start_is_open = false;
        // After an axis move, the position of the tool is not known without a model of the arm.
        self.pose = [None; AXES];
        Ok(())
    }

    fn tool_move(
        &mut self,
        end: &Coordinates,
        mask: AxisMask,
        through: Option<&Coordinates>,
    ) -> Result<(), Violation> {
        let place = |coordinates: &Coordinates, axis: AxisIndex| {
            let kept = self.pose.get(axis.index()).copied().flatten();
            if mask.contains(axis) { coordinates.at(axis).or(kept) } else { kept }
        };
        let xyz = || AxisIndex::ALL.into_iter().take(3);
        let from: Vec<Option<f64>> =
            xyz().map(|axis| self.pose.get(axis.index()).copied().flatten()).collect();
        let to: Vec<Option<f64>> = xyz().map(|axis| place(end, axis)).collect();
        let middle: Option<Vec<Option<f64>>> =
            through.map(|through| xyz().map(|axis| place(through, axis)).collect());
        self.workspace(mask, &from, middle.as_deref(), &to)?;
        if let Some(largest) = self.envelope.largest_distance {
            let distance = point(&from).zip(point(&to)).map(|(from, to)| {
                from.iter().zip(to).map(|(from, to)| (to - from).powi(2)).sum::<f64>().sqrt()
            });
            if !distance.map_or(self.start_is_open, |distance| distance <= largest.value()) {
                return Err(self.beyond(Checked::Distance, distance, (0.0, largest.value())));
            }
        }
        for (slot, to) in self.pose.iter_mut().zip(to) {
            *slot = to.filter(|_| !self.may_be_cut);
        }
        self.axes = [None; AXES];
        self.start_is_open = false;
        Ok(())
    }
}

impl Walk<'_> {
    /// Checks the unit of an axis, because millimetres cannot be compared with degrees. An axis without
    /// limits in mm counts as turning.
    fn unit(
        &self,
        axis: AxisIndex,
        limits: Option<(AxisCoordinate, AxisCoordinate)>,
        units: AxisUnits,
    ) -> Result<(), Violation> {
        let compares = limits.is_some()
            || self.envelope.largest_axis_step.is_some()
            || self.envelope.largest_distance.is_some();
        let other = if slides(limits) { units.turning } else { units.sliding };
        if compares && other.contains(axis) {
            return Err(self.beyond(Checked::Unit(axis, slides(limits)), None, (0.0, 0.0)));
        }
        Ok(())
    }

    /// Whether the path stays in the workspace. A straight path does if its end is inside, because its start
    /// was.
    fn workspace(
        &self,
        mask: AxisMask,
        from: &[Option<f64>],
        middle: Option<&[Option<f64>]>,
        to: &[Option<f64>],
    ) -> Result<(), Violation> {
        let Some(workspace) = self.envelope.workspace else { return Ok(()) };
        let arc = match middle {
            None => None,
            Some(middle) => match (point(from), point(middle), point(to)) {
                (Some(from), Some(middle), Some(to)) => Some(arc_extremes(from, middle, to)),
                (None, Some(middle), Some(to)) if self.start_is_open => {
                    Some(arc_extremes(middle, middle, to))
                }
                _ => return Err(self.beyond(Checked::Arc, None, (0.0, 0.0))),
            },
        };
        for (axis, (lowest, highest)) in AxisIndex::ALL.into_iter().zip(workspace) {
            let at = axis.index();
            let reached = match &arc {
                Some(arc) => arc.get(at).copied(),
                // A component that the move does not change stays where it is.
                None if mask.contains(axis) => to.get(at).copied().flatten().map(|to| (to, to)),
                None => None,
            };
            let Some((low, high)) = reached else { continue };
            let inside = lowest.value()..=highest.value();
            if let Some(value) = [low, high].into_iter().find(|value| !inside.contains(value)) {
                let limit = (lowest.value(), highest.value());
                return Err(self.beyond(Checked::Place(axis), Some(value), limit));
            }
        }
        Ok(())
    }
}

fn point(components: &[Option<f64>]) -> Option<[f64; 3]> {
    match components {
        [Some(x), Some(y), Some(z)] => Some([*x, *y, *z]),
        _ => None,
    }
}

fn slides(limits: Option<(AxisCoordinate, AxisCoordinate)>) -> bool {
    matches!(limits, Some((AxisCoordinate::Millimetres(_), _)))
}

fn moved(manner: &Manner, given: AxisMask) -> AxisMask {
    manner.mask.unwrap_or(AxisMask::ALL).and(given)
}
