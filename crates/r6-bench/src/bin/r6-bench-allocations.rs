//! Counts allocations per frame in steady state: one line for each path, the count first.
//!
//! Started by `make bench ARGS=allocations`.

use std::hint::black_box;

use r6_proto::client::{ClientSession, ClientSettings, Event};
use r6_proto::dialect::Dialect;
use r6_proto::frame::Limits;
use r6_proto::message::Body;
use r6_proto::reply::ReplyWriter;
use r6_proto::request::Request;
use r6_proto::server::ServerSession;
use r6_proto::time::Instant;
use r6_proto::{Address, RequestType};
use r6_testkit::alloc::{CountingAllocator, allocations_during};

#[path = "../rows/echo.rs"]
#[allow(dead_code, reason = "the server in it is for others")]
mod echo;

#[path = "../../../r6-proto/benches/codec/cases.rs"]
mod cases;
#[path = "../../../r6-proto/benches/codec/others.rs"]
mod others;
#[path = "../../../r6-proto/benches/codec/samples.rs"]
mod samples;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Frames that count; as many come before them.
const FRAMES: usize = samples::FRAMES;

/// Prints how often memory is asked for in each of so many frames, once as many have passed.
fn tell(what: &str, mut each: impl FnMut(usize)) {
    (0..FRAMES).for_each(&mut each);
    let count = u32::try_from(allocations_during(|| (0..FRAMES).for_each(&mut each))).unwrap_or(u32::MAX);
    println!("{} {what}", f64::from(count) / f64::from(u32::try_from(FRAMES).unwrap_or(u32::MAX)));
}

fn main() {
    codec();
    client(&echo::addresses());
    server();
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

/// A query leaves, its reply comes and every value is read.
fn client(addresses: &[Address]) {
    let mut session = ClientSession::new(ClientSettings::default());
    let mut reply = Vec::new();
    tell("client session, query of 12 and its reply", |_| {
        session.send(Instant::ORIGIN, &Request::Query(addresses)).expect("it is short enough");
        reply.clear();
        let query = session.poll_transmit().expect("it is to be written");
        let length = echo::answer(query, &mut reply);
        session.transmitted(length);
        assert_eq!(session.handle_input(Instant::ORIGIN, &reply), reply.len());
        let Some(Event::Reply { message, .. }) = session.poll_event(Instant::ORIGIN) else {
            panic!("a reply")
        };
        let Body::QueryReply(values) = message.body else { panic!("values") };
        assert_eq!(values.values.iter().filter_map(|value| value.number()).count(), addresses.len());
        assert!(session.poll_event(Instant::ORIGIN).is_none());
    });
}

/// A query comes, every address of it is read, and its reply leaves.
fn server() {
    let query = echo::query_bytes();
    let mut session = ServerSession::new(Limits::default());
    tell("server session, query of 12 and its reply", |_| {
        let (inbox, outbox) = session.split();
        assert_eq!(inbox.push(Instant::ORIGIN, query.as_bytes()), query.len());
        while let Some(message) = inbox.next_message() {
            let Ok(message) = message else { panic!("it is understood") };
            let Body::Query(asked) = message.body else { panic!("a query") };
            outbox.send(|out| {
                let writer = ReplyWriter::new(Dialect::HC1, message.header, RequestType::Query);
                writer.query(asked.addresses, out, |data| {
                    for (_, address) in asked.resolved() {
                        data.decimal(
                            f64::from(address.ok().and_then(Address::index).unwrap_or(0)) - 137.563_782,
                        );
                    }
                });
            });
        }
        let mut sent = 0;
        while let Some(frame) = outbox.poll_transmit(Instant::ORIGIN) {
            sent += frame.len();
        }
        assert!(sent > 300);
    });
}
