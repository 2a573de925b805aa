//! The members of an instruction or a point: collected in any order first, read by meaning afterwards.

use crate::axis::AXES;
use crate::encode::{Key, key};
use crate::error::{FieldError, JsonError};
use crate::json::Cursor;
use crate::message::extra::{ExtraKind, ExtraNode, Place};
use crate::message::fast::{Habit, Pattern};
use crate::value::{Node, Value};

/// Every member that an instruction or a point can have, by slot.
pub(crate) struct Fields;

/// The names, in the order of the slots.
const NAMES: [&str; 50] = [
    "m0",
    "m1",
    "m2",
    "m3",
    "m4",
    "m5",
    "m6",
    "m7",
    "m0_p",
    "m1_p",
    "m2_p",
    "m3_p",
    "m4_p",
    "m5_p",
    "m6_p",
    "m7_p",
    "oneshot",
    "action",
    "ckStatus",
    "speed",
    "delay",
    "smooth",
    "tool",
    "coord",
    "isUse",
    "ioNumber",
    "io_status",
    "type",
    "point",
    "point2",
    "limit",
    "isUnlimit",
    "cnt_id",
    "xpos",
    "ypos",
    "zpos",
    "upos",
    "vpos",
    "wpos",
    "ModelID",
    "X",
    "Y",
    "Z",
    "U",
    "V",
    "Angel",
    "Similarity",
    "Color",
    "Rel",
    "camID",
];

/// The same, ready to be compared.
static PATTERNS: [Pattern; NAMES.len()] = Pattern::all(NAMES);

/// The same, ready to be written.
static KEYS: [Key; NAMES.len()] = {
    let mut keys = [Key::of(""); NAMES.len()];
    let (mut slots, mut names) = (keys.as_mut_slice(), NAMES.as_slice());
    while let ([key, later_keys @ ..], [name, later_names @ ..]) = (slots, names) {
        *key = Key::of(name);
        (slots, names) = (later_keys, later_names);
    }
    keys
};

impl Fields {
    pub const M: [usize; AXES] = [0, 1, 2, 3, 4, 5, 6, 7];
    pub const M_P: [usize; AXES] = [8, 9, 10, 11, 12, 13, 14, 15];
    pub const ONESHOT: usize = 16;
    pub const ACTION: usize = 17;
    pub const CK_STATUS: usize = 18;
    pub const SPEED: usize = 19;
    pub const DELAY: usize = 20;
    pub const SMOOTH: usize = 21;
    pub const TOOL: usize = 22;
    pub const COORD: usize = 23;
    pub const IS_USE: usize = 24;
    pub const IO_NUMBER: usize = 25;
    pub const IO_STATUS: usize = 26;
    pub const TYPE: usize = 27;
    pub const POINT: usize = 28;
    pub const POINT2: usize = 29;
    pub const LIMIT: usize = 30;
    pub const IS_UNLIMIT: usize = 31;
    pub const CNT_ID: usize = 32;
    /// `xpos` … `wpos` of the 2020 shape: they stand for `m0` … `m5`.
    pub const POS: [usize; 6] = [33, 34, 35, 36, 37, 38];
    pub const MODEL_ID: usize = 39;
    pub const X: usize = 40;
    pub const Y: usize = 41;
    pub const Z: usize = 42;
    pub const U: usize = 43;
    pub const V: usize = 44;
    pub const ANGEL: usize = 45;
    pub const SIMILARITY: usize = 46;
    pub const COLOR: usize = 47;
    pub const REL: usize = 48;
    const CAM_ID: usize = 49;

    const COUNT: usize = NAMES.len();

    /// The name of a slot as the manual writes it.
    pub fn name(slot: usize) -> &'static str {
        NAMES.get(slot).copied().unwrap_or("?")
    }

    /// The same, ready to be written.
    pub fn key(slot: usize) -> &'static Key {
        KEYS.get(slot).unwrap_or(key!("?"))
    }

    /// All names, for the nearest word.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMES.into_iter()
    }

    /// The slot of a name, with the accepted spelling `Angle`.
    fn slot(name: &[u8]) -> Option<usize> {
        // A match is several times as fast as a search through the names, and every member of a list comes by here.
        Some(match name {
            [b'm', digit @ b'0'..=b'7'] => usize::from(digit - b'0'),
            [b'm', digit @ b'0'..=b'7', b'_', b'p'] => usize::from(digit - b'0') + AXES,
            b"oneshot" => Self::ONESHOT,
            b"action" => Self::ACTION,
            b"ckStatus" => Self::CK_STATUS,
            b"speed" => Self::SPEED,
            b"delay" => Self::DELAY,
            b"smooth" => Self::SMOOTH,
            b"tool" => Self::TOOL,
            b"coord" => Self::COORD,
            b"isUse" => Self::IS_USE,
            b"ioNumber" => Self::IO_NUMBER,
            b"io_status" => Self::IO_STATUS,
            b"type" => Self::TYPE,
            b"point" => Self::POINT,
            b"point2" => Self::POINT2,
            b"limit" => Self::LIMIT,
            b"isUnlimit" => Self::IS_UNLIMIT,
            b"cnt_id" => Self::CNT_ID,
            b"xpos" => Self::POS[0],
            b"ypos" => Self::POS[1],
            b"zpos" => Self::POS[2],
            b"upos" => Self::POS[3],
            b"vpos" => Self::POS[4],
            b"wpos" => Self::POS[5],
            b"ModelID" => Self::MODEL_ID,
            b"X" => Self::X,
            b"Y" => Self::Y,
            b"Z" => Self::Z,
            b"U" => Self::U,
            b"V" => Self::V,
            b"Angel" | b"Angle" => Self::ANGEL,
            b"Similarity" => Self::SIMILARITY,
            b"Color" => Self::COLOR,
            b"Rel" => Self::REL,
            b"camID" => Self::CAM_ID,
            _ => return None,
        })
    }
}

/// The collected members of one object: key and value by slot. It is used again for the next object.
#[derive(Debug)]
pub(crate) struct FieldSet {
    members: [(Node, Node); Fields::COUNT],
    /// Which slots hold a member of this object; the others hold what came before.
    present: u64,
    habit: Habit<{ Fields::COUNT }>,
}

impl Default for FieldSet {
    fn default() -> Self {
        Self { members: [(Node::NULL, Node::NULL); Fields::COUNT], present: 0, habit: Habit::default() }
    }
}

impl FieldSet {
    /// Reads one object; unknown, repeated and differently spelt keys go to `extras`.
    pub fn read(
        &mut self,
        cursor: &mut Cursor<'_>,
        bytes: &[u8],
        place: Place,
        extras: &mut Vec<ExtraNode>,
    ) -> Result<(), JsonError> {
        // The accepted spelling is reported, and so read with everything else that is.
        let slot_of = |name: &[u8]| Fields::slot(name).filter(|slot| Fields::name(*slot).as_bytes() == name);
        let known = self.habit.object(bytes, cursor.at(), &PATTERNS, slot_of, &mut self.members);
        if let Some((present, behind)) = known {
            self.present = present;
            cursor.go_to(behind);
            return Ok(());
        }
        self.present = 0;
        cursor.open_object()?;
        let mut first = true;
        while let Some(key) = cursor.next_key(first)? {
            first = false;
            let value = cursor.value()?;
            let name = &*Value::new(bytes, key).word();
            let slot = Fields::slot(name).and_then(|slot| Some((slot, self.members.get_mut(slot)?)));
            match slot {
                None => extras.push(ExtraNode { place, key, value, kind: ExtraKind::UnknownKey }),
                Some((slot, member)) => {
                    let (_, earlier) = std::mem::replace(member, (key, value));
                    if self.present & 1 << slot != 0 {
                        extras.push(ExtraNode { place, key, value: earlier, kind: ExtraKind::DuplicateKey });
                    }
                    if slot == Fields::ANGEL && name != b"Angel" {
                        extras.push(ExtraNode { place, key, value, kind: ExtraKind::OtherSpelling });
                    }
                    self.present |= 1 << slot;
                }
            }
        }
        Ok(())
    }

    /// The key and the value of a member, where it is there.
    pub fn at(&self, slot: usize) -> Option<(Node, Node)> {
        if self.present & 1 << slot == 0 { None } else { self.members.get(slot).copied() }
    }

    /// Lets the members `xpos` … `wpos` of the 2020 shape stand for `m0` … `m5`.
    ///
    /// Where an object has both, the earlier shape counts and the other one is an extra.
    pub fn translate_2020(&mut self, place: Place, extras: &mut Vec<ExtraNode>) {
        for (pos, m) in Fields::POS.into_iter().zip(Fields::M) {
            let Some(member) = self.at(pos) else { continue };
            if let Some((key, value)) = self.at(m) {
                extras.push(ExtraNode { place, key, value, kind: ExtraKind::DuplicateKey });
            }
            if let Some(slot) = self.members.get_mut(m) {
                *slot = member;
                self.present = (self.present & !(1 << pos)) | 1 << m;
            }
        }
    }
}

/// A field set being read: it remembers what was used, so that the rest can be reported.
pub(crate) struct FieldsView<'a> {
    pub bytes: &'a [u8],
    pub set: &'a FieldSet,
    pub place: Place,
    used: u64,
}

impl<'a> FieldsView<'a> {
    pub fn new(bytes: &'a [u8], set: &'a FieldSet, place: Place) -> Self {
        Self { bytes, set, place, used: 0 }
    }

    /// Reads the field with `read`, or `None` where it is absent.
    pub fn optional<T>(
        &mut self,
        field: usize,
        wanted: &'static str,
        read: impl FnOnce(Value<'a>) -> Option<T>,
    ) -> Result<Option<T>, FieldError> {
        self.used |= 1 << field;
        let Some((_, node)) = self.set.at(field) else { return Ok(None) };
        let value = Value::new(self.bytes, node);
        match read(value) {
            Some(read) => Ok(Some(read)),
            None => {
                Err(FieldError { path: self.path(field), found: Some(excerpt(value)), wanted, nearest: None })
            }
        }
    }

    /// Reads the field with `read`; it must be there.
    pub fn required<T>(
        &mut self,
        field: usize,
        wanted: &'static str,
        read: impl FnOnce(Value<'a>) -> Option<T>,
    ) -> Result<T, FieldError> {
        self.optional(field, wanted, read)?.ok_or_else(|| self.missing(field, wanted))
    }

    /// A whole number that must be there.
    pub fn integer(&mut self, field: usize, wanted: &'static str) -> Result<i64, FieldError> {
        self.required(field, wanted, |value| value.integer())
    }

    /// The error that the field is missing.
    pub fn missing(&self, field: usize, wanted: &'static str) -> FieldError {
        FieldError { path: self.path(field), found: None, wanted, nearest: None }
    }

    /// Members that are known but were not used for what this object is: key and value.
    pub fn unused(&self) -> impl Iterator<Item = (Node, Node)> + use<'a> {
        let unused = self.set.present & !self.used;
        let set = self.set;
        // Most instructions use all they have, and then there is nothing to walk through.
        let slots = if unused == 0 { 0..0 } else { 0..Fields::COUNT };
        slots.filter_map(move |slot| set.at(slot).filter(|_| unused & 1 << slot != 0))
    }

    fn path(&self, field: usize) -> String {
        format!("{}.{}", self.place, Fields::name(field))
    }
}

/// A value as on the wire, cut at 48 characters, for an error message.
pub(crate) fn excerpt(value: Value<'_>) -> String {
    let text = String::from_utf8_lossy(value.wire());
    if text.chars().count() > 48 { text.chars().take(47).chain(['…']).collect() } else { text.into_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_finds_its_own_slot() {
        for (slot, name) in NAMES.into_iter().enumerate() {
            assert_eq!(Fields::slot(name.as_bytes()), Some(slot), "{name}");
        }
        assert_eq!(Fields::slot(b"m8"), None);
        assert_eq!(Fields::slot(b"Angle"), Some(Fields::ANGEL));
        let named = [
            (Fields::ONESHOT, "oneshot"),
            (Fields::CNT_ID, "cnt_id"),
            (Fields::POS[5], "wpos"),
            (Fields::MODEL_ID, "ModelID"),
            (Fields::REL, "Rel"),
        ];
        for (slot, name) in named {
            assert_eq!(Fields::name(slot), name);
        }
    }

    #[test]
    fn every_name_has_a_row_in_the_coverage_table() {
        let rows = r6_testkit::coverage::protocol_rows();
        let covered: Vec<&str> = rows
            .iter()
            .filter(|row| ["instruction field", "vision field"].contains(&row.group.as_str()))
            .filter_map(|row| row.item.rsplit('.').next())
            .collect();
        // The eight axes share a row; the shape of 2020 is told in a sentence of its own.
        let row = |slot: usize, name: &'static str| match slot {
            slot if Fields::M.contains(&slot) => Some("m0-m7"),
            slot if Fields::M_P.contains(&slot) => Some("m0_p-m7_p"),
            slot if Fields::POS.contains(&slot) => None,
            _ => Some(name),
        };
        let rows_of_names: Vec<&str> =
            NAMES.into_iter().enumerate().filter_map(|(slot, name)| row(slot, name)).collect();
        for name in &rows_of_names {
            assert!(covered.contains(name), "docs/PROTOCOL.md has no row in its coverage for {name}");
        }
        // The answer to a photo, and the list itself, are read elsewhere.
        for item in covered.into_iter().filter(|item| !["ret", "data"].contains(item)) {
            assert!(rows_of_names.contains(&item), "{item} has a row, and no slot");
        }
    }
}
