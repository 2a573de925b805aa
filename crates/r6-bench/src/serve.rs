//! Servers in separate processes, so that their cost can be separated from that of their clients:
//! `r6-bench serve NAME`.

use std::env;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, ExitCode, Stdio};
use std::thread;

use r6_controller::Profile;
use r6_sim::VirtualController;

use crate::rows::{at_rest, echo, gateway};

/// The servers.
#[derive(Clone, Copy)]
pub enum Server {
    /// Sends canned replies as fast as queries of a known length arrive, without reading them.
    Canned,
    /// Answers every query with the same values and the query's `packID`.
    Echo,
    /// A virtual controller with its arm at rest.
    Controller,
    /// A thousand virtual controllers at rest.
    AtRest,
    /// A thousand virtual controllers whose program runs.
    Working,
    /// A gateway in front of the robots with these addresses.
    Gateway,
    /// A gateway with a day of history.
    Day,
}

impl Server {
    const ALL: [(&'static str, Self); 7] = [
        ("canned", Self::Canned),
        ("echo", Self::Echo),
        ("controller", Self::Controller),
        ("at-rest", Self::AtRest),
        ("working", Self::Working),
        ("gateway", Self::Gateway),
        ("day", Self::Day),
    ];

    /// Starts it in a separate process.
    pub fn start(self) -> Running {
        self.start_with(&[])
    }

    /// The same, with these arguments.
    pub fn start_with(self, arguments: &[String]) -> Running {
        let name =
            Self::ALL.iter().find(|(_, server)| *server as u8 == self as u8).map_or("", |(name, _)| name);
        let mut child = Command::new(env::current_exe().expect("this program has a path"))
            .args(["serve", name])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("this program starts");
        let mut line = String::new();
        let output = child.stdout.take().expect("its output");
        BufReader::new(output).read_line(&mut line).expect("it tells where it listens");
        let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        let addresses: Vec<SocketAddr> = words.iter().filter_map(|word| word.parse().ok()).collect();
        Running { address: *addresses.first().expect("it listens"), addresses, words, child }
    }
}

/// A running server. It ends when this value is dropped.
pub struct Running {
    /// Its address; the first one, if there are several.
    pub address: SocketAddr,
    /// All its addresses.
    pub addresses: Vec<SocketAddr>,
    /// All that it told: its addresses, and more for some.
    pub words: Vec<String>,
    child: Child,
}

impl Running {
    /// The id of its process.
    pub fn process(&self) -> u32 {
        self.child.id()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Runs a server, if this process was started for that.
pub fn asked() -> Option<ExitCode> {
    let mut words = env::args().skip(1);
    if words.next().as_deref() != Some("serve") {
        return None;
    }
    let name = words.next().unwrap_or_default();
    let (_, server) = Server::ALL.into_iter().find(|(known, _)| *known == name)?;
    match server {
        Server::Canned => serve(canned),
        Server::Echo => serve(echo::serve),
        Server::Controller => controller(),
        Server::AtRest => at_rest::serve(),
        Server::Working => gateway::serve_robots(),
        Server::Gateway => gateway::serve_gateway(&words.collect::<Vec<_>>()),
        Server::Day => gateway::day::serve(&words.collect::<Vec<_>>()),
    }
    Some(ExitCode::SUCCESS)
}

/// Prints the addresses, and waits until the parent process is gone.
pub fn told(addresses: &str) {
    println!("{addresses}");
    std::io::stdin().read_to_end(&mut Vec::new()).ok();
}

fn serve(each: fn(TcpStream)) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            thread::spawn(move || each(stream));
        }
    });
    told(&address.to_string());
}

/// Sends one reply for each query, each in a separate write, as a controller does.
fn canned(mut stream: TcpStream) {
    let query = echo::query_bytes().len();
    let mut reply = Vec::new();
    echo::answer(echo::query_bytes().as_bytes(), &mut reply);
    stream.set_nodelay(true).expect("small frames leave at once");
    let (mut input, mut waiting) = (vec![0; 1 << 16], 0);
    while let Ok(count @ 1..) = stream.read(&mut input) {
        waiting += count;
        for _ in 0..waiting / query {
            if stream.write_all(&reply).is_err() {
                return;
            }
        }
        waiting %= query;
    }
}

fn controller() {
    let mut profile = Profile::named("hc1").expect("a profile that comes with the crate").clone();
    profile.max_connections = 64;
    let controller = VirtualController::builder().profile(profile).start_blocking().expect("it starts");
    told(&controller.address().to_string());
}
