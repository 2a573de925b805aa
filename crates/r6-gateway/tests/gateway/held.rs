//! Values that come before the robot has said who it is.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use r6_controller::PanelAction;
use r6_gateway::RobotConfig;
use r6_proto::frame::{FrameBuffer, Limits};
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

use crate::support::{Hall, PATIENCE, name, signal};

/// A way to a robot. Its first connection can be cut. On the second one, the first questions for the state
/// are lost, so that the gateway does not know who answers.
struct Way {
    address: SocketAddr,
    cut: watch::Sender<bool>,
    lost: Arc<AtomicUsize>,
}

impl Way {
    /// `losses`: how many questions are lost.
    async fn to(robot: SocketAddr, losses: usize) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (cut, mut is_cut) = watch::channel(false);
        let lost = Arc::<AtomicUsize>::default();
        let counted = Arc::clone(&lost);
        tokio::spawn(async move {
            let (mut near, mut far) = both(&listener, robot).await;
            tokio::select! {
                _ = tokio::io::copy_bidirectional(&mut near, &mut far) => {}
                _ = is_cut.wait_for(|is_cut| *is_cut) => {}
            }
            drop((near, far));
            let (near, far) = both(&listener, robot).await;
            pass(near, far, losses, &counted).await;
        });
        Self { address, cut, lost }
    }

    fn lost(&self) -> usize {
        self.lost.load(Ordering::SeqCst)
    }
}

async fn both(listener: &TcpListener, robot: SocketAddr) -> (TcpStream, TcpStream) {
    (listener.accept().await.unwrap().0, TcpStream::connect(robot).await.unwrap())
}

async fn pass(mut near: TcpStream, mut far: TcpStream, losses: usize, lost: &AtomicUsize) {
    let mut frames = FrameBuffer::new(Limits::default());
    let (mut asked, mut answered) = ([0; 4096], [0; 4096]);
    loop {
        tokio::select! {
            read = near.read(&mut asked) => {
                let Ok(count @ 1..) = read else { return };
                assert_eq!(frames.push(&asked[..count]), count);
                while let Some(frame) = frames.next() {
                    let frame = String::from_utf8(frame.unwrap().bytes.to_vec()).unwrap();
                    // The question who it is has no axes, and a poll has no version.
                    let is_of_state = frame.contains("\"version\"") && frame.contains("\"axis-0\"");
                    if is_of_state && lost.load(Ordering::SeqCst) < losses {
                        lost.fetch_add(1, Ordering::SeqCst);
                    } else if far.write_all(frame.as_bytes()).await.is_err() {
                        return;
                    }
                }
            }
            read = far.read(&mut answered) => {
                let Ok(count @ 1..) = read else { return };
                if near.write_all(&answered[..count]).await.is_err() {
                    return;
                }
            }
        }
    }
}

fn samples(history: &Value) -> &[Value] {
    history["samples"].as_array().unwrap()
}

/// A gateway that does not know who answers since a question for the state was lost.
async fn doubtful(losses: usize) -> (Hall, Way) {
    let robot = VirtualController::start().await.unwrap();
    let way = Way::to(robot.address(), losses).await;
    let period = Duration::from_millis(20);
    let config = RobotConfig { period, ..RobotConfig::new(name("press"), way.address.to_string()) };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], vec![robot]).await;
    hall.until_up("press").await;
    hall.until_history("signal=curAlarm", |history| !samples(history).is_empty()).await;
    way.cut.send(true).unwrap();
    let begun = Instant::now();
    while way.lost() == 0 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    tokio::time::sleep(Duration::from_millis(200)).await;
    (hall, way)
}

/// An alarm begins and ends while it is not known who answers.
async fn alarm(hall: &Hall) {
    let robot = hall.robots[0].handle();
    robot.operate(&PanelAction::EmergencyStop).unwrap();
    let state = hall.until("press", |state| signal(state, "curAlarm")["value"] == 7).await;
    assert_eq!((&state["link"], &signal(&state, "curAlarm")["quality"]), (&json!("down"), &json!("stale")));
    robot.operate(&PanelAction::ReleaseEmergencyStop).unwrap();
}

#[tokio::test]
async fn an_alarm_is_kept_that_began_before_the_robot_said_who_it_is() {
    let (hall, way) = doubtful(1).await;
    alarm(&hall).await;
    let is_known = |state: &Value| state["link"] == "up" && signal(state, "curMode")["quality"] == "fresh";
    hall.until("press", is_known).await;
    assert_eq!(way.lost(), 1);
    let has_alarm = |history: &Value| samples(history).iter().any(|sample| sample["value"] == 7);
    let history = hall.until_history("signal=curAlarm", has_alarm).await;
    let gaps = samples(&history).iter().filter(|sample| !sample["gap"].is_null());
    assert_eq!(gaps.count(), 0, "every poll was read: {history:#}");
}

#[tokio::test]
async fn what_waits_too_long_for_the_robot_to_say_who_it_is_is_told_as_lost() {
    let (hall, way) = doubtful(3).await;
    alarm(&hall).await;
    hall.until_up("press").await;
    assert_eq!(way.lost(), 3);
    let is_read_again = |history: &Value| {
        let gap = samples(history).iter().position(|sample| !sample["gap"].is_null());
        gap.is_some_and(|gap| gap + 1 < samples(history).len())
    };
    let history = hall.until_history("signal=curMode", is_read_again).await;
    let gaps: Vec<_> =
        samples(&history).iter().map(|sample| &sample["gap"]).filter(|gap| !gap.is_null()).collect();
    assert_eq!(gaps, ["lost"], "{history:#}");
    let metrics = hall.get(&hall.viewer, "/metrics").await;
    let metrics = metrics.as_str().unwrap();
    let none = "r6_gateway_history_lost_total{robot=\"press\"} 0";
    assert!(metrics.contains("r6_gateway_history_lost_total") && !metrics.contains(none), "{metrics}");
}
