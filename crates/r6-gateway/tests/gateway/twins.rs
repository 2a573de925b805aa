//! Twins: virtual controllers beside the robots.

use r6_controller::RobotModel;
use r6_gateway::RobotConfig;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::support::{Hall, name};

/// A gateway with `press` and its twin. Both are up.
async fn hall() -> Hall {
    let robots = [VirtualController::start().await.unwrap(), VirtualController::start().await.unwrap()];
    let [press, twin] = [&robots[0], &robots[1]].map(|robot| robot.address().to_string());
    let press = RobotConfig { twin: Some(name("press-twin")), ..RobotConfig::new(name("press"), press) };
    let twin = RobotConfig { twin_of: Some(name("press")), ..RobotConfig::new(name("press-twin"), twin) };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![press, twin], robots.into()).await;
    hall.until_up("press").await;
    hall.until_up("press-twin").await;
    hall
}

#[tokio::test]
async fn the_api_tells_a_twin_from_its_robot() {
    let hall = hall().await;
    let robots = hall.get(&hall.viewer, "/v1/robots").await["robots"].as_array().unwrap().clone();
    let told = |robot: &Value| json!([robot["name"], robot["twin"], robot["twin_of"], robot["virtual"]]);
    let told: Vec<_> = robots.iter().map(told).collect();
    // Here the robot is virtual, too.
    assert_eq!(
        told,
        [json!(["press", "press-twin", null, true]), json!(["press-twin", null, "press", true])]
    );
}

#[tokio::test]
async fn a_twin_that_never_answered_is_virtual_all_the_same() {
    let twin = RobotConfig { twin_of: Some(name("press")), ..RobotConfig::new(name("p"), "127.0.0.1:1") };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![twin], Vec::new()).await;
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/p").await["virtual"], true);
}

#[tokio::test]
async fn a_stop_and_a_lease_of_a_twin_do_not_touch_the_robot() {
    let hall = hall().await;
    let of_press = hall.lease(&hall.operator, "press").await;
    let of_twin = hall.lease(&hall.operator, "press-twin").await;
    // Each lease is for its own robot only.
    assert_eq!(hall.command(&hall.operator, "press", &of_twin, "modifyGSPD 5").await.1["code"], "no_lease");
    assert_eq!(
        hall.command(&hall.operator, "press-twin", &of_press, "modifyGSPD 5").await.1["code"],
        "no_lease"
    );
    assert_eq!(hall.stop(&hall.operator, "press-twin").await.0, 200);
    let stopped =
        async |robot: &str| hall.get(&hall.viewer, &format!("/v1/robots/{robot}")).await["stopped"].clone();
    assert_eq!((stopped("press").await, stopped("press-twin").await), (json!(false), json!(true)));
    let (status, answer) = hall.command(&hall.operator, "press", &of_press, "modifyGSPD 5").await;
    assert_eq!(status, 200, "{answer}");
    // And the other way round.
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let clear = json!({ "lease": of_twin });
    assert_eq!(hall.post(&hall.operator, "/v1/robots/press-twin/clear-stopped", &clear).await.0, 204);
    assert_eq!((stopped("press").await, stopped("press-twin").await), (json!(true), json!(false)));
}

#[tokio::test]
async fn the_api_makes_no_robot_of_a_twin_and_no_twin_has_the_name_of_its_robots() {
    let hall = hall().await;
    let put = async |robot: &str, address: String| {
        let body = json!({ "address": address });
        hall.call(&hall.admin, "PUT", &format!("/v1/robots/{robot}"), Some(&body)).await
    };
    let here = format!("localhost:{}", hall.robots[1].address().port());
    for (robot, address, code) in
        [("press-twin", "127.0.0.1:1".to_owned(), "managed_by_file"), ("other", here, "address_taken")]
    {
        let (status, problem) = put(robot, address).await;
        assert_eq!((status, &problem["code"]), (409, &json!(code)), "{problem}");
    }
    // A robot that has the name of a later twin stays.
    assert_eq!(put("saw-twin", "127.0.0.1:1".to_owned()).await.0, 201);
    let saw = RobotConfig { twin_of: Some(name("saw")), ..RobotConfig::new(name("saw-twin"), "127.0.0.1:2") };
    let refused = hall.gateway.reload(vec![saw.clone()]).await.unwrap_err();
    assert_eq!(refused.code.word(), "bad_value");
    let kept = hall.get(&hall.viewer, "/v1/robots/saw-twin").await;
    assert_eq!((&kept["twin_of"], &kept["address"]), (&json!(null), &json!("127.0.0.1:1")));
    hall.get(&hall.viewer, "/v1/robots/press").await;

    // The same at the next start.
    let Hall { gateway, data, .. } = hall;
    gateway.shutdown().await.unwrap();
    let settings = crate::support::settings(data.path(), vec![saw]);
    let refused = r6_gateway::Gateway::start(settings).await.unwrap_err();
    assert!(refused.to_string().contains("a twin would have its name"), "{refused}");
}

#[tokio::test]
async fn a_twin_of_another_model_is_no_exchanged_robot_and_a_stop_of_it_holds() {
    let hall = hall().await;
    let press = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!(hall.stop(&hall.operator, "press-twin").await.0, 200);
    // The next twin has four axes, and its robot is as before.
    let scara = RobotModel::named("GENERIC-SCARA").unwrap().clone();
    let other = VirtualController::builder().model(scara).start().await.unwrap();
    let address = |robot: &Value| robot["address"].as_str().unwrap().to_owned();
    let robots = |twin: String| {
        let press = RobotConfig {
            twin: Some(name("press-twin")),
            ..RobotConfig::new(name("press"), address(&press))
        };
        let twin = RobotConfig { twin_of: Some(name("press")), ..RobotConfig::new(name("press-twin"), twin) };
        vec![press, twin]
    };
    hall.gateway.reload(robots(other.address().to_string())).await.unwrap();
    let is_scara = |robot: &Value| robot["link"] == "up" && robot["identity"]["axis_count"] == 4;
    let twin = hall.until("press-twin", is_scara).await;
    assert_eq!((&twin["identity_changed"], &twin["stopped"]), (&json!(null), &json!(true)), "{twin}");

    // The same at the next start of the gateway, with six axes again.
    let six = VirtualController::start().await.unwrap();
    let robots = robots(six.address().to_string());
    let hall = hall.again(robots, vec![other, six]).await;
    let twin = hall.until("press-twin", |robot| robot["link"] == "up").await;
    assert_eq!((&twin["identity_changed"], &twin["stopped"]), (&json!(null), &json!(true)), "{twin}");

    // A robot that takes the name of a twin is another one, and gets no command.
    let robot = RobotConfig::new(name("press-twin"), hall.robots[0].address().to_string());
    hall.gateway.reload(vec![robot]).await.unwrap();
    let is_other = |robot: &Value| !robot["identity_changed"].is_null();
    let changed = hall.until("press-twin", is_other).await;
    assert_eq!((&changed["twin_of"], &changed["stopped"]), (&json!(null), &json!(true)), "{changed}");
}
