//! The history: what a robot did is there later, for those who may see it.

use std::time::{Duration, Instant};

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use r6_gateway::{Gateway, HistorySettings, RobotConfig};
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::{Hall, PATIENCE, name, ready_to_start, settings};

impl Hall {
    async fn history(&self, query: &str) -> Value {
        self.get(&self.viewer, &format!("/v1/robots/press/history?{query}")).await
    }

    /// The history of the press in another form: the head of the answer and its body.
    async fn history_as(&self, form: &str, query: &str) -> (String, Vec<u8>) {
        let address = self.gateway.address();
        let mut stream = TcpStream::connect(address).await.unwrap();
        let request = format!(
            "GET /v1/robots/press/history?{query} HTTP/1.1\r\nHost: {address}\r\nAccept: {form}\r\n\
             Authorization: Bearer {}\r\nConnection: close\r\n\r\n",
            self.viewer
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut reply = Vec::new();
        stream.read_to_end(&mut reply).await.unwrap();
        let end = reply.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let body = reply.split_off(end + 4);
        (String::from_utf8(reply).unwrap(), body)
    }

    /// Waits until the history is as `is` says.
    pub async fn until_history(&self, query: &str, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let history = self.history(query).await;
            if is(&history) {
                return history;
            }
            assert!(begun.elapsed() < PATIENCE, "{history:#}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

fn samples(history: &Value) -> &Vec<Value> {
    history["samples"].as_array().unwrap()
}

#[tokio::test]
async fn a_move_is_in_the_history_and_survives_a_restart() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "startButton").await.0, 200);
    let history = hall.until_history("signal=axis-0", |history| samples(history).len() > 20).await;
    let all = samples(&history);
    assert!(all.windows(2).all(|pair| pair[0]["time"].as_str() < pair[1]["time"].as_str()), "{history:#}");
    assert!(all.iter().all(|sample| sample["value"].is_f64() && sample["gap"].is_null()), "{history:#}");
    assert_eq!((&history["robot"], &history["signal"]), (&json!("press"), &json!("axis-0")));
    hall.until_history("signal=axis-0", |history| history["kept_until"].is_string()).await;
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let moving = hall.until_history("signal=isMoving", |history| {
        samples(history).last().is_some_and(|last| last["value"] == false)
    });
    let moving = moving.await;
    assert!(samples(&moving).iter().any(|sample| sample["value"] == true), "{moving:#}");
    // Only changes are kept.
    assert!(samples(&moving).len() < 20, "{moving:#}");
    let before = hall.history("signal=axis-0").await;

    let Hall { gateway, robots, data, viewer, operator, engineer, admin } = hall;
    gateway.shutdown().await.unwrap();
    drop(robots);
    let config = RobotConfig::new(name("press"), "127.0.0.1:1");
    let gateway = Gateway::start(settings(data.path(), vec![config])).await.unwrap();
    let hall = Hall { gateway, robots: Vec::new(), data, viewer, operator, engineer, admin };
    let range = format!("from={}&signal=axis-0", before["from"].as_str().unwrap());
    let after = hall
        .until_history(&range, |history| samples(history).last().is_some_and(|last| last["gap"] == "ended"))
        .await;
    let (before, after) = (samples(&before), samples(&after));
    assert_eq!(after[..before.len()], before[..], "nothing is lost");
    assert!(after.len() < before.len() + 20, "and nothing comes twice");
}

#[tokio::test]
async fn buckets_weigh_by_time_and_a_table_is_given_on_request() {
    let hall = Hall::start().await;
    hall.until_history("signal=curMode", |history| !samples(history).is_empty()).await;
    let history = hall
        .until_history("signal=curMode&bucket=1h", |history| {
            history["buckets"][0]["good_ms"].as_f64() > Some(100.0)
        })
        .await;
    let bucket = &history["buckets"][0];
    assert_eq!((&bucket["mean"], &bucket["min"], &bucket["max"]), (&json!(7.0), &json!(7.0), &json!(7.0)));
    assert_eq!((&bucket["last"], &bucket["samples"]), (&json!(7), &json!(1)));
    assert_eq!(history["bucket_ms"], 3_600_000);
    assert!(history["samples"].is_null());

    let (head, table) = hall.history_as("text/csv", "signal=curMode").await;
    assert!(head.contains("content-type: text/csv"), "{head}");
    let table = String::from_utf8(table).unwrap();
    let lines: Vec<_> = table.lines().collect();
    assert!(lines[0] == "time,value,gap" && lines[1].ends_with("Z,7,"), "{table}");
}

#[tokio::test]
async fn a_file_of_parquet_has_the_rows_of_the_table() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "startButton").await.0, 200);
    let history = hall.until_history("signal=axis-0", |history| samples(history).len() > 20).await;
    let (from, to) = (history["from"].as_str().unwrap(), samples(&history)[20]["time"].as_str().unwrap());
    for more in ["", "&bucket=1m", "&limit=7"] {
        let query = format!("signal=axis-0&from={from}&to={to}{more}");
        let (of_table, table) = hall.history_as("text/csv", &query).await;
        let (of_file, file) = hall.history_as("application/vnd.apache.parquet", &query).await;
        assert!(of_file.contains("content-type: application/vnd.apache.parquet"), "{of_file}");
        let next =
            |head: &str| head.lines().find(|line| line.starts_with("r6-next-cursor")).map(str::to_owned);
        assert_eq!(next(&of_table), next(&of_file));
        assert_eq!(next(&of_file).is_some(), more == "&limit=7", "{of_file}");
        let table = String::from_utf8(table).unwrap();
        assert_eq!(rows_of_file(file), table.lines().skip(1).collect::<Vec<_>>(), "{query}");
    }
}

/// The rows of a file of Parquet, written as the table writes them.
fn rows_of_file(file: Vec<u8>) -> Vec<String> {
    let reader = SerializedFileReader::new(axum::body::Bytes::from(file)).unwrap();
    let cell = |field: &Field| match field {
        Field::Null => String::new(),
        Field::TimestampMicros(time) => {
            let time = jiff::Timestamp::from_microsecond(*time).unwrap();
            format!("{time:.6}")
        }
        Field::Double(number) => number.to_string(),
        Field::Long(number) => number.to_string(),
        Field::Str(text) => text.clone(),
        other => panic!("{other:?}"),
    };
    let rows = reader.get_row_iter(None).unwrap();
    rows.map(|row| row.unwrap().get_column_iter().map(|(_, field)| cell(field)).collect::<Vec<_>>().join(","))
        .collect()
}

#[tokio::test]
async fn pages_are_read_one_after_the_other() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "startButton").await.0, 200);
    let history = hall.until_history("signal=axis-0", |history| samples(history).len() > 40).await;
    let (from, to) = (history["from"].as_str().unwrap(), history["to"].as_str().unwrap());
    let query = format!("signal=axis-0&from={from}&to={to}");
    let whole = samples(&history);
    let (mut pages, mut cursor) = (Vec::new(), String::new());
    loop {
        let page = hall.history(&format!("{query}&limit=9{cursor}")).await;
        assert!(samples(&page).len() <= 10);
        pages.extend(samples(&page).clone());
        match page["next_cursor"].as_str() {
            Some(next) => cursor = format!("&cursor={next}"),
            None => break,
        }
    }
    // What was read within the last moments of the range came later.
    assert_eq!(pages[..whole.len()], whole[..]);
    assert!(pages.len() < whole.len() + 10);

    // Without a begin the range moves on with the time. A page goes on where the last one ended all the same.
    let first = hall.history("signal=axis-0&limit=9").await;
    let cursor = first["next_cursor"].as_str().unwrap();
    let second = hall.history(&format!("signal=axis-0&limit=9&cursor={cursor}")).await;
    let read: Vec<_> = samples(&first).iter().chain(samples(&second)).cloned().collect();
    assert_eq!(read[..], whole[..read.len()], "{read:?}");
}

#[tokio::test]
async fn a_robot_that_is_lost_has_a_gap() {
    let mut hall = Hall::start().await;
    hall.until_history("signal=curMode", |history| !samples(history).is_empty()).await;
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    let history = hall
        .until_history("signal=curMode", |history| {
            samples(history).last().is_some_and(|last| last["gap"] == "stale")
        })
        .await;
    assert_eq!(samples(&history).last().unwrap()["value"], json!(null));
}

#[tokio::test]
async fn every_mistake_of_a_query_is_told() {
    let hall = Hall::start().await;
    for (query, part) in [
        ("", "signal"),
        ("signal=axis-99", "`axis-99` is no query address"),
        ("signal=Adr-800", "nearest: `Addr-n` with n from 800"),
        ("signal=axis-0&from=yesterday", "from: `yesterday`"),
        ("signal=axis-0&to=2026-13-01T00:00:00Z", "to: "),
        ("signal=axis-0&from=9999-01-01T00:00:00Z", "from is a time before to"),
        ("signal=axis-0&from=1970-01-01T00:00:00Z", "ten years"),
        ("signal=axis-0&bucket=0s", "bucket: `0s`"),
        ("signal=axis-0&bucket=1x", "bucket: `1x`"),
        ("signal=axis-0&bucket=1500us", "bucket: `1500us`"),
        ("signal=axis-0&limit=0", "limit is from 1 to 10000"),
        ("signal=axis-0&limit=10001", "limit is from 1 to 10000"),
        ("signal=axis-0&cursor=t5", "no cursor of this range"),
        ("signal=axis-0&cursor=%00", "no cursor of this range"),
        ("signal=axis-0&page=2", "page"),
        ("signal=axis-0&format=csv", "; the header `Accept` says the form, such as `Accept: text/csv`"),
        ("signal=axis-0&signal=axis-1", "signal"),
    ] {
        let path = format!("/v1/robots/press/history?{query}");
        let (status, problem) = hall.call(&hall.viewer, "GET", &path, None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{query}: {problem}");
        let message = problem["message"].as_str().unwrap();
        assert!(message.contains(part) && !message.contains("deserialize"), "{query}: {problem}");
    }
    let (status, problem) =
        hall.call(&hall.viewer, "GET", "/v1/robots/none/history?signal=axis-0", None).await;
    assert_eq!((status, &problem["code"]), (404, &json!("no_such_robot")));
    // A value that is not read has no samples, and that is no mistake.
    let history = hall.history("signal=Addr-850").await;
    assert!(samples(&history).is_empty() && history["next_cursor"].is_null());
}

#[tokio::test]
async fn commands_and_stops_go_on_while_the_history_cannot_be_written() {
    let robot = VirtualController::start().await.unwrap();
    let data = tempfile::tempdir().unwrap();
    // A file is where the folder of the history should be.
    std::fs::write(data.path().join("history"), "no folder").unwrap();
    let config = RobotConfig {
        period: Duration::from_millis(20),
        ..RobotConfig::new(name("press"), robot.address().to_string())
    };
    let hall = Hall::at(data, vec![config], vec![robot]).await;
    hall.until_up("press").await;
    let begun = Instant::now();
    loop {
        let ready = hall.get(&hall.viewer, "/readyz").await;
        if ready["history"] == "paused" {
            assert_eq!(ready["store"], true);
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "{ready}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await.0, 200);
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let metrics = hall.get(&hall.viewer, "/metrics").await;
    let metrics = metrics.as_str().unwrap();
    assert!(metrics.contains("\nr6_gateway_history_paused 1\n"), "{metrics}");
    let (status, problem) =
        hall.call(&hall.viewer, "GET", "/v1/robots/press/history?signal=curMode", None).await;
    assert_eq!((status, &problem["code"]), (503, &json!("store_unavailable")), "{problem}");
    // The disk is there again: what waited in memory is kept.
    std::fs::remove_file(hall.data.path().join("history")).unwrap();
    let history = hall.until_history("signal=curMode", |history| history["kept_until"].is_string()).await;
    assert_eq!(samples(&history)[0]["value"], 7);
}

#[tokio::test]
async fn a_history_that_is_off_says_so_and_writes_nothing() {
    let data = tempfile::tempdir().unwrap();
    let config = RobotConfig::new(name("press"), "127.0.0.1:1");
    let off = r6_gateway::GatewaySettings {
        history: HistorySettings::off(),
        ..settings(data.path(), vec![config])
    };
    let gateway = Gateway::start(off).await.unwrap();
    let token = r6_gateway::make_token(data.path(), r6_api::gateway::Role::Viewer, None, String::new());
    let token = token.unwrap().1;
    let get = |path: &'static str| crate::support::call(gateway.address(), &token, "GET", path, None);
    let (status, problem) = get("/v1/robots/press/history?signal=curMode").await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{problem}");
    assert_eq!(get("/readyz").await.1["history"], "off");
    assert!(!get("/metrics").await.1.as_str().unwrap().contains("history"));
    gateway.shutdown().await.unwrap();
    assert!(!data.path().join("history").exists());
}
