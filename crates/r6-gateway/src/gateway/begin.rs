//! The begin of a gateway: its store, its robots, and what it writes down of what the last one left undone.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::Path;

use r6_api::gateway::{ActedBy, AuditRecord, CommandOutcome, Deed};
use r6_client::RobotSettings;

use super::GatewayError;
use crate::core::name::RobotName;
use crate::fleet::config::RobotConfig;
use crate::fleet::station::{Kept, by_itself};
use crate::fleet::{roster, run};
use crate::reserve::Start;
use crate::store::{Sqlite, Store, StoreError};
use crate::{clock, folder};

/// The robots, each as it was saved, and those that are owed a stop: a list of a run may still be there.
pub(crate) type Begun = (Vec<(Kept, RobotConfig)>, BTreeSet<RobotName>);

/// Opens the store of a folder under its lock. On a full disk, that is done in the room that was held for it.
pub(crate) fn open_store(data: &Path) -> Result<(Sqlite, File, Start), GatewayError> {
    if !folder::has_store(data) {
        return Ok((Sqlite::open(data)?, folder::lock(data)?, Start::first(data)));
    }
    let lock = folder::lock(data)?;
    let start = Start::begin(data);
    Ok((Sqlite::open(data)?, lock, start))
}

/// The robots of the configuration, and those that were added through the API. A robot of the configuration
/// takes the place of one with the same name.
pub(crate) fn all_robots(
    store: &mut dyn Store,
    configured: Vec<RobotConfig>,
    settings: &RobotSettings,
) -> Result<Vec<RobotConfig>, GatewayError> {
    let mut robots = configured;
    let added = store.robots()?;
    roster::check_names_of_twins(&robots, added.iter().map(|robot| &robot.name))
        .map_err(GatewayError::Robots)?;
    for stored in added {
        if robots.iter().any(|robot| robot.name == stored.name) {
            tracing::warn!(robot = %stored.name, "it was added through the API: from now on it is as configured");
            store.remove_robot(&stored.name, &[])?;
        } else {
            robots.push(roster::of_store(&stored, settings.clone())?);
        }
    }
    roster::check(&robots).map_err(GatewayError::Robots)?;
    Ok(robots)
}

/// Writes down that the gateway starts, and what the last one left undone.
pub(crate) fn begin(store: &mut dyn Store, robots: Vec<RobotConfig>) -> Result<Begun, StoreError> {
    let records: Vec<_> = store.open_intents()?.into_iter().map(unknown).chain([started(None)]).collect();
    store.append(&records)?;
    // A link that an earlier start printed ends with it.
    store.remove_setup_link()?;
    close_open(store, &|_| true)?;
    kept(store, robots)
}

/// Lets a stop hold for each robot, as after a restore: the disk was full, so a stop of the gateway before
/// may be lost.
pub(crate) fn hold_stops(store: &mut Sqlite, (robots, _): &mut Begun) -> Result<(), StoreError> {
    let by = ActedBy { by: by_itself().actor, at: clock::time_of_day() };
    let detail = "nothing was sent to the robot: the disk was full, so that a stop of before may be lost, and commands are \
                  refused until somebody has looked at the robot and clears this stop";
    let mut stops = Vec::new();
    for (kept, config) in robots.iter_mut().filter(|(kept, _)| !kept.seat.stopped) {
        (kept.seat.stopped, kept.seat.stopped_by) = (true, Some(by.clone()));
        let (request, detail) = ("start after a full disk".to_owned(), detail.to_owned());
        let deed = Deed::Stop { request, confirmed: false, detail };
        stops.push((config.name.clone(), kept.seat.clone(), record(Some(config.name.to_string()), deed)));
    }
    store.hold_stops(&stops, &by)?;
    tracing::warn!("the disk was full: a stop holds for each robot, because one of before may be lost");
    Ok(())
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
