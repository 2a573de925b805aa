//! The figures of production.

use std::time::{Duration, Instant};

use r6_controller::PanelAction;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::happenings::with_counter;
use crate::support::{Hall, PATIENCE};

const PRODUCTION: &str = "/v1/robots/press/production";

impl Hall {
    async fn until_production(&self, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let figures = self.get(&self.viewer, PRODUCTION).await;
            if is(&figures) {
                return figures;
            }
            assert!(begun.elapsed() < PATIENCE, "{figures:#}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("{of} is no number"))
}

#[tokio::test]
async fn states_alarms_and_parts_are_those_that_were_seen() {
    let hall = with_counter(VirtualController::start().await.unwrap()).await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "modifyCounter 0 4 -1").await.0, 200);
    hall.until_production(|figures| figures["parts"]["count"] == 4).await;
    hall.robots[0].handle().operate(&PanelAction::EmergencyStop).unwrap();
    let figures = hall.until_production(|figures| number(&figures["states"]["alarm_ms"]) > 300.0).await;
    let states = &figures["states"];
    let names = ["running_ms", "waiting_ms", "alarm_ms", "manual_ms", "other_ms"];
    let sum: f64 = names.iter().map(|name| number(&states[name])).sum();
    assert!((sum - number(&figures["seen_ms"])).abs() < 0.01, "{figures:#}");
    // The range is a day, and the gateway has been there for seconds.
    let range = number(&figures["seen_ms"]) + number(&figures["unseen_ms"]);
    assert!((range - 86_400_000.0).abs() < 0.01, "{figures:#}");
    assert!(number(&figures["unseen_ms"]) > 86_000_000.0, "{figures:#}");
    assert!(number(&states["running_ms"]) > 0.0, "{figures:#}");
    let availability = &figures["availability"];
    assert_eq!(availability["definition"], "running_of_seen_time");
    let expected = number(&states["running_ms"]) / number(&figures["seen_ms"]);
    assert!((number(&availability["value"]) - expected).abs() < 1e-6, "{figures:#}");
    let alarm = &figures["alarms"]["top"][0];
    assert_eq!(
        (&alarm["code"], &alarm["count"], &figures["alarms"]["codes"]),
        (&json!(7), &json!(1), &json!(1))
    );
    assert_eq!(alarm["lost_ms"], states["alarm_ms"]);
    assert_eq!(figures["parts"]["computed_from"], json!(["counter-0", "parts", "parts_reset"]));
    assert_eq!((&figures["cycles"]["count"], &figures["cycles"]["p50_ms"]), (&json!(0), &json!(null)));
}

#[tokio::test]
async fn a_robot_that_is_gone_does_not_run_on_in_the_figures() {
    let mut hall = Hall::start().await;
    hall.until_production(|figures| number(&figures["states"]["running_ms"]) > 200.0).await;
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    hall.until_events("kind=link_lost", |events| !events.is_empty()).await;
    let first = hall.get(&hall.viewer, PRODUCTION).await;
    tokio::time::sleep(Duration::from_millis(300)).await;
    let second = hall.get(&hall.viewer, PRODUCTION).await;
    assert_eq!(first["states"], second["states"]);
    assert_eq!(first["parts"]["count"], json!(null), "no counter of parts");
}

#[tokio::test]
async fn every_mistake_of_a_range_is_told() {
    let hall = Hall::start().await;
    for (query, part) in [
        ("from=2026-01-01T00:00:00Z&to=2026-02-01T00:00:01Z", "at most 31 days"),
        ("from=9999-01-01T00:00:00Z", "from is a time before to"),
        ("to=now", "to: `now`"),
        ("shift=early", "shift"),
    ] {
        let (status, problem) = hall.call(&hall.viewer, "GET", &format!("{PRODUCTION}?{query}"), None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{query}: {problem}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{query}: {problem}");
    }
    // Nothing was seen then.
    let path = format!("{PRODUCTION}?from=2020-01-01T00:00:00Z&to=2020-01-31T00:00:00Z");
    let figures = hall.get(&hall.viewer, &path).await;
    assert_eq!((&figures["seen_ms"], &figures["availability"]["value"]), (&json!(0.0), &json!(null)));
}
