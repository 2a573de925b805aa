//! A controller whose lists always have one value too many: the client asks for each address alone, and
//! everything else has to hold.

use std::fmt;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{
    Address, Command, Connect, FollowOptions, Robot, RobotSettings, RunOptions, TargetSender, WaitOptions,
};
use r6_proto::address::RegisterIndex;
use r6_testkit::hostile::serve::HostileController;
use r6_testkit::hostile::{Character, Delays};
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use tokio::time::{Instant, sleep};

use crate::hands::{self, on_every_hand, pause};
use crate::{there_and_on, to_j1};

on_every_hand! {
    a_stop_is_confirmed_in_time_over_one_connection,
    motions_and_waiting_hold,
    following_holds,
    a_subscription_is_fresh_and_commands_are_not_held_up,
    odd_queries_end,
}

/// Connections on which each list of values repeats its last value.
struct Bent {
    controller: Arc<HostileController>,
    made: Arc<AtomicUsize>,
}

impl fmt::Display for Bent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a controller with odd lists")
    }
}

impl Connect for Bent {
    type Stream = DuplexStream;

    async fn connect(&mut self) -> io::Result<DuplexStream> {
        self.made.fetch_add(1, Ordering::SeqCst);
        let (ours, mine) = tokio::io::duplex(64 * 1024);
        let (mut from, mut to) = tokio::io::split(self.controller.dial()?);
        let (mut asks, mut answers) = tokio::io::split(mine);
        tokio::spawn(async move { tokio::io::copy(&mut asks, &mut to).await });
        tokio::spawn(async move {
            let (mut received, mut bytes) = (Vec::new(), [0; 4096]);
            while let Ok(count @ 1..) = from.read(&mut bytes).await {
                received.extend_from_slice(&bytes[..count]);
                let mut frames = serde_json::Deserializer::from_slice(&received).into_iter::<Value>();
                let mut out = Vec::new();
                while let Some(Ok(mut frame)) = frames.next() {
                    bend(&mut frame);
                    out.extend_from_slice(frame.to_string().as_bytes());
                }
                let used = frames.byte_offset();
                received.drain(..used);
                if answers.write_all(&out).await.is_err() {
                    return;
                }
            }
        });
        Ok(ours)
    }
}

/// Gives each register its number as value, and repeats the last value of each list.
fn bend(frame: &mut Value) {
    let asked = frame["queryAddr"].as_array().cloned().unwrap_or_default();
    let register = |name: &Value| name.as_str()?.strip_prefix("Addr-").map(Value::from);
    let Some(data) = frame["queryData"].as_array_mut() else { return };
    if asked.iter().any(|name| register(name).is_some()) {
        let mut known = std::mem::take(data).into_iter();
        *data = asked.iter().filter_map(|name| register(name).or_else(|| known.next())).collect();
    }
    if asked.len() > 1 {
        data.extend(data.last().cloned());
    }
}

/// A robot on such a connection. Also returns how many connections were opened.
async fn robot_bent(character: Character) -> (Arc<HostileController>, Robot, Arc<AtomicUsize>) {
    let controller = HostileController::new(character);
    let made = Arc::new(AtomicUsize::new(0));
    let bent = Bent { controller: Arc::clone(&controller), made: Arc::clone(&made) };
    let robot = hands::connect_with(bent, RobotSettings::default()).await.unwrap();
    (controller, robot, made)
}

async fn a_stop_is_confirmed_in_time_over_one_connection() {
    for (ms, absent) in [(18, false), (26, false), (18, true), (60, false)] {
        let wait = Duration::from_millis(ms);
        let mut character =
            Character { delays: Delays { query: wait, command: wait, list: wait }, ..Character::default() };
        if absent {
            character.list_length = r6_testkit::hostile::ListLength::Absent;
        }
        let (controller, robot, made) = robot_bent(character).await;
        let handle = robot.run(&there_and_on(20), RunOptions::default()).await.unwrap();
        pause(Duration::from_secs(1)).await;
        let (begun, told) = (Instant::now(), controller.now());
        let report = robot.stop().await.unwrap();
        let took = begun.elapsed();
        let (moved, stopped) = controller.arm(|arm, _| {
            let way_since = |time| arm.path_since(1, time)[0];
            (way_since(told) > 0.0, way_since(told + Duration::from_millis(150)) < 0.001)
        });
        drop(handle);
        assert!(report.confirmed && took < Duration::from_secs(5));
        assert!(moved && stopped, "{ms} ms");
        assert_eq!(
            (report.second, made.load(Ordering::SeqCst)),
            (None, 1),
            "{ms} ms: every answer came in time"
        );
    }
}

async fn motions_and_waiting_hold() {
    let (_controller, robot, _) = robot_bent(Character::default()).await;
    let status = robot.status().await.unwrap();
    assert!(status.is_ready(), "{:?}", status.unmet());
    let done = robot.run(&there_and_on(20), RunOptions::default()).await.unwrap().finished().await;
    assert_eq!(done.unwrap().axes[0], Some(100.0));
    robot.wait_until_done(WaitOptions::default()).await.unwrap();
}

async fn following_holds() {
    let (_controller, robot, _) = robot_bent(Character::default()).await;
    let (target, targets) = TargetSender::new();
    let source = async move {
        for n in 0..100 {
            target.send(AxisPosition::degrees([f64::from(n) / 10.0]));
            sleep(Duration::from_millis(50)).await;
        }
        for _ in 0..100 {
            target.send(AxisPosition::degrees([10.0]));
            sleep(Duration::from_millis(50)).await;
        }
    };
    let (followed, ()) = tokio::join!(robot.follow(targets, FollowOptions::default()), source);
    assert!(followed.is_ok());
}

async fn a_subscription_is_fresh_and_commands_are_not_held_up() {
    for count in [10, 40, 90] {
        let (_controller, robot, _) = robot_bent(Character::default()).await;
        robot.status().await.unwrap();
        let registers = (800..800 + count).map(|number| Address::Addr(RegisterIndex::new(number).unwrap()));
        let addresses: Vec<_> = [Address::CurMode, Address::CurAlarm].into_iter().chain(registers).collect();
        let mut state = robot.subscribe(&addresses, Duration::from_millis(100)).unwrap();
        let (mut fresh, mut seen) = (0, 0);
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(20) {
            let snapshot = state.next().await.unwrap();
            seen += 1;
            fresh += usize::from(snapshot.fresh(Address::CurMode).is_some());
        }
        let begun = Instant::now();
        robot.command(Command::ClearAlarm).await.unwrap();
        assert!(begun.elapsed() < Duration::from_millis(100), "{:?}", begun.elapsed());
        let begun = Instant::now();
        let report = robot.stop().await.unwrap();
        assert!(report.confirmed && begun.elapsed() < Duration::from_secs(5), "{report}");
        // A reply takes 18 ms: with more addresses one round takes longer than a value counts as fresh.
        assert!(count > 40 || (seen > 10 && fresh == seen), "{fresh} of {seen}");
    }
}

async fn odd_queries_end() {
    let (_controller, robot, _) = robot_bent(Character::default()).await;
    assert!(matches!(robot.query(&[]).await, Err(r6_client::RequestError::Invalid(_))));
    for _ in 0..3 {
        let twice = robot
            .query(&[Address::CurMode, Address::CurMode, Address::AxisNum, Address::CurMode])
            .await
            .unwrap();
        assert_eq!(twice.rows().len(), 4);
        assert!(twice.rows().iter().all(|(_, value)| value.is_ok()), "{twice:?}");
        assert!(matches!(robot.query(&[]).await, Err(r6_client::RequestError::Invalid(_))));
    }
    let (mut a, mut b) = (robot.clone(), robot.clone());
    let (a, b) = (&mut a, &mut b);
    let axes: Vec<_> = [Address::AxisNum, Address::CurMode, Address::IsMoving].into();
    for _ in 0..20 {
        let (x, y, z) = tokio::join!(a.query(&axes), b.query(&axes), robot.status());
        assert_eq!(
            (x.unwrap().integer(Address::AxisNum), y.unwrap().integer(Address::CurMode)),
            (Some(6), Some(7))
        );
        assert!(z.unwrap().is_ready());
    }
    robot.run(&to_j1(1.0), RunOptions::default()).await.unwrap().finished().await.unwrap();
}
