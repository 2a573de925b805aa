//! The numbers of the gateway, in the text format of Prometheus.

use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::extract::State as Of;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use r6_api::gateway::RobotLink;
use r6_client::LinkQuality;

use super::State;
use super::caller::Caller;
use super::described::OfToken;
use super::refused::Refused;
use crate::fleet::station::Station;
use crate::history::HistoryCounts;

/// The text format of Prometheus.
const FORMAT: &str = "text/plain; version=0.0.4; charset=utf-8";

/// The numbers of the robots that the token may see, in the text format of Prometheus.
#[utoipa::path(get, path = "/metrics", responses(
    (status = 200, description = "The numbers", content_type = "text/plain", body = String),
    OfToken,
))]
pub async fn metrics(caller: Caller, Of(state): Of<State>) -> impl IntoResponse {
    let stations = state.fleet.stations();
    let seen: Vec<_> = stations.iter().filter(|station| caller.grant().covers(station.name())).collect();
    let mut text = String::new();
    let flag = u64::from;
    let owner = "r6_gateway_owns_robots";
    family(
        &mut text,
        owner,
        "gauge",
        "How many robots this gateway owns, and no other gateway that shares its store.",
    );
    let owns = stations.len();
    // To write to a text cannot fail.
    let _ = writeln!(text, "{owner} {owns}");
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
    let runs = "Runs of programs that ended, by state, since the robot was added or the gateway started.";
    family(&mut text, "r6_gateway_runs_total", "counter", runs);
    for station in &seen {
        for (state, count) in station.counts.runs() {
            let label = format!(",state=\"{state}\"");
            sample(&mut text, "r6_gateway_runs_total", station.name(), &label, count);
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
    links(&mut text, &seen);
    raw(&mut text, &seen);
    live(&mut text, &seen);
    if let Some(recorder) = &state.shared.history {
        history(&mut text, &seen);
        if caller.grant().is_for_all() {
            files(&mut text, recorder.counts(), recorder.is_paused());
        }
    }
    if caller.grant().is_for_all() {
        refused(&mut text, &state.refused);
    }
    if let Some(certificate) = state.certificate.as_ref().filter(|_| caller.grant().is_for_all()) {
        let name = "r6_gateway_certificate_expires_timestamp_seconds";
        family(&mut text, name, "gauge", "When the certificate of the gateway ends.");
        // To write to a text cannot fail.
        let _ = writeln!(text, "{name} {}", certificate.expires());
    }
    ([(CONTENT_TYPE, FORMAT)], text)
}

/// The requests that were refused.
fn refused(text: &mut String, refused: &Refused) {
    let name = "r6_gateway_http_refused_total";
    let told = "Requests that were refused, by status: 401 no valid token, session or password, 403 role too low, page from \
                elsewhere or wrong host, 413 body too long, 429 too many.";
    family(text, name, "counter", told);
    for (status, count) in refused.counts() {
        // To write to a text cannot fail.
        let _ = writeln!(text, "{name}{{status=\"{status}\"}} {count}");
    }
}

/// The connections to the robots. A robot without one has no rows.
fn links(text: &mut String, seen: &[&Arc<Station>]) {
    let links: Vec<_> =
        seen.iter().filter_map(|station| Some((station.name(), station.robot()?.link_quality()))).collect();
    let mut rows = |name: &str, help, value: fn(&LinkQuality) -> u64| {
        let name = format!("r6_gateway_robot_{name}_total");
        family(text, &name, "counter", help);
        links.iter().for_each(|(robot, link)| sample(text, &name, robot, "", value(link)));
    };
    rows("requests", "Requests to the robot that wait, or waited, for a reply.", |link| link.requests);
    rows("replies", "Replies of the robot to them.", |link| link.replies);
    rows("timeouts", "Requests that got no reply in time.", |link| link.timeouts);
    rows("reconnects", "How often the connection to the robot was made anew.", |link| link.reconnects);
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

/// The events that readers of streams did not get.
fn live(text: &mut String, seen: &[&Arc<Station>]) {
    let skipped = "Events that were not told live: the robot had more than 20 in a second.";
    family(text, "r6_gateway_live_events_skipped_total", "counter", skipped);
    for station in seen {
        let skipped = station.counts.events_skipped();
        sample(text, "r6_gateway_live_events_skipped_total", station.name(), "", skipped);
    }
}

/// The samples of each robot.
fn history(text: &mut String, seen: &[&Arc<Station>]) {
    let kept = "Samples of values that were kept, since the robot was added or the gateway started.";
    family(text, "r6_gateway_history_samples_total", "counter", kept);
    for station in seen {
        let kept = station.counts.history.now().0;
        sample(text, "r6_gateway_history_samples_total", station.name(), "", kept);
    }
    let lost = "Samples of values that could not be kept: the disk or the gateway was too slow.";
    family(text, "r6_gateway_history_lost_total", "counter", lost);
    for station in seen {
        sample(text, "r6_gateway_history_lost_total", station.name(), "", station.counts.history.now().1);
    }
    let kept = "Events that were kept, since the robot was added or the gateway started.";
    family(text, "r6_gateway_history_events_total", "counter", kept);
    for station in seen {
        let kept = station.counts.history.events().0;
        sample(text, "r6_gateway_history_events_total", station.name(), "", kept);
    }
    let lost = "Events that could not be kept: the disk was too slow.";
    family(text, "r6_gateway_history_events_lost_total", "counter", lost);
    for station in seen {
        let lost = station.counts.history.events().1;
        sample(text, "r6_gateway_history_events_lost_total", station.name(), "", lost);
    }
    let lag = "How much of what was read is not on the disk yet, in ms. It grows while the disk fails.";
    family(text, "r6_gateway_history_lag_ms", "gauge", lag);
    for station in seen {
        let lag = u64::try_from(station.counts.history.lag() / 1000).unwrap_or(0);
        sample(text, "r6_gateway_history_lag_ms", station.name(), "", lag);
    }
}

/// The files of the history, of all robots.
fn files(text: &mut String, counts: &HistoryCounts, is_paused: bool) {
    let oldest = counts.oldest_day.load(Ordering::Relaxed).saturating_mul(86_400);
    let rows = [
        ("paused", "gauge", "Whether the disk does not take samples.", u64::from(is_paused)),
        ("bytes", "gauge", "What all files of the history take.", counts.bytes.load(Ordering::Relaxed)),
        (
            "oldest_timestamp_seconds",
            "gauge",
            "The begin of the oldest day that is kept; 0 without a day.",
            u64::try_from(oldest).unwrap_or(0),
        ),
        (
            "files_removed_total",
            "counter",
            "Files of values removed for their age or the size of all.",
            counts.removed.load(Ordering::Relaxed),
        ),
        (
            "files_removed_without_averages_total",
            "counter",
            "Those of them with values of which no averages were computed.",
            counts.removed_unaveraged.load(Ordering::Relaxed),
        ),
        (
            "averages_bytes",
            "gauge",
            "What the files of averages take; it is in the bytes of all files too.",
            counts.average_bytes.load(Ordering::Relaxed),
        ),
        (
            "averages_files_removed_total",
            "counter",
            "Files of averages removed for their age or their size.",
            counts.removed_averages.load(Ordering::Relaxed),
        ),
        (
            "averages_days_total",
            "counter",
            "Days of which averages were computed.",
            counts.averaged_days.load(Ordering::Relaxed),
        ),
        (
            "averages_days_given_up_total",
            "counter",
            "Days whose averages failed again and again, and are given up until the next start.",
            counts.given_up_days.load(Ordering::Relaxed),
        ),
        (
            "clock_steps_total",
            "counter",
            "How often the clock of the system was set.",
            counts.clock_steps.load(Ordering::Relaxed),
        ),
        (
            "unreadable_total",
            "counter",
            "Rows that could not be read after a start.",
            counts.unreadable.load(Ordering::Relaxed),
        ),
    ];
    for (name, kind, help, value) in rows {
        let name = format!("r6_gateway_history_{name}");
        family(text, &name, kind, help);
        // To write to a text cannot fail.
        let _ = writeln!(text, "{name} {value}");
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
