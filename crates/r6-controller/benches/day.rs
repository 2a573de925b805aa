//! A day of a palletising cell, on one core and without sockets: its cost, and that two runs give the same
//! result.
//!
//! The cell is that of `tests/day.rs`: a camera with a photo request for every part, stacks that the PC
//! changes, counters with a target, pallets and sheets that come with a delay, and a PC that reads twelve
//! addresses once a second. The bench measures processor time (`/proc`, Linux), so that other processes do
//! not count.

#[path = "../tests/day/cell.rs"]
mod cell;

use std::time::Duration;

const DAY: Duration = Duration::from_secs(24 * 3600);

/// An hour is enough to check that it runs.
const HOUR: Duration = Duration::from_secs(3600);

const SEED: u64 = 7;

/// The processor time of this process.
fn processor_time() -> Duration {
    #[expect(clippy::disallowed_methods, reason = "a bench asks the system what it cost")]
    let costs = std::fs::read_to_string("/proc/self/schedstat").expect("Linux tells what a process cost");
    let nanoseconds = costs.split(' ').next().and_then(|number| number.parse().ok()).expect("nanoseconds");
    Duration::from_nanos(nanoseconds)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.iter().any(|word| !word.starts_with('-') && !"day".contains(word.as_str())) {
        return;
    }
    let time = if arguments.iter().any(|word| word == "--test") { HOUR } else { DAY };
    let runs: Vec<_> = (0..2)
        .map(|_| {
            let before = processor_time();
            let day = cell::work(SEED, time);
            (processor_time() - before, day)
        })
        .collect();
    for (cost, day) in &runs {
        let seconds = cost.as_secs_f64();
        println!(
            "{} h of a palletising cell: {seconds:.2} s of processor time, {:.0} times as fast as the world; {} parts, {} \
             pallets, {} frames, {} bytes (sum {:016x})",
            time.as_secs() / 3600,
            time.as_secs_f64() / seconds,
            day.parts,
            day.pallets,
            day.frames,
            day.bytes.0,
            day.bytes.1,
        );
    }
    let [(_, first), (_, second)] = runs.as_slice() else { unreachable!("two runs") };
    assert_eq!(first, second, "the same seed, the same bytes");
    assert_eq!(first.alarm, None);
}
