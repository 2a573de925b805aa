//! The state of a robot at a glance, and whether it takes instructions.

use r6_proto::alarm::AlarmCode;
use r6_proto::readiness::{self, Readiness, ReadinessFacts};
use r6_proto::{Address, AxisIndex, OperationMode, Reading};
use serde::{Deserialize, Serialize};

use crate::position::{AxisPosition, Pose, SHOWN_AXES};
use crate::problem::{Code, CommandProblem};

/// The state of a robot, as read over its port. A value is `null` if the controller does not have it, or if
/// it cannot be parsed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Status {
    /// The address of the remote protocol, as the caller gave it; from the panel, as the controller listens
    /// on it.
    #[cfg_attr(feature = "openapi", schema(example = "127.0.0.1:9760"))]
    pub robot: String,
    /// Its name (`machineName`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub machine_name: Option<String>,
    /// Whether its name says that it is not a real machine.
    pub r#virtual: bool,
    /// Its firmware (`version`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub firmware: Option<String>,
    /// The program in use (`curMold`); only the pendant's port tells.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub program: Option<String>,
    /// The operation mode (`curMode`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub mode: Option<i64>,
    /// The operation mode in words.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "running (7)"))]
    pub mode_name: Option<String>,
    /// The alarm, 0 for none (`curAlarm`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub alarm: Option<i64>,
    /// The alarm in words; `null` without an alarm.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "135 (J6: positive soft limit)"))]
    pub alarm_text: Option<String>,
    /// Whether it is homed (`origin`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub homed: Option<bool>,
    /// Whether a move is under way (`isMoving`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub moving: Option<bool>,
    /// How many instructions are left in the list (`RemoteCmdLen`); older firmware does not tell.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub list_length: Option<i64>,
    /// How many axes the robot has (`axisNum`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub axis_count: Option<i64>,
    /// The axes that the robot has, J1 first, six at most (`axis-n`).
    pub axes: Vec<AxisPosition>,
    /// The pose of the tool in use, in the work frame in use (`world-n`).
    pub pose: Pose,
    /// Time of the present cycle, seconds (`curCycle`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub cycle_s: Option<f64>,
    /// Time of the last cycle that ended, seconds (`lastCycle`).
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub last_cycle_s: Option<f64>,
    /// Whether it takes instructions: `true` if the values prove every condition, `false` if a condition is
    /// not met, else `null`.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub ready: Option<bool>,
    /// The conditions that are not met, in the order in which to deal with them.
    pub unmet: Vec<Unmet>,
    /// The conditions that no value proves or disproves.
    pub unknown: Vec<Unproved>,
    /// Why it takes no instructions; absent if no condition is unmet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<CommandProblem>,
}

impl Status {
    /// The state according to the values of a robot; `read` returns `None` if an address has no value.
    ///
    /// `remote_program` is the name of a program that only waits for remote commands, if one is known.
    /// `list_is_unreadable`: whether a `RemoteCmdLen` came that cannot be read.
    pub fn read(
        robot: &str,
        remote_program: Option<&str>,
        list_is_unreadable: bool,
        read: impl Fn(Address) -> Option<Reading>,
    ) -> Self {
        let text = |address| if let Reading::Text(text) = read(address)? { Some(text) } else { None };
        let integer =
            |address| if let Reading::Integer(number) = read(address)? { Some(number) } else { None };
        let decimal =
            |address| if let Reading::Decimal(number) = read(address)? { Some(number) } else { None };
        let flag = |address| if let Reading::Flag(flag) = read(address)? { Some(flag) } else { None };
        let components = |address: fn(AxisIndex) -> Address| {
            let shown = AxisIndex::ALL.into_iter().take(SHOWN_AXES);
            shown.map(|axis| decimal(address(axis))).collect::<Vec<_>>()
        };

        let (machine_name, program) = (text(Address::MachineName), text(Address::CurMold));
        let mode = integer(Address::CurMode).map(OperationMode::of_number);
        let alarm = integer(Address::CurAlarm);
        let axis_count = integer(Address::AxisNum);
        let axes = components(Address::Axis);
        let shown = axis_count.and_then(|count| usize::try_from(count).ok()).unwrap_or(SHOWN_AXES);
        let facts = ReadinessFacts {
            program: program.as_deref(),
            mode,
            alarm,
            homed: flag(Address::Origin),
            moving: flag(Address::IsMoving),
            list_length: integer(Address::RemoteCmdLen),
            list_is_unreadable,
        };
        let unmet: Vec<_> = facts.unmet_with(remote_program).iter().map(Unmet::of).collect();
        Self {
            robot: robot.to_owned(),
            r#virtual: machine_name.as_deref().is_some_and(is_virtual),
            firmware: text(Address::Version),
            mode: mode.map(OperationMode::number),
            mode_name: mode.map(|mode| mode.to_string()),
            alarm,
            alarm_text: alarm.filter(|code| *code != 0).map(alarm_text),
            homed: facts.homed,
            moving: facts.moving,
            list_length: facts.list_length,
            axis_count,
            axes: AxisPosition::read(axes.get(..shown).unwrap_or(&axes)),
            pose: Pose::of(&components(Address::World)),
            cycle_s: decimal(Address::CurCycle),
            last_cycle_s: decimal(Address::LastCycle),
            ready: match facts.readiness(remote_program) {
                Readiness::Ready => Some(true),
                Readiness::NotReady(_) => Some(false),
                Readiness::Unknown(_) => None,
            },
            unknown: facts.unproved(remote_program).into_iter().map(Unproved::of).collect(),
            problem: (!unmet.is_empty()).then(|| not_ready(&unmet)),
            unmet,
            program,
            machine_name,
        }
    }
}

/// Whether a machine with this name says that it is a virtual controller.
#[must_use]
pub fn is_virtual(machine_name: &str) -> bool {
    machine_name.to_lowercase().contains("virtual")
}

/// An alarm in a few words, such as `135 (J6: positive soft limit)`; `code` is not 0.
#[must_use]
pub fn alarm_text(code: i64) -> String {
    match u32::try_from(code) {
        Ok(known) => format!("{code} ({})", AlarmCode(known).decode().text),
        Err(_negative) => code.to_string(),
    }
}

/// The problem of a machine that does not meet these conditions.
fn not_ready(unmet: &[Unmet]) -> CommandProblem {
    let names: Vec<_> = unmet.iter().map(|unmet| unmet.is.as_str()).collect();
    let message = format!("NOT READY: {}", names.join(", "));
    CommandProblem { code: Code::NotReady, message, advice: None, exit: 1 }
}

/// A condition that is required before instructions are sent, and is not met.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Unmet {
    /// Which: a word that does not change.
    pub condition: Condition,
    /// The mode, the alarm, or how many instructions are left; `null` for the other conditions.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub value: Option<i64>,
    /// The address that cannot be read; `null` for the other conditions.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub address: Option<String>,
    /// What is, in a few words.
    #[cfg_attr(feature = "openapi", schema(example = "mode is stop (3)"))]
    pub is: String,
    /// What to do about it.
    pub advice: String,
}

/// Which condition is not met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// The mode is not 7.
    Mode,
    /// There is an alarm.
    Alarm,
    /// The machine is not homed.
    NotHomed,
    /// The arm moves.
    Moving,
    /// Instructions are left in the list from before.
    LeftoverList,
    /// `--remote-program` named a program, and the controller runs another one.
    OtherProgram,
    /// A value that has to be known could not be read.
    Unknown,
}

impl Condition {
    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Mode => "mode",
            Self::Alarm => "alarm",
            Self::NotHomed => "not_homed",
            Self::Moving => "moving",
            Self::LeftoverList => "leftover_list",
            Self::OtherProgram => "other_program",
            Self::Unknown => "unknown",
        }
    }
}

impl Unmet {
    /// A condition from the type in `r6-proto`.
    #[must_use]
    pub fn of(unmet: &readiness::Unmet) -> Self {
        use readiness::Unmet as Of;
        let (condition, value, address, is) = match unmet {
            Of::Mode { found } => (Condition::Mode, Some(found.number()), None, format!("mode is {found}")),
            Of::Alarm { code } => (Condition::Alarm, Some(*code), None, format!("alarm {code}")),
            Of::NotHomed => (Condition::NotHomed, None, None, "not homed".to_owned()),
            Of::Moving => (Condition::Moving, None, None, "moving".to_owned()),
            Of::LeftoverList { length } => {
                let s = if *length == 1 { "" } else { "s" };
                let is = format!("{length} instruction{s} left in the list");
                (Condition::LeftoverList, Some(*length), None, is)
            }
            Of::OtherProgram => (Condition::OtherProgram, None, None, "another program".to_owned()),
            Of::Unknown { address } => {
                (Condition::Unknown, None, Some(address.to_string()), format!("{address} unknown"))
            }
        };
        Self { condition, value, address, is, advice: unmet.to_string() }
    }
}

/// A condition that no value proves or disproves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Unproved {
    /// The program is at its step that waits for remote commands: no firmware reports this.
    RemoteStep,
    /// No instructions are left in the list: older firmware does not report this.
    ListLength,
}

impl Unproved {
    /// A condition from the type in `r6-proto`.
    #[must_use]
    pub fn of(unproved: readiness::Unproved) -> Self {
        match unproved {
            readiness::Unproved::RemoteStep => Self::RemoteStep,
            readiness::Unproved::ListLength => Self::ListLength,
        }
    }

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::RemoteStep => "remote_step",
            Self::ListLength => "list_length",
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    /// A machine that is ready, except for the values in `changed`.
    fn status(changed: &[(Address, Option<Reading>)], remote_program: Option<&str>) -> Value {
        let read = |address| {
            if let Some((_, value)) = changed.iter().find(|(of, _)| *of == address) {
                return value.clone();
            }
            match address {
                Address::MachineName => Some(Reading::Text("r6 virtual BRTIRUS0707A".to_owned())),
                Address::CurMold => Some(Reading::Text("remote".to_owned())),
                Address::CurMode => Some(Reading::Integer(7)),
                Address::CurAlarm | Address::RemoteCmdLen => Some(Reading::Integer(0)),
                Address::AxisNum => Some(Reading::Integer(6)),
                Address::Origin => Some(Reading::Flag(true)),
                Address::IsMoving => Some(Reading::Flag(false)),
                Address::Axis(axis) | Address::World(axis) => {
                    Some(Reading::Decimal(f64::from(axis.number()) + 0.5))
                }
                _ => None,
            }
        };
        serde_json::to_value(Status::read("127.0.0.1:9760", remote_program, false, read)).unwrap()
    }

    #[test]
    fn each_value_has_its_unit_and_an_axis_has_none_that_nobody_told() {
        let json = status(&[], Some("remote"));
        assert_eq!(json["pose"]["x_mm"], 0.5);
        assert_eq!(json["pose"]["u_deg"], 3.5);
        assert_eq!(json["axes"][1], json!({ "name": "J2", "position": 1.5, "unit": null }));
        assert_eq!(json["axes"].as_array().map(Vec::len), Some(6));
        assert_eq!(json["last_cycle_s"], Value::Null);
        assert_eq!((&json["virtual"], &json["alarm_text"]), (&true.into(), &Value::Null));
    }

    #[test]
    fn as_many_axes_are_shown_as_the_robot_has_and_six_at_most() {
        for (count, shown) in [(Some(4), 4), (Some(6), 6), (Some(8), 6), (Some(-1), 6), (None, 6)] {
            let json = status(&[(Address::AxisNum, count.map(Reading::Integer))], None);
            assert_eq!(json["axes"].as_array().map(Vec::len), Some(shown), "{count:?}");
        }
    }

    #[test]
    fn ready_is_said_only_where_values_prove_it() {
        let no_length = (Address::RemoteCmdLen, None);
        let no_program = (Address::CurMold, None);
        for (changed, known, ready, unknown) in [
            (vec![], Some("remote"), Some(true), json!([])),
            (vec![], None, None, json!(["remote_step"])),
            (vec![no_program.clone()], Some("remote"), None, json!(["remote_step"])),
            (vec![no_length.clone()], Some("remote"), None, json!(["list_length"])),
            (vec![no_program, no_length], None, None, json!(["remote_step", "list_length"])),
        ] {
            let json = status(&changed, known);
            assert_eq!(
                (&json["ready"], &json["unknown"]),
                (&json!(ready), &unknown),
                "{changed:?} {known:?}"
            );
            assert_eq!((&json["unmet"], json.get("problem")), (&json!([]), None));
        }
        let other = status(&[], Some("wait"));
        assert_eq!(
            (&other["ready"], &other["unmet"][0]["condition"]),
            (&json!(false), &json!("other_program"))
        );
    }

    #[test]
    fn every_unmet_condition_is_named_with_its_value() {
        let changed = [
            (Address::CurMode, Some(Reading::Integer(3))),
            (Address::CurAlarm, Some(Reading::Integer(42))),
            (Address::Origin, None),
            (Address::RemoteCmdLen, Some(Reading::Integer(1))),
            (Address::IsMoving, Some(Reading::Flag(true))),
        ];
        let json = status(&changed, Some("remote"));
        let named: Vec<_> = json["unmet"]
            .as_array()
            .unwrap()
            .iter()
            .map(|one| (one["condition"].as_str().unwrap(), &one["value"], &one["address"]))
            .collect();
        let null = Value::Null;
        assert_eq!(
            named,
            [
                ("moving", &null, &null),
                ("leftover_list", &json!(1), &null),
                ("alarm", &json!(42), &null),
                ("unknown", &null, &json!("origin")),
                ("mode", &json!(3), &null),
            ]
        );
        assert_eq!((&json["ready"], &json["problem"]["code"]), (&json!(false), &json!("not_ready")));
        for unmet in json["unmet"].as_array().unwrap() {
            assert!(json["problem"]["message"].as_str().unwrap().contains(unmet["is"].as_str().unwrap()));
            assert!(!unmet["advice"].as_str().unwrap().is_empty());
        }
    }
}
