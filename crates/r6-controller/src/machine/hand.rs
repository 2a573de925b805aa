//! Moves by hand: jogging one axis, and homing. They are not steps of a program, and need mode manual.

use std::time::Duration;

use r6_motion::robot_model::Limits;
use r6_motion::{Axes, Conditions, Move, MoveMask, MoveSpeed, MoveTarget, Movement};
use r6_proto::alarm::AlarmCode;
use r6_proto::time::Instant;
use r6_proto::{AXES, AxisIndex, OperationMode};

use super::Machine;
use super::execution::Run;
use super::halt::AfterHalt;
use crate::event::{AlarmCause, Event};
use crate::panel::Refused;

/// The homing speed, in percent of the axes' full speed. Chosen: slow enough to be stopped by hand.
const HOMING_PERCENT: f64 = 20.0;

/// How long an axis moves after its button was last seen pressed. A page that stalls, or a link that is lost,
/// lets it run no longer: at full speed an axis turns some 40 degrees in this time, at the usual 10 % some
/// 4. A page asks three times within it, so one late request does not stop the arm.
pub const HELD_FOR: Duration = Duration::from_millis(200);

/// A move by hand that is under way.
#[derive(Clone, Debug)]
pub(super) struct HandMove {
    pub run: Run,
    arrival: Arrival,
    /// For a move that lasts as long as a button is held: when it ends if the button is not seen pressed
    /// again.
    pub held_until: Option<Instant>,
}

/// What follows after a move by hand reaches its end.
#[derive(Clone, Copy, Debug)]
enum Arrival {
    /// Nothing.
    Rest,
    /// It has reached a soft limit, which raises this alarm.
    AtLimit(AlarmCode),
    /// The machine is homed.
    Homed,
}

impl Machine {
    /// Moves one axis by this many degrees or mm, as far as its soft limits allow.
    pub(super) fn jog(&mut self, axis: AxisIndex, by: f64, percent: f64) -> Result<(), Refused> {
        let no_axis = Refused::NoSuchAxis { axis, axes: self.model.axis_count() };
        let limits = self.model.drives().nth(axis.index()).map(|drive| drive.soft).ok_or(no_axis)?;
        if !by.is_finite() || by == 0.0 {
            return Err(Refused::NoDistance);
        }
        if !(percent > 0.0 && percent <= 100.0) {
            return Err(Refused::BadSpeed);
        }
        self.ready_for_hand()?;
        self.note(Event::MovedByHand { axis, by, percent });
        self.begin_jog(axis, limits, by, percent)
    }

    /// Moves one axis up or down as long as its button is held: until [`Self::let_go`], or until
    /// [`Self::still_held`] was not called for [`HELD_FOR`]. It ends at the soft limit.
    pub(super) fn hold(&mut self, axis: AxisIndex, up: bool, percent: f64) -> Result<(), Refused> {
        let no_axis = Refused::NoSuchAxis { axis, axes: self.model.axis_count() };
        let limits = self.model.drives().nth(axis.index()).map(|drive| drive.soft).ok_or(no_axis)?;
        if !(percent > 0.0 && percent <= 100.0) {
            return Err(Refused::BadSpeed);
        }
        self.ready_for_hand()?;
        self.note(Event::HeldByHand { axis, up, percent });
        // Beyond the limit, from wherever it is.
        let by = (limits.max - limits.min).abs()
            + self.axes.degrees().get(axis.index()).map_or(0.0, |at| at.abs());
        self.begin_jog(axis, limits, if up { by + 1.0 } else { -by - 1.0 }, percent)?;
        if let Some(hand) = &mut self.hand {
            hand.held_until = Some(self.now + HELD_FOR);
        }
        Ok(())
    }

    /// The button is still held. This begins no move.
    pub(super) fn still_held(&mut self) -> Result<(), Refused> {
        let until = self.now + HELD_FOR;
        let held = self.hand.as_mut().and_then(|hand| hand.held_until.as_mut());
        *held.ok_or(Refused::NotHeld)? = until;
        Ok(())
    }

    /// The button is let go: a move that lasts as long as it is held comes to rest. Other moves go on.
    pub(super) fn let_go(&mut self) {
        if self.held_until().is_some() {
            self.halt_hand(self.profile.action_stop_time);
        }
    }

    /// When a move ends whose button is not seen pressed any more.
    pub(super) fn held_until(&self) -> Option<Instant> {
        self.hand.as_ref()?.held_until
    }

    /// Moves one axis, as far as its soft limits allow.
    fn begin_jog(&mut self, axis: AxisIndex, limits: Limits, by: f64, percent: f64) -> Result<(), Refused> {
        let mut degrees: [f64; AXES] = *self.axes.degrees();
        let Some(slot) = degrees.get_mut(axis.index()) else { return Err(Refused::NoDistance) };
        // An axis outside its limits may come back, but not go farther out.
        let told = *slot + by;
        *slot = told.clamp(limits.min.min(*slot), limits.max.max(*slot));
        let arrival = match told {
            told if told > *slot => Arrival::AtLimit(AlarmCode::positive_limit(axis)),
            told if told < *slot => Arrival::AtLimit(AlarmCode::negative_limit(axis)),
            _ => Arrival::Rest,
        };
        let target = Axes::new(degrees).map_err(|_| Refused::NoDistance)?;
        self.begin_hand(target, MoveMask(1 << axis.number()), percent, arrival)
    }

    /// Moves all axes to 0, where the machine is homed.
    pub(super) fn home_by_hand(&mut self) -> Result<(), Refused> {
        self.ready_for_hand()?;
        self.note(Event::Homing);
        self.begin_hand(Axes::ZERO, MoveMask::SIX, HOMING_PERCENT, Arrival::Homed)
    }

    fn ready_for_hand(&self) -> Result<(), Refused> {
        if self.emergency_stop {
            return Err(Refused::EmergencyStop);
        }
        if self.mode != OperationMode::Manual {
            return Err(Refused::NotManual { mode: self.mode });
        }
        if self.alarm.is_raised() {
            return Err(Refused::Alarm { alarm: self.alarm });
        }
        if self.is_moving() {
            return Err(Refused::Moving);
        }
        if self.global_speed <= 0.0 {
            return Err(Refused::NoGlobalSpeed);
        }
        Ok(())
    }

    fn begin_hand(
        &mut self,
        target: Axes,
        mask: MoveMask,
        percent: f64,
        arrival: Arrival,
    ) -> Result<(), Refused> {
        let order = Move {
            target: MoveTarget::Axes(target),
            mask,
            speed: MoveSpeed::PercentOfMax(percent),
            delay: 0.0,
        };
        let conditions = Conditions {
            global: self.global_speed,
            ramps: self.ramps,
            frames: self.frames(),
            turning: self.profile.turning,
        };
        let movement = Movement::plan(&self.model, &self.axes, &order, &conditions)
            .map_err(|error| Refused::NoPath { reason: error.to_string() })?;
        // Drop the unfinished step of a program, because the arm leaves the place where that step began.
        self.halt(Duration::ZERO, AfterHalt::Drop);
        let run = Run::new(movement, self.now, r6_motion::Blend::new(0));
        self.hand = Some(HandMove { run, arrival, held_until: None });
        self.finish_hand();
        Ok(())
    }

    /// Brings a move by hand to rest within `time`. It does not continue.
    pub(super) fn halt_hand(&mut self, time: Duration) {
        if let Some(hand) = &mut self.hand {
            hand.run = hand.run.clone().sooner(time, self.now);
            hand.held_until = None;
        }
    }

    /// Applies a new global speed to a move by hand. At 0 it ends.
    pub(super) fn replan_hand(&mut self) {
        let Some(hand) = &mut self.hand else { return };
        let run = &hand.run;
        match run.movement.with_global(run.seconds(self.now), self.global_speed) {
            Ok(movement) => hand.run = run.clone().by(movement, self.now),
            Err(_) => self.halt_hand(self.profile.action_pause_time),
        }
    }

    /// Ends a move by hand once the arm rests, and one whose button was not seen pressed for too long.
    pub(super) fn finish_hand(&mut self) {
        if self.held_until().is_some_and(|until| until <= self.now) {
            self.note(Event::NotHeldAnyMore);
            self.let_go();
        }
        let Some(hand) = self.hand.take_if(|hand| hand.run.ends_at() <= self.now) else { return };
        let movement = &hand.run.movement;
        self.axes = movement.state_at(movement.duration()).axes;
        match hand.arrival {
            Arrival::AtLimit(alarm) if movement.reaches_end() => {
                self.raise(alarm, AlarmCause::MovedToLimit);
            }
            Arrival::Homed if movement.reaches_end() => {
                self.homed = true;
                self.note(Event::Homed);
            }
            Arrival::Rest | Arrival::AtLimit(_) | Arrival::Homed => {}
        }
    }
}
