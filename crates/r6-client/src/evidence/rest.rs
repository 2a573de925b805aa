//! The statement "the arm is at rest": it stands, without alarm, and its list is empty as far as is known.

use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::time::Instant;

use crate::done::{WaitError, WaitOptions};
use crate::error::RequestError;
use crate::evidence::{About, Observation, Sample};

/// How long alarm or mode may have no value. One odd reply is tolerated. But the client does not wait longer
/// for an arm whose state it cannot judge.
const UNREADABLE_FOR: Duration = Duration::from_secs(1);

/// Judges observations of one robot over one connection, one after the other. Answers whether the arm is at
/// rest.
#[derive(Debug)]
pub(crate) struct Rest {
    pub options: WaitOptions,
    about: About,
    begun: Instant,
    last: Option<Sample>,
    still_since: Option<Instant>,
    unreadable_since: Option<Instant>,
    pub moved: bool,
}

impl Rest {
    pub fn new(options: WaitOptions, about: About, begun: Instant) -> Self {
        Self { options, about, begun, last: None, still_since: None, unreadable_since: None, moved: false }
    }

    /// How many instructions the list had when it was last read.
    pub fn list_length(&self) -> Option<i64> {
        self.last.and_then(|last| last.list_length)
    }

    /// A read failed: stillness has to be seen again from the start.
    pub fn missed(&mut self) {
        self.still_since = None;
        self.last = None;
    }

    /// Judges one observation. Returns `Ok(true)` once the arm is at rest.
    ///
    /// # Errors
    /// [`WaitError`]: an alarm, a mode in which nothing runs, values without which the arm cannot be judged,
    /// or an observation of another robot or over another connection ([`WaitError::AnotherConnection`]).
    pub fn judge(&mut self, observation: &Observation, now: Instant) -> Result<bool, WaitError> {
        let sample = observation.values;
        if !observation.is_about(&self.about) {
            self.missed();
            // An alarm, or a mode in which nothing runs, says more than "another connection".
            sample.check(self.options.idle_mode)?;
            return Err(WaitError::AnotherConnection);
        }
        self.about.robot = self.about.robot.take().or_else(|| observation.robot.clone());
        sample.check(self.options.idle_mode)?;
        let unreadable = match (sample.alarm, sample.mode) {
            (None, _) => Some(Address::CurAlarm),
            (Some(_), None) => Some(Address::CurMode),
            (Some(_), Some(_)) => None,
        };
        if let Some(address) = unreadable {
            self.missed();
            if now - *self.unreadable_since.get_or_insert(now) < UNREADABLE_FOR {
                return Ok(false);
            }
            return Err(WaitError::Request(RequestError::no_value(address)));
        }
        self.unreadable_since = None;
        let stands = self.last.is_some_and(|last| sample.stands_since(&last));
        // A negative length is not an empty list.
        let more_to_come = sample.list_length.is_some_and(|length| length != 0);
        self.moved |= sample.moving == Some(true) || more_to_come || (self.last.is_some() && !stands);
        self.last = Some(sample);
        if !stands || more_to_come {
            self.still_since = None;
            return Ok(false);
        }
        let still_for = now - *self.still_since.get_or_insert(now);
        // If the list is known to be empty, the arm cannot be standing in a corner of its path.
        let settled = sample.list_length.is_some() || still_for >= self.options.settle;
        // A controller may answer a list before it reports that the arm moves.
        let started = self.moved || now - self.begun >= self.options.start_within;
        Ok(settled && started)
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::OperationMode;
    use r6_proto::axis::AXES;

    use super::*;
    use crate::identity::Identity;

    const STANDING: Sample = Sample {
        moving: Some(false),
        alarm: Some(0),
        mode: Some(OperationMode::Running),
        list_length: Some(0),
        axes: [Some(0.0), None, None, None, None, None, None, None],
        pose: [None; AXES],
    };

    fn moving(j1: f64) -> Sample {
        let mut sample = Sample { moving: Some(true), ..STANDING };
        sample.axes[0] = Some(j1);
        sample
    }

    fn about() -> About {
        About { connection: 1, robot: Some(Identity { axis_count: Some(6), ..Identity::default() }) }
    }

    fn observed(values: Sample) -> Observation {
        Observation {
            robot: about().robot,
            connection: 1,
            asked_at: Instant::ORIGIN + Duration::from_secs(100),
            values,
        }
    }

    #[test]
    fn what_another_robot_or_another_connection_shows_is_not_the_end() {
        let end = Sample { moving: Some(false), ..moving(9.0) };
        for other in [
            Observation { connection: 2, ..observed(end) },
            Observation {
                robot: Some(Identity { axis_count: Some(4), ..Identity::default() }),
                ..observed(end)
            },
        ] {
            let begun = Instant::ORIGIN + Duration::from_secs(100);
            let mut watch = Rest::new(WaitOptions::default(), about(), begun);
            assert_eq!(watch.judge(&observed(moving(1.0)), begun), Ok(false));
            assert_eq!(watch.judge(&other, begun), Err(WaitError::AnotherConnection), "{other:?}");
        }
    }

    /// Feeds samples 50 ms apart. Returns the index of the sample that ended the motion.
    fn done_after(samples: impl IntoIterator<Item = Sample>) -> Result<Option<usize>, WaitError> {
        let begun = Instant::ORIGIN + Duration::from_secs(100);
        let mut watch = Rest::new(WaitOptions::default(), about(), begun);
        for (n, sample) in samples.into_iter().enumerate() {
            if watch
                .judge(&observed(sample), begun + Duration::from_millis(50) * u32::try_from(n).unwrap())?
            {
                return Ok(Some(n));
            }
        }
        Ok(None)
    }

    #[test]
    fn standing_right_after_the_answer_is_not_the_end() {
        let samples = [STANDING, STANDING, STANDING, moving(1.0), moving(5.0)];
        assert_eq!(done_after(samples), Ok(None));
    }

    #[test]
    fn two_reads_at_rest_with_an_empty_list_end_a_motion() {
        let end = Sample { moving: Some(false), ..moving(9.0) };
        assert_eq!(done_after([moving(1.0), moving(8.0), end, end, end]), Ok(Some(3)));
    }

    #[test]
    fn a_list_with_steps_left_goes_on() {
        let corner = Sample { list_length: Some(2), ..STANDING };
        assert_eq!(done_after([moving(1.0)].into_iter().chain([corner; 100])), Ok(None));
    }

    #[test]
    fn a_list_that_had_steps_has_moved_the_arm_although_no_look_saw_it_move() {
        let waits = Sample { list_length: Some(1), ..STANDING };
        assert_eq!(done_after([waits, waits, STANDING, STANDING]), Ok(Some(2)));
    }

    #[test]
    fn without_a_list_length_a_corner_is_waited_out() {
        let unknown = |sample| Sample { list_length: None, ..sample };
        let corner = [unknown(STANDING); 7];
        let samples = [unknown(moving(1.0))].into_iter().chain(corner).chain([unknown(moving(2.0))]);
        assert_eq!(done_after(samples), Ok(None));
        // Standstill is first seen in the second read of the corner. 500 ms later it counts as the end.
        let samples = [unknown(moving(1.0))].into_iter().chain([unknown(STANDING); 20]);
        assert_eq!(done_after(samples), Ok(Some(12)));
    }

    #[test]
    fn without_any_motion_it_ends_after_the_time_to_start() {
        assert_eq!(done_after([STANDING; 30]), Ok(Some(20)));
    }

    #[test]
    fn axes_that_creep_are_motion_whatever_the_flag_says() {
        let creeping = (0..60).map(|n| Sample { moving: Some(false), ..moving(f64::from(n) * 0.05) });
        assert_eq!(done_after(creeping), Ok(None));
    }

    #[test]
    fn alarm_and_stop_end_it_at_once() {
        let alarm = Sample { alarm: Some(135), mode: Some(OperationMode::Stop), ..STANDING };
        assert_eq!(done_after([moving(1.0), alarm]), Err(WaitError::AlarmRaised { code: 135 }));
        let paused = Sample { mode: Some(OperationMode::Auto), ..moving(1.0) };
        assert_eq!(done_after([moving(1.0), paused]), Err(WaitError::Stopped { mode: OperationMode::Auto }));
    }

    #[test]
    fn an_alarm_or_mode_that_cannot_be_read_is_never_the_end() {
        for (unknown, name) in
            [(Sample { alarm: None, ..STANDING }, "curAlarm"), (Sample { mode: None, ..STANDING }, "curMode")]
        {
            assert_eq!(done_after([moving(1.0)].into_iter().chain([unknown; 20])), Ok(None));
            let error = done_after([moving(1.0)].into_iter().chain([unknown; 30])).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
        }
    }

    #[test]
    fn a_controller_that_idles_in_auto_may_return_there() {
        let idle = Sample { mode: Some(OperationMode::Auto), ..STANDING };
        let begun = Instant::ORIGIN + Duration::from_secs(100);
        let options = WaitOptions { idle_mode: OperationMode::Auto, ..WaitOptions::default() };
        let mut watch = Rest::new(options, about(), begun);
        assert_eq!(watch.judge(&observed(moving(0.0)), begun), Ok(false));
        assert_eq!(watch.judge(&observed(idle), begun), Ok(false));
        assert_eq!(watch.judge(&observed(idle), begun), Ok(true));
    }
}
