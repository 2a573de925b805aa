//! Each robot is owned by one of the gateways that share a store, and another takes over.

use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};

use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use crate::gateways::{
    Here, There, audit, beside, command, database, killed, lease, own_database, settings_of, started, until,
};
use crate::raw::lists::{list, to};
use crate::support::{PATIENCE, call, call_with, commands, ready_to_start};

/// How long it takes until another gateway has the robots of an owner that was killed: 3 s until it is sure,
/// half a second until it looks, a second to connect. The rest is for a machine that is busy.
const TAKEN_OVER: Duration = Duration::from_secs(7);

/// Sends the command of [`command`] to a gateway that may hang up: `None` then.
async fn attempt(gateway: SocketAddr, token: &str, robot: &str, lease: &Value) -> Option<String> {
    let body = json!({ "command": "modifyGSPD", "arguments": ["5"], "lease": lease }).to_string();
    let head = format!(
        "POST /v1/robots/{robot}/commands HTTP/1.1\r\nHost: {gateway}\r\nConnection: close\r\n\
         Authorization: Bearer {token}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    let mut stream = TcpStream::connect(gateway).await.ok()?;
    stream.write_all((head + &body).as_bytes()).await.ok()?;
    let mut reply = String::new();
    stream.read_to_string(&mut reply).await.ok()?;
    Some(reply)
}

fn numbers(entries: &[Value], what: &str, field: &str) -> Vec<u64> {
    let of = entries.iter().filter(|entry| entry["what"] == what);
    of.map(|entry| entry[field].as_u64().unwrap()).collect()
}

/// Which of these gateways owns a robot, once one does.
async fn owner_of(robot: &str, gateways: &[&Here]) -> usize {
    let begun = Instant::now();
    loop {
        for (number, here) in gateways.iter().enumerate() {
            if here.owns(robot).await {
                return number;
            }
        }
        assert!(begun.elapsed() < PATIENCE, "no gateway owns {robot}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_robot_is_owned_by_one_gateway_and_a_second_one_gets_its_share() {
    let Some((_server, url, token)) = database("the test of two gateways").await else { return };
    let (press, saw) = (VirtualController::start().await.unwrap(), VirtualController::start().await.unwrap());
    let robots = [("press", press.address()), ("saw", saw.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    one.until_up("saw").await;
    assert_eq!((one.gateway.owned(), one.gateway.robots()), (Some(2), 2));
    // Somebody works with the press, so the saw is given away.
    let key = one.lease("press").await;
    assert_eq!(command(one.gateway.address(), &token, "press", &key).await.0, 200);
    let saws = one.lease("saw").await;
    let (status, stopped) = one.call("POST", "/v1/robots/saw/stop", None).await;
    assert_eq!(status, 200, "{stopped}");
    let given_back = json!({ "lease": saws });
    assert_eq!(one.call("DELETE", "/v1/robots/saw/lease", Some(&given_back)).await.0, 204);

    let other = Here::start(&url, &token, &robots).await;
    let state = other.until_up("saw").await;
    assert_eq!(state["stopped"], true, "stops go with their robots");
    assert_eq!((one.gateway.owned(), other.gateway.owned()), (Some(1), Some(1)));
    assert_eq!(saw.handle().snapshot().connections, 1);
    let next = other.lease("saw").await;
    assert!(next["number"].as_u64() > saws["number"].as_u64(), "{next}");
    assert_eq!(command(one.gateway.address(), &token, "press", &key).await.0, 200, "the lease goes on");
    for path in ["/v1/audit", "/v1/tokens", "/v1/users", "/v1/programs", "/v1/settings", "/readyz"] {
        for here in [&one, &other] {
            assert_eq!(here.call("GET", path, None).await.0, 200, "{path}");
        }
    }
    assert_eq!(
        call(other.gateway.address(), "r6_no", "GET", "/v1/robots/press", None).await.0,
        401,
        "who asks first"
    );
    let (status, missing) = other.call("GET", "/v1/robots/pres", None).await;
    assert_eq!((status, &missing["code"]), (404, &json!("no_such_robot")));
    // The rest goes over, with all that holds for it.
    let begun = Instant::now();
    let one_address = one.gateway.address().to_string();
    one.gateway.shutdown().await.unwrap();
    other.until_up("press").await;
    assert!(begun.elapsed() < Duration::from_secs(5), "no gateway waits for a gateway that ended in order");
    let last = other.lease("press").await;
    assert!(last["number"].as_u64() > key["number"].as_u64(), "{last}");
    let entries = audit(&other, &url).await;
    let of = |what: &str| -> Vec<&str> {
        let own = entries.iter().filter(|entry| entry["what"] == what);
        own.map(|entry| entry["url"].as_str().unwrap()).collect()
    };
    let (started, ended) = (of("gateway_started"), of("gateway_ended"));
    assert!(started.len() == 2 && started[0] == ended[0] && started[1] != ended[0], "{started:?}");
    assert!(ended.len() == 1 && ended[0].ends_with(&one_address), "{ended:?}");
    assert_eq!(other.call("GET", "/v1/audit/head", None).await.0, 200);
    other.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_that_is_moved_by_somebody_else_is_not_given_away() {
    let Some((_server, url, token)) = database("the test of a list that runs").await else { return };
    let (press, saw) = (ready_to_start().await, VirtualController::start().await.unwrap());
    // Some other program sends a list, which runs for more than ten seconds.
    let mut program = TcpStream::connect(press.address()).await.unwrap();
    program.write_all(list(true, &[to("40", "1")]).as_bytes()).await.unwrap();
    let command = r#"{"dsID": "www.hc-system.com.HCRemoteCommand", "reqType": "command", "packID": "2", "cmdData": ["startButton"]}"#;
    program.write_all(command.as_bytes()).await.unwrap();
    until(|| press.handle().snapshot().moving, "the arm moves").await;
    let robots = [("press", press.address()), ("saw", saw.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    one.until_up("saw").await;
    let other = Here::start(&url, &token, &robots).await;
    other.until_up("saw").await;
    assert!(press.handle().snapshot().moving, "it was moving all the time");
    assert!(one.owns("press").await);
    one.gateway.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn robots_that_are_added_over_the_api_go_to_the_gateway_that_has_the_fewest() {
    let Some((_server, url, token)) = database("the test of added robots").await else { return };
    let press = VirtualController::start().await.unwrap();
    let robots = [("press", press.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    let other = Here::start(&url, &token, &robots).await;
    let saw = VirtualController::start().await.unwrap();
    let wanted = json!({ "address": saw.address().to_string() });
    assert_eq!(one.call("PUT", "/v1/robots/saw", Some(&wanted)).await.0, 201);
    other.until_up("saw").await;
    let taken = json!({ "address": press.address().to_string() });
    let (status, problem) = one.call("PUT", "/v1/robots/third", Some(&taken)).await;
    assert_eq!((status, &problem["code"]), (409, &json!("address_taken")));
    let slower = json!({ "address": saw.address().to_string(), "period_ms": 500 });
    assert_eq!(other.call("PUT", "/v1/robots/saw", Some(&slower)).await.0, 204);
    assert_eq!(other.until_up("saw").await["period_ms"], 500);
    assert_eq!(other.call("DELETE", "/v1/robots/saw", None).await.0, 204);
    let begun = Instant::now();
    while one.call("GET", "/v1/robots/saw", None).await.0 != 404 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(saw.handle().snapshot().connections, 0);
    one.gateway.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_arm_gets_no_second_name_at_a_gateway_that_does_not_own_it() {
    let Some((_server, url, token)) = database("the test of an arm with two names").await else { return };
    let press = ready_to_start().await;
    let one = Here::start(&url, &token, &[("press", press.address())]).await;
    one.until_up("press").await;
    let other = Here::start(&url, &token, &[("press", press.address())]).await;
    assert_eq!(one.call("POST", "/v1/robots/press/stop", None).await.0, 200);
    let renamed = || settings_of(&url, Path::new("/"), &[("drill".to_owned(), press.address())]).robots;
    let refused = other.gateway.reload(renamed()).await.unwrap_err();
    assert_eq!(refused.code, r6_api::Code::Stopped, "the stop holds at another gateway: {refused:?}");
    let key = one.lease("press").await;
    let clear = json!({ "lease": key });
    assert_eq!(one.call("POST", "/v1/robots/press/clear-stopped", Some(&clear)).await.0, 204);

    // Without a stop it reads the file, and waits until the owner has read it, too.
    other.gateway.reload(renamed()).await.unwrap();
    assert_eq!(one.call("POST", "/v1/robots/press/stop", None).await.0, 200);
    tokio::time::sleep(Duration::from_secs(3)).await;
    let (status, problem) = other.call("GET", "/v1/robots/drill", None).await;
    assert_eq!((status, &problem["code"]), (503, &json!("no_owner")), "{problem}");
    let (_, told) = other.call("GET", "/v1/alarms", None).await;
    assert_eq!(told["not_known"], json!(["drill"]), "its owner tells of the press: {told}");
    // No gateway can stop it under this name, and that is said in time.
    let stopping = Instant::now();
    let (status, problem) = other.call("POST", "/v1/robots/drill/stop", None).await;
    assert_eq!((status, &problem["code"]), (504, &json!("not_stopped")), "{problem}");
    let took = stopping.elapsed();
    assert!((Duration::from_secs(6)..Duration::from_secs(9)).contains(&took), "{took:?}");
    assert_eq!(press.handle().snapshot().connections, 1);
    let (_, state) = one.call("GET", "/v1/robots/press", None).await;
    assert_eq!((&state["link"], &state["stopped"]), (&json!("up"), &json!(true)));
    // The file of this gateway has it no more. Its owner is asked all the same.
    let (status, stopped) = other.call("POST", "/v1/robots/press/stop", None).await;
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    assert_eq!(one.gateway.reload(renamed()).await.unwrap_err().code, r6_api::Code::Stopped);
    // The owner ends: the gateway with the new file does not take the arm that was stopped.
    one.gateway.shutdown().await.unwrap();
    tokio::time::sleep(Duration::from_secs(3)).await;
    assert_eq!(press.handle().snapshot().connections, 0);
    // Under its own name it was looked at. Now it gets the other one.
    let one = Here::start(&url, &token, &[("press", press.address())]).await;
    assert_eq!(one.until_up("press").await["stopped"], true);
    let key = one.lease("press").await;
    let clear = json!({ "lease": key });
    assert_eq!(one.call("POST", "/v1/robots/press/clear-stopped", Some(&clear)).await.0, 204);
    one.gateway.reload(renamed()).await.unwrap();
    let begun = Instant::now();
    while !one.owns("drill").await && !other.owns("drill").await {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    one.gateway.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn others_take_the_robots_of_a_gateway_that_was_killed_and_nothing_is_lost() {
    let Some((_server, url, token)) = database("the test of a killed owner").await else { return };
    let mut controllers = Vec::new();
    for _ in 0..3 {
        controllers.push(ready_to_start().await);
    }
    let names = ["drill", "press", "saw"];
    let robots: Vec<_> = names.into_iter().zip(controllers.iter().map(|robot| robot.address())).collect();
    let mut there = There::start(&url, &robots).await;
    let (one, two) = tokio::join!(Here::start(&url, &token, &robots), Here::start(&url, &token, &robots));
    let key = lease(there.address, &token, "press").await;
    let mut acknowledged = Vec::new();
    for _ in 0..5 {
        let (status, done) = command(there.address, &token, "press", &key).await;
        assert_eq!(status, 200, "{done}");
        acknowledged.push(done["command_id"].as_u64().unwrap());
    }
    let killed = Instant::now();
    there.child.kill().unwrap();
    there.child.wait().unwrap();
    let mut had = [0, 0];
    let mut of_press = 0;
    for robot in names {
        let owner = owner_of(robot, &[&one, &two]).await;
        [&one, &two][owner].until_up(robot).await;
        had[owner] += 1;
        if robot == "press" {
            of_press = owner;
        }
    }
    let took = killed.elapsed();
    assert!(took < TAKEN_OVER, "{took:?}");
    assert!(took > Duration::from_secs(2), "{took:?}: it may have lived");
    assert!(had == [1, 2] || had == [2, 1], "they share them out: {had:?}");
    assert!(controllers.iter().all(|robot| robot.handle().snapshot().connections <= 2));
    let here = [&one, &two][of_press];
    let next = here.lease("press").await;
    assert!(next["number"].as_u64() > key["number"].as_u64(), "{next}");
    assert_eq!(command(here.gateway.address(), &token, "press", &next).await.0, 200);
    let entries = audit(here, &url).await;
    let intents = numbers(&entries, "command_intent", "number");
    assert!(acknowledged.iter().all(|number| intents.contains(number)), "{acknowledged:?} of {intents:?}");
    let outcomes = numbers(&entries, "command_outcome", "intent");
    assert!(intents.iter().all(|number| outcomes.contains(number)), "{intents:?}: {outcomes:?}");
    one.gateway.shutdown().await.unwrap();
    two.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_owner_that_was_frozen_changes_nothing_when_it_goes_on() {
    let Some((_server, url, token)) = database("the test of a frozen owner").await else { return };
    let (robot, saw) = (ready_to_start().await, ready_to_start().await);
    let robots = [("press", robot.address()), ("saw", saw.address())];
    let there = There::start(&url, &robots).await;
    let key = lease(there.address, &token, "press").await;
    let here = Here::start(&url, &token, &robots).await;
    // Commands come again and again, also while it is frozen.
    let (gateway, caller) = (there.address, token.clone());
    let asking = tokio::spawn(async move {
        let mut asked = tokio::task::JoinSet::new();
        for _ in 0..400 {
            let (caller, key) = (caller.clone(), key.clone());
            asked.spawn(async move { attempt(gateway, &caller, "press", &key).await });
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        asked.join_all().await
    });
    let mut log = robot.handle().log();
    tokio::time::sleep(Duration::from_millis(300)).await;
    there.signal("STOP");
    here.until_up("press").await;
    here.until_up("saw").await;
    assert!(!commands(&mut log).is_empty(), "it sent some before");
    // Robots that somebody works with are not given to the gateway that goes on.
    let next = here.lease("press").await;
    here.lease("saw").await;
    let before = audit(&here, &url).await.len();
    there.signal("CONT");
    let answers = asking.await.unwrap();
    let answers: Vec<_> = answers.into_iter().flatten().collect();
    let done = answers.iter().filter(|answer| answer.starts_with("HTTP/1.1 200")).count();
    assert!(done > 0 && done < answers.len(), "{done} of {}", answers.len());
    // It passes them on to the new owner, which does not know the lease.
    assert!(answers.iter().any(|answer| answer.contains("no_lease")), "{:?}", answers.last());
    assert_eq!(commands(&mut log), Vec::<String>::new(), "no frame under the old fence was accepted");
    // And the other way round: this gateway has the robots, and the log is its own.
    let entries = audit(&here, &url).await;
    // The new owner refuses what is passed on to it. The old one did nothing any more, but tells that its
    // leases ended.
    let is_an_end = |entry: &Value| entry["what"] == "lease_ended" && entry["cause"] == "owner_changed";
    let is_its_own =
        |entry: &&Value| entry["robot"].is_string() && entry["what"] != "refused" && !is_an_end(entry);
    let of_robots = entries[before..].iter().filter(is_its_own);
    assert_eq!(of_robots.collect::<Vec<_>>(), Vec::<&Value>::new(), "the old owner did nothing");
    assert_eq!(command(here.gateway.address(), &token, "press", &next).await.0, 200);
    assert_eq!(commands(&mut log), ["modifyGSPD"]);
    here.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_gateway_that_was_frozen_while_it_began_with_a_robot_takes_it_again_at_once() {
    let Some((server, url, _token)) = database("the test of a frozen begin").await else { return };
    let (server, press) = (std::sync::Arc::new(server), ready_to_start().await);
    let sql = |text: &'static str| {
        let (server, url) = (std::sync::Arc::clone(&server), url.clone());
        move || server.sql(&url, text)
    };
    // What it writes once it has taken the robot takes a second.
    let slow = "CREATE FUNCTION r6_gateway.slow() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
         IF TG_OP = 'INSERT' OR NEW.gateway IS DISTINCT FROM OLD.gateway THEN NEW.address := NULL;
         ELSE PERFORM pg_sleep(1); END IF; RETURN NEW; END $$;
         CREATE TRIGGER slow BEFORE INSERT OR UPDATE ON r6_gateway.owner FOR EACH ROW
         EXECUTE FUNCTION r6_gateway.slow();";
    beside(sql(slow)).await;
    let (there, address) = There::spawn(&url, &[("press", press.address())]);
    let taken = "SELECT count(*) FROM r6_gateway.owner WHERE robot = 'press' AND gateway IS NOT NULL";
    let begun = Instant::now();
    while beside(sql(taken)).await != "1" {
        assert!(begun.elapsed() < PATIENCE, "it does not take the robot");
    }
    let writes =
        "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() AND wait_event = 'PgSleep'";
    while beside(sql(writes)).await != "1" {
        assert!(begun.elapsed() < PATIENCE, "it does not write");
    }
    there.signal("STOP");
    // The server ends its transaction, 2 s after the last statement.
    let open =
        "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() AND pid <> pg_backend_pid()
         AND state <> 'idle'";
    while beside(sql(open)).await != "0" {
        assert!(begun.elapsed() < PATIENCE, "the transaction goes on");
    }
    beside(sql("DROP TRIGGER slow ON r6_gateway.owner")).await;
    there.signal("CONT");
    let begun = Instant::now();
    address.await;
    let took = begun.elapsed();
    assert!(took < Duration::from_millis(2_500), "no other gateway can have it, and it waited: {took:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_gateway_lets_go_of_the_robots_while_the_server_is_away_and_loses_nothing() {
    // A run of minutes.
    let step =
        |angle| format!("[[instruction]]\ndo = \"axis-move\"\nto = [{angle}, 0, 0, 0, 0, 0]\nspeed = 1\n");
    let program: String = [60, -60, 60, -60].map(step).concat();
    let made = own_database("the test of a killed server").await;
    let Some((server, url, token)) = made else { return };
    let robot = VirtualController::start().await.unwrap();
    let here = Here::start(&url, &token, &[("press", robot.address())]).await;
    here.until_up("press").await;
    let key = here.lease("press").await;
    let (status, done) = command(here.gateway.address(), &token, "press", &key).await;
    assert_eq!(status, 200, "{done}");
    let body = json!({ "program": program, "lease": key });
    let path = "/v1/robots/press/programs/run";
    let run =
        call_with(here.gateway.address(), &token, "POST", path, "Idempotency-Key: one\r\n", Some(&body))
            .await;
    assert_eq!(run.status, 202, "{}", run.body);
    until(|| robot.handle().snapshot().moving, "the arm moves").await;
    let server = killed(server).await;
    let mut log = robot.handle().log();
    let begun = Instant::now();
    until(|| here.gateway.owned() == Some(0), "it lets go").await;
    loop {
        let (status, problem) = command(here.gateway.address(), &token, "press", &key).await;
        assert_eq!(status, 503, "{problem}");
        if problem["code"] == "no_owner" {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(5), "{problem}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    until(|| robot.handle().snapshot().connections == 0, "the connection ends").await;
    assert!(!robot.handle().snapshot().moving, "the arm was stopped before");
    let took = begun.elapsed();
    assert!(took < Duration::from_secs(5), "{took:?}");
    let _server = started(server).await;
    here.until_up("press").await;
    // It stops the arm again when it owns it: what became of the list is not known.
    let sent = commands(&mut log);
    assert!(sent.iter().all(|command| command == "actionStop"), "{sent:?}");
    let next = here.lease("press").await;
    assert!(next["number"].as_u64() > key["number"].as_u64(), "{next}");
    let entries = audit(&here, &url).await;
    assert!(numbers(&entries, "command_intent", "number").contains(&done["command_id"].as_u64().unwrap()));
    here.gateway.shutdown().await.unwrap();
}
