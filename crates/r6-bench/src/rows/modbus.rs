//! The same poll with widely used Modbus libraries: twelve registers, which are twelve words of two bytes.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use r6_client::{Robot, RobotSettings};
use tokio_modbus::prelude::{Reader, tcp};

use super::python::PYTHON;
use super::{echo, round_trip};
use crate::measure::{Contender, compare};
use crate::report::{Figure, Goal, Row};

/// The number of registers to read, from the first on.
const REGISTERS: u16 = 12;

/// The value of each register.
const VALUE: u16 = 0x0102;

/// The length of a read request, with its header of seven bytes.
const REQUEST_BYTES: usize = 12;

/// From `perf` on both.
const BEYOND_TOKIO: &str = "both are the kernel's to nine tenths, which carries 576 bytes of text here and 45 there; the SDK reads \
     twelve texts into their types, and keeps what stops, heartbeats and other callers need";
const BEYOND_PYMODBUS: &str = "the kernel's part, which no client is without, is by itself about a third of what `pymodbus` takes: a bare blocking socket hardly \
     gets below this goal";

const SCRIPT: &str = "crates/r6-python/benches/modbus.py";

/// The simplest possible server. It answers every request with the same twelve registers, and reads only the
/// request's number.
fn serve(mut stream: TcpStream) {
    stream.set_nodelay(true).expect("small frames leave at once");
    let mut request = [0; REQUEST_BYTES];
    // Length of the rest, unit 1, function 3, 24 bytes of values.
    let mut reply = vec![0, 0, 0, 0, 0, 27, 1, 3, 24];
    reply.extend(VALUE.to_be_bytes().repeat(usize::from(REGISTERS)));
    while stream.read_exact(&mut request).is_ok() {
        reply[..2].copy_from_slice(&request[..2]);
        reply[6] = request[6];
        if stream.write_all(&reply).is_err() {
            return;
        }
    }
}

/// `tokio-modbus`, percentiles 50 and 99.
fn tokio_modbus<'c>(address: SocketAddr) -> Contender<'c> {
    let runtime = round_trip::runtime();
    let mut client = runtime.block_on(tcp::connect(address)).expect("it listens");
    let mut slice = move || {
        runtime.block_on(round_trip::slice_async(async || {
            let read = client.read_holding_registers(0, REGISTERS).await.expect("it is read");
            assert_eq!(read.expect("no exception"), [VALUE; REGISTERS as usize]);
        }))
    };
    slice();
    Box::new(slice)
}

/// The SDK, percentiles 50 and 99.
fn sdk<'c>(address: SocketAddr) -> Contender<'c> {
    let runtime = round_trip::runtime();
    let robot = runtime.block_on(Robot::connect(&address.to_string(), RobotSettings::default()));
    let (robot, addresses) = (robot.expect("it listens"), echo::addresses());
    let slice = move || {
        runtime.block_on(round_trip::slice_async(async || round_trip::query(&robot, &addresses).await))
    };
    slice();
    Box::new(slice)
}

/// A Python program that measures one slice of the requested contender each time it is asked.
struct Script {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Script {
    fn start(arguments: &[String]) -> Self {
        let mut child = Command::new(PYTHON)
            .arg(SCRIPT)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("Python starts");
        let input = child.stdin.take().expect("its input");
        let output = BufReader::new(child.stdout.take().expect("its output"));
        Self { child, input, output }
    }

    /// One slice of this contender: the median, in nanoseconds.
    fn slice(&mut self, contender: &str) -> Vec<f64> {
        writeln!(self.input, "{contender}").expect("it reads");
        let mut line = String::new();
        self.output.read_line(&mut line).expect("it answers");
        vec![line.trim().parse().unwrap_or_else(|_| panic!("{SCRIPT} failed"))]
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Compares the SDK with both libraries.
pub fn rows() -> Vec<Row> {
    let (modbus, robots) = (echo::listen(serve), echo::start());
    let ratio = compare(&mut [tokio_modbus(modbus), sdk(robots)]).remove(0).remove(0);
    let row = |what: &str, against, goal, figure, in_the_way| Row {
        what: format!("round trip of a 12-address query, {what}, p50"),
        against,
        goal,
        figure,
        in_the_way,
    };
    let goal = Some(Goal::AtMost(1.0));
    let mut rows =
        vec![row("async", "`tokio-modbus`, 12 registers", goal, Figure::Ratio(ratio), BEYOND_TOKIO)];
    let kinds = [("async", Some(Goal::AtMost(0.3))), ("Python, asyncio", Some(Goal::AtMost(0.5)))];
    let figures = beside_pymodbus(modbus, robots);
    rows.extend(figures.into_iter().zip(kinds).map(|(figure, (what, goal))| {
        row(what, "`pymodbus`, async, 12 registers", goal, figure, BEYOND_PYMODBUS)
    }));
    rows
}

/// The SDK from Rust and from Python, compared with `pymodbus`.
fn beside_pymodbus(modbus: SocketAddr, robots: SocketAddr) -> [Figure; 2] {
    let there = |module: &str| {
        let import =
            Command::new(PYTHON).args(["-c", &format!("import {module}")]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    };
    if !Path::new(PYTHON).exists() || !there("pymodbus") || !there("r6") {
        return [(); 2].map(|()| Figure::NotMeasured("it takes what `tools/python/run bench` installs"));
    }
    let script = std::cell::RefCell::new(Script::start(&[modbus.to_string(), robots.to_string()]));
    let mut ours = sdk(robots);
    let mut contenders: [Contender<'_>; 3] = [
        Box::new(|| script.borrow_mut().slice("pymodbus")),
        Box::new(move || vec![ours()[0]]),
        Box::new(|| script.borrow_mut().slice("r6")),
    ];
    let mut ratios = compare(&mut contenders).into_iter().map(|mut figures| Figure::Ratio(figures.remove(0)));
    let mut next = || ratios.next().expect("one for each contender");
    [next(), next()]
}
