//! A palletising cell with a camera, sheets, pallets and a PC works for an hour of its time (`day/cell.rs`).
//! The bench `day` lets it work for a day.

#[path = "day/cell.rs"]
mod cell;

use std::time::Duration;

use cell::PALLETS_OF_A_PATTERN;

const HOUR: Duration = Duration::from_secs(3600);

/// Both patterns have 18 places, in layers of 9 and of 6.
const PLACES: u64 = 18;

#[test]
fn an_hour_of_a_palletising_cell_does_what_it_should() {
    let hour = cell::work(7, HOUR);
    assert_eq!(hour.alarm, None, "{hour:?}");
    assert!((600..1200).contains(&hour.parts), "one in three to six seconds: {hour:?}");
    assert_eq!(hour.pallets, hour.parts / PLACES);
    assert!(hour.farthest < 1e-6, "{} mm from its place", hour.farthest);
    // Pallets with 9 and with 6 parts a layer take turns, five of each; the last pallet is not full.
    let pattern = |pallet: u64| pallet / PALLETS_OF_A_PATTERN % 2;
    let full: u64 = (0..hour.pallets).map(|pallet| 2 + pattern(pallet)).sum();
    let layer = [9, 6][usize::try_from(pattern(hour.pallets)).unwrap()];
    assert_eq!(hour.layers, full + hour.parts % PLACES / layer, "{hour:?}");
    assert_eq!(hour.patterns, hour.pallets / PALLETS_OF_A_PATTERN + 1);
    // One photo for each part, and one more for each that failed.
    assert!(hour.photos > hour.parts && hour.photos < hour.parts + hour.parts / 5, "{hour:?}");
    // Each poll was answered, each photo asked for, each point acknowledged.
    assert!(hour.frames > 3599 + hour.photos + hour.parts, "{hour:?}");
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let hour = cell::work(7, HOUR);
    assert_eq!(cell::work(7, HOUR), hour);
    assert_ne!(cell::work(8, HOUR).bytes, hour.bytes);
}
