//! What a gateway writes down when it begins with robots: what the last one left undone.

use std::collections::BTreeSet;

use r6_api::gateway::{AuditRecord, CommandOutcome, Deed};

use crate::clock;
use crate::core::name::RobotName;
use crate::fleet::config::RobotConfig;
use crate::fleet::run;
use crate::fleet::station::Kept;
use crate::store::{Store, StoreError};

/// The robots, each as it was saved, and those that are owed a stop: a list of a run may still be there.
pub(crate) type Begun = (Vec<(Kept, RobotConfig)>, BTreeSet<RobotName>);

/// Writes down that the gateway starts, and what the last one left undone.
pub(crate) fn begin(store: &mut dyn Store, robots: Vec<RobotConfig>) -> Result<Begun, StoreError> {
    let records: Vec<_> = store.open_intents()?.into_iter().map(unknown).chain([started(None)]).collect();
    store.append(&records)?;
    // A link that an earlier start printed ends with it.
    store.remove_setup_link()?;
    close_open(store, &|_| true)?;
    kept(store, robots)
}

/// Begins with robots that another gateway had before: what it left undone at them is written down.
pub(crate) fn take_over(store: &mut dyn Store, robots: Vec<RobotConfig>) -> Result<Begun, StoreError> {
    let names: BTreeSet<_> = robots.iter().map(|robot| robot.name.as_str()).collect();
    close_open(store, &|robot| names.contains(robot))?;
    kept(store, robots)
}

/// Writes down that commands of these robots have no outcome, and that their runs were cut short.
pub(crate) fn close_open(store: &mut dyn Store, is_one: &dyn Fn(&str) -> bool) -> Result<(), StoreError> {
    let intents = store.open_intents()?.into_iter();
    let records: Vec<_> =
        intents.filter(|(_, robot)| is_one(robot.as_deref().unwrap_or_default())).map(unknown).collect();
    if !records.is_empty() {
        store.append(&records)?;
    }
    let runs = store.open_runs()?.into_iter().filter(|run| is_one(&run.robot));
    let ends: Vec<_> = runs.map(run::killed).collect();
    store.end_runs(&ends)
}

/// What was saved of these robots.
fn kept(store: &mut dyn Store, robots: Vec<RobotConfig>) -> Result<Begun, StoreError> {
    let owed = store.owed_stops()?.into_iter().collect();
    let names: Vec<_> = robots.iter().map(|robot| robot.name.clone()).collect();
    let kept = store.kept(&names)?.into_iter().map(|(seat, alarms)| Kept { seat, alarms });
    Ok((kept.zip(robots).collect(), owed))
}

/// The record about the start of a gateway, with its URL if several share a store.
pub(crate) fn started(url: Option<String>) -> AuditRecord {
    record(None, Deed::GatewayStarted { url })
}

/// A record of the gateway itself.
pub(crate) fn record(robot: Option<String>, deed: Deed) -> AuditRecord {
    let (time, actor) = (clock::time_of_day(), "gateway".to_owned());
    AuditRecord { time, actor, source: None, robot, deed }
}

/// The outcome of a command that the end of the process cut short.
fn unknown((intent, robot): (u64, Option<String>)) -> AuditRecord {
    let detail = "the gateway ended before the answer: the robot may have acted".to_owned();
    record(robot, Deed::CommandOutcome { intent, outcome: CommandOutcome::Unknown, detail })
}
