//! A gateway in front of a thousand robots that work: what a poll that is kept costs, and what it takes
//! besides.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_client::{Address, RobotSettings};
use r6_controller::Library;
use r6_gateway::{Gateway, GatewaySettings, HistorySettings, RawPolicy, RobotConfig, RobotName, TlsSettings};
use r6_sim::{SimSettings, Simulation};
use serde_json::Value;
use tokio::runtime::Builder;

use crate::measure::{Contender, compare, processor_time, processor_time_of};
use crate::report::{Figure, Goal, Row};
use crate::rows::at_rest::resident_megabytes;
use crate::serve::{Running, Server, told};

const ROBOTS: u16 = 1000;

/// Each robot is polled ten times a second.
const EVERY: Duration = Duration::from_millis(100);

/// The slice of this row, which holds several polls of each robot.
const LONG_SLICE: Duration = Duration::from_secs(1);

/// How long the gateway runs before something is measured: all robots are known, and the first chunks are on
/// the disk.
const SETTLE: Duration = Duration::from_secs(15);

/// How many commands are measured.
const COMMANDS: usize = 300;

/// A program that moves all axes back and forth without an end.
const WORK: &str = "[[step]]\ndo = \"axis-move\"\nto = [60, -10, 20, 30, 40, 50]\nspeed = 20\n\
                    [[step]]\ndo = \"axis-move\"\nto = [-60, 10, -20, -30, -40, -50]\nspeed = 20\n";

/// The server process of the robots: a thousand controllers whose program runs. It prints their addresses.
pub fn serve_robots() {
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    let mut library = Library::default();
    library.load("work", WORK).expect("a program");
    let settings = SimSettings { count: ROBOTS, library, mold: "work".to_owned(), ..SimSettings::default() };
    let simulation = runtime.block_on(Simulation::start(settings)).expect("it starts");
    let addresses: Vec<_> =
        simulation.controllers().iter().map(|controller| controller.address().to_string()).collect();
    wait(&runtime, addresses.join(" "));
}

/// The server process of the gateway, in front of the robots with these addresses. It prints its address, a
/// token and its folder.
pub fn serve_gateway(robots: &[String]) {
    let runtime = Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("a runtime");
    let data = tempfile::tempdir().expect("a folder");
    let robots = robots.iter().enumerate().map(|(number, address)| RobotConfig {
        period: EVERY,
        ..RobotConfig::new(name(number), address.as_str())
    });
    let settings = GatewaySettings {
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        data: data.path().to_owned(),
        robots: robots.collect(),
        robot_settings: RobotSettings::default(),
        raw: Vec::new(),
        raw_policy: RawPolicy::default(),
        hall: None,
        history: HistorySettings::default(),
        names: Vec::new(),
        tls: TlsSettings::Off,
    };
    let gateway = runtime.block_on(Gateway::start(settings)).expect("it starts");
    let token = r6_gateway::make_token(data.path(), Role::Operator, None, String::new()).expect("a token").1;
    wait(&runtime, format!("{} {token} {}", gateway.address(), data.path().display()));
}

fn name(number: usize) -> RobotName {
    RobotName::new(&format!("robot-{number}")).expect("a name")
}

/// Prints the line. What runs on the runtime goes on until the parent process is gone.
fn wait(runtime: &tokio::runtime::Runtime, line: String) {
    let (end, ended) = tokio::sync::oneshot::channel();
    std::thread::spawn(move || {
        told(&line);
        end.send(()).ok();
    });
    runtime.block_on(ended).ok();
}

/// A client of the gateway over one connection.
struct Client {
    stream: BufReader<TcpStream>,
    token: String,
}

impl Client {
    fn new(running: &Running) -> Self {
        let stream = TcpStream::connect(running.address).expect("it listens");
        stream.set_nodelay(true).expect("small requests leave at once");
        let token = running.words.get(1).expect("a token").clone();
        Self { stream: BufReader::new(stream), token }
    }

    fn ask(&mut self, method: &str, path: &str, body: &str) -> (u16, String) {
        let mut request = format!("{method} {path} HTTP/1.1\r\nHost: localhost\r\n");
        write!(request, "Authorization: Bearer {}\r\nContent-Type: application/json\r\n", self.token)
            .and_then(|()| write!(request, "Content-Length: {}\r\n\r\n{body}", body.len()))
            .expect("a text can be written");
        self.stream.get_mut().write_all(request.as_bytes()).expect("it is read");
        let (mut line, mut status, mut length) = (String::new(), 0, 0);
        loop {
            line.clear();
            self.stream.read_line(&mut line).expect("an answer");
            if let Some(rest) = line.strip_prefix("HTTP/1.1 ") {
                status = rest.get(..3).and_then(|status| status.parse().ok()).expect("a status");
            } else if let Some(told) = line.strip_prefix("content-length: ") {
                length = told.trim().parse().expect("a length");
            } else if line.trim().is_empty() {
                break;
            }
        }
        let mut body = vec![0; length];
        self.stream.read_exact(&mut body).expect("the body");
        (status, String::from_utf8(body).expect("text"))
    }

    fn json(&mut self, method: &str, path: &str, body: &str) -> Value {
        let (status, answer) = self.ask(method, path, body);
        assert_eq!(status, 200, "{method} {path}: {answer}");
        serde_json::from_str(&answer).expect("JSON")
    }

    /// The sum of a metric over all robots.
    fn total(&mut self, metric: &str) -> f64 {
        let (_, text) = self.ask("GET", "/metrics", "");
        let rows =
            text.lines().filter(|line| line.starts_with(metric) && line[metric.len()..].starts_with('{'));
        rows.map(|row| row.rsplit(' ').next().and_then(|value| value.parse::<f64>().ok()).expect("a number"))
            .sum()
    }
}

/// A poll over bare sockets and through the gateway, and what the gateway takes.
pub fn rows() -> Vec<Row> {
    let robots = Server::Working.start();
    let gateway = Server::Gateway.start_with(&robots.words);
    let mut client = Client::new(&gateway);
    std::thread::sleep(SETTLE);
    let state = client.json("GET", "/v1/robots/robot-0", "");
    let addresses: Vec<String> = state["signals"]
        .as_array()
        .expect("signals")
        .iter()
        .map(|signal| signal["address"].as_str().expect("an address").to_owned())
        .collect();
    let count = addresses.len();
    assert!(addresses.iter().all(|address| address.parse::<Address>().is_ok()));
    // A client of the same robots, each with a second connection. It asks for the same values.
    let quoted: Vec<_> = addresses.iter().map(|address| format!("\"{address}\"")).collect();
    let query = format!(
        r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"10000","queryAddr":[{}]}}"#,
        quoted.join(",")
    );
    let mut streams: Vec<TcpStream> = robots
        .addresses
        .iter()
        .map(|address| {
            let stream = TcpStream::connect(address).expect("it listens");
            stream.set_nodelay(true).expect("small frames leave at once");
            stream
        })
        .collect();
    let mut buffer = vec![0; 16 * 1024];
    let bare = move || {
        let before = processor_time();
        let (begun, mut polls) = (Instant::now(), 0_u32);
        while begun.elapsed() < LONG_SLICE {
            let round = Instant::now();
            for stream in &mut streams {
                stream.write_all(query.as_bytes()).expect("it is read");
                // A reply is sent in one write, and ends with its brace.
                let mut filled = 0;
                while buffer[..filled].last() != Some(&b'}') {
                    filled += stream.read(&mut buffer[filled..]).expect("a reply");
                }
                polls += 1;
            }
            std::thread::sleep(EVERY.saturating_sub(round.elapsed()));
        }
        vec![(processor_time() - before).as_secs_f64() * 1e9 / f64::from(polls)]
    };
    let process = gateway.process();
    let mut counting = Client::new(&gateway);
    let mut through_the_gateway = || {
        let polls = counting.total("r6_gateway_robot_replies_total");
        let before = processor_time_of(process);
        std::thread::sleep(LONG_SLICE);
        // Read the time first, because counting costs more than a poll.
        let spent = processor_time_of(process) - before;
        let polls = counting.total("r6_gateway_robot_replies_total") - polls;
        if polls < 9.0 * f64::from(ROBOTS) {
            eprintln!("  {polls} polls in a second: the machine is too busy for the pace");
        }
        vec![spent.as_secs_f64() * 1e9 / polls]
    };
    through_the_gateway();
    let kept_before = counting_kept(&mut client);
    let mut contenders: Vec<Contender<'_>> = vec![Box::new(bare), Box::new(through_the_gateway)];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    drop(contenders);
    let [p50, p99] = commands(&mut client);
    let floor = disk(gateway.words.get(2).expect("a folder"));
    // What is kept by now is on the disk after the next write.
    std::thread::sleep(Duration::from_secs(1));
    let (kept, bytes) = counting_kept(&mut client);
    let per_sample = (bytes - kept_before.1) / (kept - kept_before.0);
    let what = |what: &str| {
        format!("A gateway, 1 000 robots that move × {count} addresses × 10 Hz polled and kept: {what}")
    };
    let amount = |text: &str, limit, amount, unit, in_the_way| Row {
        what: what(text),
        against: "–",
        goal: Some(Goal::AmountAtMost(limit)),
        figure: Figure::Amount(amount, unit),
        in_the_way,
    };
    vec![
        Row {
            what: what("processor time for each poll"),
            against: "bare write and read of the same query to the same robots",
            goal: Some(Goal::AtMost(2.0)),
            figure: Figure::Ratio(ratio),
            in_the_way: "besides what the SDK needs for a poll, each of its values is compared with the last one, \
                         and those that changed are packed and written",
        },
        amount(
            "resident memory",
            256.0,
            resident_megabytes(process),
            " MB",
            "each robot has its last values, its open blocks of the history and its connection",
        ),
        amount(
            "a command over HTTP, median",
            1.0,
            p50,
            " ms",
            "its intent is on the disk before it leaves, and its outcome before the answer: two synchronised writes",
        ),
        amount(
            "a command over HTTP, 99 of 100",
            5.0,
            p99,
            " ms",
            "its intent is on the disk before it leaves, and its outcome before the answer: two synchronised writes",
        ),
        Row {
            what: what("a synchronised write of 4 KiB on the disk of its folder, median, for comparison"),
            against: "–",
            goal: None,
            figure: Figure::Amount(floor, " ms"),
            in_the_way: "",
        },
        amount(
            "history, bytes on the disk for each kept sample",
            4.0,
            per_sample,
            " B",
            "the tails of open blocks are written again and again, and files grow by pages",
        ),
    ]
}

/// The samples that were kept, and the bytes of all files of the history.
fn counting_kept(client: &mut Client) -> (f64, f64) {
    let kept = client.total("r6_gateway_history_samples_total");
    let (_, text) = client.ask("GET", "/metrics", "");
    let bytes = text.lines().find_map(|line| line.strip_prefix("r6_gateway_history_bytes "));
    (kept, bytes.and_then(|bytes| bytes.parse().ok()).expect("the size of the history"))
}

/// The median and the 99th of 100 of commands, in ms, from the request to the answer.
fn commands(client: &mut Client) -> [f64; 2] {
    let lease = client.json("POST", "/v1/robots/robot-0/lease", r#"{"duration_ms":300000}"#);
    let lease = lease["lease"].to_string();
    let mut times: Vec<f64> = (0..COMMANDS)
        .map(|number| {
            let on = number % 2;
            let body =
                format!(r#"{{"command":"modifyOutput","arguments":["0","3","{on}"],"lease":{lease}}}"#);
            let begun = Instant::now();
            client.json("POST", "/v1/robots/robot-0/commands", &body);
            let took = begun.elapsed();
            // A controller takes about ten a second.
            std::thread::sleep(Duration::from_millis(20));
            took.as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    [50, 99].map(|percent| times[times.len() * percent / 100])
}

/// The median of a synchronised write of 4 KiB in this folder, in ms.
fn disk(folder: &str) -> f64 {
    let mut file = std::fs::File::create(Path::new(folder).join("floor")).expect("a file");
    let mut times: Vec<f64> = (0..COMMANDS)
        .map(|_| {
            let begun = Instant::now();
            file.write_all(&[0; 4096]).and_then(|()| file.sync_data()).expect("it is written");
            begun.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
