//! The table of the members of instructions and of camera points. Each row is one member; a struct groups its
//! rows. The structs, the code that reads and writes them, the names on the wire and the lists of
//! [`super::super::action`] are generated from this table.
//!
//! Each row has: its documentation, its name in the code and its type; `must` (required), `may` (optional) or
//! `or` (with a default); its names on the wire, each with the section of the manual or the evidence for a
//! later one; and its kind ([`super::kinds`]). A struct is written in the order of its rows.

use super::kinds::{
    BareFlag, BareNumber, BareWhole, Blend, Flag, Kind, Listed, Mask, Number, OnGrid, POINT, Pairs, Seconds,
    UpTo, Watched, Whole,
};
use super::{BlendLevel, OutputBoard, OutputKind, WaitCondition, WaitSource};
use crate::axis::AxisMask;
use crate::encode::{Decimals, ObjectWriter, key};
use crate::error::{EncodeError, FieldError, Wanted};
use crate::grid::Grid;
use crate::io_point::PairMask;
use crate::message::action::MemberInfo;
use crate::message::fields::{Fields, FieldsView};

const MM: Wanted = Wanted(&["a finite number of mm", "有限的毫米数"]);
const DEGREES: Wanted = Wanted(&["a finite number of degrees", "有限的角度"]);

macro_rules! parts {
    ($(
        $(#[$doc:meta])*
        $part:ident {
            $(
                $(#[$member_doc:meta])*
                $member:ident: $value:ty = $how:ident $(($($default:expr),+))?
                    $($name:literal $source:literal),+ => $kind:expr;
            )+
        }
    )+) => {
        $(
            $(#[$doc])*
            pub struct $part {
                $( $(#[$member_doc])* pub $member: $value, )+
            }

            impl $part {
                /// Its members on the wire.
                pub const MEMBERS: &[MemberInfo] =
                    &[$( $( MemberInfo { name: $name, source: $source }, )+ )+];

                /// Reads it from the members of an object.
                pub(crate) fn from_fields(fields: &mut FieldsView<'_>) -> Result<Self, FieldError> {
                    $(
                        let slots = [$( const { Fields::of($name) } ),+];
                        let $member = parts!(@take $how $(($($default),+))? fields, slots, $kind);
                    )+
                    Ok(Self { $( $member, )+ })
                }

                /// Appends its members to an object.
                pub(in crate::message) fn write(&self, object: &mut ObjectWriter<'_>) -> Result<(), EncodeError> {
                    $( parts!(@give $how object, self.$member, [$( key!($name) ),+], $kind); )+
                    Ok(())
                }
            }
        )+

        /// The names of all members, as often as they occur in the table.
        pub(crate) const NAMES: &[&str] = &[$( $( $( $name, )+ )+ )+];
    };
    (@take must $fields:ident, $slots:ident, $kind:expr) => {
        match $kind.take($fields, $slots)? {
            Some(value) => value,
            None => return Err($kind.missing($fields, $slots)),
        }
    };
    (@take may $fields:ident, $slots:ident, $kind:expr) => { $kind.take($fields, $slots)? };
    (@take or($default:expr) $fields:ident, $slots:ident, $kind:expr) => {
        $kind.take($fields, $slots)?.unwrap_or($default)
    };
    // If the member is absent: the default counts if the condition holds. Otherwise the member is missing.
    (@take or($default:expr, $if:expr) $fields:ident, $slots:ident, $kind:expr) => {
        match $kind.take($fields, $slots)? {
            Some(value) => value,
            None if $if => $default,
            None => return Err($kind.missing($fields, $slots)),
        }
    };
    (@give may $object:ident, $value:expr, $keys:expr, $kind:expr) => {
        if let Some(value) = $value {
            $kind.give($object, $keys, value)?;
        }
    };
    (@give $how:ident $object:ident, $value:expr, $keys:expr, $kind:expr) => {
        $kind.give($object, $keys, $value)?;
    };
}

parts! {
    /// The members that all moves have besides their coordinates (manual 6.1.1; `tool` and `coord` from 206
    /// master F1).
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    Manner {
        /// `ckStatus`: the axes that move, each of which needs a coordinate; `None`: all axes with a
        /// coordinate.
        ///
        /// If one of the first six coordinates is absent, the mask is written even for `None`. It is not
        /// known which value a controller uses for an absent coordinate.
        mask: Option<AxisMask> = may "ckStatus" "6.1.1" => Mask;
        /// `speed`: percent, 0.1 to 100, in steps of 0.1; other values are not sent.
        speed: Option<f64> = may "speed" "6.1.1" =>
            OnGrid { range: Manner::SPEEDS, grid: Grid::PERCENT, read: Wanted(&["a finite number of percent", "有限的百分比"]), sent: Manner::SPEEDS_WANTED };
        /// `delay`: seconds to wait before the move, 0 to 86400, in steps of 0.1; other values are not sent.
        delay: Option<f64> = may "delay" "6.1.1" => Seconds(Grid::TENTHS_OF_A_SECOND, Decimals::TENTHS);
        /// `smooth`: blend level 0 to 9.
        smooth: Option<BlendLevel> = may "smooth" "6.1.1" => Blend;
        /// `tool`: number of the tool frame.
        tool: Option<u32> = may "tool" "later manual" => Whole(Wanted(&["a tool number from 0", "不小于 0 的工具编号"]));
        /// `coord`: number of the work frame (workbench).
        coord: Option<u32> = may "coord" "later manual" => Whole(Wanted(&["a workbench number from 0", "不小于 0 的工作台编号"]));
    }

    /// Path speed for linear moves without a speed of their own (action 51).
    #[derive(Clone, Copy, Debug, PartialEq)]
    PathSpeed {
        /// `isUse`: on or off.
        in_use: bool = must "isUse" "later manual" => Flag;
        /// `speed`: mm/s before the global speed is applied. The controller requires a whole number (`"0.05"`
        /// raised alarm 219).
        speed: Option<f64> = may "speed" "later manual" => Number(Wanted(&["a number of mm/s", "数值，单位 mm/s"]));
    }

    /// An input that stops the motion (action 52, manual 6.1.4).
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    StopOnSignal {
        /// `isUse`: start (`true`) or stop (`false`) watching.
        in_use: bool = must "isUse" "6.1.4" => Flag;
        /// `ioNumber`: ordinary input 0 to 31.
        input: u8 = must "ioNumber" "6.1.4" => UpTo(31, POINT);
        /// `io_status`: the state that stops the motion.
        on: bool = must "io_status" "6.1.4" => Flag;
    }

    /// A wait for a signal or a time (action 100, manual 6.1.3).
    #[derive(Clone, Copy, Debug, PartialEq)]
    Wait {
        /// `type` and `point`: the signal, or time.
        source: WaitSource = must "type" "6.1.3", "point" "6.1.3" => Watched;
        /// `io_status`: the state or change to wait for.
        condition: WaitCondition = or(WaitCondition::Off, source == WaitSource::Time) "io_status" "6.1.3" => Listed(
            Wanted(&["0 off, 1 on, 2 rising or 3 falling", "0 断、1 通、2 上升沿或 3 下降沿"]),
            &[
                (0, WaitCondition::Off),
                (1, WaitCondition::On),
                (2, WaitCondition::RisingEdge),
                (3, WaitCondition::FallingEdge),
            ],
        );
        /// `limit`: seconds in steps of 0.1; other values are not sent. For a wait for time, this is the
        /// time.
        limit: f64 = or(0.0) "limit" "6.1.3" => Seconds(Grid::TENTHS_OF_A_SECOND, Decimals::FEW);
        /// `isUnlimit`: `true` waits for ever.
        unlimited: bool = or(false) "isUnlimit" "6.1.3" => Flag;
    }

    /// One output (action 200).
    #[derive(Clone, Copy, Debug, PartialEq)]
    Output {
        /// `type`: which kind of output.
        kind: OutputKind = must "type" "later manual" => Listed(
            Wanted(&["0 (Y), 5 (M), 7 (EUY) or 100 (timed Y)", "0（Y）、5（M）、7（EUY）或 100（定时 Y）"]),
            &[(0, OutputKind::Y), (5, OutputKind::M), (7, OutputKind::Euy), (100, OutputKind::TimedY)],
        );
        /// `io_status`: on or off.
        on: bool = must "io_status" "later manual" => Flag;
        /// `point`: 0 to 32 (010 to 047 and one more in octal names).
        point: u8 = must "point" "later manual" => UpTo(32, Wanted(&["a point from 0 to 32", "0 至 32 的点位"]));
        /// `delay`: seconds in steps of 0.001; other values are not sent. For types 0, 5 and 7 it is the time
        /// before the output; for a timed output it is the length of the pulse.
        delay: f64 = or(0.0) "delay" "later manual" => Seconds(Grid::MILLISECONDS, Decimals::FEW);
    }

    /// All outputs of one board (action 204).
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    BoardOutput {
        /// `type`: which board.
        board: OutputBoard = must "type" "later manual" => Listed(
            Wanted(&["0, 1 (Y) or 5, 6 (M)", "0、1（Y）或 5、6（M）"]),
            &[(0, OutputBoard::Y(0)), (1, OutputBoard::Y(1)), (5, OutputBoard::M(0)), (6, OutputBoard::M(1))],
        );
        /// `point`: two bits each for points 0 to 15.
        low: PairMask = or(PairMask::from_bits(0)) "point" "later manual" => Pairs;
        /// `point2`: two bits each for points 16 to 31.
        high: PairMask = or(PairMask::from_bits(0)) "point2" "later manual" => Pairs;
    }

    /// The workbench for the following instructions (action 800, manual 6.1.2).
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Workbench {
        /// `cnt_id`: number of the workbench.
        id: u32 = must "cnt_id" "6.1.2" => Whole(Wanted(&["a number from 0", "不小于 0 的整数"]));
    }

    /// One part that a camera found, in the robot's calibrated world (manual 5.2).
    ///
    /// A coordinate that is left out is not written, and is not read as 0: the tool keeps its present value.
    /// The manual always shows all of X to `Angel`. It is not known what a shipped controller does with an
    /// incomplete point, so give all six if the wrist matters.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    Point {
        /// `ModelID`: the template that recognised the part.
        model_id: i64 = or(0) "ModelID" "5.2" => BareWhole;
        /// `X`, mm.
        x: f64 = must "X" "5.2" => BareNumber(MM, Decimals::POSITION);
        /// `Y`, mm.
        y: f64 = must "Y" "5.2" => BareNumber(MM, Decimals::POSITION);
        /// `Z`, mm. If it is left out, the tool keeps its height.
        z: Option<f64> = may "Z" "5.2" => BareNumber(MM, Decimals::POSITION);
        /// `U`, degrees. If it is left out, the tool keeps its U. A four-axis robot has no U.
        u: Option<f64> = may "U" "5.2" => BareNumber(DEGREES, Decimals::POSITION);
        /// `V`, degrees. If it is left out, the tool keeps its V. A four-axis robot has no V.
        v: Option<f64> = may "V" "5.2" => BareNumber(DEGREES, Decimals::POSITION);
        /// `Angel` (the wire's spelling), degrees: W, or U on a four-axis robot. If it is left out, the tool
        /// keeps its angle.
        angle: Option<f64> = may "Angel" "5.2" => BareNumber(DEGREES, Decimals::POSITION);
        /// `Similarity`. The manual does not give its range.
        similarity: Option<f64> = may "Similarity" "5.2" => BareNumber(Wanted(&["a finite number", "有限的数"]), Decimals::FEW);
        /// `Color`. The manual does not give its range.
        color: Option<i64> = may "Color" "5.2" => BareWhole;
        /// `Rel`: the coordinates are relative.
        relative: bool = or(false) "Rel" "5.2" => BareFlag;
    }
}
