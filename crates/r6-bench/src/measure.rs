//! Measures on a machine that also does other work: in turns, in short slices, as ratios.

use std::hint::black_box;
use std::io;
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use rustix::process::Pid;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use rustix::time::{ClockId, clock_gettime};

/// Rounds of each comparison. In each round, every contender has one slice.
pub const ROUNDS: usize = 15;

/// One slice of one contender.
pub const SLICE: Duration = Duration::from_millis(200);

/// The warm-up slice of a contender, which does not count.
const WARM_UP: Duration = Duration::from_millis(200);

/// The cores on which this program was started.
fn cores() -> io::Result<CpuSet> {
    static CORES: OnceLock<CpuSet> = OnceLock::new();
    if let Some(cores) = CORES.get() {
        return Ok(*cores);
    }
    let now = sched_getaffinity(None)?;
    Ok(*CORES.get_or_init(|| now))
}

/// Pins this thread, and all threads and processes that it starts, to one core. Waking another core costs
/// more than what is measured here.
pub fn pin() -> io::Result<()> {
    let cores = cores()?;
    let last = (0..CpuSet::MAX_CPU).rev().find(|core| cores.is_set(*core));
    let mut one = CpuSet::new();
    one.set(last.unwrap_or(0));
    Ok(sched_setaffinity(None, &one)?)
}

/// Lets all threads of these processes, and this thread, run on all cores on which this program was started,
/// and threads that they start later. To be undone with [`pin`].
pub fn spread(processes: &[u32]) -> io::Result<()> {
    let cores = cores()?;
    for process in processes {
        for task in std::fs::read_dir(format!("/proc/{process}/task"))?.flatten() {
            let thread = task.file_name().to_str().and_then(|id| id.parse().ok());
            // A thread that has just ended cannot be moved.
            let _ = sched_setaffinity(thread.and_then(Pid::from_raw), &cores);
        }
    }
    Ok(sched_setaffinity(None, &cores)?)
}

/// The minimum number of rounds that count. With fewer, the machine was too busy for a result.
pub const LEAST_ROUNDS: usize = 9;

/// The processor time of this process, including threads that have ended.
pub fn processor_time() -> Duration {
    told_by(ClockId::ProcessCPUTime)
}

/// The processor time of the calling thread.
pub fn time_of_this_thread() -> Duration {
    told_by(ClockId::ThreadCPUTime)
}

fn told_by(clock: ClockId) -> Duration {
    let time = clock_gettime(clock);
    Duration::new(time.tv_sec.unsigned_abs(), u32::try_from(time.tv_nsec).expect("below a second"))
}

/// The processor time of another process on the same core: all its threads (Linux). For a running thread,
/// `/proc` shows the value of the last system tick. While the caller runs, none of these threads runs.
pub fn processor_time_of(process: u32) -> Duration {
    let main = Path::new("/proc").join(process.to_string());
    assert!(ran(&main).is_some(), "{}/schedstat does not tell how long the process ran", main.display());
    let tasks = std::fs::read_dir(main.join("task")).expect("Linux tells the threads of a process");
    // A thread that has just ended has no value.
    tasks.flatten().filter_map(|task| ran(&task.path())).sum()
}

/// The processor time of this thread.
fn ran(thread: &Path) -> Option<Duration> {
    let text = std::fs::read_to_string(thread.join("schedstat")).ok()?;
    Some(Duration::from_nanos(text.split(' ').next()?.parse().ok()?))
}

/// The durations of one slice, sorted.
pub struct Slice(Vec<u32>);

impl Slice {
    /// Repeats `once` for the time of a slice, and measures each call in nanoseconds.
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

    /// The duration that `percent` percent of the calls do not exceed, in nanoseconds.
    pub fn percentile(&self, percent: usize) -> f64 {
        let at = self.0.len() * percent / 100;
        f64::from(self.0.get(at.min(self.0.len().saturating_sub(1))).copied().unwrap_or(u32::MAX))
    }
}

/// A contender. It runs for one slice and returns its figures; smaller is better. All contenders return the
/// same figures.
pub type Contender<'c> = Box<dyn FnMut() -> Vec<f64> + 'c>;

/// A contender that repeats one call. Its figures are the percentiles 50 and 99.
pub fn repeated<'c>(mut once: impl FnMut() + 'c) -> Contender<'c> {
    Slice::timed(WARM_UP, &mut once);
    Box::new(move || {
        let slice = Slice::of(&mut once);
        vec![slice.percentile(50), slice.percentile(99)]
    })
}

/// A comparison with another contender: the ratio of each round, smallest first.
#[derive(Clone, Debug)]
pub struct Ratio(Vec<f64>);

impl Ratio {
    /// The number of rounds.
    pub fn rounds(&self) -> usize {
        self.0.len()
    }

    /// The comparison in the other direction.
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

/// Runs contenders in turns. The first is the floor. Returns for each other contender the ratio of each of
/// its figures to the floor's figure in the same round.
///
/// Rounds in which the floor's first figure differs by more than 15 % from its median are dropped, because
/// something else was running.
pub fn compare(contenders: &mut [Contender<'_>]) -> Vec<Vec<Ratio>> {
    judge(take_turns(contenders))
}

/// The figures of each contender in each round.
fn take_turns(contenders: &mut [Contender<'_>]) -> Vec<Vec<Vec<f64>>> {
    let mut rounds: Vec<Vec<Vec<f64>>> = Vec::new();
    for round in 0..ROUNDS {
        let mut figures = vec![Vec::new(); contenders.len()];
        for turn in 0..contenders.len() {
            // Change the order, so that no contender always follows the same one.
            let at = (round + turn) % contenders.len();
            figures[at] = contenders[at]();
        }
        rounds.push(figures);
    }
    rounds
}

/// Drops the rounds in which the floor's first figure differs by more than 15 % from its median.
fn keep_undisturbed(rounds: &mut Vec<Vec<Vec<f64>>>) {
    let mut floors: Vec<f64> = rounds.iter().map(|figures| figures[0][0]).collect();
    floors.sort_by(f64::total_cmp);
    let median = floors[floors.len() / 2];
    rounds.retain(|figures| (figures[0][0] / median - 1.0).abs() <= 0.15);
    eprintln!("  its yardstick took {median:.0} ns; {} of {} rounds count", rounds.len(), floors.len());
}

/// Compares a contender's figure with a fixed amount. Its floor is a copy of memory, so that a disturbed
/// round is noticed.
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

/// The ratios of rounds. Each round has the figures of each contender. The first contender is the floor.
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
