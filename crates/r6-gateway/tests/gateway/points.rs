//! Points that the gateway keeps: places of arms, by name and with their versions.

use r6_api::gateway::Role;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::support::{Hall, Reply, call_with, name, ready_to_start};

const BELT: &str = "/v1/points/above-belt";

async fn put(hall: &Hall, path: &str, body: &Value, head: &str) -> Reply {
    call_with(hall.gateway.address(), &hall.engineer, "PUT", path, head, Some(body)).await
}

fn refused(reply: &Reply) -> (u16, &str) {
    (reply.status, reply.body["code"].as_str().unwrap_or_default())
}

#[tokio::test]
async fn a_point_is_kept_with_its_versions() {
    let hall = Hall::start().await;
    let axes = json!([0, -10.5, 20, 0, 90, 0]);
    let wanted = json!({ "axes": axes, "note": "20 mm above the belt" });
    let made = put(&hall, BELT, &wanted, "").await;
    assert_eq!((made.status, &made.body["version"]), (201, &json!(1)), "{}", made.body);
    let value = &made.body["value"];
    assert_eq!((&value["axes"], &value["pose"]), (&json!([0.0, -10.5, 20.0, 0.0, 90.0, 0.0]), &json!(null)));
    let first = made.etag.unwrap();
    assert_eq!(refused(&put(&hall, BELT, &wanted, "").await), (428, "needs_if_match"));
    assert_eq!(refused(&put(&hall, BELT, &wanted, "If-None-Match: *\r\n").await), (412, "not_this_version"));
    let pose = json!({ "robot": "press", "pose": [500, 0, 300.25, 180, 0, 0], "tool": 1, "work_frame": 0 });
    let changed = put(&hall, BELT, &pose, &format!("If-Match: {first}\r\n")).await;
    assert_eq!((changed.status, &changed.body["version"]), (200, &json!(2)), "{}", changed.body);
    assert_eq!(
        refused(&put(&hall, BELT, &pose, &format!("If-Match: {first}\r\n")).await),
        (412, "not_this_version")
    );

    let latest = call_with(hall.gateway.address(), &hall.viewer, "GET", BELT, "", None).await;
    assert_eq!((&latest.body, &latest.etag), (&changed.body, &changed.etag));
    assert_eq!(latest.body["value"]["tool"], 1);
    assert_eq!(hall.get(&hall.viewer, &format!("{BELT}?version=1")).await, made.body);
    let versions = hall.get(&hall.viewer, &format!("{BELT}/versions")).await;
    assert_eq!(versions, json!({ "versions": [changed.body, made.body] }));
    assert_eq!(hall.get(&hall.viewer, "/v1/points").await, json!({ "points": [changed.body] }));

    // They are there after a new start. Then the point goes.
    let hall = hall.again(Vec::new(), Vec::new()).await;
    assert_eq!(hall.get(&hall.viewer, BELT).await, changed.body);
    let remove = async |head: &str| {
        call_with(hall.gateway.address(), &hall.engineer, "DELETE", BELT, head, None).await.status
    };
    assert_eq!((remove("").await, remove(&format!("If-Match: {first}\r\n")).await), (428, 412));
    let present = format!("If-Match: {}\r\n", changed.etag.unwrap());
    assert_eq!((remove(&present).await, remove(&present).await), (204, 404));
    let told: Vec<_> =
        hall.audit().await.into_iter().filter(|entry| entry["point"] == "above-belt").collect();
    let whats: Vec<_> =
        told.iter().map(|entry| (entry["what"].as_str().unwrap(), &entry["version"])).collect();
    let (one, two) = (json!(1), json!(2));
    assert_eq!(whats, [("point_stored", &one), ("point_stored", &two), ("point_removed", &two)]);
    assert!(told.iter().all(|entry| entry["actor"] == "token 3 (engineer)"));
}

#[tokio::test]
async fn a_point_is_where_a_robot_stands_and_not_where_it_moves() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let here = json!({ "robot": "press", "note": "home" });
    let made = put(&hall, BELT, &here, "").await;
    assert_eq!(made.status, 201, "{}", made.body);
    let (value, stands) = (&made.body["value"], hall.robots[0].handle().snapshot().axes);
    let axes: Vec<f64> = serde_json::from_value(value["axes"].clone()).unwrap();
    assert!(
        axes.len() == 6 && axes.iter().zip(stands).all(|(told, axis)| (told - axis).abs() < 1e-3),
        "{value}"
    );
    assert_eq!(value["pose"].as_array().unwrap().len(), 6);
    assert_eq!(
        (&value["robot"], &value["tool"], &value["note"]),
        (&json!("press"), &json!(null), &json!("home"))
    );

    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "startButton").await.0, 200);
    hall.until("press", |state| crate::support::signal(state, "isMoving")["value"] == true).await;
    let moving = put(&hall, "/v1/points/moving", &here, "").await;
    assert_eq!(refused(&moving), (409, "not_ready"), "{}", moving.body);
    hall.robots.into_iter().next().unwrap().shutdown().await.unwrap();
}

#[tokio::test]
async fn a_robot_that_does_not_answer_gives_no_point() {
    let mut hall = Hall::start().await;
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    hall.until("press", |state| state["link"] == "down").await;
    let gone = put(&hall, BELT, &json!({ "robot": "press" }), "").await;
    assert_eq!(refused(&gone), (409, "not_ready"), "{}", gone.body);
    assert_eq!(hall.get(&hall.viewer, "/v1/points").await, json!({ "points": [] }));
}

#[tokio::test]
async fn a_point_that_is_none_is_refused() {
    let hall = Hall::start().await;
    let six = json!([0, 0, 0, 0, 0, 0]);
    for (path, body, wanted) in [
        (BELT, json!({}), (422, "bad_value")),
        (BELT, json!({ "axes": [] }), (422, "bad_value")),
        (BELT, json!({ "axes": [1e7] }), (422, "bad_value")),
        (BELT, json!({ "axes": ["1"] }), (422, "bad_value")),
        (BELT, json!({ "pose": [1, 2, 3] }), (422, "bad_value")),
        (BELT, json!({ "axes": six, "tool": 1 }), (422, "bad_value")),
        (BELT, json!({ "axes": six, "tol": 1 }), (422, "bad_value")),
        (BELT, json!({ "axes": six, "robot": "saw" }), (404, "no_such_robot")),
        (BELT, json!({ "axes": six, "robot": "Press" }), (404, "no_such_robot")),
        ("/v1/points/Above", json!({ "axes": six }), (422, "bad_value")),
        ("/v1/points/%FF", json!({ "axes": six }), (422, "bad_value")),
    ] {
        let reply = put(&hall, path, &body, "").await;
        assert_eq!(refused(&reply), wanted, "{body}: {}", reply.body);
    }
    for path in
        ["/v1/points/other", "/v1/points/other/versions", "/v1/points/Other", "/v1/points/other?version=1"]
    {
        let (status, problem) = hall.call(&hall.viewer, "GET", path, None).await;
        assert_eq!((status, &problem["code"]), (404, &json!("no_such_point")), "{path}");
    }
}

#[tokio::test]
async fn who_may_change_programs_may_change_points() {
    let saw = VirtualController::start().await.unwrap();
    let hall = Hall::with(vec![VirtualController::start().await.unwrap(), saw]).await;
    let wanted = json!({ "axes": [1, 2, 3, 4, 5, 6] });
    put(&hall, BELT, &wanted, "").await;
    let of_saw =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("saw").into()), String::new());
    let of_saw = of_saw.unwrap().1;
    for token in [&hall.viewer, &hall.operator, &of_saw] {
        assert_eq!(hall.get(token, BELT).await["version"], 1);
        for method in ["PUT", "DELETE"] {
            let reply =
                call_with(hall.gateway.address(), token, method, BELT, "If-Match: *\r\n", Some(&wanted))
                    .await;
            assert_eq!(refused(&reply), (403, "not_allowed"), "{method}");
        }
    }
}
