//! The raw port: old scripts, and clients that mean harm.

mod cameras;
mod commands;
mod hostile;
pub mod lists;
mod queries;
mod switch;

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_gateway::{RawAllow, RawPolicy, RawRule, RawSource};
use r6_proto::frame::{FrameBuffer, Limits};
use r6_sim::VirtualController;
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinSet;

use crate::support::{Hall, PATIENCE};

/// A gateway with the raw port of one robot, and what goes over the connection between them.
pub struct Raw {
    pub hall: Hall,
    pub tap: Tap,
}

impl Raw {
    /// These sources may do this.
    pub async fn start(robot: VirtualController, rules: &[(&str, RawAllow)]) -> Self {
        Self::with(robot, policy(rules)).await
    }

    pub async fn with(robot: VirtualController, policy: RawPolicy) -> Self {
        Self::read_every(Duration::from_millis(20), robot, policy).await
    }

    pub async fn read_every(period: Duration, robot: VirtualController, policy: RawPolicy) -> Self {
        let tap = Tap::before(robot.address()).await;
        let hall = Hall::with_raw(robot, tap.address, policy, period).await;
        Self { hall, tap }
    }

    pub fn address(&self) -> SocketAddr {
        self.hall.raw()
    }

    pub async fn script(&self) -> Script {
        Script::at(self.address()).await
    }
}

/// These sources may do this.
pub fn policy(rules: &[(&str, RawAllow)]) -> RawPolicy {
    let rule = |(source, allow): &(&str, RawAllow)| RawRule::new(RawSource::parse(source).unwrap(), *allow);
    RawPolicy::new(rules.iter().map(rule).collect())
}

/// Passes all bytes on, and remembers what goes to the controller.
pub struct Tap {
    pub address: SocketAddr,
    seen: Arc<Mutex<Seen>>,
    _task: JoinSet<()>,
}

#[derive(Default)]
struct Seen {
    connections: usize,
    frames: Vec<String>,
    /// Frames with this in them are not passed on.
    lost: Option<&'static str>,
    /// This part of frames is passed on as that.
    changed: Option<(&'static str, &'static str)>,
    /// A frame with this in it is passed on once the gate is open, and so is what comes behind it.
    held: Option<(&'static str, watch::Receiver<bool>)>,
}

impl Tap {
    pub async fn before(controller: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let seen = Arc::<Mutex<Seen>>::default();
        let sees = Arc::clone(&seen);
        let mut task = JoinSet::new();
        task.spawn(async move {
            let mut both = JoinSet::new();
            while let Ok((near, _)) = listener.accept().await {
                let Ok(far) = TcpStream::connect(controller).await else { continue };
                near.set_nodelay(true).unwrap();
                far.set_nodelay(true).unwrap();
                sees.lock().unwrap().connections += 1;
                both.spawn(pass(near, far, Arc::clone(&sees)));
            }
        });
        Self { address, seen, _task: task }
    }

    /// How many connections were made to the controller.
    pub fn connections(&self) -> usize {
        self.seen.lock().unwrap().connections
    }

    /// Loses the frames that have this in them, from now on.
    pub fn lose(&self, part: &'static str) {
        self.seen.lock().unwrap().lost = Some(part);
    }

    /// Passes this part of frames on as that, from now on.
    pub fn change(&self, part: &'static str, to: &'static str) {
        self.seen.lock().unwrap().changed = Some((part, to));
    }

    /// Holds frames that have this in them, and what comes behind them, until `true` is sent.
    pub fn hold(&self, part: &'static str) -> watch::Sender<bool> {
        let (gate, opens) = watch::channel(false);
        self.seen.lock().unwrap().held = Some((part, opens));
        gate
    }

    /// The frames to the controller that have this in them.
    pub fn frames(&self, part: &str) -> Vec<String> {
        let seen = self.seen.lock().unwrap();
        seen.frames.iter().filter(|frame| frame.contains(part)).cloned().collect()
    }
}

async fn pass(mut near: TcpStream, mut far: TcpStream, seen: Arc<Mutex<Seen>>) {
    let mut frames = FrameBuffer::new(Limits::default());
    let (mut up, mut down) = ([0; 4096], [0; 4096]);
    loop {
        tokio::select! {
            read = near.read(&mut up) => {
                let Ok(count @ 1..) = read else { return };
                assert_eq!(frames.push(&up[..count]), count);
                while let Some(frame) = frames.next() {
                    let frame = String::from_utf8(frame.unwrap().bytes.to_vec()).unwrap();
                    let (is_lost, changed, held) = {
                        let mut seen = seen.lock().unwrap();
                        seen.frames.push(frame.clone());
                        let held = seen.held.clone().filter(|(part, _)| frame.contains(part));
                        (seen.lost.is_some_and(|part| frame.contains(part)), seen.changed, held)
                    };
                    if let Some((_, mut opens)) = held {
                        opens.wait_for(|is_open| *is_open).await.unwrap();
                    }
                    let frame = match changed {
                        Some((part, to)) => frame.replace(part, to),
                        None => frame,
                    };
                    if !is_lost && far.write_all(frame.as_bytes()).await.is_err() {
                        return;
                    }
                }
            }
            read = far.read(&mut down) => {
                let Ok(count @ 1..) = read else { return };
                if near.write_all(&down[..count]).await.is_err() {
                    return;
                }
            }
        }
    }
}

/// A script that speaks the robots' protocol.
pub struct Script {
    pub stream: TcpStream,
    frames: FrameBuffer,
}

impl Script {
    /// Connects from 127.0.0.1.
    pub async fn at(address: SocketAddr) -> Self {
        Self::from(1, address).await
    }

    /// Connects from 127.0.0.`last`.
    pub async fn from(last: u8, address: SocketAddr) -> Self {
        let socket = TcpSocket::new_v4().unwrap();
        socket.bind(SocketAddr::new(IpAddr::V4(Ipv4Addr::new(127, 0, 0, last)), 0)).unwrap();
        Self::of(socket.connect(address).await.unwrap())
    }

    pub fn of(stream: TcpStream) -> Self {
        stream.set_nodelay(true).unwrap();
        Self { stream, frames: FrameBuffer::new(Limits::default()) }
    }

    pub async fn send(&mut self, frame: &str) {
        self.stream.write_all(frame.as_bytes()).await.unwrap();
    }

    /// The next reply, byte for byte; `None` once the other end has closed.
    pub async fn reply(&mut self) -> Option<String> {
        loop {
            if let Some(frame) = self.frames.next() {
                return Some(String::from_utf8(frame.unwrap().bytes.to_vec()).unwrap());
            }
            let mut bytes = [0; 4096];
            let read = tokio::time::timeout(PATIENCE, self.stream.read(&mut bytes)).await;
            match read.expect("a reply or an end in time") {
                Ok(0) | Err(_) => return None,
                Ok(count) => assert_eq!(self.frames.push(&bytes[..count]), count),
            }
        }
    }

    /// Sends a request and returns its reply.
    pub async fn ask(&mut self, frame: &str) -> String {
        self.send(frame).await;
        self.reply().await.expect("a reply")
    }

    /// The values of these addresses.
    pub async fn query(&mut self, addresses: &str) -> Vec<Value> {
        let addresses: Vec<_> = addresses.split(' ').collect();
        let reply: Value = serde_json::from_str(&self.ask(&query(&addresses)).await).unwrap();
        reply["queryData"].as_array().unwrap().clone()
    }

    /// Sends a command, and returns what `cmdReply` says behind the name: `ok`, or `err` and the reason.
    pub async fn command(&mut self, words: &str) -> String {
        let words: Vec<_> = words.split(' ').collect();
        verdict(&self.ask(&command(&words)).await)
    }
}

pub fn query(addresses: &[&str]) -> String {
    let dsid = "www.hc-system.com.RemoteMonitor";
    serde_json::json!({ "dsID": dsid, "reqType": "query", "packID": "5", "queryAddr": addresses }).to_string()
}

pub fn command(words: &[&str]) -> String {
    let dsid = "www.hc-system.com.RemoteMonitor";
    serde_json::json!({ "dsID": dsid, "reqType": "command", "packID": "6", "cmdData": words }).to_string()
}

/// What a reply to a command says behind the name of the command.
pub fn verdict(reply: &str) -> String {
    let reply: Value = serde_json::from_str(reply).unwrap();
    let words: Vec<_> = reply["cmdReply"].as_array().unwrap().iter().skip(1).collect();
    words.into_iter().map(|word| word.as_str().unwrap()).collect::<Vec<_>>().join(" ")
}
