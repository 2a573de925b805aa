//! The numbers of the gateway, in the text format of Prometheus.

use std::fmt::Write as _;
use std::sync::Arc;

use axum::extract::State as Of;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use r6_api::gateway::RobotLink;

use super::State;
use super::caller::Caller;
use super::described::OfToken;
use crate::fleet::station::Station;

/// The text format of Prometheus.
const FORMAT: &str = "text/plain; version=0.0.4; charset=utf-8";

/// The numbers of the robots that the token may see, in the text format of Prometheus.
#[utoipa::path(get, path = "/metrics", responses(
    (status = 200, description = "The numbers", content_type = "text/plain", body = String),
    OfToken,
))]
pub async fn metrics(caller: Caller, Of(state): Of<State>) -> impl IntoResponse {
    let stations = state.fleet.stations();
    let seen: Vec<_> = stations.iter().filter(|station| caller.token.grant.covers(station.name())).collect();
    let mut text = String::new();
    let flag = u64::from;
    family(&mut text, "r6_gateway_robot_up", "gauge", "Whether the robot answers.");
    let summaries: Vec<_> = seen.iter().map(|station| station.summary()).collect();
    for robot in &summaries {
        sample(&mut text, "r6_gateway_robot_up", &robot.name, "", flag(robot.link == RobotLink::Up));
    }
    family(&mut text, "r6_gateway_robot_stopped", "gauge", "Whether a stop holds.");
    for robot in &summaries {
        sample(&mut text, "r6_gateway_robot_stopped", &robot.name, "", flag(robot.stopped));
    }
    family(&mut text, "r6_gateway_robot_leased", "gauge", "Whether somebody holds the lease.");
    for robot in &summaries {
        sample(&mut text, "r6_gateway_robot_leased", &robot.name, "", flag(robot.lease.is_some()));
    }
    let exchanged = "Whether another robot than before answers.";
    family(&mut text, "r6_gateway_robot_exchanged", "gauge", exchanged);
    for robot in &summaries {
        let is_exchanged = flag(robot.identity_changed.is_some());
        sample(&mut text, "r6_gateway_robot_exchanged", &robot.name, "", is_exchanged);
    }
    let commands =
        "Commands that change or move, by outcome, since the robot was added or the gateway started.";
    family(&mut text, "r6_gateway_commands_total", "counter", commands);
    for station in &seen {
        for (outcome, count) in station.counts.commands() {
            let label = format!(",outcome=\"{outcome}\"");
            sample(&mut text, "r6_gateway_commands_total", station.name(), &label, count);
        }
    }
    let stops =
        "Stops that ended, by whether they were confirmed, since the robot was added or the gateway started.";
    family(&mut text, "r6_gateway_stops_total", "counter", stops);
    for station in &seen {
        for (confirmed, count) in station.counts.stops() {
            let label = format!(",confirmed=\"{confirmed}\"");
            sample(&mut text, "r6_gateway_stops_total", station.name(), &label, count);
        }
    }
    let waiting = "Records that wait for the disk. They grow while it fails.";
    family(&mut text, "r6_gateway_records_waiting", "gauge", waiting);
    for station in &seen {
        let count = station.records_waiting() as u64;
        sample(&mut text, "r6_gateway_records_waiting", station.name(), "", count);
    }
    raw(&mut text, &seen);
    ([(CONTENT_TYPE, FORMAT)], text)
}

/// The clients of the raw ports.
fn raw(text: &mut String, seen: &[&Arc<Station>]) {
    family(text, "r6_gateway_raw_clients", "gauge", "Clients of the raw port.");
    for station in seen {
        sample(text, "r6_gateway_raw_clients", station.name(), "", station.counts.raw.now().0);
    }
    let refused = "Requests over the raw port that were answered with err, by the gateway or the controller.";
    family(text, "r6_gateway_raw_refused_total", "counter", refused);
    for station in seen {
        sample(text, "r6_gateway_raw_refused_total", station.name(), "", station.counts.raw.now().1);
    }
    let closed = "Clients of the raw port that the gateway closed or did not let in, by cause.";
    family(text, "r6_gateway_raw_closed_total", "counter", closed);
    for station in seen {
        for (cause, count) in station.counts.raw.by_cause() {
            let label = format!(",cause=\"{cause}\"");
            sample(text, "r6_gateway_raw_closed_total", station.name(), &label, count);
        }
    }
}

fn family(text: &mut String, name: &str, kind: &str, help: &str) {
    // To write to a text cannot fail.
    let _ = write!(text, "# HELP {name} {help}\n# TYPE {name} {kind}\n");
}

/// A name of a robot has no character that a label would need to escape.
fn sample(text: &mut String, name: &str, robot: &str, labels: &str, value: u64) {
    let _ = writeln!(text, "{name}{{robot=\"{robot}\"{labels}}} {value}");
}
