//! Instructions, and waiting until what they started has ended.

use std::fmt;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::axis::AXES;
use r6_proto::message::Instruction;
use tokio::time::{Instant, sleep, timeout_at};

use crate::error::{Invalid, NotSent, RequestError};
use crate::evidence::rest::Rest;
use crate::evidence::restart::Restart;
use crate::evidence::{About, Observation, Sample};
use crate::guard::{AxisUnits, Start};
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::moves::Motion;
use crate::path::place::Missed;
use crate::robot::{Accepted, Robot};
use crate::status::{AlarmAdvice, components, position_addresses};
use crate::stream::MotionError;
use r6_proto::OperationMode;

/// Reads that may fail in a row before waiting is given up: one lost reply says nothing about the arm.
const MAX_FAILED_READS: u32 = 3;

/// How to wait until a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaitOptions {
    /// The pause between the answer to one read of the state and the next read. Default 50 ms, which real
    /// controllers bear for hours. There is no minimum: with 0 the state is read as fast as answers come.
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

/// A motion has ended: the arm stands, without alarm, and as far as the controller tells its list is done.
///
/// [`Self::proof`] says what was seen of it. All of it was read over the connection that the motion was sent on.
#[derive(Clone, Debug, PartialEq)]
pub struct Done {
    /// The motion, as numbered by [`crate::MotionHandle::number`]; `None` where [`Robot::wait_until_done`] watched what no
    /// [`Robot::run`] of this handle had sent.
    pub motion: Option<u64>,
    /// What proves the end.
    pub proof: EndProof,
    /// `axis-0` to `axis-5`, degrees; `None` where not known.
    pub axes: [Option<f64>; AXES],
    /// `world-0` to `world-5`, mm and degrees; `None` where not known.
    pub pose: [Option<f64>; AXES],
    /// The operation mode.
    pub mode: Option<OperationMode>,
    /// Whether a look saw the arm move, or a list that was not empty.
    pub moved: bool,
    /// How long it took from the first read on.
    pub took: Duration,
}

/// What proves that a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EndProof {
    /// The arm stands where the last move ends, and it moved, or was elsewhere before. Exception: a motion to
    /// where the arm stands already; then [`Done::moved`] may be false.
    Reached,
    /// Where the last move ends cannot be compared (another tool or work frame), but the controller was seen to work
    /// through its list step by step, down to the last one.
    Consumed,
    /// The arm stands short of the end of the last move, which an input may cut short
    /// ([`crate::Motion::stop_on_input`]).
    CutShort(Missed),
    /// The arm stands with an empty list, as far as the controller tells; where the motion should have ended is not known
    /// or does not apply. A motion without a move ends like this, and whatever [`Robot::wait_until_done`] watches.
    AtRest,
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
    /// The connection was lost, and the controller seems to have been switched off and on.
    Restarted(Restart),
    /// It still went on when the time was up.
    TimedOut {
        /// The time it was given.
        after: Duration,
        /// Instructions left in the list, where the controller tells.
        list_length: Option<i64>,
    },
    /// The state cannot be read; the motion may go on.
    Request(RequestError),
    /// The connection that the motion was sent on is lost, or another robot answers. What is seen now does not tell whether
    /// the motion came to its end.
    AnotherConnection,
    /// The motion of this handle that was waited for did not come to its end.
    Motion(Box<MotionError>),
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
            Self::Restarted(restart) => restart.fmt(f),
            Self::TimedOut { after, list_length } => {
                write!(f, "the motion has not ended within {after:?}")?;
                if let Some(length) = list_length {
                    let are = if *length == 1 { "instruction is" } else { "instructions are" };
                    write!(f, ", {length} {are} left")?;
                }
                f.write_str("; wait longer or stop it (instructions that are not one-shot never end)")
            }
            Self::Request(error) => write!(f, "the state cannot be read, the motion may go on: {error}"),
            Self::AnotherConnection => f.write_str(
                "the connection that the motion was sent on is lost; what another one shows does not tell whether the \
                 motion came to its end: look at the arm",
            ),
            Self::Motion(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for WaitError {}

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
        // Before anything is waited for: a stop that is asked for meanwhile takes this list back.
        let stops_before = Some(self.hub().stops_asked());
        // An empty list is the same wherever the arm stands.
        let _turn = if instructions.is_empty() { None } else { Some(self.lists().await) };
        let only_on = self.held_against_guard(replace, &instructions, units).await?;
        let terms = Terms { only_on, stops_before, ..Terms::default() };
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
            let Observation { connection, values: sample, .. } = self.observe(Lane::Ordinary).await?;
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

    /// Waits until the arm stands and the list is done. No answer to a command counts, only state.
    ///
    /// While a motion of [`Robot::run`] is under way over this connection, this waits for its end; after one that did not
    /// come to its end, and whose handle nobody asked, it tells that once ([`WaitError::Motion`]). Otherwise it watches the
    /// state: call it right after the instructions were accepted ([`Robot::add_rcc`]).
    ///
    /// Instructions that are not one-shot run again and again: then it ends with the time-out. Dropping the future ends the
    /// watching, not the motion.
    ///
    /// # Errors
    /// [`WaitError`]. An alarm that was there before counts too. What another connection shows than the instructions were
    /// accepted on is no end ([`WaitError::AnotherConnection`]); that is told once, and the next call watches the present
    /// connection.
    pub async fn wait_until_done(&self, options: WaitOptions) -> Result<Done, WaitError> {
        let begun = Instant::now();
        let deadline = begun + options.timeout;
        let timed_out = |list_length| WaitError::TimedOut { after: options.timeout, list_length };
        match timeout_at(deadline, self.motions().end_of_last()).await {
            Ok(Some(Ok(done))) => return Ok(done),
            Ok(Some(Err(error))) => return Err(WaitError::Motion(Box::new(error))),
            Ok(None) => {}
            Err(_elapsed) => return Err(timed_out(None)),
        }
        let about = self.motions().sent_on().unwrap_or_else(|| self.about());
        let mut rest = Rest::new(options, about.clone(), begun);
        let mut failed = 0;
        loop {
            let Ok(read) = timeout_at(deadline, self.observe(Lane::Ordinary)).await else {
                return Err(timed_out(rest.list_length()));
            };
            match read {
                Ok(seen) => {
                    failed = 0;
                    let at_rest = match rest.judge(&seen, Instant::now()) {
                        Ok(at_rest) => at_rest,
                        Err(error) => {
                            let another = seen.connection != about.connection;
                            if another {
                                self.motions().forget_sent_on();
                            }
                            let restart = if another {
                                self.restart_since(&about, &seen, options.idle_mode).await
                            } else {
                                None
                            };
                            return Err(restart.map_or(error, WaitError::Restarted));
                        }
                    };
                    if at_rest {
                        self.motions().forget_sent_on();
                        let Sample { axes, pose, mode, .. } = seen.values;
                        let (moved, took) = (rest.moved, begun.elapsed());
                        return Ok(Done {
                            motion: None,
                            proof: EndProof::AtRest,
                            axes,
                            pose,
                            mode,
                            moved,
                            took,
                        });
                    }
                }
                Err(error) => {
                    rest.missed();
                    failed += 1;
                    if failed >= MAX_FAILED_READS || error == RequestError::NotSent(NotSent::Closed) {
                        return Err(WaitError::Request(error));
                    }
                }
            }
            if timeout_at(deadline, sleep(options.interval)).await.is_err() {
                return Err(timed_out(rest.list_length()));
            }
        }
    }

    /// The present connection and who is there, as far as is known.
    pub(crate) fn about(&self) -> About {
        let known = self.hub().known();
        About { connection: known.connection, robot: known.present.clone() }
    }

    /// Reads what tells about motion.
    pub(crate) async fn observe(&self, lane: Lane) -> Result<Observation, RequestError> {
        let asked: Vec<Address> =
            [Address::IsMoving, Address::CurAlarm, Address::CurMode, Address::RemoteCmdLen]
                .into_iter()
                .chain(position_addresses())
                .collect();
        let (read, connection, asked_at) = self.query_on_one_connection(lane, &asked).await?;
        let values = Sample {
            moving: read.flag(Address::IsMoving),
            alarm: read.integer(Address::CurAlarm),
            mode: read.integer(Address::CurMode).map(OperationMode::of_number),
            list_length: read.integer(Address::RemoteCmdLen),
            axes: components(&read, Address::Axis),
            pose: components(&read, Address::World),
        };
        let robot = self.hub().identity_on(connection);
        Ok(Observation { robot, connection, asked_at, values })
    }
}
