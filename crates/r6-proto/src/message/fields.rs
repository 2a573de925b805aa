//! The members of an instruction or a point. They are first collected in any order, then read by meaning.

use crate::axis::AXES;
use crate::encode::{Key, key};
use crate::error::{FieldError, FieldPath, JsonError, Wanted};
use crate::json::Cursor;
use crate::message::extra::{ExtraKind, ExtraNode, Place};
use crate::message::fast::{Habit, Pattern};
use crate::message::instruction;
use crate::value::{Node, Value};

/// Every member that an instruction or a point can have, by slot.
pub(crate) struct Fields;

/// Defines the members of all instructions and the coordinates. Each row has the name in the code and the
/// name on the wire. The other members are in the table of [`super::instruction`].
macro_rules! fields {
    ($( $field:ident $name:literal )+) => {
        /// The names, in the order of the slots.
        const OWN_NAMES: [&str; [$( Slot::$field ),+].len()] = [$( text($name) ),+];

        /// The slots.
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "they are called as the constants are")]
        enum Slot { $( $field, )+ }

        impl Fields {
            $( pub const $field: usize = Slot::$field as usize; )+

            /// The slot of a name, including the accepted spelling `Angle`.
            fn slot(name: &[u8]) -> Option<usize> {
                // A `match` is several times as fast as a search through the names, and every member of a
                // list passes here.
                match name {
                    $( $name => Some(Self::$field), )+
                    b"Angle" => Some(Self::ANGEL),
                    _ => Self::slot_of_table(name),
                }
            }
        }
    };
}

/// A name of the table as text. All names are ASCII: `every_name_finds_its_own_slot` reads them back.
const fn text(name: &'static [u8]) -> &'static str {
    match std::str::from_utf8(name) {
        Ok(text) => text,
        Err(_) => "?",
    }
}

#[rustfmt::skip]
fields! {
    M0 b"m0"  M1 b"m1"  M2 b"m2"  M3 b"m3"  M4 b"m4"  M5 b"m5"  M6 b"m6"  M7 b"m7"
    M0_P b"m0_p"  M1_P b"m1_p"  M2_P b"m2_p"  M3_P b"m3_p"  M4_P b"m4_p"  M5_P b"m5_p"  M6_P b"m6_p"
    M7_P b"m7_p"
    ONESHOT b"oneshot"  ACTION b"action"
    XPOS b"xpos"  YPOS b"ypos"  ZPOS b"zpos"  UPOS b"upos"  VPOS b"vpos"  WPOS b"wpos"
    CAM_ID b"camID"
}

/// The names of the table of instructions and points, each once, even if several of them use it.
const TABLE_NAMES: [&str; distinct(instruction::NAMES)] = once_each(instruction::NAMES);

/// All names, in the order of the slots.
const NAMES: [&str; OWN_NAMES.len() + TABLE_NAMES.len()] = {
    let mut names = [""; OWN_NAMES.len() + TABLE_NAMES.len()];
    let (own, table) = names.split_at_mut(OWN_NAMES.len());
    own.copy_from_slice(&OWN_NAMES);
    table.copy_from_slice(&TABLE_NAMES);
    names
};

/// The set of present members is stored in 64 bits.
const _: () = assert!(NAMES.len() <= 64);

const fn same(one: &[u8], other: &[u8]) -> bool {
    match (one, other) {
        ([], []) => true,
        ([a, one @ ..], [b, other @ ..]) => *a == *b && same(one, other),
        _ => false,
    }
}

/// The first position of the name.
const fn place(name: &str, names: &[&str]) -> Option<usize> {
    let (mut at, mut rest) = (0, names);
    while let [first, later @ ..] = rest {
        if same(first.as_bytes(), name.as_bytes()) {
            return Some(at);
        }
        (at, rest) = (at + 1, later);
    }
    None
}

/// Number of different names.
const fn distinct(names: &[&str]) -> usize {
    let (mut count, mut rest) = (0, names);
    while let [name, later @ ..] = rest {
        count += if place(name, later).is_none() { 1 } else { 0 };
        rest = later;
    }
    count
}

/// Each name once.
const fn once_each<const COUNT: usize>(names: &[&'static str]) -> [&'static str; COUNT] {
    let mut each = [""; COUNT];
    let (mut slots, mut rest) = (each.as_mut_slice(), names);
    while let [name, later @ ..] = rest {
        rest = later;
        if place(name, later).is_some() {
            continue;
        }
        let [slot, free @ ..] = slots else { break };
        *slot = name;
        slots = free;
    }
    each
}

/// The same names, prepared for comparison.
static PATTERNS: [Pattern; NAMES.len()] = Pattern::all(NAMES);

/// The same names, prepared for writing.
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
    pub const M: [usize; AXES] =
        [Self::M0, Self::M1, Self::M2, Self::M3, Self::M4, Self::M5, Self::M6, Self::M7];
    pub const M_P: [usize; AXES] =
        [Self::M0_P, Self::M1_P, Self::M2_P, Self::M3_P, Self::M4_P, Self::M5_P, Self::M6_P, Self::M7_P];
    /// `xpos` … `wpos` of the 2020 shape: they stand for `m0` … `m5`.
    pub const POS: [usize; 6] = [Self::XPOS, Self::YPOS, Self::ZPOS, Self::UPOS, Self::VPOS, Self::WPOS];

    /// `Angel`, which has a second spelling.
    const ANGEL: usize = Self::of("Angel");

    const COUNT: usize = NAMES.len();

    /// The slot of a name of the table of instructions and points. Call this only in constants, where an
    /// unknown name is a compile error.
    #[expect(clippy::panic, reason = "the compiler calls it, and tells the author of a table")]
    pub const fn of(name: &str) -> usize {
        match place(name, &TABLE_NAMES) {
            Some(at) => OWN_NAMES.len() + at,
            None => panic!("no such member"),
        }
    }

    fn slot_of_table(name: &[u8]) -> Option<usize> {
        let at = TABLE_NAMES.iter().position(|of_table| of_table.as_bytes() == name)?;
        Some(OWN_NAMES.len() + at)
    }

    /// The name of a slot as the manual writes it.
    pub fn name(slot: usize) -> &'static str {
        NAMES.get(slot).copied().unwrap_or("?")
    }

    /// The same name, prepared for writing.
    pub fn key(slot: usize) -> &'static Key {
        KEYS.get(slot).unwrap_or(key!("?"))
    }

    /// All names, for the search of the nearest word.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMES.into_iter()
    }
}

/// The collected members of one object: key and value by slot. It is reused for the next object.
#[derive(Debug)]
pub(crate) struct FieldSet {
    members: [(Node, Node); Fields::COUNT],
    /// Which slots hold a member of this object. The other slots hold old values.
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
        // The accepted spelling is reported, so the slow path reads it, as it reads all other extras.
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

    /// The key and the value of a member, if it is present.
    pub fn at(&self, slot: usize) -> Option<(Node, Node)> {
        if self.present & 1 << slot == 0 { None } else { self.members.get(slot).copied() }
    }

    /// Uses the members `xpos` … `wpos` of the 2020 shape as `m0` … `m5`.
    ///
    /// If an object has both, the 2020 member counts and the other one is an extra.
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

/// A field set during reading. It records which members were used, so that the rest can be reported.
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

    /// Reads the field with `read`; `None` if it is absent.
    pub fn optional<T>(
        &mut self,
        field: usize,
        wanted: Wanted,
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

    /// Reads the field with `read`; the field is required.
    pub fn required<T>(
        &mut self,
        field: usize,
        wanted: Wanted,
        read: impl FnOnce(Value<'a>) -> Option<T>,
    ) -> Result<T, FieldError> {
        self.optional(field, wanted, read)?.ok_or_else(|| self.missing(field, wanted))
    }

    /// Reads a required whole number.
    pub fn integer(&mut self, field: usize, wanted: Wanted) -> Result<i64, FieldError> {
        self.required(field, wanted, |value| value.integer())
    }

    /// The error for a missing field.
    pub fn missing(&self, field: usize, wanted: Wanted) -> FieldError {
        FieldError { path: self.path(field), found: None, wanted, nearest: None }
    }

    /// Members that are known but were not used for this object: key and value.
    pub fn unused(&self) -> impl Iterator<Item = (Node, Node)> + use<'a> {
        let unused = self.set.present & !self.used;
        let set = self.set;
        // Most instructions use all their members, so usually there is nothing to search.
        let slots = if unused == 0 { 0..0 } else { 0..Fields::COUNT };
        slots.filter_map(move |slot| set.at(slot).filter(|_| unused & 1 << slot != 0))
    }

    fn path(&self, field: usize) -> FieldPath {
        FieldPath::Member(format!("{}.{}", self.place, Fields::name(field)))
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
            (const { Fields::of("cnt_id") }, "cnt_id"),
            (Fields::POS[5], "wpos"),
            (const { Fields::of("ModelID") }, "ModelID"),
            (const { Fields::of("Rel") }, "Rel"),
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
        // The eight axes share a row. A separate sentence describes the 2020 shape.
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
        // Other code reads the answer to a photo, and the list itself.
        for item in covered.into_iter().filter(|item| !["ret", "data"].contains(item)) {
            assert!(rows_of_names.contains(&item), "{item} has a row, and no slot");
        }
    }
}
