//! The camera service on the robot's own connection.

use r6_client::{
    Address, CameraSet, Command, Conditions, Invalid, LostReason, NotSent, Permission, PhotoAnswer,
    PhotosEnded, Point, Refused, RequestError, Robot, Shot,
};
use serde_json::json;
use tokio::sync::Notify;

use crate::controller::{Controller, Peer, Wires, command_word, settings, soon, values, verdict};

const CUR_MODE: Address = Address::CurMode;

const PHOTO: &str = "{\"dsID\":\"www.hc-system.com.cam\",\"reqType\":\"photo\",\"camID\":3}";

fn part() -> Point {
    Point { model_id: 1, x: 360.0, y: -80.5, z: Some(440.0), ..Point::default() }
}

#[tokio::test]
async fn a_photo_is_answered_and_its_points_follow_even_between_replies() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let serving = robot.serve_photos(|cam_id| async move {
        assert_eq!(cam_id, 3);
        Shot::Points(vec![part()])
    });
    let (ended, ()) = tokio::join!(biased; serving, async {
        // The same connection reads values meanwhile.
        let asking = robot.query(&[CUR_MODE]);
        let (read, ()) = tokio::join!(asking, async {
            let request = peer.frame().await;
            peer.send(PHOTO).await;
            peer.send(values(&request, json!(["7"]))).await;
        });
        assert_eq!(read.unwrap().integer(CUR_MODE), Some(7));
        let answer = peer.frame().await;
        assert_eq!((&answer["reqType"], &answer["camID"], &answer["ret"]), (&json!("photo"), &json!(3), &json!(1)));
        let points = peer.frame().await;
        assert_eq!(points["dsData"][0]["camID"], json!(3));
        assert_eq!(points["dsData"][0]["data"][0]["Y"], json!(-80.5));
        peer.send(verdict(&points, &["AddPoints", "1"])).await;
        // Once this reply has arrived, the one before it has arrived too.
        let (read, ()) = tokio::join!(robot.query(&[CUR_MODE]), async {
            let request = peer.frame().await;
            peer.send(values(&request, json!(["7"]))).await;
        });
        read.unwrap();
        robot.clone().close().await;
    });
    assert_eq!(ended, PhotosEnded::Closed);
}

#[tokio::test]
async fn no_picture_no_part_and_another_camera() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut shots = vec![Shot::NotMine, Shot::Points(Vec::new()), Shot::Failed];
    let serving = robot.serve_photos(|_| {
        let shot = shots.pop().unwrap();
        async move { shot }
    });
    let (ended, ()) = tokio::join!(biased; serving, async {
        peer.send(format!("{PHOTO}{PHOTO}{PHOTO}")).await;
        // Only these two frames: no points, and no answer for another client's camera.
        for ret in [0, 1] {
            let answer = peer.frame().await;
            assert_eq!((&answer["reqType"], &answer["ret"]), (&json!("photo"), &json!(ret)));
        }
        let asking = robot.query(&[CUR_MODE]);
        let ((), read) = tokio::join!(async {
            let next = peer.frame().await;
            assert_eq!(next["reqType"], json!("query"));
            peer.send(values(&next, json!(["7"]))).await;
        }, asking);
        read.unwrap();
        robot.clone().close().await;
    });
    assert_eq!(ended, PhotosEnded::Closed);
}

#[tokio::test]
async fn points_that_are_refused_end_it() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let serving = robot.serve_photos(|_| async { Shot::Points(vec![part()]) });
    let (ended, ()) = tokio::join!(biased; serving, async {
        peer.send(PHOTO).await;
        peer.frame().await;
        let points = peer.frame().await;
        peer.send(verdict(&points, &["AddPoints", "err"])).await;
    });
    let error = RequestError::Refused(Refused::Points { reason: None });
    assert_eq!(ended, PhotosEnded::Request { cam_id: 3, error });
}

/// "Taken" promises points. So nothing is answered if the points cannot be sent.
#[tokio::test]
async fn points_that_cannot_be_sent_are_not_promised() {
    let nowhere = Point { x: f64::NAN, ..part() };
    for points in [vec![part(), nowhere], vec![part(); 100]] {
        let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
        let serving = robot.serve_photos(|_| async { Shot::Points(points.clone()) });
        let (ended, ()) = tokio::join!(biased; soon(serving), peer.send(PHOTO));
        let PhotosEnded::Request { cam_id: 3, error: RequestError::Invalid(error) } = &ended else {
            panic!("{ended:?}")
        };
        match error {
            Invalid::Value(error) => assert_eq!(error.field, "X"),
            Invalid::TooLong { bytes, limit: 2048 } => assert!(*bytes > 2048, "{bytes}"),
            other => panic!("{other:?}"),
        }
        nothing_has_left(&robot, &mut peer).await;
    }
}

/// For programs that hand on what cameras of others send.
#[tokio::test]
async fn points_and_answers_leave_only_under_their_conditions() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    // The robot says who it is.
    nothing_has_left(&robot, &mut peer).await;
    let sets = |count: usize| vec![CameraSet { cam_id: 3, points: vec![part(); count] }];
    let answer = PhotoAnswer { cam_id: 3, ret: 1 };
    let void = Permission::new();
    void.withdraw();
    let elsewhere = Conditions { only_on: Some(robot.connection() + 1), ..Conditions::default() };
    let withdrawn = Conditions { permission: Some(void), ..Conditions::default() };
    for (conditions, wanted) in [(elsewhere, NotSent::Disconnected), (withdrawn, NotSent::Withdrawn)] {
        let error = soon(robot.add_points_under(conditions.clone(), sets(1))).await.unwrap_err();
        assert_eq!(error, RequestError::NotSent(wanted.clone()));
        let error = soon(robot.answer_photo_under(conditions, answer)).await.unwrap_err();
        assert_eq!(error, RequestError::NotSent(wanted));
    }
    let all = Conditions { only_on: Some(robot.connection()), ..Conditions::default() };
    let error = soon(robot.add_points_under(all.clone(), sets(100))).await.unwrap_err();
    assert!(matches!(error, RequestError::Invalid(Invalid::TooLong { limit: 2048, .. })), "{error}");
    nothing_has_left(&robot, &mut peer).await;
    robot.answer_photo_under(all.clone(), answer).await.unwrap();
    assert_eq!(peer.frame().await["ret"], json!(1));
    let (accepted, ()) = tokio::join!(robot.add_points_under(all, sets(2)), async {
        let points = peer.frame().await;
        peer.send(verdict(&points, &["AddPoints", "2"])).await;
    });
    assert_eq!(accepted.unwrap().points, Some(2));
}

#[tokio::test]
async fn photos_are_served_by_one_at_a_time() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let serving = robot.serve_photos(|_| async { Shot::Failed });
    let other = robot.clone();
    let (ended, ()) = tokio::join!(biased; soon(serving), async {
        let second = soon(other.serve_photos(|_| async { Shot::Points(vec![part()]) })).await;
        assert_eq!(second, PhotosEnded::ServedAlready);
        assert!(second.to_string().contains("served already"), "{second}");
        peer.send(PHOTO).await;
        assert_eq!(peer.frame().await["ret"], json!(0));
        nothing_has_left(&other, &mut peer).await;
        other.clone().close().await;
    });
    assert_eq!(ended, PhotosEnded::Closed);
}

/// A dropped service gives its place free.
#[tokio::test]
async fn photos_are_served_by_the_next_once_the_first_is_gone() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    {
        let mut first = Box::pin(robot.serve_photos(|_| async { Shot::Points(vec![part()]) }));
        tokio::select! {
            biased;
            ended = &mut first => panic!("{ended}"),
            () = std::future::ready(()) => {}
        }
    }
    let (ended, ()) = tokio::join!(biased; soon(robot.serve_photos(|_| async { Shot::Failed })), async {
        peer.send(PHOTO).await;
        assert_eq!(peer.frame().await["ret"], json!(0));
        nothing_has_left(&robot, &mut peer).await;
        robot.clone().close().await;
    });
    assert_eq!(ended, PhotosEnded::Closed);
}

#[tokio::test]
async fn a_picture_of_a_lost_connection_is_not_answered_on_the_next() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (looking, developed) = (Notify::new(), Notify::new());
    let serving = robot.serve_photos(|_| async {
        looking.notify_one();
        developed.notified().await;
        Shot::Points(vec![part()])
    });
    let (ended, mut peer) = tokio::join!(biased; serving, async {
        peer.send(PHOTO).await;
        soon(looking.notified()).await;
        drop(peer);
        // Meanwhile another caller's query reconnects.
        let (read, peer) = tokio::join!(robot.query(&[CUR_MODE]), async {
            let mut peer = controller.accept().await;
            let request = peer.frame().await;
            peer.send(values(&request, json!(["7"]))).await;
            peer
        });
        read.unwrap();
        developed.notify_one();
        peer
    });
    assert_eq!(ended, PhotosEnded::ConnectionLost(LostReason::ClosedByPeer));
    let (read, ()) = tokio::join!(robot.query(&[CUR_MODE]), async {
        let next = peer.frame().await;
        assert_eq!(next["reqType"], json!("query"), "neither answer nor points");
        peer.send(values(&next, json!(["7"]))).await;
    });
    read.unwrap();
}

/// The next frame is the stop. Behind it there is nothing of a picture.
async fn only_the_stop_leaves(robot: &Robot, peer: &mut Peer) {
    let (sent, ()) = tokio::join!(robot.command(Command::ActionStop), async {
        let request = peer.frame().await;
        assert_eq!(command_word(&request), "actionStop");
        peer.send(verdict(&request, &["actionStop", "ok"])).await;
    });
    sent.unwrap();
}

async fn nothing_has_left(robot: &Robot, peer: &mut Peer) {
    let (read, ()) = tokio::join!(robot.query(&[CUR_MODE]), async {
        let next = peer.frame().await;
        assert_eq!(next["reqType"], json!("query"), "neither answer nor points");
        peer.send(values(&next, json!(["7"]))).await;
    });
    read.unwrap();
}

#[tokio::test]
async fn a_stop_while_a_picture_is_looked_at_ends_it_without_points() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (looking, developed) = (Notify::new(), Notify::new());
    let serving = robot.serve_photos(|_| async {
        looking.notify_one();
        developed.notified().await;
        Shot::Points(vec![part()])
    });
    let other = robot.clone();
    let (ended, mut peer) = tokio::join!(biased; soon(serving), async {
        // The second request comes before the stop too.
        peer.send(format!("{PHOTO}{PHOTO}")).await;
        soon(looking.notified()).await;
        only_the_stop_leaves(&other, &mut peer).await;
        developed.notify_one();
        peer
    });
    assert_eq!(ended, PhotosEnded::Stopped);
    assert!(ended.to_string().contains("stop"), "{ended}");
    nothing_has_left(&robot, &mut peer).await;
}

#[tokio::test]
async fn a_stop_between_pictures_does_not_end_it() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let serving = robot.serve_photos(|_| async { Shot::Failed });
    let (ended, ()) = tokio::join!(biased; soon(serving), async {
        only_the_stop_leaves(&robot, &mut peer).await;
        peer.send(PHOTO).await;
        assert_eq!(peer.frame().await["ret"], json!(0));
        nothing_has_left(&robot, &mut peer).await;
        robot.clone().close().await;
    });
    assert_eq!(ended, PhotosEnded::Closed);
}

#[tokio::test]
async fn a_stop_between_the_answer_and_its_points_holds_the_points_back() {
    let (_wires, robot, mut peer) = Wires::with_robot(settings()).await;
    // The identity is known, so only the stop can hold the points back.
    let (read, ()) = tokio::join!(
        robot.query(&[Address::Version, Address::MachineName, Address::AxisNum]),
        peer.introduces()
    );
    read.unwrap();
    let serving = robot.serve_photos(|_| async { Shot::Points(vec![part()]) });
    // The test's own future is polled first: its stop comes after the answer was sent and before the points
    // are sent.
    let (mut peer, ended) = tokio::join!(biased; async {
        // The service begins.
        tokio::task::yield_now().await;
        peer.send(PHOTO).await;
        let answer = peer.frame().await;
        assert_eq!((&answer["reqType"], &answer["ret"]), (&json!("photo"), &json!(1)));
        only_the_stop_leaves(&robot, &mut peer).await;
        peer
    }, soon(serving));
    assert_eq!(ended, PhotosEnded::Stopped);
    nothing_has_left(&robot, &mut peer).await;
}
