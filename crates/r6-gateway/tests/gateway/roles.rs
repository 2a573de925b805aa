//! Tokens and users with another role for some robots.

use r6_api::gateway::Role;
use r6_gateway::GrantRobots;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::access::{Needs, described, needs, of_nonsense};
use crate::support::Hall;

/// A token with these robots.
fn token_for(hall: &Hall, role: Role, robots: &str) -> String {
    let robots = Some(GrantRobots::read(robots).unwrap());
    r6_gateway::make_token(hall.data.path(), role, robots, String::new()).unwrap().1
}

#[tokio::test]
async fn each_route_counts_the_role_for_its_robot() {
    let hall = Hall::start().await;
    let lower = token_for(&hall, Role::Admin, "press=viewer,*");
    let higher = token_for(&hall, Role::Admin, "press,*=viewer");
    for (method, path) in described() {
        let (needs, concrete) = needs(&method, &path);
        let Needs::Role(lowest) = needs else { continue };
        let body = (method != "GET").then(|| json!({ "no": "such field" }));
        let is_of_robot = path.starts_with("/v1/robots/{name}");
        // What is for no robot. The audit log is for those of which the role may read it.
        if !is_of_robot && lowest > Role::Viewer && !path.starts_with("/v1/audit") {
            for token in [&lower, &higher] {
                let (status, problem) = hall.call(token, &method, &concrete, body.as_ref()).await;
                assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{method} {path}");
            }
        }
        if is_of_robot && lowest > Role::Viewer {
            let (status, problem) = hall.call(&lower, &method, &concrete, body.as_ref()).await;
            assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{method} {path}");
            if !path.ends_with("/stop") {
                let (status, problem) = hall.call(&higher, &method, &concrete, body.as_ref()).await;
                assert_eq!(status, of_nonsense(&method, &path), "{method} {path}: {problem}");
            }
        }
    }
    assert_eq!(hall.get(&lower, "/v1/robots/press").await["stopped"], false, "it was not stopped");
    // The role of the whole says nothing where no robot has it.
    let nowhere = token_for(&hall, Role::Admin, "press=viewer");
    for path in ["/v1/audit", "/v1/audit/head"] {
        let (status, problem) = hall.call(&nowhere, "GET", path, None).await;
        assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{path}");
    }
    // Behind a new address may be the arm of any robot, and where an arm is, is nothing of one robot.
    for token in [&lower, &higher] {
        for (method, path, body) in [
            ("PUT", "/v1/robots/mill", json!({ "address": "127.0.0.1:9" })),
            ("PUT", "/v1/robots/press", json!({ "address": "127.0.0.1:9" })),
            ("POST", "/v1/robots/press/forget-owed-stop", json!({ "because": "it is gone" })),
        ] {
            let (status, problem) = hall.call(token, method, path, Some(&body)).await;
            assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{method} {path}");
        }
    }
}

#[tokio::test]
async fn a_token_commands_one_robot_and_only_watches_another() {
    let robots = [VirtualController::start().await, VirtualController::start().await];
    let hall = Hall::with(robots.map(Result::unwrap).into()).await;
    let mixed = token_for(&hall, Role::Engineer, "press,*=viewer");
    hall.get(&mixed, "/v1/robots/saw").await;
    let (status, problem) = hall.post(&mixed, "/v1/robots/saw/lease", &json!({})).await;
    assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")));
    let message = problem["message"].as_str().unwrap();
    assert!(message.contains("the role operator") && message.contains("is viewer for saw"), "{message}");
    assert_eq!(hall.stop(&mixed, "saw").await.0, 403);
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/saw").await["stopped"], false);
    hall.lease(&mixed, "press").await;
    hall.lease(&hall.operator, "saw").await;
    let taker = token_for(&hall, Role::Admin, "press,saw=operator");
    let take = json!({ "take_because": "the holder is away" });
    assert_eq!(hall.post(&taker, "/v1/robots/saw/lease", &take).await.0, 403);
    assert_eq!(hall.stop(&mixed, "press").await.0, 200);
    assert_eq!(hall.post(&taker, "/v1/robots/press/lease", &take).await.0, 200);
    // The log of a robot that it only watches is not for it.
    let seen = hall.get(&mixed, "/v1/audit").await;
    let entries = seen["entries"].as_array().unwrap();
    assert!(!entries.is_empty() && entries.iter().all(|entry| entry["robot"] == "press"), "{entries:#?}");
    // Nor is what is for all robots.
    let (status, problem) = hall.call(&mixed, "PUT", "/v1/raw-ports", Some(&json!({ "open": false }))).await;
    assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")));
    assert!(problem["message"].as_str().unwrap().contains("without a list of robots"), "{problem}");
}

#[tokio::test]
async fn robots_and_their_roles_are_given_over_the_api_and_never_above_the_role() {
    let hall = Hall::start().await;
    let wanted = |role: &str, robot: &str| json!({ "role": role, "robot": robot });
    let made = wanted("engineer", "saw=viewer,press,*=operator");
    let (status, made) = hall.post(&hall.admin, "/v1/tokens", &made).await;
    assert_eq!(status, 201, "{made}");
    let session = hall.get(made["token"].as_str().unwrap(), "/v1/session").await;
    assert_eq!(session["robot"], "press,saw=viewer,*=operator");
    for (role, robot, why) in [
        ("viewer", "press=admin", "is above the role viewer"),
        ("admin", "press=operater", "nearest: `operator`"),
        ("admin", "press,press=viewer", "two roles"),
        ("admin", "Press", "is no robot"),
    ] {
        for (method, path) in [("POST", "/v1/tokens"), ("PUT", "/v1/users/ben")] {
            let (status, problem) = hall.call(&hall.admin, method, path, Some(&wanted(role, robot))).await;
            assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{robot}");
            assert!(problem["message"].as_str().unwrap().contains(why), "{problem}");
        }
    }
    let put = async |body: Value| hall.call(&hall.admin, "PUT", "/v1/users/ben", Some(&body)).await.0;
    assert_eq!(put(wanted("engineer", "press,saw=operator")).await, 201);
    // A lower role, without a word about the robots: one with a role of its own keeps the lower one when the
    // role rises again, the others always have the role.
    assert_eq!(put(json!({ "role": "viewer" })).await, 204);
    assert_eq!(put(json!({ "role": "admin" })).await, 204);
    let users = hall.get(&hall.admin, "/v1/users").await;
    let ben = users["users"].as_array().unwrap().iter().find(|user| user["name"] == "ben").unwrap();
    assert_eq!((&ben["role"], &ben["robot"]), (&json!("admin"), &json!("press,saw=viewer")));
}
