//! A gateway in front of a thousand robots that work: what a poll that is kept costs, and what it takes
//! besides.

mod client;
pub mod day;
mod live;

use std::io::{Read, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_client::{Address, RobotSettings};
use r6_controller::Library;
use r6_gateway::{
    AuditSettings, Gateway, GatewaySettings, HistorySettings, PollGroup, RawPolicy, RobotConfig, RobotName,
    TlsSettings,
};
use r6_sim::{SimSettings, Simulation};
use tokio::runtime::Builder;

use self::client::Client;
use crate::measure::{Contender, compare, pin, processor_time, processor_time_of, spread};
use crate::report::{Figure, Goal, Row};
use crate::rows::at_rest::resident_megabytes;
use crate::serve::{Server, told};

const ROBOTS: u16 = 1000;

/// These values of each robot are read ten times a second: all change while it moves, but the output.
const READ: [&str; 13] = [
    "axis-0", "axis-1", "axis-2", "axis-3", "axis-4", "axis-5", "world-0", "world-1", "world-2", "world-3",
    "world-4", "world-5", "output-0",
];
const EVERY: Duration = Duration::from_millis(100);

/// All others that a gateway reads are read once a second, and the mode twice.
const OTHERS: Duration = Duration::from_secs(1);

/// The slice of this row, which holds several polls of each robot.
const LONG_SLICE: Duration = Duration::from_secs(1);

/// How long the gateway runs before something is measured: all robots are known, and the first chunks are on
/// the disk.
const SETTLE: Duration = Duration::from_secs(15);

/// How long the history grows while that is measured: four blocks of 512 samples of a signal that changes
/// with each poll. Tails grow until a block is full, so it has to be whole blocks.
const GROWS: Duration = Duration::from_millis(4 * 512 * 100);

/// How many commands are measured.
const COMMANDS: usize = 300;

/// Between two commands. A controller takes about ten a second.
const PAUSE: Duration = Duration::from_millis(50);

/// Why a command takes longer through the gateway.
const SYNCHRONISED: &str = "with one robot and no load it takes about as long (`perf`, switches and system calls): a quarter is the \
                            synchronised write of its intent, a third is computed before and behind it with cold caches, a \
                            quarter are the two transactions of the store, the rest is changes between threads. The slowest \
                            wait for a processor, behind polls and the history";

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

/// The server process of the gateway with this folder, in front of the robots with these addresses. It prints
/// its address and a token.
pub fn serve_gateway(words: &[String]) {
    let (data, robots) = words.split_first().expect("a folder");
    let runtime = Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("a runtime");
    let reads = READ.map(|address| Address::parse(address).expect("an address"));
    let robots = robots.iter().enumerate().map(|(number, address)| RobotConfig {
        period: OTHERS,
        groups: vec![PollGroup::new(EVERY, reads.to_vec())],
        ..RobotConfig::new(name(number), address.as_str())
    });
    let robots: Vec<_> = robots.collect();
    let settings = GatewaySettings {
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        data: data.into(),
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
    };
    run_gateway(&runtime, settings);
}

/// Runs a gateway until the parent process is gone.
fn run_gateway(runtime: &tokio::runtime::Runtime, settings: GatewaySettings) {
    let data = settings.data.clone();
    let gateway = runtime.block_on(Gateway::start(settings)).expect("it starts");
    let token = r6_gateway::make_token(&data, Role::Operator, None, String::new()).expect("a token").1;
    wait(runtime, format!("{} {token}", gateway.address()));
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

/// A poll over bare sockets and through the gateway, and what the gateway takes.
pub fn rows() -> Vec<Row> {
    let robots = Server::Working.start();
    // The process of the gateway is ended before its folder is removed.
    let data = tempfile::tempdir().expect("a folder");
    let folder = data.path().display().to_string();
    let gateway = Server::Gateway.start_with(&[&[folder], &robots.words[..]].concat());
    let mut client = Client::new(&gateway);
    std::thread::sleep(SETTLE);
    let count = READ.len();
    // A client of the same robots, each with a second connection. It asks for the same values.
    let quoted: Vec<_> = READ.iter().map(|address| format!("\"{address}\"")).collect();
    let query = format!(
        r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"10000","queryAddr":[{}]}}"#,
        quoted.join(",")
    );
    let mut sockets: Vec<Bare> = robots.addresses.iter().map(|address| Bare::new(*address)).collect();
    let mut buffer = vec![0; 16 * 1024];
    let bare = move || {
        let before = processor_time();
        let (begun, mut polls) = (Instant::now(), 0_u32);
        while begun.elapsed() < LONG_SLICE {
            let round = Instant::now();
            for socket in &mut sockets {
                socket.ask(&query, &mut buffer);
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
    let mut contenders: Vec<Contender<'_>> = vec![Box::new(bare), Box::new(through_the_gateway)];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    drop(contenders);
    // How long something takes is measured as people have it: with all cores. The load goes on.
    spread(&[process, robots.process()]).expect("threads may move to the other cores");
    let [through, direct] = commands(&mut client, &mut Bare::new(robots.addresses[1]));
    let [change_p50, change_p99] = live::changes(&gateway, robots.addresses[2], "robot-2");
    let floor = disk(data.path());
    pin().expect("this process can be kept on one core");
    let memory = resident_megabytes(process);
    let history = data.path().join("history");
    let (first_kept, first_size) = history_now(&mut client, &history);
    std::thread::sleep(GROWS);
    let (kept, size) = history_now(&mut client, &history);
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
    let told = |text: &str, amount, unit| Row {
        what: what(text),
        against: "–",
        goal: None,
        figure: Figure::Amount(amount, unit),
        in_the_way: "",
    };
    vec![
        Row {
            what: what("processor time for each poll"),
            against: "bare write and read of the same query to the same robots",
            goal: Some(Goal::AtMost(2.0)),
            figure: Figure::Ratio(ratio),
            in_the_way: "no single place (`perf`, `callgrind`): system calls take a quarter of the time. Of the \
                         instructions a third each belong to the client and to the task of a robot, a fifth to the thread \
                         of the history, which packs and writes, and no function has more than 5 %. With fewer robots a \
                         poll takes less",
        },
        amount(
            "resident memory",
            256.0,
            memory,
            " MB",
            "each robot has its last values, its open blocks of the history and its connection",
        ),
        amount(
            "what a command takes longer over HTTP than over a bare socket, median",
            1.0,
            through[0] - direct[0],
            " ms",
            SYNCHRONISED,
        ),
        amount("the same, 99 of 100", 5.0, through[1] - direct[1], " ms", SYNCHRONISED),
        told(
            "from the change of an output at the controller to a WebSocket client, median",
            change_p50,
            " ms",
        ),
        told("the same, 99 of 100; a poll every 100 ms sees it", change_p99, " ms"),
        told("a synchronised write of 4 KiB on the disk of its folder, median, for comparison", floor, " ms"),
        amount(
            "history, bytes by which its files grow for each sample, over four blocks",
            4.0,
            (size - first_size) / (kept - first_kept),
            " B",
            "not looked into",
        ),
        told("history, all bytes of its files for each sample of the first six minutes", size / kept, " B"),
    ]
}

/// How many samples are kept by now, and the bytes of their files.
fn history_now(client: &mut Client, history: &Path) -> (f64, f64) {
    let kept = client.total("r6_gateway_history_samples_total");
    // They are on the disk after the next write.
    std::thread::sleep(Duration::from_secs(1));
    (kept, size_of(history))
}

/// A bare socket to a controller.
struct Bare(TcpStream);

impl Bare {
    fn new(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).expect("it listens");
        stream.set_nodelay(true).expect("small frames leave at once");
        Self(stream)
    }

    /// Sends a frame and reads the reply, which a controller sends in one write, and which ends with its
    /// brace.
    fn ask(&mut self, frame: &str, reply: &mut [u8]) {
        self.0.write_all(frame.as_bytes()).expect("it is read");
        let mut filled = 0;
        while reply[..filled].last() != Some(&b'}') {
            let count = self.0.read(&mut reply[filled..]).expect("a reply");
            assert!(count > 0, "the controller closed the connection");
            filled += count;
        }
    }

    /// Switches the output Y013.
    fn set_output(&mut self, on: usize) {
        let frame = format!(
            r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"10001","cmdData":["modifyOutput","0","3","{on}"]}}"#
        );
        self.ask(&frame, &mut [0; 1024]);
    }
}

/// The bytes of all files of a folder.
fn size_of(folder: &Path) -> f64 {
    let files = std::fs::read_dir(folder).expect("a folder").flatten();
    files.map(|file| file.metadata().map_or(0, |data| data.len()) as f64).sum()
}

/// Commands through the gateway, and the same command over a bare socket to another robot, in turns. The
/// median and the 99th of 100 of each, in ms, from the request to the answer.
fn commands(client: &mut Client, bare: &mut Bare) -> [[f64; 2]; 2] {
    let lease = client.json("POST", "/v1/robots/robot-0/lease", r#"{"duration_ms":300000}"#);
    let lease = lease["lease"].to_string();
    let (mut through, mut direct) = (Vec::new(), Vec::new());
    for number in 0..COMMANDS {
        let on = number % 2;
        let body = format!(r#"{{"command":"modifyOutput","arguments":["0","3","{on}"],"lease":{lease}}}"#);
        let begun = Instant::now();
        client.json("POST", "/v1/robots/robot-0/commands", &body);
        through.push(begun.elapsed().as_secs_f64() * 1e3);
        std::thread::sleep(PAUSE);
        let begun = Instant::now();
        bare.set_output(on);
        direct.push(begun.elapsed().as_secs_f64() * 1e3);
        std::thread::sleep(PAUSE);
    }
    [through, direct].map(|times| percentiles(times, [50, 99]))
}

/// These percentiles of the times.
fn percentiles<const N: usize>(mut times: Vec<f64>, percents: [usize; N]) -> [f64; N] {
    times.sort_by(f64::total_cmp);
    percents.map(|percent| times[times.len() * percent / 100])
}

/// The median of a synchronised write of 4 KiB in this folder, in ms.
fn disk(folder: &Path) -> f64 {
    let mut file = std::fs::File::create(folder.join("floor")).expect("a file");
    let times: Vec<f64> = (0..COMMANDS)
        .map(|_| {
            let begun = Instant::now();
            file.write_all(&[0; 4096]).and_then(|()| file.sync_data()).expect("it is written");
            begun.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    let [median] = percentiles(times, [50]);
    median
}
