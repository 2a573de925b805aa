//! What one frame says, and what is wrong with it.

mod checks;

use std::collections::VecDeque;

use r6_proto::message::command::Outcome;
use r6_proto::message::{Message, Query, QueryReply};
use r6_proto::value::Value;
use r6_proto::{Body, Decoder, RequestType};

use crate::cmd::inspect::source::{PYTHON, Side, is_python};

/// Queries that are remembered until their reply comes: more than any client has on its way.
const MAX_OPEN_QUERIES: usize = 256;

/// Characters of a summary: one line of a terminal.
const SUMMARY_CHARS: usize = 160;

/// What one frame says, and what is wrong with it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Finding {
    /// Who sends such a frame to whom.
    pub direction: &'static str,
    /// Its kind, such as `query` or `command reply`.
    pub kind: &'static str,
    /// What it says, in one line.
    pub summary: String,
    /// What is wrong.
    pub problems: Vec<String>,
    /// What is worth knowing, but not wrong.
    pub notes: Vec<String>,
}

/// Judges the frames of one capture, in their order.
#[derive(Default)]
pub struct Judge {
    decoder: Decoder,
    open: VecDeque<OpenQuery>,
}

/// A query whose reply has not come yet.
struct OpenQuery {
    pack_id: Option<String>,
    addresses: Vec<String>,
}

impl Judge {
    /// Judges one frame.
    pub fn judge(&mut self, frame: &[u8], from: Option<Side>) -> Finding {
        let mut decoder = std::mem::take(&mut self.decoder);
        let finding = match decoder.decode(frame) {
            Ok(message) => self.judge_message(&message, from),
            Err(error) => Finding {
                direction: direction_of(from),
                kind: "no JSON",
                summary: excerpt(&String::from_utf8_lossy(frame)),
                problems: vec![if is_python(frame) { PYTHON.to_owned() } else { error.to_string() }],
                notes: Vec::new(),
            },
        };
        self.decoder = decoder;
        finding
    }

    fn judge_message(&mut self, message: &Message<'_>, from: Option<Side>) -> Finding {
        let mut finding = Finding::default();
        (finding.direction, finding.kind) = kind(&message.body);
        checks::header(message, &mut finding);
        checks::extras(message, &mut finding);
        match &message.body {
            Body::Query(query) => self.query(message, query, &mut finding),
            Body::QueryReply(reply) => self.query_reply(message, reply, &mut finding),
            Body::Command(command) => checks::command(command, &mut finding),
            Body::CommandReply(reply) => {
                let words: Vec<_> = reply.words().iter().map(|word| word.text().into_owned()).collect();
                finding.summary = words.join(" ");
                match reply.outcome() {
                    Outcome::Ok | Outcome::Points(_) => {}
                    Outcome::Refused(None) => finding.notes.push("refused, without a reason".to_owned()),
                    Outcome::Refused(Some(reason)) => finding.notes.push(format!("refused: {reason}")),
                    Outcome::Unclear(answer) => {
                        finding.problems.push(format!("`{answer}` is neither ok nor err"));
                    }
                }
            }
            Body::Heartbreak => finding.notes.push(
                "arms the controller's watchdog: from now on one is due every 10 s, or an alarm is raised"
                    .to_owned(),
            ),
            Body::Photo(photo) => finding.summary = format!("camera {}", photo.cam_id),
            Body::PhotoAnswer(answer) => {
                finding.summary = format!("camera {}, ret {}", answer.cam_id, answer.ret);
            }
            Body::AddPoints(points) => {
                let sets: Vec<_> = points
                    .sets()
                    .map(|(cam_id, points)| format!("camera {cam_id}: {} points", points.len()))
                    .collect();
                finding.summary = sets.join(", ");
            }
            Body::AddRcc(list) => checks::list(message, list, &mut finding),
            Body::Unknown(unknown) => finding.problems.push(unknown.to_string()),
            Body::Rejected(rejection) => finding.problems.push(rejection.error.to_string()),
        }
        finding.summary = excerpt(&finding.summary);
        if let Some(side) = from {
            finding.direction = direction_of(Some(side));
        }
        finding
    }

    fn query(&mut self, message: &Message<'_>, query: &Query<'_>, finding: &mut Finding) {
        let mut addresses = Vec::new();
        for (word, resolved) in query.resolved() {
            let name = word.text().into_owned();
            match resolved {
                Ok(address) if address.to_string() != name => {
                    finding.notes.push(format!("`{name}` is also spelt `{address}`"));
                }
                Ok(_) => {}
                Err(error) => finding.problems.push(error.to_string()),
            }
            addresses.push(name);
        }
        if addresses.is_empty() {
            finding.problems.push("`queryAddr` is empty: nothing is asked for".to_owned());
        }
        finding.summary = addresses.join(", ");
        if self.open.len() >= MAX_OPEN_QUERIES {
            self.open.pop_front();
        }
        self.open.push_back(OpenQuery { pack_id: pack_id(message), addresses });
    }

    fn query_reply(&mut self, message: &Message<'_>, reply: &QueryReply<'_>, finding: &mut Finding) {
        let asked = match reply.addresses {
            Some(addresses) => {
                self.answered(message);
                Some(addresses.iter().map(|address| address.text().into_owned()).collect())
            }
            None => self.answered(message),
        };
        let values: Vec<_> = reply.values.iter().map(wire_text).collect();
        match asked.filter(|asked: &Vec<String>| !asked.is_empty()) {
            None => finding.summary = values.join(", "),
            Some(asked) => match reply.aligned(asked.len()) {
                Ok(_) => {
                    let pairs: Vec<_> =
                        asked.iter().zip(&values).map(|(name, value)| format!("{name}={value}")).collect();
                    finding.summary = pairs.join(", ");
                }
                Err(mismatch) => {
                    finding.summary = values.join(", ");
                    finding.problems.push(mismatch.to_string());
                }
            },
        }
    }

    /// The addresses of the query that this reply answers, by its `packID`, else by order.
    fn answered(&mut self, message: &Message<'_>) -> Option<Vec<String>> {
        let pack_id = pack_id(message);
        let position = match pack_id {
            Some(_) => self.open.iter().rposition(|query| query.pack_id == pack_id),
            None => (!self.open.is_empty()).then_some(0),
        };
        self.open.remove(position?).map(|query| query.addresses)
    }
}

fn pack_id(message: &Message<'_>) -> Option<String> {
    message.header.pack_id.map(|pack_id| pack_id.text().into_owned())
}

fn wire_text(value: Value<'_>) -> String {
    String::from_utf8_lossy(value.wire()).into_owned()
}

fn excerpt(text: &str) -> String {
    let one_line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match one_line.char_indices().nth(SUMMARY_CHARS) {
        Some((end, _)) => format!("{}…", one_line.get(..end).unwrap_or_default()),
        None => one_line,
    }
}

fn direction_of(from: Option<Side>) -> &'static str {
    match from {
        Some(Side::Pc) => "PC → controller",
        Some(Side::Controller) => "controller → PC",
        None => "?",
    }
}

/// Direction and kind of a frame.
fn kind(body: &Body<'_>) -> (&'static str, &'static str) {
    const TO: &str = "PC → controller";
    const FROM: &str = "controller → PC";
    match body {
        Body::Query(_) => (TO, "query"),
        Body::QueryReply(_) => (FROM, "query reply"),
        Body::Command(_) => (TO, "command"),
        Body::CommandReply(_) => (FROM, "command reply"),
        Body::Heartbreak => (TO, "heartbreak"),
        Body::Photo(_) => ("controller → camera", "photo"),
        Body::PhotoAnswer(_) => ("camera → controller", "photo answer"),
        Body::AddPoints(_) => ("camera → controller", "AddPoints"),
        Body::AddRcc(_) => (TO, "AddRCC"),
        Body::Unknown(_) => ("?", "unknown"),
        Body::Rejected(rejection) => match rejection.request {
            RequestType::Query => ("?", "query"),
            RequestType::Command => ("?", "command"),
            RequestType::Heartbreak => (TO, "heartbreak"),
            RequestType::Photo => ("?", "photo"),
            RequestType::AddPoints => ("camera → controller", "AddPoints"),
            RequestType::AddRcc => (TO, "AddRCC"),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DS_ID: &str = r#""dsID":"www.hc-system.com.RemoteMonitor""#;

    fn judge(members: &str) -> Finding {
        Judge::default().judge(format!("{{{DS_ID},{members}}}").as_bytes(), None)
    }

    #[test]
    fn a_right_frame_has_no_problem() {
        let finding = judge(r#""reqType":"query","queryAddr":["version","axis-0"]"#);
        assert_eq!((finding.direction, finding.kind), ("PC → controller", "query"));
        assert_eq!(finding.summary, "version, axis-0");
        assert_eq!(finding.problems, [""; 0]);
    }

    #[test]
    fn wrong_words_name_the_nearest() {
        for (members, wrong) in [
            (r#""reqType":"query","queryAddrr":["version"]"#, "nearest: `queryAddr`"),
            (r#""reqType":"query","queryAddr":["curAlrm"]"#, "nearest: `curAlarm`"),
            (r#""reqType":"command","cmdData":["clearAlarmAndContinue"]"#, "nearest: `clearAlarmContinue`"),
            (r#""reqType":"heartbeat""#, "nearest: `heartbreak`"),
            (r#""reqType":"actionStop""#, "it is a command"),
            (r#""reqType":"query","queryAddr":["version"],"packID":"1","packID":"2""#, "duplicate key"),
            (
                r#""reqType":"AddRCC","emptyList":"1","instructions":[{"oneshot":"1","action":"14"}]"#,
                "action 14",
            ),
            (r#""reqType":"AddrCC","emptyList":"1","instructions":[]"#, "nearest: `AddRCC`"),
            (r#""queryAddr":["version"]"#, "gets no reply"),
        ] {
            let problems = judge(members).problems;
            assert!(problems.iter().any(|problem| problem.contains(wrong)), "{members}: {problems:?}");
        }
        let finding = Judge::default()
            .judge(br#"{"dsID":"www.hc-system.com.RemoteMonitr","reqType":"heartbreak"}"#, None);
        assert_eq!(finding.problems.len(), 1, "{:?}", finding.problems);
        assert!(finding.problems[0].contains("nearest: `www.hc-system.com.RemoteMonitor`"));
    }

    #[test]
    fn values_that_are_missing_are_found_with_and_without_an_echo() {
        let echoed = judge(r#""reqType":"query","queryAddr":["version","curMold"],"queryData":["v"]"#);
        assert!(
            echoed.problems[0].starts_with("2 addresses were asked for and 1 values came"),
            "{:?}",
            echoed.problems
        );
        let mut judge = Judge::default();
        judge.judge(
            br#"{"dsID":"HCRemoteMonitor","reqType":"query","packID":"7","queryAddr":["version","curMold"]}"#,
            None,
        );
        let reply = judge
            .judge(br#"{"dsID":"HCRemoteMonitor","reqType":"query","packID":"7","queryData":["v"]}"#, None);
        assert_eq!(reply.problems.len(), 1, "{:?}", reply.problems);
        // The query is answered; the next reply belongs to no query that was seen.
        let reply = judge.judge(br#"{"dsID":"HCRemoteMonitor","reqType":"query","queryData":["v"]}"#, None);
        assert_eq!(reply.problems, [""; 0]);
    }

    #[test]
    fn a_frame_that_is_too_long_is_a_problem() {
        let step =
            r#"{"oneshot":"1","action":"4","m0":"0.000","m1":"0.000","ckStatus":"0x3F","speed":"10.0"}"#;
        let list = vec![step; 40].join(",");
        let finding = judge(&format!(r#""reqType":"AddRCC","emptyList":"1","instructions":[{list}]"#));
        assert!(finding.problems.iter().any(|problem| problem.contains("2048")), "{:?}", finding.problems);
        assert!(finding.summary.starts_with("40 instructions, replace the list: axis move"));
    }
}
