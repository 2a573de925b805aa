//! A hall of virtual controllers behind a gateway, and a client of its API.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_client::RobotSettings;
use r6_controller::{Event, LogEntry, Program, StartState};
use r6_gateway::{
    AuditSettings, Gateway, GatewaySettings, HistorySettings, RawPolicy, RawPort, RobotConfig, RobotName,
    TlsSettings,
};
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::broadcast::Receiver;
use tokio::sync::watch;

/// How long a test waits for something that takes milliseconds.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// A gateway, its robots, and a token of each role.
pub struct Hall {
    pub gateway: Gateway,
    pub robots: Vec<VirtualController>,
    pub data: TempDir,
    pub viewer: String,
    pub operator: String,
    pub engineer: String,
    pub admin: String,
}

pub fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// A controller whose start button moves J1 back and forth for minutes.
pub async fn ready_to_start() -> VirtualController {
    let text = "[[step]]\ndo = \"axis-move\"\nto = [60, 0, 0, 0, 0, 0]\nspeed = 1\n\
                [[step]]\ndo = \"axis-move\"\nto = [-60, 0, 0, 0, 0, 0]\nspeed = 1\n";
    let program = Program::read("long", text).unwrap();
    let builder = VirtualController::builder().program(program).unwrap().stands(StartState::Auto);
    builder.start().await.unwrap()
}

impl Hall {
    /// A gateway with one robot, `press`.
    pub async fn start() -> Self {
        Self::with(vec![VirtualController::start().await.unwrap()]).await
    }

    /// A gateway with these robots: `press`, `saw`, `lathe`. When this returns, all are up.
    pub async fn with(robots: Vec<VirtualController>) -> Self {
        let names = ["press", "saw", "lathe"].into_iter().zip(&robots);
        let configs: Vec<_> = names
            .map(|(called, robot)| RobotConfig {
                period: Duration::from_millis(20),
                ..RobotConfig::new(name(called), robot.address().to_string())
            })
            .collect();
        let names: Vec<_> = configs.iter().map(|config| config.name.clone()).collect();
        let hall = Self::at(tempfile::tempdir().unwrap(), configs, robots).await;
        for name in names {
            hall.until_up(name.as_str()).await;
        }
        hall
    }

    /// A gateway with this folder and these robots.
    pub async fn at(data: TempDir, configs: Vec<RobotConfig>, robots: Vec<VirtualController>) -> Self {
        let gateway = gateway(data.path(), configs).await;
        Self::of(gateway, data, robots)
    }

    /// This gateway with this folder, its robots, and a new token of each role.
    pub fn of(gateway: Gateway, data: TempDir, robots: Vec<VirtualController>) -> Self {
        let make = |role: Role| {
            let name = role.word().to_owned();
            r6_gateway::make_token(data.path(), role, None, name).unwrap().1
        };
        let [viewer, operator, engineer, admin] = Role::ALL.map(make);
        Self { gateway, robots, data, viewer, operator, engineer, admin }
    }

    /// A gateway with one robot, `press`, at this address, which is read with this period and is up, and its
    /// raw port with these rules.
    pub async fn with_raw(
        robot: VirtualController,
        address: SocketAddr,
        policy: RawPolicy,
        period: Duration,
    ) -> Self {
        let press = RobotConfig { period, ..RobotConfig::new(name("press"), address.to_string()) };
        let data = tempfile::tempdir().unwrap();
        let port = RawPort { robot: name("press"), listen: SocketAddr::from(([127, 0, 0, 1], 0)) };
        let settings =
            GatewaySettings { raw: vec![port], raw_policy: policy, ..settings(data.path(), vec![press]) };
        let gateway = Gateway::start(settings).await.unwrap();
        let hall = Self::of(gateway, data, vec![robot]);
        hall.until_up("press").await;
        hall
    }

    /// Ends the gateway and starts it again with one robot, `press`, at this address, and its raw port.
    pub async fn again_with_raw(self, address: SocketAddr, policy: RawPolicy) -> Self {
        let Self { gateway: first, data, robots, viewer, operator, engineer, admin } = self;
        first.shutdown().await.unwrap();
        let press = RobotConfig::new(name("press"), address.to_string());
        let port = RawPort { robot: name("press"), listen: SocketAddr::from(([127, 0, 0, 1], 0)) };
        let settings =
            GatewaySettings { raw: vec![port], raw_policy: policy, ..settings(data.path(), vec![press]) };
        let gateway = Gateway::start(settings).await.unwrap();
        let hall = Self { gateway, robots, data, viewer, operator, engineer, admin };
        hall.until_up("press").await;
        hall
    }

    /// Where the raw port of `press` is.
    pub fn raw(&self) -> SocketAddr {
        self.gateway.raw_ports()[0].listen
    }

    /// Ends the gateway and starts it again with these robots.
    pub async fn again(self, configs: Vec<RobotConfig>, robots: Vec<VirtualController>) -> Self {
        let Self { gateway: first, data, viewer, operator, engineer, admin, .. } = self;
        first.shutdown().await.unwrap();
        let gateway = gateway(data.path(), configs).await;
        Self { gateway, robots, data, viewer, operator, engineer, admin }
    }

    /// One request: the status and the body.
    pub async fn call(&self, token: &str, method: &str, path: &str, body: Option<&Value>) -> (u16, Value) {
        call(self.gateway.address(), token, method, path, body).await
    }

    pub async fn get(&self, token: &str, path: &str) -> Value {
        let (status, body) = self.call(token, "GET", path, None).await;
        assert_eq!(status, 200, "{path}: {body}");
        body
    }

    pub async fn post(&self, token: &str, path: &str, body: &Value) -> (u16, Value) {
        self.call(token, "POST", path, Some(body)).await
    }

    pub async fn stop(&self, token: &str, robot: &str) -> (u16, Value) {
        self.call(token, "POST", &format!("/v1/robots/{robot}/stop"), None).await
    }

    /// Makes a user with the usual password.
    pub async fn user(&self, name: &str, role: Role) {
        let wanted = json!({ "role": role, "password": PASSWORD });
        let (status, problem) =
            self.call(&self.admin, "PUT", &format!("/v1/users/{name}"), Some(&wanted)).await;
        assert_eq!(status, 201, "{problem}");
    }

    /// A browser in which this user signed in.
    pub async fn browser(&self, name: &str) -> Browser {
        Browser::sign_in(self.gateway.address(), name, PASSWORD).await
    }

    /// Acquires the lease of a robot: its key.
    pub async fn lease(&self, token: &str, robot: &str) -> Value {
        let (status, lease) = self.post(token, &format!("/v1/robots/{robot}/lease"), &json!({})).await;
        assert_eq!(status, 200, "{lease}");
        lease["lease"].clone()
    }

    /// Sends a command with this lease; `null` for none.
    pub async fn command(&self, token: &str, robot: &str, lease: &Value, words: &str) -> (u16, Value) {
        let mut words = words.split(' ');
        let command = words.next().unwrap();
        let arguments: Vec<_> = words.collect();
        let mut body = json!({ "command": command, "arguments": arguments });
        if !lease.is_null() {
            body["lease"] = lease.clone();
        }
        self.post(token, &format!("/v1/robots/{robot}/commands"), &body).await
    }

    /// Waits until the state of a robot is as `is` says.
    pub async fn until(&self, robot: &str, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let state = self.get(&self.viewer, &format!("/v1/robots/{robot}")).await;
            if is(&state) {
                return state;
            }
            assert!(begun.elapsed() < PATIENCE, "{state:#}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    pub async fn until_up(&self, robot: &str) -> Value {
        self.until(robot, |state| state["link"] == "up").await
    }

    /// All entries of the audit log.
    pub async fn audit(&self) -> Vec<Value> {
        self.get(&self.engineer, "/v1/audit?limit=1000").await["entries"].as_array().unwrap().clone()
    }

    /// Waits until the audit log has an entry as `is` says.
    pub async fn until_audited(&self, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let entries = self.audit().await;
            if let Some(entry) = entries.iter().find(|entry| is(entry)) {
                return entry.clone();
            }
            assert!(begun.elapsed() < PATIENCE, "{entries:#?}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
}

async fn gateway(data: &Path, robots: Vec<RobotConfig>) -> Gateway {
    Gateway::start(settings(data, robots)).await.unwrap()
}

/// A gateway without raw ports.
pub fn settings(data: &Path, robots: Vec<RobotConfig>) -> GatewaySettings {
    GatewaySettings {
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        data: data.to_owned(),
        store: None,
        robots,
        robot_settings: RobotSettings::default(),
        raw: Vec::new(),
        raw_policy: RawPolicy::default(),
        hall: None,
        audit: AuditSettings::default(),
        history: HistorySettings::default(),
        names: Vec::new(),
        tls: TlsSettings::Off,
    }
}

/// Whether such an event comes from the values of a robot.
pub fn is_of_values(kind: &str) -> bool {
    let prefixes = ["alarm_", "cycle_", "mode_", "parts", "program_", "unseen"];
    prefixes.iter().any(|prefix| kind.starts_with(prefix))
}

/// A value of a robot's state.
pub fn signal<'v>(state: &'v Value, address: &str) -> &'v Value {
    let signals = state["signals"].as_array().unwrap();
    signals
        .iter()
        .find(|signal| signal["address"] == address)
        .unwrap_or_else(|| panic!("{address}: {state:#}"))
}

/// An answer with its `ETag`.
#[derive(Debug)]
pub struct Reply {
    pub status: u16,
    pub etag: Option<String>,
    pub body: Value,
}

/// One request over a connection of its own: the status and the body.
pub async fn call(
    gateway: SocketAddr,
    token: &str,
    method: &str,
    path: &str,
    body: Option<&Value>,
) -> (u16, Value) {
    let answer = request(gateway, &bearer(token), method, path, body).await;
    (answer.status, answer.body)
}

/// The same, with these lines of the head besides.
pub async fn call_with(
    gateway: SocketAddr,
    token: &str,
    method: &str,
    path: &str,
    lines: &str,
    body: Option<&Value>,
) -> Reply {
    let headers = bearer(token) + lines;
    let Answer { status, head, body } = request(gateway, &headers, method, path, body).await;
    let etag = head.lines().find_map(|line| line.strip_prefix("etag: ")).map(str::to_owned);
    Reply { status, etag, body }
}

/// The header with a token; nothing without one.
fn bearer(token: &str) -> String {
    if token.is_empty() { String::new() } else { format!("Authorization: Bearer {token}\r\n") }
}

/// An answer.
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: Value,
}

/// One request with these headers over a connection of its own.
pub async fn request(
    gateway: SocketAddr,
    headers: &str,
    method: &str,
    path: &str,
    body: Option<&Value>,
) -> Answer {
    let mut stream = TcpStream::connect(gateway).await.unwrap();
    let body = body.map(Value::to_string);
    let mut head = format!("{method} {path} HTTP/1.1\r\nHost: {gateway}\r\nConnection: close\r\n{headers}");
    if let Some(body) = &body {
        head += &format!("Content-Type: application/json\r\nContent-Length: {}\r\n", body.len());
    }
    stream.write_all(format!("{head}\r\n{}", body.unwrap_or_default()).as_bytes()).await.unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).await.unwrap();
    let status = reply.split(' ').nth(1).unwrap_or_else(|| panic!("{reply:?}")).parse().unwrap();
    let (head, body) = reply.split_once("\r\n\r\n").unwrap();
    let body = serde_json::from_str(body).unwrap_or_else(|_| json!(body));
    Answer { status, head: head.to_owned(), body }
}

/// A password of the tests.
pub const PASSWORD: &str = "correct horse battery";

/// The name of the cookie of this gateway.
pub fn cookie_name(gateway: SocketAddr) -> String {
    format!("r6_session_{}", gateway.port())
}

/// A browser in which a user signed in.
#[derive(Clone, Debug)]
pub struct Browser {
    gateway: SocketAddr,
    pub cookie: String,
    pub csrf: String,
}

impl Browser {
    pub async fn sign_in(gateway: SocketAddr, name: &str, password: &str) -> Self {
        let asked = json!({ "name": name, "password": password });
        Self::open(gateway, "/v1/session", &asked).await
    }

    /// A browser that signs in with a token.
    pub async fn with_token(gateway: SocketAddr, token: &str) -> Self {
        Self::open(gateway, "/v1/session/token", &json!({ "token": token })).await
    }

    /// A browser that signs in over this path.
    pub async fn open(gateway: SocketAddr, path: &str, asked: &Value) -> Self {
        let answer = request(gateway, "", "POST", path, Some(asked)).await;
        assert_eq!(answer.status, 200, "{}", answer.body);
        let named = format!("set-cookie: {}=", cookie_name(gateway));
        let cookie = answer.head.lines().find_map(|line| line.strip_prefix(&named));
        let (cookie, attributes) = cookie.unwrap().split_once(';').unwrap();
        assert_eq!(attributes, " HttpOnly; SameSite=Strict; Path=/");
        assert_eq!(cookie.len(), 64);
        let csrf = answer.body["csrf"].as_str().unwrap().to_owned();
        Self { gateway, cookie: cookie.to_owned(), csrf }
    }

    /// The header with the session.
    pub fn headers(&self) -> String {
        format!("Cookie: {}={}\r\n", cookie_name(self.gateway), self.cookie)
    }

    /// A request with the proof that the page belongs to the session.
    pub async fn call(&self, method: &str, path: &str, body: Option<&Value>) -> (u16, Value) {
        let headers = format!("{}X-CSRF-Token: {}\r\n", self.headers(), self.csrf);
        let answer = request(self.gateway, &headers, method, path, body).await;
        (answer.status, answer.body)
    }

    /// A request without it.
    pub async fn bare(&self, method: &str, path: &str, body: Option<&Value>) -> (u16, Value) {
        let answer = request(self.gateway, &self.headers(), method, path, body).await;
        (answer.status, answer.body)
    }
}

/// A stream of server-sent events.
pub struct Stream {
    lines: BufReader<TcpStream>,
}

/// An event of a stream: its kind, its id and its data.
#[derive(Debug)]
pub struct Message {
    pub kind: String,
    pub id: String,
    pub data: Value,
}

impl Stream {
    pub async fn open(gateway: SocketAddr, token: &str, path: &str, last_event_id: &str) -> Self {
        Self::open_with(gateway, &bearer(token), path, last_event_id).await
    }

    /// A stream of a caller with these headers.
    pub async fn open_with(gateway: SocketAddr, headers: &str, path: &str, last_event_id: &str) -> Self {
        let mut stream = TcpStream::connect(gateway).await.unwrap();
        let mut head = format!("GET {path} HTTP/1.1\r\nHost: {gateway}\r\n{headers}");
        if !last_event_id.is_empty() {
            head += &format!("Last-Event-ID: {last_event_id}\r\n");
        }
        stream.write_all(format!("{head}\r\n").as_bytes()).await.unwrap();
        let mut stream = Self { lines: BufReader::new(stream) };
        let status = stream.line().await.unwrap();
        assert!(status.starts_with("HTTP/1.1 200"), "{status}");
        while !stream.line().await.unwrap().is_empty() {}
        stream
    }

    async fn line(&mut self) -> Option<String> {
        let mut line = String::new();
        let read = tokio::time::timeout(PATIENCE, self.lines.read_line(&mut line)).await;
        let read = read.expect("the stream says something in time").unwrap_or(0);
        (read > 0).then(|| line.trim_end().to_owned())
    }

    /// The next event; `None` at the end of the stream. Sizes of chunks and comments are passed over.
    pub async fn next(&mut self) -> Option<Message> {
        let mut message = Message { kind: String::new(), id: String::new(), data: Value::Null };
        loop {
            let line = self.line().await?;
            if let Some(value) = line.strip_prefix("event: ") {
                message.kind = value.to_owned();
            } else if let Some(value) = line.strip_prefix("id: ") {
                message.id = value.to_owned();
            } else if let Some(value) = line.strip_prefix("data: ") {
                message.data = serde_json::from_str(value).unwrap();
            } else if line.is_empty() && !message.data.is_null() {
                return Some(message);
            } else if line == "0" {
                return None;
            }
        }
    }
}

/// A way to a robot that can be cut: then its connections end, and new ones are taken and never answered,
/// until it is whole again.
pub async fn way(to: SocketAddr) -> (SocketAddr, watch::Sender<bool>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (cut, is_cut) = watch::channel(false);
    tokio::spawn(async move {
        let mut silent = Vec::new();
        while let Ok((mut near, _)) = listener.accept().await {
            if *is_cut.borrow() {
                silent.push(near);
                continue;
            }
            let mut until = is_cut.clone();
            tokio::spawn(async move {
                let mut far = TcpStream::connect(to).await.unwrap();
                tokio::select! {
                    _ = tokio::io::copy_bidirectional(&mut near, &mut far) => {}
                    _ = until.wait_for(|is_cut| *is_cut) => {}
                }
            });
        }
    });
    (address, cut)
}

/// The commands that the log of a virtual controller has by now.
pub fn commands(log: &mut Receiver<Arc<LogEntry>>) -> Vec<String> {
    let entries = std::iter::from_fn(|| log.try_recv().ok());
    let accepted = entries.filter_map(|entry| match &entry.event {
        Event::CommandAccepted { command, .. } => Some(command.as_str().to_owned()),
        _ => None,
    });
    accepted.collect()
}
