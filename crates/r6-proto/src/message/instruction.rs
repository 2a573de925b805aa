//! Instructions: the steps that AddRCC puts into a controller's instruction list (manual 6).

use std::borrow::Cow;

use crate::axis::{AXES, AxisIndex, AxisMask};
use crate::encode::{Decimals, ObjectWriter, key};
use crate::error::{EncodeError, FieldError};
use crate::grid::Grid;
use crate::io_point::PairMask;
use crate::message::action::{self, Known};
use crate::message::fields::{Fields, FieldsView};

/// One step of an instruction list (manual 6, "instructions").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruction {
    /// `oneshot`: `true` removes the step once it has run; `false` keeps it, and the list runs it again and again.
    pub oneshot: bool,
    /// What the step does.
    pub action: Action,
}

/// What an instruction does, by its `action` number (manual 6.1 and later).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// 4, "free path": every axis goes straight to its target, all arriving together. Coordinates in degrees.
    AxisMove(Move),
    /// 10, "pose line": the tool goes straight to a pose. Coordinates X, Y, Z in mm, U, V, W in degrees.
    LinearMove(Move),
    /// 17, "pose curve": the tool goes through a middle pose to an end pose.
    CurveMove(CurveMove),
    /// 51: later linear moves without a speed of their own run at this path speed (207beta91).
    PathSpeed(PathSpeed),
    /// 52: an input that stops the motion when it takes a state.
    StopOnSignal(StopOnSignal),
    /// 100: waits for an input or for a time.
    Wait(Wait),
    /// 200: sets one output (206 master F1).
    Output(Output),
    /// 204: sets many outputs of one board at once (later manual).
    BoardOutput(BoardOutput),
    /// 800: changes the workbench.
    Workbench(Workbench),
    /// Any other action: kept, its fields readable through [`crate::message::AddRcc::unknown_fields`].
    Unknown(UnknownAction),
}

impl Action {
    /// The `action` number.
    #[must_use]
    pub fn number(&self) -> i64 {
        let known = match self {
            Self::AxisMove(_) => Known::AxisMove,
            Self::LinearMove(_) => Known::LinearMove,
            Self::CurveMove(_) => Known::CurveMove,
            Self::PathSpeed(_) => Known::PathSpeed,
            Self::StopOnSignal(_) => Known::StopOnSignal,
            Self::Wait(_) => Known::Wait,
            Self::Output(_) => Known::Output,
            Self::BoardOutput(_) => Known::BoardOutput,
            Self::Workbench(_) => Known::Workbench,
            Self::Unknown(unknown) => return unknown.action,
        };
        known.number()
    }

    /// What it is called: the name of its row in the table, such as `axis move`; `action 14` where there is no such row.
    #[must_use]
    pub fn name(&self) -> Cow<'static, str> {
        let number = self.number();
        action::name(number).map_or_else(|| format!("action {number}").into(), Cow::Borrowed)
    }
}

/// Up to eight coordinates, each given or left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coordinates {
    values: [f64; AXES],
    given: AxisMask,
}

impl Coordinates {
    /// The coordinates in order, as many as there are; more than eight are not taken.
    #[must_use]
    pub fn from_slice(values: &[f64]) -> Self {
        let mut coordinates = Self::default();
        for (axis, value) in AxisIndex::ALL.into_iter().zip(values) {
            coordinates.set(axis, *value);
        }
        coordinates
    }

    /// Gives one coordinate.
    pub fn set(&mut self, axis: AxisIndex, value: f64) {
        if let Some(slot) = self.values.get_mut(axis.index()) {
            *slot = value;
        }
        self.given = self.given.with(axis);
    }

    /// The coordinate, or `None` where it was left out.
    #[must_use]
    pub fn at(&self, axis: AxisIndex) -> Option<f64> {
        self.values.get(axis.index()).copied().filter(|_| self.given.contains(axis))
    }

    /// Which coordinates are given.
    #[must_use]
    pub fn given(&self) -> AxisMask {
        self.given
    }
}

/// An axis move or a linear move (manual 6.1.1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Move {
    /// `m0` … `m7`: degrees for an axis move; mm and degrees of a pose for a linear move.
    pub target: Coordinates,
    /// How it goes there.
    pub manner: Manner,
}

/// A curve through a middle pose (`m0` … `m7`) to an end pose (`m0_p` … `m7_p`) (manual 6.1.1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurveMove {
    /// `m0` … `m7`: the pose in the middle, mm and degrees.
    pub middle: Coordinates,
    /// `m0_p` … `m7_p`: the pose at the end, mm and degrees.
    pub end: Coordinates,
    /// How it goes there.
    pub manner: Manner,
}

/// What all moves have besides their coordinates (manual 6.1.1; `tool` and `coord` from 206 master F1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Manner {
    /// `ckStatus`: the axes that move, each of which has to have a coordinate; `None`: all that are given.
    ///
    /// Where one of the first six is left out, the mask is written all the same: what a controller takes for a coordinate that it
    /// does not find, nobody knows.
    pub mask: Option<AxisMask>,
    /// `speed`: percent, 0.1 to 100, in steps of 0.1; others are not sent.
    pub speed: Option<f64>,
    /// `delay`: seconds to wait before the move, 0 to 86400, in steps of 0.1; others are not sent.
    pub delay: Option<f64>,
    /// `smooth`: blend level 0 to 9.
    pub smooth: Option<BlendLevel>,
    /// `tool`: number of the tool frame.
    pub tool: Option<u32>,
    /// `coord`: number of the work frame (workbench).
    pub coord: Option<u32>,
}

/// How much a corner is rounded: 0 (stop at the point) to 9 (`smooth`, manual 6.1.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct BlendLevel(u8);

impl BlendLevel {
    /// The level, 0 to 9; `None` beyond.
    #[must_use]
    pub const fn new(level: u8) -> Option<Self> {
        if level <= 9 { Some(Self(level)) } else { None }
    }

    /// The level, 0 to 9.
    #[must_use]
    pub const fn level(self) -> u8 {
        self.0
    }
}

/// Path speed for linear moves that bring no speed of their own (action 51).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSpeed {
    /// `isUse`: on or off.
    pub in_use: bool,
    /// `speed`: mm/s before the global speed is applied; the controller wants a whole number (`"0.05"` raised alarm 219).
    pub speed: Option<f64>,
}

impl PathSpeed {
    /// The fastest that is sent, mm/s: arms of this protocol reach 2000 (reported, unit B).
    pub const FASTEST: u32 = 10_000;

    /// What a wrong one has to be.
    pub const WANTED: &str = "a whole number of mm/s, from 1 to 10000";

    /// Whether this speed is sent while a path speed is on: a whole number of mm/s, from 1 to [`Self::FASTEST`]. A controller may take
    /// more: no maximum is known.
    #[must_use]
    pub fn is_possible(speed: f64) -> bool {
        speed.fract() == 0.0 && (1.0..=f64::from(Self::FASTEST)).contains(&speed)
    }
}

/// An input that stops the motion (action 52, manual 6.1.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopOnSignal {
    /// `isUse`: begin (`true`) or end (`false`) to watch.
    pub in_use: bool,
    /// `ioNumber`: ordinary input 0 to 31.
    pub input: u8,
    /// `io_status`: the state that stops.
    pub on: bool,
}

/// A wait for a signal or a time (action 100, manual 6.1.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wait {
    /// `type` and `point`: what is watched.
    pub source: WaitSource,
    /// `io_status`: for what.
    pub condition: WaitCondition,
    /// `limit`: seconds in steps of 0.1, others are not sent; the time itself where only time is waited for.
    pub limit: f64,
    /// `isUnlimit`: `true` waits for ever.
    pub unlimited: bool,
}

/// What a wait watches (`type` and `point` of action 100).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitSource {
    /// An ordinary input: board 0 to 4 (`type` 0–4), point 0 to 31.
    Input {
        /// 0 to 4.
        board: u8,
        /// 0 to 31.
        point: u8,
    },
    /// An M point: board 0 to 2 (`type` 5–7), point 0 to 31.
    M {
        /// 0 to 2.
        board: u8,
        /// 0 to 31.
        point: u8,
    },
    /// An EU input (`type` 8), point 0 to 31.
    Eu {
        /// 0 to 31.
        point: u8,
    },
    /// Nothing but time (`type` 100).
    Time,
}

/// For what a wait waits (`io_status` of action 100).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitCondition {
    /// 0: off.
    Off,
    /// 1: on.
    On,
    /// 2: the change from off to on.
    RisingEdge,
    /// 3: the change from on to off.
    FallingEdge,
}

/// One output (action 200).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// `type`: which kind of output.
    pub kind: OutputKind,
    /// `point`: 0 to 32 (010 to 047 and one more in octal names).
    pub point: u8,
    /// `io_status`: on or off.
    pub on: bool,
    /// `delay`: seconds in steps of 0.001, others are not sent; before the output for 0, 5 and 7, the length of the pulse for a timed
    /// output.
    pub delay: f64,
}

/// Which kind of output action 200 sets (`type`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// 0: output Y.
    Y,
    /// 5: point M.
    M,
    /// 7: output EUY.
    Euy,
    /// 100: output Y, set back after the delay.
    TimedY,
}

/// All outputs of one board (action 204).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardOutput {
    /// `type`: which board.
    pub board: OutputBoard,
    /// `point`: two bits each for points 0 to 15.
    pub low: PairMask,
    /// `point2`: two bits each for points 16 to 31.
    pub high: PairMask,
}

/// Which board action 204 sets (`type`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputBoard {
    /// 0 and 1: output boards Y0, Y1.
    Y(u8),
    /// 5 and 6: M boards M0, M1.
    M(u8),
}

/// The workbench to use from here on (action 800, manual 6.1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Workbench {
    /// `cnt_id`: number of the workbench.
    pub id: u32,
}

/// An action that this version does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownAction {
    pub(crate) action: i64,
    /// Its members, by position in the decoder's list.
    pub(crate) fields: (u32, u32),
}

impl UnknownAction {
    /// The `action` number.
    #[must_use]
    pub fn number(&self) -> i64 {
        self.action
    }
}

/// Seconds that any delay or limit may last: a day. Longer ones are taken for a mistake in the unit.
const LONGEST_TIME: f64 = 86_400.0;

impl Instruction {
    /// Reads the instruction that the fields tell, `Ok(None)` for an action number that nobody knows.
    pub(crate) fn from_fields(fields: &mut FieldsView<'_>) -> Result<Option<Self>, FieldError> {
        let number = fields.integer(Fields::ACTION, "a whole number")?;
        let oneshot = fields.optional(Fields::ONESHOT, "1 or 0", |value| value.flag())?.unwrap_or(false);
        let Some(known) = Known::of(number) else { return Ok(None) };
        let action = match known {
            Known::AxisMove => Action::AxisMove(Move::from_fields(fields)?),
            Known::LinearMove => Action::LinearMove(Move::from_fields(fields)?),
            Known::CurveMove => Action::CurveMove(CurveMove {
                middle: coordinates(fields, Fields::M)?,
                end: coordinates(fields, Fields::M_P)?,
                manner: Manner::from_fields(fields)?,
            }),
            Known::PathSpeed => Action::PathSpeed(PathSpeed {
                in_use: fields.required(Fields::IS_USE, "1 or 0", |value| value.flag())?,
                speed: fields.optional(Fields::SPEED, "a number of mm/s", |value| value.number())?,
            }),
            Known::StopOnSignal => Action::StopOnSignal(StopOnSignal {
                in_use: fields.required(Fields::IS_USE, "1 or 0", |value| value.flag())?,
                input: fields.required(Fields::IO_NUMBER, POINT, |value| small(value.integer(), 31))?,
                on: fields.required(Fields::IO_STATUS, "1 or 0", |value| value.flag())?,
            }),
            Known::Wait => Action::Wait(Wait::from_fields(fields)?),
            Known::Output => Action::Output(Output::from_fields(fields)?),
            Known::BoardOutput => Action::BoardOutput(BoardOutput {
                board: fields.required(Fields::TYPE, "0, 1 (Y) or 5, 6 (M)", |value| {
                    match value.integer()? {
                        board @ (0 | 1) => small(Some(board), 1).map(OutputBoard::Y),
                        board @ (5 | 6) => small(Some(board - 5), 1).map(OutputBoard::M),
                        _ => None,
                    }
                })?,
                low: pairs(fields, Fields::POINT)?,
                high: pairs(fields, Fields::POINT2)?,
            }),
            Known::Workbench => Action::Workbench(Workbench {
                id: fields.required(Fields::CNT_ID, "a number from 0", |value| {
                    u32::try_from(value.integer()?).ok()
                })?,
            }),
        };
        Ok(Some(Self { oneshot, action }))
    }

    /// Appends the instruction as the manual writes it.
    ///
    /// # Errors
    /// A coordinate, speed or time that is not finite or out of range, and an unknown action, are not encoded.
    pub(crate) fn encode(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let mut object = ObjectWriter::begin(out);
        object.quoted_flag(key!("oneshot"), self.oneshot);
        object.quoted_integer(key!("action"), self.action.number());
        match &self.action {
            Action::AxisMove(motion) | Action::LinearMove(motion) => {
                write_coordinates(&mut object, &motion.target, Fields::M)?;
                motion.manner.encode(&mut object, motion.target.given())?;
            }
            Action::CurveMove(curve) => {
                write_coordinates(&mut object, &curve.middle, Fields::M)?;
                write_coordinates(&mut object, &curve.end, Fields::M_P)?;
                curve.manner.encode(&mut object, curve.middle.given().and(curve.end.given()))?;
            }
            Action::PathSpeed(path) => {
                object.quoted_flag(key!("isUse"), path.in_use);
                if let Some(speed) = path.speed {
                    // Where it is switched off, 0 is what clients send.
                    let is_off = !path.in_use && speed == 0.0;
                    if !is_off && !PathSpeed::is_possible(speed) {
                        return Err(EncodeError::new("speed", PathSpeed::WANTED));
                    }
                    object.quoted_fixed(key!("speed"), speed, Decimals::FEW)?;
                }
            }
            Action::StopOnSignal(stop) => {
                object.quoted_flag(key!("isUse"), stop.in_use);
                object.quoted_integer(key!("ioNumber"), within("ioNumber", stop.input, 31, POINT)?);
                object.quoted_flag(key!("io_status"), stop.on);
            }
            Action::Wait(wait) => wait.encode(&mut object)?,
            Action::Output(output) => {
                object.quoted_integer(key!("type"), output.kind.number());
                object.quoted_flag(key!("io_status"), output.on);
                object.quoted_integer(
                    key!("point"),
                    within("point", output.point, 32, "a point from 0 to 32")?,
                );
                object.quoted_fixed(
                    key!("delay"),
                    sendable_seconds("delay", output.delay, Grid::MILLISECONDS)?,
                    Decimals::FEW,
                )?;
            }
            Action::BoardOutput(output) => {
                let (OutputBoard::Y(board) | OutputBoard::M(board)) = output.board;
                within("type", board, 1, "board 0 or 1")?;
                object.quoted_integer(key!("type"), output.board.number());
                object.quoted_integer(key!("point"), i64::from(output.low.bits()));
                object.quoted_integer(key!("point2"), i64::from(output.high.bits()));
            }
            Action::Workbench(bench) => object.quoted_integer(key!("cnt_id"), i64::from(bench.id)),
            Action::Unknown(_) => {
                return Err(EncodeError::new("action", "an action that this version knows"));
            }
        }
        object.end();
        Ok(())
    }
}

const POINT: &str = "a point from 0 to 31";

fn small(value: Option<i64>, last: u8) -> Option<u8> {
    value.and_then(|value| u8::try_from(value).ok()).filter(|value| *value <= last)
}

/// A small number as the wire's integer, if it is not beyond `last`.
fn within(field: &'static str, value: u8, last: u8, wanted: &'static str) -> Result<i64, EncodeError> {
    if value <= last { Ok(i64::from(value)) } else { Err(EncodeError::new(field, wanted)) }
}

fn coordinates(fields: &mut FieldsView<'_>, group: [usize; AXES]) -> Result<Coordinates, FieldError> {
    let mut coordinates = Coordinates::default();
    for (axis, field) in AxisIndex::ALL.into_iter().zip(group) {
        if let Some(value) =
            fields.optional(field, "a finite number of mm or degrees", |value| value.number())?
        {
            coordinates.set(axis, value);
        }
    }
    Ok(coordinates)
}

fn write_coordinates(
    object: &mut ObjectWriter<'_>,
    coordinates: &Coordinates,
    group: [usize; AXES],
) -> Result<(), EncodeError> {
    for (axis, field) in AxisIndex::ALL.into_iter().zip(group) {
        if let Some(value) = coordinates.at(axis) {
            object.quoted_fixed(Fields::key(field), value, Decimals::POSITION)?;
        }
    }
    Ok(())
}

fn pairs(fields: &mut FieldsView<'_>, field: usize) -> Result<PairMask, FieldError> {
    let bits = fields.optional(field, "a number of 32 bits, two for each point", |value| {
        u32::try_from(value.integer()?).ok()
    })?;
    Ok(PairMask::from_bits(bits.unwrap_or(0)))
}

fn sendable_seconds(field: &'static str, seconds: f64, grid: Grid) -> Result<f64, EncodeError> {
    if !(0.0..=LONGEST_TIME).contains(&seconds) {
        return Err(EncodeError::new(field, "seconds, from 0 to 86400"));
    }
    grid.sendable(field, seconds)?;
    Ok(seconds)
}

fn seconds(fields: &mut FieldsView<'_>, field: usize) -> Result<Option<f64>, FieldError> {
    fields.optional(field, "seconds, from 0 to 86400", |value| {
        value.number().filter(|time| (0.0..=LONGEST_TIME).contains(time))
    })
}

impl Move {
    fn from_fields(fields: &mut FieldsView<'_>) -> Result<Self, FieldError> {
        Ok(Self { target: coordinates(fields, Fields::M)?, manner: Manner::from_fields(fields)? })
    }
}

impl Manner {
    fn from_fields(fields: &mut FieldsView<'_>) -> Result<Self, FieldError> {
        let number = |value: crate::value::Value<'_>| u32::try_from(value.integer()?).ok();
        Ok(Self {
            mask: fields.optional(
                Fields::CK_STATUS,
                "a mask from 0 to 0xFF, such as \"0x3F\" or 63",
                mask,
            )?,
            speed: fields.optional(Fields::SPEED, "a finite number of percent", |value| value.number())?,
            delay: seconds(fields, Fields::DELAY)?,
            smooth: fields.optional(Fields::SMOOTH, "a blend level from 0 to 9", |value| {
                small(value.integer(), 9).and_then(BlendLevel::new)
            })?,
            tool: fields.optional(Fields::TOOL, "a tool number from 0", number)?,
            coord: fields.optional(Fields::COORD, "a workbench number from 0", number)?,
        })
    }

    /// Appends it to a move that has these coordinates.
    fn encode(&self, object: &mut ObjectWriter<'_>, given: AxisMask) -> Result<(), EncodeError> {
        if self.mask.is_some_and(|mask| mask.and(given) != mask) {
            return Err(EncodeError::new("ckStatus", "a mask of axes that all have a coordinate"));
        }
        // A controller may take 0 for what it does not find.
        let left_out = given.and(AxisMask::SIX) != AxisMask::SIX;
        if let Some(mask) = self.mask.or(left_out.then_some(given)) {
            let digit = |nibble| if nibble < 10 { b'0' + nibble } else { b'A' + nibble - 10 };
            let [high, low] = [mask.bits() >> 4, mask.bits() & 0xF].map(digit);
            object.key(key!("ckStatus")).extend_from_slice(&[b'"', b'0', b'x', high, low, b'"']);
        }
        if let Some(speed) = self.speed {
            // Below the first step nothing would move.
            if !(0.1..=100.0).contains(&speed) {
                return Err(EncodeError::new("speed", "percent, from 0.1 to 100"));
            }
            Grid::PERCENT.sendable("speed", speed)?;
            object.quoted_fixed(key!("speed"), speed, Decimals::TENTHS)?;
        }
        if let Some(delay) = self.delay {
            object.quoted_fixed(
                key!("delay"),
                sendable_seconds("delay", delay, Grid::TENTHS_OF_A_SECOND)?,
                Decimals::TENTHS,
            )?;
        }
        if let Some(smooth) = self.smooth {
            object.quoted_integer(key!("smooth"), i64::from(smooth.level()));
        }
        if let Some(tool) = self.tool {
            object.quoted_integer(key!("tool"), i64::from(tool));
        }
        if let Some(coord) = self.coord {
            object.quoted_integer(key!("coord"), i64::from(coord));
        }
        Ok(())
    }
}

/// A mask as clients send it: `0x3F`, `0X3F`, `63` or a bare number.
fn mask(value: crate::value::Value<'_>) -> Option<AxisMask> {
    let word = value.word();
    let word = word.trim_ascii();
    let bits = match word.strip_prefix(b"0x").or_else(|| word.strip_prefix(b"0X")) {
        Some(digits) if value.is_text() => {
            let plain = !digits.is_empty() && digits.iter().all(u8::is_ascii_hexdigit);
            let digits = std::str::from_utf8(digits).ok().filter(|_| plain)?;
            i64::from(u32::from_str_radix(digits, 16).ok()?)
        }
        Some(_) | None => value.integer()?,
    };
    u8::try_from(bits).ok().map(AxisMask::from_bits)
}

impl Wait {
    fn from_fields(fields: &mut FieldsView<'_>) -> Result<Self, FieldError> {
        let kind = fields.required(Fields::TYPE, "0–4 (X), 5–7 (M), 8 (EU) or 100 (time)", |value| {
            value
                .integer()
                .filter(|kind| matches!(kind, 0..=8 | 100))
                .and_then(|kind| u8::try_from(kind).ok())
        })?;
        let timed = kind == 100;
        let point = fields.optional(Fields::POINT, POINT, |value| small(value.integer(), 31))?;
        let condition =
            fields.optional(Fields::IO_STATUS, "0 off, 1 on, 2 rising or 3 falling", |value| match value
                .integer()?
            {
                0 => Some(WaitCondition::Off),
                1 => Some(WaitCondition::On),
                2 => Some(WaitCondition::RisingEdge),
                3 => Some(WaitCondition::FallingEdge),
                _ => None,
            })?;
        let (point, condition) = match (point, condition) {
            (Some(point), Some(condition)) => (point, condition),
            (point, condition) if timed => (point.unwrap_or(0), condition.unwrap_or(WaitCondition::Off)),
            (None, _) => return Err(fields.missing(Fields::POINT, POINT)),
            (Some(_), None) => {
                return Err(fields.missing(Fields::IO_STATUS, "0 off, 1 on, 2 rising or 3 falling"));
            }
        };
        let source = match kind {
            board @ 0..=4 => WaitSource::Input { board, point },
            board @ 5..=7 => WaitSource::M { board: board - 5, point },
            8 => WaitSource::Eu { point },
            _ => WaitSource::Time,
        };
        let unlimited = fields.optional(Fields::IS_UNLIMIT, "1 or 0", |value| value.flag())?.unwrap_or(false);
        let limit = seconds(fields, Fields::LIMIT)?.unwrap_or(0.0);
        Ok(Self { source, condition, limit, unlimited })
    }

    fn encode(&self, object: &mut ObjectWriter<'_>) -> Result<(), EncodeError> {
        let (kind, point) = match self.source {
            WaitSource::Input { board, point } => (within("type", board, 4, "input board 0 to 4")?, point),
            WaitSource::M { board, point } => (within("type", board, 2, "M board 0 to 2")? + 5, point),
            WaitSource::Eu { point } => (8, point),
            WaitSource::Time => (100, 0),
        };
        object.quoted_integer(key!("type"), kind);
        object.quoted_integer(key!("point"), within("point", point, 31, POINT)?);
        object.quoted_integer(
            key!("io_status"),
            match self.condition {
                WaitCondition::Off => 0,
                WaitCondition::On => 1,
                WaitCondition::RisingEdge => 2,
                WaitCondition::FallingEdge => 3,
            },
        );
        object.quoted_fixed(
            key!("limit"),
            sendable_seconds("limit", self.limit, Grid::TENTHS_OF_A_SECOND)?,
            Decimals::FEW,
        )?;
        object.quoted_flag(key!("isUnlimit"), self.unlimited);
        Ok(())
    }
}

impl Output {
    fn from_fields(fields: &mut FieldsView<'_>) -> Result<Self, FieldError> {
        Ok(Self {
            kind: fields.required(
                Fields::TYPE,
                "0 (Y), 5 (M), 7 (EUY) or 100 (timed Y)",
                |value| match value.integer()? {
                    0 => Some(OutputKind::Y),
                    5 => Some(OutputKind::M),
                    7 => Some(OutputKind::Euy),
                    100 => Some(OutputKind::TimedY),
                    _ => None,
                },
            )?,
            point: fields
                .required(Fields::POINT, "a point from 0 to 32", |value| small(value.integer(), 32))?,
            on: fields.required(Fields::IO_STATUS, "1 or 0", |value| value.flag())?,
            delay: seconds(fields, Fields::DELAY)?.unwrap_or(0.0),
        })
    }
}

impl OutputKind {
    /// The `type` number.
    #[must_use]
    pub fn number(self) -> i64 {
        match self {
            Self::Y => 0,
            Self::M => 5,
            Self::Euy => 7,
            Self::TimedY => 100,
        }
    }
}

impl OutputBoard {
    /// The `type` number.
    #[must_use]
    pub fn number(self) -> i64 {
        match self {
            Self::Y(board) => i64::from(board),
            Self::M(board) => i64::from(board) + 5,
        }
    }
}
