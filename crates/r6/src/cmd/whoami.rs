//! `r6 -g URL whoami`: who the caller of a gateway is, and what the caller may do.

use std::time::Duration;

use clap::Args;
use r6_api::gateway::{Role, Session};
use r6_gateway::{Grant, GrantRobots, RobotName};
use serde::Serialize;
use serde_json::json;

use crate::by_gateway::ByGateway;
use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::table::Table;
use crate::waiting;

/// Show whose token this is, and its role for each robot (with --gateway-url)
#[derive(Debug, Args)]
#[command(after_help = "\
The first line has the number and the name of the token. The table has its robots, each with the role that the \
token has for it. With --robot NAME it has this robot alone: the role is `none` if the token is not for it.

A viewer reads. An operator also stops, holds the lease, and sends commands and programs. An engineer also reads the \
audit log and stores programs. An admin also changes robots, users and tokens. What is for no single robot, such as \
programs, users and tokens, needs a role for all robots.

`r6 gateway token` makes tokens, as the owner of the gateway's folder. An admin makes them on its page, too.

Examples:
  r6 -g http://127.0.0.1:9780 whoami
  r6 -g http://127.0.0.1:9780 -r press-4 whoami
  r6 -g http://127.0.0.1:9780 --token-file token whoami --json")]
pub struct WhoamiArgs {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// The role for a robot.
#[derive(Debug, PartialEq, Eq, Serialize)]
struct ForRobot {
    /// Its name; `*` stands for all robots, or for all others.
    robot: String,
    /// The role; `null` if the token is not for this robot.
    role: Option<Role>,
}

/// Prints who calls.
pub async fn run_by_gateway(args: WhoamiArgs, by: ByGateway) -> Result<Exit, Failure> {
    let gateway = by.gateway()?;
    let waiting = format!("waiting for an answer of {}", by.url().unwrap_or_default());
    let session = waiting::told(&waiting, gateway.session()).await?;
    let robots = robots(&session, by.robot_name());
    if args.json {
        let mut object = json!(session);
        // A session of a browser has it, and a token none.
        if let Some(members) = object.as_object_mut() {
            members.remove("csrf");
        }
        object["robots"] = json!(robots);
        output::json(&object);
        return Ok(Exit::Done);
    }
    output::line(r6_proto::printable(&who(&session)));
    output::line(table(&robots, session.robot.is_none()));
    Ok(Exit::Done)
}

/// Who calls, for people, and when that ends if the gateway tells it: `token 3 (line 2)`.
fn who(session: &Session) -> String {
    let who = match (&session.user, session.token, &session.token_name) {
        (Some(user), ..) => format!("user {user}"),
        (None, Some(number), Some(name)) => format!("token {number} ({name})"),
        (None, Some(number), None) => format!("token {number}"),
        (None, None, _) => "a caller without a name".to_owned(),
    };
    match session.ends_in_ms {
        Some(left) => {
            format!("{who}, ends in {}", humantime::format_duration(Duration::from_secs(left / 1_000)))
        }
        None => who,
    }
}

/// The robots of the caller with their roles, or this one alone.
fn robots(session: &Session, only: Option<&str>) -> Vec<ForRobot> {
    let for_robot = |robot: &str, role| ForRobot { robot: robot.to_owned(), role };
    let robots = match session.robot.as_deref().map(GrantRobots::read).transpose() {
        Ok(robots) => robots.map(|robots| robots.up_to(session.role)),
        // A newer gateway may write them in another way. They are shown as they are.
        Err(_) => {
            return vec![for_robot(session.robot.as_deref().unwrap_or_default(), Some(session.role))];
        }
    };
    let grant = Grant { role: session.role, robots };
    if let Some(name) = only {
        return vec![for_robot(name, grant.role_for(name))];
    }
    let Some(robots) = &grant.robots else { return vec![for_robot("*", Some(grant.role))] };
    let each = robots.each();
    each.map(|(name, own)| for_robot(name.map_or("*", RobotName::as_str), Some(own.unwrap_or(grant.role))))
        .collect()
}

/// `is_for_all`: the token has no list of robots.
fn table(robots: &[ForRobot], is_for_all: bool) -> Table {
    let others = if is_for_all { "all robots" } else { "all others" };
    let mut table = Table::new();
    table.row([&"ROBOT", &"ROLE"]);
    for ForRobot { robot, role } in robots {
        let robot = if robot == "*" { others } else { robot };
        table.row([&robot, &role.map_or("none", Role::word)]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(robot: Option<&str>) -> Session {
        Session {
            user: None,
            token: Some(3),
            token_name: Some("line 2".to_owned()),
            role: Role::Operator,
            robot: robot.map(str::to_owned),
            csrf: None,
            idle_ends_in_ms: None,
            ends_in_ms: None,
        }
    }

    fn shown(robot: Option<&str>, only: Option<&str>) -> String {
        table(&robots(&session(robot), only), robot.is_none()).to_string()
    }

    #[test]
    fn each_robot_is_shown_with_the_role_that_the_token_has_for_it() {
        assert_eq!(shown(None, None), "ROBOT       ROLE\nall robots  operator");
        assert_eq!(
            shown(Some("press-4,saw=viewer,*=viewer"), None),
            "ROBOT       ROLE\npress-4     operator\nsaw         viewer\nall others  viewer"
        );
        assert_eq!(shown(Some("saw=viewer,*"), Some("mill")), "ROBOT  ROLE\nmill   operator");
        assert_eq!(shown(Some("saw"), Some("mill")), "ROBOT  ROLE\nmill   none");
        // As a store has it that somebody else wrote: no robot has more than the token.
        assert_eq!(shown(Some("saw=admin"), None), "ROBOT  ROLE\nsaw    operator");
        assert_eq!(shown(Some("halls/2"), None), "ROBOT    ROLE\nhalls/2  operator");
    }

    #[test]
    fn a_user_and_a_token_without_a_name_are_told_too() {
        let token = session(None);
        assert_eq!(who(&token), "token 3 (line 2)");
        assert_eq!(who(&Session { token_name: None, ..token.clone() }), "token 3");
        let ending = Session { ends_in_ms: Some(7_500_400), ..token.clone() };
        assert_eq!(who(&ending), "token 3 (line 2), ends in 2h 5m");
        assert_eq!(who(&Session { user: Some("anna".to_owned()), token: None, ..token }), "user anna");
    }
}
