//! The round trip of a query of twelve addresses: what the SDK adds to a socket.

use std::io::{Read, Write};
use std::net::SocketAddr;
use std::time::Instant;

use r6_client::{Robot, RobotSettings, blocking};
use r6_proto::Address;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::runtime::{Builder, Runtime};

use super::echo;
use crate::measure::{Contender, SLICE, compare, repeated};
use crate::report::{Figure, Goal, Row};

/// From `strace` and `perf` on these rows.
const IN_THE_WAY: &str = "of the SDK's own instructions (callgrind) nearly half find the reply, hold it against the query and read twelve values into their \
     types, and a quarter take the request through the lanes, the checks and the session; the rest is locks, wakers, the timer and the \
     buffers that are handed out. The async client makes an `epoll_wait` for the reply, as any tokio socket";

const FLOOR: &str = "blocking socket, same bytes";

/// The expected first value of a reply. Both sides must have read the same values.
const FIRST: f64 = 10.25;

/// A blocking socket that writes a query and reads to the end of the reply.
fn socket(address: SocketAddr) -> impl FnMut() {
    let query = echo::query_bytes();
    let mut stream = std::net::TcpStream::connect(address).expect("it listens");
    stream.set_nodelay(true).expect("small frames leave at once");
    let mut buffer = vec![0; 4096];
    move || {
        stream.write_all(query.as_bytes()).expect("it is read");
        let mut filled = 0;
        while filled == 0 || buffer[filled - 1] != b'}' {
            let count = stream.read(&mut buffer[filled..]).expect("a reply");
            assert!(count > 0, "the reply is whole");
            filled += count;
        }
    }
}

pub fn runtime() -> Runtime {
    Builder::new_current_thread().enable_all().build().expect("a runtime")
}

pub async fn query(robot: &Robot, addresses: &[Address]) {
    let result = robot.query(addresses).await.expect("an answer");
    assert_eq!(result.decimal(addresses[0]), Some(FIRST));
}

/// The SDK, blocking and async, each compared with the bare socket.
pub fn rows() -> Vec<Row> {
    let server = echo::start();
    let addresses = echo::addresses();
    let engine_robot =
        blocking::Robot::connect(&server.to_string(), RobotSettings::default()).expect("it listens");
    let runtime = runtime();
    let robot =
        runtime.block_on(Robot::connect(&server.to_string(), RobotSettings::default())).expect("it listens");
    let mut contenders: Vec<Contender<'_>> = vec![
        repeated(socket(server)),
        repeated(|| {
            let result = engine_robot.query(&addresses).expect("an answer");
            assert_eq!(result.decimal(addresses[0]), Some(FIRST));
        }),
        {
            let addresses = &addresses;
            let slice = move || {
                runtime.block_on(async { slice_async(async || query(&robot, addresses).await).await })
            };
            slice();
            Box::new(slice)
        },
    ];
    contenders.push(bare_tokio(server));
    let ratios = compare(&mut contenders);
    // The last of these contenders is the yardstick of the one before it.
    let mut both: Vec<_> = contenders.drain(2..).rev().collect();
    let beside_tokio = compare(&mut both);
    let row = |what: &str, goal, ratio| Row {
        what: format!("round trip of a 12-address query, {what}"),
        against: FLOOR,
        goal: Some(Goal::AtMost(goal)),
        figure: Figure::Ratio(ratio),
        in_the_way: IN_THE_WAY,
    };
    vec![
        row("blocking, p50", 1.05, ratios[0][0].clone()),
        row("blocking, p99", 1.15, ratios[0][1].clone()),
        row("async, p50", 1.10, ratios[1][0].clone()),
        row("async, p99", 1.20, ratios[1][1].clone()),
        Row {
            what: "round trip of a 12-address query, async, p50".to_owned(),
            against: "bare tokio socket, same bytes",
            goal: Some(Goal::AtMost(1.15)),
            figure: Figure::Ratio(beside_tokio[0][0].clone()),
            in_the_way: IN_THE_WAY,
        },
        Row {
            what: "the same bytes over a bare tokio socket, p50".to_owned(),
            against: FLOOR,
            goal: None,
            figure: Figure::Ratio(ratios[2][0].clone()),
            in_the_way: "",
        },
    ]
}

/// The lower bound for async: a tokio socket that writes and reads the same bytes, without a separate task.
fn bare_tokio<'c>(address: SocketAddr) -> Contender<'c> {
    let runtime = runtime();
    let query = echo::query_bytes();
    let mut stream = runtime.block_on(tokio::net::TcpStream::connect(address)).expect("it listens");
    stream.set_nodelay(true).expect("small frames leave at once");
    let mut buffer = vec![0; 4096];
    let mut durations = move || {
        runtime.block_on(async {
            slice_async(async || {
                stream.write_all(query.as_bytes()).await.expect("it is read");
                let mut filled = 0;
                while filled == 0 || buffer[filled - 1] != b'}' {
                    filled += stream.read(&mut buffer[filled..]).await.expect("a reply");
                }
            })
            .await
        })
    };
    durations();
    Box::new(durations)
}

/// One task that repeats a call for a slice, like an async program. Returns the percentiles 50 and 99.
pub async fn slice_async(mut once: impl AsyncFnMut()) -> Vec<f64> {
    let mut durations = Vec::with_capacity(1 << 16);
    let begun = Instant::now();
    let mut last = begun;
    while last.duration_since(begun) < SLICE {
        once().await;
        let now = Instant::now();
        durations.push(now.duration_since(last));
        last = now;
    }
    durations.sort_unstable();
    [50, 99].map(|percent| durations[durations.len() * percent / 100].as_secs_f64() * 1e9).to_vec()
}

/// Compares sixty-four tasks, each with a handle, on one connection with one task.
pub fn handles() -> Vec<Row> {
    const HANDLES: usize = 64;
    let server = echo::start();
    let runtime = runtime();
    let robot =
        runtime.block_on(Robot::connect(&server.to_string(), RobotSettings::default())).expect("it listens");
    let addresses = echo::addresses();
    // Returns the time per query, in nanoseconds.
    let slice = |handles: usize| {
        let (robot, addresses) = (robot.clone(), addresses.clone());
        let begun = Instant::now();
        let counts = runtime.block_on(async {
            let tasks: Vec<_> = (0..handles)
                .map(|_| {
                    let (robot, addresses) = (robot.clone(), addresses.clone());
                    tokio::spawn(async move {
                        let mut count = 0_u32;
                        while begun.elapsed() < SLICE {
                            query(&robot, &addresses).await;
                            count += 1;
                        }
                        count
                    })
                })
                .collect();
            let mut counts = 0;
            for task in tasks {
                counts += task.await.expect("it does not panic");
            }
            counts
        });
        vec![begun.elapsed().as_secs_f64() * 1e9 / f64::from(counts)]
    };
    let mut contenders: Vec<Contender<'_>> = vec![Box::new(|| slice(1)), Box::new(|| slice(HANDLES))];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    vec![Row {
        what: "64 handles sharing one robot, time per query".to_owned(),
        against: "one handle",
        goal: Some(Goal::AtMost(1.0)),
        figure: Figure::Ratio(ratio),
        in_the_way: "",
    }]
}
