//! Compares decoding and encoding with serde_json and sonic-rs, and finding frames with a loop over the
//! bytes.

use std::hint::black_box;
use std::time::Instant;

use r6_proto::frame::{FrameBuffer, Limits};

use crate::measure::{Contender, Ratio, SLICE, compare};
use crate::report::{Figure, Goal, Row};

#[path = "../../../r6-proto/benches/codec/cases.rs"]
mod cases;
#[path = "../../../r6-proto/benches/codec/others.rs"]
mod others;
#[path = "../../../r6-proto/benches/codec/samples.rs"]
mod samples;
#[path = "../../../r6-proto/benches/frames/stream.rs"]
mod stream;

use samples::FRAMES;

/// What is known of a codec that is slower than the others.
const UNCHANGED: &str = "not looked into: the code is what it was on 2026-11-24, when no row of the codec missed its goal \
                         (encoding a query: 1.31 × as fast); the program of the bench has grown since";

/// The positions of the others in a case.
const SERDE_JSON: usize = 1;
const SONIC_RS: usize = 2;

/// A contender that takes the frames in turn. Its figure is the mean time of one frame, in nanoseconds.
fn taking_turns<'c>(mut take: impl FnMut(usize) + 'c) -> Contender<'c> {
    let frames = f64::from(u32::try_from(FRAMES).unwrap_or(u32::MAX));
    let mut slice = timed(move || (0..FRAMES).for_each(&mut take));
    Box::new(move || slice().into_iter().map(|figure| figure / frames).collect())
}

/// The time of each other contender as a multiple of ours.
fn against_ours(contenders: Vec<Contender<'_>>) -> Vec<Ratio> {
    let mut contenders = contenders;
    compare(&mut contenders).into_iter().flatten().collect()
}

/// Every kind of frame, decoded and encoded.
pub fn rows() -> Vec<Row> {
    let mut rows = Vec::new();
    // The goal is the speed of the fastest general JSON library. A user would not notice more.
    let beside = |what: String, ratios: &[Ratio]| {
        [
            (SONIC_RS, "sonic-rs, typed structs", Goal::AtLeastFast(1.0)),
            (SERDE_JSON, "serde_json, typed structs", Goal::ToldFast),
        ]
        .map(|(other, against, goal)| Row {
            what: what.clone(),
            against,
            goal: Some(goal),
            figure: Figure::Ratio(ratios[other - 1].inverse()),
            in_the_way: UNCHANGED,
        })
    };
    for case in cases::all() {
        let name = &case.name;
        eprintln!("  {name}");
        let decode = case.decode.into_iter().map(|mut read| {
            taking_turns(move |at| {
                black_box(read(at));
            })
        });
        rows.extend(beside(format!("decode {name}"), &against_ours(decode.collect())));
        let encode = case.encode.into_iter().map(|mut write| {
            let mut out = Vec::with_capacity(1 << 16);
            taking_turns(move |at| {
                out.clear();
                write(at, &mut out);
                black_box(&out);
            })
        });
        rows.extend(beside(format!("encode {name}"), &against_ours(encode.collect())));
    }
    rows
}

/// Finds the frames of a mixed stream, in pieces of several sizes.
pub fn frames() -> Vec<Row> {
    let stream = stream::stream();
    let expected = (stream::FRAMES, stream.len());
    let in_pieces = |piece: usize| {
        let stream = &stream;
        let mut buffer = FrameBuffer::new(Limits::default());
        timed(move || assert_eq!(stream::in_pieces(&mut buffer, black_box(stream), piece), expected))
    };
    let mut contenders = vec![
        in_pieces(stream.len()),
        timed(|| assert_eq!(stream::byte_loop(black_box(&stream)), expected)),
        in_pieces(4096),
        in_pieces(100),
        in_pieces(1),
    ];
    let ratios: Vec<Ratio> = compare(&mut contenders).into_iter().flatten().collect();
    let row = |what: &str, against: &'static str, goal, ratio: &Ratio| Row {
        what: format!("frames of a mixed stream, {what}"),
        against,
        goal,
        figure: Figure::Ratio(ratio.clone()),
        in_the_way: "",
    };
    let whole = "the same, whole";
    vec![
        row("resumable", "byte loop", Some(Goal::ToldFast), &ratios[0].inverse()),
        row("in pieces of 4096", whole, None, &ratios[1]),
        row("in pieces of 100", whole, Some(Goal::AtMost(2.0)), &ratios[2]),
        row("in pieces of 1", whole, None, &ratios[3]),
        piecemeal(),
    ]
}

/// Whether the work for a frame that arrives byte by byte depends only on its length: the same bytes as one
/// frame and as four.
fn piecemeal() -> Row {
    let frame = |items: usize| format!("{{\"a\":[{}1]}}", "1,".repeat(items)).into_bytes();
    let (long, short) = (frame(30_000), frame(7_497));
    let four = short.repeat(4);
    assert!(long.len().abs_diff(four.len()) < 16, "{} and {}", long.len(), four.len());
    let whole = |bytes: Vec<u8>, frames: u32| {
        let mut buffer = FrameBuffer::new(Limits::default());
        timed(move || {
            assert_eq!(stream::in_pieces(&mut buffer, black_box(&bytes), 1), (frames, bytes.len()));
        })
    };
    let ratio = compare(&mut [whole(four, 4), whole(long, 1)]).remove(0).remove(0);
    Row {
        what: "a frame of 60 kB, in pieces of 1".to_owned(),
        against: "four of 15 kB, in pieces of 1",
        goal: Some(Goal::AtMost(1.1)),
        figure: Figure::Ratio(ratio),
        in_the_way: "something is done again for each piece that depends on what came before it",
    }
}

/// A contender that repeats one call. Its figure is the mean time in nanoseconds.
fn timed<'c>(mut once: impl FnMut() + 'c) -> Contender<'c> {
    let mut slice = move || {
        let begun = Instant::now();
        let mut times = 0_u32;
        while begun.elapsed() < SLICE {
            once();
            times += 1;
        }
        vec![begun.elapsed().as_secs_f64() * 1e9 / f64::from(times)]
    };
    slice();
    Box::new(slice)
}
