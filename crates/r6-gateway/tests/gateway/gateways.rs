//! Gateways that share a store in PostgreSQL, in this process or in one of their own, and servers for them.

use std::io::{BufRead, BufReader, Write as _};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_gateway::{At, Database, Gateway, GatewaySettings, RobotConfig};
use r6_testkit::postgres::{Server, shared, signal};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::support::{PATIENCE, call, name, settings};

/// Does something that waits beside the tasks.
pub async fn beside<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    tokio::task::spawn_blocking(work).await.unwrap()
}

/// A database, and an admin's token in it. `None` without PostgreSQL.
pub async fn database(test: &'static str) -> Option<(Server, String, String)> {
    let (server, url) = beside(move || {
        let server = shared(test)?;
        let url = server.database();
        Some((server, url))
    })
    .await?;
    let token = admin(&url).await;
    Some((server, url, token))
}

/// The same on a server of its own, which can be killed.
pub async fn own_database(test: &'static str) -> Option<(Server, String, String)> {
    let (server, url) = beside(move || {
        let server = Server::own(test)?;
        let url = server.database();
        Some((server, url))
    })
    .await?;
    let token = admin(&url).await;
    Some((server, url, token))
}

/// Kills the server.
pub async fn killed(mut server: Server) -> Server {
    beside(move || {
        server.kill();
        server
    })
    .await
}

/// Starts the server again.
pub async fn started(mut server: Server) -> Server {
    beside(move || {
        server.start();
        server
    })
    .await
}

pub async fn admin(url: &str) -> String {
    let at = at(url);
    beside(move || r6_gateway::make_token(at, Role::Admin, None, String::new()).unwrap().1).await
}

fn at(url: &str) -> At {
    At::Database(Database::parse(url).unwrap())
}

/// Robots, by their names.
pub type Robots = [(&'static str, SocketAddr)];

pub fn settings_of(url: &str, data: &Path, robots: &[(String, SocketAddr)]) -> GatewaySettings {
    let period = Duration::from_millis(20);
    let robot = |(called, at): &(String, SocketAddr)| RobotConfig {
        period,
        ..RobotConfig::new(name(called), at.to_string())
    };
    let robots = robots.iter().map(robot).collect();
    GatewaySettings { store: Some(Database::parse(url).unwrap()), ..settings(data, robots) }
}

/// A gateway of this process.
pub struct Here {
    pub gateway: Gateway,
    pub token: String,
    _data: TempDir,
}

impl Here {
    pub async fn start(url: &str, token: &str, robots: &Robots) -> Self {
        let robots: Vec<_> = robots.iter().map(|(name, at)| ((*name).to_owned(), *at)).collect();
        Self::start_with(url, token, &robots).await
    }

    async fn start_with(url: &str, token: &str, robots: &[(String, SocketAddr)]) -> Self {
        let data = tempfile::tempdir().unwrap();
        let gateway = Gateway::start(settings_of(url, data.path(), robots)).await.unwrap();
        Self { gateway, token: token.to_owned(), _data: data }
    }

    pub async fn call(&self, method: &str, path: &str, body: Option<&Value>) -> (u16, Value) {
        call(self.gateway.address(), &self.token, method, path, body).await
    }

    /// Waits until it owns a robot, which answers.
    pub async fn until_up(&self, robot: &str) -> Value {
        let begun = Instant::now();
        loop {
            let (status, state) = self.call("GET", &format!("/v1/robots/{robot}"), None).await;
            if status == 200 && state["link"] == "up" && self.owns(robot).await {
                return state;
            }
            assert!(begun.elapsed() < PATIENCE, "{status} {state}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// Whether this gateway has the connection of a robot.
    pub async fn owns(&self, robot: &str) -> bool {
        owns(self.gateway.address(), &self.token, robot).await
    }

    pub async fn lease(&self, robot: &str) -> Value {
        lease(self.gateway.address(), &self.token, robot).await
    }
}

pub async fn owns(gateway: SocketAddr, token: &str, robot: &str) -> bool {
    let (_, metrics) = call(gateway, token, "GET", "/metrics", None).await;
    metrics.as_str().unwrap().contains(&format!("r6_gateway_robot_up{{robot=\"{robot}\"}}"))
}

pub async fn lease(gateway: SocketAddr, token: &str, robot: &str) -> Value {
    let asked = json!({ "duration_ms": 300_000 });
    let path = format!("/v1/robots/{robot}/lease");
    let (status, lease) = call(gateway, token, "POST", &path, Some(&asked)).await;
    assert_eq!(status, 200, "{lease}");
    lease["lease"].clone()
}

pub async fn command(gateway: SocketAddr, token: &str, robot: &str, lease: &Value) -> (u16, Value) {
    let body = json!({ "command": "modifyGSPD", "arguments": ["5"], "lease": lease });
    call(gateway, token, "POST", &format!("/v1/robots/{robot}/commands"), Some(&body)).await
}

/// Waits until this holds.
pub async fn until(holds: impl Fn() -> bool, what: &str) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "{what}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// Checks that the chain of the audit log is whole, and returns its entries.
pub async fn audit(here: &Here, url: &str) -> Vec<Value> {
    let at = at(url);
    beside(move || r6_gateway::verify(at, &[], None)).await.unwrap();
    let (status, page) = here.call("GET", "/v1/audit?limit=1000", None).await;
    assert_eq!(status, 200, "{page}");
    page["entries"].as_array().unwrap().clone()
}

/// A gateway in a process of its own.
pub struct There {
    pub child: Child,
    pub address: SocketAddr,
}

impl There {
    /// When this returns, it owns the robots, and they answer.
    pub async fn start(url: &str, robots: &Robots) -> Self {
        let (mut there, address) = Self::spawn(url, robots);
        there.address = address.await;
        there
    }

    /// The process, which was just started, and what tells its address once it owns the robots.
    pub fn spawn(url: &str, robots: &Robots) -> (Self, impl Future<Output = SocketAddr> + use<>) {
        let robots: Vec<_> = robots.iter().map(|(name, at)| format!("{name}={at}")).collect();
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "gateways::child", "--nocapture"])
            .env("R6_OWNER_STORE", url)
            .env("R6_OWNER_ROBOTS", robots.join(","))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let out = child.stdout.take().unwrap();
        let line = beside(move || {
            let lines = BufReader::new(out).lines().map(Result::unwrap);
            lines.filter_map(|line| line.strip_prefix("gateway ").map(str::to_owned)).next()
        });
        let unknown = SocketAddr::from(([0, 0, 0, 0], 0));
        (Self { child, address: unknown }, async { line.await.unwrap().parse().unwrap() })
    }

    /// Freezes it, or lets it go on. When this returns, it is frozen.
    pub fn signal(&self, name: &str) {
        signal(name, &self.child.id().to_string());
        let status = format!("/proc/{}/status", self.child.id());
        let begun = Instant::now();
        while name == "STOP"
            && std::fs::read_to_string(&status).is_ok_and(|status| !status.contains("State:\tT"))
        {
            assert!(begun.elapsed() < PATIENCE, "it does not stop");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for There {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The process of [`There`]. It does nothing unless the tests start it, and ends when it is killed.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn child() {
    let of = |name| std::env::var(name).ok();
    let (Some(url), Some(robots)) = (of("R6_OWNER_STORE"), of("R6_OWNER_ROBOTS")) else { return };
    let token = admin(&url).await;
    let robots: Vec<_> = robots
        .split(',')
        .map(|robot| robot.split_once('=').unwrap())
        .map(|(name, at)| (name.to_owned(), at.parse().unwrap()))
        .collect();
    let here = Here::start_with(&url, &token, &robots).await;
    for (robot, _) in &robots {
        here.until_up(robot).await;
    }
    let mut out = std::io::stdout();
    writeln!(out, "gateway {}", here.gateway.address()).unwrap();
    // It ends with the test at the latest.
    tokio::time::sleep(Duration::from_secs(100)).await;
}
