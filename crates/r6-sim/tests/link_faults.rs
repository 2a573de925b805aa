//! Link faults over real sockets: their effects, that other links are not affected, and that everything works
//! again afterwards.

use r6_controller::Event;
use r6_controller::event::ShellEvent;
use r6_controller::scenario::Happening;
use std::io::ErrorKind;
use std::sync::Arc;
use std::time::{Duration, Instant};

use r6_controller::fault::{Fault, LinkFault, LinkFaultNow};
use r6_controller::scenario::Scenario;
use r6_controller::{ConnectionId, LogEntry, Profile};
use r6_proto::frame::{FrameBuffer, Limits};
use r6_sim::{Clock, ControllerHandle, SimSettings, Simulation};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::broadcast::Receiver;
use tokio::time::timeout;

const QUERY: &[u8] =
    br#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"0","queryAddr":["version","curMold"]}"#;
const REPLY: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["version","curMold"],"queryData":["HC-QC-RX-7.8.07-master-F5.2.1"],"reqType":"query"}"#;

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// How long a test waits for something that must not happen.
const SHORT: Duration = Duration::from_millis(300);

const HOUR: Duration = Duration::from_secs(3600);

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

async fn soon<T>(what: impl Future<Output = T>) -> T {
    timeout(PATIENCE, what).await.expect("it never happened")
}

/// Two controllers: the first has link faults, and the second must not notice them.
struct Cell(Simulation);

impl Cell {
    async fn start() -> Self {
        Self::with(SimSettings::default()).await
    }

    async fn with(settings: SimSettings) -> Self {
        Self(Simulation::start(SimSettings { count: 2, ..settings }).await.unwrap())
    }

    fn broken(&self) -> &ControllerHandle {
        &self.0.controllers()[0]
    }

    async fn try_connect(&self) -> std::io::Result<TcpStream> {
        TcpStream::connect(self.broken().address()).await
    }

    /// A connection that has already been served once.
    async fn connect(&self) -> TcpStream {
        let mut stream = soon(self.try_connect()).await.unwrap();
        assert_answered(&mut stream).await;
        stream
    }

    fn set(&self, faults: &[LinkFault]) {
        let always = |fault| LinkFaultNow { fault, chance: 1.0 };
        self.broken().set_link_faults(faults.iter().copied().map(always).collect());
    }

    /// Checks that the other controller answers.
    async fn assert_others_are_served(&self) {
        let mut other = soon(TcpStream::connect(self.0.controllers()[1].address())).await.unwrap();
        assert_answered(&mut other).await;
    }

    /// Checks that new connections are served after the fault.
    async fn assert_works_again(&self) {
        self.set(&[]);
        self.connect().await;
        self.assert_others_are_served().await;
    }
}

async fn ask(stream: &mut TcpStream) {
    soon(stream.write_all(QUERY)).await.unwrap();
}

/// Reads exactly as many bytes as a reply has.
async fn read_reply(stream: &mut TcpStream) -> String {
    let mut bytes = vec![0; REPLY.len()];
    soon(stream.read_exact(&mut bytes)).await.unwrap();
    String::from_utf8(bytes).unwrap()
}

/// Reads up to the end of a reply without lists in lists.
async fn read_object(stream: &mut TcpStream) -> String {
    let mut bytes = Vec::new();
    while bytes.last() != Some(&b'}') {
        assert!(soon(stream.read_buf(&mut bytes)).await.unwrap() > 0, "it was closed");
    }
    String::from_utf8(bytes).unwrap()
}

async fn assert_answered(stream: &mut TcpStream) {
    ask(stream).await;
    assert_eq!(read_reply(stream).await, REPLY);
}

async fn assert_silent(stream: &mut TcpStream) {
    ask(stream).await;
    let read = timeout(SHORT, stream.read(&mut [0; 16])).await;
    assert!(read.is_err(), "{read:?}");
}

/// Waits for an event of the log.
async fn told(log: &mut Receiver<Arc<LogEntry>>, what: impl Fn(&Event) -> bool) {
    soon(async { while !what(&log.recv().await.unwrap().event) {} }).await;
}

fn of(event: ShellEvent) -> impl Fn(&Event) -> bool {
    move |told| *told == Event::Shell(event.clone())
}

/// The whole frames in these bytes.
fn frames(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut buffer = FrameBuffer::new(Limits::default());
    let mut found = Vec::new();
    let mut rest = bytes;
    loop {
        rest = &rest[buffer.push(rest)..];
        while let Some(frame) = buffer.next() {
            found.extend(frame.map(|frame| frame.bytes.to_vec()));
        }
        if rest.is_empty() {
            return found;
        }
    }
}

#[tokio::test]
async fn t1_connections_are_refused_and_then_taken_on_the_same_port() {
    let cell = Cell::start().await;
    let mut before = cell.connect().await;
    let mut log = cell.broken().log();
    for _ in 0..3 {
        cell.set(&[LinkFault::Refuse]);
        told(&mut log, of(ShellEvent::Refuses)).await;
        assert_eq!(soon(cell.try_connect()).await.unwrap_err().kind(), ErrorKind::ConnectionRefused);
        assert_answered(&mut before).await;
        cell.assert_others_are_served().await;
        cell.set(&[]);
        told(&mut log, of(ShellEvent::TakesAgain)).await;
        cell.connect().await;
    }
    cell.assert_works_again().await;
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn t2_an_attempt_to_connect_gets_no_answer_until_it_is_over() {
    let cell = Cell::start().await;
    let mut before = cell.connect().await;
    let mut log = cell.broken().log();
    cell.set(&[LinkFault::BlackHole]);
    told(&mut log, of(ShellEvent::GivesNoAnswer)).await;
    let mut attempts = Vec::new();
    for _ in 0..3 {
        let mut attempt = Box::pin(cell.try_connect());
        let made = timeout(SHORT, &mut attempt).await;
        assert!(made.is_err(), "neither made nor refused: {made:?}");
        attempts.push(attempt);
    }
    assert_answered(&mut before).await;
    cell.assert_others_are_served().await;
    cell.set(&[]);
    told(&mut log, of(ShellEvent::TakesAgain)).await;
    // Those that waited are served, because their systems retry.
    for attempt in attempts {
        assert_answered(&mut soon(attempt).await.unwrap()).await;
    }
    cell.assert_works_again().await;
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn t1_and_t2_follow_one_another() {
    let cell = Cell::start().await;
    let mut log = cell.broken().log();
    for (fault, event) in [
        (LinkFault::Refuse, ShellEvent::Refuses),
        (LinkFault::BlackHole, ShellEvent::GivesNoAnswer),
        (LinkFault::Refuse, ShellEvent::Refuses),
    ] {
        cell.set(&[fault]);
        told(&mut log, of(event)).await;
    }
    assert_eq!(soon(cell.try_connect()).await.unwrap_err().kind(), ErrorKind::ConnectionRefused);
    cell.set(&[]);
    told(&mut log, of(ShellEvent::TakesAgain)).await;
    cell.assert_works_again().await;
}

/// The log says what struck a connection, once while the fault is in force.
#[tokio::test]
async fn a_strike_is_told_once_for_each_connection() {
    let cell = Cell::start().await;
    let mut stream = cell.connect().await;
    let mut log = cell.broken().log();
    for _ in 0..2 {
        cell.set(&[LinkFault::Pieces { bytes: 20 }]);
        assert_answered(&mut stream).await;
        assert_answered(&mut stream).await;
        cell.set(&[]);
        assert_answered(&mut stream).await;
    }
    let strikes: Vec<_> = std::iter::from_fn(|| log.try_recv().ok())
        .filter(|entry| matches!(entry.event, Event::Struck { .. }))
        .map(|entry| (entry.connection.map(ConnectionId::number), entry.event.clone()))
        .collect();
    let struck = Event::Struck { fault: Fault::Link(LinkFault::Pieces { bytes: 20 }) };
    assert_eq!(strikes, [(Some(0), struck.clone()), (Some(0), struck)]);
}

#[tokio::test]
async fn t3_a_connection_that_comes_is_accepted_and_never_answered() {
    let cell = Cell::start().await;
    let mut before = cell.connect().await;
    cell.set(&[LinkFault::Silence]);
    let mut during = soon(cell.try_connect()).await.unwrap();
    assert_silent(&mut during).await;
    assert_answered(&mut before).await;
    cell.assert_others_are_served().await;
    cell.assert_works_again().await;
    assert_silent(&mut during).await;
    // The controller notices its end.
    drop(during);
    soon(async {
        while cell.broken().snapshot().connections > 1 {
            assert_answered(&mut before).await;
        }
    })
    .await;
}

#[tokio::test]
async fn t4_a_frame_breaks_off_and_the_connection_is_reset() {
    let cell = Cell::start().await;
    let mut other = cell.connect().await;
    for after in [Some(0), Some(10), Some(100_000), None] {
        let mut stream = cell.connect().await;
        cell.set(&[LinkFault::ResetMidFrame { after }]);
        ask(&mut stream).await;
        let mut came = Vec::new();
        let end = soon(stream.read_to_end(&mut came)).await.unwrap_err();
        assert_eq!(end.kind(), ErrorKind::ConnectionReset);
        assert!(REPLY.as_bytes().starts_with(&came) && came.len() < REPLY.len(), "{after:?}");
        assert!(
            after.is_none_or(|after| came.len() == after.min(REPLY.len() - 1)),
            "{after:?}: {}",
            came.len()
        );
        assert!(frames(&came).is_empty());
        cell.assert_others_are_served().await;
        cell.assert_works_again().await;
    }
    assert_answered(&mut other).await;
}

#[tokio::test]
async fn t5_the_connection_is_closed_in_good_order_in_place_of_a_reply() {
    let cell = Cell::start().await;
    let mut stream = cell.connect().await;
    let mut other = cell.connect().await;
    cell.set(&[LinkFault::CloseBeforeReply]);
    // More bytes are on their way than are read before the first answer. This must not cause a reset.
    soon(stream.write_all(&QUERY.repeat(100))).await.unwrap();
    let mut came = Vec::new();
    soon(stream.read_to_end(&mut came)).await.unwrap();
    assert_eq!(came, b"");
    cell.assert_works_again().await;
    assert_answered(&mut other).await;
}

#[tokio::test]
async fn t6_connections_go_deaf_and_keep_their_places() {
    let profile = Profile::from_toml("max_connections = 3").unwrap();
    let cell = Cell::with(SimSettings { profile, ..SimSettings::default() }).await;
    let mut deaf = [cell.connect().await, cell.connect().await];
    cell.set(&[LinkFault::HalfOpen]);
    for stream in &mut deaf {
        assert_silent(stream).await;
    }
    // A connection that comes now is not struck.
    let mut served = cell.connect().await;
    cell.set(&[]);
    for mut stream in deaf {
        assert_silent(&mut stream).await;
        // Our end closes, and so does the socket at the other end; the controller does not notice.
        stream.shutdown().await.unwrap();
        assert_eq!(soon(stream.read(&mut [0; 16])).await.unwrap(), 0);
    }
    assert_answered(&mut served).await;
    let mut log = cell.broken().log();
    let mut late = soon(cell.try_connect()).await.unwrap();
    told(&mut log, |event| matches!(event, Event::TooManyConnections { limit: 3 })).await;
    assert_silent(&mut late).await;
    assert_eq!(cell.broken().snapshot().connections, 3);
    cell.broken().request_photo(1);
    assert_answered_after_a_photo(&mut served).await;
    cell.assert_others_are_served().await;
}

async fn assert_answered_after_a_photo(stream: &mut TcpStream) {
    let photo = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":1}"#;
    let mut bytes = vec![0; photo.len()];
    soon(stream.read_exact(&mut bytes)).await.unwrap();
    assert_eq!(bytes, photo.as_bytes());
    assert_answered(stream).await;
}

#[tokio::test]
async fn t7_frames_in_pieces_are_the_same_frames() {
    let cell = Cell::start().await;
    let mut stream = cell.connect().await;
    for bytes in [1, 7] {
        cell.set(&[LinkFault::Pieces { bytes }]);
        ask(&mut stream).await;
        let mut piece = [0; 4096];
        let length = soon(stream.read(&mut piece)).await.unwrap();
        assert!(length < REPLY.len(), "the first {bytes} bytes do not wait for the rest: {length}");
        let mut rest = vec![0; REPLY.len() - length];
        soon(stream.read_exact(&mut rest)).await.unwrap();
        assert_eq!([&piece[..length], &rest].concat(), REPLY.as_bytes());
        for _ in 0..5 {
            assert_answered(&mut stream).await;
        }
    }
    cell.assert_works_again().await;
    assert_answered(&mut stream).await;
}

#[tokio::test]
async fn t7_frames_are_gathered_until_there_are_enough_or_it_is_time() {
    let cell = Cell::start().await;
    let mut stream = cell.connect().await;
    cell.set(&[LinkFault::Coalesce { frames: 3, within: HOUR }]);
    ask(&mut stream).await;
    assert_silent(&mut stream).await;
    ask(&mut stream).await;
    let mut together = [0; 4096];
    let length = soon(stream.read(&mut together)).await.unwrap();
    assert_eq!(String::from_utf8_lossy(&together[..length]), REPLY.repeat(3));
    cell.set(&[LinkFault::Coalesce { frames: 3, within: ms(20) }]);
    assert_answered(&mut stream).await;
    cell.set(&[LinkFault::Coalesce { frames: 3, within: HOUR }]);
    assert_silent(&mut stream).await;
    cell.set(&[]);
    assert_eq!(read_reply(&mut stream).await, REPLY, "what waits leaves when the fault is over");
    assert_answered(&mut stream).await;
}

/// How long a reply takes with that latency, in real time.
async fn latency(clock: Clock, latency: LinkFault) -> Duration {
    let cell = Cell::with(SimSettings { clock, ..SimSettings::default() }).await;
    let mut stream = cell.connect().await;
    cell.set(&[latency]);
    let begun = Instant::now();
    for _ in 0..3 {
        ask(&mut stream).await;
    }
    for _ in 0..3 {
        assert_eq!(read_reply(&mut stream).await, REPLY);
    }
    let taken = begun.elapsed();
    cell.assert_works_again().await;
    assert_answered(&mut stream).await;
    taken
}

#[tokio::test]
async fn t8_bytes_take_their_time_in_both_directions() {
    let of = |to_controller, to_client| LinkFault::Latency { to_controller, to_client, spread: ms(5) };
    assert!(latency(Clock::Real, of(ms(60), ms(0))).await >= ms(60));
    assert!(latency(Clock::Real, of(ms(0), ms(60))).await >= ms(60));
    assert!(latency(Clock::Real, of(ms(60), ms(60))).await >= ms(120));
    // The latency is in the controller's time.
    let scaled = latency(Clock::Times(100.0), of(ms(6000), ms(6000))).await;
    assert!(scaled >= ms(120) && scaled < ms(6000), "{scaled:?}");
    assert!(latency(Clock::AsFastAsPossible, of(HOUR, HOUR)).await < PATIENCE);
}

#[tokio::test]
async fn t8_others_do_not_wait_and_an_end_takes_its_time_too() {
    let cell = Cell::start().await;
    let mut stream = cell.connect().await;
    let mut brief = cell.connect().await;
    cell.set(&[LinkFault::Latency { to_controller: ms(100), to_client: ms(0), spread: ms(0) }]);
    ask(&mut brief).await;
    let begun = Instant::now();
    drop(brief);
    soon(async {
        while cell.broken().snapshot().connections > 1 {
            cell.assert_others_are_served().await;
        }
    })
    .await;
    assert!(begun.elapsed() >= ms(60), "what it had sent was on its way: {:?}", begun.elapsed());
    cell.set(&[LinkFault::Latency { to_controller: HOUR, to_client: HOUR, spread: HOUR }]);
    assert_silent(&mut stream).await;
    cell.assert_works_again().await;
}

#[tokio::test]
async fn t9_a_slow_line_takes_time_and_holds_back_its_peer() {
    let cell = Cell::start().await;
    let mut stream = cell.connect().await;
    cell.set(&[LinkFault::Slow { bytes_per_second: 1500 }]);
    let begun = Instant::now();
    assert_answered(&mut stream).await;
    // All bytes except the first slices, of 20 ms each.
    let bytes = u32::try_from(QUERY.len() + REPLY.len()).unwrap();
    assert!(begun.elapsed() >= Duration::from_secs(1) * bytes / 1500 - ms(60), "{:?}", begun.elapsed());
    // The rest stays in the buffers of the systems, which are bounded.
    cell.set(&[LinkFault::Slow { bytes_per_second: 1 }]);
    let block = [b' '; 65_536];
    let mut written = 0;
    while timeout(SHORT, stream.writable()).await.is_ok() {
        written += stream.try_write(&block).unwrap_or(0);
        assert!(written < 256 << 20, "nothing holds it back");
    }
    cell.assert_others_are_served().await;
    cell.set(&[]);
    soon(stream.writable()).await.unwrap();
    assert_answered(&mut stream).await;
    cell.assert_works_again().await;
}

/// This many bytes of 200 replies came while the line was noisy, whenever that ended.
const NOISY_BYTES: usize = REPLY.len() * 190;

/// The bytes of 200 replies over a noisy line; the last three came after the noise.
async fn over_noise(seed: u64) -> Vec<u8> {
    let cell = Cell::with(SimSettings { seed, ..SimSettings::default() }).await;
    let mut stream = cell.connect().await;
    cell.broken().set_link_faults(vec![LinkFaultNow { fault: LinkFault::Noise, chance: 0.01 }]);
    // Together, so that all of them are answered before the noise ends.
    soon(stream.write_all(&QUERY.repeat(200))).await.unwrap();
    let mut came = Vec::new();
    while came.len() < NOISY_BYTES {
        soon(stream.read_buf(&mut came)).await.unwrap();
    }
    cell.set(&[]);
    // Noise in the frame before costs at most one more.
    for _ in 0..3 {
        ask(&mut stream).await;
    }
    while !came.ends_with(REPLY.repeat(3).as_bytes()) {
        assert_ne!(soon(stream.read_buf(&mut came)).await.unwrap(), 0);
    }
    cell.assert_works_again().await;
    came
}

#[tokio::test]
async fn t11_noise_disturbs_frames_and_not_the_connection() {
    let came = over_noise(1).await;
    let found = frames(&came);
    let whole = found.iter().filter(|frame| *frame == REPLY.as_bytes()).count();
    // 1 % of 170 bytes: four of five frames are disturbed, each differently.
    assert!((3..150).contains(&whole), "{whole} of {}", found.len());
    assert_eq!(found.last().unwrap(), REPLY.as_bytes(), "the reader finds its way back");
    let noisy = |came: &[u8]| came[..NOISY_BYTES].to_vec();
    assert!(noisy(&over_noise(1).await) == noisy(&came), "the same seed, the same noise");
    assert!(noisy(&over_noise(2).await) != noisy(&came));
}

#[tokio::test]
async fn t14_the_second_half_of_a_frame_comes_later() {
    let cell = Cell::start().await;
    let mut stream = cell.connect().await;
    cell.set(&[LinkFault::Stall { delay: ms(190) }]);
    let begun = Instant::now();
    ask(&mut stream).await;
    let mut first = [0; 4096];
    let length = soon(stream.read(&mut first)).await.unwrap();
    assert_eq!(length, REPLY.len() / 2);
    let mut second = vec![0; REPLY.len() - length];
    soon(stream.read_exact(&mut second)).await.unwrap();
    assert!(begun.elapsed() >= ms(190));
    assert_eq!([&first[..length], &second].concat(), REPLY.as_bytes());
    cell.assert_works_again().await;
    assert_answered(&mut stream).await;
}

#[tokio::test]
async fn a_scenario_begins_and_ends_them() {
    let scenario = "[[fault]]\nfault = \"refuse\"\nfor = 1\n\
                    [[fault]]\nfault = \"close-before-reply\"\nfrom = 1.3\n";
    let scenario = Some(Arc::new(Scenario::read(scenario).unwrap()));
    let cell = Cell::with(SimSettings { scenario, ..SimSettings::default() }).await;
    let mut log = cell.broken().log();
    told(&mut log, of(ShellEvent::Refuses)).await;
    assert_eq!(soon(cell.try_connect()).await.unwrap_err().kind(), ErrorKind::ConnectionRefused);
    told(&mut log, of(ShellEvent::TakesAgain)).await;
    let mut stream = soon(cell.try_connect()).await.unwrap();
    // It is served until the second fault closes it.
    let closed = async {
        loop {
            ask(&mut stream).await;
            let mut came = Vec::new();
            while came.len() < REPLY.len() {
                if stream.read_buf(&mut came).await.unwrap() == 0 {
                    return came;
                }
            }
            assert_eq!(came, REPLY.as_bytes());
        }
    };
    assert_eq!(soon(closed).await, b"");
}

/// The mains fail: connected clients hear nothing and are reset when the mains are back. Savable values are
/// there again, and nothing runs.
#[tokio::test]
async fn a_scenario_cuts_the_power() {
    let text = "[[at]]\ntime = 1\ndo = \"power-cut\"\nfor = 1";
    let folder = tempfile::TempDir::new().unwrap();
    let settings = SimSettings {
        scenario: Some(Arc::new(Scenario::read(text).unwrap())),
        state: Some(folder.path().to_owned()),
        ..SimSettings::default()
    };
    let cell = Cell::with(settings).await;
    let mut log = cell.broken().log();
    let mut stream = cell.connect().await;
    let write = br#"{"reqType":"command","cmdData":["rewriteData","800","4711","1"]}"#;
    stream.write_all(write).await.unwrap();
    assert!(read_object(&mut stream).await.contains(r#","ok"]"#));
    told(&mut log, |event| matches!(event, Event::Happens { what: Happening::PowerCut { .. } })).await;
    ask(&mut stream).await;
    assert_silent(&mut stream).await;
    told(&mut log, |event| *event == Event::MainsAreBack).await;
    let mut rest = [0; 64];
    assert_eq!(soon(stream.read(&mut rest)).await.unwrap_err().kind(), ErrorKind::ConnectionReset);
    let mut stream = soon(cell.try_connect()).await.unwrap();
    stream.write_all(br#"{"reqType":"query","queryAddr":["Addr-800","curMode"]}"#).await.unwrap();
    assert!(read_object(&mut stream).await.contains(r#""queryData":["4711","2"]"#));
}
