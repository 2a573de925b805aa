//! Compares the virtual controller with a server that is known for its speed, both under the same load.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::load::Load;
use crate::measure::{Contender, compare};
use crate::report::{Figure, Goal, Row};
use crate::serve::Server;

/// The requests of `redis-benchmark -t get`: a value of three bytes.
const SET: &[u8] = b"*3\r\n$3\r\nSET\r\n$3\r\nkey\r\n$3\r\nabc\r\n";
const GET: &[u8] = b"*2\r\n$3\r\nGET\r\n$3\r\nkey\r\n";

/// A byte that occurs once in each reply to [`GET`].
const MARK: u8 = b'$';

/// How long the server may take to start.
const START: Duration = Duration::from_secs(5);

/// A separate server that writes nothing to the disk and ends with this value.
struct Redis {
    child: Child,
    address: SocketAddr,
}

impl Redis {
    /// Starts the server; `None` if it is not installed.
    fn start() -> Option<Self> {
        // The server does not report a free port that it chooses, so it gets one here.
        let free = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr());
        let address = free.expect("a free port");
        let child = Command::new("redis-server")
            .args(["--bind", "127.0.0.1", "--port", &address.port().to_string()])
            .args(["--save", "", "--appendonly", "no", "--dir", "/tmp"])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .ok()?;
        let redis = Self { child, address };
        let begun = Instant::now();
        while begun.elapsed() < START {
            if let Ok(mut stream) = TcpStream::connect(address) {
                let mut answer = [0; 5];
                stream.write_all(SET).expect("it is read");
                stream.read_exact(&mut answer).expect("an answer");
                assert_eq!(&answer, b"+OK\r\n", "it keeps the value");
                return Some(redis);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("redis-server does not listen within {START:?}");
    }
}

impl Drop for Redis {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Processor time for each request, both on this core.
pub fn rows() -> Vec<Row> {
    let row = |figure| {
        Row {
        what: "virtual controller, 16 connections × 16 queries under way, frames per second of its processor time".to_owned(),
        against: "`redis-server`, GET, as many under way",
        goal: Some(Goal::ToldFast),
        figure,
        in_the_way: "87 of 100 samples are in the kernel, which sends each reply by itself, as controllers do and clients that read with one call \
                     expect; `redis-server` sends sixteen at once. The server of canned bytes, which does nothing else, is nearly as far \
                     behind",
    }
    };
    let Some(redis) = Redis::start() else {
        return vec![row(Figure::NotMeasured("it takes `apt-get install redis-server`"))];
    };
    let controller = Server::Controller.start();
    let mut theirs = Load::of(redis.child.id(), redis.address, GET, MARK);
    let mut ours = Load::of_queries(&controller);
    let mut contenders: Vec<Contender<'_>> = vec![Box::new(|| theirs.cost()), Box::new(|| ours.cost())];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    vec![row(Figure::Ratio(ratio))]
}
