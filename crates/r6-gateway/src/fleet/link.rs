//! The task of one robot: it keeps the connection, finds out who answers, and takes in the values.

use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use futures_util::StreamExt as _;
use futures_util::stream::FuturesUnordered;
use r6_api::gateway::RobotIdentity;
use r6_client::{
    Address, Changes, Identity, NotSubscribed, OperationMode, OutcomeUnknown, Permission, Quality, Reading,
    RequestError, Robot, RobotSettings, Snapshot, Subscription,
};
use r6_proto::time::Instant;
use tokio::sync::watch;

use super::clerk::ended;
use super::config::RobotConfig;
use super::group::MAX_OF_GROUP;
use super::record::record;
use super::station::Station;
use crate::clock;

/// The first and the longest wait before the next attempt to connect: doubled each time.
const WAITS: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(5));

/// How often to look at a robot from which nothing comes.
const LOOK: Duration = Duration::from_millis(500);

/// How long closing the connection may take at the end: the client waits for a stop that is under way, for
/// 15 s at most.
const CLOSE: Duration = Duration::from_secs(17);

/// Keeps the connection until `end` is true. Then the robot has no connection.
pub async fn keep(station: Arc<Station>, mut end: watch::Receiver<bool>) {
    tokio::select! {
        biased;
        () = run(&station) => {}
        () = ended(&mut end) => {}
    }
    // From now on no command is permitted.
    station.seat(|seat, _| seat.link_lost());
    station.finish_commands().await;
    // A stop that is asked for from now on waits for the next connection.
    let robot = station.robot.send_replace(None);
    if let Some(robot) = robot
        && tokio::time::timeout(CLOSE, robot.close()).await.is_err()
    {
        tracing::warn!(robot = station.name(), "the connection could not be closed in order");
    }
}

async fn run(station: &Station) {
    let config = station.config();
    // Numbers of connections begin anew.
    station.introduced(None);
    let robot = connect(station, &config).await;
    station.robot.send_replace(Some(robot.clone()));
    match subscribe(&robot, &config) {
        Ok(values) => tokio::select! {
            biased;
            () = watch(station, &robot, values) => {}
            () = record(station, &robot, &config) => {}
            () = station.make_owed_stops(&robot) => {}
            () = station.watch_photos(&robot) => {}
        },
        // The configuration was checked, so this is a fault of ours.
        Err(error) => tracing::error!(robot = station.name(), %error, "the values cannot be read"),
    }
    tracing::error!(robot = station.name(), "its values are not read any more");
    std::future::pending().await
}

/// The values, by their period.
fn subscribe(robot: &Robot, config: &RobotConfig) -> Result<Vec<Subscription>, NotSubscribed> {
    let mut all = Vec::new();
    for (period, addresses) in config.by_period() {
        for part in addresses.chunks(MAX_OF_GROUP) {
            all.push(robot.subscribe(part, period)?);
        }
    }
    Ok(all)
}

/// Waits until the values of the subscription at this place were read again. `None` once the handle is
/// closed. Without `changes` it waits for ever.
async fn next_of(place: usize, changes: Option<Changes>) -> Option<(usize, Changes)> {
    let Some(mut changes) = changes else { return std::future::pending().await };
    changes.next().await.then_some((place, changes))
}

/// Takes in the values until the handle of the robot is closed.
async fn watch(station: &Station, robot: &Robot, values: Vec<Subscription>) {
    let each = values.iter().enumerate().map(|(place, values)| next_of(place, Some(values.changes())));
    let mut changes: FuturesUnordered<_> = each.collect();
    // A set of which every future was polled wakes its task once more, for nothing. This one is never ready,
    // so it is polled once.
    changes.push(next_of(values.len(), None));
    // The connection whose robot was asked for its state: the client wants that before it sends a command.
    let mut known_on = None;
    // A robot may take long to answer. Meanwhile its values grow old, and that has to be seen.
    let (mut introduction, mut asked_on): (Option<Introduction<'_>>, _) = (None, None);
    let mut next_introduction = tokio::time::Instant::now();
    // A timer of its own for each reading would cost more than the look.
    let mut look = clock::every(LOOK);
    // When all values were looked at last.
    let mut looked_at = next_introduction;
    loop {
        let waits = introduction.is_none() && known_on != Some(robot.connection());
        let introduced = async {
            match &mut introduction {
                Some(introduction) => introduction.as_mut().await,
                None => std::future::pending().await,
            }
        };
        // Values come again and again, so they are the last to be looked for.
        let (is_open, read) = tokio::select! {
            biased;
            known = introduced => {
                introduction = None;
                known_on = known;
                let pause = if asked_on == Some(robot.connection()) { LOOK } else { Duration::ZERO };
                next_introduction = tokio::time::Instant::now() + pause;
                (true, None)
            }
            () = station.try_now.notified() => {
                next_introduction = tokio::time::Instant::now();
                (true, None)
            }
            Some(changed) = changes.next() => match changed {
                Some((place, of_place)) => {
                    changes.push(next_of(place, Some(of_place)));
                    (true, Some(place))
                }
                None => (false, None),
            },
            () = tokio::time::sleep_until(next_introduction), if waits => (true, None),
            _ = look.tick() => (true, None),
        };
        if !is_open {
            return;
        }
        let connection = robot.connection();
        let is_due = introduction.is_none() && next_introduction <= tokio::time::Instant::now();
        if known_on != Some(connection) && is_due {
            introduction = Some(Box::pin(introduce(station, robot, connection)));
            asked_on = Some(connection);
        }
        let known_on = known_on.filter(|known| *known == robot.connection());
        // The others may have grown old meanwhile.
        let is_all = read.is_none() || looked_at.elapsed() >= LOOK;
        if is_all {
            looked_at = tokio::time::Instant::now();
        }
        for (place, values) in values.iter().enumerate() {
            if is_all || read == Some(place) {
                let now = clock::now();
                take(station, now, &values.latest(), robot.connection(), known_on);
            }
        }
    }
}

/// The question to a robot who it is.
type Introduction<'r> = Pin<Box<dyn Future<Output = Option<u64>> + Send + 'r>>;

async fn connect(station: &Station, config: &RobotConfig) -> Robot {
    let (mut wait, longest) = WAITS;
    let ownership = station.term.ownership.clone();
    // The client asks this in the call that writes: a process that was frozen in the middle of a stop sends
    // no more of it when it goes on.
    let permission = Some(Permission::new().only_while(move || ownership.may_send()));
    let settings = RobotSettings { permission, ..config.settings.clone() };
    let mut road = None;
    // How often listening failed, and which failure is in the log.
    let (mut failed, mut told) = (0_u32, None);
    let mut is_told = false;
    loop {
        match &road {
            None => match station.shared.roads.to(&config.address).await {
                Ok(open) => {
                    if config.dials_in() {
                        tracing::info!(
                            robot = station.name(),
                            address = config.address,
                            "waits for the robot"
                        );
                    }
                    road = Some(open);
                    continue;
                }
                Err(error) => {
                    failed = failed.saturating_add(1);
                    // The first time, the old connection of this robot may still have the port.
                    if failed > 1 && told != Some(error.kind()) {
                        told = Some(error.kind());
                        tracing::warn!(robot = station.name(), address = config.address, %error,
                            "cannot listen for the robot: end what uses the port, or correct the address");
                    }
                }
            },
            Some(road) => match road.connect(settings.clone()).await {
                Ok(robot) => return robot,
                // A wrong address is the first mistake of all. It is told once: a robot may be off for days.
                Err(error) if !std::mem::replace(&mut is_told, true) => {
                    tracing::warn!(robot = station.name(), address = config.address, %error,
                        "no connection yet: it is tried again and again");
                }
                Err(error) => tracing::debug!(robot = station.name(), %error, "no connection yet"),
            },
        }
        tokio::select! {
            biased;
            () = tokio::time::sleep(wait) => wait = (wait * 2).min(longest),
            () = station.try_now.notified() => wait = WAITS.0,
        }
    }
}

/// Reads the state of the robot on a connection. Returns the number of the connection once that is done and
/// the robot is known.
async fn introduce(station: &Station, robot: &Robot, connection: u64) -> Option<u64> {
    let found = match robot.status().await {
        Ok(_) => robot.identity()?,
        Err(RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { found, .. })) => {
            station.seat(|seat, _| seat.identified(identity(&found)));
            return None;
        }
        Err(error) => {
            tracing::debug!(robot = station.name(), %error, "its state could not be read");
            return None;
        }
    };
    if robot.connection() != connection {
        return None;
    }
    station.seat(|seat, _| seat.identified(identity(&found)));
    station.introduced(Some(connection));
    Some(connection)
}

/// Takes in the values, and whether the robot can be used.
///
/// `now`: from before the values were taken, so that none seems younger than it is. `connection`: from after
/// that, so that none counts as read over a later one.
fn take(station: &Station, now: Instant, values: &Snapshot, connection: u64, known_on: Option<u64>) {
    let source = station.source_of(connection);
    let changed = station.board().take(now, values, source, || station.shared.draw());
    if changed {
        station.shared.wake_readers();
    }
    // Other values say nothing about whether the robot can be used.
    let Some(mode) = values.value(Address::CurMode) else { return };
    let fresh = Some(mode).filter(|mode| mode.quality == Quality::Fresh).and_then(|mode| {
        match (&mode.reading, mode.age) {
            (Some(Reading::Integer(number)), Some(age)) => Some((OperationMode::of_number(*number), age)),
            _ => None,
        }
    });
    station.seat(|seat, _| match (known_on, fresh) {
        (Some(connection), Some((mode, age))) => {
            seat.observed(clock::before(now, age), connection, mode == OperationMode::Manual);
        }
        _ => seat.link_lost(),
    });
}

/// The client's identity as the contract has it.
fn identity(of: &Identity) -> RobotIdentity {
    RobotIdentity {
        firmware: of.firmware.clone(),
        machine_name: of.machine_name.clone(),
        axis_count: of.axis_count,
    }
}

/// The identity of the contract as the client has it.
pub(super) fn to_client(of: &RobotIdentity) -> Identity {
    Identity {
        firmware: of.firmware.clone(),
        machine_name: of.machine_name.clone(),
        axis_count: of.axis_count,
    }
}
