//! The errors that a caller gets, sorted by what the caller must do.

use r6_client::{Effect, Invalid, OutcomeUnknown, Refused, RequestError};
use r6_proto::address::Address;
use r6_proto::message::instruction::{Action, Coordinates, Move};
use r6_proto::message::{Command, CommandName, Instruction};

use crate::controller::{Controller, SHORT, command_word, impatient, settings, values, verdict};

fn axis_move() -> Instruction {
    let target = Coordinates::from_slice(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    Instruction { oneshot: true, action: Action::AxisMove(Move { target, ..Move::default() }) }
}

#[tokio::test]
async fn a_refusal_names_the_command_and_the_reason() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (refused, ()) = tokio::join!(robot.command(Command::StartButton), async {
        let request = peer.frame().await;
        peer.send(verdict(&request, &["startButton", "err", "not in auto"])).await;
    });
    let error = refused.unwrap_err();
    let reason = Some("not in auto".to_owned());
    assert_eq!(error, Refused::Command { command: CommandName::StartButton, reason }.into());
    assert!(!error.may_send_again());
    assert!(error.to_string().starts_with("the controller refused startButton: not in auto; "), "{error}");
}

#[tokio::test]
async fn a_refused_list_warns_that_it_may_run() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (refused, ()) = tokio::join!(robot.add_rcc(true, vec![axis_move()]), async {
        let request = peer.frame().await;
        // Captured from unit B: the reply to a list that nevertheless ran.
        peer.send(verdict(&request, &["AddRCC", "err"])).await;
    });
    let error = refused.unwrap_err();
    assert_eq!(error, Refused::InstructionList { reason: None }.into());
    assert!(error.to_string().contains("controllers have run lists that they refused"), "{error}");
}

#[tokio::test]
async fn no_reply_to_a_motion_forbids_sending_it_again() {
    let (_controller, robot, mut peer) = Controller::with_robot(impatient()).await;
    let (sent, request) = tokio::join!(robot.add_rcc(true, vec![axis_move()]), peer.frame());
    assert_eq!(request["reqType"], "AddRCC");
    let error = sent.unwrap_err();
    match &error {
        RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { request, after, heard }) => {
            assert_eq!(*heard, None);
            assert_eq!((request.word, request.effect, *after), ("AddRCC", Effect::Moves, SHORT));
        }
        other => panic!("{other:?}"),
    }
    assert!(!error.may_send_again());
    assert!(error.to_string().contains("Do not send it again"), "{error}");
    // Nothing else was sent, in particular no second list.
    drop(robot);
    peer.ends().await;
}

#[tokio::test]
async fn a_late_reply_is_not_taken_for_the_next() {
    let (_controller, robot, mut peer) = Controller::with_robot(impatient()).await;
    let (first, late) = tokio::join!(robot.query(&[Address::CurMode]), peer.frame());
    assert!(first.is_err());
    let (second, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        let both = values(&late, serde_json::json!(["3"])) + &values(&request, serde_json::json!(["7"]));
        peer.send(both).await;
    });
    assert_eq!(second.unwrap().integer(Address::CurMode), Some(7));
}

#[tokio::test]
async fn a_reply_that_says_neither_yes_nor_no_is_unknown() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (sent, ()) = tokio::join!(robot.command(Command::ModifyGspd { percent: 5.0 }), async {
        let request = peer.frame().await;
        assert_eq!(request["cmdData"], serde_json::json!(["modifyGSPD", "50"]));
        peer.send(verdict(&request, &["modifyGSPD", "busy"])).await;
    });
    match sent.unwrap_err() {
        RequestError::OutcomeUnknown(OutcomeUnknown::Unclear { request, answer }) => {
            assert_eq!(
                (request.word, request.effect, answer.as_str()),
                ("modifyGSPD", Effect::Changes, "busy")
            );
        }
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_list_that_is_too_long_is_not_sent() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (sent, ()) = tokio::join!(robot.add_rcc(true, vec![axis_move(); 30]), peer.introduces());
    let error = sent.unwrap_err();
    assert!(matches!(error, RequestError::Invalid(Invalid::TooLong { limit: 2048, .. })), "{error:?}");
    drop(robot);
    peer.ends().await;
}

#[tokio::test]
async fn a_dropped_future_takes_its_request_back_if_it_has_not_left() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut tasks = Vec::new();
    let mut requests = Vec::new();
    for _ in 0..8 {
        let robot = robot.clone();
        tasks.push(tokio::spawn(async move { robot.query(&[Address::CurMode]).await.map(|_| ()) }));
        requests.push(peer.frame().await);
    }
    let queued = robot.clone();
    let start = tokio::spawn(async move { queued.command(Command::StartButton).await });
    tokio::task::yield_now().await;
    start.abort();
    assert!(start.await.unwrap_err().is_cancelled());
    for request in &requests {
        peer.send(values(request, serde_json::json!(["7"]))).await;
    }
    for task in tasks {
        task.await.unwrap().unwrap();
    }
    let (sent, ()) = tokio::join!(robot.command(Command::ClearAlarm), async {
        let request = peer.frame().await;
        assert_eq!(command_word(&request), "clearAlarm", "the start was taken back");
        peer.send(verdict(&request, &["clearAlarm", "ok"])).await;
    });
    sent.unwrap();
}
