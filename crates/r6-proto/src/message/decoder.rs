//! The decoder: one pass over a frame, into buffers that are reused for the next.
//!
//! This file reads the members at the top and decides the type of the frame. `lists` reads the nested lists.
//!
//! # From bytes to a message
//!
//! 1. `FrameBuffer` (`frame.rs`) finds the end of an object: it counts brackets and skips strings
//!    (`text.rs`).
//! 2. [`Decoder`] reads the object once (`json.rs`) and stores positions (`Node`, `value.rs`) in buffers that
//!    are reused.
//! 3. It gives a [`Message`] that borrows from the bytes. Addresses that are queried by name become an
//!    `Address`.
//!
//! Each fact of the protocol is in one row of one table:
//!
//! | facts | table |
//! |---|---|
//! | addresses | `address/table.rs` |
//! | commands and their arguments | `message/command/table.rs` |
//! | actions | `message/action.rs` |
//! | members of instructions | `message/instruction/table.rs` |
//! | members at the top and in points | `message/top.rs`, `message/fields.rs` |
//!
//! There are two faster ways for frames that arrive all the time. They decide nothing, and stop at anything
//! unusual:
//!
//! - `message/fast.rs` compares each key with the key at its place last time, sixteen bytes at once
//!   (`sixteen_bytes.rs`).
//! - `message/decoder/again.rs` recognises the reply of a repeated query by the bytes around its values.
//!
//! `tests/fast_path.rs` compares both with the slow way. To understand decoding, skip them.

mod again;
mod lists;

use crate::error::{FieldError, FieldPath, JsonError, Wanted};
use crate::json::Cursor;
use crate::message::decoder::again::LastReply;
use crate::message::decoder::lists::Lists;
use crate::message::extra::{ExtraKind, ExtraNode, Place};
use crate::message::fast::{self, Habit, Pattern};
use crate::message::fields::excerpt;
use crate::message::top::Top;
use crate::message::{
    AddPoints, AddRcc, Body, CommandReply, CommandWords, Header, Message, Photo, PhotoAnswer, Query,
    QueryReply, Rejection, RequestType, TypeKey, UnknownType,
};
use crate::value::{Kind, Node, Span, Value, Values};

/// The keys at the top, prepared for comparison.
static PATTERNS: [Pattern; TOP_COUNT] = Pattern::all(Top::KEYS);

const TOP_COUNT: usize = Top::KEYS.len();

/// The members found at the top of a frame: key and value by slot.
#[derive(Clone, Copy, Debug)]
struct TopNodes {
    members: [(Node, Node); TOP_COUNT],
    /// Which slots hold a member, as bits.
    present: u32,
}

impl TopNodes {
    const NONE: Self = Self { members: [(Node::NULL, Node::NULL); TOP_COUNT], present: 0 };

    /// Stores a member, and returns the earlier member with the same key.
    #[inline]
    fn put(&mut self, top: Top, member: (Node, Node)) -> Option<(Node, Node)> {
        let earlier = self.members.get_mut(top as usize).map(|slot| std::mem::replace(slot, member));
        let had = self.has(top);
        self.present |= top.bit();
        earlier.filter(|_| had)
    }

    #[inline]
    fn at(&self, top: Top) -> Option<Node> {
        self.members.get(top as usize).filter(|_| self.has(top)).map(|(_, value)| *value)
    }

    #[inline]
    fn value<'a>(&self, top: Top, bytes: &'a [u8]) -> Option<Value<'a>> {
        self.at(top).map(|node| Value::new(bytes, node))
    }

    #[inline]
    fn has(&self, top: Top) -> bool {
        self.present & top.bit() != 0
    }

    /// The slots of the members after this place in the frame, as bits.
    fn slots_behind(&self, place: usize) -> u32 {
        Top::ALL
            .into_iter()
            .filter(|top| self.at(*top).is_some_and(|value| value.span.start as usize > place))
            .fold(0, |slots, top| slots | top.bit())
    }

    /// Moves the members in these slots: their distance behind `from` becomes their distance behind `to`.
    #[inline]
    fn move_members(&mut self, mut slots: u32, from: usize, to: usize) {
        while slots != 0 {
            if let Some((key, value)) = self.members.get_mut(slots.trailing_zeros() as usize) {
                key.span = key.span.moved(from, to);
                value.span = value.span.moved(from, to);
            }
            slots &= slots - 1;
        }
    }
}

/// Decodes frames into messages. Its buffers grow to the largest frame seen and are reused.
///
/// In the steady state, decoding allocates nothing. One decoder can serve one connection, or several in turn.
#[derive(Debug, Default)]
pub struct Decoder {
    addresses: Vec<Node>,
    data: Vec<Node>,
    words: Vec<Node>,
    reply: Vec<Node>,
    lists: Lists,
    extras: Vec<ExtraNode>,
    error: Option<FieldError>,
    habit: Habit<TOP_COUNT>,
    last_reply: LastReply,
}

impl Decoder {
    /// A decoder with empty buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Decodes one frame: the bytes of one JSON object, as [`crate::frame::FrameBuffer`] delivers them.
    ///
    /// # Errors
    /// [`JsonError`] if the bytes are not a JSON object. A well-formed object with wrong fields gives a
    /// [`Body::Rejected`] instead.
    pub fn decode<'a>(&'a mut self, bytes: &'a [u8]) -> Result<Message<'a>, JsonError> {
        if self.length_of_same_reply(bytes) == Some(bytes.len()) {
            return Ok(self.same_reply(bytes));
        }
        self.clear();
        let mut top = TopNodes::NONE;
        self.members(bytes, &mut top)?;
        let (header, request) = self.header(bytes, &top);
        let body = self.classify(bytes, &top, &header, request)?;
        self.report_out_of_place(&top, body);
        if self.extras.is_empty() {
            self.last_reply.keep(bytes, &top, body, &self.data);
        }
        let body = self.view(bytes, &top, &header, body);
        Ok(Message { header, body, bytes, extras: &self.extras })
    }

    /// If `bytes` begin with the last decoded reply, with another number and other values, returns the length
    /// of that frame. [`Self::same_reply`] then returns its message.
    #[inline]
    pub(crate) fn length_of_same_reply(&mut self, bytes: &[u8]) -> Option<usize> {
        self.last_reply.length_of(bytes, &mut self.data)
    }

    /// The message of a frame that [`Self::length_of_same_reply`] found.
    #[inline]
    pub(crate) fn same_reply<'a>(&'a self, bytes: &'a [u8]) -> Message<'a> {
        let top = &self.last_reply.top;
        let (header, _) = self.header(bytes, top);
        let body = self.view(bytes, top, &header, Shape::QueryReply);
        Message { header, body, bytes, extras: &[] }
    }

    fn clear(&mut self) {
        self.last_reply.forget();
        self.addresses.clear();
        self.data.clear();
        self.words.clear();
        self.reply.clear();
        self.lists.clear();
        self.extras.clear();
        self.error = None;
    }

    /// Reads every member at the top. Lists of values go directly into their buffers.
    #[inline]
    fn members(&mut self, bytes: &[u8], top: &mut TopNodes) -> Result<(), JsonError> {
        let mut cursor = Cursor::new(bytes, 0);
        cursor.open_object()?;
        self.habit.begin();
        let mut first = true;
        while let Some((known, key)) = self.next_key(&mut cursor, bytes, first)? {
            first = false;
            let value = match known {
                Some(Top::QueryAddr) => list(&mut cursor, bytes, &mut self.addresses)?,
                Some(Top::QueryData) => list(&mut cursor, bytes, &mut self.data)?,
                Some(Top::CmdData) => list(&mut cursor, bytes, &mut self.words)?,
                Some(Top::CmdReply) => list(&mut cursor, bytes, &mut self.reply)?,
                Some(Top::Instructions) if cursor.stands_at(b'[') => {
                    self.lists.instructions(&mut cursor, bytes, &mut self.extras)?
                }
                Some(Top::DsData) if cursor.stands_at(b'[') && says_add_points(top, bytes) => {
                    self.lists.cameras(&mut cursor, bytes, &mut self.extras)?
                }
                Some(_) | None => match fast::plain_text(bytes, cursor.at()) {
                    Some(node) => {
                        cursor.go_to(node.span.end as usize + 1);
                        node
                    }
                    None => cursor.value()?,
                },
            };
            let extra = match known {
                None => Some((key, value, ExtraKind::UnknownKey)),
                Some(known) => {
                    top.put(known, (key, value)).map(|(key, value)| (key, value, ExtraKind::DuplicateKey))
                }
            };
            if let Some((key, value, kind)) = extra {
                self.extras.push(ExtraNode { place: Place::Top, key, value, kind });
            }
        }
        cursor.end()
    }

    /// Reads the next key at the top and its meaning, and stops at its value; `None` after the last brace.
    #[inline]
    fn next_key(
        &mut self,
        cursor: &mut Cursor<'_>,
        bytes: &[u8],
        first: bool,
    ) -> Result<Option<(Option<Top>, Node)>, JsonError> {
        if first || cursor.stands_at(b',') {
            let at = cursor.at() + usize::from(!first);
            let slot_of = |name: &[u8]| Top::of(name).map(|top| top as usize);
            if let Some((slot, key, value)) = self.habit.key(bytes, at, &PATTERNS, slot_of) {
                cursor.go_to(value);
                cursor.skip_blank();
                return Ok(Some((Top::ALL.get(slot).copied(), key)));
            }
        }
        let key = cursor.next_key(first)?;
        Ok(key.map(|key| (Top::of(&Value::new(bytes, key).word()), key)))
    }

    fn header<'a>(&self, bytes: &'a [u8], top: &TopNodes) -> (Header<'a>, Option<RequestType>) {
        let (type_key, type_word) = match (top.value(Top::ReqType, bytes), top.value(Top::CmdType, bytes)) {
            (Some(word), _) => (TypeKey::ReqType, Some(word)),
            (None, Some(word)) => (TypeKey::CmdType, Some(word)),
            (None, None) => (TypeKey::Absent, None),
        };
        let request = match type_word {
            Some(word) => RequestType::from_word(&word.word()),
            None => guess(top),
        };
        let header = Header {
            ds_id: top.value(Top::DsId, bytes),
            type_key,
            type_word,
            pack_id: top.value(Top::PackId, bytes),
        };
        (header, request)
    }

    /// Decides the type of the frame, and reads the nested lists that this needs.
    fn classify(
        &mut self,
        bytes: &[u8],
        top: &TopNodes,
        header: &Header<'_>,
        request: Option<RequestType>,
    ) -> Result<Shape, JsonError> {
        let Some(request) = request else { return Ok(Shape::Unknown) };
        let echo = header.type_word.is_some_and(|word| matches!(&*word.word(), b"queryEcho" | b"cmdEcho"));
        let shape = match request {
            _ if top.has(Top::CmdReply) && request != RequestType::Query => Shape::CommandReply,
            RequestType::Query if top.has(Top::QueryData) || echo => Shape::QueryReply,
            RequestType::Query => Shape::Query,
            RequestType::Command if echo => Shape::CommandReply,
            RequestType::Command => Shape::Command,
            RequestType::Heartbreak => Shape::Heartbreak,
            RequestType::Photo if top.has(Top::Ret) => Shape::PhotoAnswer,
            RequestType::Photo => Shape::Photo,
            RequestType::AddPoints => Shape::AddPoints,
            RequestType::AddRcc if !top.has(Top::Instructions) && top.has(Top::DsData) => Shape::AddRcc2020,
            RequestType::AddRcc => Shape::AddRcc,
        };
        let checked = match shape {
            Shape::Query => require_list(
                bytes,
                top,
                Top::QueryAddr,
                Wanted(&["a list of query addresses", "查询地址的列表"]),
            ),
            Shape::QueryReply => {
                require_list(bytes, top, Top::QueryData, Wanted(&["a list of values", "值的列表"]))
            }
            Shape::Command => require_list(
                bytes,
                top,
                Top::CmdData,
                Wanted(&["a list: the command's name and arguments", "列表：命令名和参数"]),
            )
            .and_then(|()| self.require_name(bytes)),
            Shape::CommandReply => require_reply(bytes, top),
            Shape::Photo => require_integer(bytes, top, Top::CamId),
            Shape::PhotoAnswer => {
                require_integer(bytes, top, Top::CamId).and_then(|()| require_integer(bytes, top, Top::Ret))
            }
            Shape::AddPoints => {
                match require_list(
                    bytes,
                    top,
                    Top::DsData,
                    Wanted(&["a list of cameras with their points", "相机及其视觉点位的列表"]),
                ) {
                    Ok(()) => self.lists.checked_cameras(bytes, top.at(Top::DsData), &mut self.extras)?,
                    Err(error) => Err(error),
                }
            }
            Shape::AddRcc => {
                require_list(bytes, top, Top::Instructions, Wanted(&["a list of instructions", "指令列表"]))
                    .and_then(|()| require_flag(bytes, top))
                    .and_then(|()| self.lists.checked_instructions())
            }
            Shape::AddRcc2020 => {
                match require_list(bytes, top, Top::DsData, Wanted(&["a list of instructions", "指令列表"]))
                    .and_then(|()| require_flag(bytes, top))
                {
                    Ok(()) => {
                        let sets = top.value(Top::DsData, bytes);
                        self.lists.instructions_2020(bytes, sets, &mut self.extras)?
                    }
                    Err(error) => Err(error),
                }
            }
            Shape::Heartbreak | Shape::Unknown | Shape::Rejected(_) => Ok(()),
        };
        Ok(match checked {
            Ok(()) => shape,
            Err(error) => {
                self.error = Some(error);
                Shape::Rejected(request)
            }
        })
    }

    fn require_name(&self, bytes: &[u8]) -> Result<(), FieldError> {
        const WANTED: Wanted = Wanted(&["the name of a command", "命令名"]);
        match self.words.first().map(|node| Value::new(bytes, *node)) {
            Some(name) if name.is_text() => Ok(()),
            found => Err(FieldError {
                path: FieldPath::Member("cmdData[0]".to_owned()),
                found: found.map(excerpt),
                wanted: WANTED,
                nearest: None,
            }),
        }
    }

    /// Reports members that are known but have no meaning in a frame of this shape.
    fn report_out_of_place(&mut self, top: &TopNodes, shape: Shape) {
        let used = match shape {
            Shape::Query => Top::QueryAddr.bit(),
            Shape::QueryReply => Top::QueryAddr.bit() | Top::QueryData.bit(),
            Shape::Command => Top::CmdData.bit(),
            Shape::CommandReply => Top::CmdReply.bit(),
            Shape::Heartbreak => 0,
            Shape::Photo => Top::CamId.bit(),
            Shape::PhotoAnswer => Top::CamId.bit() | Top::Ret.bit(),
            Shape::AddPoints => Top::DsData.bit(),
            Shape::AddRcc => Top::EmptyList.bit() | Top::Instructions.bit(),
            Shape::AddRcc2020 => Top::EmptyList.bit() | Top::DsData.bit(),
            Shape::Unknown | Shape::Rejected(_) => return,
        };
        let both_types = top.has(Top::ReqType) && top.has(Top::CmdType);
        let type_keys = Top::ReqType.bit() | if both_types { 0 } else { Top::CmdType.bit() };
        let unused = top.present & !(used | type_keys | Top::DsId.bit() | Top::PackId.bit());
        if unused == 0 {
            return;
        }
        for (known, (key, value)) in Top::ALL.into_iter().zip(top.members) {
            if unused & known.bit() != 0 {
                self.extras.push(ExtraNode { place: Place::Top, key, value, kind: ExtraKind::OutOfPlace });
            }
        }
    }

    fn view<'a>(&'a self, bytes: &'a [u8], top: &TopNodes, header: &Header<'a>, shape: Shape) -> Body<'a> {
        let values = |nodes: &'a Vec<Node>| Values { bytes, nodes };
        let integer = |key| top.value(key, bytes).and_then(|value| value.integer()).unwrap_or_default();
        let empty_list = || top.value(Top::EmptyList, bytes).and_then(|value| value.flag());
        let add_rcc = |shape_2020| AddRcc {
            empty_list: empty_list(),
            instructions: self.lists.found_instructions(),
            shape_2020,
            without_oneshot: self.lists.found_without_oneshot(),
            bytes,
            fields: self.lists.found_fields(),
        };
        match shape {
            Shape::Query => Body::Query(Query { addresses: values(&self.addresses) }),
            Shape::QueryReply => Body::QueryReply(QueryReply {
                addresses: top.has(Top::QueryAddr).then(|| values(&self.addresses)),
                values: values(&self.data),
            }),
            Shape::Command => Body::Command(CommandWords { words: values(&self.words) }),
            Shape::CommandReply => Body::CommandReply(match top.value(Top::CmdReply, bytes) {
                Some(text) if !text.is_list() => CommandReply::of_text(text),
                Some(_) | None => CommandReply::of_words(values(&self.reply)),
            }),
            Shape::Heartbreak => Body::Heartbreak,
            Shape::Photo => Body::Photo(Photo { cam_id: integer(Top::CamId) }),
            Shape::PhotoAnswer => {
                Body::PhotoAnswer(PhotoAnswer { cam_id: integer(Top::CamId), ret: integer(Top::Ret) })
            }
            Shape::AddPoints => {
                let (sets, points) = self.lists.found_points();
                Body::AddPoints(AddPoints { sets, points })
            }
            Shape::AddRcc => Body::AddRcc(add_rcc(false)),
            Shape::AddRcc2020 => Body::AddRcc(add_rcc(true)),
            Shape::Unknown => Body::Unknown(UnknownType { word: header.type_word }),
            Shape::Rejected(request) => match &self.error {
                Some(error) => Body::Rejected(Rejection { request, error }),
                None => Body::Unknown(UnknownType { word: header.type_word }),
            },
        }
    }
}

/// The shape of a frame: its type and direction.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shape {
    Query,
    QueryReply,
    Command,
    CommandReply,
    Heartbreak,
    Photo,
    PhotoAnswer,
    AddPoints,
    AddRcc,
    AddRcc2020,
    Unknown,
    Rejected(RequestType),
}

/// Whether the members read so far show that this is AddPoints, so that its points can be read in the same
/// pass.
fn says_add_points(top: &TopNodes, bytes: &[u8]) -> bool {
    let word = top.value(Top::ReqType, bytes).or_else(|| top.value(Top::CmdType, bytes));
    word.is_some_and(|word| RequestType::from_word(&word.word()) == Some(RequestType::AddPoints))
}

/// Guesses the type of a frame without a stated type from its members.
fn guess(top: &TopNodes) -> Option<RequestType> {
    let told_by = [
        (Top::QueryData, RequestType::Query),
        (Top::QueryAddr, RequestType::Query),
        (Top::CmdReply, RequestType::Command),
        (Top::CmdData, RequestType::Command),
        (Top::Instructions, RequestType::AddRcc),
        (Top::EmptyList, RequestType::AddRcc),
        (Top::DsData, RequestType::AddPoints),
    ];
    told_by.into_iter().find(|(key, _)| top.has(*key)).map(|(_, request)| request)
}

/// Reads a list into `nodes`. Any other value is read as a single value and left to a later check.
#[inline]
fn list(cursor: &mut Cursor<'_>, bytes: &[u8], nodes: &mut Vec<Node>) -> Result<Node, JsonError> {
    nodes.clear();
    let start = cursor.at();
    if bytes.get(start) != Some(&b'[') {
        return cursor.value();
    }
    cursor.open_list()?;
    cursor.go_to(fast::read_texts(bytes, cursor.at(), nodes));
    let mut first = nodes.is_empty();
    while cursor.next_element(first)? {
        first = false;
        nodes.push(cursor.value()?);
    }
    Ok(Node { span: Span::new(start, cursor.at()), kind: Kind::List })
}

fn top_error(top: &TopNodes, bytes: &[u8], key: Top, wanted: Wanted) -> FieldError {
    let name = Top::KEYS.get(key as usize).copied().unwrap_or("?");
    FieldError {
        path: FieldPath::Member(name.to_owned()),
        found: top.value(key, bytes).map(excerpt),
        wanted,
        nearest: None,
    }
}

fn require_list(bytes: &[u8], top: &TopNodes, key: Top, wanted: Wanted) -> Result<(), FieldError> {
    match top.at(key) {
        Some(Node { kind: Kind::List, .. }) => Ok(()),
        Some(_) | None => Err(top_error(top, bytes, key, wanted)),
    }
}

/// Checks that a reply is a list of words. Before 2.0.2.1 the reply to a failed command may be a bare text.
fn require_reply(bytes: &[u8], top: &TopNodes) -> Result<(), FieldError> {
    match top.at(Top::CmdReply).map(|node| node.kind) {
        Some(Kind::List | Kind::Text { .. }) => Ok(()),
        Some(_) | None => Err(top_error(top, bytes, Top::CmdReply, Wanted(&["a list of words", "词的列表"]))),
    }
}

fn require_integer(bytes: &[u8], top: &TopNodes, key: Top) -> Result<(), FieldError> {
    match top.value(key, bytes).and_then(|value| value.integer()) {
        Some(_) => Ok(()),
        None => Err(top_error(top, bytes, key, Wanted(&["a whole number", "整数"]))),
    }
}

fn require_flag(bytes: &[u8], top: &TopNodes) -> Result<(), FieldError> {
    match top.value(Top::EmptyList, bytes) {
        Some(value) if value.flag().is_none() => Err(top_error(
            top,
            bytes,
            Top::EmptyList,
            Wanted(&["1 (replace the list) or 0 (append to it)", "1（替换列表）或 0（追加到列表）"]),
        )),
        Some(_) | None => Ok(()),
    }
}
