//! Judges one frame: its meaning and its [`Problem`]s and [`Note`]s, as values with an English text.

mod checks;
mod problem;

use std::fmt;

use r6_proto::message::command::Outcome;
use r6_proto::message::{CommandReply, Message, Query, QueryReply};
use r6_proto::time::Instant;
use r6_proto::{Body, Decoder, RequestType};

pub use problem::{Note, Problem};

use crate::conversation::{Conversation, Request, Side};
use crate::recording::{BrokenFrame, Captured, is_printed_python};

/// Maximum length in characters of a summary, and of a `dsID` in the text of a [`Problem`]: one line of a
/// terminal.
pub const SUMMARY_CHARS: usize = 160;

/// The meaning of one frame, and its problems.
///
/// It has at most as many problems as the frame has bytes, and takes memory in proportion to them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The sender and the receiver of such a frame.
    pub direction: Direction,
    /// Its kind.
    pub kind: FrameKind,
    /// Its content, in one line of at most [`SUMMARY_CHARS`] characters and `…`.
    pub summary: String,
    /// The problems.
    pub problems: Vec<Problem>,
    /// Useful facts that are not problems.
    pub notes: Vec<Note>,
}

/// The sender and the receiver of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Direction {
    /// PC → controller.
    PcToController,
    /// Controller → PC.
    ControllerToPc,
    /// Controller → camera.
    ControllerToCamera,
    /// Camera → controller.
    CameraToController,
    /// Neither the frame nor the recording shows the direction.
    Unknown,
}

impl Direction {
    /// The direction in words; `?` if it is unknown.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::PcToController => "PC → controller",
            Self::ControllerToPc => "controller → PC",
            Self::ControllerToCamera => "controller → camera",
            Self::CameraToController => "camera → controller",
            Self::Unknown => "?",
        }
    }
}

impl From<Option<Side>> for Direction {
    /// The direction, as far as the recording shows it.
    fn from(side: Option<Side>) -> Self {
        match side {
            Some(Side::Pc) => Self::PcToController,
            Some(Side::Controller) => Self::ControllerToPc,
            None => Self::Unknown,
        }
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// The kind of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FrameKind {
    /// Reads values.
    Query,
    /// The values.
    QueryReply,
    /// Acts at once.
    Command,
    /// The reply to a command, to points or to instructions.
    CommandReply,
    /// The PC is alive.
    Heartbreak,
    /// The controller requests a photo.
    Photo,
    /// The camera reports whether it took the photo.
    PhotoAnswer,
    /// Points of a camera.
    AddPoints,
    /// Instructions.
    AddRcc,
    /// JSON of an unknown type.
    Unknown,
    /// A complete frame that is not JSON.
    NoJson,
    /// Bytes that begin like a frame but are not one.
    Broken,
}

impl FrameKind {
    /// In words, such as `query reply`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Query => "query",
            Self::QueryReply => "query reply",
            Self::Command => "command",
            Self::CommandReply => "command reply",
            Self::Heartbreak => "heartbreak",
            Self::Photo => "photo",
            Self::PhotoAnswer => "photo answer",
            Self::AddPoints => "AddPoints",
            Self::AddRcc => "AddRCC",
            Self::Unknown => "unknown",
            Self::NoJson => "no JSON",
            Self::Broken => "broken frame",
        }
    }
}

impl fmt::Display for FrameKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// Judges the frames of one connection or recording, in their order.
///
/// Between frames it keeps the [`Conversation`], with its limits, and the decoder's buffers, which grow to
/// the longest frame.
#[derive(Debug, Default)]
pub struct Judge {
    decoder: Decoder,
    conversation: Conversation,
}

impl Judge {
    /// Judges one frame. The caller gives its sender and time if it knows them.
    pub fn frame(&mut self, frame: &[u8], from: Option<Side>, time: Option<Instant>) -> Finding {
        match self.decoder.decode(frame) {
            Ok(message) => {
                let answered = self.conversation.take(&message, from, time);
                Finding::of(&message, from, answered.as_ref())
            }
            Err(error) => Finding {
                direction: from.into(),
                kind: FrameKind::NoJson,
                summary: excerpt(&String::from_utf8_lossy(frame)),
                problems: vec![if is_printed_python(frame) {
                    Problem::Broken(BrokenFrame::PrintedPython)
                } else {
                    Problem::NoJson(error)
                }],
                notes: Vec::new(),
            },
        }
    }

    /// Judges one frame of a recording, complete or broken.
    pub fn captured(&mut self, captured: &Captured) -> Finding {
        match &captured.frame {
            Ok(frame) => self.frame(frame, captured.from, captured.time),
            Err(error) => Finding {
                direction: captured.from.into(),
                kind: FrameKind::Broken,
                summary: String::new(),
                problems: vec![Problem::Broken(error.clone())],
                notes: Vec::new(),
            },
        }
    }

    /// The conversation so far, with the requests that have no reply yet.
    #[must_use]
    pub fn conversation(&self) -> &Conversation {
        &self.conversation
    }
}

impl Finding {
    /// Judges a message. The caller gives the sender and the answered request if it knows them.
    #[must_use]
    pub fn of(message: &Message<'_>, from: Option<Side>, answered: Option<&Request>) -> Self {
        let (direction, kind) = kind(&message.body);
        let mut finding =
            Self { direction, kind, summary: String::new(), problems: Vec::new(), notes: Vec::new() };
        checks::header(message, &mut finding);
        checks::extras(message, &mut finding);
        finding.body(message, answered);
        finding.summary = excerpt(&finding.summary);
        if from.is_some() {
            finding.direction = from.into();
        }
        finding
    }

    fn body(&mut self, message: &Message<'_>, answered: Option<&Request>) {
        match &message.body {
            Body::Query(query) => self.query(query),
            Body::QueryReply(reply) => self.query_reply(reply, answered),
            Body::Command(command) => checks::command(command, self),
            Body::CommandReply(reply) => self.command_reply(reply),
            Body::Heartbreak => self.notes.push(Note::ArmsWatchdog),
            Body::Photo(photo) => self.summary = format!("camera {}", photo.cam_id),
            Body::PhotoAnswer(answer) => {
                self.summary = format!("camera {}, ret {}", answer.cam_id, answer.ret);
            }
            Body::AddPoints(points) => {
                let sets: Vec<_> = points
                    .sets()
                    .map(|(cam_id, points)| format!("camera {cam_id}: {} points", points.len()))
                    .collect();
                self.summary = sets.join(", ");
            }
            Body::AddRcc(list) => checks::list(message, list, self),
            Body::Unknown(unknown) => self.problems.push(Problem::UnknownType(unknown.to_word())),
            Body::Rejected(rejection) => self.problems.push(Problem::WrongField(rejection.error.clone())),
        }
    }

    fn query(&mut self, query: &Query<'_>) {
        let mut addresses = Vec::new();
        for (word, resolved) in query.resolved() {
            let sent = word.text().into_owned();
            match resolved {
                Ok(address) if address.to_string() != sent => {
                    self.notes.push(Note::OtherSpelling { sent: sent.clone(), address });
                }
                Ok(_) => {}
                Err(error) => self.problems.push(Problem::UnknownAddress(error)),
            }
            addresses.push(sent);
        }
        if addresses.is_empty() {
            self.problems.push(Problem::NothingAsked);
        }
        self.summary = addresses.join(", ");
    }

    fn query_reply(&mut self, reply: &QueryReply<'_>, answered: Option<&Request>) {
        let asked: Vec<_> = match (reply.addresses, answered) {
            (Some(addresses), _) => addresses.iter().map(|address| address.text()).collect(),
            (None, Some(request)) => request.words.iter().map(|word| word.into()).collect(),
            (None, None) => Vec::new(),
        };
        let values = reply.values.iter().map(|value| String::from_utf8_lossy(value.wire()));
        let mut said: Vec<_> = values.map(|value| value.into_owned()).collect();
        if !asked.is_empty() {
            match reply.aligned(asked.len()) {
                Ok(_) => {
                    let pairs = asked.iter().zip(&said).map(|(name, value)| format!("{name}={value}"));
                    said = pairs.collect();
                }
                Err(mismatch) => self.problems.push(Problem::WrongNumberOfValues(mismatch)),
            }
        }
        self.summary = said.join(", ");
    }

    fn command_reply(&mut self, reply: &CommandReply<'_>) {
        let words: Vec<_> = reply.words().iter().map(|word| word.text().into_owned()).collect();
        self.summary = words.join(" ");
        match reply.outcome() {
            Outcome::Ok | Outcome::Points(_) => {}
            Outcome::Refused(reason) => self.notes.push(Note::Refused { reason }),
            Outcome::Unclear(answer) => self.problems.push(Problem::UnclearAnswer { answer }),
        }
    }
}

/// The text in one line, cut at [`SUMMARY_CHARS`].
fn excerpt(text: &str) -> String {
    let one_line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match one_line.char_indices().nth(SUMMARY_CHARS) {
        Some((end, _)) => format!("{}…", one_line.get(..end).unwrap_or_default()),
        None => one_line,
    }
}

/// Direction and kind of a frame.
fn kind(body: &Body<'_>) -> (Direction, FrameKind) {
    use Direction::{CameraToController, ControllerToCamera, ControllerToPc, PcToController, Unknown};
    match body {
        Body::Query(_) => (PcToController, FrameKind::Query),
        Body::QueryReply(_) => (ControllerToPc, FrameKind::QueryReply),
        Body::Command(_) => (PcToController, FrameKind::Command),
        Body::CommandReply(_) => (ControllerToPc, FrameKind::CommandReply),
        Body::Heartbreak => (PcToController, FrameKind::Heartbreak),
        Body::Photo(_) => (ControllerToCamera, FrameKind::Photo),
        Body::PhotoAnswer(_) => (CameraToController, FrameKind::PhotoAnswer),
        Body::AddPoints(_) => (CameraToController, FrameKind::AddPoints),
        Body::AddRcc(_) => (PcToController, FrameKind::AddRcc),
        Body::Unknown(_) => (Unknown, FrameKind::Unknown),
        // Requests and their replies have the same types.
        Body::Rejected(rejection) => match rejection.request {
            RequestType::Query => (Unknown, FrameKind::Query),
            RequestType::Command => (Unknown, FrameKind::Command),
            RequestType::Heartbreak => (PcToController, FrameKind::Heartbreak),
            RequestType::Photo => (Unknown, FrameKind::Photo),
            RequestType::AddPoints => (CameraToController, FrameKind::AddPoints),
            RequestType::AddRcc => (PcToController, FrameKind::AddRcc),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DS_ID: &str = r#""dsID":"www.hc-system.com.RemoteMonitor""#;

    fn judge(members: &str) -> Finding {
        Judge::default().frame(format!("{{{DS_ID},{members}}}").as_bytes(), None, None)
    }

    #[test]
    fn a_right_frame_has_no_problem() {
        let finding = judge(r#""reqType":"query","queryAddr":["version","axis-0"]"#);
        assert_eq!((finding.direction, finding.kind), (Direction::PcToController, FrameKind::Query));
        assert_eq!((finding.direction.word(), finding.kind.word()), ("PC → controller", "query"));
        assert_eq!(finding.summary, "version, axis-0");
        assert_eq!(finding.problems, []);
    }

    #[test]
    fn the_side_that_sent_a_frame_counts_more_than_its_kind() {
        let photo = br#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#;
        for (from, direction) in [
            (None, Direction::ControllerToCamera),
            (Some(Side::Controller), Direction::ControllerToPc),
            (Some(Side::Pc), Direction::PcToController),
        ] {
            assert_eq!(Judge::default().frame(photo, from, None).direction, direction, "{from:?}");
        }
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
                "instructions[0]: action 14 is not known",
            ),
            (r#""reqType":"AddrCC","emptyList":"1","instructions":[]"#, "nearest: `AddRCC`"),
            (r#""queryAddr":["version"]"#, "gets no reply"),
        ] {
            let problems = judge(members).problems;
            assert!(
                problems.iter().any(|problem| problem.to_string().contains(wrong)),
                "{members}: {problems:?}"
            );
        }
    }

    #[test]
    fn what_is_wrong_has_fields() {
        let frame = br#"{"dsID":"www.hc-system.com.RemoteMonitr","reqType":"query","queryAddr":["curAlrm"]}"#;
        let problems = Judge::default().frame(frame, None, None).problems;
        let [Problem::UnknownDsId { ds_id, nearest }, Problem::UnknownAddress(address)] = &problems[..]
        else {
            panic!("{problems:?}")
        };
        assert_eq!(ds_id, "www.hc-system.com.RemoteMonitr");
        assert_eq!(*nearest, Some("www.hc-system.com.RemoteMonitor"));
        assert_eq!(address.nearest().map(|row| row.name), Some("curAlarm"));
        assert_eq!(
            problems[0].to_string(),
            "`dsID` is `www.hc-system.com.RemoteMonitr`, which is not known; nearest: `www.hc-system.com.RemoteMonitor`"
        );
    }

    #[test]
    fn values_that_are_missing_are_found_with_and_without_an_echo() {
        let echoed = judge(r#""reqType":"query","queryAddr":["version","curMold"],"queryData":["v"]"#);
        assert!(
            echoed.problems[0].to_string().starts_with("2 addresses were asked for and 1 values came"),
            "{:?}",
            echoed.problems
        );
        let mut judge = Judge::default();
        let mut frame = |members| {
            judge.frame(format!("{{\"dsID\":\"HCRemoteMonitor\",{members}}}").as_bytes(), None, None)
        };
        frame(r#""reqType":"query","packID":"7","queryAddr":["version","curMold"]"#);
        let reply = frame(r#""reqType":"query","packID":"7","queryData":["v"]"#);
        assert_eq!(reply.problems.len(), 1, "{:?}", reply.problems);
        // The query is answered, so the next reply belongs to no query that was seen.
        let reply = frame(r#""reqType":"query","queryData":["v"]"#);
        assert_eq!(reply.problems, []);
        frame(r#""reqType":"query","queryAddr":["version","curMold"]"#);
        let reply = frame(r#""reqType":"query","queryData":["v","w"]"#);
        assert_eq!((&*reply.summary, reply.problems), (r#"version="v", curMold="w""#, vec![]));
    }

    #[test]
    fn a_frame_that_is_too_long_is_a_problem() {
        let step =
            r#"{"oneshot":"1","action":"4","m0":"0.000","m1":"0.000","ckStatus":"0x3F","speed":"10.0"}"#;
        let list = vec![step; 40].join(",");
        let finding = judge(&format!(r#""reqType":"AddRCC","emptyList":"1","instructions":[{list}]"#));
        let [Problem::TooLongAddRcc { bytes }] = finding.problems[..] else {
            panic!("{:?}", finding.problems)
        };
        assert!(bytes > list.len());
        assert!(finding.problems[0].to_string().contains("2048"));
        assert_eq!(finding.summary, "40 instructions, replace the list: axis move");
    }

    #[test]
    fn notes_are_no_problems() {
        for (members, note) in [
            (r#""reqType":"heartbreak""#, "arms the controller's watchdog"),
            (r#""cmdType":"query","queryAddr":["version"]"#, "older firmware"),
            (r#""reqType":"query","queryAddr":["boardIONum"]"#, "`boardIONum` is also spelt `boardIOnum`"),
            (r#""reqType":"command","cmdData":["actionStop","1"]"#, "actionStop takes 0 arguments, 1 given"),
            (r#""reqType":"command","cmdReply":["actionStop","err","why"]"#, "refused: why"),
            (r#""reqType":"command","cmdReply":["actionStop","err"]"#, "refused, without a reason"),
            (
                r#""reqType":"AddRCC","emptyList":"1","instructions":[{"oneshot":"0","action":"800","cnt_id":"1"}]"#,
                "starts over",
            ),
        ] {
            let finding = judge(members);
            let notes: Vec<_> = finding.notes.iter().map(ToString::to_string).collect();
            assert!(notes.len() == 1 && notes[0].contains(note), "{members}: {notes:?}");
            assert_eq!(finding.problems, [], "{members}");
        }
        // The second argument gives the number of values.
        let list = judge(r#""reqType":"command","cmdData":["rewriteDataList","800","2","0","1","2"]"#);
        assert_eq!((list.problems, list.notes), (vec![], vec![]));
    }
}
