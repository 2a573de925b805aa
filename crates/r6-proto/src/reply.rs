//! What a controller sends: replies in a firmware's dialect, and photo requests.

use crate::dialect::{CommandReplyForm, CounterForm, Dialect, DsIdForm, KeyOrder};
use crate::encode::{Decimals, ObjectWriter, key, write_integer, write_quoted_fixed, write_quoted_integer};
use crate::message::reading::Counter;
use crate::message::{Header, RequestType, TypeKey};
use crate::request::ListWriter;
use crate::value::Values;

/// The outcome of a command, AddPoints or AddRCC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict<'a> {
    /// Accepted.
    Ok,
    /// Refused, with the reason.
    Err(&'a str),
    /// Refused without a reason: the reply to AddRCC has no place for one (manual 6).
    BareErr,
    /// AddPoints: how many points the controller took.
    Points(usize),
}

/// Writes the replies to one request into a buffer.
#[derive(Debug)]
pub struct ReplyWriter<'a> {
    dialect: Dialect,
    header: Header<'a>,
    request: RequestType,
}

impl<'a> ReplyWriter<'a> {
    /// Creates a writer for the reply to a request with this header and type.
    #[must_use]
    pub fn new(dialect: Dialect, header: Header<'a>, request: RequestType) -> Self {
        Self { dialect, header, request }
    }

    /// Appends the reply to a query; `fill` writes the values.
    pub fn query(
        &self,
        addresses: Values<'_>,
        out: &mut Vec<u8>,
        fill: impl FnOnce(&mut DataWriter<'_, '_>),
    ) {
        let echo = self.dialect.echo_query_addr.then_some(addresses);
        self.frame(
            out,
            |frame| {
                if let Some(addresses) = echo {
                    let mut list = ListWriter::begin(frame.key(key!("queryAddr")));
                    for address in addresses.iter() {
                        list.item().extend_from_slice(address.wire());
                    }
                    list.end();
                }
                let mut list = ListWriter::begin(frame.key(key!("queryData")));
                fill(&mut DataWriter { list: &mut list, counter: self.dialect.counter });
                list.end();
            },
            |_| {},
        );
    }

    /// Appends the reply to a command, AddPoints or AddRCC. `word` is its name in the reply.
    pub fn verdict(&self, word: &str, verdict: Verdict<'_>, out: &mut Vec<u8>) {
        let reply = |frame: &mut ObjectWriter<'_>| {
            let mut list = ListWriter::begin(frame.key(key!("cmdReply")));
            let named = match self.dialect.command_reply {
                CommandReplyForm::NameAndVerdict => true,
                // In every manual, the templates of AddPoints and AddRCC contain their names.
                CommandReplyForm::Verdict => self.request != RequestType::Command,
            };
            if named {
                list.text(word);
            }
            match verdict {
                Verdict::Ok => list.text("ok"),
                Verdict::Err(reason) if named => {
                    list.text("err");
                    list.text(reason);
                }
                Verdict::BareErr if named => list.text("err"),
                Verdict::Err(_) | Verdict::BareErr => list.text(""),
                Verdict::Points(count) => {
                    write_quoted_integer(list.item(), i64::try_from(count).unwrap_or(i64::MAX));
                }
            }
            list.end();
        };
        match self.dialect.key_order {
            KeyOrder::Alphabetical => self.frame(out, |_| {}, reply),
            KeyOrder::Manual => self.frame(out, reply, |_| {}),
        }
    }

    /// Writes the whole frame. `early` writes the keys that come before `cmdType` in the alphabet, `late`
    /// those between `packID` and `reqType`. In the manual's order only `late` is used.
    fn frame(
        &self,
        out: &mut Vec<u8>,
        late: impl FnOnce(&mut ObjectWriter<'_>),
        early: impl FnOnce(&mut ObjectWriter<'_>),
    ) {
        let mut frame = ObjectWriter::begin(out);
        match self.dialect.key_order {
            KeyOrder::Alphabetical => {
                early(&mut frame);
                if self.header.type_key == TypeKey::CmdType {
                    self.type_word(&mut frame);
                }
                self.ds_id(&mut frame);
                self.pack_id(&mut frame);
                late(&mut frame);
                if self.header.type_key != TypeKey::CmdType {
                    self.type_word(&mut frame);
                }
            }
            KeyOrder::Manual => {
                self.ds_id(&mut frame);
                self.type_word(&mut frame);
                self.pack_id(&mut frame);
                late(&mut frame);
            }
        }
        // The last key in either order.
        if self.dialect.says_virtual {
            frame.key(key!("virtual")).extend_from_slice(b"true");
        }
        frame.end();
    }

    fn ds_id(&self, frame: &mut ObjectWriter<'_>) {
        match &self.header.ds_id {
            Some(ds_id) => frame.key(key!("dsID")).extend_from_slice(ds_id.wire()),
            None => frame.text(key!("dsID"), DsIdForm::Long.ds_id(self.request)),
        }
    }

    fn pack_id(&self, frame: &mut ObjectWriter<'_>) {
        if let Some(pack_id) = self.header.pack_id.as_ref().filter(|_| self.dialect.echo_pack_id) {
            frame.key(key!("packID")).extend_from_slice(pack_id.wire());
        }
    }

    fn type_word(&self, frame: &mut ObjectWriter<'_>) {
        let key = self.header.type_key.key();
        match (self.dialect.type_word(self.request), &self.header.type_word) {
            (Some(word), _) => frame.text(key, word),
            (None, Some(word)) => frame.key(key).extend_from_slice(word.wire()),
            (None, None) => frame.text(key, self.request.word()),
        }
    }
}

/// Writes the values of a query reply, each in the form that controllers use.
pub struct DataWriter<'l, 'o> {
    list: &'l mut ListWriter<'o>,
    counter: CounterForm,
}

impl DataWriter<'_, '_> {
    /// Writes a text.
    pub fn text(&mut self, value: &str) {
        self.list.text(value);
    }

    /// Writes a value as another controller wrote it: one JSON value, with its quotes.
    pub fn wire(&mut self, value: &[u8]) {
        self.list.item().extend_from_slice(value);
    }

    /// Writes a whole number in quotes.
    pub fn integer(&mut self, value: i64) {
        write_quoted_integer(self.list.item(), value);
    }

    /// Writes a decimal number with six decimals, in quotes. A value that is not finite or is beyond ±1e9 is
    /// written as 0.
    pub fn decimal(&mut self, value: f64) {
        let out = self.list.item();
        if write_quoted_fixed(out, "value", value, Decimals::SIX).is_err() {
            out.extend_from_slice(b"\"0.000000\"");
        }
    }

    /// Writes a flag: "1" or "0".
    pub fn flag(&mut self, value: bool) {
        self.integer(i64::from(value));
    }

    /// Writes a list of texts.
    pub fn texts<'t>(&mut self, values: impl IntoIterator<Item = &'t str>) {
        let mut list = ListWriter::begin(self.list.item());
        for value in values {
            list.text(value);
        }
        list.end();
    }

    /// Whether the dialect's form of a counter contains its name.
    #[must_use]
    pub fn names_counters(&self) -> bool {
        match self.counter {
            CounterForm::OldText => true,
            CounterForm::Numbers | CounterForm::Texts => false,
        }
    }

    /// Writes a counter in the dialect's form.
    pub fn counter(&mut self, counter: &Counter) {
        let numbers = [counter.id, counter.target, counter.current];
        match self.counter {
            CounterForm::Numbers => {
                let mut list = ListWriter::begin(self.list.item());
                for number in numbers {
                    write_integer(list.item(), number);
                }
                list.end();
            }
            CounterForm::Texts => {
                let mut list = ListWriter::begin(self.list.item());
                for number in numbers {
                    write_quoted_integer(list.item(), number);
                }
                list.end();
            }
            CounterForm::OldText => {
                let name = counter.name.as_deref().unwrap_or_default();
                let [id, target, current] = numbers;
                self.list.text(&format!("{name}[{id}][T:{target}][C:{current}]"));
            }
        }
    }
}

/// Appends a controller's photo request (manual 5.1; captured, unit D, in this key order).
pub fn encode_photo(cam_id: i64, pack_id: Option<&str>, out: &mut Vec<u8>) {
    let mut frame = ObjectWriter::begin(out);
    frame.text(key!("dsID"), DsIdForm::Long.ds_id(RequestType::Photo));
    frame.text(key!("reqType"), RequestType::Photo.word());
    if let Some(pack_id) = pack_id {
        frame.text(key!("packID"), pack_id);
    }
    frame.bare_integer(key!("camID"), cam_id);
    frame.end();
}
