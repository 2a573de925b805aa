//! A caller that sends what no client of good will sends (G13).

use std::fmt::Write;
use std::time::Duration;

use tokio::io::AsyncWriteExt;
use tokio::time::{sleep, timeout};
use turmoil::net::TcpStream;

use super::{Work, ms};
use crate::fault::{Class, Promise};
use crate::hall::http::{connect, read_answer};
use crate::hall::token_of;
use crate::shared::now;

/// How long to wait for an answer: a body and a head have to end within 5 s.
const ANSWERS_WITHIN: Duration = Duration::from_secs(8);

/// How many connections it opens at once: more than a gateway gives to one peer.
const MANY: usize = 40;

impl Work {
    /// Attacks until the faults are over.
    pub(super) async fn attack(&mut self) {
        while !self.is_over() {
            self.rest(600).await;
            match self.random.below(8) {
                0 => self.send(&oversized(&token_of(self.index))).await,
                1 => self.send(&bad_json(&token_of(self.index))).await,
                2 => {
                    let path =
                        ["/v1/robots/..%2f..%2fetc%2fpasswd", "/../../etc/passwd", "/v1/robots/%00/stop"];
                    let path = path[self.random.below(path.len())];
                    self.send(&head("POST", path, &token_of(self.index))).await;
                }
                3 => self.send(&header_flood()).await,
                4 => self.send(&head("POST", "/v1/robots/robot-0/stop", "r6_wrong")).await,
                5 => self.send(b"\x16\x03\x01\x00\xa5\x01\x00\x00\xa1\x03\x03rubbish\r\n\r\n").await,
                6 => self.half_a_request().await,
                _ => self.many_connections().await,
            }
        }
    }

    /// Sends bytes and reads the answer. It must be a refusal, or the connection is closed, both in time.
    async fn send(&mut self, bytes: &[u8]) {
        let Ok(mut stream) = connect().await else { return };
        let asked = now();
        let answer = timeout(ANSWERS_WITHIN, async {
            stream.write_all(bytes).await?;
            read_answer(&mut stream).await
        });
        let index = self.index;
        let Ok(answer) = answer.await else {
            self.shared.tell(format_args!("caller-{index}: no answer to an attack"));
            let is_bad = self.hall(|hall, _, at| hall.has_to_answer(asked, at)) == Some(true);
            let text = || format!("an attack at {asked:?} gets no answer, and its connection stays");
            return self.shared.check(Promise::I12, !is_bad, text);
        };
        let status = answer.map(|answer| answer.status);
        self.shared.tell(format_args!("caller-{index}: an attack gets {status:?}"));
        if let Ok(status) = status {
            let holds = (400..500).contains(&status) || status == 503;
            self.shared.check(Promise::I12, holds, || format!("an attack gets {status}"));
        }
        self.shared.state().record.strikes(Class::G13);
    }

    /// Begins a request and never ends it.
    async fn half_a_request(&mut self) {
        let Ok(mut stream) = connect().await else { return };
        let _ = stream.write_all(b"POST /v1/robots/robot-0/stop HTTP/1.1\r\nhost: gate").await;
        let pause = self.random.up_to(ms(4000));
        sleep(pause).await;
        self.shared.state().record.strikes(Class::G13);
    }

    /// Opens many connections and says nothing on them.
    async fn many_connections(&mut self) {
        let mut open: Vec<TcpStream> = Vec::new();
        for _ in 0..MANY {
            match connect().await {
                Ok(stream) => open.push(stream),
                Err(_) => break,
            }
        }
        let pause = self.random.up_to(ms(3000));
        sleep(pause).await;
        self.shared.state().record.strikes(Class::G13);
    }
}

fn head(method: &str, path: &str, token: &str) -> Vec<u8> {
    format!("{method} {path} HTTP/1.1\r\nhost: gateway\r\nauthorization: Bearer {token}\r\n\r\n").into_bytes()
}

/// A body that is longer than any route takes.
fn oversized(token: &str) -> Vec<u8> {
    let length = 40 << 20;
    let mut bytes = format!(
        "POST /v1/robots/robot-0/commands HTTP/1.1\r\nhost: gateway\r\nauthorization: Bearer {token}\r\n\
         content-type: application/json\r\ncontent-length: {length}\r\n\r\n"
    );
    bytes.push_str(&"x".repeat(64 << 10));
    bytes.into_bytes()
}

fn bad_json(token: &str) -> Vec<u8> {
    let body = "{".repeat(500);
    format!(
        "POST /v1/robots/robot-0/commands HTTP/1.1\r\nhost: gateway\r\nauthorization: Bearer {token}\r\n\
         content-type: application/json\r\ncontent-length: {}\r\n\r\n{body}",
        body.len()
    )
    .into_bytes()
}

fn header_flood() -> Vec<u8> {
    let mut bytes = "GET /v1/robots HTTP/1.1\r\nhost: gateway\r\n".to_owned();
    for number in 0..2000 {
        let _ = write!(bytes, "x-{number}: {number}\r\n");
    }
    bytes.push_str("\r\n");
    bytes.into_bytes()
}
