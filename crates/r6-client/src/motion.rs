//! Instructions, and waiting until what they started has ended.

use std::fmt;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::axis::AXES;
use r6_proto::message::Instruction;
use tokio::time::{Instant, sleep, timeout_at};

use crate::error::{Invalid, NotSent, OutcomeUnknown, RequestError};
use crate::guard::{AxisUnits, Start};
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::moves::Motion;
use crate::robot::{Accepted, Robot};
use crate::status::{AlarmAdvice, components, position_addresses};
use r6_proto::OperationMode;

/// Reads that may fail in a row before waiting is given up: one lost reply says nothing about the arm.
const MAX_FAILED_READS: u32 = 3;

/// How long alarm or mode may stay without a value: one odd reply passes, but an arm nobody can judge is not waited for.
const UNREADABLE_FOR: Duration = Duration::from_secs(1);

/// Two positions closer than this (degrees or mm) are the same: encoders tremble in the last digit at rest.
const STILL_WITHIN: f64 = 0.01;

/// Less than this, degrees, is no progress: encoders tremble.
const NO_PROGRESS: f64 = 1e-3;

/// How to wait until a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaitOptions {
    /// The time between two reads. Default 50 ms, which real controllers bear for hours.
    pub interval: Duration,
    /// How long to wait at most. Default 60 s.
    pub timeout: Duration,
    /// How long the arm has to stand where the controller cannot tell the length of its list. Default 500 ms: arms
    /// stand up to a third of a second in a corner that is not blended.
    pub settle: Duration,
    /// When no motion was seen until then, there was none, or it was shorter than the interval. Default 1 s. Make it
    /// longer than the longest delay or wait before the first move.
    pub start_within: Duration,
    /// The mode in which this controller waits for instructions. Default running (7); some go from auto (2) to
    /// running by themselves and back (reported, unit B).
    pub idle_mode: OperationMode,
}

impl Default for WaitOptions {
    fn default() -> Self {
        Self {
            interval: Duration::from_millis(50),
            timeout: Duration::from_secs(60),
            settle: Duration::from_millis(500),
            start_within: Duration::from_secs(1),
            idle_mode: OperationMode::Running,
        }
    }
}

/// The arm stands, without alarm, and as far as the controller tells its list is done.
///
/// That it stands where it was sent is for the caller to compare.
#[derive(Clone, Debug, PartialEq)]
pub struct Done {
    /// `axis-0` to `axis-5`, degrees; `None` where not known.
    pub axes: [Option<f64>; AXES],
    /// `world-0` to `world-5`, mm and degrees; `None` where not known.
    pub pose: [Option<f64>; AXES],
    /// The operation mode.
    pub mode: Option<OperationMode>,
    /// Whether a motion was seen at all.
    pub moved: bool,
    /// How long it took from the first read on.
    pub took: Duration,
}

/// Why waiting ended without the motion having ended as it should.
#[derive(Clone, Debug, PartialEq)]
pub enum WaitError {
    /// There is an alarm.
    AlarmRaised {
        /// Its number.
        code: i64,
    },
    /// The program does not run (any more): somebody stopped or paused it, or it was never started.
    Stopped {
        /// The mode the controller is in.
        mode: OperationMode,
    },
    /// It still went on when the time was up.
    TimedOut {
        /// The time it was given.
        after: Duration,
        /// Instructions left in the list, where the controller tells.
        list_length: Option<i64>,
    },
    /// The state cannot be read; the motion may go on.
    Request(RequestError),
}

impl fmt::Display for WaitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AlarmRaised { code } => {
                write!(
                    f,
                    "{}; clear the list too, or the rest of it may run at the next start",
                    AlarmAdvice(*code)
                )
            }
            Self::Stopped { mode } => write!(
                f,
                "the program does not run, the mode is {mode}: clear the list, or the rest of it may run at the next start; \
                 then press Start on the pendant"
            ),
            Self::TimedOut { after, list_length } => {
                write!(f, "the motion has not ended within {after:?}")?;
                if let Some(length) = list_length {
                    let are = if *length == 1 { "instruction is" } else { "instructions are" };
                    write!(f, ", {length} {are} left")?;
                }
                f.write_str("; wait longer or stop it (instructions that are not one-shot never end)")
            }
            Self::Request(error) => write!(f, "the state cannot be read, the motion may go on: {error}"),
        }
    }
}

impl std::error::Error for WaitError {}

/// What one read tells about motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub moving: Option<bool>,
    pub alarm: Option<i64>,
    pub mode: Option<OperationMode>,
    pub list_length: Option<i64>,
    pub axes: [Option<f64>; AXES],
    pub pose: [Option<f64>; AXES],
}

impl Sample {
    /// Refuses what ends a motion: an alarm, and a mode in which nothing runs.
    pub fn check(&self, idle_mode: OperationMode) -> Result<(), WaitError> {
        if let Some(code) = self.alarm.filter(|code| *code != 0) {
            return Err(WaitError::AlarmRaised { code });
        }
        match self.mode.filter(|mode| !mode.may_run() && *mode != idle_mode) {
            Some(mode) => Err(WaitError::Stopped { mode }),
            None => Ok(()),
        }
    }

    /// Whether an axis is elsewhere than before.
    pub fn went_on_from(&self, before: &[Option<f64>; AXES]) -> bool {
        self.axes.iter().zip(before).any(|(now, before)| match (now, before) {
            (Some(now), Some(before)) => (now - before).abs() > NO_PROGRESS,
            (Some(_), None) => true,
            (None, _) => false,
        })
    }

    /// Whether the arm stood from `before` to this one. Where `isMoving` is not known, the axes alone tell.
    pub fn stands_since(&self, before: &Self) -> bool {
        let same = self.axes.iter().zip(before.axes).all(|(now, before)| match (now, before) {
            (Some(now), Some(before)) => (now - before).abs() <= STILL_WITHIN,
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        });
        match (self.moving, before.moving) {
            (Some(now), Some(before)) => !now && !before && same,
            (None, _) | (_, None) => same && self.axes.iter().any(Option::is_some),
        }
    }
}

/// Judges reads, one after the other.
#[derive(Debug)]
pub(crate) struct Watch {
    pub options: WaitOptions,
    begun: Instant,
    last: Option<Sample>,
    still_since: Option<Instant>,
    unreadable_since: Option<Instant>,
    pub moved: bool,
}

impl Watch {
    pub fn new(options: WaitOptions, begun: Instant) -> Self {
        Self { options, begun, last: None, still_since: None, unreadable_since: None, moved: false }
    }

    /// A read failed: stillness has to be seen anew.
    pub fn missed(&mut self) {
        self.still_since = None;
        self.last = None;
    }

    /// `Ok(true)` once the motion has ended.
    pub fn judge(&mut self, sample: Sample, now: Instant) -> Result<bool, WaitError> {
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
            let request = Work::Query(Vec::new()).sent();
            let answer = format!("no value for {address}");
            return Err(WaitError::Request(OutcomeUnknown::Unclear { request, answer }.into()));
        }
        self.unreadable_since = None;
        let stands = self.last.is_some_and(|last| sample.stands_since(&last));
        let more_to_come = sample.list_length.is_some_and(|length| length > 0);
        self.moved |= sample.moving == Some(true) || more_to_come || (self.last.is_some() && !stands);
        self.last = Some(sample);
        if !stands || more_to_come {
            self.still_since = None;
            return Ok(false);
        }
        let still_for = now - *self.still_since.get_or_insert(now);
        // A list that is known to be empty cannot be standing in a corner.
        let settled = sample.list_length.is_some() || still_for >= self.options.settle;
        // A controller may answer a list before it says that it moves.
        let started = self.moved || now - self.begun >= self.options.start_within;
        Ok(settled && started)
    }
}

impl Robot {
    /// Sends instructions (manual 6): `replace` empties the list first, otherwise they are appended.
    ///
    /// `Ok` says that the list was taken, not that it runs: see [`Robot::wait_until_done`]. Replacing the list of an arm
    /// that moves has raised alarm 200 (reported, unit A).
    ///
    /// # Errors
    /// [`RequestError`]. It is never sent twice by itself. Behind a guard that asks where the arm is, it does not leave on another
    /// connection than that was read on ([`NotSent::Disconnected`]). A list longer than [`crate::RobotSettings::max_frame_bytes`] is
    /// not sent at all: send fewer instructions and append the rest.
    pub async fn add_rcc(
        &self,
        replace: bool,
        instructions: Vec<Instruction>,
    ) -> Result<Accepted, RequestError> {
        self.add_list(replace, instructions, &[]).await
    }

    /// Sends the steps of a motion as one list, as [`Self::add_rcc`] does. A guard knows the units of its axes.
    ///
    /// # Errors
    /// [`RequestError`], as there; [`Invalid::Step`] if a step is wrong.
    pub async fn add_motion(&self, replace: bool, motion: &Motion) -> Result<Accepted, RequestError> {
        let steps = motion.instructions().map_err(Invalid::Step)?.to_vec();
        self.add_list(replace, steps, motion.units()).await
    }

    async fn add_list(
        &self,
        replace: bool,
        instructions: Vec<Instruction>,
        units: &[AxisUnits],
    ) -> Result<Accepted, RequestError> {
        // An empty list is the same wherever the arm stands.
        let _turn = if instructions.is_empty() { None } else { Some(self.lists().await) };
        let only_on = self.held_against_guard(replace, &instructions, units).await?;
        let terms = Terms { only_on, ..Terms::default() };
        self.accepted_on(terms, Work::AddRcc { replace, instructions }, Lane::Ordinary).await
    }

    /// Checks a list against the guard of this handle, if it has one. Tells the connection that the list was judged on, if where the
    /// arm is counts: on another it may stand elsewhere.
    async fn held_against_guard(
        &self,
        replace: bool,
        instructions: &[Instruction],
        units: &[AxisUnits],
    ) -> Result<Option<u64>, RequestError> {
        let Some(envelope) = self.guard() else { return Ok(None) };
        let (mut from, mut only_on) = (None, None);
        if envelope.needs_start() && !instructions.is_empty() {
            let (sample, connection) = self.on_one_connection(|| self.sample(Lane::Ordinary)).await?;
            only_on = Some(connection);
            // What is appended begins where the list ends, and nobody knows where that is.
            let at_rest = sample.moving == Some(false) && (replace || sample.list_length == Some(0));
            from = at_rest.then_some(Start { axes: sample.axes, pose: sample.pose });
        }
        envelope.check(instructions, units, from, self.reckoning()).map_err(Invalid::OutsideEnvelope)?;
        Ok(only_on)
    }

    /// Empties the instruction list, so that nothing left in it runs at the next start.
    ///
    /// # Errors
    /// [`RequestError`].
    pub async fn clear_list(&self) -> Result<Accepted, RequestError> {
        self.add_rcc(true, Vec::new()).await
    }

    /// Watches the state until the arm stands and the list is done. No answer to a command counts, only state.
    ///
    /// Call it right after the instructions were accepted. Instructions that are not one-shot run again and again: then
    /// it ends with the time-out. Dropping the future ends the watching, not the motion.
    ///
    /// # Errors
    /// [`WaitError`]. An alarm that was there before counts too.
    pub async fn wait_until_done(&self, options: WaitOptions) -> Result<Done, WaitError> {
        let begun = Instant::now();
        let deadline = begun + options.timeout;
        let mut watch = Watch::new(options, begun);
        let mut failed = 0;
        loop {
            let list_length = watch.last.and_then(|last| last.list_length);
            let timed_out = WaitError::TimedOut { after: options.timeout, list_length };
            let Ok(read) = timeout_at(deadline, self.sample(Lane::Ordinary)).await else {
                return Err(timed_out);
            };
            match read {
                Ok(sample) => {
                    failed = 0;
                    if watch.judge(sample, Instant::now())? {
                        return Ok(Done {
                            axes: sample.axes,
                            pose: sample.pose,
                            mode: sample.mode,
                            moved: watch.moved,
                            took: begun.elapsed(),
                        });
                    }
                }
                Err(error) => {
                    watch.missed();
                    failed += 1;
                    if failed >= MAX_FAILED_READS || error == RequestError::NotSent(NotSent::Closed) {
                        return Err(WaitError::Request(error));
                    }
                }
            }
            if timeout_at(deadline, sleep(options.interval)).await.is_err() {
                return Err(timed_out);
            }
        }
    }

    /// Reads what tells about motion.
    pub(crate) async fn sample(&self, lane: Lane) -> Result<Sample, RequestError> {
        let asked: Vec<Address> =
            [Address::IsMoving, Address::CurAlarm, Address::CurMode, Address::RemoteCmdLen]
                .into_iter()
                .chain(position_addresses())
                .collect();
        let read = self.query_in(lane, &asked).await?;
        Ok(Sample {
            moving: read.flag(Address::IsMoving),
            alarm: read.integer(Address::CurAlarm),
            mode: read.integer(Address::CurMode).map(OperationMode::of_number),
            list_length: read.integer(Address::RemoteCmdLen),
            axes: components(&read, Address::Axis),
            pose: components(&read, Address::World),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// Feeds samples 50 ms apart; how many it took to be done.
    fn done_after(samples: impl IntoIterator<Item = Sample>) -> Result<Option<usize>, WaitError> {
        let begun = Instant::now();
        let mut watch = Watch::new(WaitOptions::default(), begun);
        for (n, sample) in samples.into_iter().enumerate() {
            if watch.judge(sample, begun + Duration::from_millis(50) * u32::try_from(n).unwrap())? {
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
    fn without_a_list_length_a_corner_is_waited_out() {
        let unknown = |sample| Sample { list_length: None, ..sample };
        let corner = [unknown(STANDING); 7];
        let samples = [unknown(moving(1.0))].into_iter().chain(corner).chain([unknown(moving(2.0))]);
        assert_eq!(done_after(samples), Ok(None));
        // The corner is first seen to stand in the read after it began; 500 ms later it is the end.
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
        let begun = Instant::now();
        let options = WaitOptions { idle_mode: OperationMode::Auto, ..WaitOptions::default() };
        let mut watch = Watch::new(options, begun);
        assert_eq!(watch.judge(moving(0.0), begun), Ok(false));
        assert_eq!(watch.judge(idle, begun), Ok(false));
        assert_eq!(watch.judge(idle, begun), Ok(true));
    }
}
