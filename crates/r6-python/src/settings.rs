//! Settings of a connection and of a motion.

use std::time::Duration;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use r6_client::{Heartbeat, OperationMode};
use r6_proto::dialect::DsIdForm;
use r6_proto::message::TypeKey;

use crate::convert::{repr, seconds, word};
use crate::units::{Degrees, Given, Percent};

/// `TypeKey::Absent` is missing here, because a frame without the key gets no reply.
const TYPE_KEYS: [(&str, TypeKey); 2] = [("reqType", TypeKey::ReqType), ("cmdType", TypeKey::CmdType)];

const DS_IDS: [(&str, DsIdForm); 2] = [("long", DsIdForm::Long), ("short", DsIdForm::Short)];

/// Settings of a connection to a robot. The defaults suit every known firmware. Times are seconds.
///
/// - ``reply_timeout`` (2): how long a reply may take.
/// - ``connect_timeout`` (3): how long an attempt to connect may take.
/// - ``max_frame_bytes`` (2048): controllers neither answer nor execute longer lists.
/// - ``heartbeat`` (None: off): the time from one heartbeat to the next, 0.1 to 5. Other values are refused.
///   The first heartbeat arms a watchdog, which raises an alarm if no heartbeat comes for 10 s, also after
///   this program has died.
/// - ``suspect_after`` (1), ``dead_after`` (5): after how much silence values and connection are no longer
///   trusted.
/// - ``reconnect_first_wait`` (0.1), ``reconnect_cap`` (5), ``reconnect_seed``: the waits between attempts to
///   reconnect.
/// - ``type_key`` ("reqType"): the key of a request's type, ``"cmdType"`` for the oldest firmware.
/// - ``ds_id`` ("long"): the form of ``dsID``, ``"short"`` for older firmware (``HCRemoteMonitor``).
/// - ``stays_in_mode_7`` (False): whether this controller stays in mode 7 after a stop that it carried out.
///   No known controller does. If it is true, a rest of 2 s with an empty list also proves the standstill. A
///   taught program that waits longer may then still move the arm.
#[pyclass(frozen, module = "r6._r6")]
#[derive(Clone, Default)]
pub struct RobotSettings(pub r6_client::RobotSettings);

#[pymethods]
impl RobotSettings {
    #[new]
    #[pyo3(signature = (
        *, reply_timeout=None, connect_timeout=None, max_frame_bytes=None, heartbeat=None, suspect_after=None,
        dead_after=None, reconnect_first_wait=None, reconnect_cap=None, reconnect_seed=None, type_key=None, ds_id=None,
        stays_in_mode_7=false
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        reply_timeout: Option<f64>,
        connect_timeout: Option<f64>,
        max_frame_bytes: Option<usize>,
        heartbeat: Option<f64>,
        suspect_after: Option<f64>,
        dead_after: Option<f64>,
        reconnect_first_wait: Option<f64>,
        reconnect_cap: Option<f64>,
        reconnect_seed: Option<u64>,
        type_key: Option<&str>,
        ds_id: Option<&str>,
        stays_in_mode_7: bool,
    ) -> PyResult<Self> {
        let mut settings = r6_client::RobotSettings::default();
        time("reply_timeout", reply_timeout, &mut settings.reply_timeout)?;
        time("connect_timeout", connect_timeout, &mut settings.connect_timeout)?;
        time("suspect_after", suspect_after, &mut settings.liveness.suspect_after)?;
        time("dead_after", dead_after, &mut settings.liveness.dead_after)?;
        time("reconnect_first_wait", reconnect_first_wait, &mut settings.reconnect.first_wait)?;
        time("reconnect_cap", reconnect_cap, &mut settings.reconnect.cap)?;
        settings.reconnect.jitter_seed = reconnect_seed;
        settings.max_frame_bytes = max_frame_bytes.unwrap_or(settings.max_frame_bytes);
        if let Some(every) = heartbeat {
            // Rust clamps such a value to the range.
            let (shortest, longest) = (Heartbeat::SHORTEST.as_secs_f64(), Heartbeat::LONGEST.as_secs_f64());
            if !(shortest..=longest).contains(&every) {
                return Err(PyValueError::new_err(format!(
                    "heartbeat has to be {shortest} to {longest} s, or None for none, not {every}: the watchdog waits 10 s"
                )));
            }
            settings.heartbeat = Heartbeat::Managed { every: seconds("heartbeat", every)? };
        }
        settings.stays_in_mode_7 = stays_in_mode_7;
        if let Some(key) = type_key {
            settings.type_key = word("type_key", key, &TYPE_KEYS)?;
        }
        if let Some(form) = ds_id {
            settings.ds_id = word("ds_id", form, &DS_IDS)?;
        }
        Ok(Self(settings))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> Keywords<'py> {
        let r6_client::RobotSettings {
            reply_timeout,
            connect_timeout,
            max_frame_bytes,
            heartbeat,
            liveness,
            reconnect,
            type_key,
            ds_id,
            stays_in_mode_7,
            // Python has no permissions.
            permission: _,
        } = &self.0;
        let given = PyDict::new(py);
        given.set_item("reply_timeout", reply_timeout.as_secs_f64())?;
        given.set_item("connect_timeout", connect_timeout.as_secs_f64())?;
        given.set_item("max_frame_bytes", max_frame_bytes)?;
        if let Heartbeat::Managed { every } = heartbeat {
            given.set_item("heartbeat", every.as_secs_f64())?;
        }
        given.set_item("suspect_after", liveness.suspect_after.as_secs_f64())?;
        given.set_item("dead_after", liveness.dead_after.as_secs_f64())?;
        given.set_item("reconnect_first_wait", reconnect.first_wait.as_secs_f64())?;
        given.set_item("reconnect_cap", reconnect.cap.as_secs_f64())?;
        given.set_item("reconnect_seed", reconnect.jitter_seed)?;
        given.set_item("type_key", type_key.word())?;
        given.set_item("ds_id", ds_id_word(*ds_id))?;
        given.set_item("stays_in_mode_7", stays_in_mode_7)?;
        Ok((PyTuple::empty(py), given))
    }

    fn __repr__(&self) -> String {
        let settings = &self.0;
        let ds_id = ds_id_word(settings.ds_id);
        let heartbeat = match settings.heartbeat {
            Heartbeat::Off => "None".to_owned(),
            Heartbeat::Managed { every } => every.as_secs_f64().to_string(),
        };
        repr(
            "RobotSettings",
            &[
                ("reply_timeout", settings.reply_timeout.as_secs_f64().to_string()),
                ("connect_timeout", settings.connect_timeout.as_secs_f64().to_string()),
                ("max_frame_bytes", settings.max_frame_bytes.to_string()),
                ("heartbeat", heartbeat),
                ("type_key", format!("'{}'", settings.type_key.word())),
                ("ds_id", format!("'{ds_id}'")),
                ("stays_in_mode_7", if settings.stays_in_mode_7 { "True" } else { "False" }.to_owned()),
            ],
        )
    }
}

/// Options of a motion. Times are seconds.
///
/// - ``interval`` (0.05): the pause between two reads of the state; 0 reads as fast as answers come.
/// - ``frame_instructions`` (8): how many instructions one frame has at most.
/// - ``room`` (24): how many instructions the controller's list has at most. They still run if the connection
///   breaks.
/// - ``settle`` (0.5): how long the arm has to stand if the controller cannot report the length of its list.
/// - ``start_within`` (1): how long the arm may stand away from the end of an accepted list while its list is
///   empty.
/// - ``stall_within`` (5): how long the arm may stand without progress.
/// - ``idle_mode`` (7): the mode in which this controller waits for instructions.
/// - ``clear_leftover`` (False): clear a list that is left from before.
/// - ``append`` (False): append to the list, which may be running. The motion is sent at once and as a whole,
///   and its steps are not counted.
/// - ``stop_on_failure`` (True): stop the arm if the motion fails after something was sent.
/// - ``stop_on_drop`` (False): stop the arm when the handle is dropped or released, or the robot is closed.
///   Without it, a motion whose handle is dropped goes on to its end. A motion whose robot is closed ends
///   with the instructions in the controller's list.
#[pyclass(frozen, module = "r6._r6")]
#[derive(Clone, Copy, Default)]
pub struct RunOptions(pub r6_client::RunOptions);

#[pymethods]
impl RunOptions {
    #[new]
    #[pyo3(signature = (
        *, interval=None, frame_instructions=None, room=None, settle=None, start_within=None, stall_within=None,
        idle_mode=None, clear_leftover=None, append=None, stop_on_failure=None, stop_on_drop=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        interval: Option<f64>,
        frame_instructions: Option<usize>,
        room: Option<usize>,
        settle: Option<f64>,
        start_within: Option<f64>,
        stall_within: Option<f64>,
        idle_mode: Option<i64>,
        clear_leftover: Option<bool>,
        append: Option<bool>,
        stop_on_failure: Option<bool>,
        stop_on_drop: Option<bool>,
    ) -> PyResult<Self> {
        let mut options = r6_client::RunOptions::default();
        time("interval", interval, &mut options.interval)?;
        time("settle", settle, &mut options.settle)?;
        time("start_within", start_within, &mut options.start_within)?;
        time("stall_within", stall_within, &mut options.stall_within)?;
        options.frame_instructions = frame_instructions.unwrap_or(options.frame_instructions);
        options.room = room.unwrap_or(options.room);
        options.idle_mode = idle_mode.map_or(options.idle_mode, OperationMode::of_number);
        options.clear_leftover = clear_leftover.unwrap_or(options.clear_leftover);
        options.append = append.unwrap_or(options.append);
        options.stop_on_failure = stop_on_failure.unwrap_or(options.stop_on_failure);
        options.stop_on_drop = stop_on_drop.unwrap_or(options.stop_on_drop);
        Ok(Self(options))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> Keywords<'py> {
        let r6_client::RunOptions {
            interval,
            frame_instructions,
            room,
            settle,
            start_within,
            stall_within,
            idle_mode,
            clear_leftover,
            append,
            stop_on_failure,
            stop_on_drop,
        } = self.0;
        let given = PyDict::new(py);
        given.set_item("interval", interval.as_secs_f64())?;
        given.set_item("frame_instructions", frame_instructions)?;
        given.set_item("room", room)?;
        given.set_item("settle", settle.as_secs_f64())?;
        given.set_item("start_within", start_within.as_secs_f64())?;
        given.set_item("stall_within", stall_within.as_secs_f64())?;
        given.set_item("idle_mode", idle_mode.number())?;
        given.set_item("clear_leftover", clear_leftover)?;
        given.set_item("append", append)?;
        given.set_item("stop_on_failure", stop_on_failure)?;
        given.set_item("stop_on_drop", stop_on_drop)?;
        Ok((PyTuple::empty(py), given))
    }

    fn __repr__(&self) -> String {
        let options = &self.0;
        repr(
            "RunOptions",
            &[
                ("interval", options.interval.as_secs_f64().to_string()),
                ("frame_instructions", options.frame_instructions.to_string()),
                ("room", options.room.to_string()),
                ("clear_leftover", flag(options.clear_leftover)),
                ("append", flag(options.append)),
                ("stop_on_failure", flag(options.stop_on_failure)),
                ("stop_on_drop", flag(options.stop_on_drop)),
            ],
        )
    }
}

/// Options for following a moving target. Times are seconds.
///
/// The protocol has no command for it: each step is its own instruction. Small steps without a pause have
/// overloaded the servos of a real arm (reported). Its operator cut the speed to 20 %, made the steps larger,
/// and sent each step only while the arm stood. The defaults do the same.
///
/// - ``interval`` (0.05): the time between two checks of target and arm, 0.02 at least.
/// - ``speed`` (20 %): the speed of each step.
/// - ``smallest_step`` (1°): if the target is nearer than this, the arm does not move.
/// - ``largest_step`` (10°): the most that a step moves an axis. It also bounds how far the arm still goes
///   after targets, program or link are gone: two such steps. Both are mm for a linear axis.
/// - ``while_moving`` (False): append a step while the arm makes the step before. On a real arm try it at low
///   speed, and watch the load of the servos (``curTorque-n``).
/// - ``fresh_within`` (0.5): how long a target counts if no other target comes, not even the same again.
/// - ``start_within`` (1): how long the arm may stand away from the end of a step after the controller
///   accepted it.
/// - ``stall_within`` (5): how long a step may go on without progress.
/// - ``idle_mode`` (7): as in ``RunOptions``.
/// - ``stop_on_failure`` (True): stop the arm if following fails after a step was sent.
#[pyclass(frozen, module = "r6._r6")]
#[derive(Clone, Copy, Default)]
pub struct FollowOptions(pub r6_client::FollowOptions);

#[pymethods]
impl FollowOptions {
    #[new]
    #[pyo3(signature = (
        *, interval=None, speed=None, smallest_step=None, largest_step=None, while_moving=None, fresh_within=None,
        start_within=None, stall_within=None, idle_mode=None, stop_on_failure=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        interval: Option<f64>,
        speed: Option<Given<Percent>>,
        smallest_step: Option<Given<Degrees>>,
        largest_step: Option<Given<Degrees>>,
        while_moving: Option<bool>,
        fresh_within: Option<f64>,
        start_within: Option<f64>,
        stall_within: Option<f64>,
        idle_mode: Option<i64>,
        stop_on_failure: Option<bool>,
    ) -> PyResult<Self> {
        let mut options = r6_client::FollowOptions::default();
        time("interval", interval, &mut options.interval)?;
        time("fresh_within", fresh_within, &mut options.fresh_within)?;
        time("start_within", start_within, &mut options.start_within)?;
        time("stall_within", stall_within, &mut options.stall_within)?;
        options.speed = speed.map_or(options.speed, |speed| speed.0);
        options.smallest_step = smallest_step.map_or(options.smallest_step, |step| step.0);
        options.largest_step = largest_step.map_or(options.largest_step, |step| step.0);
        options.while_moving = while_moving.unwrap_or(options.while_moving);
        options.idle_mode = idle_mode.map_or(options.idle_mode, OperationMode::of_number);
        options.stop_on_failure = stop_on_failure.unwrap_or(options.stop_on_failure);
        if options.interval.is_zero() {
            return Err(PyValueError::new_err("interval has to be more than 0"));
        }
        Ok(Self(options))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> Keywords<'py> {
        let r6_client::FollowOptions {
            interval,
            speed,
            smallest_step,
            largest_step,
            while_moving,
            fresh_within,
            start_within,
            stall_within,
            idle_mode,
            stop_on_failure,
        } = self.0;
        let given = PyDict::new(py);
        given.set_item("interval", interval.as_secs_f64())?;
        given.set_item("speed", Percent(speed))?;
        given.set_item("smallest_step", Degrees(smallest_step))?;
        given.set_item("largest_step", Degrees(largest_step))?;
        given.set_item("while_moving", while_moving)?;
        given.set_item("fresh_within", fresh_within.as_secs_f64())?;
        given.set_item("start_within", start_within.as_secs_f64())?;
        given.set_item("stall_within", stall_within.as_secs_f64())?;
        given.set_item("idle_mode", idle_mode.number())?;
        given.set_item("stop_on_failure", stop_on_failure)?;
        Ok((PyTuple::empty(py), given))
    }

    fn __repr__(&self) -> String {
        let options = &self.0;
        repr(
            "FollowOptions",
            &[
                ("interval", options.interval.as_secs_f64().to_string()),
                ("speed", options.speed.value().to_string()),
                ("smallest_step", options.smallest_step.value().to_string()),
                ("largest_step", options.largest_step.value().to_string()),
                ("while_moving", flag(options.while_moving)),
                ("fresh_within", options.fresh_within.as_secs_f64().to_string()),
                ("stop_on_failure", flag(options.stop_on_failure)),
            ],
        )
    }
}

/// The keyword arguments that make a value again: for pickle.
type Keywords<'py> = PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)>;

fn ds_id_word(form: DsIdForm) -> &'static str {
    match form {
        DsIdForm::Long => "long",
        DsIdForm::Short => "short",
    }
}

/// A flag as Python writes it.
fn flag(flag: bool) -> String {
    if flag { "True" } else { "False" }.to_owned()
}

/// Sets a time if one is given.
fn time(what: &str, given: Option<f64>, slot: &mut Duration) -> PyResult<()> {
    if let Some(given) = given {
        *slot = seconds(what, given)?;
    }
    Ok(())
}
