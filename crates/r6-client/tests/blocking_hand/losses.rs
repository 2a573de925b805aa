//! Sixteen threads, calls at random, and a link that breaks again and again.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use r6_client::blocking::Robot;
use r6_client::{Reconnect, RobotSettings};
use r6_controller::fault::{LinkFault, LinkFaultNow};
use r6_proto::{Address, Command, RegisterIndex};
use r6_sim::{Clock, VirtualController};

const THREADS: u16 = 16;
const CALLS: usize = 120;

/// No call may take longer than this: a stop takes up to 15 s, anything else much less.
const LONGEST: Duration = Duration::from_secs(20);

/// A small random generator: each seed gives its own sequence.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

fn call(robot: &Robot, random: &mut Random, thread: u16, answered: &AtomicUsize) {
    let register = RegisterIndex::new(820 + thread).unwrap();
    let address = Address::Addr(register);
    let ok = match random.below(12) {
        0..5 => {
            let read = robot.query(&[Address::AxisNum, address, Address::CurMode]);
            if let Ok(read) = &read {
                assert_eq!(read.integer(Address::AxisNum), Some(6), "another reply than its own");
            }
            read.is_ok()
        }
        5 | 6 => robot.status().is_ok(),
        7 | 8 => {
            let value = i64::try_from(random.below(1000)).unwrap();
            let written = robot.command(Command::RewriteData { register, savable: false, value });
            let read = robot.query(&[address]);
            if let (Ok(_), Ok(read)) = (&written, &read) {
                assert_eq!(read.integer(address), Some(value), "no other program writes there");
            }
            written.is_ok() && read.is_ok()
        }
        9 => robot.command(Command::ActionPause).is_ok(),
        10 => match robot.subscribe(&[Address::CurMode], Duration::from_millis(20)) {
            Ok(mut values) => values.next_within(Duration::from_millis(50)).is_some(),
            Err(_) => false,
        },
        _ => {
            let lookup = robot.as_async().clone();
            robot.block_on(lookup.firmware()).is_ok()
        }
    };
    answered.fetch_add(usize::from(ok), Ordering::Relaxed);
}

#[test]
fn threads_get_through_whatever_becomes_of_the_link() {
    for seed in [1, 2] {
        let controller = VirtualController::builder().clock(Clock::Times(5.0)).start_blocking().unwrap();
        let settings = RobotSettings {
            reply_timeout: Duration::from_millis(400),
            connect_timeout: Duration::from_millis(400),
            reconnect: Reconnect {
                first_wait: Duration::from_millis(1),
                cap: Duration::from_millis(20),
                jitter_seed: Some(seed),
            },
            ..RobotSettings::default()
        };
        let robot = Robot::connect(&controller.address().to_string(), settings).unwrap();
        robot.status().unwrap();
        let (over, answered) = (AtomicBool::new(false), AtomicUsize::new(0));
        thread::scope(|scope| {
            scope.spawn(|| {
                let mut random = Random(seed * 77);
                while !over.load(Ordering::Relaxed) {
                    let fault = match random.below(5) {
                        0 => LinkFault::CloseBeforeReply,
                        1 => LinkFault::ResetMidFrame { after: None },
                        2 => LinkFault::Stall { delay: Duration::from_millis(500) },
                        3 => LinkFault::Refuse,
                        _ => LinkFault::Pieces { bytes: 7 },
                    };
                    controller.handle().set_link_faults(vec![LinkFaultNow { fault, chance: 0.3 }]);
                    thread::sleep(Duration::from_millis(8));
                    controller.handle().set_link_faults(Vec::new());
                    thread::sleep(Duration::from_millis(15));
                }
            });
            let threads: Vec<_> = (0..THREADS)
                .map(|thread| {
                    let (robot, answered) = (robot.clone(), &answered);
                    scope.spawn(move || {
                        let mut random = Random(seed * 1000 + u64::from(thread) + 1);
                        for _ in 0..CALLS {
                            let begun = Instant::now();
                            call(&robot, &mut random, thread, answered);
                            assert!(begun.elapsed() < LONGEST, "a call took {:?}", begun.elapsed());
                        }
                    })
                })
                .collect();
            let ended: Vec<_> = threads.into_iter().map(|thread| thread.join()).collect();
            over.store(true, Ordering::Relaxed);
            assert!(ended.iter().all(Result::is_ok));
        });
        let answered = answered.into_inner();
        assert!(answered > usize::from(THREADS) * CALLS / 10, "only {answered} calls were answered");
        let begun = Instant::now();
        while robot.status().is_err() {
            assert!(begun.elapsed() < LONGEST, "it does not find its way back");
        }
        robot.close();
        while controller.handle().snapshot().connections > 0 {
            assert!(begun.elapsed() < LONGEST, "a connection was left");
            thread::sleep(Duration::from_millis(5));
        }
    }
}
