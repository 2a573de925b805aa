//! Further effects when the lists of a controller are doubted.

use r6_client::Identity;
use r6_proto::address::Address;
use serde_json::{Value, json};

use crate::controller::{Controller, asked, settings, soon, values};

fn of(name: &str) -> Value {
    match name {
        "version" => "F5".into(),
        "machineName" => "cell 4".into(),
        "axisNum" => "6".into(),
        "curMode" => "7".into(),
        "curAlarm" => "0".into(),
        "RemoteCmdLen" => "3".into(),
        other => other.strip_prefix("addr-").unwrap_or("1").into(),
    }
}

/// The list has the right length, but the name was left out and the version was there twice. Later its query
/// turns out to be wrong.
#[tokio::test]
async fn who_is_there_is_not_taken_from_a_list_that_is_not_believed() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let wanted = [Address::Version, Address::MachineName, Address::AxisNum, Address::RemoteCmdLen];
    let answering = async {
        for count in 1.. {
            let request = peer.any_frame().await;
            let data = match count {
                1 => json!(["F5", "cell 4", "6"]),
                2 => json!(["F5", "F5", "6"]),
                _ => asked(&request).into_iter().map(of).collect(),
            };
            peer.send(values(&request, data)).await;
        }
    };
    let result = tokio::select! {
        result = soon(robot.query(&wanted)) => result.unwrap(),
        () = answering => unreachable!(),
    };
    assert_eq!(result.text(Address::MachineName), Some("cell 4"));
    let (firmware, machine_name) = (Some("F5".to_owned()), Some("cell 4".to_owned()));
    assert_eq!(robot.identity(), Some(Identity { firmware, machine_name, axis_count: Some(6) }));
}

/// One query shows that lists are wrong. Another one passes well, with each address asked alone. A list that
/// was under way meanwhile is still wrong.
#[tokio::test]
async fn a_list_that_came_while_lists_were_doubted_is_not_believed_after_that() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (first, second) = ([Address::CurMode, Address::AxisNum], [Address::CurAlarm, Address::CurMode]);
    // The link learns that replies have numbers.
    let (warm, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        peer.send(values(&request, json!(["7"]))).await;
    });
    warm.unwrap();
    let late = tokio::spawn({
        let robot = robot.clone();
        async move { robot.query(&first).await }
    });
    let held = peer.frame().await;
    assert_eq!(asked(&held), ["curMode", "axisNum"]);
    for turn in 0..2 {
        let asking = tokio::spawn({
            let robot = robot.clone();
            async move { robot.query(&second).await }
        });
        for number in 0..3 - turn {
            let request = peer.frame().await;
            let mut data: Vec<_> = asked(&request).into_iter().map(of).collect();
            if number == 0 && turn == 0 {
                data.push("7".into());
            }
            peer.send(values(&request, data.into())).await;
        }
        soon(asking).await.unwrap().unwrap();
    }
    peer.send(values(&held, json!(["6", "6"]))).await;
    let answering = async {
        loop {
            let request = peer.frame().await;
            let data: Vec<_> = asked(&request).into_iter().map(of).collect();
            peer.send(values(&request, data.into())).await;
        }
    };
    let late = tokio::select! {
        late = soon(late) => late.unwrap().unwrap(),
        () = answering => unreachable!(),
    };
    assert_eq!(late.integer(Address::CurMode), Some(7));
}

/// A query began while lists were doubted. It ends well after another query has found a new wrong list.
#[tokio::test]
async fn an_older_query_does_not_end_a_newer_doubt() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let ask = |wanted: [Address; 2]| {
        let robot = robot.clone();
        tokio::spawn(async move { robot.query(&wanted).await })
    };
    let wanted = [Address::CurAlarm, Address::CurMode];
    let doubt = ask(wanted);
    for number in 0..3 {
        let request = peer.frame().await;
        let mut data: Vec<_> = asked(&request).into_iter().map(of).collect();
        if number == 0 {
            data.push("7".into());
        }
        peer.send(values(&request, data.into())).await;
    }
    soon(doubt).await.unwrap().unwrap();
    // Both ask for each address alone.
    let old = ask(wanted);
    let old_held = peer.frame().await;
    let new = ask([Address::AxisNum, Address::CurMode]);
    let request = peer.frame().await;
    assert_eq!(asked(&request), ["axisNum"]);
    peer.send(values(&request, json!(["6", "6"]))).await;
    let request = peer.frame().await;
    assert_eq!(asked(&request), ["curMode"]);
    peer.send(values(&request, json!(["7"]))).await;
    soon(new).await.unwrap().unwrap();
    peer.send(values(&old_held, json!(["0"]))).await;
    let request = peer.frame().await;
    assert_eq!(asked(&request), ["curMode"]);
    peer.send(values(&request, json!(["7"]))).await;
    soon(old).await.unwrap().unwrap();
    let _next = ask(wanted);
    assert_eq!(asked(&peer.frame().await), ["curAlarm"], "the newer doubt holds for the next query");
}

/// The first query of a connection asks for the identity. Its list is checked like any other.
#[tokio::test]
async fn too_many_values_for_who_is_there_cast_doubt_on_lists_too() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let asking = tokio::spawn({
        let robot = robot.clone();
        async move { robot.query(&[Address::CurAlarm, Address::CurMode]).await }
    });
    let request = peer.any_frame().await;
    assert_eq!(asked(&request), ["version", "machineName", "axisNum"]);
    peer.send(values(&request, json!(["F5", "cell 4", "6", "6"]))).await;
    let answering = async {
        loop {
            let request = peer.any_frame().await;
            let names = asked(&request);
            let mut data: Vec<_> = names.iter().map(|name| of(name)).collect();
            if names == ["curAlarm", "curMode"] {
                data[1] = data[0].clone();
            }
            peer.send(values(&request, data.into())).await;
        }
    };
    let result = tokio::select! {
        result = soon(asking) => result.unwrap().unwrap(),
        () = answering => unreachable!(),
    };
    assert_eq!(result.integer(Address::CurMode), Some(7));
}
