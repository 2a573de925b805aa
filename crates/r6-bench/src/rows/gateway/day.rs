//! The averages of a day of the history, beside the same question to a plain table of SQLite.

use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_client::{Address, RobotSettings};
use r6_gateway::simulation::write_history;
use r6_gateway::{
    AuditSettings, GatewaySettings, HistorySettings, RawPolicy, RobotConfig, RobotName, TlsSettings,
};
use rusqlite::Connection;
use tokio::runtime::Builder;

use super::client::Client;
use crate::measure::{Contender, compare};
use crate::report::{Figure, Goal, Row};
use crate::serve::{Running, Server};

/// The signals of the robot: all are kept, and the first one is asked for.
const SIGNALS: [&str; 4] = ["axis-0", "axis-1", "axis-2", "axis-3"];

/// The samples of each signal, ten a second.
const SAMPLES: u32 = 864_000;

/// The time between two samples, in µs.
const EVERY: i64 = 100_000;

/// The begin of the day, 2026-11-20, in µs since 1970. It is over, so its file is not written any more.
const BEGIN: i64 = 1_795_132_800_000_000;

/// How long the day is, in µs.
const DAY: i64 = 86_400_000_000;

/// The same in the words of the API.
const RANGE: &str = "from=2026-11-20T00:00:00Z&to=2026-11-21T00:00:00Z&bucket=1m&limit=1440";

/// The position of an axis that moves back and forth, in tenths of a millidegree as the history keeps it.
fn position(signal: usize, sample: u32) -> f64 {
    let turn = f64::from(sample) * 0.002 + f64::from(u32::try_from(signal).unwrap_or(0));
    (turn.sin() * 900_000.0).round() / 10_000.0
}

/// The gateway in whose folder the day is: a server process.
pub fn serve(words: &[String]) {
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    let data = Path::new(words.first().expect("a folder"));
    // A folder that has a history and no store is not taken.
    r6_gateway::make_token(data, Role::Viewer, None, String::new()).expect("a store");
    let name = RobotName::new("robot-0").expect("a name");
    for (number, signal) in SIGNALS.iter().enumerate() {
        let address = Address::parse(signal).expect("an address");
        let values = (0..SAMPLES).map(|sample| position(number, sample));
        let samples = (BEGIN..).step_by(usize::try_from(EVERY).expect("it fits")).zip(values);
        write_history(data, &name, address, samples).expect("the disk has room");
    }
    let settings = GatewaySettings {
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        data: data.to_owned(),
        store: None,
        // Nothing listens there: the day is all that is known of this robot.
        robots: vec![RobotConfig {
            period: Duration::from_secs(3600),
            ..RobotConfig::new(name, "127.0.0.1:1")
        }],
        robot_settings: RobotSettings::default(),
        raw: Vec::new(),
        raw_policy: RawPolicy::default(),
        hall: None,
        audit: AuditSettings::default(),
        history: HistorySettings { keep_days: 3_650, ..HistorySettings::default() },
        names: Vec::new(),
        tls: TlsSettings::Off,
    };
    super::run_gateway(&runtime, settings);
}

/// The question over HTTP beside SQLite. Both sides read files that were written before.
pub fn rows() -> Vec<Row> {
    // The process of the gateway is ended before its folder is removed.
    let data = tempfile::tempdir().expect("a folder");
    let gateway: Running = Server::Day.start_with(&[data.path().display().to_string()]);
    let mut client = Client::new(&gateway);
    let folder = tempfile::tempdir().expect("a folder");
    let plain = plain_table(&folder.path().join("plain.db"));
    let minutes = usize::try_from(DAY / 60_000_000).expect("it fits");
    let of_sqlite = || {
        let begun = Instant::now();
        let sql = "SELECT time / 60000000, avg(value), min(value), max(value), count(*) FROM samples \
                   WHERE robot = 0 AND signal = 0 AND time >= ?1 AND time < ?2 GROUP BY 1 ORDER BY 1";
        let mut statement = plain.prepare_cached(sql).expect("a statement");
        let rows = statement.query_map([BEGIN, BEGIN + DAY], |row| row.get::<_, f64>(1)).expect("rows");
        let means: Vec<f64> = rows.map(|row| row.expect("a number")).collect();
        assert_eq!(means.len(), minutes);
        vec![begun.elapsed().as_secs_f64() * 1e9]
    };
    let of_gateway = || {
        let begun = Instant::now();
        let answer = client.json("GET", &format!("/v1/robots/robot-0/history?signal=axis-0&{RANGE}"), "");
        let took = begun.elapsed();
        let buckets = answer["buckets"].as_array().expect("buckets");
        assert!(
            buckets.len() == minutes && buckets.iter().all(|bucket| bucket["samples"].as_u64() >= Some(599))
        );
        vec![took.as_secs_f64() * 1e9]
    };
    let mut contenders: Vec<Contender<'_>> = vec![Box::new(of_sqlite), Box::new(of_gateway)];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    vec![Row {
        what: "The history of a gateway: a day of one signal, 864 000 samples, as 1 440 averages over HTTP"
            .to_owned(),
        against: "the same from a table of SQLite with an index by robot, signal and time",
        goal: Some(Goal::AtMost(1.0)),
        figure: Figure::Ratio(ratio),
        in_the_way: "chunks are unpacked, averages are weighted by time, and the answer is written as JSON and sent",
    }]
}

/// The same samples in a plain table.
fn plain_table(path: &std::path::Path) -> Connection {
    let mut plain = Connection::open(path).expect("a file");
    plain
        .execute_batch("CREATE TABLE samples (robot INTEGER, signal INTEGER, time INTEGER, value REAL)")
        .expect("a table");
    let whole = plain.transaction().expect("a transaction");
    {
        let mut insert = whole.prepare("INSERT INTO samples VALUES (0, ?1, ?2, ?3)").expect("a statement");
        for sample in 0..SAMPLES {
            for signal in 0..SIGNALS.len() {
                let (time, value) = (BEGIN + i64::from(sample) * EVERY, position(signal, sample));
                insert.execute((i64::try_from(signal).expect("it fits"), time, value)).expect("a row");
            }
        }
    }
    whole.commit().expect("it is written");
    plain.execute_batch("CREATE INDEX by_time ON samples (robot, signal, time)").expect("an index");
    plain
}
