//! A thousand virtual controllers without clients.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use r6_sim::{SimSettings, Simulation};
use tokio::runtime::Builder;

use super::echo;
use crate::measure::processor_time_of;
use crate::report::{Figure, Goal, Row};
use crate::serve::{Server, told};

const CONTROLLERS: u16 = 1000;

/// How long they are observed.
const WATCHED: Duration = Duration::from_secs(5);

/// The limit for noise: a five-thousandth of a core. If the timer of each controller fired once in that time,
/// the cost would be several times as much.
const NOISE_MS: f64 = 1.0;

/// The server process: a thousand controllers on separate ports. It prints their addresses.
pub fn serve() {
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    let settings = SimSettings { count: CONTROLLERS, ..SimSettings::default() };
    let simulation = runtime.block_on(Simulation::start(settings)).expect("it starts");
    let addresses: Vec<SocketAddr> =
        simulation.controllers().iter().map(|controller| controller.address()).collect();
    // The controllers run on this thread. Another thread waits for the end of the input.
    let (end, ended) = tokio::sync::oneshot::channel();
    std::thread::spawn(move || {
        let ports: Vec<String> = addresses.iter().map(ToString::to_string).collect();
        told(&ports.join(" "));
        end.send(()).ok();
    });
    runtime.block_on(ended).ok();
}

/// Processor time and resident memory, after each controller has answered one query.
pub fn rows() -> Vec<Row> {
    let server = Server::AtRest.start();
    for address in &server.addresses {
        let mut stream = TcpStream::connect(address).expect("it listens");
        stream.write_all(echo::query_bytes().as_bytes()).expect("it is read");
        assert_ne!(stream.read(&mut [0; 4096]).expect("a reply"), 0);
    }
    // Wait, because closing these connections is work too.
    std::thread::sleep(Duration::from_secs(1));
    let before = processor_time_of(server.process());
    std::thread::sleep(WATCHED);
    let spent = processor_time_of(server.process()) - before;
    let row = |what: &str, limit, amount, unit| Row {
        what: format!("1 000 virtual controllers at rest, {what}"),
        against: "–",
        goal: Some(Goal::AmountAtMost(limit)),
        figure: Figure::Amount(amount, unit),
        in_the_way: "",
    };
    vec![
        row("processor time in 5 s", NOISE_MS, spent.as_secs_f64() * 1e3, " ms"),
        row("resident memory", 50.0, resident_megabytes(server.process()), " MB"),
    ]
}

/// The resident memory of a process, in MB.
pub fn resident_megabytes(process: u32) -> f64 {
    let status =
        std::fs::read_to_string(format!("/proc/{process}/status")).expect("Linux tells of a process");
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its resident memory");
    let kib: u32 = resident.trim().trim_end_matches(" kB").parse().expect("a number");
    f64::from(kib) * 1024.0 / 1e6
}
