//! Cameras that listen: the controller dials them, loses them, and finds them again.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use r6_controller::event::ShellEvent;
use r6_controller::{Event, LogEntry, PanelAction};
use r6_sim::{Camera, Clock, SimError, SimSettings, Simulation};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::broadcast;

/// Long enough for a loaded machine; the events themselves take milliseconds, plus the wait before a new
/// attempt.
const PATIENCE: Duration = Duration::from_secs(30);

const CLOCKS: [Clock; 3] = [Clock::Real, Clock::Times(10.0), Clock::AsFastAsPossible];

async fn in_time<T>(what: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, what).await.expect("it happens in time")
}

/// An address of our own, at which a camera listens from time to time. It is always bound, so that no other
/// program gets it.
struct Place {
    address: SocketAddr,
    _bound: TcpSocket,
}

impl Place {
    fn new() -> Self {
        let bound = TcpSocket::new_v4().unwrap();
        bound.set_reuseaddr(true).unwrap();
        bound.bind("127.0.0.1:0".parse().unwrap()).unwrap();
        Self { address: bound.local_addr().unwrap(), _bound: bound }
    }

    fn listen(&self) -> TcpListener {
        let socket = TcpSocket::new_v4().unwrap();
        socket.set_reuseaddr(true).unwrap();
        socket.bind(self.address).unwrap();
        socket.listen(16).unwrap()
    }

    fn camera(&self, cam_id: impl Into<Option<i64>>) -> Camera {
        Camera { cam_id: cam_id.into(), address: self.address }
    }
}

/// The camera's end of a connection.
struct Eye {
    stream: TcpStream,
    bytes: Vec<u8>,
}

impl Eye {
    async fn accept(listener: &TcpListener) -> Self {
        let (stream, _) = in_time(listener.accept()).await.unwrap();
        Self { stream, bytes: Vec::new() }
    }

    /// The next frame; `None` once the connection is over.
    async fn frame(&mut self) -> Option<Value> {
        loop {
            let mut values = serde_json::Deserializer::from_slice(&self.bytes).into_iter();
            if let Some(Ok(value)) = values.next() {
                let end = values.byte_offset();
                self.bytes.drain(..end);
                return Some(value);
            }
            let mut piece = [0; 1024];
            let read = in_time(self.stream.read(&mut piece)).await.unwrap_or(0);
            if read == 0 {
                return None;
            }
            self.bytes.extend_from_slice(&piece[..read]);
        }
    }

    /// Waits for a photo request, and returns its `camID`.
    async fn requested(&mut self) -> i64 {
        let frame = self.frame().await.expect("a photo request");
        assert_eq!(frame["reqType"], "photo", "{frame}");
        frame["camID"].as_i64().unwrap()
    }

    async fn say(&mut self, frame: &Value) {
        self.stream.write_all(frame.to_string().as_bytes()).await.unwrap();
    }

    /// Answers a request, and sends parts at these positions along Y.
    async fn find(&mut self, camera: i64, parts: &[f64]) {
        let dialect = "www.hc-system.com.cam";
        self.say(&json!({"dsID": dialect, "reqType": "photo", "camID": camera, "ret": 1})).await;
        let point = |y: &f64| json!({"ModelID": 0, "X": 400.0, "Y": y, "Z": 450.0, "Angel": 90.0, "Rel": 0});
        let points: Vec<_> = parts.iter().map(point).collect();
        let set = json!({"camID": camera, "data": points});
        self.say(&json!({"dsID": dialect, "reqType": "AddPoints", "dsData": [set]})).await;
        let mut reply = self.frame().await.expect("a reply");
        while reply["reqType"] == "photo" {
            // This machine is so loaded that the program has asked again meanwhile.
            reply = self.frame().await.expect("a reply");
        }
        assert_eq!(reply["cmdReply"], json!(["AddPoints", parts.len().to_string()]));
    }
}

/// Asks each of these cameras for a photo and takes a point of it, again and again. So the next request to a
/// camera shows that its last point was used. A lost request is repeated after half a second of real time.
fn looking_at(cameras: &[i64], clock: Clock) -> String {
    let limit = match clock {
        Clock::Real | Clock::AsFastAsPossible => 0.5,
        Clock::Times(factor) => 0.5 * factor,
    };
    let look = |camera: &i64| {
        format!(
            "[[step]]\ndo=\"photo\"\ncamera={camera}\nlimit={limit}\ntries=100\n\
             [[step]]\ndo=\"take-point\"\ncamera={camera}\n"
        )
    };
    cameras.iter().map(look).collect()
}

fn settings(cameras: Vec<Camera>, clock: Clock, ids: &[i64]) -> SimSettings {
    let mut settings = SimSettings { cameras, clock, ..SimSettings::default() };
    settings.library.load("test", &looking_at(ids, clock)).unwrap();
    SimSettings { mold: "test".to_owned(), ..settings }
}

/// The next matching event of the log, and how many of the other kind came before it.
async fn event(
    log: &mut broadcast::Receiver<Arc<LogEntry>>,
    is_it: impl Fn(&Event) -> bool,
    is_other: impl Fn(&Event) -> bool,
) -> (Event, usize) {
    let mut others = 0;
    loop {
        let event = in_time(log.recv()).await.unwrap().event.clone();
        if is_it(&event) {
            return (event, others);
        }
        others += usize::from(is_other(&event));
    }
}

fn unreachable(event: &Event) -> bool {
    matches!(event, Event::Shell(ShellEvent::CameraUnreachable { .. }))
}

fn connected(event: &Event) -> bool {
    matches!(event, Event::Shell(ShellEvent::CameraConnected { .. }))
}

fn nothing(_: &Event) -> bool {
    false
}

#[tokio::test]
async fn a_program_picks_what_a_dialled_camera_found() {
    let place = Place::new();
    let listener = place.listen();
    let settings = SimSettings {
        mold: "pick-and-place".to_owned(),
        cameras: vec![place.camera(None)],
        clock: Clock::AsFastAsPossible,
        ..SimSettings::default()
    };
    let simulation = Simulation::start(settings).await.unwrap();
    let controller = &simulation.controllers()[0];
    let mut eye = Eye::accept(&listener).await;
    // The belt has room.
    controller.operate(&PanelAction::SetInput { board: 0, point: 0, on: true }).unwrap();
    assert_eq!(eye.requested().await, 0);
    eye.find(0, &[-40.0, 0.0, 40.0]).await;
    // It asks again after it has picked them all.
    assert_eq!(eye.requested().await, 0);
    // A query from a camera is answered as on any connection.
    eye.say(&json!({"reqType": "query", "queryAddr": ["counter-0", "curAlarm"]})).await;
    let reply = eye.frame().await.unwrap();
    assert_eq!(reply["queryData"], json!([[0, 0, 3], "0"]));
    simulation.shutdown().await.unwrap();
    assert_eq!(eye.frame().await, None, "the connection ends with the simulation");
}

#[tokio::test]
async fn a_camera_that_goes_away_is_dialled_again_and_the_program_goes_on() {
    for clock in CLOCKS {
        let place = Place::new();
        let listener = place.listen();
        let settings = settings(vec![place.camera(None)], clock, &[0]);
        let simulation = Simulation::start(settings).await.unwrap();
        let mut log = simulation.controllers()[0].log();
        let mut eye = Eye::accept(&listener).await;
        for _ in 0..3 {
            eye.requested().await;
            eye.find(0, &[1.0]).await;
        }
        // The camera hangs up with a request unanswered, and takes the next connection.
        eye.requested().await;
        drop(eye);
        let mut eye = Eye::accept(&listener).await;
        eye.requested().await;
        eye.find(0, &[2.0]).await;
        eye.requested().await;
        // The camera program ends, and is started again later.
        drop((eye, listener));
        let (Event::Shell(ShellEvent::CameraUnreachable { camera, .. }), _) =
            event(&mut log, unreachable, nothing).await
        else {
            panic!("that is what was waited for")
        };
        assert!(camera.as_str().contains(&place.address.to_string()), "{camera}");
        let listener = place.listen();
        let mut eye = Eye::accept(&listener).await;
        for _ in 0..3 {
            eye.requested().await;
            eye.find(0, &[3.0]).await;
        }
        let (_, before) = event(&mut log, connected, connected).await;
        assert_eq!(before, 0, "{clock}");
        assert_eq!(simulation.controllers()[0].snapshot().alarm, 0, "{clock}");
    }
}

#[tokio::test]
async fn a_camera_may_come_later_than_the_controller() {
    for clock in CLOCKS {
        let place = Place::new();
        let settings = settings(vec![place.camera(7)], clock, &[7]);
        let simulation = Simulation::start(settings).await.unwrap();
        let mut log = simulation.controllers()[0].log();
        event(&mut log, unreachable, nothing).await;
        let lost = Event::PhotoLost { camera: 7, away: true };
        event(&mut log, |event| *event == lost, nothing).await;
        let listener = place.listen();
        let mut eye = Eye::accept(&listener).await;
        // The failures in between were not logged one by one.
        let (camera, told) = event(&mut log, connected, unreachable).await;
        assert!(told == 0, "{clock}: {camera}");
        assert_eq!(eye.requested().await, 7);
        eye.find(7, &[1.0]).await;
        assert_eq!(eye.requested().await, 7);
    }
}

#[tokio::test]
async fn each_of_two_cameras_gets_its_own_requests() {
    let places = [Place::new(), Place::new()];
    let listeners = [places[0].listen(), places[1].listen()];
    let cameras = vec![places[0].camera(1), places[1].camera(2)];
    let settings = settings(cameras, Clock::Real, &[2, 1]);
    let simulation = Simulation::start(settings).await.unwrap();
    let mut first = Eye::accept(&listeners[0]).await;
    let mut second = Eye::accept(&listeners[1]).await;
    for _ in 0..5 {
        assert_eq!(second.requested().await, 2);
        second.find(2, &[1.0]).await;
        assert_eq!(first.requested().await, 1);
        first.find(1, &[1.0]).await;
    }
    // One of them disconnects: the other gets none of its requests, and both continue once it is back.
    drop(second);
    let mut second = Eye::accept(&listeners[1]).await;
    assert_eq!(second.requested().await, 2);
    second.find(2, &[1.0]).await;
    assert_eq!(first.requested().await, 1);
    drop(simulation);
}

#[tokio::test]
async fn every_controller_dials() {
    let place = Place::new();
    let listener = place.listen();
    let settings = SimSettings { count: 3, cameras: vec![place.camera(None)], ..SimSettings::default() };
    let simulation = Simulation::start(settings).await.unwrap();
    let (mut replies, mut eyes) = (Vec::new(), Vec::new());
    for _ in 0..3 {
        let mut eye = Eye::accept(&listener).await;
        // Each has its own connection to its own controller.
        eye.say(&json!({"reqType": "command", "cmdData": ["rewriteData", "800", "1", "0"], "packID": "1"}))
            .await;
        replies.push(eye.frame().await.unwrap()["cmdReply"].clone());
        eye.say(&json!({"reqType": "query", "queryAddr": ["Addr-800"]})).await;
        assert_eq!(eye.frame().await.unwrap()["queryData"], json!(["1"]));
        eyes.push(eye);
    }
    assert_eq!(replies, vec![json!(["rewriteData", "ok"]); 3]);
    for controller in simulation.controllers() {
        let mut log = controller.log();
        controller.request_photo(0);
        let about_photo =
            |event: &Event| matches!(event, Event::PhotoRequested { .. } | Event::PhotoLost { .. });
        let (told, _) = event(&mut log, about_photo, nothing).await;
        assert_eq!(told, Event::PhotoRequested { camera: 0 }, "{}", controller.address());
    }
}

#[tokio::test]
async fn cameras_that_cannot_be_told_apart_start_nothing() {
    let camera = Place::new().camera(1);
    for (cameras, part) in [
        (vec![camera, camera], "camera 1 has two addresses"),
        (vec![Camera { cam_id: None, ..camera }; 2], "ID=ADDR:PORT"),
        ((0..17).map(|n| Camera { cam_id: Some(n), ..camera }).collect(), "16 are possible"),
    ] {
        let settings = SimSettings { cameras, ..SimSettings::default() };
        let error = Simulation::start(settings).await.unwrap_err();
        assert!(matches!(error, SimError::SameCamera { .. } | SimError::TooManyCameras { .. }), "{error}");
        assert!(error.to_string().contains(part), "{error}");
    }
}
