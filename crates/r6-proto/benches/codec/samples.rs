//! The values that all contenders read and write, 1 024 of each kind, and the sums of what they read.

use r6_proto::axis::AxisMask;
use r6_proto::message::Body;
use r6_proto::message::Point;
use r6_proto::message::instruction::{Action, BlendLevel, Coordinates, Instruction, Manner, Move};
use r6_proto::{Address, AxisIndex, Decoder};

/// The number of different frames in each case: enough that a branch predictor cannot learn them.
pub const FRAMES: usize = 1024;

/// A multiplicative generator: the same frames in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from((self.0 >> 33) % u64::from(limit)).unwrap_or(0)
    }

    /// A multiple of 1 / `parts` within ±`limit` whose last decimal is not zero.
    fn decimal(&mut self, parts: u32, limit: u32) -> f64 {
        let steps = self.below(limit * parts / 10) * 10 + 1 + self.below(9);
        let sign = if self.below(2) == 0 { 1.0 } else { -1.0 };
        sign * f64::from(steps) / f64::from(parts)
    }
}

// All three contenders use the same values.

pub struct Samples {
    pub pack_ids: Vec<String>,
    pub queries: Vec<Vec<Address>>,
    pub replies: Vec<Vec<f64>>,
    pub lists: Vec<Vec<Instruction>>,
    pub points: Vec<Vec<Point>>,
}

impl Samples {
    /// `FRAMES` samples of each kind. Each list has this many instructions.
    pub fn new(instructions: usize) -> Self {
        let mut random = Random(u64::try_from(instructions).unwrap_or(0) + 1);
        let per_frame = |random: &mut Random, count: usize| {
            (0..count).map(|_| random.below(u32::MAX)).collect::<Vec<_>>()
        };
        let seeds = per_frame(&mut random, FRAMES);
        let each = |make: &dyn Fn(&mut Random) -> f64, count: usize, random: &mut Random| -> Vec<f64> {
            (0..count).map(|_| make(random)).collect()
        };
        Self {
            pack_ids: seeds.iter().map(u32::to_string).collect(),
            queries: (0..FRAMES).map(|_| (0..12).map(|_| address(&mut random)).collect()).collect(),
            replies: (0..FRAMES)
                .map(|_| each(&|random| random.decimal(1_000_000, 400), 12, &mut random))
                .collect(),
            lists: (0..FRAMES)
                .map(|_| (0..instructions).map(|_| instruction(&mut random)).collect())
                .collect(),
            points: (0..FRAMES).map(|_| (0..8).map(|_| point(&mut random)).collect()).collect(),
        }
    }
}

fn address(random: &mut Random) -> Address {
    let axis = AxisIndex::ALL[random.below(8) as usize];
    match random.below(10) {
        0 | 1 => Address::Axis(axis),
        2 | 3 => Address::World(axis),
        4 => Address::CurMode,
        5 => Address::CurAlarm,
        6 => Address::IsMoving,
        7 => Address::RemoteCmdLen,
        8 => Address::Counter(random.below(1000)),
        _ => Address::CurTorque(axis),
    }
}

fn instruction(random: &mut Random) -> Instruction {
    // A mask contains only axes with a coordinate.
    let target: Vec<f64> = (0..6).map(|_| random.decimal(1000, 1000)).collect();
    let manner = Manner {
        mask: Some(AxisMask::from_bits(u8::try_from(random.below(64)).unwrap_or(0))),
        speed: Some(f64::from(random.below(1000) + 1) / 10.0),
        delay: Some(f64::from(random.below(100)) / 10.0),
        smooth: BlendLevel::new(u8::try_from(random.below(10)).unwrap_or(0)),
        ..Manner::default()
    };
    Instruction {
        oneshot: true,
        action: Action::AxisMove(Move { target: Coordinates::from_slice(&target), manner }),
    }
}

fn point(random: &mut Random) -> Point {
    Point {
        model_id: i64::from(random.below(20)),
        x: random.decimal(1000, 2000),
        y: random.decimal(1000, 2000),
        z: Some(random.decimal(1000, 2000)),
        u: Some(random.decimal(1000, 180)),
        v: Some(random.decimal(1000, 180)),
        angle: Some(random.decimal(1000, 180)),
        similarity: Some(f64::from(random.below(100)) + 0.5),
        color: Some(i64::from(random.below(8))),
        relative: random.below(2) == 1,
    }
}

// The sum of the values that were read, to check that all three read the same.

pub fn sum_of_addresses(addresses: impl Iterator<Item = Option<Address>>) -> f64 {
    addresses.flatten().map(|address| f64::from(address.index().unwrap_or(1000) + 1)).sum()
}

pub fn decoded(decoder: &mut Decoder, frame: &[u8]) -> f64 {
    let message = decoder.decode(frame).expect("a frame of ours");
    match message.body {
        Body::Query(query) => sum_of_addresses(query.resolved().map(|(_, address)| address.ok())),
        Body::QueryReply(reply) => reply.values.iter().filter_map(|value| value.number()).sum(),
        Body::AddRcc(list) => list.instructions.iter().map(sum_of_instruction).sum(),
        Body::AddPoints(points) => points
            .sets()
            .flat_map(|(cam_id, points)| points.iter().map(move |point| cam_id as f64 + sum_of_point(point)))
            .sum(),
        other => panic!("{other:?}"),
    }
}

fn sum_of_instruction(instruction: &Instruction) -> f64 {
    let Action::AxisMove(motion) = &instruction.action else { panic!("{instruction:?}") };
    let target: f64 = AxisIndex::ALL.into_iter().filter_map(|axis| motion.target.at(axis)).sum();
    let manner = &motion.manner;
    let mask = manner.mask.map_or(0.0, |mask| f64::from(mask.bits()));
    let smooth = manner.smooth.map_or(0.0, |level| f64::from(level.level()));
    target + mask + manner.speed.unwrap_or(0.0) + manner.delay.unwrap_or(0.0) + smooth
}

fn sum_of_point(point: &Point) -> f64 {
    let turned = [point.u, point.v, point.angle].into_iter().flatten().sum::<f64>();
    let rest = point.similarity.unwrap_or(0.0) + point.color.unwrap_or(0) as f64;
    point.model_id as f64
        + point.x
        + point.y
        + point.z.unwrap_or(0.0)
        + turned
        + rest
        + f64::from(u8::from(point.relative))
}
