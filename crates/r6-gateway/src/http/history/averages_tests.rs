//! A gateway with values of a day that is too old: what it answers when only its averages are left.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_client::{Address, RobotSettings};
use r6_proto::time::Instant as Moment;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::clock::{self, text};
use crate::core::history::averages::begin_of;
use crate::core::history::sample::{Interval, Micros, Sample, State};
use crate::core::name::RobotName;
use crate::history::journal::Journal;
use crate::history::{Batch, HistorySettings, RobotCounts};
use crate::store::HISTORY;
use crate::store::history::Days;
use crate::{AuditSettings, Gateway, GatewaySettings, RawPolicy, RobotConfig, TlsSettings};

/// How long to wait for the gateway.
const PATIENCE: Duration = Duration::from_secs(60);

async fn call(at: SocketAddr, token: &str, accept: &str, path: &str) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(at).await.unwrap();
    let request = format!(
        "GET {path} HTTP/1.1\r\nHost: {at}\r\nAccept: {accept}\r\nAuthorization: Bearer {token}\r\n\
         Connection: close\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut reply = Vec::new();
    stream.read_to_end(&mut reply).await.unwrap();
    let end = reply.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let body = reply.split_off(end + 4);
    (String::from_utf8(reply).unwrap(), body)
}

#[tokio::test]
async fn averages_take_the_place_of_values_that_are_too_old() {
    let data = tempfile::tempdir().unwrap();
    let token = crate::make_token(data.path(), Role::Viewer, None, String::new()).unwrap().1;
    let history = HistorySettings { keep_days: 1, min_free: 0, ..HistorySettings::default() };
    let robot = RobotName::new("press").unwrap();
    let begin = begin_of(clock::system().day() - 2);
    let at = |minute: i64| Micros(begin.0 + minute * 60_000_000);
    // Ten minutes of whole numbers, as a gateway of before left them.
    let samples = (0..10).map(|minute| {
        let sample = Sample { time: at(600 + minute), state: State::Integer(minute) };
        (Address::CurMode, Interval::USUAL, sample)
    });
    let mut journal = Journal::new(
        Days::to_write(&data.path().join(HISTORY), history.max_bytes),
        HistorySettings { keep_days: 9, ..history.clone() },
        Arc::default(),
    );
    let counts = Arc::<RobotCounts>::default();
    let batch = Batch { robot, time: at(610), samples: samples.collect(), events: Vec::new(), counts };
    journal.take(Moment::ORIGIN, batch);
    journal.flush(Moment::ORIGIN, at(610)).unwrap();
    drop(journal);

    let settings = GatewaySettings {
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        data: data.path().to_owned(),
        store: None,
        robots: vec![RobotConfig::new(RobotName::new("press").unwrap(), "127.0.0.1:1")],
        robot_settings: RobotSettings::default(),
        raw: Vec::new(),
        raw_policy: RawPolicy::default(),
        hall: None,
        audit: AuditSettings::default(),
        history,
        names: Vec::new(),
        tls: TlsSettings::Off,
    };
    let gateway = Gateway::start(settings).await.unwrap();
    let get = async |accept: &str, more: &str| {
        let (from, to) = (text(at(600)), text(at(720)));
        let path = format!("/v1/robots/press/history?signal=curMode&from={from}&to={to}{more}");
        call(gateway.address(), &token, accept, &path).await
    };
    let begun = Instant::now();
    let hours: Value = loop {
        let (head, body) = get("*/*", "&bucket=1h").await;
        assert!(head.starts_with("HTTP/1.1 200"), "{head}");
        let answer: Value = serde_json::from_slice(&body).unwrap();
        if answer["averages"].is_array() {
            break answer;
        }
        assert!(begun.elapsed() < PATIENCE, "{answer:#}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    let told = |width: u64, used: &str| json!([{"from": text(at(600)), "to": text(at(720)), "width_ms": width, "used": used}]);
    assert_eq!(hours["averages"], told(3_600_000, "exact"));
    let bucket = &hours["buckets"][0];
    // Each counts for a minute, the last one for two and a half.
    assert_eq!((&bucket["min"], &bucket["max"], &bucket["samples"]), (&json!(0.0), &json!(9.0), &json!(10)));
    assert_eq!(bucket["good_ms"], json!(690_000.0));
    assert_eq!(hours["buckets"][1]["mean"], Value::Null);

    // A table has the same rows, and says in its head what they are made of.
    let (head, table) = get("text/csv", "&bucket=30m").await;
    let header: BTreeMap<_, _> = head.lines().filter_map(|line| line.split_once(": ")).collect();
    let averages: Value = serde_json::from_str(header["r6-averages"]).unwrap();
    assert_eq!(averages, told(60_000, "exact"));
    assert_eq!(String::from_utf8(table).unwrap().lines().count(), 5);
    let (head, _) = get("application/vnd.apache.parquet", "&bucket=90s").await;
    assert!(head.contains("by_begin"), "{head}");
    let (_, body) = get("*/*", "").await;
    let samples: Value = serde_json::from_slice(&body).unwrap();
    assert_eq!((&samples["samples"], &samples["averages"]), (&json!([]), &told(60_000, "not_used")));

    let (_, metrics) = call(gateway.address(), &token, "*/*", "/metrics").await;
    let metrics = String::from_utf8(metrics).unwrap();
    for line in [
        "r6_gateway_history_files_removed_total 1",
        "r6_gateway_history_files_removed_without_averages_total 0",
        "r6_gateway_history_averages_days_total 1",
    ] {
        assert!(metrics.contains(&format!("\n{line}\n")), "{metrics}");
    }
    gateway.shutdown().await.unwrap();
}
