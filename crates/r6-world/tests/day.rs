//! An hour of a hall, in seconds; `make day` runs 24 hours with 200 robots.

use std::time::Duration;

use r6_world::day::{self, DayPlan};

#[test]
fn an_hour_of_a_hall_keeps_the_bounds_of_memory_tasks_and_files() {
    let plan = DayPlan {
        robots: 6,
        lasts: Duration::from_secs(3600),
        period: Duration::from_millis(1000),
        max_bytes: 64 << 20,
        seed: 1,
    };
    let folder = std::env::temp_dir().join(format!("r6-day-test-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut looks = 0;
    let day = day::run(&plan, &folder, |_| looks += 1);
    std::fs::remove_dir_all(&folder).unwrap();
    let day = day.unwrap();
    assert_eq!(day.wrong, Vec::<String>::new());
    assert_eq!((looks, day.seen.len()), (6, 6));
    // Each part of it was at work.
    assert!(day.cuts >= 50 && day.stops >= 5, "{day:?}");
    assert!(day.streamed > 1_000_000 && day.entries > 500, "{day:?}");
    assert!(day.seen[5].history > 100_000 && day.seen[5].answers > 1500, "{day:?}");
}
