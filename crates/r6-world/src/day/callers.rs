//! The callers of a day. Each does one thing again and again, and says what was not answered as it should be.

use std::time::Duration;

use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

use super::network::{Door, Network};
use super::{SharedNotes, name_of};
use crate::hall::http::{Answer, read_answer, request};

/// How long a caller waits for an answer. A stop takes 15 s at most.
const ANSWERS_WITHIN: Duration = Duration::from_secs(20);

/// How long after its connection was cut a robot has to answer again.
const BACK_WITHIN: Duration = Duration::from_secs(10);

/// How many callers send commands.
const OPERATORS: u16 = 4;

/// How many callers follow the values.
const FOLLOWERS: usize = 3;

/// Those who call the gateway.
#[derive(Clone)]
pub struct Callers {
    pub door: Door,
    pub viewer: String,
    pub operator: String,
    pub robots: u16,
    pub notes: SharedNotes,
}

impl Callers {
    /// Begins their work. It ends when this is dropped.
    pub fn begin(&self, network: &Network) -> JoinSet<()> {
        let mut working = JoinSet::new();
        for operator in 0..OPERATORS {
            working.spawn(self.clone().command(operator));
        }
        for _ in 0..FOLLOWERS {
            working.spawn(self.clone().follow(Duration::ZERO));
        }
        // This one reads so slowly that it is given up again and again.
        working.spawn(self.clone().follow(Duration::from_millis(500)));
        working.spawn(self.clone().come_and_go());
        working.spawn(self.clone().stop());
        working.spawn(self.clone().look_back());
        working.spawn(self.clone().guess());
        working.spawn(self.clone().cut(network.clone()));
        working
    }

    /// All robots answer, and none is read too late.
    pub async fn look(&self) {
        let Some(answer) = self.expect("GET", "/v1/robots", &self.viewer, None, 200).await else { return };
        let told = answer.json();
        let robots = told["robots"].as_array().map_or(&[][..], Vec::as_slice);
        if robots.len() != usize::from(self.robots) {
            self.notes.wrong(format!("{} robots are listed", robots.len()));
        }
    }

    async fn ask(&self, method: &str, path: &str, token: &str, body: Option<&Value>) -> Option<Answer> {
        let answer = timeout(ANSWERS_WITHIN, async {
            let mut stream = self.door.connect().await?;
            stream.write_all(&request(method, path, token, body)).await?;
            read_answer(&mut stream).await
        });
        match answer.await {
            Ok(Ok(answer)) => Some(answer),
            Ok(Err(error)) => {
                self.notes.wrong(format!("{method} {path}: {error}"));
                None
            }
            Err(_late) => {
                self.notes.wrong(format!("{method} {path}: no answer"));
                None
            }
        }
    }

    /// Asks for something that has to be answered with this status.
    async fn expect(
        &self,
        method: &str,
        path: &str,
        token: &str,
        body: Option<&Value>,
        status: u16,
    ) -> Option<Answer> {
        let answer = self.ask(method, path, token, body).await?;
        if answer.status != status {
            let body = String::from_utf8_lossy(&answer.body).into_owned();
            self.notes.wrong(format!("{method} {path}: {} {body}, not {status}", answer.status));
            return None;
        }
        self.notes.notes().answers += 1;
        Some(answer)
    }

    /// Takes the lease of a robot, does something with it, and gives it back.
    async fn with_lease(&self, robot: u16, act: impl AsyncFnOnce(&Value)) {
        let path = format!("/v1/robots/{}/lease", name_of(robot));
        let Some(given) = self.expect("POST", &path, &self.operator, Some(&json!({})), 200).await else {
            return;
        };
        let key = given.json()["lease"].clone();
        act(&key).await;
        self.expect("DELETE", &path, &self.operator, Some(&json!({ "lease": key })), 204).await;
    }

    /// Commands the robots of this operator, one after the other.
    async fn command(self, operator: u16) {
        // The last robot is stopped by another caller, and the connection to the one before it is cut.
        let own: Vec<u16> =
            (0..self.robots.saturating_sub(2)).filter(|robot| robot % OPERATORS == operator).collect();
        for (round, robot) in (0_u64..).zip(own.iter().cycle()) {
            sleep(Duration::from_secs(30)).await;
            self.with_lease(*robot, async |key| {
                let path = format!("/v1/robots/{}/commands", name_of(*robot));
                let percent = (20 + round % 80).to_string();
                let wanted = json!({ "command": "modifyGSPD", "arguments": [percent], "lease": key });
                self.expect("POST", &path, &self.operator, Some(&wanted), 200).await;
            })
            .await;
        }
    }

    /// Stops a robot every ten minutes, and lets it go on.
    async fn stop(self) {
        let robot = self.robots - 1;
        let path = |what: &str| format!("/v1/robots/{}/{what}", name_of(robot));
        loop {
            sleep(Duration::from_secs(600)).await;
            if self.expect("POST", &path("stop"), &self.operator, None, 200).await.is_some() {
                self.notes.notes().stops += 1;
            }
            self.with_lease(robot, async |key| {
                let clear = json!({ "lease": key });
                self.expect("POST", &path("clear-stopped"), &self.operator, Some(&clear), 204).await;
                let start = json!({ "command": "startButton", "lease": key });
                self.expect("POST", &path("commands"), &self.operator, Some(&start), 200).await;
            })
            .await;
        }
    }

    /// Follows the values of all robots. `rest`: how long to wait between two kilobytes.
    async fn follow(self, rest: Duration) {
        loop {
            self.follow_until(rest, Duration::from_secs(3600)).await;
            sleep(Duration::from_secs(1)).await;
        }
    }

    /// Follows them for a minute, again and again.
    async fn come_and_go(self) {
        loop {
            self.follow_until(Duration::ZERO, Duration::from_secs(60)).await;
        }
    }

    async fn follow_until(&self, rest: Duration, lasts: Duration) {
        let Ok(mut stream) = self.door.connect().await else { return };
        if stream.write_all(&request("GET", "/v1/live", &self.viewer, None)).await.is_err() {
            return;
        }
        let mut buffer = vec![0; if rest.is_zero() { 65_536 } else { 1024 }];
        let reading = async {
            while let Ok(count @ 1..) = stream.read(&mut buffer).await {
                self.notes.notes().streamed += count as u64;
                sleep(rest).await;
            }
        };
        let _ = timeout(lasts, reading).await;
    }

    /// Reads the last hour of the history of one robot after the other.
    async fn look_back(self) {
        for robot in (0..self.robots).cycle() {
            sleep(Duration::from_secs(300)).await;
            let path = format!("/v1/robots/{}/history?signal=axis-0&bucket=60s", name_of(robot));
            self.expect("GET", &path, &self.viewer, None, 200).await;
            let path = format!("/v1/robots/{}/production", name_of(robot));
            self.expect("GET", &path, &self.viewer, None, 200).await;
        }
    }

    /// Has no token. It is counted, and not written down.
    async fn guess(self) {
        loop {
            sleep(Duration::from_secs(5)).await;
            self.expect("GET", "/v1/robots", "r6_guessed", None, 401).await;
        }
    }

    /// Cuts the connection to one robot every minute. The robot is read again soon.
    async fn cut(self, network: Network) {
        let robot = self.robots.saturating_sub(2);
        let path = format!("/v1/robots/{}", name_of(robot));
        loop {
            sleep(Duration::from_secs(60)).await;
            network.cut(robot);
            self.notes.notes().cuts += 1;
            sleep(BACK_WITHIN).await;
            let Some(answer) = self.expect("GET", &path, &self.viewer, None, 200).await else { continue };
            if answer.json()["link"] != "up" {
                self.notes.wrong(format!("{} is not back: {}", name_of(robot), answer.json()["link"]));
            }
        }
    }
}
