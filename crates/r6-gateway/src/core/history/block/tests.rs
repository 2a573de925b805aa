use std::time::Duration;

use r6_api::gateway::Gap;

use super::super::sample::State;
use super::*;

const SECOND: i64 = 1_000_000;
const DAY: i64 = 86_400 * SECOND;

fn now(seconds: u64) -> Instant {
    Instant::ORIGIN + Duration::from_secs(seconds)
}

fn whole(time: i64, number: i64) -> Sample {
    Sample { time: Micros(time), state: State::Integer(number) }
}

fn push(blocks: &mut OpenBlocks, address: Address, sample: Sample) {
    blocks.push(now(0), address, Interval::USUAL, sample);
}

/// What is in the file of each day after these writes: the counts of chunks, and the samples of tails.
fn tail_samples(write: &Write) -> usize {
    let decoded = write.tail.as_ref().map_or(Vec::new(), |bytes| tail::decode(bytes).unwrap());
    decoded.iter().map(|(_, decoded)| decoded.samples.len()).sum()
}

#[test]
fn a_tail_grows_by_rows_until_a_block_is_full() {
    let (mode, moving) = (Address::CurMode, Address::IsMoving);
    let mut blocks = OpenBlocks::default();
    push(&mut blocks, moving, whole(0, 0));
    for at in 0..511 {
        push(&mut blocks, mode, whole(at, at));
        if at == 10 || at == 20 {
            let writes = blocks.writes();
            let write = &writes[&0];
            assert!(!write.replace_tail && write.chunks.is_empty());
            assert_eq!(tail_samples(write), if at == 10 { 12 } else { 10 }, "only what is new");
            assert_eq!(blocks.writes(), writes, "asking changes nothing");
            blocks.written();
            assert!(blocks.writes().is_empty());
        }
    }
    push(&mut blocks, mode, whole(511, 511));
    let writes = blocks.writes();
    let write = &writes[&0];
    assert!(write.replace_tail);
    assert_eq!((write.chunks.len(), write.chunks[0].1.summary.count), (1, 512));
    assert_eq!(tail_samples(write), 1, "the tail is what is still open");
    blocks.written();
    assert!(blocks.writes().is_empty());
    assert!(blocks.size() < 200, "{}", blocks.size());
}

#[test]
fn blocks_that_are_half_full_are_sealed_with_the_first() {
    let mut blocks = OpenBlocks::default();
    for at in 0..512 {
        for (number, address) in
            [Address::CurMode, Address::IsMoving, Address::Origin].into_iter().enumerate()
        {
            if at % [1, 2, 3][number] == 0 {
                push(&mut blocks, address, whole(at, at));
            }
        }
    }
    let counts: Vec<_> = blocks.writes()[&0].chunks.iter().map(|(_, chunk)| chunk.summary.count).collect();
    assert_eq!(counts.len(), 2, "not the third: {counts:?}");
}

#[test]
fn a_block_ends_at_midnight_and_when_it_must_not_go_on() {
    let mode = Address::CurMode;
    let mut blocks = OpenBlocks::default();
    push(&mut blocks, mode, whole(DAY - 2, 1));
    blocks.written();
    push(&mut blocks, mode, whole(DAY - 1, 2));
    push(&mut blocks, mode, whole(DAY, 3));
    let writes = blocks.writes();
    let (before, after) = (&writes[&0], &writes[&1]);
    assert!(before.replace_tail && before.tail.is_none());
    assert_eq!((before.chunks.len(), before.chunks[0].1.summary.count), (1, 2));
    assert_eq!((after.chunks.len(), tail_samples(after)), (0, 1));
    blocks.written();

    // Earlier than the last one, behind ten minutes, of another kind, of another interval.
    push(&mut blocks, mode, whole(DAY + 5, 1));
    push(&mut blocks, mode, whole(DAY + 4, 1));
    push(&mut blocks, mode, whole(DAY + 5 + 600 * SECOND, 1));
    push(&mut blocks, mode, Sample { time: Micros(DAY + 601 * SECOND), state: State::Text("a".into()) });
    blocks.push(
        now(0),
        mode,
        Interval::LONGEST,
        Sample { time: Micros(DAY + 602 * SECOND), state: State::Gap(Gap::Stale) },
    );
    assert_eq!(blocks.writes()[&1].chunks.len(), 4);
    for (_, chunk) in &blocks.writes()[&1].chunks {
        assert!(chunk.summary.last.0 - chunk.summary.first.0 < 600 * SECOND);
    }
    blocks.written();
    blocks.seal_old(now(599));
    assert!(blocks.writes().is_empty());
    blocks.seal_old(now(600));
    assert_eq!(blocks.writes()[&1].chunks.len(), 1);
}

#[test]
fn after_a_failure_everything_open_is_written_anew() {
    let mode = Address::CurMode;
    let mut blocks = OpenBlocks::default();
    push(&mut blocks, mode, whole(0, 1));
    blocks.written();
    push(&mut blocks, mode, whole(1, 2));
    blocks.failed();
    let writes = blocks.writes();
    assert!(writes[&0].replace_tail);
    assert_eq!(tail_samples(&writes[&0]), 2);
}

#[test]
fn a_tail_of_many_rows_becomes_one_row() {
    let mut blocks = OpenBlocks::default();
    for at in 0..600 {
        // One at each odd flush, so that no block gets full.
        push(&mut blocks, Address::CurMode, whole(at, 1));
        if at == 400 {
            blocks.seal_all();
        }
        blocks.written();
    }
    let mut rows = 0;
    for at in 600..900 {
        push(&mut blocks, Address::IsMoving, whole(at, 1));
        let write = blocks.writes().remove(&0).unwrap();
        rows = if write.replace_tail { 1 } else { rows + 1 };
        blocks.written();
    }
    assert!(rows < 256, "{rows}");
}

#[test]
fn a_summary_tells_what_the_samples_tell() {
    let samples = [
        whole(0, 4),
        whole(10 * SECOND, -6),
        Sample { time: Micros(20 * SECOND), state: State::Gap(Gap::Stale) },
        whole(30 * SECOND, 1),
        whole(300 * SECOND, 2),
    ];
    let summary = Summary::of(Interval::USUAL, &samples).unwrap();
    assert_eq!((summary.first, summary.last, summary.count), (Micros(0), Micros(300 * SECOND), 5));
    assert_eq!((summary.range, summary.last_number), (Some((-6.0, 4.0)), Some(2.0)));
    // 10 s of 4, 10 s of -6, no value for 10 s, then 1 for 150 s, because no sample came for longer.
    assert_eq!(summary.good, 170 * SECOND);
    assert_eq!(summary.sum, ((40 - 60 + 150) * SECOND) as f64);
}
