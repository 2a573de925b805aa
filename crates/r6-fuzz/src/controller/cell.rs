//! A controller with its connections, on its own clock.

use std::time::Duration;

use r6_controller::{ConnectionId, Controller};
use r6_proto::ADDRESSES;
use r6_proto::time::Instant;

/// A controller and its connections.
pub struct Cell {
    /// The controller.
    pub controller: Controller,
    /// The current time.
    pub now: Instant,
    /// Everything that it has sent, frame by frame.
    pub transcript: Vec<u8>,
    id: ConnectionId,
    other: ConnectionId,
}

/// The maximum number of events in one period. A program of steps that take no time has a thousand a second.
const MOST_EVENTS: u32 = 3_000;

impl Cell {
    /// The controller with two connections.
    pub fn around(mut controller: Controller, now: Instant) -> Self {
        let id = controller.connect(now);
        let other = controller.connect(now);
        Self { controller, now, transcript: Vec::new(), id, other }
    }

    /// Replaces the controller, with new connections.
    pub fn replace(&mut self, controller: Controller) {
        self.controller = controller;
        (self.id, self.other) = (self.controller.connect(self.now), self.controller.connect(self.now));
    }

    /// Delivers bytes on the first connection.
    pub fn send(&mut self, bytes: &[u8]) {
        self.controller.handle_input(self.now, self.id, bytes);
        self.read();
    }

    /// Delivers bytes on the second connection.
    pub fn send_elsewhere(&mut self, bytes: &[u8]) {
        self.controller.handle_input(self.now, self.other, bytes);
        self.read();
    }

    /// Ends the first connection and makes it again.
    pub fn reconnect(&mut self) {
        self.controller.disconnect(self.id);
        self.id = self.controller.connect(self.now);
    }

    /// Loses the first connection without the controller's knowledge, and makes another.
    pub fn lose(&mut self) {
        self.controller.lose(self.id);
        self.id = self.controller.connect(self.now);
    }

    /// Lets time pass from deadline to deadline, as a shell does.
    pub fn pass(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f64(seconds);
        for _ in 0..MOST_EVENTS {
            let Some(due) = self.next_due().filter(|due| *due <= end) else { break };
            self.now = self.now.max(due);
            self.controller.handle_timeout(self.now);
            self.read();
        }
        if self.next_due().is_none_or(|due| due > end) {
            self.now = end;
        }
        self.controller.handle_timeout(self.now);
        self.read();
    }

    fn next_due(&self) -> Option<Instant> {
        let frames = [self.id, self.other].map(|id| self.controller.next_transmit(id));
        frames.into_iter().flatten().chain(self.controller.poll_timeout()).min()
    }

    /// Takes everything that is sent now. It must be complete JSON objects, each within the size that a
    /// client must read.
    fn read(&mut self) {
        while self.controller.poll_woken().is_some() {}
        while let Some(line) = self.controller.poll_log() {
            assert!(!line.to_string().is_empty());
        }
        for id in [self.id, self.other] {
            while let Some(frame) = self.controller.poll_transmit(self.now, id) {
                self.transcript.extend_from_slice(frame);
                self.transcript.push(b'\n');
            }
        }
        for first in [true, false] {
            let id = if first { self.id } else { self.other };
            if self.controller.is_over(id) {
                self.controller.disconnect(id);
                let id = self.controller.connect(self.now);
                *(if first { &mut self.id } else { &mut self.other }) = id;
            }
        }
    }

    /// The reply to a client's query of all registers, 800 to 900; `None` without a reply.
    pub fn registers(&mut self) -> Option<Vec<i64>> {
        let names: Vec<_> = (800..=900).map(|number| format!("\"Addr-{number}\"")).collect();
        let sent = self.transcript.len();
        self.send(format!(r#"{{"reqType":"query","queryAddr":[{}]}}"#, names.join(",")).as_bytes());
        let frames = self.transcript[sent..].split(|byte| *byte == b'\n');
        let reply = frames
            .filter_map(|frame| serde_json::from_slice::<serde_json::Value>(frame).ok())
            .find(|frame| frame.get("queryData").is_some_and(|data| data.is_array()))?;
        let values = reply["queryData"].as_array()?.iter();
        let values =
            values.map(|value| value.as_str().map_or_else(|| value.as_i64(), |text| text.parse().ok()));
        values.collect::<Option<Vec<_>>>().filter(|values| values.len() == names.len())
    }

    /// Queries every address.
    pub fn ask_everything(&mut self) {
        let mut names = Vec::new();
        for row in &ADDRESSES {
            match (row.name.strip_suffix('n'), row.indices) {
                (Some(stem), Some((first, last))) => {
                    names.extend([first, last].map(|index| format!("\"{stem}{index}\"")));
                }
                _ => names.push(format!("\"{}\"", row.name)),
            }
        }
        for names in names.chunks(12) {
            let names = names.join(",");
            self.send(format!(r#"{{"reqType":"query","packID":"1","queryAddr":[{names}]}}"#).as_bytes());
        }
    }

    /// Sends the usual requests of a client: moves, signals, registers, points, commands.
    pub fn work(&mut self) {
        const FRAMES: [&str; 8] = [
            r#"{"reqType":"command","cmdData":["clearAlarm"]}"#,
            r#"{"reqType":"command","cmdData":["startButton"]}"#,
            r#"{"reqType":"AddRCC","emptyList":"1","instructions":[{"oneshot":"1","action":"4","m0":"5","m1":"5","m2":"5","m3":"0","m4":"0","m5":"0","ckStatus":"0x3F","speed":"50","delay":"0","smooth":"3"},{"oneshot":"1","action":"4","m0":"-5","m1":"0","m2":"0","m3":"0","m4":"5","m5":"0","ckStatus":"0x3F","speed":"50","delay":"0","smooth":"0"}]}"#,
            r#"{"reqType":"AddPoints","dsData":[{"camID":"0","data":[{"ModelID":"0","X":"1","Y":"2","Z":"3","Angel":"4"}]}]}"#,
            r#"{"reqType":"photo","camID":0,"ret":1}"#,
            r#"{"reqType":"command","cmdData":["rewriteDataList","800","6","0","1000","0","0","0","0","0"]}"#,
            r#"{"reqType":"command","cmdData":["modifyGSPD","500"]}"#,
            r#"{"reqType":"command","cmdData":["actionStop"]}"#,
        ];
        for frame in FRAMES {
            self.send(frame.as_bytes());
            self.pass(0.05);
            self.ask_everything();
        }
    }
}
