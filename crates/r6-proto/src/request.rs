//! Requests, encoded strictly: one compact form, with every number in its range.

use crate::address::Address;
use crate::dialect::Addressing;
use crate::encode::{ObjectWriter, key};
use crate::error::EncodeError;
use crate::message::{Command, Effect, Instruction, PhotoAnswer, Point, RequestType};
use crate::text;

mod head;

/// The longest AddRCC that controllers answer and execute, in bytes (inferred from the thresholds reported of
/// unit A).
pub const LONGEST_ADD_RCC: usize = 2048;

/// What a PC or a camera sends to a controller.
#[derive(Clone, Copy, Debug)]
pub enum Request<'a> {
    /// Reads these addresses (manual 4.1).
    Query(&'a [Address]),
    /// Acts at once (manual 4.2).
    Command(&'a Command<'a>),
    /// Puts instructions into the instruction list (manual 6).
    AddRcc {
        /// `true` replaces the list, `false` appends.
        empty_list: bool,
        /// The instructions. An empty slice with `empty_list` clears the list.
        instructions: &'a [Instruction],
    },
    /// Sends the points of each camera (manual 5.2).
    AddPoints(&'a [CameraPoints<'a>]),
    /// Feeds the controller's watchdog; the first one arms it (manual 7). The controller does not answer.
    Heartbreak,
    /// Answers a photo request (manual 5.1). The controller does not answer.
    PhotoAnswer(PhotoAnswer),
}

/// The points of one camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraPoints<'a> {
    /// `camID`.
    pub cam_id: i64,
    /// Its points.
    pub points: &'a [Point],
}

impl Request<'_> {
    /// The type of the request.
    #[must_use]
    pub fn request_type(&self) -> RequestType {
        match self {
            Self::Query(_) => RequestType::Query,
            Self::Command(_) => RequestType::Command,
            Self::AddRcc { .. } => RequestType::AddRcc,
            Self::AddPoints(_) => RequestType::AddPoints,
            Self::Heartbreak => RequestType::Heartbreak,
            Self::PhotoAnswer(_) => RequestType::Photo,
        }
    }

    /// Whether a controller answers this request.
    #[must_use]
    pub fn expects_reply(&self) -> bool {
        match self {
            Self::Query(_) | Self::Command(_) | Self::AddRcc { .. } | Self::AddPoints(_) => true,
            Self::Heartbreak | Self::PhotoAnswer(_) => false,
        }
    }

    /// Its word for reports: the name of the command, or the type of the request.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Command(command) => command.name().word(),
            Self::Query(_)
            | Self::AddRcc { .. }
            | Self::AddPoints(_)
            | Self::Heartbreak
            | Self::PhotoAnswer(_) => self.request_type().word(),
        }
    }

    /// Its effect on the machine. That of a command is in the table of commands. Instructions move, and so
    /// do the points of a camera, because a program may wait for exactly these points.
    #[must_use]
    pub fn effect(&self) -> Effect {
        match self {
            Self::Query(_) => Effect::Reads,
            Self::Command(command) => command.name().effect(),
            Self::AddRcc { instructions: [], .. } | Self::Heartbreak | Self::PhotoAnswer(_) => {
                Effect::Changes
            }
            Self::AddRcc { .. } | Self::AddPoints(_) => Effect::Moves,
        }
    }

    /// Appends the frame to `out`.
    ///
    /// # Errors
    /// [`EncodeError`] names the field that the wire cannot carry; `out` is unchanged then.
    pub fn encode(&self, addressing: &Addressing<'_>, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let before = out.len();
        let encoded = self.encode_members(addressing, out);
        if encoded.is_err() {
            out.truncate(before);
        }
        encoded
    }

    fn encode_members(&self, addressing: &Addressing<'_>, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let request = self.request_type();
        head::append(out, addressing, request);
        let mut frame = ObjectWriter::go_on(out);
        if let Some(pack_id) = addressing.pack_id {
            frame.text(key!("packID"), pack_id);
        }
        match self {
            Self::Query(addresses) => {
                let out = frame.key(key!("queryAddr"));
                out.push(b'[');
                for (at, address) in addresses.iter().enumerate() {
                    address.write_item(at == 0, out);
                }
                out.push(b']');
            }
            Self::Command(command) => command.encode_data(frame.key(key!("cmdData")))?,
            Self::AddRcc { empty_list, instructions } => {
                frame.quoted_flag(key!("emptyList"), *empty_list);
                let mut list = ListWriter::begin(frame.key(key!("instructions")));
                for instruction in *instructions {
                    instruction.encode(list.item())?;
                }
                list.end();
            }
            Self::AddPoints(cameras) => {
                let mut list = ListWriter::begin(frame.key(key!("dsData")));
                for camera in *cameras {
                    let mut set = ObjectWriter::begin(list.item());
                    set.bare_integer(key!("camID"), camera.cam_id);
                    let mut points = ListWriter::begin(set.key(key!("data")));
                    for point in camera.points {
                        point.encode(points.item())?;
                    }
                    points.end();
                    set.end();
                }
                list.end();
            }
            Self::Heartbreak => {}
            Self::PhotoAnswer(answer) => {
                frame.bare_integer(key!("camID"), answer.cam_id);
                frame.bare_integer(key!("ret"), answer.ret);
            }
        }
        frame.end();
        Ok(())
    }
}

/// Writes one compact JSON list, item by item.
pub(crate) struct ListWriter<'o> {
    out: &'o mut Vec<u8>,
    first: bool,
}

impl<'o> ListWriter<'o> {
    pub fn begin(out: &'o mut Vec<u8>) -> Self {
        out.push(b'[');
        Self { out, first: true }
    }

    /// Returns the buffer for the next item.
    #[inline]
    pub fn item(&mut self) -> &mut Vec<u8> {
        if !self.first {
            self.out.push(b',');
        }
        self.first = false;
        self.out
    }

    pub fn text(&mut self, value: &str) {
        text::write_escaped(self.item(), value);
    }

    pub fn end(self) {
        self.out.push(b']');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Action;
    use crate::message::instruction::PathSpeed;

    #[test]
    fn every_request_has_its_effect() {
        let stop = Command::ActionStop;
        let off = PathSpeed { in_use: false, speed: None };
        let step = [Instruction { oneshot: true, action: Action::PathSpeed(off) }];
        for (request, word, effect) in [
            (Request::Query(&[Address::CurMode]), "query", Effect::Reads),
            (Request::Command(&stop), "actionStop", Effect::Stops),
            (Request::AddRcc { empty_list: true, instructions: &[] }, "AddRCC", Effect::Changes),
            (Request::AddRcc { empty_list: false, instructions: &step }, "AddRCC", Effect::Moves),
            (Request::AddPoints(&[]), "AddPoints", Effect::Moves),
            (Request::Heartbreak, "heartbreak", Effect::Changes),
            (Request::PhotoAnswer(PhotoAnswer { cam_id: 0, ret: 1 }), "photo", Effect::Changes),
        ] {
            assert_eq!((request.word(), request.effect()), (word, effect), "{request:?}");
        }
    }
}
