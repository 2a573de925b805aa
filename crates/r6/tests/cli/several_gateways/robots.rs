//! Virtual controllers that remember which gateway sent them what, and when.

use std::collections::BTreeMap;
use std::fs;
use std::future::poll_fn;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::task::Poll;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use r6_controller::event::Event;
use r6_sim::{ControllerHandle, VirtualController};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};

/// A process of a gateway, and where it listens. They stay in the list after their end.
#[derive(Clone, Debug)]
pub struct Process {
    pub pid: u32,
    pub url: String,
}

/// All processes of the test.
pub type Processes = Arc<Mutex<Vec<Process>>>;

/// A connection that a controller accepted.
#[derive(Clone, Debug)]
pub struct Connection {
    pub opened: SystemTime,
    /// Where its gateway listens; `None` if the gateway was gone before this could be seen.
    pub gateway: Option<String>,
}

/// A frame that changes, moves or stops something, and that a controller accepted.
#[derive(Clone, Debug)]
pub struct Frame {
    pub at: SystemTime,
    pub connection: Connection,
    pub what: String,
}

#[derive(Debug, Default)]
struct Seen {
    /// By the number that the controller gives the connection, from 0.
    connections: Vec<Connection>,
    /// When, over which connection, and what.
    frames: Vec<(SystemTime, usize, String)>,
}

/// How long looking up gateways may take.
const LOOK_UP: Duration = Duration::from_secs(60);

/// A connection whose gateway is not known yet.
struct Asked {
    seen: Arc<Mutex<Seen>>,
    number: usize,
    /// Both ends, that of the gateway first: the system uses a port again for another controller.
    ends: (SocketAddr, SocketAddr),
}

/// Looks up which gateways connections are from, on a thread of its own: the table of the system can be long,
/// and no controller must wait for it.
#[derive(Clone)]
struct LookUp {
    asked: mpsc::Sender<Asked>,
    /// How many are not looked up yet.
    waiting: Arc<AtomicUsize>,
}

impl LookUp {
    fn start(processes: Processes) -> Self {
        let (asked, asks) = mpsc::channel::<Asked>();
        let waiting = Arc::<AtomicUsize>::default();
        let done = Arc::clone(&waiting);
        thread::spawn(move || {
            while let Ok(first) = asks.recv() {
                let all: Vec<_> = std::iter::once(first).chain(asks.try_iter()).collect();
                let gateways = gateways(&processes.lock().unwrap().clone());
                for Asked { seen, number, ends } in &all {
                    seen.lock().unwrap().connections[*number].gateway = gateways.get(ends).cloned();
                }
                done.fetch_sub(all.len(), Ordering::SeqCst);
            }
        });
        Self { asked, waiting }
    }

    fn ask(&self, asked: Asked) {
        self.waiting.fetch_add(1, Ordering::SeqCst);
        self.asked.send(asked).unwrap();
    }

    fn wait(&self) {
        let begun = Instant::now();
        while self.waiting.load(Ordering::SeqCst) > 0 {
            assert!(begun.elapsed() < LOOK_UP, "the gateways of connections are looked up");
            thread::sleep(Duration::from_millis(5));
        }
    }
}

/// The controllers, on their own thread.
pub struct Robots {
    pub addresses: Vec<SocketAddr>,
    seen: Vec<Arc<Mutex<Seen>>>,
    look_up: LookUp,
    _controllers: Vec<VirtualController>,
    _runtime: Runtime,
}

impl Robots {
    /// Starts this many.
    pub fn start(count: usize, processes: &Processes) -> Self {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let look_up = LookUp::start(Arc::clone(processes));
        let (mut addresses, mut seen, mut controllers) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..count {
            let (controller, listener) = runtime.block_on(async {
                let controller = VirtualController::builder().start_in_memory().await.unwrap();
                (controller, TcpListener::bind("127.0.0.1:0").await.unwrap())
            });
            let of_one = Arc::new(Mutex::new(Seen::default()));
            watch(controller.handle(), Arc::clone(&of_one));
            addresses.push(listener.local_addr().unwrap());
            let accepts = accept(listener, controller.handle().clone(), Arc::clone(&of_one), look_up.clone());
            runtime.spawn(accepts);
            seen.push(of_one);
            controllers.push(controller);
        }
        Self { addresses, seen, look_up, _controllers: controllers, _runtime: runtime }
    }

    /// The frames since the last call, with the number of the controller.
    pub fn frames(&self) -> Vec<(usize, Frame)> {
        let of = |(robot, seen): (usize, &Arc<Mutex<Seen>>)| {
            let frames = std::mem::take(&mut seen.lock().unwrap().frames);
            self.look_up.wait();
            let connections = seen.lock().unwrap().connections.clone();
            frames.into_iter().map(move |(at, number, what)| {
                (robot, Frame { at, connection: connections[number].clone(), what })
            })
        };
        self.seen.iter().enumerate().flat_map(of).collect()
    }
}

/// Keeps the frames that this controller accepts.
fn watch(controller: &ControllerHandle, seen: Arc<Mutex<Seen>>) {
    controller.observe(move |_, _, lines| {
        for line in lines {
            let what = match &line.event {
                Event::CommandAccepted { command, .. } => command.as_str().to_owned(),
                Event::ListTaken { instructions, .. } | Event::LateListTaken { instructions } => {
                    format!("a list of {instructions}")
                }
                Event::PointsTaken { .. } => "points".to_owned(),
                _ => continue,
            };
            let mut seen = seen.lock().unwrap();
            let number = line.connection.map_or(usize::MAX, |id| usize::try_from(id.number()).unwrap());
            assert!(number < seen.connections.len(), "{what} over connection {number}");
            seen.frames.push((SystemTime::now(), number, what));
        }
    });
}

/// Accepts connections and looks which gateway each is from.
async fn accept(
    listener: TcpListener,
    controller: ControllerHandle,
    seen: Arc<Mutex<Seen>>,
    look_up: LookUp,
) {
    loop {
        let (stream, peer) = listener.accept().await.unwrap();
        let number = {
            let mut seen = seen.lock().unwrap();
            seen.connections.push(Connection { opened: SystemTime::now(), gateway: None });
            seen.connections.len() - 1
        };
        let ends = (peer, stream.local_addr().unwrap());
        look_up.ask(Asked { seen: Arc::clone(&seen), number, ends });
        let mut served = Box::pin(serve(controller.clone(), stream));
        // It gets the next number of the controller now.
        let first = poll_fn(|context| Poll::Ready(served.as_mut().poll(context))).await;
        if first.is_pending() {
            tokio::spawn(served);
        }
    }
}

async fn serve(controller: ControllerHandle, stream: TcpStream) {
    // It may have ended already.
    stream.set_nodelay(true).ok();
    controller.serve(stream).await;
}

/// Which gateway has the socket with each two ends, as far as it is one of these processes.
fn gateways(processes: &[Process]) -> BTreeMap<(SocketAddr, SocketAddr), String> {
    let mut sockets = BTreeMap::new();
    for process in processes.iter().rev() {
        let files = fs::read_dir(format!("/proc/{}/fd", process.pid)).into_iter().flatten().flatten();
        for link in files.filter_map(|file| fs::read_link(file.path()).ok()) {
            sockets.entry(link.display().to_string()).or_insert_with(|| process.url.clone());
        }
    }
    let table = fs::read_to_string("/proc/net/tcp").unwrap();
    let address = |text: &str| {
        let (host, port) = text.split_once(':')?;
        let host = u32::from_str_radix(host, 16).ok()?.swap_bytes();
        Some(SocketAddr::from((host.to_be_bytes(), u16::from_str_radix(port, 16).ok()?)))
    };
    let of = |line: &str| {
        let words: Vec<_> = line.split_whitespace().collect();
        let ends = (address(words.get(1)?)?, address(words.get(2)?)?);
        Some((ends, sockets.get(&format!("socket:[{}]", words.get(9)?))?.clone()))
    };
    table.lines().filter_map(of).collect()
}
