//! Long paths: no pause between lists, no step twice, and the end where it should be.

use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{EndProof, Motion, Robot, RunOptions, StepState};
use r6_controller::{ControllerSnapshot, Profile};
use r6_sim::{Clock, ControllerHandle};
use tokio::time::{Instant, sleep};

use crate::cell::{Cell, percent, profile, soon, through, wave};

/// How often the test looks at the machine: much more often than the shortest move takes.
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// A speed below this, degrees per second in every axis, counts as standing. The slowest of these waves is
/// many times as fast.
const STANDING: f64 = 0.5;

/// What a continuous observer sees of a motion.
#[derive(Debug, Default)]
struct Seen {
    looks: usize,
    standing: usize,
    /// The maximum length of the list, and its minimum before the last steps.
    longest: usize,
    shortest: usize,
    took: Duration,
}

/// Looks until the machine has come to rest at the end.
async fn look_on(handle: ControllerHandle, end: [f64; 6]) -> Seen {
    let mut seen = Seen { shortest: usize::MAX, ..Seen::default() };
    let mut before: Option<ControllerSnapshot> = None;
    let mut begun = None;
    loop {
        let now = handle.snapshot();
        if let Some(before) = &before {
            let fastest =
                now.axes.iter().zip(before.axes).map(|(now, then)| (now - then).abs()).fold(0.0, f64::max)
                    / LOOK_EVERY.as_secs_f64();
            let is_over = !now.moving && now.axes.iter().zip(end).all(|(at, end)| (at - end).abs() < 1e-6);
            if begun.is_some() && is_over {
                seen.took = begun.map(|begun: Instant| begun.elapsed()).unwrap_or_default();
                return seen;
            }
            if now.moving && begun.is_none() {
                begun = Some(Instant::now());
            }
            // The first and the last move begin and end at rest.
            let within = now.list_length > 1 && begun.is_some_and(|begun| begun.elapsed().as_millis() > 300);
            if within {
                seen.looks += 1;
                seen.standing += usize::from(!now.moving || fastest < STANDING);
                seen.shortest = seen.shortest.min(now.list_length);
            }
            seen.longest = seen.longest.max(now.list_length);
        }
        before = Some(now);
        sleep(LOOK_EVERY).await;
    }
}

/// Streams 500 points. Returns what the observer saw.
async fn stream(profile: Profile, options: RunOptions, speed: f64) -> Seen {
    stream_points(wave(500), profile, options, speed).await
}

async fn stream_points(points: Vec<[f64; 6]>, profile: Profile, options: RunOptions, speed: f64) -> Seen {
    let mut cell = Cell::new(profile, Clock::Real).await;
    let end = *points.last().unwrap();
    let watching = tokio::spawn(look_on(cell.handle().clone(), end));
    let handle = cell.robot.run(&through(&points, speed, 5), options).await.unwrap();
    let done = soon(handle.finished()).await.unwrap();
    let seen = soon(watching).await.unwrap();
    assert!(done.moved);
    assert!(cell.error(&end) < 0.01, "{}", cell.error(&end));
    assert_eq!(cell.taken(), 500, "each step once");
    let lists = cell.lists();
    assert_eq!(lists.iter().filter(|(_, replaced)| *replaced).count(), 1);
    assert!(lists[0].1 && lists.iter().all(|(count, _)| (1..=8).contains(count)), "{lists:?}");
    seen
}

#[tokio::test(start_paused = true)]
async fn five_hundred_points_without_a_pause() {
    for speed in [10.0, 50.0] {
        let seen = stream(Profile::hc1(), RunOptions::default(), speed).await;
        println!("{speed} %: {seen:?}");
        assert!(seen.looks > 1000, "{seen:?}");
        assert_eq!(seen.standing, 0, "{seen:?}");
        assert!(seen.longest <= RunOptions::default().room, "{seen:?}");
        // No time is lost: it takes as long as with the whole path in the list from the beginning.
        let all_at_once = RunOptions { room: 500, ..RunOptions::default() };
        let whole = stream(Profile::hc1(), all_at_once, speed).await;
        println!("with the whole path in the list: {whole:?}");
        assert!(whole.longest > 400, "{whole:?}");
        assert!(seen.took.abs_diff(whole.took) < Duration::from_millis(20), "{seen:?} {whole:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn points_close_together_are_fed_in_time() {
    let points: Vec<_> = wave(11).windows(2).flat_map(|ends| between(ends[0], ends[1], 50)).collect();
    for name in ["hc1", "legacy"] {
        let all_at_once = RunOptions { room: 500, ..RunOptions::default() };
        let whole = stream_points(points.clone(), profile(name), all_at_once, 50.0).await;
        let seen = stream_points(points.clone(), profile(name), RunOptions::default(), 50.0).await;
        println!("{name}: {seen:?}, with the whole path in the list: {whole:?}");
        assert!(seen.took.abs_diff(whole.took) < Duration::from_millis(20), "{name}: {seen:?} {whole:?}");
    }
}

/// Points between two positions.
fn between(from: [f64; 6], to: [f64; 6], count: u32) -> impl Iterator<Item = [f64; 6]> {
    (0..count).map(move |n| {
        let share = f64::from(n + 1) / f64::from(count);
        std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * share)
    })
}

#[tokio::test(start_paused = true)]
async fn what_looks_for_pauses_finds_one() {
    // A list that is refilled only when it is nearly empty.
    let late = RunOptions { interval: Duration::from_secs(6), ..RunOptions::default() };
    let seen = stream(Profile::hc1(), late, 50.0).await;
    assert!(seen.standing > 0, "{seen:?}");
}

#[tokio::test(start_paused = true)]
async fn five_hundred_points_without_a_pause_where_nobody_tells_the_length_of_the_list() {
    for name in ["legacy", "r6-host"] {
        let seen = stream(profile(name), RunOptions::default(), 10.0).await;
        println!("{name}: {seen:?}");
        assert!(seen.looks > 1000, "{name} {seen:?}");
        assert_eq!(seen.standing, 0, "{name} {seen:?}");
        assert!(seen.longest <= RunOptions::default().room, "{name} {seen:?}");
    }
}

#[tokio::test]
async fn on_a_clock_that_jumps_each_list_is_over_when_it_is_answered() {
    for name in Profile::names() {
        let mut cell = Cell::new(profile(name), Clock::AsFastAsPossible).await;
        let points = wave(500);
        let options = RunOptions {
            interval: Duration::from_millis(1),
            settle: Duration::from_millis(2),
            ..RunOptions::default()
        };
        let handle = cell.robot.run(&through(&points, 50.0, 5), options).await.unwrap();
        soon(handle.finished()).await.unwrap();
        assert!(cell.error(points.last().unwrap()) < 0.01, "{name}");
        assert_eq!(cell.taken(), 500, "{name}");
    }
}

#[tokio::test]
async fn in_real_time_too() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Times(10.0)).await;
    let points = wave(120);
    let options = RunOptions { interval: Duration::from_millis(5), ..RunOptions::default() };
    let handle = cell.robot.run(&through(&points, 20.0, 5), options).await.unwrap();
    soon(handle.finished()).await.unwrap();
    assert!(cell.error(points.last().unwrap()) < 0.01);
    assert_eq!(cell.taken(), 120);
}

#[tokio::test(start_paused = true)]
async fn a_way_back_and_forth_is_not_mistaken_for_its_first_leg() {
    // Unit A's corner test, sixty times.
    let points: Vec<_> =
        (0..60).map(|n| [if n % 2 == 0 { 8.0 } else { -8.0 }, 0.0, 0.0, 0.0, 30.0, 0.0]).collect();
    for name in ["hc1", "legacy"] {
        let mut cell = Cell::new(profile(name), Clock::Real).await;
        let handle = cell.robot.run(&through(&points, 30.0, 0), RunOptions::default()).await.unwrap();
        let watch = handle.watch();
        let longest = tokio::spawn(longest_list(cell.handle().clone(), watch));
        soon(handle.finished()).await.unwrap();
        assert!(cell.error(points.last().unwrap()) < 0.01, "{name}");
        assert_eq!(cell.taken(), 60, "{name}");
        let longest = longest.await.unwrap();
        assert!(longest <= RunOptions::default().room, "{name}: {longest}");
    }
}

async fn longest_list(
    handle: ControllerHandle,
    watch: tokio::sync::watch::Receiver<r6_client::Progress>,
) -> usize {
    let mut longest = 0;
    while !watch.borrow().ended {
        longest = longest.max(handle.snapshot().list_length);
        sleep(LOOK_EVERY).await;
    }
    longest
}

#[tokio::test(start_paused = true)]
async fn each_step_is_followed_from_queued_to_done() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let points = wave(60);
    let handle = cell.robot.run(&through(&points, 20.0, 5), RunOptions::default()).await.unwrap();
    let mut last = handle.step(60).unwrap();
    assert_eq!(last.state(), StepState::Queued);
    assert!(handle.step(0).is_none() && handle.step(61).is_none());
    for number in [1, 20, 40, 60] {
        let mut step = handle.step(number).unwrap();
        assert!(soon(step.started()).await);
        let length = cell.handle().snapshot().list_length;
        let left = handle.progress().accepted - length;
        // The controller may be ahead of the reported progress by one read.
        assert!((number - 1..=number + 3).contains(&left), "step {number}: {left} done");
        assert!(soon(step.done()).await);
    }
    assert!(soon(last.done()).await);
    soon(handle.finished()).await.unwrap();
    assert_eq!(last.state(), StepState::Done);
}

#[tokio::test(start_paused = true)]
async fn outputs_and_waits_are_carried_out_in_their_order() {
    for name in ["hc1", "legacy"] {
        let cell = Cell::new(profile(name), Clock::Real).await;
        let mut motion = Motion::new();
        for (n, point) in wave(30).into_iter().enumerate() {
            motion = motion.axis_move(AxisPosition::degrees(point), percent(50.0)).blend(3);
            if n % 10 == 5 {
                motion = motion.wait(Duration::from_secs(2));
            }
            if name == "hc1" && n == 20 {
                motion = motion.set_output("Y013".parse().unwrap(), true);
            }
        }
        // A wait at the end counts.
        motion = motion.wait(Duration::from_secs(9));
        let begun = Instant::now();
        let handle = cell.robot.run(&motion, RunOptions::default()).await.unwrap();
        soon(handle.finished()).await.unwrap();
        assert!(begun.elapsed() > Duration::from_secs(15), "{name}");
        let snapshot = cell.handle().snapshot();
        assert_eq!((snapshot.list_length, snapshot.moving), (0, false), "{name}");
        assert!(cell.error(&wave(30)[29]) < 0.01, "{name}");
        if name == "hc1" {
            assert_eq!(snapshot.io.outputs[0], 1 << 3);
        }
    }
}

#[tokio::test]
async fn two_paths_do_not_mix_in_one_list() {
    let cell = Cell::new(Profile::hc1(), Clock::Times(10.0)).await;
    let motion = through(&wave(100), 10.0, 5);
    let handle = cell.robot.run(&motion, RunOptions::default()).await.unwrap();
    let other: Robot = cell.robot.clone();
    let error = other.run(&motion, RunOptions::default()).await.unwrap_err();
    assert_eq!(error.cause, r6_client::Cause::AnotherRuns);
    assert!(handle.stop().await.unwrap().confirmed);
}

/// With a clock that jumps, an observer sees the arm start, and then at its end.
#[tokio::test]
async fn a_motion_that_ends_where_it_began_is_seen_on_a_clock_that_jumps() {
    for name in Profile::names() {
        let cell = Cell::new(profile(name), Clock::AsFastAsPossible).await;
        let there_and_back = [[30.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 6]];
        let begun = std::time::Instant::now();
        for _ in 0..3 {
            let handle =
                cell.robot.run(&through(&there_and_back, 50.0, 0), RunOptions::default()).await.unwrap();
            let done = soon(handle.finished()).await.unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!((done.proof, done.moved), (EndProof::Reached, true), "{name}");
        }
        // If firmware does not report the length of the list, half a second of rest counts as the end.
        let most = if name == "hc1" { 2 } else { 6 };
        assert!(begun.elapsed() < Duration::from_secs(most), "{name}: {:?}", begun.elapsed());
    }
}
