//! Programs: their check, their plan, and those that the gateway keeps.

use r6_api::gateway::Role;
use r6_gateway::RobotConfig;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::support::{Hall, Reply, call_with, commands, name};

const SQUARE: &str = include_str!("../../../../examples/programs/square.toml");

const PICK: &str = "/v1/programs/pick";

async fn check(hall: &Hall, program: &str) -> Value {
    let (status, checked) =
        hall.post(&hall.viewer, "/v1/programs/check", &json!({ "program": program })).await;
    assert_eq!(status, 200, "{checked}");
    checked
}

async fn plan(hall: &Hall, body: Value) -> (u16, Value) {
    hall.post(&hall.viewer, "/v1/programs/plan", &body).await
}

/// Stores a program as the engineer, with these lines of the head.
async fn put(hall: &Hall, path: &str, program: &str, head: &str) -> Reply {
    let body = json!({ "program": program });
    call_with(hall.gateway.address(), &hall.engineer, "PUT", path, head, Some(&body)).await
}

#[tokio::test]
async fn a_check_tells_every_mistake_with_its_place_and_where_steps_can_run() {
    let hall = Hall::start().await;
    let good = check(&hall, SQUARE).await;
    assert_eq!((&good["ok"], &good["kind"]), (&json!(true), &json!("instructions")));
    let steps = good["steps"].as_array().unwrap();
    assert!(!steps.is_empty() && steps.iter().all(|step| step["runs"] == "sent"), "{good}");

    let bad = "[[step]]\ndo = \"axis-move\"\nto = [1]\n[[step]]\ndo = \"jump\"\nto = \"nowhere\"\n\
               [[step]]\ndo = \"photo\"\n";
    let checked = check(&hall, bad).await;
    assert_eq!((&checked["ok"], &checked["kind"]), (&json!(false), &json!("taught")));
    let places: Vec<_> =
        checked["problems"].as_array().unwrap().iter().map(|one| one["line"].clone()).collect();
    assert_eq!(places, [json!(1), json!(6)], "{checked}");
    assert!(checked["problems"][0]["message"].as_str().unwrap().contains("`speed`"), "{checked}");
    assert_eq!(checked["problems"][1]["column"], 6);
    let runs: Vec<_> = checked["steps"].as_array().unwrap().iter().map(|step| step["runs"].clone()).collect();
    assert_eq!(runs, [json!(null), json!(null), json!("on_controller")]);

    // More mistakes than are listed are counted.
    let many = check(&hall, &"[[instruction]]\ndo = 1\n".repeat(30)).await;
    assert_eq!((many["problems"].as_array().unwrap().len(), &many["more_problems"]), (20, &json!(10)));
    let neither = check(&hall, "hello = 1").await;
    assert_eq!((&neither["kind"], neither["problems"].as_array().unwrap().len()), (&json!("neither"), 1));
}

#[tokio::test]
async fn a_text_that_is_too_long_is_refused_and_one_of_the_longest_is_not() {
    let hall = Hall::start().await;
    let path = "/v1/programs/check";
    let of_length = |length: usize| json!({ "program": "#".repeat(length) });
    let (status, _) = hall.post(&hall.viewer, path, &of_length(256 * 1024)).await;
    assert_eq!(status, 200);
    let (status, problem) = hall.post(&hall.viewer, path, &of_length(256 * 1024 + 1)).await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    let (status, problem) = hall.post(&hall.viewer, path, &of_length(400 * 1024)).await;
    assert_eq!((status, &problem["code"]), (413, &json!("too_long")));
    // Other routes keep their limit.
    let (status, _) = hall.post(&hall.operator, "/v1/robots/press/lease", &of_length(17 * 1024)).await;
    assert_eq!(status, 413);
}

#[tokio::test]
async fn a_plan_of_a_model_has_times_samples_and_problems_and_moves_no_robot() {
    let hall = Hall::start().await;
    let mut log = hall.robots[0].handle().log();
    let (status, planned) = plan(&hall, json!({ "program": SQUARE, "model": "brtirus0707a" })).await;
    assert_eq!(status, 200, "{planned}");
    assert_eq!((&planned["model"], &planned["ended"]), (&json!("BRTIRUS0707A"), &json!("done")));
    let samples = planned["samples"].as_array().unwrap();
    let times: Vec<_> = samples.iter().map(|sample| sample["time_ms"].as_f64().unwrap()).collect();
    assert!(times.is_sorted() && times[0] == 0.0, "{times:?}");
    assert!((times.last().unwrap() - planned["duration_ms"].as_f64().unwrap()).abs() < 0.01);
    assert_eq!(samples[0]["axes"].as_array().unwrap().len(), 6);
    assert_eq!(samples[0]["pose"].as_array().unwrap().len(), 6);
    assert!(samples.iter().any(|sample| sample["tool_speed"].as_f64() > Some(1.0)));

    let beyond = "[[instruction]]\ndo = \"axis-move\"\nto = [0, 0, 0, 0, 500, 0]\nspeed = 5\n";
    let (status, planned) = plan(&hall, json!({ "program": beyond, "model": "BRTIRUS0707A" })).await;
    assert_eq!((status, &planned["ended"]), (200, &json!("alarm")));
    let problem = &planned["problems"][0];
    assert_eq!(
        (&problem["kind"], &problem["step"], &problem["axis"]),
        (&json!("limit"), &json!(1), &json!("J5"))
    );

    for (body, code, part) in [
        (json!({ "program": SQUARE }), "bad_value", "BRTIRUS0707A"),
        (json!({ "program": SQUARE, "model": "R2D2" }), "bad_value", "GENERIC-SCARA"),
        (json!({ "program": SQUARE, "model": "BRTIRUS0707A", "robot": "press" }), "bad_value", "either"),
        (json!({ "program": SQUARE, "robot": "press" }), "bad_value", "`model`"),
        (json!({ "program": SQUARE, "model": "BRTIRUS0707A", "sample_ms": 1 }), "bad_value", "sample_ms"),
        (
            json!({ "program": SQUARE, "model": "BRTIRUS0707A", "from": [0, 0, 0, 0, 0, 0, 0] }),
            "bad_value",
            "from",
        ),
        (json!({ "program": SQUARE, "model": "BRTIRUS0707A", "from": [9000] }), "bad_value", "from"),
        (
            json!({ "program": SQUARE, "model": "BRTIRUS0707A", "global_speed_percent": 0 }),
            "bad_value",
            "speed",
        ),
        (json!({ "program": "[[instruction]]\n", "model": "BRTIRUS0707A" }), "bad_program", "`do`"),
    ] {
        let (status, problem) = plan(&hall, body.clone()).await;
        assert_eq!((status, &problem["code"]), (422, &json!(code)), "{problem}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{part}: {problem}");
    }
    assert!(commands(&mut log).is_empty());
}

#[tokio::test]
async fn a_plan_for_a_robot_that_is_read_seldom_asks_where_it_stands() {
    let text = "[[step]]\ndo = \"axis-move\"\nto = [20]\nspeed = 100\n";
    let program = r6_controller::Program::read("go", text).unwrap();
    let builder =
        VirtualController::builder().program(program).unwrap().stands(r6_controller::StartState::Auto);
    let robot = builder.start().await.unwrap();
    let config = RobotConfig {
        period: std::time::Duration::from_secs(60),
        model: Some("BRTIRUS0707A".to_owned()),
        ..RobotConfig::new(name("press"), robot.address().to_string())
    };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], vec![robot]).await;
    hall.until_up("press").await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "actionSingleCycle").await.0, 200);
    // The reading of its axes counts for 1.5 s. It says 0.
    tokio::time::sleep(std::time::Duration::from_secs(2)).await;
    assert_eq!(hall.robots[0].handle().snapshot().axes[0], 20.0);
    let (status, planned) = plan(&hall, json!({ "program": SQUARE, "robot": "press" })).await;
    assert_eq!(status, 200, "{planned}");
    assert_eq!(planned["samples"][0]["axes"][0], 20.0, "{}", planned["samples"][0]);
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!(crate::support::signal(&state, "axis-0")["value"], 0.0, "it was not polled meanwhile");
}

#[tokio::test]
async fn a_plan_for_a_robot_begins_where_it_stands() {
    let text = "[[step]]\ndo = \"axis-move\"\nto = [20, 0, -10, 0, -40, 0]\nspeed = 100\n";
    let program = r6_controller::Program::read("go", text).unwrap();
    let builder =
        VirtualController::builder().program(program).unwrap().stands(r6_controller::StartState::Auto);
    let robot = builder.start().await.unwrap();
    let address = robot.address().to_string();
    let config = RobotConfig {
        period: std::time::Duration::from_millis(20),
        model: Some("BRTIRUS0707A".to_owned()),
        ..RobotConfig::new(name("press"), address)
    };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], vec![robot]).await;
    assert_eq!(hall.until_up("press").await["model"], "BRTIRUS0707A");
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "actionSingleCycle").await.0, 200);
    let stands = |state: &Value, address: &str, at: f64| {
        let value = crate::support::signal(state, address)["value"].as_f64();
        value.is_some_and(|value| (value - at).abs() < 0.001)
    };
    hall.until("press", |state| stands(state, "axis-0", 20.0) && stands(state, "axis-4", -40.0)).await;

    let (status, planned) = plan(&hall, json!({ "program": SQUARE, "robot": "press" })).await;
    assert_eq!(status, 200, "{planned}");
    let first: Vec<_> =
        planned["samples"][0]["axes"].as_array().unwrap().iter().map(|axis| axis.as_f64().unwrap()).collect();
    let wanted = [20.0, 0.0, -10.0, 0.0, -40.0, 0.0];
    assert!(first.iter().zip(wanted).all(|(axis, wanted)| (axis - wanted).abs() < 0.001), "{first:?}");
    // What is given counts before where the robot stands.
    let (_, planned) = plan(&hall, json!({ "program": SQUARE, "robot": "press", "from": [5] })).await;
    assert_eq!(planned["samples"][0]["axes"], json!([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]));

    let of_another =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("saw").into()), String::new());
    let body = json!({ "program": SQUARE, "robot": "press" });
    let (status, problem) = hall.post(&of_another.unwrap().1, "/v1/programs/plan", &body).await;
    assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")));
    let (status, problem) = plan(&hall, json!({ "program": SQUARE, "robot": "no-such" })).await;
    assert_eq!((status, &problem["code"]), (404, &json!("no_such_robot")));
    let Hall { robots, gateway, viewer, data: _data, .. } = hall;
    drop(robots);
    let begun = std::time::Instant::now();
    loop {
        let (status, problem) =
            crate::support::call(gateway.address(), &viewer, "POST", "/v1/programs/plan", Some(&body)).await;
        if (status, &problem["code"]) == (409, &json!("not_ready")) {
            break;
        }
        assert!(status == 200 && begun.elapsed() < crate::support::PATIENCE, "{problem}");
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn a_model_is_checked_shown_and_outlives_a_new_start() {
    let saw = VirtualController::start().await.unwrap();
    let hall = Hall::at(tempfile::tempdir().unwrap(), Vec::new(), vec![saw]).await;
    let path = "/v1/robots/saw";
    let address = hall.robots[0].address().to_string();
    let wanted = |model: &str| json!({ "address": address, "model": model });
    let (status, problem) = hall.call(&hall.admin, "PUT", path, Some(&wanted("R2D2"))).await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    assert!(problem["message"].as_str().unwrap().contains("GENERIC-SCARA"), "{problem}");
    assert_eq!(hall.call(&hall.admin, "PUT", path, Some(&wanted("generic-scara"))).await.0, 201);
    assert_eq!(hall.call(&hall.admin, "PUT", path, Some(&wanted("brtirus1510a"))).await.0, 204);
    let configured = hall.audit().await.into_iter().rfind(|entry| entry["what"] == "robot_configured");
    assert_eq!(configured.unwrap()["model"], "BRTIRUS1510A");
    let hall = hall.again(Vec::new(), Vec::new()).await;
    assert_eq!(hall.get(&hall.viewer, path).await["model"], "BRTIRUS1510A");
}

#[tokio::test]
async fn programs_are_kept_with_their_versions_and_an_old_version_overwrites_nothing() {
    let hall = Hall::start().await;
    let made = put(&hall, PICK, SQUARE, "").await;
    assert_eq!((made.status, &made.body["version"], &made.body["ok"]), (201, &json!(1), &json!(true)));
    assert_eq!(
        (&made.body["stored_by"], &made.body["kind"]),
        (&json!("token 3 (engineer)"), &json!("instructions"))
    );
    let first = made.etag.clone().unwrap();
    assert_eq!(made.body["etag"], first.as_str());

    // Without the version, and for an old one, nothing changes.
    let unsaid = put(&hall, PICK, "draft", "").await;
    assert_eq!((unsaid.status, &unsaid.body["code"]), (428, &json!("needs_if_match")));
    let anew = put(&hall, PICK, "draft", "If-None-Match: *\r\n").await;
    assert_eq!((anew.status, &anew.body["code"]), (412, &json!("not_this_version")));
    let changed = put(&hall, PICK, "draft = [", &format!("If-Match: {first}\r\n")).await;
    assert_eq!(
        (changed.status, &changed.body["version"], &changed.body["ok"]),
        (200, &json!(2), &json!(false))
    );
    let late = put(&hall, PICK, SQUARE, &format!("If-Match: {first}\r\n")).await;
    assert_eq!((late.status, &late.body["code"]), (412, &json!("not_this_version")));
    let unquoted = put(&hall, PICK, SQUARE, &format!("If-Match: {}\r\n", first.trim_matches('"'))).await;
    assert_eq!(
        (unquoted.status, &unquoted.body["code"]),
        (422, &json!("bad_value")),
        "it is no other version"
    );
    assert!(unquoted.body["message"].as_str().unwrap().starts_with("`if-match` has tags such as \"3-"));
    let nothing = put(&hall, "/v1/programs/other", SQUARE, &format!("If-Match: {first}\r\n")).await;
    assert_eq!(nothing.status, 412);

    // A viewer reads the versions.
    let latest = call_with(hall.gateway.address(), &hall.viewer, "GET", PICK, "", None).await;
    assert_eq!((&latest.body["program"], latest.etag), (&json!("draft = ["), changed.etag.clone()));
    let old = hall.get(&hall.viewer, &format!("{PICK}?version=1")).await;
    assert_eq!((&old["program"], &old["etag"]), (&json!(SQUARE), &json!(first)));
    let versions = hall.get(&hall.viewer, &format!("{PICK}/versions")).await;
    let numbers: Vec<_> =
        versions["versions"].as_array().unwrap().iter().map(|one| one["version"].clone()).collect();
    assert_eq!(numbers, [json!(2), json!(1)]);
    assert_eq!(hall.get(&hall.viewer, "/v1/programs").await["programs"].as_array().unwrap().len(), 1);
    for path in [
        format!("{PICK}?version=3"),
        "/v1/programs/other".to_owned(),
        "/v1/programs/other/versions".to_owned(),
    ] {
        let (status, problem) = hall.call(&hall.viewer, "GET", &path, None).await;
        assert_eq!((status, &problem["code"]), (404, &json!("no_such_program")), "{path}");
    }
    for path in ["/v1/programs/Pick", "/v1/programs/a.b", "/v1/programs/%FF"] {
        assert_eq!(put(&hall, path, SQUARE, "").await.status, 422, "{path}");
    }
    assert_eq!(put(&hall, "/v1/programs/check", SQUARE, "").await.status, 405);

    // They are there after a new start. Then the program goes.
    let hall = hall.again(Vec::new(), Vec::new()).await;
    let remove = async |head: &str| {
        call_with(hall.gateway.address(), &hall.engineer, "DELETE", PICK, head, None).await
    };
    assert_eq!(remove("").await.status, 428);
    assert_eq!(remove(&format!("If-Match: {first}\r\n")).await.status, 412);
    let present = changed.etag.unwrap();
    assert_eq!(remove(&format!("If-Match: {present}\r\n")).await.status, 204);
    assert_eq!(remove(&format!("If-Match: {present}\r\n")).await.status, 404);
    let told: Vec<_> = hall.audit().await.into_iter().filter(|entry| entry["program"] == "pick").collect();
    let whats: Vec<_> =
        told.iter().map(|entry| (entry["what"].as_str().unwrap(), &entry["version"])).collect();
    let (one, two) = (json!(1), json!(2));
    assert_eq!(whats, [("program_stored", &one), ("program_stored", &two), ("program_removed", &two)]);
    assert!(told.iter().all(|entry| entry["actor"] == "token 3 (engineer)" && entry["robot"].is_null()));
}

#[tokio::test]
async fn of_many_who_change_one_version_one_wins() {
    let hall = Hall::start().await;
    let first = put(&hall, PICK, "a = 1", "").await.etag.unwrap();
    let head = format!("If-Match: {first}\r\n");
    let texts: Vec<_> = (0..8).map(|number| format!("a = {number}")).collect();
    let all = futures_util::future::join_all(texts.iter().map(|text| put(&hall, PICK, text, &head))).await;
    // Some find no place to be checked. Nothing was stored of them.
    let count = |status| all.iter().filter(|reply| reply.status == status).count();
    assert_eq!((count(200), count(200) + count(412) + count(503)), (1, 8));
    let latest = hall.get(&hall.viewer, PICK).await;
    let winner = all.iter().position(|reply| reply.status == 200).unwrap();
    assert_eq!((&latest["version"], &latest["program"]), (&json!(2), &json!(texts[winner])));
}

#[tokio::test]
async fn a_token_for_one_robot_reads_programs_and_changes_none() {
    let hall = Hall::start().await;
    put(&hall, PICK, SQUARE, "").await;
    let only =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("press").into()), String::new());
    let only = only.unwrap().1;
    assert_eq!(hall.get(&only, PICK).await["version"], 1);
    for method in ["PUT", "DELETE"] {
        let body = json!({ "program": "x" });
        let reply =
            call_with(hall.gateway.address(), &only, method, PICK, "If-Match: *\r\n", Some(&body)).await;
        assert_eq!((reply.status, &reply.body["code"]), (403, &json!("not_allowed")), "{method}");
    }
}

#[tokio::test]
async fn the_models_tell_lengths_and_limits_of_every_arm() {
    let hall = Hall::start().await;
    let (status, told) = hall.call(&hall.viewer, "GET", "/v1/models", None).await;
    assert_eq!(status, 200, "{told}");
    let models = told["models"].as_array().unwrap();
    let names: Vec<_> = models.iter().map(|model| model["name"].as_str().unwrap()).collect();
    assert_eq!(names, r6_motion::RobotModel::names().collect::<Vec<_>>());
    let arm = &models[names.iter().position(|name| *name == "BRTIRUS0707A").unwrap()];
    assert_eq!((&arm["geometry"]["kind"], &arm["geometry"]["d1"]), (&json!("six_axis"), &json!(296.5)));
    assert_eq!(arm["axes"].as_array().unwrap().len(), 6);
    assert_eq!(arm["axes"][1]["limits"], json!([-105.0, 75.0]));
    assert_eq!((&arm["axes"][1]["sign"], &arm["axes"][1]["unit"]), (&json!(-1), &json!("deg")));
    let scara = &models[names.iter().position(|name| *name == "GENERIC-SCARA").unwrap()];
    assert_eq!((&scara["geometry"]["kind"], &scara["axes"][2]["unit"]), (&json!("scara"), &json!("mm")));
}
