//! Requests and stops that are passed on while their owner freezes, starts again, or the database is silent.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use r6_gateway::{Gateway, GatewaySettings};
use serde_json::{Value, json};
use tokio::task::JoinHandle;

use crate::gateways::{Here, There, beside, command, database, lease, settings_of};
use crate::support::{PATIENCE, call, ready_to_start};

/// Stops a robot beside the test. Returns how long that took, too.
fn stop(gateway: SocketAddr, token: &str, robot: &str) -> JoinHandle<(u16, Value, Duration)> {
    let (token, path) = (token.to_owned(), format!("/v1/robots/{robot}/stop"));
    tokio::spawn(async move {
        let begun = Instant::now();
        let (status, answer) = call(gateway, &token, "POST", &path, None).await;
        (status, answer, begun.elapsed())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stop_does_not_wait_beside_an_owner_that_has_the_robot_again() {
    let Some((_server, url, token)) = database("the test of an owner that was frozen for a moment").await
    else {
        return;
    };
    let press = ready_to_start().await;
    let robots = [("press", press.address())];
    let there = There::start(&url, &robots).await;
    let here = Here::start(&url, &token, &robots).await;
    here.call("GET", "/v1/robots/press", None).await;
    there.signal("STOP");
    // Its connection to the robot ends after 2 s, and no gateway takes the robot before 3 s.
    tokio::time::sleep(Duration::from_millis(1_200)).await;
    let stopping = stop(here.gateway.address(), &token, "press");
    tokio::time::sleep(Duration::from_millis(1_000)).await;
    there.signal("CONT");
    let going_on = Instant::now();
    let (status, stopped, _) = stopping.await.unwrap();
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    let took = going_on.elapsed();
    assert!(took < Duration::from_secs(3), "{took:?}");
    here.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_gateway_that_starts_again_under_its_address_refuses_no_caller_and_the_stop_comes_to_the_robot() {
    let Some((_server, url, token)) = database("the test of a gateway that starts again").await else {
        return;
    };
    let press = ready_to_start().await;
    let robots = [("press", press.address())];
    let mut there = There::start(&url, &robots).await;
    let here = Here::start(&url, &token, &robots).await;
    assert_eq!(here.call("GET", "/v1/robots/press", None).await.0, 200);
    there.child.kill().unwrap();
    there.child.wait().unwrap();
    let data = tempfile::tempdir().unwrap();
    let all = [("press".to_owned(), press.address())];
    let settings = GatewaySettings { listen: there.address, ..settings_of(&url, data.path(), &all) };
    let again = Gateway::start(settings).await.unwrap();
    let stopping = stop(here.gateway.address(), &token, "press");
    let begun = Instant::now();
    let mut without = 0;
    loop {
        let (status, answer) = here.call("GET", "/v1/robots/press", None).await;
        match (status, answer["code"].as_str()) {
            (200, _) if answer["link"] == "up" => break,
            (200, _) => {}
            (503, Some("no_owner")) => without += 1,
            _ => panic!("{status} {answer}"),
        }
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(without > 0, "it was asked while the last owner still seemed to live");
    let (status, stopped, took) = stopping.await.unwrap();
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    assert!(took < Duration::from_secs(8), "{took:?}");
    again.shutdown().await.unwrap();
    here.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_pause_of_the_database_is_not_another_owner() {
    let Some((server, url, token)) = database("the test of a pause of the database").await else { return };
    let press = ready_to_start().await;
    let robots = [("press", press.address())];
    let there = There::start(&url, &robots).await;
    let here = Here::start(&url, &token, &robots).await;
    let key = lease(here.gateway.address(), &token, "press").await;
    let (at, asked) = (here.gateway.address(), token.clone());
    let asking = tokio::spawn(async move { command(at, &asked, "press", &key).await });
    // The owner is silent for a moment, so that the command is under way while looks fail.
    there.signal("STOP");
    let paused = beside(move || {
        let text =
            "BEGIN; LOCK TABLE r6_gateway.gateway IN ACCESS EXCLUSIVE MODE; SELECT pg_sleep(1.3); COMMIT";
        server.sql(&url, text)
    });
    tokio::join!(paused, async {
        tokio::time::sleep(Duration::from_millis(1_300)).await;
        there.signal("CONT");
    });
    let (status, answer) = asking.await.unwrap();
    let message = answer["message"].as_str().unwrap_or_default();
    assert!(
        matches!(status, 200 | 409 | 503) && !message.contains("another owner by now"),
        "{status} {answer}"
    );
    here.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_waits_for_a_frozen_owner_takes_no_place_of_others() {
    let Some((_server, url, token)) = database("the test of places behind a frozen owner").await else {
        return;
    };
    let (press, saw) = (ready_to_start().await, ready_to_start().await);
    let robots = [("press", press.address()), ("saw", saw.address())];
    let there = There::start(&url, &robots[..1]).await;
    let other = Here::start(&url, &token, &robots).await;
    other.until_up("saw").await;
    let here = Here::start(&url, &token, &robots).await;
    assert_eq!(here.call("GET", "/v1/robots/saw", None).await.0, 200);
    assert_eq!(here.call("GET", "/v1/robots/press", None).await.0, 200);
    there.signal("STOP");
    let stops: Vec<_> = (0..40).map(|_| stop(here.gateway.address(), &token, "press")).collect();
    let viewer = beside(move || {
        let at = r6_gateway::At::Database(r6_gateway::Database::parse(&url).unwrap());
        r6_gateway::make_token(at, r6_api::gateway::Role::Viewer, None, String::new()).unwrap().1
    });
    let viewer = viewer.await;
    let reads: Vec<_> = (0..80)
        .map(|_| {
            let (at, viewer) = (here.gateway.address(), viewer.clone());
            tokio::spawn(async move { call(at, &viewer, "GET", "/v1/robots/press", None).await.0 })
        })
        .collect();
    tokio::time::sleep(Duration::from_millis(500)).await;
    let (status, _) = call(here.gateway.address(), &viewer, "GET", "/v1/robots/saw", None).await;
    assert_eq!(status, 200, "the viewer sees other robots, too");
    assert_eq!(here.call("GET", "/v1/robots/saw", None).await.0, 200);
    let (status, stopped, took) = stop(here.gateway.address(), &token, "saw").await.unwrap();
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    assert!(took < Duration::from_secs(2), "{took:?}");
    let mut confirmed = 0;
    for stop in stops {
        let (status, answer, took) = stop.await.unwrap();
        assert!(matches!(status, 200 | 504), "{answer}");
        assert!(took < Duration::from_secs(20), "{took:?}");
        confirmed += usize::from(status == 200);
    }
    assert!(confirmed > 0, "the next owner stopped it");
    for read in reads {
        read.await.unwrap();
    }
    other.gateway.shutdown().await.unwrap();
    here.gateway.shutdown().await.unwrap();
}
