//! Strategies for everything that a request can contain, limited to values that the wire carries exactly.

use std::borrow::Cow;

use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::sample::select;
use r6_proto::axis::{AxisIndex, AxisMask};
use r6_proto::dialect::DsIdForm;
use r6_proto::io_point::PairMask;
use r6_proto::message::instruction::{
    Action, BlendLevel, BoardOutput, Coordinates, CurveMove, Instruction, Manner, Move, Output, OutputBoard,
    OutputKind, PathSpeed, StopOnSignal, Wait, WaitCondition, WaitSource, Workbench,
};
use r6_proto::message::{PhotoAnswer, Point, TypeKey};
use r6_proto::{ADDRESSES, Address, Command, RegisterIndex};

/// One request that owns the data that a [`r6_proto::Request`] borrows.
#[derive(Clone, Debug)]
pub enum Owned {
    Query(Vec<Address>),
    Command(Command<'static>),
    AddRcc { empty_list: bool, instructions: Vec<Instruction> },
    AddPoints(Vec<(i64, Vec<Point>)>),
    Heartbreak,
    PhotoAnswer(PhotoAnswer),
}

/// Owns the data that an [`r6_proto::dialect::Addressing`] borrows.
#[derive(Clone, Debug)]
pub struct OwnedAddressing {
    pub ds_id: DsIdForm,
    pub type_key: TypeKey,
    pub pack_id: Option<String>,
}

pub fn request() -> impl Strategy<Value = Owned> {
    prop_oneof![
        vec(address(), 0..30).prop_map(Owned::Query),
        command().prop_map(Owned::Command),
        (any::<bool>(), vec(instruction(), 0..12))
            .prop_map(|(empty_list, instructions)| Owned::AddRcc { empty_list, instructions }),
        vec((any::<i64>(), vec(point(), 0..6)), 0..4).prop_map(Owned::AddPoints),
        Just(Owned::Heartbreak),
        (any::<i64>(), any::<i64>())
            .prop_map(|(cam_id, ret)| Owned::PhotoAnswer(PhotoAnswer { cam_id, ret })),
    ]
}

pub fn addressing() -> impl Strategy<Value = OwnedAddressing> {
    let type_key = select(&[TypeKey::ReqType, TypeKey::CmdType, TypeKey::Absent]);
    (select(&[DsIdForm::Long, DsIdForm::Short]), type_key, option::of(any::<String>()))
        .prop_map(|(ds_id, type_key, pack_id)| OwnedAddressing { ds_id, type_key, pack_id })
}

pub fn address() -> impl Strategy<Value = Address> {
    select(&ADDRESSES).prop_flat_map(|row| {
        let (first, last) = row.indices.unwrap_or((0, 0));
        (first..=last).prop_map(move |index| {
            let name = row.name.strip_suffix('n').map_or(row.name.to_owned(), |stem| match row.indices {
                Some(_) => format!("{stem}{index}"),
                None => row.name.to_owned(),
            });
            Address::parse(&name).unwrap_or_else(|error| panic!("{error}"))
        })
    })
}

fn register() -> impl Strategy<Value = RegisterIndex> {
    (RegisterIndex::FIRST..=RegisterIndex::LAST).prop_filter_map("a register", RegisterIndex::new)
}

/// A multiple of 1 / `parts`, up to ±`limit`; exactly the number that its decimal text stands for.
fn decimal(parts: u32, limit: u32) -> impl Strategy<Value = f64> {
    let most = i64::from(parts) * i64::from(limit);
    #[expect(clippy::cast_precision_loss, reason = "at most 1e12: exact")]
    (-most..=most).prop_map(move |steps| steps as f64 / f64::from(parts))
}

fn positive(parts: u32, limit: u32) -> impl Strategy<Value = f64> {
    decimal(parts, limit).prop_map(f64::abs)
}

/// mm or degrees, in steps of 1e-6.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![decimal(1_000_000, 1_000_000), decimal(1000, 400), decimal(1, 360)]
}

fn seconds() -> impl Strategy<Value = f64> {
    prop_oneof![positive(1000, 86_400), positive(10, 10)]
}

pub fn command() -> impl Strategy<Value = Command<'static>> {
    let plain = select(vec![
        Command::ActionStop,
        Command::ActionPause,
        Command::ActionSingleCycle,
        Command::StartButton,
        Command::StopButton,
        Command::ClearAlarmRunNext,
        Command::ClearAlarmContinue,
        Command::ClearAlarm,
    ]);
    prop_oneof![
        plain,
        any::<String>().prop_map(|mold| Command::SwitchMold { mold: Cow::Owned(mold) }),
        (any::<u32>(), option::of(any::<u32>()), option::of(any::<u32>()))
            .prop_map(|(id, current, target)| Command::ModifyCounter { id, current, target }),
        (0..=7_u8, 0..=31_u8, any::<bool>()).prop_map(|(board, point, on)| Command::ModifyOutput {
            board,
            point,
            on
        }),
        (any::<u32>(), [decimal(1000, 1_000_000), decimal(10, 100), decimal(1, 10)], any::<[u32; 3]>())
            .prop_map(|(stack, spacing, count)| Command::ModifyStackData { stack, spacing, count }),
        (0..=1000_u16).prop_map(|steps| Command::ModifyGspd { percent: f64::from(steps) / 10.0 }),
        (register(), any::<i32>(), any::<bool>()).prop_map(|(register, value, savable)| {
            Command::RewriteData { register, value: i64::from(value), savable }
        }),
        rewrite_data_list(),
        (1..=60_000_u16, 1..=60_000_u16).prop_map(|(acceleration, deceleration)| Command::ModifyAccDec {
            acceleration: f64::from(acceleration) / 1000.0,
            deceleration: f64::from(deceleration) / 1000.0,
        }),
        any::<u32>().prop_map(|tool| Command::SwitchTool { tool }),
        (any::<u32>(), vec(decimal(1000, 1_000_000), 6)).prop_filter_map("six offsets", |(tool, offset)| {
            Some(Command::ModifyTool { tool, offset: offset.try_into().ok()? })
        }),
        any::<u32>().prop_map(|workbench| Command::SwitchCoordinate { workbench }),
        any::<[bool; 2]>()
            .prop_map(|[first_line, only_alarm]| Command::ClearAlarmWith { first_line, only_alarm }),
    ]
}

fn rewrite_data_list() -> impl Strategy<Value = Command<'static>> {
    register().prop_flat_map(|first| {
        let room = usize::from(RegisterIndex::LAST - first.number()) + 1;
        (any::<bool>(), vec(any::<i32>().prop_map(i64::from), 1..=room))
            .prop_map(move |(savable, values)| Command::RewriteDataList { first, savable, values })
    })
}

pub fn instruction() -> impl Strategy<Value = Instruction> {
    (any::<bool>(), action()).prop_map(|(oneshot, action)| Instruction { oneshot, action })
}

fn action() -> impl Strategy<Value = Action> {
    let motion = || {
        (coordinates(), manner())
            .prop_map(|(target, manner)| Move { target, manner: with_mask(manner, target.given()) })
    };
    prop_oneof![
        motion().prop_map(Action::AxisMove),
        motion().prop_map(Action::LinearMove),
        (coordinates(), coordinates(), manner()).prop_map(|(middle, end, manner)| {
            let manner = with_mask(manner, middle.given().and(end.given()));
            Action::CurveMove(CurveMove { middle, end, manner })
        }),
        (any::<bool>(), option::of((1..=PathSpeed::FASTEST).prop_map(f64::from)))
            .prop_map(|(in_use, speed)| Action::PathSpeed(PathSpeed { in_use, speed })),
        (any::<bool>(), 0..=31_u8, any::<bool>())
            .prop_map(|(in_use, input, on)| Action::StopOnSignal(StopOnSignal { in_use, input, on })),
        wait(),
        (output_kind(), 0..=32_u8, any::<bool>(), seconds())
            .prop_map(|(kind, point, on, delay)| Action::Output(Output { kind, point, on, delay })),
        (output_board(), any::<u32>(), any::<u32>()).prop_map(|(board, low, high)| {
            Action::BoardOutput(BoardOutput {
                board,
                low: PairMask::from_bits(low),
                high: PairMask::from_bits(high),
            })
        }),
        any::<u32>().prop_map(|id| Action::Workbench(Workbench { id })),
    ]
}

fn output_kind() -> impl Strategy<Value = OutputKind> {
    select(&[OutputKind::Y, OutputKind::M, OutputKind::Euy, OutputKind::TimedY])
}

fn output_board() -> impl Strategy<Value = OutputBoard> {
    select(&[OutputBoard::Y(0), OutputBoard::Y(1), OutputBoard::M(0), OutputBoard::M(1)])
}

fn wait() -> impl Strategy<Value = Action> {
    let point = || 0..=31_u8;
    let source = prop_oneof![
        (0..=4_u8, point()).prop_map(|(board, point)| WaitSource::Input { board, point }),
        (0..=2_u8, point()).prop_map(|(board, point)| WaitSource::M { board, point }),
        point().prop_map(|point| WaitSource::Eu { point }),
        Just(WaitSource::Time),
    ];
    let condition = select(&[
        WaitCondition::Off,
        WaitCondition::On,
        WaitCondition::RisingEdge,
        WaitCondition::FallingEdge,
    ]);
    (source, condition, positive(10, 86_400), any::<bool>()).prop_map(
        |(source, condition, limit, unlimited)| Action::Wait(Wait { source, condition, limit, unlimited }),
    )
}

fn coordinates() -> impl Strategy<Value = Coordinates> {
    vec(option::of(coordinate()), 8).prop_map(|values| {
        let mut coordinates = Coordinates::default();
        for (axis, value) in AxisIndex::ALL.into_iter().zip(values) {
            if let Some(value) = value {
                coordinates.set(axis, value);
            }
        }
        coordinates
    })
}

/// A mask contains only axes with a coordinate. It is written if one of the first six axes has none.
fn with_mask(manner: Manner, given: AxisMask) -> Manner {
    let left_out = given.and(AxisMask::SIX) != AxisMask::SIX;
    let mask = manner.mask.map(|mask| mask.and(given)).or(left_out.then_some(given));
    Manner { mask, ..manner }
}

fn manner() -> impl Strategy<Value = Manner> {
    let mask = any::<u8>().prop_map(AxisMask::from_bits);
    let smooth = (0..=9_u8).prop_filter_map("a blend level", BlendLevel::new);
    (
        option::of(mask),
        option::of((1..=1000_u32).prop_map(|tenths| f64::from(tenths) / 10.0)),
        option::of(positive(10, 86_400)),
        option::of(smooth),
        option::of(any::<u32>()),
        option::of(any::<u32>()),
    )
        .prop_map(|(mask, speed, delay, smooth, tool, coord)| Manner {
            speed,
            delay,
            smooth,
            tool,
            coord,
            ..Manner { mask, ..Manner::default() }
        })
}

pub fn point() -> impl Strategy<Value = Point> {
    let turn = || option::of(coordinate());
    let place = (coordinate(), coordinate(), option::of(coordinate()), turn());
    let rest = (turn(), turn(), option::of(decimal(1000, 1000)));
    (any::<i64>(), place, rest, option::of(any::<i64>()), any::<bool>()).prop_map(
        |(model_id, (x, y, z, angle), (u, v, similarity), color, relative)| Point {
            model_id,
            x,
            y,
            z,
            u,
            v,
            angle,
            similarity,
            color,
            relative,
        },
    )
}
