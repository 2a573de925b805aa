//! K1: drops futures at every point at which they wait, and after every millisecond. In all cases nothing
//! hangs and nothing is carried out twice. A request that was not sent before the drop is never sent. The
//! next caller finds everything in order.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{CameraSet, Motion, Robot, RobotSettings, RunOptions, WaitOptions};
use r6_controller::Scenario;
use r6_proto::message::{PhotoAnswer, Point};
use r6_proto::{Address, Command, RegisterIndex};
use r6_sim::VirtualController;
use tokio::time::{Instant, timeout};

use crate::floor::{Floor, thousandths};
use crate::hands::{self, On, Time, for_every_hand, pause, run, tasks};
use crate::tap::{Dialler, Tap};
use crate::world::{LONGEST_CALL, WRITTEN, connect, controller, ms};

/// The link is slow, so that there is something to wait for, and replies come in two parts.
const SLOW: &str = "[[fault]]\nfault = \"latency\"\nto_controller = 0.003\nto_client = 0.004\n\
    [[fault]]\nfault = \"stall\"\ndelay = 0.005\n";

/// No future waits more often than this.
const MOST_POLLS: usize = 2000;

/// The value that the dropped call writes, and the positions it moves to, degrees.
const VALUE: i64 = 424_242;
const TARGETS: [f64; 4] = [0.5, 1.0, 1.5, 2.0];

struct Cell {
    controller: VirtualController,
    floor: Floor,
    robot: Robot,
    tap: Tap,
}

type Dropped = Pin<Box<dyn Future<Output = ()>>>;

/// Creates one of the futures.
type Call = fn(&Cell) -> Dropped;

/// The futures that are dropped.
const CALLS: [(&str, Call); 19] = [
    ("query", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.query(&[Address::CurMode, Address::CurAlarm]).await) })
    }),
    ("a long query", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move {
            let many: Vec<_> = (800..890).filter_map(RegisterIndex::new).map(Address::Addr).collect();
            drop(robot.query(&many).await);
        })
    }),
    ("status", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.status().await) })
    }),
    ("firmware", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.firmware().await) })
    }),
    ("command", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(write(&robot, VALUE).await) })
    }),
    ("a stop as a command", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.command(Command::ActionStop).await) })
    }),
    ("clear_list", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.clear_list().await) })
    }),
    ("add_rcc", |cell| {
        let robot = cell.robot.clone();
        let steps = motion(&TARGETS[..2]).instructions().unwrap().to_vec();
        Box::pin(async move { drop(robot.add_rcc(false, steps).await) })
    }),
    ("wait_until_done", |cell| {
        let robot = cell.robot.clone();
        let options = WaitOptions { start_within: ms(200), ..WaitOptions::default() };
        Box::pin(async move { drop(robot.wait_until_done(options).await) })
    }),
    ("stop", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.stop().await) })
    }),
    ("run", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.run(&motion(&TARGETS), options()).await) })
    }),
    ("run, finished", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.run(&motion(&TARGETS), options()).await.unwrap().finished().await) })
    }),
    ("run, done step by step", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move {
            let handle = robot.run(&motion(&TARGETS), options()).await.unwrap();
            for step in 1..=TARGETS.len() {
                handle.step(step).unwrap().done().await;
            }
        })
    }),
    ("run, stop", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.run(&motion(&TARGETS), options()).await.unwrap().stop().await) })
    }),
    ("subscribe", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move {
            let mut subscription = robot.subscribe(&[Address::CurMode], ms(20)).unwrap();
            for _ in 0..3 {
                subscription.next().await;
            }
        })
    }),
    ("add_points", |cell| {
        let robot = cell.robot.clone();
        let point = Point {
            model_id: 1,
            x: 1.0,
            y: 2.0,
            z: Some(3.0),
            u: None,
            v: None,
            angle: Some(0.0),
            similarity: None,
            color: None,
            relative: false,
        };
        Box::pin(
            async move { drop(robot.add_points(vec![CameraSet { cam_id: 0, points: vec![point] }]).await) },
        )
    }),
    ("answer_photo", |cell| {
        let robot = cell.robot.clone();
        Box::pin(async move { drop(robot.answer_photo(PhotoAnswer { cam_id: 0, ret: 1 }).await) })
    }),
    ("connect", |cell| {
        let dialler = Dialler {
            controller: cell.controller.handle().clone(),
            tap: Tap::default(),
            rewrite: None,
            begun: Instant::now(),
        };
        Box::pin(async move {
            let other = hands::connect_with(dialler, RobotSettings::default()).await.unwrap();
            drop(other.status().await);
        })
    }),
    ("close", |cell| {
        let (robot, tap) = (cell.robot.clone(), Arc::clone(&cell.tap));
        Box::pin(async move {
            robot.close().await;
            drop(tap);
        })
    }),
];

fn options() -> RunOptions {
    RunOptions { frame_instructions: 1, room: 2, interval: ms(20), ..RunOptions::default() }
}

fn motion(targets: &[f64]) -> Motion {
    targets.iter().fold(Motion::new(), |motion, to| {
        let place = AxisPosition::degrees([*to, 0.0, 0.0, 0.0, 0.0, 0.0]);
        motion.axis_move(place, Percent::new(80.0).unwrap())
    })
}

async fn write(robot: &Robot, value: i64) -> Result<(), r6_client::RequestError> {
    let register = RegisterIndex::new(WRITTEN).unwrap();
    robot.command(Command::RewriteData { register, savable: false, value }).await.map(|_| ())
}

/// A future that is dropped after a number of polls. Returns whether it ended before.
struct Polls {
    inner: Dropped,
    left: usize,
}

impl Future for Polls {
    type Output = bool;

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<bool> {
        if self.left == 0 {
            return Poll::Ready(false);
        }
        self.left -= 1;
        match self.inner.as_mut().poll(cx) {
            Poll::Ready(()) => Poll::Ready(true),
            Poll::Pending if self.left == 0 => Poll::Ready(false),
            Poll::Pending => Poll::Pending,
        }
    }
}

/// When the test drops a future.
#[derive(Clone, Copy, Debug)]
enum When {
    Polled(usize),
    After(Duration),
}

/// Drops a call, and checks that everything is in order afterwards. Returns whether the call ended before.
async fn drop_and_look(call: Call, name: &'static str, when: When) -> bool {
    let scenario = Scenario::read(SLOW).unwrap();
    let (virtual_controller, floor) = controller("hc1", 1, &scenario).await;
    let (robot, tap) = connect(virtual_controller.handle(), &RobotSettings::default(), None).await;
    robot.status().await.unwrap();
    let idle = tasks();
    let cell = Cell { controller: virtual_controller, floor, robot, tap };
    let inner = call(&cell);
    let ended = match when {
        When::Polled(left) => timeout(LONGEST_CALL, Polls { inner, left }).await.expect("it hangs"),
        When::After(time) => timeout(time, inner).await.is_ok(),
    };
    // An arm finishes what is in its list.
    pause(Duration::from_secs(6)).await;
    let robot = if name == "close" {
        let (robot, _) = connect(cell.controller.handle(), &RobotSettings::default(), None).await;
        robot
    } else {
        // The tasks of the call are gone, and so are those of another client whose connection was just
        // opened.
        assert!(tasks() <= idle, "{name} {when:?}: {} tasks, {idle} before", tasks());
        cell.robot.clone()
    };
    let status = robot.status().await.expect("it can be read");
    if status.mode == Some(r6_client::OperationMode::Auto) {
        robot.command(Command::StartButton).await.expect("it takes a start");
    }
    write(&robot, 1).await.expect("it takes commands");
    let handle = robot.run(&motion(&[10.0, 11.0]), RunOptions { clear_leftover: true, ..options() }).await;
    handle.expect("it takes motions").finished().await.expect("it comes to its end");
    let report = robot.stop().await.expect("it takes a stop");
    assert!(report.confirmed, "{report}");

    let line = cell.tap.lock().unwrap().clone();
    assert!(line.text().matches(&format!("\"{VALUE}\"")).count() <= 1, "{name} {when:?}: sent twice");
    if matches!(when, When::Polled(0)) {
        assert!(!line.text().contains(&VALUE.to_string()), "{name}: sent, and never wanted");
    }
    let mut seen = cell.floor.seen();
    seen.assert_nothing_twice(|_| true);
    let done = std::mem::take(&mut seen.done);
    assert!(done.ends_with(&[10_000, 11_000]), "{name} {when:?}: {done:?}");
    let steps =
        line.frames().iter().map(|frame| frame["instructions"].as_array().map_or(0, Vec::len)).sum::<usize>();
    let sent_elsewhere = if name == "close" { 2 } else { 0 };
    assert_eq!(seen.taken, steps + sent_elsewhere, "{name} {when:?}");
    for target in TARGETS.map(thousandths) {
        assert!(done.iter().filter(|done| **done == target).count() <= 1, "{name} {when:?}: {done:?}");
    }
    ended
}

for_every_hand! {
    k1_a_future_dropped_wherever_it_waits_leaves_all_in_order,
    k1_a_future_dropped_after_any_time_leaves_all_in_order,
}

fn k1_a_future_dropped_wherever_it_waits_leaves_all_in_order(on: On) {
    for (name, call) in CALLS {
        let mut polls = 0;
        while !run(on, Time::Paused, move || drop_and_look(call, name, When::Polled(polls))) {
            polls += 1;
            assert!(polls < MOST_POLLS, "{name} never ends");
        }
        assert!(polls > 0 || name == "subscribe", "{name} waits for nothing: it cannot be dropped within");
        println!("{name}: dropped after 0 to {} polls", polls - 1);
    }
}

fn k1_a_future_dropped_after_any_time_leaves_all_in_order(on: On) {
    // The code that all drivers share meets every point on one of them; the other drivers meet some.
    let step = if on == On::Tokio { 2 } else { 7 };
    for (name, call) in CALLS {
        let ends = (0..800).step_by(step).map(ms).find(|time| {
            let when = When::After(*time);
            run(on, Time::Paused, move || drop_and_look(call, name, when))
        });
        println!("{name}: dropped within {ends:?}");
    }
}
