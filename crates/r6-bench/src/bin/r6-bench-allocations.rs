//! Counts allocations per frame in the steady state. It prints one line for each path, the count first.
//!
//! `make bench ARGS=allocations` starts it.

use std::hint::black_box;
use std::time::Duration;

use r6_client::{Robot, RobotSettings};
use r6_controller::{Controller, ControllerSettings, Profile, RobotModel, StartState};
use r6_proto::client::{ClientSession, ClientSettings, Event};
use r6_proto::dialect::{Addressing, Dialect};
use r6_proto::frame::Limits;
use r6_proto::message::instruction::{Action, Coordinates};
use r6_proto::message::{Body, Query};
use r6_proto::reply::ReplyWriter;
use r6_proto::request::{CameraPoints, Request};
use r6_proto::server::ServerSession;
use r6_proto::time::Instant;
use r6_proto::{AxisIndex, Decoder, RequestType};
use r6_testkit::alloc::{CountingAllocator, allocations_during};

#[path = "../rows/echo.rs"]
#[allow(dead_code, reason = "the server in it is for others")]
mod echo;
#[path = "../rows/memory.rs"]
mod memory;

#[path = "../../../r6-proto/benches/codec/cases.rs"]
mod cases;
#[path = "../../../r6-proto/benches/codec/others.rs"]
mod others;
#[path = "../../../r6-proto/benches/codec/samples.rs"]
mod samples;

use samples::Samples;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// The number of counted frames. The same number of frames comes before them.
const FRAMES: usize = samples::FRAMES;

/// Prints the average number of allocations per frame, after a warm-up with as many frames.
fn tell(what: &str, mut each: impl FnMut(usize)) {
    (0..FRAMES).for_each(&mut each);
    let count = u32::try_from(allocations_during(|| (0..FRAMES).for_each(&mut each))).unwrap_or(u32::MAX);
    println!("{} {what}", f64::from(count) / f64::from(u32::try_from(FRAMES).unwrap_or(u32::MAX)));
}

fn main() {
    let samples = Samples::new(1);
    codec();
    client(&samples);
    server(&samples);
    controller();
    sdk();
}

fn codec() {
    for case in cases::all() {
        let ([mut read, ..], [mut write, ..]) = (case.decode, case.encode);
        tell(&format!("decode {}", case.name), |at| {
            black_box(read(at));
        });
        let mut out = Vec::with_capacity(1 << 16);
        tell(&format!("encode {}", case.name), |at| {
            out.clear();
            write(at, &mut out);
        });
    }
}

/// Writes the reply to a query as controllers write it.
fn reply(writer: ReplyWriter<'_>, query: &Query<'_>, values: &[f64], out: &mut Vec<u8>) {
    writer.query(query.addresses, out, |data| values.iter().for_each(|value| data.decimal(*value)));
}

/// Sends a query, receives its reply and reads every value.
fn client(samples: &Samples) {
    let mut session = ClientSession::new(ClientSettings::default());
    let (mut decoder, mut answer) = (Decoder::new(), Vec::new());
    tell("client session, query of 12 and its reply", |at| {
        let asked = Request::Query(&samples.queries[at]);
        session.send(Instant::ORIGIN, &asked).expect("it is short enough");
        answer.clear();
        let sent = session.poll_transmit().expect("it is to be written");
        let message = decoder.decode(sent).expect("a frame of ours");
        let Body::Query(query) = &message.body else { panic!("a query") };
        let writer = ReplyWriter::new(Dialect::HC1, message.header, RequestType::Query);
        reply(writer, query, &samples.replies[at], &mut answer);
        let length = sent.len();
        session.transmitted(length);
        assert_eq!(session.handle_input(Instant::ORIGIN, &answer), answer.len());
        let Some(Event::Reply { message, .. }) = session.poll_event(Instant::ORIGIN) else {
            panic!("a reply")
        };
        let Body::QueryReply(values) = message.body else { panic!("values") };
        assert_eq!(
            values.values.iter().filter_map(|value| value.number()).count(),
            samples.replies[at].len()
        );
        assert!(session.poll_event(Instant::ORIGIN).is_none());
    });
}

/// The frames of these requests, each with its own number.
fn frames(samples: &Samples, request: impl Fn(usize, &mut Vec<u8>, &Addressing<'_>)) -> Vec<Vec<u8>> {
    let each = |at: usize| {
        let (mut frame, pack_id) = (Vec::new(), samples.pack_ids[at].as_str());
        request(at, &mut frame, &Addressing { pack_id: Some(pack_id), ..Addressing::default() });
        frame
    };
    (0..FRAMES).map(each).collect()
}

fn queries(samples: &Samples) -> Vec<Vec<u8>> {
    frames(samples, |at, frame, addressing| {
        Request::Query(&samples.queries[at]).encode(addressing, frame).expect("it can be written");
    })
}

/// Receives a query, reads all its addresses and sends the reply.
fn server(samples: &Samples) {
    let queries = queries(samples);
    let mut session = ServerSession::new(Limits::default());
    tell("server session, query of 12 and its reply", |at| {
        let (inbox, outbox) = session.split();
        assert_eq!(inbox.push(Instant::ORIGIN, &queries[at]), queries[at].len());
        while let Some(message) = inbox.next_message() {
            let Ok(message) = message else { panic!("it is understood") };
            let Body::Query(query) = &message.body else { panic!("a query") };
            assert!(query.resolved().all(|(_, address)| address.is_ok()));
            outbox.send(|out| {
                let writer = ReplyWriter::new(Dialect::HC1, message.header, RequestType::Query);
                reply(writer, query, &samples.replies[at], out);
            });
        }
        let mut sent = 0;
        while let Some(frame) = outbox.poll_transmit(Instant::ORIGIN) {
            sent += frame.len();
        }
        assert!(sent > 100);
    });
}

/// Time between two requests at a controller: long enough for the work and for the reply.
const APART: Duration = Duration::from_secs(600);

/// Complete virtual controllers: a request arrives, the reply leaves, and the work is done before the next
/// request.
fn controller() {
    let few = Samples::new(1);
    let many = Samples::new(50);
    let lists = |samples: &Samples| {
        frames(samples, |at, frame, addressing| {
            let mut instructions = samples.lists[at].clone();
            // Within the limits of every arm, and fast.
            for instruction in &mut instructions {
                if let Action::AxisMove(motion) = &mut instruction.action {
                    let small: Vec<f64> = AxisIndex::ALL
                        .iter()
                        .take(6)
                        .map(|axis| motion.target.at(*axis).unwrap_or(0.0) / 100.0)
                        .collect();
                    motion.target = Coordinates::from_slice(&small);
                    motion.manner.speed = Some(100.0);
                    motion.manner.delay = Some(0.0);
                }
            }
            let request = Request::AddRcc { empty_list: true, instructions: &instructions };
            request.encode(addressing, frame).expect("it can be written");
        })
    };
    let points = frames(&few, |at, frame, addressing| {
        let cameras = [CameraPoints { cam_id: 3, points: &few.points[at] }];
        Request::AddPoints(&cameras).encode(addressing, frame).expect("it can be written");
    });
    answers("query of 12", &queries(&few), b"\"queryData\":[");
    answers("AddRCC of 1, done", &lists(&few), b"\"ok\"");
    answers("AddRCC of 50, done", &lists(&many), b"\"ok\"");
    answers("AddPoints of 8", &points, b"[\"AddPoints\",\"8\"]");
}

/// Counts for such requests. Every reply must contain `said`.
fn answers(what: &str, requests: &[Vec<u8>], said: &[u8]) {
    let model = RobotModel::named("BRTIRUS0707A").expect("a model that comes with r6-motion").clone();
    // No limit on the length, because fifty instructions are one frame here.
    let profile = Profile {
        add_rcc_silent_over: None,
        add_rcc_reset_over: None,
        ..Profile::named("hc1").expect("a profile that comes with the crate")
    };
    let settings =
        ControllerSettings { start: StartState::Waiting, ..ControllerSettings::new(profile, model) };
    let mut controller = Controller::new(settings, Instant::ORIGIN);
    let id = controller.connect(Instant::ORIGIN);
    let mut now = Instant::ORIGIN;
    tell(&format!("virtual controller, {what}"), |at| {
        controller.handle_input(now, id, &requests[at]);
        now += APART;
        controller.handle_timeout(now);
        let reply = controller.poll_transmit(now, id).expect("an answer");
        assert!(reply.windows(said.len()).any(|part| part == said), "{}", reply.escape_ascii());
        while controller.poll_log().is_some() {}
        assert!(!controller.machine().is_moving());
    });
    assert!(controller.machine().alarm() == 0, "{what}: it was done");
}

/// A query through a handle, with its reply.
fn sdk() {
    let addresses = echo::addresses();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let robot = runtime
        .block_on(Robot::connect_with(memory::Memory, RobotSettings::default()))
        .expect("memory connects");
    let mut result = runtime.block_on(robot.query(&addresses)).expect("an answer");
    tell("SDK, query of 12 and its reply", |_| {
        runtime.block_on(robot.query_again(&mut result)).expect("an answer");
        assert!(result.decimal(addresses[0]).is_some());
    });
}
