//! `r6 -g URL alarms`: the alarms of a gateway's robots, and who saw them.

use clap::Args;
use r6_api::Code;
use r6_api::gateway::{RobotAlarm, RobotAlarmState, RobotAlarms};
use serde_json::json;

use crate::by_gateway::{ByGateway, GatewayRobot, shortened};
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output::table::Table;
use crate::output::{self, problem};
use crate::waiting;

/// Show the alarms of the robots of a gateway, and acknowledge one (with --gateway-url)
#[derive(Debug, Args)]
#[command(after_help = "\
The alarms that are there come first, then those that ended within a day. With --robot NAME those of this robot. \
`r6 alarm CODE` says what a code means, and what to do.

--acknowledge tells the others that you saw an alarm. It changes nothing at the robot: once the cause is gone, \
`r6 command clearAlarm` clears the alarm. The first who acknowledges an alarm stays. It takes the number of the \
alarm (ID), not its code, and a token of an operator.

The exit code is 3 if the alarms of a robot are not known, because no gateway answers for it at the moment. The \
others are shown then, too; with --json, `not_known` names the robots, and `problem` says why.

Examples:
  r6 -g http://127.0.0.1:9780 alarms --active
  r6 -g http://127.0.0.1:9780 -r press-4 alarms --json
  r6 -g http://127.0.0.1:9780 -r press-4 alarms --acknowledge 1764043200031200 --comment guard-door")]
pub struct AlarmsArgs {
    /// Leave out the alarms that have ended
    #[arg(long, conflicts_with = "acknowledge")]
    active: bool,
    /// Say that you saw the alarm with this number
    #[arg(long, value_name = "ID")]
    acknowledge: Option<u64>,
    /// What the others should know about it, 1 to 200 bytes
    #[arg(long, value_name = "TEXT", conflicts_with = "active")]
    comment: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Prints the alarms, or acknowledges one.
pub async fn run_by_gateway(args: AlarmsArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    if args.comment.is_some() && args.acknowledge.is_none() {
        return Err(Failure::usage("--comment goes with --acknowledge ID"));
    }
    let waiting = format!("waiting for an answer of {}", gateway.url().unwrap_or_default());
    let Some(id) = args.acknowledge else {
        let told = async {
            if gateway.has_robot() {
                gateway.robot().await?.alarms(args.active).await
            } else {
                gateway.gateway()?.alarms(args.active).await
            }
        };
        return Ok(show(&waiting::told(&waiting, told).await?, &args));
    };
    let robot = gateway.robot().await?;
    let comment = args.comment.clone();
    let alarm = match waiting::told(&waiting, robot.acknowledge(id, args.comment)).await {
        Ok(alarm) => alarm,
        Err(failure) if failure.code() == Code::NoSuchAlarm => {
            return Err(explained(failure, &robot, id).await);
        }
        Err(failure) => return Err(failure),
    };
    if args.json {
        output::json_pretty(&alarm);
    } else {
        let by = acknowledged(&alarm);
        output::line(format_args!(
            "{}: alarm {} ({}) is acknowledged: {by}",
            r6_proto::printable(&alarm.robot),
            alarm.code,
            r6_proto::printable(&alarm.text)
        ));
    }
    if comment.is_some() && alarm.acknowledged.as_ref().is_none_or(|seen| seen.comment != comment) {
        output::note("r6: your comment was not kept: the first who acknowledged the alarm stays");
    }
    Ok(Exit::Done)
}

/// Prints the alarms. Returns 3 if those of a robot are not known.
fn show(told: &RobotAlarms, args: &AlarmsArgs) -> Exit {
    let unknown = (!told.not_known.is_empty()).then(|| {
        let names: Vec<_> = told.not_known.iter().map(String::as_str).collect();
        Failure::no_reply(format!("the alarms of {} are not known now", shortened(&names)))
            .with_code(Code::NoOwner)
            .advise("ask again: another gateway takes a robot within seconds, if one can")
    });
    if args.json {
        let mut object = json!(told);
        if let Some(failure) = &unknown {
            object["problem"] = json!(problem::of(failure));
        }
        output::json_pretty(&object);
    } else if told.alarms.is_empty() {
        output::line(if args.active {
            "no alarm is there"
        } else {
            "no alarm is there, and none ended within a day"
        });
    } else {
        output::line(table(&told.alarms));
        if told.left_out > 0 {
            output::line(format_args!("{} more are not shown", told.left_out));
        }
    }
    match unknown {
        Some(failure) => {
            output::note(failure);
            Exit::NoReply
        }
        None => Exit::Done,
    }
}

fn table(alarms: &[RobotAlarm]) -> Table {
    let mut table = Table::with_right_columns(&[1]);
    table.row([&"ROBOT", &"CODE", &"ALARM", &"STATE", &"SINCE", &"ACKNOWLEDGED", &"ID"]);
    for alarm in alarms {
        let since = output::to_the_second(&alarm.since);
        let (state, by) = (state(alarm), acknowledged(alarm));
        table.row([&alarm.robot, &alarm.code, &alarm.text, &state, &since, &by, &alarm.id]);
    }
    table
}

fn state(alarm: &RobotAlarm) -> String {
    let state = match alarm.state {
        RobotAlarmState::Active => "THERE".to_owned(),
        RobotAlarmState::Unseen => "THERE when the robot was seen last".to_owned(),
        RobotAlarmState::Ended => match &alarm.until {
            Some(until) => format!("ended {}", output::to_the_second(until)),
            None => "ended".to_owned(),
        },
    };
    match &alarm.shelved {
        Some(shelved) => format!("{state}, shelved until {}", output::to_the_second(&shelved.until)),
        None => state,
    }
}

fn acknowledged(alarm: &RobotAlarm) -> String {
    let Some(seen) = &alarm.acknowledged else { return "-".to_owned() };
    let comment = seen.comment.as_ref().map(|comment| format!(", {comment}"));
    r6_proto::printable(&format!("{}{}", seen.by, comment.unwrap_or_default())).to_string()
}

/// Says which alarms there are to acknowledge. People write the code in place of the number.
async fn explained(failure: Failure, robot: &GatewayRobot, id: u64) -> Failure {
    let Ok(told) = robot.alarms(true).await else { return failure };
    match told.alarms.iter().find(|alarm| u64::from(alarm.code) == id).or(told.alarms.first()) {
        Some(alarm) => {
            let advice = hint::r6(&format!("alarms --acknowledge {}", alarm.id));
            failure.advise(format!(
                "alarm {} of {} has the number {}: `{advice}`",
                alarm.code,
                robot.name(),
                alarm.id
            ))
        }
        None => failure.advise(format!("no alarm of {} is there now", robot.name())),
    }
}
