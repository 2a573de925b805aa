//! Measuring on a machine that does other things too: in turns, in short slices, as ratios.

use std::hint::black_box;
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

/// Rounds of each comparison. In each, every contender has one slice.
pub const ROUNDS: usize = 15;

/// One slice of one contender.
pub const SLICE: Duration = Duration::from_millis(200);

/// A contender's slice before anything counts.
const WARM_UP: Duration = Duration::from_millis(200);

/// Keeps this thread, and every thread and process that it will start, on one core: a wake-up of another core
/// costs more than what is measured here.
pub fn pin() -> io::Result<()> {
    let allowed = rustix::thread::sched_getaffinity(None)?;
    let last = (0..rustix::thread::CpuSet::MAX_CPU).rev().find(|core| allowed.is_set(*core));
    let mut one = rustix::thread::CpuSet::new();
    one.set(last.unwrap_or(0));
    Ok(rustix::thread::sched_setaffinity(None, &one)?)
}

/// Rounds that have to count: fewer, and the machine was too busy to say anything.
pub const LEAST_ROUNDS: usize = 9;

/// How long this process has had a processor, threads that have ended included.
pub fn processor_time() -> Duration {
    told_by(ClockId::ProcessCPUTime)
}

/// The same for the thread that asks.
pub fn time_of_this_thread() -> Duration {
    told_by(ClockId::ThreadCPUTime)
}

fn told_by(clock: ClockId) -> Duration {
    let time = clock_gettime(clock);
    Duration::new(time.tv_sec.unsigned_abs(), u32::try_from(time.tv_nsec).expect("below a second"))
}

/// The same for another process on the same core: all its threads (Linux). What `/proc` tells of a thread
/// that runs is as old as the last tick of the system; while the one that asks runs, none of these does.
pub fn processor_time_of(process: u32) -> Duration {
    let main = Path::new("/proc").join(process.to_string());
    assert!(ran(&main).is_some(), "{}/schedstat does not tell how long the process ran", main.display());
    let tasks = std::fs::read_dir(main.join("task")).expect("Linux tells the threads of a process");
    // A thread that has just ended has nothing to tell.
    tasks.flatten().filter_map(|task| ran(&task.path())).sum()
}

/// How long this thread has had a processor.
fn ran(thread: &Path) -> Option<Duration> {
    let text = std::fs::read_to_string(thread.join("schedstat")).ok()?;
    Some(Duration::from_nanos(text.split(' ').next()?.parse().ok()?))
}

/// The durations of one slice, in order.
pub struct Slice(Vec<u32>);

impl Slice {
    /// Does something again and again for the time of a slice, and takes how long each took, nanoseconds.
    pub fn of(mut once: impl FnMut()) -> Self {
        Self::timed(SLICE, &mut once)
    }

    fn timed(time: Duration, once: &mut dyn FnMut()) -> Self {
        let mut durations = Vec::with_capacity(1 << 16);
        let begun = Instant::now();
        let mut last = begun;
        while last.duration_since(begun) < time {
            once();
            let now = Instant::now();
            durations.push(u32::try_from(now.duration_since(last).as_nanos()).unwrap_or(u32::MAX));
            last = now;
        }
        durations.sort_unstable();
        Self(durations)
    }

    /// A duration that so many of a hundred are not longer than, nanoseconds.
    pub fn percentile(&self, percent: usize) -> f64 {
        let at = self.0.len() * percent / 100;
        f64::from(self.0.get(at.min(self.0.len().saturating_sub(1))).copied().unwrap_or(u32::MAX))
    }
}

/// A contender: it runs for one slice and gives its figures, the smaller the better. All contenders give the
/// same ones.
pub type Contender<'c> = Box<dyn FnMut() -> Vec<f64> + 'c>;

/// A contender that does one thing again and again; its figures are the percentiles 50 and 99.
pub fn repeated<'c>(mut once: impl FnMut() + 'c) -> Contender<'c> {
    Slice::timed(WARM_UP, &mut once);
    Box::new(move || {
        let slice = Slice::of(&mut once);
        vec![slice.percentile(50), slice.percentile(99)]
    })
}

/// How one compares with another: the ratio of each round, smallest first.
#[derive(Clone, Debug)]
pub struct Ratio(Vec<f64>);

impl Ratio {
    /// How many rounds it is of.
    pub fn rounds(&self) -> usize {
        self.0.len()
    }

    /// How the other compares with the one.
    pub fn inverse(&self) -> Self {
        Self(self.0.iter().rev().map(|ratio| 1.0 / ratio).collect())
    }

    /// The median, and the middle half of the rounds.
    pub fn quartiles(&self) -> [f64; 3] {
        [1, 2, 3].map(|quarter| {
            let at = (self.0.len() - 1) * quarter;
            let (below, part) = (at / 4, f64::from(u32::try_from(at % 4).unwrap_or(0)) / 4.0);
            let next = self.0.get(below + 1).or(self.0.get(below));
            self.0[below] + (next.copied().unwrap_or_default() - self.0[below]) * part
        })
    }
}

/// Lets contenders take turns. The first is the floor: what comes back is, for each of the others, the ratio
/// of each of its figures to the floor's in the same round.
///
/// Rounds in which the floor's first figure is more than 15 % off its own median are thrown away: something
/// else ran.
pub fn compare(contenders: &mut [Contender<'_>]) -> Vec<Vec<Ratio>> {
    judge(take_turns(contenders))
}

/// The figures of each contender in each round.
fn take_turns(contenders: &mut [Contender<'_>]) -> Vec<Vec<Vec<f64>>> {
    let mut rounds: Vec<Vec<Vec<f64>>> = Vec::new();
    for round in 0..ROUNDS {
        let mut figures = vec![Vec::new(); contenders.len()];
        for turn in 0..contenders.len() {
            // Nobody always comes after the same one.
            let at = (round + turn) % contenders.len();
            figures[at] = contenders[at]();
        }
        rounds.push(figures);
    }
    rounds
}

/// Throws away the rounds in which the floor's first figure is more than 15 % off its own median.
fn keep_undisturbed(rounds: &mut Vec<Vec<Vec<f64>>>) {
    let mut floors: Vec<f64> = rounds.iter().map(|figures| figures[0][0]).collect();
    floors.sort_by(f64::total_cmp);
    let median = floors[floors.len() / 2];
    rounds.retain(|figures| (figures[0][0] / median - 1.0).abs() <= 0.15);
    eprintln!("  its yardstick took {median:.0} ns; {} of {} rounds count", rounds.len(), floors.len());
}

/// How a contender's figure compares with a fixed amount. So that a disturbed round is noticed, its floor is
/// a copy of memory.
pub fn beside(amount: f64, contender: Contender<'_>) -> Ratio {
    let (from, mut to) = (vec![1_u8; 1 << 16], vec![0_u8; 1 << 16]);
    let copy = repeated(move || {
        to.copy_from_slice(black_box(&from));
        black_box(&mut to);
    });
    let mut rounds = take_turns(&mut [copy, contender]);
    keep_undisturbed(&mut rounds);
    let mut ratios: Vec<f64> = rounds.iter().map(|figures| figures[1][0] / amount).collect();
    ratios.sort_by(f64::total_cmp);
    Ratio(ratios)
}

/// The ratios of rounds: in each, for each contender, its figures. The first contender is the floor.
pub fn judge(mut rounds: Vec<Vec<Vec<f64>>>) -> Vec<Vec<Ratio>> {
    keep_undisturbed(&mut rounds);
    (1..rounds[0].len())
        .map(|at| {
            (0..rounds[0][at].len())
                .map(|figure| {
                    let mut ratios: Vec<f64> =
                        rounds.iter().map(|figures| figures[at][figure] / figures[0][figure]).collect();
                    ratios.sort_by(f64::total_cmp);
                    Ratio(ratios)
                })
                .collect()
        })
        .collect()
}
