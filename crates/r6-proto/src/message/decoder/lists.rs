//! Reads the nested lists of a frame: instructions, and the points of cameras.

use crate::error::{FieldError, FieldPath, JsonError, Wanted};
use crate::json::Cursor;
use crate::message::extra::{ExtraKind, ExtraNode, Place};
use crate::message::fields::{FieldSet, Fields, FieldsView, excerpt};
use crate::message::instruction::{Action, Instruction, UnknownAction};
use crate::message::vision::{Point, PointSet};
use crate::value::{Kind, Node, Span, Value};

/// The first wrong field of a list that is valid JSON. The list is read to its end in any case.
type Checked = Result<(), FieldError>;

/// The nested lists of one frame, in reused buffers.
#[derive(Debug, Default)]
pub(super) struct Lists {
    instructions: Vec<Instruction>,
    /// Which instructions have no `oneshot`, in order.
    without_oneshot: Vec<u32>,
    /// The members of unknown actions.
    fields: Vec<(Node, Node)>,
    sets: Vec<PointSet>,
    points: Vec<Point>,
    /// The members of the object that is being read.
    set: FieldSet,
    /// How many instructions or points were found, valid or not. This is the number in their names.
    items: u32,
    instructions_checked: Option<FieldError>,
    /// Which list of cameras was read, and its error. Another list may follow in the same frame.
    cameras_checked: Option<(Node, Checked)>,
}

impl Lists {
    pub fn clear(&mut self) {
        self.clear_instructions();
        self.clear_cameras();
    }

    fn clear_instructions(&mut self) {
        self.instructions.clear();
        self.without_oneshot.clear();
        self.fields.clear();
        self.items = 0;
        self.instructions_checked = None;
    }

    fn clear_cameras(&mut self) {
        self.sets.clear();
        self.points.clear();
        self.items = 0;
        self.cameras_checked = None;
    }

    pub fn found_instructions(&self) -> &[Instruction] {
        &self.instructions
    }

    pub fn found_without_oneshot(&self) -> &[u32] {
        &self.without_oneshot
    }

    pub fn found_fields(&self) -> &[(Node, Node)] {
        &self.fields
    }

    pub fn found_points(&self) -> (&[PointSet], &[Point]) {
        (&self.sets, &self.points)
    }

    /// Reads `instructions`; the cursor stands at its `[`. It replaces an earlier list.
    pub fn instructions(
        &mut self,
        cursor: &mut Cursor<'_>,
        bytes: &[u8],
        extras: &mut Vec<ExtraNode>,
    ) -> Result<Node, JsonError> {
        self.clear_instructions();
        let start = cursor.at();
        self.instructions_checked = self.read_instructions(cursor, bytes, extras, false)?.err();
        Ok(Node { span: Span::new(start, cursor.at()), kind: Kind::List })
    }

    /// The error of the instructions that were read.
    pub fn checked_instructions(&mut self) -> Checked {
        self.instructions_checked.take().map_or(Ok(()), Err)
    }

    /// Reads `dsData: [{camID, data: [instruction …]}]`, the shape that clients of 2020 send. The list was
    /// checked before.
    pub fn instructions_2020(
        &mut self,
        bytes: &[u8],
        sets: Option<Value<'_>>,
        extras: &mut Vec<ExtraNode>,
    ) -> Result<Checked, JsonError> {
        self.clear_instructions();
        let mut checked = Ok(());
        for (number, set) in (0..).zip(sets.iter().flat_map(Value::items)) {
            let data =
                data_of(bytes, set, Place::Set(number), extras)?.filter(|data| data.kind == Kind::List);
            let read = match data {
                Some(data) => {
                    let mut cursor = Cursor::new(bytes, data.span.start as usize);
                    self.read_instructions(&mut cursor, bytes, extras, true)?
                }
                None => Err(FieldError {
                    path: FieldPath::Member("dsData[].data".to_owned()),
                    found: None,
                    wanted: Wanted(&["a list of instructions", "指令列表"]),
                    nearest: None,
                }),
            };
            checked = checked.and(read);
        }
        Ok(checked)
    }

    fn read_instructions(
        &mut self,
        cursor: &mut Cursor<'_>,
        bytes: &[u8],
        extras: &mut Vec<ExtraNode>,
        shape_2020: bool,
    ) -> Result<Checked, JsonError> {
        let mut checked = Ok(());
        cursor.open_list()?;
        let mut first = true;
        while cursor.next_element(first)? {
            first = false;
            let place = Place::Instruction(self.items);
            self.items += 1;
            let start = cursor.at();
            if !cursor.stands_at(b'{') {
                let found = Value::new(bytes, cursor.value()?);
                checked = checked.and(Err(not_an_object(place, found)));
                continue;
            }
            self.set.read(cursor, bytes, place, extras)?;
            if shape_2020 {
                self.set.translate_2020(place, extras);
            }
            let mut view = FieldsView::new(bytes, &self.set, place);
            match Instruction::from_fields(&mut view) {
                Ok(Some(instruction)) => {
                    extras.extend(out_of_place(&view));
                    if self.set.at(Fields::ONESHOT).is_none() {
                        self.without_oneshot.push(number(self.instructions.len()));
                    }
                    self.instructions.push(instruction);
                }
                Ok(None) => {
                    let instruction = self.unknown_action(bytes, place, start, extras)?;
                    self.instructions.push(instruction);
                }
                Err(error) => checked = checked.and(Err(error)),
            }
        }
        Ok(checked)
    }

    /// An instruction with an unknown action. Its members are kept as they are.
    fn unknown_action(
        &mut self,
        bytes: &[u8],
        place: Place,
        start: usize,
        extras: &mut Vec<ExtraNode>,
    ) -> Result<Instruction, JsonError> {
        // An unknown action has no unknown keys: all of its keys are its fields.
        let own = extras.iter().rposition(|extra| extra.place != place).map_or(0, |at| at + 1);
        extras.extract_if(own.., |extra| extra.kind != ExtraKind::DuplicateKey).for_each(drop);
        let first = number(self.fields.len());
        let mut cursor = Cursor::new(bytes, start);
        cursor.open_object()?;
        let mut before_first = true;
        let mut oneshot = false;
        let mut action = 0;
        while let Some(key) = cursor.next_key(before_first)? {
            before_first = false;
            let node = cursor.value()?;
            let value = Value::new(bytes, node);
            match &*Value::new(bytes, key).word() {
                b"oneshot" => oneshot = value.flag().unwrap_or(false),
                b"action" => action = value.integer().unwrap_or(0),
                _ => self.fields.push((key, node)),
            }
        }
        let fields = (first, number(self.fields.len()));
        Ok(Instruction { oneshot, action: Action::Unknown(UnknownAction { action, fields }) })
    }

    /// Reads `dsData: [{camID, data: [point …]}]` (manual 5.2); the cursor stands at its `[`.
    pub fn cameras(
        &mut self,
        cursor: &mut Cursor<'_>,
        bytes: &[u8],
        extras: &mut Vec<ExtraNode>,
    ) -> Result<Node, JsonError> {
        self.clear_cameras();
        let list = cursor.at();
        let mut checked = Ok(());
        cursor.open_list()?;
        let mut first = true;
        let mut set = 0;
        while cursor.next_element(first)? {
            first = false;
            let place = Place::Set(set);
            set += 1;
            if !cursor.stands_at(b'{') {
                let found = Value::new(bytes, cursor.value()?);
                checked = checked.and(Err(not_an_object(place, found)));
                continue;
            }
            let read = self.camera(cursor, bytes, place, extras)?;
            checked = checked.and(read);
        }
        let list = Node { span: Span::new(list, cursor.at()), kind: Kind::List };
        self.cameras_checked = Some((list, checked));
        Ok(list)
    }

    /// The error of the cameras. Reads `list` first if it is not the list that was read in the first pass.
    pub fn checked_cameras(
        &mut self,
        bytes: &[u8],
        list: Option<Node>,
        extras: &mut Vec<ExtraNode>,
    ) -> Result<Checked, JsonError> {
        let read = self.cameras_checked.as_ref().map(|(read, _)| *read);
        if let Some(list) = list.filter(|list| read != Some(*list)) {
            self.cameras(&mut Cursor::new(bytes, list.span.start as usize), bytes, extras)?;
        }
        Ok(self.cameras_checked.take().map_or(Ok(()), |(_, checked)| checked))
    }

    fn camera(
        &mut self,
        cursor: &mut Cursor<'_>,
        bytes: &[u8],
        place: Place,
        extras: &mut Vec<ExtraNode>,
    ) -> Result<Checked, JsonError> {
        let start = self.points.len();
        let mut cam_id = None;
        let mut data = None;
        let mut checked = Ok(());
        cursor.open_object()?;
        let mut first = true;
        while let Some(key) = cursor.next_key(first)? {
            first = false;
            let name = Value::new(bytes, key).word();
            let value = if *name == *b"data" && cursor.stands_at(b'[') {
                self.points.truncate(start);
                let at = cursor.at();
                checked = self.camera_points(cursor, bytes, extras)?;
                Node { span: Span::new(at, cursor.at()), kind: Kind::List }
            } else {
                cursor.value()?
            };
            let earlier = match &*name {
                b"camID" => cam_id.replace(value),
                b"data" => data.replace(value),
                _ => {
                    extras.push(ExtraNode { place, key, value, kind: ExtraKind::UnknownKey });
                    None
                }
            };
            if let Some(value) = earlier {
                extras.push(ExtraNode { place, key, value, kind: ExtraKind::DuplicateKey });
            }
        }
        let wrong = |field: &str, node: Option<Node>, wanted| FieldError {
            path: FieldPath::Member(format!("{place}.{field}")),
            found: node.map(|node| excerpt(Value::new(bytes, node))),
            wanted,
            nearest: None,
        };
        if data.is_none_or(|node| node.kind != Kind::List) {
            return Ok(Err(wrong("data", data, Wanted(&["a list of points", "点位列表"]))));
        }
        let Some(id) = cam_id.and_then(|node| Value::new(bytes, node).integer()) else {
            return Ok(Err(wrong("camID", cam_id, Wanted(&["a whole number", "整数"]))));
        };
        self.sets.push(PointSet { cam_id: id, first: start, end: self.points.len() });
        Ok(checked)
    }

    fn camera_points(
        &mut self,
        cursor: &mut Cursor<'_>,
        bytes: &[u8],
        extras: &mut Vec<ExtraNode>,
    ) -> Result<Checked, JsonError> {
        let mut checked = Ok(());
        cursor.open_list()?;
        let mut first = true;
        while cursor.next_element(first)? {
            first = false;
            let place = Place::Point(self.items);
            self.items += 1;
            if !cursor.stands_at(b'{') {
                let found = Value::new(bytes, cursor.value()?);
                checked = checked.and(Err(not_an_object(place, found)));
                continue;
            }
            self.set.read(cursor, bytes, place, extras)?;
            let mut view = FieldsView::new(bytes, &self.set, place);
            match Point::from_fields(&mut view) {
                Ok(point) => {
                    extras.extend(out_of_place(&view));
                    self.points.push(point);
                }
                Err(error) => checked = checked.and(Err(error)),
            }
        }
        Ok(checked)
    }
}

/// Members that are known but have no meaning in this object.
fn out_of_place(view: &FieldsView<'_>) -> impl Iterator<Item = ExtraNode> {
    let place = view.place;
    view.unused().map(move |(key, value)| ExtraNode { place, key, value, kind: ExtraKind::OutOfPlace })
}

/// Narrows a position in a buffer to 32 bits, which are far more than any frame needs.
fn number(position: usize) -> u32 {
    u32::try_from(position).unwrap_or(u32::MAX)
}

/// The `data` of a camera's set that was checked before. Its other members, except `camID`, are extras.
fn data_of(
    bytes: &[u8],
    set: Value<'_>,
    place: Place,
    extras: &mut Vec<ExtraNode>,
) -> Result<Option<Node>, JsonError> {
    if set.node.kind != Kind::Object {
        return Ok(None);
    }
    let mut cursor = Cursor::new(bytes, set.node.span.start as usize);
    cursor.open_object()?;
    let mut data = None;
    let mut first = true;
    while let Some(key) = cursor.next_key(first)? {
        first = false;
        let value = cursor.value()?;
        let extra = |value, kind| ExtraNode { place, key, value, kind };
        match &*Value::new(bytes, key).word() {
            b"data" => {
                if let Some(earlier) = data.replace(value) {
                    extras.push(extra(earlier, ExtraKind::DuplicateKey));
                }
            }
            b"camID" => {}
            _ => extras.push(extra(value, ExtraKind::UnknownKey)),
        }
    }
    Ok(data)
}

fn not_an_object(place: Place, found: Value<'_>) -> FieldError {
    FieldError {
        path: FieldPath::Member(place.to_string()),
        found: Some(excerpt(found)),
        wanted: Wanted(&["an object", "JSON 对象"]),
        nearest: None,
    }
}
