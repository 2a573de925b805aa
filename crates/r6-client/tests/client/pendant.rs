//! What a pendant shows: points that are on, and the pose.

use r6_client::units::{Degrees, Millimetres, Pose};
use serde_json::{Value, json};

use crate::controller::{Controller, asked, settings, soon, values};

#[tokio::test]
async fn each_point_of_a_word_is_told_by_itself() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    // The first and the third of the points are on, and no other.
    tokio::spawn(peer.answer_all(|request| Some(values(request, json!(["5"])))));
    for (name, on) in [("Y010", true), ("Y011", false), ("Y012", true), ("Y013", false), ("Y027", false)] {
        assert_eq!(soon(robot.is_on(name.parse().unwrap())).await.unwrap(), Some(on), "{name}");
    }
}

#[tokio::test]
async fn a_point_that_the_controller_does_not_tell_is_neither_on_nor_off() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    tokio::spawn(peer.answer_all(|request| Some(values(request, json!([])))));
    assert_eq!(soon(robot.is_on("X010".parse().unwrap())).await.unwrap(), None);
}

#[tokio::test]
async fn a_pose_has_all_six_values_or_is_none() {
    const WORLD: [&str; 6] = ["400.500", "-20.250", "300.000", "180.000", "-1.500", "90.000"];
    for lacking in [None, Some("world-4")] {
        let (_controller, robot, peer) = Controller::with_robot(settings()).await;
        tokio::spawn(peer.answer_all(move |request| {
            let told = asked(request).into_iter().filter(|name| Some(*name) != lacking);
            let value = |name: &str| name.strip_prefix("world-").map(|n| WORLD[n.parse::<usize>().unwrap()]);
            Some(values(request, told.map(value).map(Value::from).collect()))
        }));
        let pose = Pose::new([400.5, -20.25, 300.0].map(Millimetres), [180.0, -1.5, 90.0].map(Degrees));
        let wanted = lacking.is_none().then_some(pose);
        assert_eq!(soon(robot.pose()).await.unwrap(), wanted, "without {lacking:?}");
    }
}
