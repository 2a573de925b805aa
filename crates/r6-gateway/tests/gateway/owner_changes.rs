//! What gateways that share a database say, keep and refuse when one takes the place of another.

use std::time::{Duration, Instant};

use r6_sim::VirtualController;

use crate::gateways::{Here, audit, database, killed, own_database, started, until};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_other_arm_gets_the_name_of_a_robot_while_the_files_of_gateways_differ() {
    let Some((_server, url, token)) = database("the test of files that differ").await else { return };
    let mut arms = Vec::new();
    for _ in 0..5 {
        arms.push(VirtualController::start().await.unwrap());
    }
    let at = |number: usize| arms[number].address();
    let right = [("press", at(0)), ("saw", at(1)), ("drill", at(2)), ("lathe", at(3))];
    let wrong = [("press", at(4)), ("saw", at(1)), ("drill", at(2)), ("lathe", at(3))];
    let first = Here::start(&url, &token, &right).await;
    for (name, _) in right {
        first.until_up(name).await;
    }
    let differing = Here::start(&url, &token, &wrong).await;
    // Longer than a gateway has to live before it is given robots.
    tokio::time::sleep(Duration::from_millis(6_500)).await;
    assert_eq!((first.gateway.owned(), differing.gateway.owned()), (Some(4), Some(0)), "none is given away");
    // Free robots go to the gateway that has the fewest, and after a second to any.
    let same = Here::start(&url, &token, &right).await;
    first.gateway.shutdown().await.unwrap();
    let state = same.until_up("press").await;
    assert_eq!(state["address"], at(0).to_string());
    until(|| same.gateway.owned().zip(differing.gateway.owned()).is_some_and(|(a, b)| a + b == 4), "all")
        .await;
    assert!(differing.gateway.owned() > Some(0), "it takes what it knows as the others do");
    assert_eq!(arms[4].handle().snapshot().connections, 0, "the other arm has nothing to do with it");
    // Now the only file that is left says so: it is taken there, and the audit log tells of it.
    same.gateway.shutdown().await.unwrap();
    let state = differing.until_up("press").await;
    assert_eq!(state["address"], at(4).to_string());
    let begun = Instant::now();
    loop {
        let entries = audit(&differing, &url).await;
        let moved = entries.iter().find(|entry| entry["what"] == "robot_configured");
        if moved.is_some_and(|entry| entry["address"] == at(4).to_string()) {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(5), "{entries:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    differing.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stop_while_the_server_is_away_gets_its_entries_afterwards() {
    let made = own_database("the test of a stop without a database").await;
    let Some((server, url, token)) = made else { return };
    let robot = VirtualController::start().await.unwrap();
    let here = Here::start(&url, &token, &[("press", robot.address())]).await;
    here.until_up("press").await;
    let server = killed(server).await;
    let (status, told) = here.call("POST", "/v1/robots/press/stop", None).await;
    // It is not confirmed that another gateway would know of it.
    assert_eq!((status, &told["code"]), (503, &"store_unavailable".into()), "{told}");
    let message = told["message"].as_str().unwrap();
    for part in ["the robot was stopped and the arm stands", "at another gateway it may not hold"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(!robot.handle().snapshot().moving);
    until(|| here.gateway.owned() == Some(0), "it lets go").await;
    let _server = started(server).await;
    let state = here.until_up("press").await;
    assert_eq!((&state["stopped"], &state["stopped_by"]["by"]), (&true.into(), &"token 1".into()), "{state}");
    let begun = Instant::now();
    loop {
        let entries = audit(&here, &url).await;
        let count = |what: &str| entries.iter().filter(|entry| entry["what"] == what).count();
        if (count("stop_began"), count("stop")) == (1, 1) {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(5), "once each: {entries:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    here.gateway.shutdown().await.unwrap();
}
