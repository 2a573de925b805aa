//! One process that polls a thousand robots: the cost of a poll through the SDK.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use r6_client::{Robot, RobotSettings, Subscription};
use tokio::runtime::Builder;

use super::echo;
use crate::measure::{Contender, compare, processor_time};
use crate::report::{Figure, Goal, Row};
use crate::serve::Server;

const ROBOTS: usize = 1000;

/// Each robot is polled ten times a second.
const EVERY: Duration = Duration::from_millis(100);

/// The slice of this row, which holds several polls of each robot.
const LONG_SLICE: Duration = Duration::from_secs(1);

/// Processor time of this process for each poll, over bare sockets and through the SDK. The robots are in
/// another process.
pub fn rows() -> Vec<Row> {
    let robots = Server::Echo.start();
    let mut streams: Vec<TcpStream> = (0..ROBOTS)
        .map(|_| {
            let stream = TcpStream::connect(robots.address).expect("it listens");
            stream.set_nodelay(true).expect("small frames leave at once");
            stream
        })
        .collect();
    let (query, reply) = (echo::query_bytes(), echo::reply_length());
    let mut buffer = vec![0; reply];
    let bare = move || {
        let before = processor_time();
        let begun = Instant::now();
        let mut polls = 0_u32;
        // At the same pace, because a machine that rests between two polls has colder caches.
        while begun.elapsed() < LONG_SLICE {
            let round = Instant::now();
            for stream in &mut streams {
                stream.write_all(query.as_bytes()).expect("it is read");
                stream.read_exact(&mut buffer).expect("a reply");
                polls += 1;
            }
            std::thread::sleep(EVERY.saturating_sub(round.elapsed()));
        }
        vec![(processor_time() - before).as_secs_f64() * 1e9 / f64::from(polls)]
    };
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    let address = robots.address.to_string();
    let addresses = echo::addresses();
    let subscriptions: Vec<(Robot, Subscription)> = runtime.block_on(async {
        let mut all = Vec::new();
        for _ in 0..ROBOTS {
            let robot = Robot::connect(&address, RobotSettings::default()).await.expect("it listens");
            let subscription = robot.subscribe(&addresses, EVERY).expect("it is polled");
            all.push((robot, subscription));
        }
        all
    });
    let polled = || subscriptions.iter().map(|(robot, _)| robot.link_quality().replies).sum::<u64>();
    let through_the_sdk = || {
        runtime.block_on(async {
            let (polls, before) = (polled(), processor_time());
            tokio::time::sleep(LONG_SLICE).await;
            // Read the time first, because counting costs more than a poll.
            let spent = processor_time() - before;
            let polls = u32::try_from(polled() - polls).unwrap_or(u32::MAX);
            if f64::from(polls) < 9.0 * ROBOTS as f64 {
                eprintln!("  {polls} polls in a second: the machine is too busy for the pace");
            }
            vec![spent.as_secs_f64() * 1e9 / f64::from(polls)]
        })
    };
    through_the_sdk();
    let mut contenders: Vec<Contender<'_>> = vec![Box::new(bare), Box::new(through_the_sdk)];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    vec![Row {
        what: "1 000 robots × 12 addresses × 10 Hz in one process, the last values kept: processor time for each poll".to_owned(),
        against: "bare write and read on as many sockets",
        goal: Some(Goal::AtMost(1.5)),
        figure: Figure::Ratio(ratio),
        in_the_way: "the kernel's part is as large as the other's; most of the SDK's own is waiting for memory: what belongs to one robot \
                     (session, buffers, timer, plan, values) was last touched a tenth of a second ago, and the caches do not hold that of \
                     1 000",
    }]
}
