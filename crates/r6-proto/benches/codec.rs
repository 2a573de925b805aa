//! Decoding to typed values and encoding from them, beside serde_json and sonic-rs with typed structs in the same run.
//!
//! Ratios to the other two are what counts; times differ from machine to machine. Every case goes through 1 024
//! different frames, and all three have to agree on each of them before the first is timed. What differs is in favour
//! of the others: their structs take one form of each frame (no other spelling, nothing repeated, unquoted or in GBK, no
//! error that names a field), and for encoding they get the names of the addresses ready made.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use r6_proto::axis::AxisMask;
use r6_proto::dialect::{Dialect, Envelope};
use r6_proto::message::instruction::{Action, BlendLevel, Coordinates, Instruction, Manner, Move};
use r6_proto::message::{Body, Message, Point};
use r6_proto::reply::ReplyWriter;
use r6_proto::request::CameraPoints;
use r6_proto::{Address, AxisIndex, Decoder, Request, RequestType};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Different frames in each case: enough that a branch predictor cannot learn them by heart.
const FRAMES: usize = 1024;

const MONITOR: &str = "www.hc-system.com.RemoteMonitor";
const REMOTE_COMMAND: &str = "www.hc-system.com.HCRemoteCommand";
const CAMERA: &str = "www.hc-system.com.cam";

/// A multiplicative generator: the same frames in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from((self.0 >> 33) % u64::from(limit)).unwrap_or(0)
    }

    /// A multiple of 1 / `parts` whose last decimal is no zero, within ±`limit`.
    fn decimal(&mut self, parts: u32, limit: u32) -> f64 {
        let steps = self.below(limit * parts / 10) * 10 + 1 + self.below(9);
        let sign = if self.below(2) == 0 { 1.0 } else { -1.0 };
        sign * f64::from(steps) / f64::from(parts)
    }
}

// What the others fill and write.

/// A decimal number in quotes.
struct Quoted<const DECIMALS: usize>(f64);

impl<'de, const DECIMALS: usize> Deserialize<'de> for Quoted<DECIMALS> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <&str>::deserialize(deserializer)?;
        text.parse().map(Self).map_err(serde::de::Error::custom)
    }
}

impl<const DECIMALS: usize> Serialize for Quoted<DECIMALS> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{:.DECIMALS$}", self.0))
    }
}

/// A mask as `0x3F`.
struct Mask(u8);

impl<'de> Deserialize<'de> for Mask {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <&str>::deserialize(deserializer)?;
        let digits = text.strip_prefix("0x").ok_or_else(|| serde::de::Error::custom("no mask"))?;
        u8::from_str_radix(digits, 16).map(Self).map_err(serde::de::Error::custom)
    }
}

impl Serialize for Mask {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("0x{:02X}", self.0))
    }
}

#[derive(Deserialize, Serialize)]
struct QueryFrame<'a> {
    #[serde(rename = "dsID")]
    ds_id: &'a str,
    #[serde(rename = "reqType")]
    req_type: &'a str,
    #[serde(rename = "packID")]
    pack_id: &'a str,
    #[serde(rename = "queryAddr", borrow)]
    query_addr: Vec<&'a str>,
}

#[derive(Deserialize, Serialize)]
struct ReplyFrame<'a> {
    #[serde(rename = "dsID")]
    ds_id: &'a str,
    #[serde(rename = "packID")]
    pack_id: &'a str,
    #[serde(rename = "queryData")]
    query_data: Vec<Quoted<6>>,
    #[serde(rename = "reqType")]
    req_type: &'a str,
}

#[derive(Deserialize, Serialize)]
struct AddRccFrame<'a> {
    #[serde(rename = "dsID")]
    ds_id: &'a str,
    #[serde(rename = "reqType")]
    req_type: &'a str,
    #[serde(rename = "packID")]
    pack_id: &'a str,
    #[serde(rename = "emptyList")]
    empty_list: Quoted<0>,
    instructions: Vec<Step>,
}

#[derive(Deserialize, Serialize)]
struct Step {
    oneshot: Quoted<0>,
    action: Quoted<0>,
    m0: Quoted<3>,
    m1: Quoted<3>,
    m2: Quoted<3>,
    m3: Quoted<3>,
    m4: Quoted<3>,
    m5: Quoted<3>,
    #[serde(rename = "ckStatus")]
    ck_status: Mask,
    speed: Quoted<1>,
    delay: Quoted<1>,
    smooth: Quoted<0>,
}

#[derive(Deserialize, Serialize)]
struct AddPointsFrame<'a> {
    #[serde(rename = "dsID")]
    ds_id: &'a str,
    #[serde(rename = "reqType")]
    req_type: &'a str,
    #[serde(rename = "packID")]
    pack_id: &'a str,
    #[serde(rename = "dsData")]
    ds_data: Vec<Camera>,
}

#[derive(Deserialize, Serialize)]
struct Camera {
    #[serde(rename = "camID")]
    cam_id: i64,
    data: Vec<Part>,
}

#[derive(Deserialize, Serialize)]
#[serde(rename_all = "PascalCase")]
struct Part {
    #[serde(rename = "ModelID")]
    model_id: i64,
    x: f64,
    y: f64,
    z: f64,
    u: f64,
    v: f64,
    angel: f64,
    similarity: f64,
    color: i64,
    rel: u8,
}

// The same values for all three.

struct Samples {
    pack_ids: Vec<String>,
    queries: Vec<Vec<Address>>,
    replies: Vec<Vec<f64>>,
    lists: Vec<Vec<Instruction>>,
    points: Vec<Vec<Point>>,
}

impl Samples {
    /// `FRAMES` of each, the lists with so many instructions.
    fn new(instructions: usize) -> Self {
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
    let target: Vec<f64> = (0..6).map(|_| random.decimal(1000, 1000)).collect();
    let manner = Manner {
        mask: Some(AxisMask::from_bits(u8::try_from(random.below(256)).unwrap_or(0))),
        speed: Some(f64::from(random.below(1000)) / 10.0),
        delay: Some(f64::from(random.below(100)) / 10.0),
        smooth: BlendLevel::new(u8::try_from(random.below(10)).unwrap_or(0)),
        tool: None,
        coord: None,
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
        z: random.decimal(1000, 2000),
        u: Some(random.decimal(1000, 180)),
        v: Some(random.decimal(1000, 180)),
        angle: random.decimal(1000, 180),
        similarity: Some(f64::from(random.below(100)) + 0.5),
        color: Some(i64::from(random.below(8))),
        relative: random.below(2) == 1,
    }
}

fn step(instruction: &Instruction) -> Step {
    let Action::AxisMove(motion) = &instruction.action else { panic!("{instruction:?}") };
    let m = |axis: usize| Quoted(motion.target.at(AxisIndex::ALL[axis]).unwrap_or(0.0));
    let manner = &motion.manner;
    Step {
        oneshot: Quoted(1.0),
        action: Quoted(4.0),
        m0: m(0),
        m1: m(1),
        m2: m(2),
        m3: m(3),
        m4: m(4),
        m5: m(5),
        ck_status: Mask(manner.mask.map_or(0, AxisMask::bits)),
        speed: Quoted(manner.speed.unwrap_or(0.0)),
        delay: Quoted(manner.delay.unwrap_or(0.0)),
        smooth: Quoted(manner.smooth.map_or(0.0, |level| f64::from(level.level()))),
    }
}

fn part(point: &Point) -> Part {
    Part {
        model_id: point.model_id,
        x: point.x,
        y: point.y,
        z: point.z,
        u: point.u.unwrap_or(0.0),
        v: point.v.unwrap_or(0.0),
        angel: point.angle,
        similarity: point.similarity.unwrap_or(0.0),
        color: point.color.unwrap_or(0),
        rel: u8::from(point.relative),
    }
}

// What was read, as one number: enough to see that all three read the same.

fn sum_of_addresses(addresses: impl Iterator<Item = Option<Address>>) -> f64 {
    addresses.flatten().map(|address| f64::from(address.index().unwrap_or(1000) + 1)).sum()
}

fn decoded(decoder: &mut Decoder, frame: &[u8]) -> f64 {
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
    let turned = point.u.unwrap_or(0.0) + point.v.unwrap_or(0.0) + point.angle;
    let rest = point.similarity.unwrap_or(0.0) + point.color.unwrap_or(0) as f64;
    point.model_id as f64 + point.x + point.y + point.z + turned + rest + f64::from(u8::from(point.relative))
}

/// What both of the others do with a parsed frame.
trait Summed<'a>: Deserialize<'a> {
    fn sum(&self) -> f64;
}

impl<'a> Summed<'a> for QueryFrame<'a> {
    fn sum(&self) -> f64 {
        sum_of_addresses(self.query_addr.iter().map(|name| Address::exact(name.as_bytes())))
    }
}

impl<'a> Summed<'a> for ReplyFrame<'a> {
    fn sum(&self) -> f64 {
        self.query_data.iter().map(|value| value.0).sum()
    }
}

impl<'a> Summed<'a> for AddRccFrame<'a> {
    fn sum(&self) -> f64 {
        let one = |step: &Step| {
            let target: f64 =
                [&step.m0, &step.m1, &step.m2, &step.m3, &step.m4, &step.m5].map(|m| m.0).iter().sum();
            target + f64::from(step.ck_status.0) + step.speed.0 + step.delay.0 + step.smooth.0
        };
        self.instructions.iter().map(one).sum()
    }
}

impl<'a> Summed<'a> for AddPointsFrame<'a> {
    fn sum(&self) -> f64 {
        let one = |part: &Part| {
            let turned = part.u + part.v + part.angel;
            let rest = part.similarity + part.color as f64;
            part.model_id as f64 + part.x + part.y + part.z + turned + rest + f64::from(part.rel)
        };
        let camera = |camera: &Camera| {
            let cam_id = camera.cam_id as f64;
            camera.data.iter().map(|part| cam_id + one(part)).sum::<f64>()
        };
        self.ds_data.iter().map(camera).sum()
    }
}

fn by_serde_json<'a, T: Summed<'a>>(frame: &'a [u8]) -> f64 {
    serde_json::from_slice::<T>(frame).expect("a frame of ours").sum()
}

fn by_sonic_rs<'a, T: Summed<'a>>(frame: &'a [u8]) -> f64 {
    sonic_rs::from_slice::<T>(frame).expect("a frame of ours").sum()
}

type Read = fn(&[u8]) -> f64;

fn compare_decoding(
    criterion: &mut Criterion,
    name: &str,
    frames: &[Vec<u8>],
    serde_json: Read,
    sonic_rs: Read,
) {
    let mut decoder = Decoder::new();
    for frame in frames {
        let ours = decoded(&mut decoder, frame);
        for theirs in [serde_json(frame), sonic_rs(frame)] {
            // serde_json reads long decimals one unit off, in the last place.
            assert!((ours - theirs).abs() <= 1e-9 * ours.abs().max(1.0), "{name}: {ours} {theirs}");
        }
    }
    let mut group = criterion.benchmark_group(format!("decode {name}"));
    group.throughput(Throughput::Elements(1));
    let mut turn = 0;
    let mut next = || {
        turn = (turn + 1) % frames.len();
        frames[turn].as_slice()
    };
    group.bench_function("r6", |bencher| bencher.iter(|| decoded(&mut decoder, black_box(next()))));
    group.bench_function("serde_json", |bencher| bencher.iter(|| serde_json(black_box(next()))));
    group.bench_function("sonic-rs", |bencher| bencher.iter(|| sonic_rs(black_box(next()))));
    group.finish();
}

/// Writes frame number so-and-so into the buffer.
type Write<'a> = Box<dyn Fn(usize, &mut Vec<u8>) + 'a>;

fn compare_encoding(criterion: &mut Criterion, name: &str, ours: Write<'_>, frames: &[impl Serialize]) {
    let serde_json: Write<'_> =
        Box::new(|at, out| serde_json::to_writer(out, &frames[at]).expect("it can be written"));
    let sonic_rs: Write<'_> =
        Box::new(|at, out| sonic_rs::to_writer(out, &frames[at]).expect("it can be written"));
    let contenders = [("r6", ours), ("serde_json", serde_json), ("sonic-rs", sonic_rs)];
    let written = |write: &Write<'_>, at: usize| {
        let mut out = Vec::new();
        write(at, &mut out);
        String::from_utf8(out).expect("UTF-8")
    };
    for at in 0..frames.len() {
        let all = contenders.each_ref().map(|(_, write)| written(write, at));
        assert_eq!((&all[0], &all[0]), (&all[1], &all[2]), "{name}");
    }
    let mut group = criterion.benchmark_group(format!("encode {name}"));
    group.throughput(Throughput::Elements(1));
    let mut out = Vec::with_capacity(1 << 16);
    for (contender, write) in &contenders {
        let mut turn = 0;
        group.bench_function(*contender, |bencher| {
            bencher.iter(|| {
                turn = (turn + 1) % FRAMES;
                out.clear();
                write(turn, &mut out);
                black_box(out.len())
            });
        });
    }
    group.finish();
}

fn encode(request: &Request<'_>, pack_id: &str, out: &mut Vec<u8>) {
    let envelope = Envelope { pack_id: Some(pack_id), ..Envelope::default() };
    request.encode(&envelope, out).expect("it can be written");
}

fn all_frames(write: &Write<'_>) -> Vec<Vec<u8>> {
    let one = |at| {
        let mut out = Vec::new();
        write(at, &mut out);
        out
    };
    (0..FRAMES).map(one).collect()
}

fn query(criterion: &mut Criterion) {
    let samples = Samples::new(0);
    let names: Vec<Vec<String>> =
        samples.queries.iter().map(|query| query.iter().map(Address::to_string).collect()).collect();
    let theirs: Vec<QueryFrame<'_>> = names
        .iter()
        .zip(&samples.pack_ids)
        .map(|(names, pack_id)| QueryFrame {
            ds_id: MONITOR,
            req_type: "query",
            pack_id,
            query_addr: names.iter().map(String::as_str).collect(),
        })
        .collect();
    let ours: Write<'_> =
        Box::new(|at, out| encode(&Request::Query(&samples.queries[at]), &samples.pack_ids[at], out));
    compare_decoding(
        criterion,
        "query of 12",
        &all_frames(&ours),
        |frame| by_serde_json::<QueryFrame<'_>>(frame),
        |frame| by_sonic_rs::<QueryFrame<'_>>(frame),
    );
    compare_encoding(criterion, "query of 12", ours, &theirs);
}

fn reply(criterion: &mut Criterion) {
    let samples = Samples::new(0);
    let requests: Vec<Vec<u8>> = (0..FRAMES)
        .map(|at| {
            let mut out = Vec::new();
            encode(&Request::Query(&samples.queries[at]), &samples.pack_ids[at], &mut out);
            out
        })
        .collect();
    let mut decoders: Vec<Decoder> = (0..FRAMES).map(|_| Decoder::new()).collect();
    let requests: Vec<Message<'_>> = decoders
        .iter_mut()
        .zip(&requests)
        .map(|(decoder, request)| decoder.decode(request).expect("a frame of ours"))
        .collect();
    let theirs: Vec<ReplyFrame<'_>> = samples
        .replies
        .iter()
        .zip(&samples.pack_ids)
        .map(|(values, pack_id)| ReplyFrame {
            ds_id: MONITOR,
            pack_id,
            query_data: values.iter().copied().map(Quoted).collect(),
            req_type: "query",
        })
        .collect();
    let dialect = Dialect { echo_query_addr: false, ..Dialect::HC1 };
    let ours: Write<'_> = Box::new(|at, out| {
        let Body::Query(query) = requests[at].body else { panic!("no query") };
        let writer = ReplyWriter::new(dialect, requests[at].header, RequestType::Query);
        writer.query(query.addresses, out, |data| {
            samples.replies[at].iter().for_each(|value| data.decimal(*value))
        });
    });
    compare_decoding(
        criterion,
        "reply of 12",
        &all_frames(&ours),
        |frame| by_serde_json::<ReplyFrame<'_>>(frame),
        |frame| by_sonic_rs::<ReplyFrame<'_>>(frame),
    );
    compare_encoding(criterion, "reply of 12", ours, &theirs);
}

fn add_rcc(criterion: &mut Criterion) {
    for count in [1, 50] {
        let samples = Samples::new(count);
        let theirs: Vec<AddRccFrame<'_>> = samples
            .lists
            .iter()
            .zip(&samples.pack_ids)
            .map(|(list, pack_id)| AddRccFrame {
                ds_id: REMOTE_COMMAND,
                req_type: "AddRCC",
                pack_id,
                empty_list: Quoted(1.0),
                instructions: list.iter().map(step).collect(),
            })
            .collect();
        let ours: Write<'_> = Box::new(|at, out| {
            let request = Request::AddRcc { empty_list: true, instructions: &samples.lists[at] };
            encode(&request, &samples.pack_ids[at], out);
        });
        let name = format!("AddRCC of {count}");
        compare_decoding(
            criterion,
            &name,
            &all_frames(&ours),
            |frame| by_serde_json::<AddRccFrame<'_>>(frame),
            |frame| by_sonic_rs::<AddRccFrame<'_>>(frame),
        );
        compare_encoding(criterion, &name, ours, &theirs);
    }
}

fn add_points(criterion: &mut Criterion) {
    let samples = Samples::new(0);
    let theirs: Vec<AddPointsFrame<'_>> = samples
        .points
        .iter()
        .zip(&samples.pack_ids)
        .map(|(points, pack_id)| AddPointsFrame {
            ds_id: CAMERA,
            req_type: "AddPoints",
            pack_id,
            ds_data: vec![Camera { cam_id: 3, data: points.iter().map(part).collect() }],
        })
        .collect();
    let ours: Write<'_> = Box::new(|at, out| {
        let cameras = [CameraPoints { cam_id: 3, points: &samples.points[at] }];
        encode(&Request::AddPoints(&cameras), &samples.pack_ids[at], out);
    });
    compare_decoding(
        criterion,
        "AddPoints of 8",
        &all_frames(&ours),
        |frame| by_serde_json::<AddPointsFrame<'_>>(frame),
        |frame| by_sonic_rs::<AddPointsFrame<'_>>(frame),
    );
    compare_encoding(criterion, "AddPoints of 8", ours, &theirs);
}

criterion_group!(benches, query, reply, add_rcc, add_points);
criterion_main!(benches);
