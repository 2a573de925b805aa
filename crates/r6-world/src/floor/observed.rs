//! The machine over time: whether it rests when it must, its limits, and its values at each instant.

use std::time::Duration;

use r6_controller::Controller;
use r6_proto::Address;
use r6_proto::alarm::AlarmCode;
use r6_proto::message::Reading;

use super::{AXES, Floor, SKEW};
use crate::fault::Promise;
use crate::record::Record;

/// How long observations are kept. No client calls older values fresh.
const REMEMBERED: Duration = Duration::from_secs(8);

/// The shortest and the longest interval over which speeds are compared, in seconds. Over a shorter interval
/// the difference is only rounding; over a longer one a peak is lost.
const COMPARED: [f64; 2] = [0.0009, 0.030];

/// The maximum acceleration and jerk of an axis, for one unit of its full speed: twice those of a stop from
/// full speed within 78 ms, as when one move is blended into the next (`docs/FIDELITY.md`).
const MOST_ACCELERATION: f64 = 2.0 * 2.0 / 0.078;

const MOST_JERK: f64 = 2.0 * 8.0 / (0.078 * 0.078);

/// The machine at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    pub at: Duration,
    pub mode: i64,
    pub alarm: AlarmCode,
    pub list: usize,
    pub axes: [f64; AXES],
    pub speeds: [f64; AXES],
}

impl Floor {
    pub(super) fn see(&mut self, at: Duration, controller: &Controller, record: &mut Record) {
        let machine = controller.machine();
        let motion = machine.motion();
        let mut sight = Sight {
            at,
            mode: machine.mode().number(),
            alarm: machine.alarm(),
            list: machine.list().len(),
            axes: [0.0; AXES],
            speeds: [0.0; AXES],
        };
        sight.axes.copy_from_slice(&motion.axes.degrees()[..AXES]);
        sight.speeds.copy_from_slice(&motion.axis_speeds[..AXES]);
        if let Some((since, place)) = &mut self.halted
            && at > *since
        {
            let place = *place.get_or_insert(sight.axes);
            record.check(Promise::I4, at, place == sight.axes, || {
                format!("{} moves from {place:?} to {:?}, and nobody started it", self.name, sight.axes)
            });
        }
        if let Some((since, place)) = &mut self.told
            && at > *since
        {
            let place = *place.get_or_insert(sight.axes);
            let stands = place == sight.axes;
            record.check(Promise::Stopped, at, stands, || {
                format!(
                    "{} stands since {since:?}, they say: it went from {place:?} to {:?}",
                    self.name, sight.axes
                )
            });
        }
        if let Some(since) = self.rests {
            let (name, mode) = (&self.name, machine.mode());
            record.check(Promise::I4, at, !mode.may_run(), || {
                format!("{name} is in mode {mode}, and nobody started it since {since:?}")
            });
        }
        self.limit(&sight, controller, record);
        while self.sights.front().is_some_and(|sight| sight.at + REMEMBERED < at) && self.sights.len() > 1 {
            self.sights.pop_front();
        }
        self.sights.push_back(sight);
    }

    /// Checks soft limits, speed, acceleration and jerk.
    fn limit(&mut self, sight: &Sight, controller: &Controller, record: &mut Record) {
        let model = controller.machine().model();
        for (number, (axis, (place, speed))) in
            model.drives().zip(sight.axes.iter().zip(sight.speeds)).enumerate()
        {
            let within = *place >= axis.soft.min - 1e-6 && *place <= axis.soft.max + 1e-6;
            record.check(Promise::I11, sight.at, within, || {
                format!("{}: J{} is at {place}", self.name, number + 1)
            });
            let slow = speed.abs() <= axis.max_speed * 1.0001 + 1e-6;
            record.check(Promise::I11, sight.at, slow, || {
                format!("{}: J{} has {speed} °/s", self.name, number + 1)
            });
        }
        if self.pace.back().is_some_and(|last| (sight.at.saturating_sub(last.at)).as_secs_f64() < COMPARED[0])
        {
            return;
        }
        self.pace.push_back(*sight);
        if self.pace.len() > 3 {
            self.pace.pop_front();
        }
        let [Some(first), Some(second), Some(third)] = [0, 1, 2].map(|n| self.pace.get(n)) else { return };
        let (before, after) = ((second.at - first.at).as_secs_f64(), (third.at - second.at).as_secs_f64());
        if before.max(after) > COMPARED[1] {
            return;
        }
        for (number, axis) in model.drives().enumerate() {
            let rise = |from: &Sight, to: &Sight, time: f64| (to.speeds[number] - from.speeds[number]) / time;
            let (one, other) = (rise(first, second, before), rise(second, third, after));
            let jerk = (other - one) / ((before + after) / 2.0);
            let (most, most_jerk) = (axis.max_speed * MOST_ACCELERATION, axis.max_speed * MOST_JERK);
            let way = (third.axes[number] - second.axes[number]).abs();
            let far = way <= axis.max_speed * after * 1.001 + 1e-6;
            record.check(Promise::I11, sight.at, far, || {
                format!("{}: J{} jumps by {way}", self.name, number + 1)
            });
            record.check(Promise::I11, sight.at, other.abs() <= most, || {
                format!("{}: J{} accelerates by {other} °/s², of {most}", self.name, number + 1)
            });
            record.check(Promise::I11, sight.at, jerk.abs() <= most_jerk, || {
                format!("{}: J{} has a jerk of {jerk} °/s³, of {most_jerk}", self.name, number + 1)
            });
        }
    }

    /// Whether the machine had this value at some time between the two; `None` if that is not known. After
    /// the last observation it keeps its values.
    #[must_use]
    pub fn was(&self, address: Address, reading: &Reading, from: Duration, to: Duration) -> Option<bool> {
        let (from, to) = (from.saturating_sub(SKEW), to + SKEW);
        if from <= self.booted || self.sights.front().is_none_or(|first| first.at > from) {
            return None;
        }
        #[expect(clippy::cast_possible_wrap, reason = "a short list")]
        let is_so = |sight: &Sight| match (address, reading) {
            (Address::CurMode, Reading::Integer(mode)) => Some(sight.mode == *mode),
            (Address::CurAlarm, Reading::Integer(alarm)) => Some(i64::from(sight.alarm) == *alarm),
            (Address::RemoteCmdLen, Reading::Integer(length)) => Some(sight.list as i64 == *length),
            (Address::Axis(axis), Reading::Decimal(place)) => {
                sight.axes.get(axis.index()).map(|was| (was - place).abs() < 2e-3)
            }
            _ => None,
        };
        let first = self.sights.iter().rev().find(|sight| sight.at <= from)?;
        let later =
            self.sights.iter().rev().skip_while(|sight| sight.at > to).take_while(|sight| sight.at > from);
        is_so(first)?;
        Some(std::iter::once(first).chain(later).any(|sight| is_so(sight) == Some(true)))
    }
}
