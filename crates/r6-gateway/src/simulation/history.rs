//! A history of the past, in the files of a gateway.

use std::path::Path;
use std::sync::Arc;

use r6_proto::Address;

use crate::clock;
use crate::core::history::sample::{Interval, Micros, Sample, State};
use crate::core::name::RobotName;
use crate::history::{Batch, HistorySettings, RobotCounts, journal};
use crate::store::HISTORY;

/// How many samples are given to the journal at a time.
const TOGETHER: usize = 4096;

/// Writes samples of a signal into the history of this folder, as a gateway would have written them whose
/// deadband is 0: the time of each, in µs since 1970 and ascending, and its number. No gateway may run there.
///
/// # Errors
/// The history cannot be written, in words.
pub fn write_history(
    data: &Path,
    robot: &RobotName,
    address: Address,
    samples: impl Iterator<Item = (i64, f64)>,
) -> Result<(), String> {
    let mut journal = journal::of_folder(&data.join(HISTORY), HistorySettings::default());
    let counts = Arc::new(RobotCounts::default());
    let (now, mut time) = (clock::now(), Micros::default());
    let mut samples = samples.peekable();
    while samples.peek().is_some() {
        let samples: Vec<_> = samples
            .by_ref()
            .take(TOGETHER)
            .map(|(at, number)| Sample { time: Micros(at), state: State::Decimal(number) })
            .map(|sample| (address, Interval::USUAL, sample))
            .collect();
        time = samples.last().map_or(time, |(.., sample)| sample.time);
        let (robot, counts) = (robot.clone(), Arc::clone(&counts));
        journal.take(now, Batch { robot, time, samples, events: Vec::new(), counts });
        journal.flush(now, time).map_err(|error| error.to_string())?;
    }
    journal.seal_all();
    journal.flush(now, time).map_err(|error| error.to_string())
}
