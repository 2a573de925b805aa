//! Stopping: ahead of all other requests, until the arm is seen to stand.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_client::{ListAfterStop, NotTried, OperationMode, RequestError, RobotSettings, StopMeans};
use r6_proto::address::Address;
use r6_proto::message::Command;
use serde_json::Value;

use crate::controller::{Controller, asked, command_word, settings, soon, values, verdict};

/// A controller with an arm that needs several stops to stand.
struct Arm {
    /// The number of stops that have no effect yet.
    deaf_to: u32,
    stops: u32,
    list: u32,
    mode: &'static str,
    alarm: &'static str,
    clears: u32,
}

impl Arm {
    fn moving(deaf_to: u32) -> Arc<Mutex<Self>> {
        Arc::new(Mutex::new(Self { deaf_to, stops: 0, list: 3, mode: "7", alarm: "0", clears: 0 }))
    }

    fn answer(&mut self, request: &Value) -> Option<String> {
        let word = command_word(request);
        if !word.is_empty() {
            self.stops += 1;
            if self.stops > self.deaf_to {
                (self.mode, self.alarm) = ("3", "42");
            }
            return Some(verdict(request, &[word, "ok"]));
        }
        if request["reqType"] == "AddRCC" {
            assert_eq!(
                (request["emptyList"].as_str(), &request["instructions"]),
                (Some("1"), &serde_json::json!([]))
            );
            self.clears += 1;
            self.list = 0;
            return Some(verdict(request, &["AddRCC", "ok"]));
        }
        let data: Vec<Value> = asked(request)
            .into_iter()
            .map(|address| match address {
                "isMoving" => Value::from(if self.stops > self.deaf_to { "0" } else { "1" }),
                "curMode" => self.mode.into(),
                "curAlarm" => self.alarm.into(),
                "RemoteCmdLen" => self.list.to_string().into(),
                _ => "0.000000".into(),
            })
            .collect();
        Some(values(request, data.into()))
    }
}

#[tokio::test]
async fn a_stop_overtakes_a_queue_and_the_limit_of_unanswered_requests() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let tasks: Vec<_> = (0..40)
        .map(|_| {
            let robot = robot.clone();
            tokio::spawn(async move { robot.query(&[Address::CurMode]).await.map(|_| ()) })
        })
        .collect();
    for _ in 0..8 {
        assert_eq!(peer.frame().await["reqType"], "query");
    }
    let (stopped, ()) = tokio::join!(soon(robot.command(Command::ActionStop)), async {
        let next = peer.frame().await;
        assert_eq!(command_word(&next), "actionStop", "32 queries are before it in time, none on the wire");
        peer.send(verdict(&next, &["actionStop", "ok"])).await;
    });
    stopped.unwrap();
    for task in tasks {
        task.abort();
    }
}

#[tokio::test]
async fn a_stop_is_confirmed_by_state_and_the_list_is_cleared() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let arm = Arm::moving(0);
    let answering = Arc::clone(&arm);
    tokio::spawn(peer.answer_all(move |request| answering.lock().unwrap().answer(request)));
    let report = soon(robot.stop()).await.unwrap();
    assert!(report.confirmed);
    assert_eq!((report.attempts, report.moving), (1, Some(false)));
    assert_eq!((report.mode, report.alarm), (Some(OperationMode::Stop), Some(42)));
    assert_eq!((&report.list, report.list_length), (&ListAfterStop::Cleared, Some(0)));
    assert_eq!(arm.lock().unwrap().clears, 1);
    let text = report.to_string();
    assert!(text.contains("mode stop (3); alarm 42; the instruction list was cleared"), "{text}");
}

#[tokio::test]
async fn an_empty_list_is_not_cleared() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let arm = Arm::moving(0);
    arm.lock().unwrap().list = 0;
    let answering = Arc::clone(&arm);
    tokio::spawn(peer.answer_all(move |request| answering.lock().unwrap().answer(request)));
    let report = soon(robot.stop()).await.unwrap();
    assert_eq!(report.list, ListAfterStop::WasEmpty);
    assert_eq!(arm.lock().unwrap().clears, 0);
}

#[tokio::test]
async fn a_means_that_is_answered_but_not_obeyed_is_followed_by_the_next() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let arm = Arm::moving(1);
    let answering = Arc::clone(&arm);
    tokio::spawn(peer.answer_all(move |request| answering.lock().unwrap().answer(request)));
    let report = soon(robot.stop()).await.unwrap();
    assert!(report.confirmed);
    assert_eq!((report.attempts, report.means), (2, Some(StopMeans::StopButton)));
    assert!(report.to_string().contains("by stopButton"), "{report}");
}

#[tokio::test]
async fn an_arm_that_does_not_stop_is_reported_after_every_means() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let arm = Arm::moving(u32::MAX);
    let answering = Arc::clone(&arm);
    tokio::spawn(peer.answer_all(move |request| answering.lock().unwrap().answer(request)));
    let report = soon(robot.stop()).await.unwrap();
    assert!(!report.confirmed);
    assert!(report.attempts >= 5, "{} attempts", report.attempts);
    assert_eq!(report.moving, Some(true));
    assert_eq!(report.list, ListAfterStop::NotTried(NotTried::NotStanding));
    assert!(arm.lock().unwrap().clears > 0, "the fourth means");
    assert!(report.to_string().starts_with("NOT CONFIRMED"), "{report}");
    assert!(report.to_string().contains("use the emergency stop"), "{report}");
}

#[tokio::test]
async fn a_stop_brings_a_lost_connection_back() {
    let (controller, robot, peer) = Controller::with_robot(settings()).await;
    drop(peer);
    let arm = Arm::moving(0);
    let answering = Arc::clone(&arm);
    let (report, ()) = tokio::join!(soon(robot.stop()), async {
        let peer = controller.accept().await;
        tokio::spawn(peer.answer_all(move |request| answering.lock().unwrap().answer(request)));
    });
    let report = report.unwrap();
    assert!(report.confirmed, "{report:?}");
    assert_eq!(report.list, ListAfterStop::Cleared);
}

#[tokio::test]
async fn a_stop_that_reaches_nobody_is_an_error() {
    let settings = RobotSettings { connect_timeout: Duration::from_millis(200), ..settings() };
    let (controller, robot, peer) = Controller::with_robot(settings).await;
    drop((controller, peer));
    // Bytes written before the end is seen count as sent, because the client cannot know better.
    soon(robot.query(&[Address::CurMode])).await.unwrap_err();
    let error = soon(robot.stop()).await.unwrap_err();
    assert!(matches!(error, RequestError::NotSent(_)), "{error:?}");
}

/// The runtime that drives the connection is shut down while a stop is under way on another runtime. Its
/// outcome is then unknown.
#[test]
fn a_stop_whose_runtime_is_shut_down_is_not_said_to_be_unsent() {
    let runtime = || tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let home = runtime();
    let (_controller, robot, mut peer) = home.block_on(Controller::with_robot(settings()));
    let stopping = std::thread::spawn(move || runtime().block_on(soon(robot.stop())));
    home.block_on(async { while soon(peer.any_frame()).await["cmdData"][0] != "actionStop" {} });
    drop(home);
    let error = stopping.join().unwrap().unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(_)), "{error:?}");
}
