//! Instructions: the steps that AddRCC puts into a controller's instruction list (manual 6).

mod kinds;
mod named;
mod table;

use std::borrow::Cow;
use std::ops::RangeInclusive;

use crate::axis::{AXES, AxisIndex, AxisMask};
use crate::encode::{Decimals, ObjectWriter, key};
use crate::error::{EncodeError, FieldError, Wanted};
use crate::message::action::{self, Known};
use crate::message::fields::{Fields, FieldsView};

pub use kinds::{TIMES, TIMES_WANTED};
pub use named::WrongPoint;
pub(crate) use table::NAMES;
pub use table::{BoardOutput, Manner, Output, PathSpeed, Point, StopOnSignal, Wait, Workbench};

/// One step of an instruction list (manual 6, "instructions").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruction {
    /// `oneshot`: `true` removes the step once it has run; `false` keeps it, and the list runs it again and
    /// again.
    pub oneshot: bool,
    /// What the step does.
    pub action: Action,
}

/// What an instruction does, by its `action` number (manual 6.1 and later).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// 4, "free path": every axis moves directly to its target, and all arrive together. Coordinates in
    /// degrees.
    AxisMove(Move),
    /// 10, "pose line": the tool moves in a straight line to a pose. Coordinates X, Y, Z in mm, U, V, W in
    /// degrees.
    LinearMove(Move),
    /// 17, "pose curve": the tool moves through a middle pose to an end pose.
    CurveMove(CurveMove),
    /// 51: the path speed of later linear moves that have no speed of their own (207beta91).
    PathSpeed(PathSpeed),
    /// 52: an input that stops the motion when it reaches a given state.
    StopOnSignal(StopOnSignal),
    /// 100: waits for an input or for a time.
    Wait(Wait),
    /// 200: sets one output (206 master F1).
    Output(Output),
    /// 204: sets many outputs of one board at once (later manual).
    BoardOutput(BoardOutput),
    /// 800: changes the workbench.
    Workbench(Workbench),
    /// Any other action. Its fields stay readable through [`crate::message::AddRcc::unknown_fields`].
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

    /// Its name: the name of its row in the table, such as `axis move`, or `action 14` if there is no such
    /// row.
    #[must_use]
    pub fn name(&self) -> Cow<'static, str> {
        let number = self.number();
        action::name(number).map_or_else(|| format!("action {number}").into(), Cow::Borrowed)
    }
}

/// Up to eight coordinates, each of them optional.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coordinates {
    values: [f64; AXES],
    given: AxisMask,
}

impl Coordinates {
    /// The coordinates in order. Coordinates after the eighth are ignored.
    #[must_use]
    pub fn from_slice(values: &[f64]) -> Self {
        let mut coordinates = Self::default();
        for (axis, value) in AxisIndex::ALL.into_iter().zip(values) {
            coordinates.set(axis, *value);
        }
        coordinates
    }

    /// Sets one coordinate.
    pub fn set(&mut self, axis: AxisIndex, value: f64) {
        if let Some(slot) = self.values.get_mut(axis.index()) {
            *slot = value;
        }
        self.given = self.given.with(axis);
    }

    /// The coordinate, or `None` if it is not given.
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
    /// Mask, speed, delay, blend level and frames of the move.
    pub manner: Manner,
}

/// A curve through a middle pose (`m0` … `m7`) to an end pose (`m0_p` … `m7_p`) (manual 6.1.1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurveMove {
    /// `m0` … `m7`: the pose in the middle, mm and degrees.
    pub middle: Coordinates,
    /// `m0_p` … `m7_p`: the pose at the end, mm and degrees.
    pub end: Coordinates,
    /// Mask, speed, delay, blend level and frames of the move.
    pub manner: Manner,
}

/// How much the path rounds a corner: 0 (stop at the point) to 9 (`smooth`, manual 6.1.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct BlendLevel(u8);

impl BlendLevel {
    /// The level, 0 to 9; `None` above 9.
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

impl PathSpeed {
    /// The highest speed that is sent, mm/s. Arms of this protocol reach 2000 (reported, unit B).
    pub const FASTEST: u32 = 10_000;

    /// What a valid speed is.
    pub const WANTED: &str = "a whole number of mm/s, from 1 to 10000";

    /// Whether this speed can be sent while a path speed is on: a whole number of mm/s, from 1 to
    /// [`Self::FASTEST`]. A controller may accept more; no maximum is known.
    #[must_use]
    pub fn is_possible(speed: f64) -> bool {
        speed.fract() == 0.0 && (1.0..=f64::from(Self::FASTEST)).contains(&speed)
    }
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
    /// Only time (`type` 100).
    Time,
}

/// The state or change that a wait waits for (`io_status` of action 100).
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

/// Which kind of output action 200 sets (`type`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// 0: output Y.
    Y,
    /// 5: point M.
    M,
    /// 7: output EUY.
    Euy,
    /// 100: output Y, which is set back after the delay.
    TimedY,
}

/// Which board action 204 sets (`type`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputBoard {
    /// 0 and 1: output boards Y0, Y1.
    Y(u8),
    /// 5 and 6: M boards M0, M1.
    M(u8),
}

/// An action that this version does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownAction {
    pub(crate) action: i64,
    /// Range of its members in the decoder's list.
    pub(crate) fields: (u32, u32),
}

impl UnknownAction {
    /// The `action` number.
    #[must_use]
    pub fn number(&self) -> i64 {
        self.action
    }
}

impl Instruction {
    /// Reads the instruction from the fields; `Ok(None)` for an unknown action number.
    pub(crate) fn from_fields(fields: &mut FieldsView<'_>) -> Result<Option<Self>, FieldError> {
        let number = fields.integer(Fields::ACTION, Wanted(&["a whole number", "整数"]))?;
        let oneshot = fields
            .optional(Fields::ONESHOT, Wanted(&["1 or 0", "1 或 0"]), |value| value.flag())?
            .unwrap_or(false);
        let Some(known) = Known::of(number) else { return Ok(None) };
        let action = match known {
            Known::AxisMove => Action::AxisMove(Move::from_fields(fields)?),
            Known::LinearMove => Action::LinearMove(Move::from_fields(fields)?),
            Known::CurveMove => Action::CurveMove(CurveMove {
                middle: coordinates(fields, Fields::M)?,
                end: coordinates(fields, Fields::M_P)?,
                manner: Manner::from_fields(fields)?,
            }),
            Known::PathSpeed => Action::PathSpeed(PathSpeed::from_fields(fields)?),
            Known::StopOnSignal => Action::StopOnSignal(StopOnSignal::from_fields(fields)?),
            Known::Wait => Action::Wait(Wait::from_fields(fields)?),
            Known::Output => Action::Output(Output::from_fields(fields)?),
            Known::BoardOutput => Action::BoardOutput(BoardOutput::from_fields(fields)?),
            Known::Workbench => Action::Workbench(Workbench::from_fields(fields)?),
        };
        Ok(Some(Self { oneshot, action }))
    }

    /// Appends the instruction in the manual's form.
    ///
    /// # Errors
    /// A coordinate, speed or time that is not finite or is out of range, and an unknown action, are not
    /// encoded.
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
            Action::PathSpeed(path) => path.encode(&mut object)?,
            Action::StopOnSignal(stop) => stop.write(&mut object)?,
            Action::Wait(wait) => wait.write(&mut object)?,
            Action::Output(output) => output.write(&mut object)?,
            Action::BoardOutput(output) => output.write(&mut object)?,
            Action::Workbench(bench) => bench.write(&mut object)?,
            Action::Unknown(_) => {
                return Err(EncodeError::new("action", "an action that this version knows"));
            }
        }
        object.end();
        Ok(())
    }
}

fn coordinates(fields: &mut FieldsView<'_>, group: [usize; AXES]) -> Result<Coordinates, FieldError> {
    let mut coordinates = Coordinates::default();
    for (axis, field) in AxisIndex::ALL.into_iter().zip(group) {
        if let Some(value) = fields.optional(
            field,
            Wanted(&["a finite number of mm or degrees", "有限的毫米数或角度"]),
            |value| value.number(),
        )? {
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

impl Move {
    fn from_fields(fields: &mut FieldsView<'_>) -> Result<Self, FieldError> {
        Ok(Self { target: coordinates(fields, Fields::M)?, manner: Manner::from_fields(fields)? })
    }
}

impl Manner {
    /// The speeds that are sent, in percent of the maximum (manual 6.1.1). At 0 nothing would move.
    pub const SPEEDS: RangeInclusive<f64> = 0.1..=100.0;

    /// What a valid speed is.
    pub const SPEEDS_WANTED: &str = "percent from 0.1 to 100";

    /// Appends it to a move that has these coordinates.
    fn encode(&self, object: &mut ObjectWriter<'_>, given: AxisMask) -> Result<(), EncodeError> {
        if self.mask.is_some_and(|mask| mask.and(given) != mask) {
            return Err(EncodeError::new("ckStatus", "a mask of axes that all have a coordinate"));
        }
        // A controller may read a missing coordinate as 0, so the mask has to be explicit.
        let left_out = given.and(AxisMask::SIX) != AxisMask::SIX;
        Self { mask: self.mask.or(left_out.then_some(given)), ..*self }.write(object)
    }
}

impl PathSpeed {
    fn encode(&self, object: &mut ObjectWriter<'_>) -> Result<(), EncodeError> {
        // Clients send 0 when they switch it off.
        let is_sent = |speed| (!self.in_use && speed == 0.0) || Self::is_possible(speed);
        if self.speed.is_none_or(is_sent) {
            self.write(object)
        } else {
            Err(EncodeError::new("speed", Self::WANTED))
        }
    }
}
