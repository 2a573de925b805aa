//! What gateways that share a database say, keep and refuse when one takes the place of another.

use std::time::{Duration, Instant};

use r6_sim::VirtualController;
use r6_testkit::postgres::Server;

use crate::owner::{Here, admin, audit, beside, database, until};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_other_arm_gets_the_name_of_a_robot_while_the_files_of_gateways_differ() {
    let Some((_server, url, token)) = database("the test of files that differ").await else { return };
    let (press, another) =
        (VirtualController::start().await.unwrap(), VirtualController::start().await.unwrap());
    let (right, wrong) = ([("press", press.address())], [("press", another.address())]);
    let first = Here::start(&url, &token, &right).await;
    first.until_up("press").await;
    let differing = Here::start(&url, &token, &wrong).await;
    let same = Here::start(&url, &token, &right).await;
    // Longer than a gateway has to live before it is given robots, and than a free robot is left to others.
    tokio::time::sleep(Duration::from_millis(6_500)).await;
    assert!(first.owns("press").await, "no robot is given away while files differ");
    first.gateway.shutdown().await.unwrap();
    let state = same.until_up("press").await;
    assert_eq!(state["address"], press.address().to_string());
    assert_eq!(another.handle().snapshot().connections, 0, "the other arm has nothing to do with it");
    // Now the only file that is left says so: it is taken there, and the audit log tells of it.
    same.gateway.shutdown().await.unwrap();
    let state = differing.until_up("press").await;
    assert_eq!(state["address"], another.address().to_string());
    let begun = Instant::now();
    loop {
        let entries = audit(&differing, &url).await;
        let moved = entries.iter().find(|entry| entry["what"] == "robot_configured");
        if moved.is_some_and(|entry| entry["address"] == another.address().to_string()) {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(5), "{entries:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    differing.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stop_while_the_server_is_away_gets_its_entries_afterwards() {
    let made = beside(|| {
        let server = Server::own("the test of a stop without a database")?;
        let url = server.database();
        Some((server, url))
    });
    let Some((mut server, url)) = made.await else { return };
    let token = admin(&url).await;
    let robot = VirtualController::start().await.unwrap();
    let here = Here::start(&url, &token, &[("press", robot.address())]).await;
    here.until_up("press").await;
    let server = beside(move || {
        server.kill();
        server
    });
    let mut server = server.await;
    let (status, told) = here.call("POST", "/v1/robots/press/stop", None).await;
    // It is not confirmed that another gateway would know of it.
    assert_eq!((status, &told["code"]), (503, &"store_unavailable".into()), "{told}");
    until(|| here.gateway.owned() == Some(0), "it lets go").await;
    tokio::time::sleep(Duration::from_secs(2)).await;
    let server = beside(move || {
        server.start();
        server
    });
    let _server = server.await;
    here.until_up("press").await;
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
