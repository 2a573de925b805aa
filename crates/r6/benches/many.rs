//! What many controllers in one process cost, and how fast one starts.
//!
//! Measures the real binary, from `/proc` (Linux): processor time and resident memory of 1,000 idle
//! controllers, and the time from the start of the process to the first reply. The time of a process that
//! only prints its version is shown for comparison.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How many controllers are idle together, and how long they are measured.
const CONTROLLERS: usize = 1000;
const WATCHED: Duration = Duration::from_secs(5);

/// How often the start is measured; the median is printed.
const STARTS: usize = 21;

const QUERY: &[u8] =
    br#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"0","queryAddr":["version"]}"#;

/// A running `r6 sim`. Dropping this ends it.
struct Sim {
    child: Child,
    addresses: Vec<String>,
}

impl Sim {
    fn start(count: usize) -> Self {
        let address = |line: String| line.strip_prefix("listening on ").expect("an address").to_owned();
        let mut child = Command::new(env!("CARGO_BIN_EXE_r6"))
            .args(["sim", "--listen", "127.0.0.1:0", "--count", &count.to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("r6 sim starts");
        let lines = BufReader::new(child.stdout.take().expect("its stdout")).lines();
        let addresses = lines.take(count).map(|line| address(line.expect("a line"))).collect();
        Self { child, addresses }
    }

    /// Processor time so far, and the resident memory in bytes.
    fn costs(&self) -> (Duration, u64) {
        let read = |name: &str| {
            std::fs::read_to_string(format!("/proc/{}/{name}", self.child.id()))
                .expect("/proc of the process")
        };
        // The fields of `stat` after the name; 14 and 15 of the whole are user and system time in hundredths.
        let stat = read("stat");
        let fields: Vec<&str> = stat.rsplit(") ").next().unwrap_or_default().split(' ').collect();
        let ticks = |field: usize| fields[field].parse::<u64>().expect("a number");
        let processor = Duration::from_millis(10 * (ticks(11) + ticks(12)));
        let status = read("status");
        let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("VmRSS");
        let kib: u64 = resident.trim().trim_end_matches(" kB").parse().expect("a number");
        (processor, kib * 1024)
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn ask(address: &str) {
    let mut stream = TcpStream::connect(address).expect("it listens");
    stream.write_all(QUERY).expect("it reads");
    assert_ne!(stream.read(&mut [0; 1024]).expect("it replies"), 0);
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times[times.len() / 2]
}

fn main() {
    let sim = Sim::start(CONTROLLERS);
    // Each controller has answered one query.
    sim.addresses.iter().for_each(|address| ask(address));
    let (before, _) = sim.costs();
    std::thread::sleep(WATCHED);
    let (after, resident) = sim.costs();
    println!(
        "{CONTROLLERS} idle controllers: {} ms of processor time in {} s, {:.1} MB resident",
        (after - before).as_millis(),
        WATCHED.as_secs(),
        megabytes(resident),
    );
    drop(sim);

    let (mut starts, mut floors) = (Vec::new(), Vec::new());
    for _ in 0..STARTS {
        let begun = Instant::now();
        let version = Command::new(env!("CARGO_BIN_EXE_r6")).arg("--version").stdout(Stdio::null()).status();
        assert!(version.expect("r6 runs").success());
        floors.push(begun.elapsed());
        let begun = Instant::now();
        let sim = Sim::start(1);
        ask(&sim.addresses[0]);
        starts.push(begun.elapsed());
    }
    let (start, floor) = (median(starts), median(floors));
    println!(
        "start to first reply: {:.1} ms, {:.1} times that of `r6 --version` ({:.1} ms); median of {STARTS}",
        start.as_secs_f64() * 1000.0,
        start.as_secs_f64() / floor.as_secs_f64(),
        floor.as_secs_f64() * 1000.0,
    );
}

fn megabytes(bytes: u64) -> f64 {
    f64::from(u32::try_from(bytes / 1000).unwrap_or(u32::MAX)) / 1000.0
}
