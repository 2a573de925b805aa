//! The host of the gateway: its listener, and its wires to the robots.

use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use r6_client::{Connect, Reconnect, Robot, RobotSettings};
use r6_gateway::simulation::{self, Roads};
use r6_gateway::{RobotConfig, RobotName};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::sleep;
use turmoil::net::{TcpListener, TcpStream};

use super::name_of;
use crate::fault::{Class, Promise};
use crate::shared::{Shared, State, now};
use crate::wire::PORT;

/// The name of the host.
pub const GATEWAY: &str = "gateway";

/// The port of the API.
pub const HTTP_PORT: u16 = r6_gateway::DEFAULT_PORT;

/// The maximum number of tasks of the host: for each robot those of its client and of the gateway, one for
/// each connection of HTTP and for each request that goes on, and those of the gateway itself.
const MOST_TASKS: usize = 200;

/// How long to wait before a gateway that could not be started is started again, as a service manager does.
const AGAIN_AFTER: Duration = Duration::from_millis(500);

/// The program of the host.
pub async fn run(shared: Shared) -> turmoil::Result {
    let listener = Arc::new(TcpListener::bind(("0.0.0.0", HTTP_PORT)).await?);
    let _running = loop {
        match start(&shared, Arc::clone(&listener)).await {
            Ok(running) => break running,
            Err(error) => {
                shared.tell(format_args!("gateway: {error}"));
                sleep(AGAIN_AFTER).await;
            }
        }
    };
    shared.tell(format_args!("gateway: it runs"));
    if let Some(hall) = &mut shared.state().hall {
        hall.up_since = Some(now());
    }
    loop {
        sleep(Duration::from_millis(50)).await;
        let tasks = tokio::runtime::Handle::current().metrics().num_alive_tasks();
        shared.check(Promise::I6, tasks <= MOST_TASKS, || format!("the gateway has {tasks} tasks"));
    }
}

async fn start(
    shared: &Shared,
    listener: Arc<TcpListener>,
) -> Result<simulation::Running, Box<dyn std::error::Error>> {
    let Some(disk) = shared.state().hall.as_ref().map(|hall| hall.disk.clone()) else {
        return Err("there is no hall".into());
    };
    let plan = shared.plan.hall.as_ref().ok_or("there is no hall")?;
    let settings = |robot: u64| RobotSettings {
        reconnect: Reconnect { jitter_seed: Some(shared.plan.seed ^ robot), ..Reconnect::default() },
        ..RobotSettings::default()
    };
    let mut robots = Vec::new();
    for (robot, period) in plan.periods.iter().enumerate().filter(|(robot, _)| plan.added != Some(*robot)) {
        let name = RobotName::new(&name_of(robot)).ok_or("a name")?;
        let mut config = RobotConfig::new(name, format!("{}:{PORT}", name_of(robot)));
        (config.period, config.settings) = (*period, settings(robot as u64));
        robots.push(config);
    }
    let of = shared.clone();
    let roads = Roads::new(move |address, settings| {
        let road = Road { shared: of.clone(), address: address.to_owned() };
        Box::pin(Robot::connect_with(road, settings))
    });
    let settings = simulation::Settings {
        address: SocketAddr::new(turmoil::lookup(GATEWAY), HTTP_PORT),
        names: vec![GATEWAY.to_owned()],
        robots,
        robot_settings: settings(99),
        audit: None,
        history: None,
    };
    Ok(simulation::start(&disk, Entrance { shared: shared.clone(), listener }, roads, settings).await?)
}

/// Whether the system of the gateway gives it a socket. A refusal counts as a strike.
fn give_socket(shared: &Shared) -> io::Result<()> {
    let mut state = shared.state();
    let State { hall, record, .. } = &mut *state;
    if hall.as_ref().is_some_and(|hall| hall.has_no_files) {
        record.strikes(Class::G10);
        return Err(io::Error::other("too many open files"));
    }
    Ok(())
}

/// The listener of the gateway.
struct Entrance {
    shared: Shared,
    listener: Arc<TcpListener>,
}

impl r6_http::Listener for Entrance {
    type Stream = TcpStream;

    async fn accept(&mut self) -> io::Result<(TcpStream, SocketAddr)> {
        let accepted = self.listener.accept().await?;
        // The connection is closed at once where there is no socket for it.
        give_socket(&self.shared)?;
        Ok(accepted)
    }

    fn address(&self) -> Option<SocketAddr> {
        self.listener.local_addr().ok()
    }
}

/// The way to one robot.
struct Road {
    shared: Shared,
    address: String,
}

impl fmt::Display for Road {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.address)
    }
}

impl Connect for Road {
    type Stream = Tap;

    async fn connect(&mut self) -> io::Result<Tap> {
        give_socket(&self.shared)?;
        let (host, _) = self.address.rsplit_once(':').unwrap_or((&self.address, ""));
        let robot = host.strip_prefix("robot-").and_then(|number| number.parse().ok());
        let robot = robot.filter(|robot| *robot < self.shared.plan.robots.len());
        let robot: usize = robot.ok_or(io::ErrorKind::NotFound)?;
        let stream = TcpStream::connect((host, PORT)).await?;
        self.shared.tell(format_args!("gateway: connected to robot-{robot}"));
        Ok(Tap { stream, shared: self.shared.clone(), robot, begun: Vec::new() })
    }
}

/// The gateway's end of a connection to a robot.
struct Tap {
    stream: TcpStream,
    shared: Shared,
    robot: usize,
    /// What left of a frame that is not whole yet.
    begun: Vec<u8>,
}

impl Tap {
    fn sent(&mut self, bytes: &[u8]) {
        let (at, robot) = (now(), self.robot);
        self.begun.extend_from_slice(bytes);
        let mut frames = serde_json::Deserializer::from_slice(&self.begun).into_iter::<serde_json::Value>();
        let mut end = 0;
        let mut state = self.shared.state();
        let State { record, hall, .. } = &mut *state;
        record.tell(at, format_args!("robot-{robot} < {}", String::from_utf8_lossy(bytes)));
        let left = loop {
            match frames.next() {
                Some(Ok(frame)) => {
                    end = frames.byte_offset();
                    if let Some(hall) = hall {
                        hall.leaves(at, robot, &frame, record);
                    }
                }
                left => break left,
            }
        };
        // The part of a frame ends too early. Anything else is no frame, and what follows cannot be judged.
        if let Some(Err(error)) = left.filter(|left| !left.as_ref().is_err_and(serde_json::Error::is_eof)) {
            record.check(Promise::I12, at, false, || {
                format!("{}: what leaves is no frame: {error}", name_of(robot))
            });
        }
        drop(state);
        self.begun.drain(..end);
    }
}

impl AsyncRead for Tap {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let read = ready!(Pin::new(&mut self.stream).poll_read(cx, buffer));
        let bytes = buffer.filled().get(before..).unwrap_or_default();
        self.shared.tell(format_args!("robot-{} > {}", self.robot, String::from_utf8_lossy(bytes)));
        Poll::Ready(read)
    }
}

impl AsyncWrite for Tap {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.stream).poll_write(cx, bytes));
        if let Ok(count) = written {
            self.sent(bytes.get(..count).unwrap_or_default());
        }
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
