//! Virtual controllers that remember which gateway sent them what, and when.

use std::fs;
use std::future::poll_fn;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::task::Poll;
use std::time::SystemTime;

use r6_controller::event::Event;
use r6_sim::{ControllerHandle, VirtualController};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};

/// What a stop sends: three commands, and an empty list.
const STOPS: [&str; 4] = ["actionStop", "stopButton", "actionPause", "a list of 0"];

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
    /// Whether it is a means of a stop.
    pub is_of_stop: bool,
}

#[derive(Debug, Default)]
struct Seen {
    /// By the number that the controller gives the connection, from 0.
    connections: Vec<Connection>,
    frames: Vec<Frame>,
}

/// The controllers, on their own thread.
pub struct Robots {
    pub addresses: Vec<SocketAddr>,
    seen: Vec<Arc<Mutex<Seen>>>,
    _controllers: Vec<VirtualController>,
    _runtime: Runtime,
}

impl Robots {
    /// Starts this many.
    pub fn start(count: usize, processes: &Processes) -> Self {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let (mut addresses, mut seen, mut controllers) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..count {
            let (controller, listener) = runtime.block_on(async {
                let controller = VirtualController::builder().start_in_memory().await.unwrap();
                (controller, TcpListener::bind("127.0.0.1:0").await.unwrap())
            });
            let of_one = Arc::new(Mutex::new(Seen::default()));
            watch(controller.handle(), Arc::clone(&of_one));
            addresses.push(listener.local_addr().unwrap());
            let accepts =
                accept(listener, controller.handle().clone(), Arc::clone(&of_one), processes.clone());
            runtime.spawn(accepts);
            seen.push(of_one);
            controllers.push(controller);
        }
        Self { addresses, seen, _controllers: controllers, _runtime: runtime }
    }

    /// The frames since the last call, with the number of the controller.
    pub fn frames(&self) -> Vec<(usize, Frame)> {
        let of = |(robot, seen): (usize, &Arc<Mutex<Seen>>)| {
            let frames = std::mem::take(&mut seen.lock().unwrap().frames);
            frames.into_iter().map(move |frame| (robot, frame))
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
            let connection = seen.connections.get(number).cloned();
            let connection = connection.unwrap_or_else(|| panic!("{what} over connection {number}"));
            let is_of_stop = STOPS.contains(&what.as_str());
            seen.frames.push(Frame { at: SystemTime::now(), connection, what, is_of_stop });
        }
    });
}

/// Accepts connections and looks which gateway each is from.
async fn accept(
    listener: TcpListener,
    controller: ControllerHandle,
    seen: Arc<Mutex<Seen>>,
    processes: Processes,
) {
    loop {
        let (stream, peer) = listener.accept().await.unwrap();
        let gateway = gateway_of(peer, &processes.lock().unwrap());
        seen.lock().unwrap().connections.push(Connection { opened: SystemTime::now(), gateway });
        let mut served = Box::pin(serve(controller.clone(), stream));
        // It gets the next number of the controller now.
        poll_fn(|context| {
            let _ = served.as_mut().poll(context);
            Poll::Ready(())
        })
        .await;
        tokio::spawn(served);
    }
}

async fn serve(controller: ControllerHandle, stream: TcpStream) {
    stream.set_nodelay(true).unwrap();
    controller.serve(stream).await;
}

/// Which of the processes has the socket with this address.
fn gateway_of(peer: SocketAddr, processes: &[Process]) -> Option<String> {
    let SocketAddr::V4(peer) = peer else { return None };
    let address = format!("{:08X}:{:04X}", u32::from(*peer.ip()).swap_bytes(), peer.port());
    let table = fs::read_to_string("/proc/net/tcp").unwrap();
    let mut lines = table.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    let inode = lines.find(|words| words.get(1) == Some(&address.as_str()))?.get(9)?.to_string();
    let socket = format!("socket:[{inode}]");
    let has = |process: &&Process| {
        let files = fs::read_dir(format!("/proc/{}/fd", process.pid)).into_iter().flatten().flatten();
        let mut links = files.filter_map(|file| fs::read_link(file.path()).ok());
        links.any(|link| link.as_os_str() == socket.as_str())
    };
    processes.iter().rev().find(has).map(|process| process.url.clone())
}
