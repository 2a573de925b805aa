//! Tests that a written transcript can be read again, however it is cut, and that frames are found between
//! any other bytes.

use std::path::Path;
use std::time::Duration;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use r6_proto::time::Instant;
use r6_testkit::{transcript as files, vector};
use r6_traffic::conversation::Side;
use r6_traffic::recording::transcript::{self, Write};
use r6_traffic::recording::{Captured, Place, Recording};

const SIDES: [Side; 2] = [Side::Pc, Side::Controller];

/// The frames of the golden vectors that can be decoded.
fn frames() -> Vec<Vec<u8>> {
    vector::all().iter().filter_map(|vector| vector.decodable().map(<[u8]>::to_vec)).collect()
}

/// The bytes of one side: frames, parts of frames, and other bytes.
fn stream() -> impl Strategy<Value = Vec<u8>> {
    let whole = select(frames()).boxed();
    let part = (select(frames()), 0..100_usize).prop_map(|(frame, at)| frame[..at.min(frame.len())].to_vec());
    let other = prop_oneof![vec(any::<u8>(), 0..8), Just(b"\r\n".to_vec()), Just("模".as_bytes().to_vec())];
    vec(prop_oneof![4 => whole, 1 => part, 2 => other], 0..6).prop_map(|parts| parts.concat())
}

/// The streams of both sides, cut and mixed at random, with times.
fn writes() -> impl Strategy<Value = Vec<Write>> {
    let pieces = vec((any::<bool>(), 1..200_usize, 0..50_u64), 0..60);
    ([stream(), stream()], pieces).prop_map(|(streams, pieces)| {
        let mut rest = streams.each_ref().map(|stream| &stream[..]);
        let (mut writes, mut ms) = (Vec::new(), 0);
        let mut write = |side: usize, count: usize, later: u64| {
            let (now, left) = rest[side].split_at(count.min(rest[side].len()));
            rest[side] = left;
            ms += later;
            let time = Some(Instant::ORIGIN + Duration::from_millis(ms));
            writes.push(Write { line: writes.len() + 1, from: SIDES[side], time, bytes: now.to_vec() });
        };
        for (side, count, later) in pieces {
            write(usize::from(side), count, later);
        }
        write(0, usize::MAX, 0);
        write(1, usize::MAX, 0);
        writes
    })
}

fn written(writes: &[Write]) -> String {
    writes.iter().map(|write| transcript::line(write.from, write.time.unwrap(), &write.bytes)).collect()
}

fn read(text: &str) -> Vec<Captured> {
    Recording::read(text.as_bytes()).unwrap().frames
}

/// All bytes that one side wrote.
fn bytes_of(side: Side, writes: &[Write]) -> Vec<u8> {
    let own = writes.iter().filter(|write| write.from == side);
    own.flat_map(|write| write.bytes.clone()).collect()
}

proptest! {
    #[test]
    fn what_was_written_is_read_again(writes in writes()) {
        prop_assert_eq!(transcript::writes(written(&writes).as_bytes()), Some(writes));
    }

    #[test]
    fn any_split_of_the_writes_of_a_side_gives_the_same_frames(writes in writes()) {
        let cut = read(&written(&writes));
        for side in SIDES {
            let stream = bytes_of(side, &writes);
            let whole = read(&transcript::line(side, Instant::ORIGIN, &stream));
            let cut = cut.iter().filter(|captured| captured.from == Some(side));
            let told = |captured: &Captured| (captured.place.offset, captured.frame.clone());
            prop_assert_eq!(
                cut.map(told).collect::<Vec<_>>(),
                whole.iter().map(told).collect::<Vec<_>>()
            );
        }
    }

    #[test]
    fn a_frame_has_the_bytes_the_place_and_the_time_of_its_writes(writes in writes()) {
        for Captured { place, from, time, frame } in read(&written(&writes)) {
            let Ok(frame) = frame else { continue };
            let side = from.unwrap();
            let begin = usize::try_from(place.offset).unwrap();
            let end = begin + frame.len();
            let stream = bytes_of(side, &writes);
            prop_assert_eq!(Some(&frame[..]), stream.get(begin..end));
            let last = (1..=writes.len())
                .find(|count| bytes_of(side, &writes[..*count]).len() >= end)
                .unwrap();
            prop_assert_eq!((place.line, time), (last, writes[last - 1].time));
        }
    }

    #[test]
    fn frames_are_found_in_a_log(lines in vec((r"[ -z]{0,30}", select(frames())), 0..8)) {
        let mut log = Vec::new();
        let mut put = Vec::new();
        for (text, frame) in lines {
            log.extend_from_slice(text.as_bytes());
            let line = 1 + log.iter().filter(|byte| **byte == b'\n').count();
            put.push((Place { offset: log.len() as u64, line }, frame.clone()));
            log.extend_from_slice(&frame);
            log.push(b'\n');
        }
        let recording = Recording::read(&log).unwrap();
        let found: Vec<_> = recording
            .frames
            .into_iter()
            .map(|captured| (captured.place, captured.frame.unwrap()))
            .collect();
        prop_assert_eq!(found, put);
    }
}

#[test]
#[expect(clippy::disallowed_methods, reason = "a test reads the files of the vectors")]
fn the_transcripts_of_the_vectors_are_read_and_written() {
    let files = files::all();
    assert!(!files.is_empty());
    for file in files {
        let side = |from| match from {
            files::Side::Pc => Side::Pc,
            files::Side::Controller => Side::Controller,
        };
        let lines = file.writes.iter().map(|write| {
            let time = Instant::ORIGIN + Duration::from_millis(write.ms);
            transcript::line(side(write.from), time, &write.bytes)
        });
        let text = transcript::about(&file.about) + &lines.collect::<String>();
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join(format!("../../vectors/transcripts/{}.jsonl", file.stem));
        assert_eq!(text, std::fs::read_to_string(path).unwrap(), "{}", file.stem);
        assert!(read(&text).iter().all(|captured| captured.frame.is_ok()), "{}", file.stem);
    }
}
