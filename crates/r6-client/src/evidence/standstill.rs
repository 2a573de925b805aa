//! The statement "the arm stands", made after a stop.
//!
//! Two reads at rest prove nothing while the machine runs: real arms stand for a third of a second at each
//! point that is not blended, and programs wait for inputs. So the proof needs a state that a running machine
//! cannot have:
//!
//! ```text
//!  a stop was sent ──▶ watching ──(mode 0, 1, 2 or 3, and two reads at rest)──────────────────▶ NotRunning
//!                         │
//!                         └─(only if the user says that this controller stays in mode 7: every means was
//!                            sent, a stop was answered ok, mode 7, and for two seconds at rest with the
//!                            list empty)──────────────────────────────────────────────────────▶ EmptyList
//! ```
//!
//! The second proof does not exclude a taught program: such a program may wait for an input for any time,
//! with the arm at rest. So this proof counts only if the settings say that the controller stays in mode 7.
//! Every other controller that stays in mode 7 counts as not stopped.
//!
//! A read of another robot or over another connection restarts the watch and proves nothing.

use std::time::Duration;

use r6_proto::OperationMode;
use r6_proto::time::Instant;

use crate::evidence::{About, Observation};

/// How long an arm has to stand while the mode says that a program runs: six times the longest dwell seen at
/// a point without blending (0.33 s, reported, unit A).
pub(crate) const LONGER_THAN_ANY_DWELL: Duration = Duration::from_secs(2);

/// What proves that the arm stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandProof {
    /// The controller is in a mode in which no program runs, and the arm was at rest in two reads.
    NotRunning(OperationMode),
    /// The controller stays in mode 7, which [`crate::RobotSettings::stays_in_mode_7`] announced. It answered
    /// a stop with ok. For this long the arm was at rest and the instruction list was empty. A program that
    /// was taught on the pendant may still run, and may move the arm.
    EmptyList(Duration),
}

impl StandProof {
    /// Its word, for programs.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::NotRunning(_) => "not_running",
            Self::EmptyList(_) => "empty_list",
        }
    }
}

/// The stop attempts so far, as far as the proof depends on them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tried {
    /// Whether every means of stopping was sent.
    pub all: bool,
    /// Whether a stop or a pause was answered with ok. Clearing the list does not count, because it ends no
    /// program.
    pub accepted: bool,
    /// Whether the controller is known to stay in mode 7.
    pub stays_in_mode_7: bool,
}

/// Watches one robot over one connection after a stop was sent on it.
#[derive(Debug)]
pub(crate) struct Standstill {
    about: About,
    /// When the stop was handed over. Values requested before that prove nothing.
    since: Instant,
    last: Option<Observation>,
    /// When the arm was first seen at rest with an empty list.
    empty_since: Option<Instant>,
}

impl Standstill {
    pub fn new(about: About, since: Instant) -> Self {
        Self { about, since, last: None, empty_since: None }
    }

    /// A read failed: the arm has to be seen at rest again from the start.
    pub fn missed(&mut self) {
        self.last = None;
        self.empty_since = None;
    }

    /// Takes in one observation. Returns `Some` once it proves that the arm stands.
    pub fn see(&mut self, observation: &Observation, tried: Tried) -> Option<StandProof> {
        if !observation.is_about(&self.about) || observation.asked_at < self.since {
            self.missed();
            return None;
        }
        let now = observation.values;
        let at_rest = self.last.as_ref().is_some_and(|last| now.stands_since(&last.values));
        let mode_before = self.last.as_ref().and_then(|last| last.values.mode);
        self.last = Some(observation.clone());
        if !at_rest || now.list_length != Some(0) || now.mode != Some(OperationMode::Running) {
            self.empty_since = None;
        }
        let mode = now.mode.filter(|_| at_rest)?;
        if !mode.may_run() {
            return (mode_before == Some(mode)).then_some(StandProof::NotRunning(mode));
        }
        if now.list_length != Some(0) || mode != OperationMode::Running {
            return None;
        }
        let since = *self.empty_since.get_or_insert(observation.asked_at);
        let stood = observation.asked_at.since(since);
        let proved = tried.stays_in_mode_7 && tried.all && tried.accepted && stood >= LONGER_THAN_ANY_DWELL;
        proved.then_some(StandProof::EmptyList(stood))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use r6_proto::axis::AXES;

    use super::*;
    use crate::evidence::Sample;
    use crate::identity::Identity;

    const ALL: Tried = Tried { all: true, accepted: true, stays_in_mode_7: true };

    fn robot(name: &str) -> Identity {
        Identity { machine_name: Some(name.to_owned()), ..Identity::default() }
    }

    fn about() -> About {
        About { connection: 1, robot: Some(robot("cell 4")) }
    }

    struct Film {
        begun: Instant,
        watch: Standstill,
    }

    impl Film {
        fn new() -> Self {
            let begun = Instant::ORIGIN + Duration::from_secs(100);
            Self { begun, watch: Standstill::new(about(), begun) }
        }

        fn at(&self, ms: u64, mode: OperationMode, list: Option<i64>, j1: f64) -> Observation {
            let mut axes = [None; AXES];
            axes[0] = Some(j1);
            Observation {
                robot: Some(robot("cell 4")),
                connection: 1,
                asked_at: self.begun + Duration::from_millis(ms),
                values: Sample {
                    moving: Some(false),
                    alarm: Some(0),
                    mode: Some(mode),
                    list_length: list,
                    axes,
                    pose: [None; AXES],
                },
            }
        }

        fn see(&mut self, ms: u64, mode: OperationMode, list: Option<i64>) -> Option<StandProof> {
            let observation = self.at(ms, mode, list, 0.0);
            self.watch.see(&observation, ALL)
        }
    }

    #[test]
    fn two_reads_at_rest_prove_it_where_no_program_runs() {
        let mut film = Film::new();
        assert_eq!(film.see(0, OperationMode::Stop, Some(3)), None);
        let proof = StandProof::NotRunning(OperationMode::Stop);
        assert_eq!(film.see(50, OperationMode::Stop, Some(3)), Some(proof));
    }

    #[test]
    fn a_dwell_in_a_running_mode_proves_nothing() {
        for mode in [OperationMode::Running, OperationMode::SingleCycle, OperationMode::SingleStep] {
            let mut film = Film::new();
            for ms in (0..10_000).step_by(50) {
                assert_eq!(film.see(ms, mode, Some(3)), None, "{mode}: steps are left");
            }
            for ms in (10_000..20_000).step_by(50) {
                assert_eq!(film.see(ms, mode, None), None, "{mode}: what is left is unknown");
            }
        }
    }

    #[test]
    fn an_empty_list_and_a_long_rest_prove_it_after_every_means_was_tried() {
        let mut film = Film::new();
        for ms in (0..=2000).step_by(50) {
            assert_eq!(film.see(ms, OperationMode::Running, Some(0)), None, "{ms}");
        }
        assert!(matches!(film.see(2050, OperationMode::Running, Some(0)), Some(StandProof::EmptyList(_))));
        for tried in [
            Tried { all: false, ..ALL },
            Tried { accepted: false, ..ALL },
            Tried { stays_in_mode_7: false, ..ALL },
        ] {
            let observation = film.at(9000, OperationMode::Running, Some(0), 0.0);
            assert_eq!(film.watch.see(&observation, tried), None, "{tried:?}");
        }
        // A taught program makes one pass in mode 9 and may wait for an input for any time.
        assert_eq!(film.see(20_000, OperationMode::SingleCycle, Some(0)), None);
    }

    #[test]
    fn the_two_seconds_begin_with_the_first_look_that_saw_the_list_empty() {
        for (mode, list) in [(OperationMode::Running, Some(3)), (OperationMode::SingleCycle, Some(0))] {
            let mut film = Film::new();
            assert_eq!(film.see(0, mode, list), None);
            assert_eq!(film.see(50, mode, list), None);
            assert_eq!(film.see(2100, OperationMode::Running, Some(0)), None, "after {mode}, {list:?}");
            assert_eq!(film.see(4099, OperationMode::Running, Some(0)), None);
            let stood = Some(StandProof::EmptyList(Duration::from_secs(2)));
            assert_eq!(film.see(4100, OperationMode::Running, Some(0)), stood);
        }
    }

    #[test]
    fn another_robot_another_connection_and_older_reads_prove_nothing() {
        let mut film = Film::new();
        let stands = film.at(50, OperationMode::Stop, Some(0), 0.0);
        let other = Observation { robot: Some(robot("cell 5")), ..stands.clone() };
        let elsewhere = Observation { connection: 2, ..stands.clone() };
        let before = Observation { asked_at: film.begun - Duration::from_millis(1), ..stands.clone() };
        for wrong in [other, elsewhere, before] {
            assert_eq!(film.watch.see(&wrong, ALL), None);
            assert_eq!(film.watch.see(&wrong, ALL), None, "{wrong:?}");
            // A read of another robot or connection does not count as the first of two reads.
            assert_eq!(film.watch.see(&stands, ALL), None);
            film.watch.missed();
        }
    }

    proptest! {
        /// After any earlier reads, an arm that moved between the last two reads is never said to stand.
        #[test]
        fn an_arm_that_moved_is_never_said_to_stand(
            reads in prop::collection::vec((0_u64..3000, 0_i64..10, prop::option::of(0_i64..3), 0_u8..3), 1..60),
        ) {
            let mut film = Film::new();
            let (mut ms, mut before) = (0, None);
            for (pause, mode, list, j1) in reads {
                ms += pause;
                let j1 = f64::from(j1);
                let observation = film.at(ms, OperationMode::of_number(mode), list, j1);
                if let Some(proof) = film.watch.see(&observation, ALL) {
                    prop_assert_eq!(before, Some((j1, mode)));
                    match proof {
                        StandProof::NotRunning(told) => prop_assert!(!told.may_run()),
                        StandProof::EmptyList(stood) => {
                            prop_assert!(stood >= LONGER_THAN_ANY_DWELL && list == Some(0));
                        }
                    }
                }
                before = Some((j1, mode));
            }
        }
    }
}
