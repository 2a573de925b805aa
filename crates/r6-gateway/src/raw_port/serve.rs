//! Carries out one request of a raw client.

use std::net::SocketAddr;

use r6_api::Code;
use r6_client::units::{MillimetresPerSecond, Percent};
use r6_client::{Address, Envelope, Motion, Point, Robot};
use r6_proto::Command;

use super::Client;
use super::port::Door;
use crate::clock;
use crate::core::camera::Camera;
use crate::core::order::Order;
use crate::core::raw::lease::Holder;
use crate::core::raw::policy::{RawAllow, RawRule};
use crate::core::raw::session::Answer;
use crate::core::seat::{Denied, Key, USUAL_LEASE};
use crate::fleet::camera::Granted;
use crate::fleet::send::Still;
use crate::fleet::station::{By, Station};
use crate::problem::Problem;

/// Answers a query: from readings that are fresh and show the effect of all commands, or by asking the robot.
/// If the robot does not answer, or if another one answers in its place, this does not.
pub async fn query(station: &Station, addresses: &[Address]) -> Answer {
    if addresses.is_empty() {
        // The robot has nothing of it.
        return Answer::Values(Vec::new());
    }
    let Some(robot) = station.robot() else { return Answer::Silence };
    if station.seat(|seat, _| seat.identity_change().is_some()) {
        return Answer::Silence;
    }
    if let Some(values) = fresh(station, &robot, addresses) {
        return Answer::Values(values);
    }
    let _turn = station.asking.lock().await;
    // The query of another client may have answered this one meanwhile.
    if let Some(values) = fresh(station, &robot, addresses) {
        return Answer::Values(values);
    }
    match robot.query_raw(addresses).await {
        Ok(reply) => Answer::Values(reply.values),
        Err(error) => {
            tracing::debug!(robot = station.name(), %error, "a query of a raw client has no answer");
            Answer::Silence
        }
    }
}

/// The values of these addresses, if all of them are fresh.
fn fresh(station: &Station, robot: &Robot, addresses: &[Address]) -> Option<Vec<Vec<u8>>> {
    robot.keep_raw_values();
    // Taken before the ages: so no value seems younger than it is.
    let now = clock::now();
    let values = robot.raw_values(addresses).into_iter().collect::<Option<Vec<_>>>()?;
    // Looked at after the values: a command that begins in between makes them old.
    let fresh = station.fresh();
    let all = values.iter().all(|value| fresh.may_answer(now, clock::before(now, value.age)));
    all.then(|| values.into_iter().map(|value| value.text).collect())
}

/// Stops or pauses the robot at once, for every source that was not denied when the stop came. The stop
/// holds.
pub async fn stop(
    door: &Door,
    station: &Station,
    (client, rule): (Client, &RawRule),
    command: Command<'static>,
) -> Answer {
    // A script that stops a stopped robot again and again must not fill the disk.
    let holds = station.seat(|seat, _| seat.stops().0);
    let written =
        door.refusals().is_written(clock::now(), client.source.ip(), command.name().word()) || !holds;
    let done = station.stop_command(&by(rule, client.source), command, written).await;
    door_answer(station, done.map(drop))
}

/// Sends a command, a list, or what a camera sends.
pub async fn order(door: &Door, station: &Station, client: Client, order: Order) -> Answer {
    match order {
        Order::Points { camera, points } => self::points(door, station, client, camera, points).await,
        Order::Photo { camera, taken } => photo(door, station, client, camera, taken).await,
        order @ (Order::Command(_) | Order::List { .. }) => leased(door, station, client, order).await,
    }
}

/// Sends a command or a list that changes or moves, with the implicit lease of the source.
async fn leased(door: &Door, station: &Station, client: Client, order: Order) -> Answer {
    let Some(rule) = door.policy.rule(client, &door.robot) else { return Answer::Silence };
    let word = order.word();
    if rule.allow < RawAllow::Command {
        let reason = "this address may only read and stop".to_owned();
        return refuse(door, station, client, word, (Code::NotAllowed, reason));
    }
    if let Some(reason) = rule.forbids(&order).or_else(|| beyond(&rule, &order)) {
        return refuse(door, station, client, word, (Code::NotAllowed, reason));
    }
    if rule.asks_for_program(&order)
        && let Some(reason) = rule.forbids_start(loaded(station).await.as_deref())
    {
        return refuse(door, station, client, word, (Code::NotAllowed, reason));
    }
    let effect = order.effect();
    let holder = holder(&rule, client.source);
    // What is refused anyway does not take the lease from those who could use it.
    // While a stop holds, the lease is for the person who clears the stop.
    let fit = station.seat(|seat, now| match seat.stops() {
        (true, _) => Err(Denied::Stopped),
        (false, _) => seat.check_before_lease(now, effect),
    });
    let held = match fit {
        Ok(()) => acquire(door, station, &holder, client.source).await,
        Err(denied) => Err(denied.into()),
    };
    let (key, has_list) = match held {
        Ok(held) => held,
        Err(problem) => {
            if door.refusals().is_written(clock::now(), client.source.ip(), word) {
                station.note_refused(&by(&rule, client.source), &order.to_string(), problem.code);
            }
            return door_answer(station, Err(problem));
        }
    };
    let used = Used { door, key };
    // Only the holder counts: others cannot use up what it may send.
    if let Err(wait) = door.rate().request(clock::now()) {
        let reason = format!("too many commands: wait {} ms", wait.as_millis());
        return refuse(door, station, client, word, (Code::TooManyRequests, reason));
    }
    let is_list = matches!(order, Order::List { .. });
    // Waiting for the lease took its time. It is asked again when the first byte is written: the command may
    // wait for the disk or behind another one.
    let (policy, robot, of_rule) = (door.policy.clone(), door.robot.clone(), rule.clone());
    let holds = move || policy.rule(client, &robot).is_some_and(|now| now == of_rule);
    let still = Still::new(holds, "the rules of the raw ports have changed, or the ports were closed");
    if !still.holds() {
        return refuse(door, station, client, word, (Code::NotAllowed, still.otherwise.to_owned()));
    }
    let leftover = is_list && has_list;
    let done = station.command(&by(&rule, client.source), key, order, leftover, None, Some(still)).await;
    if is_list && done.is_ok() {
        door.lease().has_list(key);
    }
    drop(used);
    door_answer(station, done.map(drop))
}

/// The program that the controller has loaded, if it says so now. Raw clients ask one after the other.
async fn loaded(station: &Station) -> Option<String> {
    let robot = station.robot()?;
    let _turn = station.asking.lock().await;
    let read = robot.query(&[Address::CurMold]).await.ok()?;
    read.text(Address::CurMold).map(str::to_owned)
}

/// Sends the points that a camera found, under the grant of the rule of this source.
async fn points(
    door: &Door,
    station: &Station,
    client: Client,
    camera: Camera,
    points: Vec<Point>,
) -> Answer {
    let Some((rule, granted)) = granted(door, station, client, camera) else {
        return not_granted(door, station, client, "AddPoints", camera);
    };
    match station.add_points(&by(&rule, client.source), granted, points).await {
        Ok(done) => Answer::Taken(done.taken.and_then(|taken| usize::try_from(taken).ok())),
        Err(problem) => door_answer(station, Err(problem)),
    }
}

/// Sends the answer of a camera to a request for a photo. As from the controller, no reply comes, also if it
/// was not sent: the audit log says so.
async fn photo(door: &Door, station: &Station, client: Client, camera: Camera, taken: bool) -> Answer {
    match granted(door, station, client, camera) {
        None => drop(not_granted(door, station, client, "photo", camera)),
        Some((rule, granted)) => {
            match station.answer_photo(&by(&rule, client.source), granted, taken).await {
                Ok(()) => {}
                Err(Problem { code: Code::OutcomeUnknown, message, .. }) => {
                    tracing::warn!(robot = door.robot, source = %client.source, %camera, problem = message,
                    "it is not known whether an answer to a photo left");
                }
                Err(problem) => {
                    station.counts.raw.refused();
                    if door.is_logged(client.source, "photo") {
                        let problem = problem.message;
                        tracing::info!(robot = door.robot, source = %client.source, %camera, problem,
                        "an answer to a photo was not sent");
                    }
                }
            }
        }
    }
    Answer::Silence
}

/// The rule of this source with its grant for this camera, if it has one.
fn granted(door: &Door, station: &Station, client: Client, camera: Camera) -> Option<(RawRule, Granted)> {
    let mut found = None;
    let granted = station.granted_by_rule(camera, || {
        found = door.policy.rule(client, &door.robot);
        found.as_ref().map(|rule| rule.cameras.clone()).unwrap_or_default()
    });
    found.zip(granted)
}

fn not_granted(door: &Door, station: &Station, client: Client, word: &str, camera: Camera) -> Answer {
    let request = format!("{word} camera {camera}");
    let reason = format!("this address is not camera {camera}: a [[raw_rule]] names it in `cameras`");
    refuse(door, station, client, &request, (Code::NotAllowed, reason))
}

/// Why a list goes beyond the limits of the rule.
fn beyond(rule: &RawRule, order: &Order) -> Option<String> {
    let Order::List { steps, .. } = order else { return None };
    let mut envelope = Envelope::new();
    let unusable = || Some("the limit of speed in the rule of this address cannot be used".to_owned());
    if let Some(percent) = rule.max_speed {
        let Ok(cap) = Percent::new(percent) else { return unusable() };
        envelope = envelope.speed_cap(cap);
    }
    if let Some(speed) = rule.max_path_speed {
        let Ok(cap) = MillimetresPerSecond::new(speed) else { return unusable() };
        envelope = envelope.path_speed_cap(cap);
    }
    if envelope == Envelope::new() {
        return None;
    }
    let motion = Motion::of_list(steps.iter().copied());
    if let Err(wrong) = motion.instructions() {
        // It would not be checked.
        return Some(wrong.to_string());
    }
    envelope.check_motion(&motion).err().map(|violation| violation.to_string())
}

/// The lease of this holder, acquired if it is free, and whether what is in the list may be the holder's own.
/// It is in use afterwards.
async fn acquire(
    door: &Door,
    station: &Station,
    holder: &Holder,
    source: SocketAddr,
) -> Result<(Key, bool), Problem> {
    // Two clients of one computer are one holder: the second waits for the lease of the first.
    let _turn = door.acquiring.lock().await;
    let held = door.lease().begin_use(holder);
    if let Some((key, has_list)) = held {
        if station.seat(|seat, now| seat.renew(now, key, USUAL_LEASE)).is_ok() {
            return Ok((key, has_list));
        }
        door.lease().lost(key);
    }
    let by = By { actor: holder.label(), source: Some(source.to_string()) };
    let key = station.acquire_key(&by, USUAL_LEASE).await?;
    door.lease().granted(clock::now(), holder.clone(), key);
    Ok((key, false))
}

/// Notes that a command does not use the lease any more, also if its task ends by itself.
struct Used<'d> {
    door: &'d Door,
    key: Key,
}

impl Drop for Used<'_> {
    fn drop(&mut self) {
        self.door.lease().used(self.key);
    }
}

/// Refuses what the gateway does not send on.
pub fn refuse(
    door: &Door,
    station: &Station,
    client: Client,
    request: &str,
    (code, reason): (Code, String),
) -> Answer {
    station.counts.raw.refused();
    if let Some(rule) = door.policy.rule(client, &door.robot)
        && door.refusals().is_written(clock::now(), client.source.ip(), request)
    {
        station.note_refused(&by(&rule, client.source), request, code);
    }
    Answer::Refused(Some(reason))
}

/// What a script has to know if something is left in the list. It cannot ask for running it, as over HTTP.
const LEFTOVER: &str = "something is left in the instruction list, or its length cannot be read, and the arm would run the \
                        list: a stop clears it";

/// How a raw client is told: what was not done or was refused by the controller is `err` with the reason; an
/// unknown outcome is silence, because an `err` would make a script send it again.
fn door_answer(station: &Station, done: Result<(), Problem>) -> Answer {
    match done {
        Ok(()) => Answer::Accepted,
        Err(Problem { code: Code::OutcomeUnknown, .. }) => Answer::Silence,
        Err(problem) => {
            station.counts.raw.refused();
            Answer::Refused(match problem.code {
                // The controller's own words, if it was the controller.
                Code::Refused => problem.reason,
                Code::LeftoverList => Some(LEFTOVER.to_owned()),
                // Old scripts read ASCII.
                _ => Some(problem.message.replace('…', "...")),
            })
        }
    }
}

/// Whom the implicit lease is for.
pub fn holder(rule: &RawRule, source: SocketAddr) -> Holder {
    Holder { address: source.ip(), rule: rule.source.to_string() }
}

fn by(rule: &RawRule, source: SocketAddr) -> By {
    By { actor: holder(rule, source).label(), source: Some(source.to_string()) }
}
