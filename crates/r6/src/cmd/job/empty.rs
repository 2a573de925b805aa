//! A list without instructions: it clears the controller's list or, if appended, changes nothing.

use r6_client::{Robot, Unmet, WaitOptions};
use r6_proto::Request;
use r6_proto::dialect::Addressing;

use crate::cmd::job::ended::Ended;
use crate::cmd::job::events::Accepted;
use crate::cmd::job::under_way::stands;
use crate::cmd::job::{JobArgs, not_ready, say_how_to_follow};
use crate::exit::{Exit, Failure};
use crate::output;

/// Prints the frame that would be sent.
pub fn print(replace: bool) -> Result<Exit, Failure> {
    let addressing = Addressing { pack_id: Some("1"), ..Addressing::default() };
    let mut frame = Vec::new();
    let list = Request::AddRcc { empty_list: replace, instructions: &[] };
    list.encode(&addressing, &mut frame).map_err(Failure::usage)?;
    output::line(String::from_utf8_lossy(&frame));
    Ok(Exit::Done)
}

/// Checks the machine and sends the empty list.
pub async fn send(args: &JobArgs, robot: &Robot, replace: bool) -> Result<Exit, Ended> {
    let in_the_way = |unmet: &Unmet| replace || !matches!(unmet, Unmet::Moving | Unmet::LeftoverList { .. });
    let status = robot.status().await.map_err(Failure::from)?;
    let unmet: Vec<_> = status.unmet().into_iter().filter(in_the_way).collect();
    if !unmet.is_empty() {
        return Err(not_ready(robot, &unmet));
    }
    let after = robot.add_rcc(replace, Vec::new()).await.map_err(Failure::from)?.after;
    output::acts();
    let accepted = Accepted { instructions: 0, replaced_list: replace, repeats: false, after };
    if args.json {
        output::json(&accepted.whole(robot.address()));
    } else {
        accepted.say();
    }
    if args.wait {
        let done = robot.wait_until_done(WaitOptions::default()).await.map_err(Failure::from)?;
        stands(robot, &done, args.json);
    } else if !args.json {
        say_how_to_follow();
    }
    Ok(Exit::Done)
}
