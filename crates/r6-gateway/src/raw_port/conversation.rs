//! Moves the bytes of one client.

use std::future::Future;
use std::io::Read as _;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use futures_util::StreamExt as _;
use futures_util::stream::FuturesUnordered;
use r6_api::Code;
use r6_proto::dialect::Dialect;
use r6_proto::time::Instant;
use socket2::SockRef;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use super::port::Door;
use super::{Client, serve};
use crate::clock;
use crate::core::raw::asked::Asked;
use crate::core::raw::policy::{RawAllow, RawRule};
use crate::core::raw::session::{Answer, Cause, HALF_FRAME, Session, Ticket};
use crate::fleet::station::Station;

/// How many bytes one read of the socket takes.
const READ_BYTES: usize = 4096;

/// How many times the socket of a client is read that may do nothing any more: a stop may be in what it has
/// sent, and it could send without an end.
const READS_AT_THE_END: usize = 16;

/// How long a client may take no byte of a reply that waits.
const WRITE_WITHIN: Duration = Duration::from_secs(10);

/// How a conversation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The client closed it, or its connection broke.
    Left,
    /// The gateway closed it.
    Closed(Cause),
}

type Work = Pin<Box<dyn Future<Output = (Ticket, Answer)> + Send>>;

/// Serves a client until it ends.
pub async fn run(door: &Arc<Door>, station: &Arc<Station>, mut stream: TcpStream, client: Client) -> End {
    let mut link = station.link.subscribe();
    let Some(connection) = *link.borrow_and_update() else { return End::Closed(Cause::RobotDown) };
    let (mut from, mut to) = stream.split();
    let mut session = Session::new();
    let mut photos = station.photos();
    let mut changes = door.policy.changes();
    let Some(mut rule) = door.policy.rule(client, &door.robot) else {
        return End::Closed(Cause::Denied);
    };
    let mut work: FuturesUnordered<Work> = FuturesUnordered::new();
    let mut input = vec![0; READ_BYTES];
    // The client may close its half and still read, as `nc -N` does.
    let mut half_closed = false;
    let mut stuck_since: Option<Instant> = None;
    loop {
        while let Some((ticket, asked)) = session.poll_request() {
            work.push(begin(door, station, client, &rule, ticket, asked));
        }
        if let Some(cause) = session.closed() {
            return End::Closed(cause);
        }
        if half_closed && session.is_idle() {
            return End::Left;
        }
        let output = session.poll_transmit();
        if output.is_none() {
            stuck_since = None;
        } else {
            stuck_since.get_or_insert_with(clock::now);
        }
        let half = session.poll_timeout();
        let stuck = stuck_since.map(|since| since + WRITE_WITHIN);
        let due = [half, stuck].into_iter().flatten().min();
        let wait = due.map_or(HALF_FRAME, |due| due.since(clock::now()));
        tokio::select! {
            read = from.read(&mut input), if !half_closed => {
                let Ok(count) = read else { return End::Left };
                half_closed = count == 0;
                let now = clock::now();
                let frames = session.handle_input(now, input.get(..count).unwrap_or_default());
                if frames > 0 {
                    match door.policy.rule(client, &door.robot) {
                        Some(now_rule) => {
                            rule = now_rule;
                            if rule.allow == RawAllow::Command {
                                door.lease().frame(now, &serve::holder(&rule, client.source));
                            }
                        }
                        None => deny(&mut session, from.as_ref(), &mut input),
                    }
                }
            }
            Some((ticket, answer)) = work.next() => {
                let dialect = station.robot().map_or(Dialect::HC1, |robot| robot.learned().dialect());
                session.answer(ticket, dialect, &answer);
            }
            written = to.write(output.unwrap_or_default()), if output.is_some() => {
                let Ok(count) = written else { return End::Left };
                session.transmitted(count);
                stuck_since = None;
            }
            photo = photos.recv() => {
                let asked = match photo {
                    Ok(camera) => vec![camera],
                    Err(_missed) => station.open_photos(),
                };
                let cameras = door.policy.rule(client, &door.robot).map(|rule| rule.cameras).unwrap_or_default();
                let granted = asked.into_iter().filter(|camera| cameras.contains(camera));
                granted.for_each(|camera| session.push_photo(camera));
            }
            _ = changes.changed() => {
                match door.policy.rule(client, &door.robot) {
                    Some(now_rule) => rule = now_rule,
                    None => deny(&mut session, from.as_ref(), &mut input),
                }
            }
            changed = link.wait_for(|now| *now != Some(connection)) => {
                // Closed without an answer to what is under way: its outcome is unknown.
                drop(changed);
                return End::Closed(Cause::RobotDown);
            }
            () = tokio::time::sleep(wait) => {
                let now = clock::now();
                session.handle_timeout(now);
                if stuck_since.is_some_and(|since| since + WRITE_WITHIN <= now) {
                    return End::Closed(Cause::SlowReader);
                }
            }
        }
    }
}

/// Closes a client that may do nothing any more. A stop that has come before is handed out all the same. The
/// system is asked for it: the runtime may not have heard yet that something is there.
fn deny(session: &mut Session, stream: &TcpStream, input: &mut [u8]) {
    let socket = SockRef::from(stream);
    for _ in 0..READS_AT_THE_END {
        let Ok(count @ 1..) = (&*socket).read(input) else { break };
        session.handle_input(clock::now(), input.get(..count).unwrap_or_default());
    }
    session.close(Cause::Denied);
}

/// Begins a request. Stops and commands run to their end even if the client leaves.
///
/// `rule`: that of a moment ago, when the client sent this.
fn begin(
    door: &Arc<Door>,
    station: &Arc<Station>,
    client: Client,
    rule: &RawRule,
    ticket: Ticket,
    asked: Asked,
) -> Work {
    let (door, station) = (Arc::clone(door), Arc::clone(station));
    let begun = tokio::time::Instant::now();
    match asked {
        Asked::Query(addresses) => Box::pin(async move {
            let answer = serve::query(&station, &addresses).await;
            tokio::time::sleep_until(begun + door.pace()).await;
            (ticket, answer)
        }),
        Asked::Refused { request, reason } => Box::pin(async move {
            let answer = serve::refuse(&door, &station, client, &request, (Code::BadCommand, reason));
            tokio::time::sleep_until(begun + door.pace()).await;
            (ticket, answer)
        }),
        Asked::Stop(command) => {
            let rule = rule.clone();
            let work =
                tokio::spawn(async move { serve::stop(&door, &station, (client, &rule), command).await });
            Box::pin(async move { (ticket, work.await.unwrap_or(Answer::Silence)) })
        }
        Asked::Order(order) => {
            let pace = door.pace();
            let work = tokio::spawn(async move { serve::order(&door, &station, client, order).await });
            Box::pin(async move {
                let answer = work.await.unwrap_or(Answer::Silence);
                tokio::time::sleep_until(begun + pace).await;
                (ticket, answer)
            })
        }
    }
}
