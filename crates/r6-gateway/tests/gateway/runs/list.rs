//! The list of the runs of a robot.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{long, moves};
use crate::support::{Hall, PATIENCE};

const RUNS: &str = "/v1/robots/press/runs";

#[tokio::test]
async fn the_runs_of_a_robot_are_listed_as_they_stand_newest_first() {
    let hall = Hall::start().await;
    let list = async |query: &str| {
        let (status, list) = hall.call(&hall.viewer, "GET", &format!("{RUNS}{query}"), None).await;
        assert_eq!(status, 200, "{list}");
        list
    };
    assert_eq!(list("").await, json!({ "runs": [], "next_before": null }));
    let lease = hall.long_lease(60).await;
    let first = hall.begin(&lease, &moves(100, &[4.0])).await;
    let done = hall.until_over(first).await;
    let second = hall.begin(&lease, &long()).await;
    let numbers = |list: &Value| -> Vec<u64> {
        list["runs"].as_array().unwrap().iter().map(|run| run["run_id"].as_u64().unwrap()).collect()
    };
    // The one under way has more than the store, which has its begin and its end.
    let begun = Instant::now();
    let all = loop {
        let all = list("").await;
        if all["runs"][0]["accepted"].as_u64() > Some(0) {
            break all;
        }
        assert!(begun.elapsed() < PATIENCE, "{all:#}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    };
    assert_eq!((numbers(&all), &all["next_before"]), (vec![second, first], &json!(null)));
    assert_eq!((&all["runs"][0]["state"], &all["runs"][1]), (&json!("running"), &done));
    let newest = list("?limit=1").await;
    assert_eq!((numbers(&newest), &newest["next_before"]), (vec![second], &json!(second)));
    assert_eq!(numbers(&list(&format!("?before={second}")).await), [first]);
    for (wrong, says) in
        [("?limit=0", "limit is from 1 to 1000"), ("?after=1", "before"), ("?before=x", "before")]
    {
        let (status, problem) = hall.call(&hall.viewer, "GET", &format!("{RUNS}{wrong}"), None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{problem}");
        assert!(problem["message"].as_str().unwrap().contains(says), "{problem}");
    }
}
