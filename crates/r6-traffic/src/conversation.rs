//! Conversations: pairs each reply with the request that it answers.
//!
//! A reply with a `packID` answers the latest request with the same `packID`. A reply without a `packID`
//! answers the earliest request that it can answer. If the reply names what it answers (the addresses of a
//! query, the word of a command, the number of a camera), the request must have the same.
//!
//! Some controllers neither echo `packID` nor name what they answer. If such a controller leaves one request
//! unanswered, every later reply of the same kind is paired with the request before its own. Nothing on the
//! wire shows this.

use std::collections::VecDeque;

use r6_proto::message::Message;
use r6_proto::time::Instant;
use r6_proto::value::Values;
use r6_proto::{Body, RequestType};
use serde::{Deserialize, Serialize};

/// How many requests can wait for their replies. Beyond this, the earliest request is forgotten. No client
/// has so many requests in flight.
pub const MAX_OPEN: usize = 256;

/// How many bytes of memory the waiting requests can take. Beyond this, the earliest requests are forgotten.
/// 16 MiB hold 20 to 256 queries of the longest frame (64 KiB), depending on the length of their addresses.
pub const MAX_OPEN_BYTES: usize = MAX_OPEN * 65_536;

/// One end of the link between a PC and a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The PC, or a camera.
    Pc,
    /// The controller.
    Controller,
}

/// A request of a conversation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Its type; never [`RequestType::Heartbreak`], which has no reply.
    pub kind: RequestType,
    /// Its `packID`, as text.
    pub pack_id: Option<String>,
    /// Its subject, as sent: the addresses of a query, the word of a command, `AddPoints`, `AddRCC`, or the
    /// number of a camera.
    pub words: Vec<String>,
    /// When it was seen, if the caller gave the time.
    pub time: Option<Instant>,
}

impl Request {
    /// Its approximate size in memory, in bytes.
    fn bytes(&self) -> usize {
        let texts = self.words.iter().chain(&self.pack_id);
        size_of::<Self>() + texts.map(|text| text.len() + size_of::<String>()).sum::<usize>()
    }
}

/// Pairs the replies of one connection with their requests.
///
/// It keeps at most [`MAX_OPEN`] requests, and at most [`MAX_OPEN_BYTES`] bytes of them.
#[derive(Clone, Debug, Default)]
pub struct Conversation {
    /// Earliest first.
    open: VecDeque<Request>,
    bytes: usize,
}

impl Conversation {
    /// Takes the next frame, and returns the request that it answers.
    ///
    /// Returns `None` if the frame is not a reply, or if its request was not seen, is answered already or was
    /// forgotten. If `from` is given, a frame of a kind that the other side sends is ignored, because it is
    /// an echo.
    pub fn take(
        &mut self,
        message: &Message<'_>,
        from: Option<Side>,
        time: Option<Instant>,
    ) -> Option<Request> {
        if from.is_some() && from != sender(&message.body) {
            return None;
        }
        let pack_id = message.header.pack_id.map(|pack_id| pack_id.text().into_owned());
        match role(&message.body) {
            Role::Request(kind, words) => {
                self.remember(Request { kind, pack_id, words, time });
                None
            }
            Role::Reply(kinds, names) => self.answered(kinds, pack_id.as_deref(), names.as_deref()),
            Role::Neither => None,
        }
    }

    /// The requests without a reply, earliest first.
    pub fn open(&self) -> impl ExactSizeIterator<Item = &Request> {
        self.open.iter()
    }

    fn remember(&mut self, request: Request) {
        self.bytes += request.bytes();
        self.open.push_back(request);
        while self.open.len() > MAX_OPEN || self.bytes > MAX_OPEN_BYTES {
            self.remove(0);
        }
    }

    fn answered(
        &mut self,
        kinds: &[RequestType],
        pack_id: Option<&str>,
        names: Option<&[String]>,
    ) -> Option<Request> {
        let fits = |request: &Request| {
            kinds.contains(&request.kind) && names.is_none_or(|names| names == request.words)
        };
        let at = match pack_id {
            Some(_) => self.open.iter().rposition(|open| open.pack_id.as_deref() == pack_id && fits(open)),
            None => self.open.iter().position(fits),
        };
        self.remove(at?)
    }

    fn remove(&mut self, at: usize) -> Option<Request> {
        let request = self.open.remove(at)?;
        self.bytes -= request.bytes();
        Some(request)
    }
}

/// The side that sends frames of this kind; `None` if the kind does not show it.
fn sender(body: &Body<'_>) -> Option<Side> {
    match body {
        Body::Query(_)
        | Body::Command(_)
        | Body::Heartbreak
        | Body::PhotoAnswer(_)
        | Body::AddPoints(_)
        | Body::AddRcc(_) => Some(Side::Pc),
        Body::QueryReply(_) | Body::CommandReply(_) | Body::Photo(_) => Some(Side::Controller),
        Body::Unknown(_) | Body::Rejected(_) => None,
    }
}

/// The role of a frame in its conversation.
enum Role {
    /// A request with its subject.
    Request(RequestType, Vec<String>),
    /// A reply to a request of one of these types, with the subject of the request if the reply names it.
    Reply(&'static [RequestType], Option<Vec<String>>),
    /// Neither a request nor a reply.
    Neither,
}

fn role(body: &Body<'_>) -> Role {
    use RequestType::{AddPoints, AddRcc, Command, Photo, Query};
    match body {
        Body::Query(query) => Role::Request(Query, texts(query.addresses)),
        Body::QueryReply(reply) => Role::Reply(&[Query], reply.addresses.map(texts)),
        Body::Command(command) => Role::Request(Command, vec![command.word().into_owned()]),
        Body::AddPoints(_) => Role::Request(AddPoints, vec![AddPoints.word().to_owned()]),
        Body::AddRcc(_) => Role::Request(AddRcc, vec![AddRcc.word().to_owned()]),
        Body::CommandReply(reply) => match reply.command() {
            Some(word) => Role::Reply(&[Command, AddPoints, AddRcc], Some(vec![word.into_owned()])),
            // Before 2.0.2.1 the replies to commands have no name. Replies to AddPoints and AddRCC have one
            // in every manual.
            None => Role::Reply(&[Command], None),
        },
        Body::Photo(photo) => Role::Request(Photo, vec![photo.cam_id.to_string()]),
        Body::PhotoAnswer(answer) => Role::Reply(&[Photo], Some(vec![answer.cam_id.to_string()])),
        Body::Heartbreak | Body::Unknown(_) | Body::Rejected(_) => Role::Neither,
    }
}

fn texts(values: Values<'_>) -> Vec<String> {
    values.iter().map(|value| value.text().into_owned()).collect()
}

#[cfg(test)]
mod tests {
    use r6_proto::Decoder;

    use super::*;

    const PC: Option<Side> = Some(Side::Pc);
    const CONTROLLER: Option<Side> = Some(Side::Controller);

    /// For each frame, the words of the request that it answers.
    fn answers(frames: &[(Option<Side>, &str)]) -> Vec<Option<String>> {
        let (mut decoder, mut conversation) = (Decoder::new(), Conversation::default());
        let mut take = |(from, members): &(Option<Side>, &str)| {
            let frame = format!("{{\"dsID\":\"HCRemoteMonitor\",{members}}}");
            let answered = conversation.take(&decoder.decode(frame.as_bytes()).unwrap(), *from, None);
            answered.map(|request| request.words.join(" "))
        };
        frames.iter().map(&mut take).collect()
    }

    fn paired(frames: &[(Option<Side>, &str)]) -> Vec<String> {
        answers(frames).into_iter().flatten().collect()
    }

    const ASKS: [&str; 2] = [
        r#""reqType":"query","packID":"1","queryAddr":["version"]"#,
        r#""reqType":"query","packID":"2","queryAddr":["curMode","origin"]"#,
    ];

    #[test]
    fn a_pack_id_pairs_in_any_order_and_once() {
        let reply = |pack_id| format!(r#""reqType":"query","packID":"{pack_id}","queryData":["1"]"#);
        let [first, second, other] = [1, 2, 3].map(reply);
        let frames = [ASKS[0], ASKS[1], &second, &other, &first, &first].map(|frame| (None, frame));
        let answered = [None, None, Some("curMode origin"), None, Some("version"), None];
        assert_eq!(answers(&frames), answered.map(|words| words.map(str::to_owned)));
    }

    #[test]
    fn one_pack_id_for_all_pairs_with_the_latest_that_is_about_the_same() {
        let ask = |address| format!(r#""reqType":"query","packID":"0","queryAddr":["{address}"]"#);
        let reply = r#""reqType":"query","packID":"0","queryData":["1"]"#;
        let echo = r#""reqType":"query","packID":"0","queryAddr":["version"],"queryData":["1"]"#;
        let (version, mode) = (ask("version"), ask("curMode"));
        assert_eq!(paired(&[(None, &version), (None, &mode), (None, reply)]), ["curMode"]);
        assert_eq!(paired(&[(None, &version), (None, &mode), (None, echo)]), ["version"]);
    }

    #[test]
    fn without_a_pack_id_order_and_names_pair() {
        let plain = r#""reqType":"query","queryData":["1"]"#;
        let echo = r#""reqType":"query","queryAddr":["curMode","origin"],"queryData":["1","1"]"#;
        let asked = [(PC, ASKS[0]), (PC, ASKS[1])];
        let with = |replies: [&'static str; 2]| [asked, replies.map(|reply| (CONTROLLER, reply))].concat();
        assert_eq!(paired(&with([plain, plain])), ["version", "curMode origin"]);
        assert_eq!(paired(&with([echo, plain])), ["curMode origin", "version"]);
        assert_eq!(paired(&with([echo, echo])), ["curMode origin"]);
    }

    #[test]
    fn every_kind_of_request_is_paired_with_its_own_replies() {
        let frames = [
            (PC, r#""reqType":"command","cmdData":["actionPause"]"#),
            (PC, r#""reqType":"AddRCC","emptyList":"1","instructions":[]"#),
            (PC, r#""reqType":"command","cmdData":["actionStop"]"#),
            (CONTROLLER, r#""reqType":"photo","camID":3"#),
            (PC, r#""reqType":"heartbreak""#),
            (CONTROLLER, r#""reqType":"command","cmdReply":["AddRCC","ok"]"#),
            (PC, r#""reqType":"photo","camID":4,"ret":1"#),
            (PC, r#""reqType":"photo","camID":3,"ret":1"#),
            (CONTROLLER, r#""reqType":"command","cmdReply":["actionStop","ok"]"#),
            (CONTROLLER, r#""reqType":"command","cmdReply":["ok"]"#),
            (CONTROLLER, r#""reqType":"command","cmdReply":["ok"]"#),
        ];
        assert_eq!(paired(&frames), ["AddRCC", "3", "actionStop", "actionPause"]);
    }

    #[test]
    fn an_echo_of_a_request_is_no_request() {
        let reply = r#""reqType":"query","queryData":["1"]"#;
        let echoed = [(PC, ASKS[0]), (CONTROLLER, ASKS[0]), (CONTROLLER, reply), (CONTROLLER, reply)];
        assert_eq!(paired(&echoed), ["version"]);
        assert_eq!(paired(&[(PC, ASKS[0]), (PC, reply)]), [""; 0]);
    }

    #[test]
    fn requests_without_replies_are_bounded_in_number_and_bytes() {
        let (mut decoder, mut conversation) = (Decoder::new(), Conversation::default());
        for number in 0..=MAX_OPEN {
            let frame =
                format!("{{\"reqType\":\"query\",\"packID\":\"{number}\",\"queryAddr\":[\"version\"]}}");
            conversation.take(&decoder.decode(frame.as_bytes()).unwrap(), None, None);
        }
        assert_eq!(conversation.open().len(), MAX_OPEN);
        assert_eq!(conversation.open().next().unwrap().pack_id.as_deref(), Some("1"));

        let addresses = vec![r#""""#; 21_000].join(",");
        let frame = format!("{{\"reqType\":\"query\",\"queryAddr\":[{addresses}]}}");
        for _ in 0..100 {
            conversation.take(&decoder.decode(frame.as_bytes()).unwrap(), None, None);
            let bytes: usize = conversation.open().map(Request::bytes).sum();
            assert!(bytes == conversation.bytes && bytes <= MAX_OPEN_BYTES);
        }
        assert!((20..100).contains(&conversation.open().len()), "{}", conversation.open().len());
    }
}
