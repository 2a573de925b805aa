//! `r6 gateway token`: makes, lists and revokes tokens, whether the gateway runs or not.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use r6_api::gateway::Role;
use r6_gateway::{At, Camera, Expiry, Grant, GrantRobots, RobotName};

use super::place::{self, StoreUrl};
use super::{DEFAULT_DATA, tell_new_folder};
use crate::exit::{Exit, Failure};
use crate::output::{self, table::Table};

/// The longest name of a token, in characters.
const MAX_NAME: usize = 64;

const DAY: Duration = Duration::from_secs(24 * 60 * 60);

/// Make a token and print it; list or revoke tokens
#[derive(Debug, Args)]
#[command(after_help = "\
The token is printed once, and the gateway keeps only its hash. A gateway that runs knows the token at once, \
and refuses a revoked one within a second.

Roles, each with the rights of those before it:
  viewer     reads values, states and events; checks and plans programs
  operator   stops; holds the lease, and with it sends commands and runs programs;
             acknowledges alarms
  engineer   accepts an exchanged robot; reads the audit log; shelves alarms;
             for all robots: stores programs and points; closes the raw ports
  admin      takes the lease from its holder; changes robots; gives grants of cameras;
             for all robots: users, tokens, settings, new robots; opens the raw ports

--robot names the robots. Each has the role, or a lower one after `=`; `*` stands for all that are not named, \
and needs quotes in a shell. What is \"for all robots\" above needs a token without --robot.

With --camera the token may also send points and answers to photos as this camera of this robot, without the \
lease, until it is revoked. A gateway that runs knows the grant at once.

Examples:
  r6 gateway token --role viewer --name screen-in-hall-2
  r6 gateway token --role operator --robot press-4,saw
  r6 gateway token --role engineer --robot 'press-4,saw=operator,*=viewer'
  r6 gateway token --role viewer --days 30
  r6 gateway token --role viewer --robot press-4 --camera press-4:0
  r6 gateway token --list
  r6 gateway token --revoke 3")]
pub struct TokenArgs {
    /// Folder of the gateway
    #[arg(long, value_name = "DIR", default_value = DEFAULT_DATA)]
    data: PathBuf,
    /// The database of gateways that share their store, in place of the folder
    #[arg(long, value_name = "URL", value_parser = StoreUrl::read, conflicts_with = "data")]
    store: Option<StoreUrl>,
    /// What the token allows
    #[arg(long, value_parser = role(), required_unless_present_any = ["list", "revoke"])]
    role: Option<Role>,
    /// The robots that it is for, with commas between them: NAME, or NAME=ROLE for a lower role; * for all
    /// others
    // The id is that of the global option, so that this one stands in its place.
    #[arg(id = "robot", short = 'r', long = "robot", value_name = "NAMES")]
    robots: Option<String>,
    /// What people call it
    #[arg(long, value_name = "TEXT", default_value = "")]
    name: String,
    /// How many days it is valid, from 1 on; without this, until it is revoked
    #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..=36_500), conflicts_with_all = ["list", "revoke"])]
    days: Option<u32>,
    /// Let it feed this camera of a robot (`camID`); may be given several times
    #[arg(long = "camera", value_name = "ROBOT:ID", value_parser = camera, conflicts_with_all = ["list", "revoke"])]
    cameras: Vec<(RobotName, Camera)>,
    /// Print the tokens that are not revoked, without their secrets
    #[arg(long, conflicts_with_all = ["role", "revoke"])]
    list: bool,
    /// Revoke the token with this number
    #[arg(long, value_name = "NUMBER", conflicts_with = "role")]
    revoke: Option<i64>,
}

impl TokenArgs {
    /// Where the store is.
    fn at(&self) -> Result<At, Failure> {
        place::at(self.store.as_ref(), &self.data)
    }
}

/// Reads a role.
pub(super) fn role() -> impl TypedValueParser<Value = Role> {
    PossibleValuesParser::new(Role::ALL.map(Role::word)).try_map(|word| Role::of_word(&word).ok_or("no role"))
}

/// Reads the camera of a robot.
fn camera(text: &str) -> Result<(RobotName, Camera), String> {
    let (robot, camera) = text.split_once(':').ok_or("it has to be ROBOT:ID, such as press-4:0")?;
    let robot = RobotName::new(robot).ok_or_else(|| format!("the robot has to be {}", RobotName::WANTED))?;
    let camera = Camera::read(camera).ok_or_else(|| format!("the camera has to be {}", Camera::WANTED))?;
    Ok((robot, camera))
}

/// Makes, lists or revokes tokens.
pub fn run(args: TokenArgs, robot_typed: bool) -> Result<Exit, Failure> {
    if let Some(number) = args.revoke {
        if !r6_gateway::revoke_token(args.at()?, number).map_err(Failure::usage)? {
            return Err(Failure::usage(format!("there is no valid token {number}"))
                .advise("`r6 gateway token --list` prints all"));
        }
        output::line(format_args!("token {number} is revoked"));
        output::note(
            "a run that it began goes on until its lease ends, within 10 s: stop the robot if the arm shall not move",
        );
        return Ok(Exit::Done);
    }
    let Some(role) = args.role else {
        return list(args.at()?);
    };
    let grant = grant(role, args.robots.as_deref().filter(|_| robot_typed))?;
    if args.name.chars().count() > MAX_NAME || args.name.chars().any(char::is_control) {
        let wanted = format!("--name has at most {MAX_NAME} characters, and no control characters");
        return Err(Failure::usage(wanted));
    }
    let is_for = |robot: &RobotName| grant.covers(robot.as_str());
    if let Some((robot, camera)) = args.cameras.iter().find(|(robot, _)| !is_for(robot)) {
        let only = grant.robots.as_ref().map(ToString::to_string).unwrap_or_default();
        let wanted = format!(
            "--camera {robot}:{camera}: the token is for {only} only (--robot), so it cannot feed a camera of {robot}"
        );
        return Err(Failure::usage(wanted));
    }
    let (what, named) = (what(&grant), names_of(&grant));
    if args.store.is_none() {
        tell_new_folder(&args.data);
    }
    let at = args.at()?;
    let expires = args.days.map(|days| Expiry::after(DAY * days));
    let made = r6_gateway::make_token_until(at.clone(), grant, args.name, expires);
    let (number, token) = made.map_err(Failure::usage)?;
    output::line(token);
    let ends = expires.map(until).unwrap_or_default();
    output::note(format_args!("token {number}: {what}{ends}. It is shown this once"));
    for robot in &named {
        tell_if_unknown(at.clone(), robot);
    }
    for (robot, camera) in args.cameras {
        let told = format!("token {number} feeds camera {camera} of {robot}");
        if !named.contains(robot.as_str()) {
            tell_if_unknown(at.clone(), &robot);
        }
        r6_gateway::grant_camera(at.clone(), number, robot, camera).map_err(|error| {
            Failure::usage(format!("the token was made, and has not this grant: {error}"))
                .advise(format!("`r6 gateway token --revoke {number}` revokes it"))
        })?;
        output::note(told);
    }
    Ok(Exit::Done)
}

/// Says that no robot has this name, which may be mistyped.
pub(super) fn tell_if_unknown(at: At, robot: &RobotName) {
    // A store that does not answer has said why before, or will.
    if !r6_gateway::is_robot_known(at, robot).unwrap_or(true) {
        output::note(format_args!(
            "r6: no robot {robot} is known here yet: check the name. A robot of the --config file is known once a \
             gateway has reached it"
        ));
    }
}

fn list(at: At) -> Result<Exit, Failure> {
    let tokens = r6_gateway::list_tokens(at.clone()).map_err(Failure::usage)?;
    let cameras = r6_gateway::list_cameras(at).map_err(Failure::usage)?;
    let mut table = Table::with_right_columns(&[0]);
    for token in &tokens {
        let mut what = what(&token.grant);
        what += &token.expires.map(until).unwrap_or_default();
        for (robot, grant) in cameras.iter().filter(|(_, grant)| grant.token == token.number) {
            what += &format!(", camera {} of {robot}", grant.camera);
        }
        table.row([&token.number, &what, &r6_proto::printable(&token.name)]);
    }
    output::line(table);
    Ok(Exit::Done)
}

/// When a token ends, for people.
fn until(expires: Expiry) -> String {
    let word = if expires.is_over() { "ended" } else { "until" };
    let expires = output::to_the_second(&expires.to_string());
    format!(", {word} {expires}")
}

/// The grant of `--role` and `--robot`.
pub(super) fn grant(role: Role, robots: Option<&str>) -> Result<Grant, Failure> {
    let read = robots.map(GrantRobots::read).transpose();
    read.and_then(|robots| Grant::new(role, robots)).map_err(|error| {
        let given = r6_proto::printable(robots.unwrap_or_default());
        Failure::usage(format!("--robot {given}: {error}"))
    })
}

/// The robots that a grant names.
pub(super) fn names_of(grant: &Grant) -> BTreeSet<RobotName> {
    grant.robots.iter().flat_map(GrantRobots::names).cloned().collect()
}

/// What a token or a user may do, for people: each role with its robots, the highest first.
pub(super) fn what(grant: &Grant) -> String {
    let Some(robots) = &grant.robots else { return format!("{} of all robots", grant.role.word()) };
    let mut parts = Vec::new();
    for role in Role::ALL.into_iter().rev() {
        let of_role = robots.each().filter(|(_, own)| own.unwrap_or(grant.role).min(grant.role) == role);
        let names: Vec<_> = of_role.map(|(name, _)| name.map_or("all others", RobotName::as_str)).collect();
        if !names.is_empty() {
            parts.push(format!("{} of {}", role.word(), names.join(", ")));
        }
    }
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grant_is_told_with_the_role_that_each_robot_has() {
        let told = |role, robots| what(&grant(role, robots).unwrap());
        assert_eq!(told(Role::Admin, None), "admin of all robots");
        assert_eq!(told(Role::Operator, Some("saw,press")), "operator of press, saw");
        assert_eq!(
            told(Role::Engineer, Some("press,saw=viewer,mill=operator,*=viewer")),
            "engineer of press; operator of mill; viewer of saw, all others"
        );
        // No robot has to have the highest role.
        assert_eq!(told(Role::Admin, Some("press=viewer")), "viewer of press");
    }
}
