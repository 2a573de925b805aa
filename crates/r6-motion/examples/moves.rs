//! Random axis moves, their limits for the axes, and their durations, for comparison by
//! `tools/oracles/trajectories`.
//!
//! `cargo run --release --package r6-motion --example moves 10000` prints for each move one line
//!
//! ```text
//! move NAME SECONDS RSRUCKIG SPEED ACCELERATION JERK
//! ```
//!
//! and six lines `axis START TARGET SPEED ACCELERATION JERK`. SECONDS is our plan's duration. RSRUCKIG is
//! that of rsruckig for six synchronised axes under the same limits, or the word `error`. The limits of an
//! axis are its full speed times the [`Peaks`] of the move's profile. The three numbers of the move say how
//! close many samples of the planned [`Movement`] came to them, as fractions.

use r6_motion::robot_model::AxisModel;
use r6_motion::speed_profile::{Peaks, Profile, SmoothStep};
use r6_motion::{
    Axes, Conditions, Frames, Move, MoveMask, MoveSpeed, MoveTarget, Movement, Ramps, RobotModel, Turning,
};
use rsruckig::prelude::*;

/// How many samples each change of speed gets, and the part between them.
const LOOKS: u32 = 100;

fn main() {
    let moves = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(100_u32);
    let mut random = Random(Numbers(1));
    let models: Vec<_> = RobotModel::names().filter_map(RobotModel::named).collect();
    for (_, model) in (0..moves).zip(models.iter().cycle()) {
        let case = Case::random(model, &mut random);
        let [speed, acceleration, jerk] = case.nearest();
        let theirs = case.rsruckig().map_or("error".to_owned(), |seconds| seconds.to_string());
        println!("move {} {} {theirs} {speed} {acceleration} {jerk}", model.name, case.movement.duration());
        for ((start, target), axis) in case.start.arm().iter().zip(case.target.arm()).zip(&model.axes) {
            let [speed, acceleration, jerk] = limits(axis, &case.peaks);
            println!("axis {start} {target} {speed} {acceleration} {jerk}");
        }
    }
}

#[path = "../tests/kinematics/common.rs"]
mod common;

use common::Numbers;

/// Random numbers for moves.
struct Random(Numbers);

impl Random {
    /// A number between 0 and 1.
    fn part(&mut self) -> f64 {
        self.0.part()
    }

    /// A number with the same probability in each decade.
    fn scaled(&mut self, least: f64, most: f64) -> f64 {
        least * (most / least).powf(self.part())
    }

    /// Axes anywhere in the soft limits.
    fn axes(&mut self, model: &RobotModel) -> Axes {
        self.0.axes(model)
    }

    /// Another target. Of five, two are anywhere, two are nearby (down to a ten-thousandth of the way), and
    /// one moves one axis only.
    fn target(&mut self, model: &RobotModel, start: &Axes) -> Axes {
        let anywhere = self.axes(model);
        let kind = self.part();
        let one = (self.part() * model.axis_count() as f64) as usize;
        let share = if kind < 0.4 { 1.0 } else { self.scaled(1e-4, 1.0) };
        let mut arm = start.arm();
        for (n, (slot, far)) in arm.iter_mut().zip(anywhere.arm()).enumerate() {
            if kind < 0.8 || n == one {
                *slot += share * (far - *slot);
            }
        }
        Axes::of_arm(arm).expect("between two axis positions")
    }

    /// The controller's initial ramps, or ramps that `modifyAccDec` may set.
    fn ramps(&mut self) -> Ramps {
        let told = [self.scaled(0.01, 3.0), self.scaled(0.01, 3.0)];
        let [up, down] = told.map(|seconds| (seconds * 1000.0).round() / 1000.0);
        if self.part() < 0.4 { Ramps::default() } else { Ramps::new(up, down).expect("within its bounds") }
    }
}

/// One move from rest to rest.
struct Case {
    model: &'static RobotModel,
    start: Axes,
    target: Axes,
    movement: Movement,
    ramps: Ramps,
    peaks: Peaks,
}

impl Case {
    fn random(model: &'static RobotModel, random: &mut Random) -> Self {
        let start = random.axes(model);
        let target = random.target(model, &start);
        let (percent, global, ramps) = (random.scaled(1.0, 100.0), random.scaled(0.05, 1.0), random.ramps());
        let order = Move {
            target: MoveTarget::Axes(target),
            mask: MoveMask::SIX,
            speed: MoveSpeed::PercentOfMax(percent),
            delay: 0.0,
        };
        let conditions = Conditions { global, ramps, frames: Frames::default(), turning: Turning::Shortest };
        let movement = Movement::plan(model, &start, &order, &conditions).expect("a move within the limits");
        // A movement does not show its profile, so the profile is planned again; equal durations confirm it.
        let profile = Profile::plan(movement.path().length(), percent / 100.0 * global, ramps)
            .expect("a profile of sensible length");
        assert!((profile.duration() - movement.duration()).abs() < 1e-9, "two plans of one move differ");
        Self { model, start, target, movement, ramps, peaks: profile.peaks() }
    }

    /// How close any sample of any axis came to its limits of speed, acceleration and jerk: 1 is at the
    /// limit.
    ///
    /// Acceleration and jerk are differences of the speed over a short time, so they never exceed the real
    /// ones.
    fn nearest(&self) -> [f64; 3] {
        let end = self.movement.duration();
        let ramps = [self.ramps.acceleration(), self.ramps.deceleration()];
        let [up, down] = ramps.map(SmoothStep::of);
        let h = 1e-3 * up.width().min(down.width()).min(end);
        let mut nearest = [0.0_f64; 3];
        for t in self.looks(&up, &down) {
            let [before, here, after] = [t - h, t, t + h].map(|t| self.movement.state_at(t).axis_speeds);
            for (n, axis) in self.model.axes.iter().enumerate() {
                let seen =
                    [here[n], (after[n] - here[n]) / h, (after[n] - 2.0 * here[n] + before[n]) / (h * h)];
                for ((nearest, seen), limit) in nearest.iter_mut().zip(seen).zip(limits(axis, &self.peaks)) {
                    *nearest = nearest.max(seen.abs() / limit);
                }
            }
        }
        nearest
    }

    /// The sample times: throughout both changes of speed and between them, and where the jerk changes
    /// direction.
    fn looks(&self, up: &SmoothStep, down: &SmoothStep) -> Vec<f64> {
        let end = self.movement.duration();
        let (up_ends, down_begins) = (up.width().min(end), (end - down.width()).max(0.0));
        let mut looks = Vec::new();
        for (from, to) in [(0.0, up_ends), (up_ends, down_begins), (down_begins, end)] {
            looks.extend((0..=LOOKS).map(|look| from + (to - from) * f64::from(look) / f64::from(LOOKS)));
        }
        looks.extend(up.knots());
        looks.extend(down.knots().map(|knot| down_begins + knot));
        looks
    }

    /// The duration of rsruckig's plan, in seconds; `None` if it finds none.
    fn rsruckig(&self) -> Option<f64> {
        let mut input = InputParameter::<6>::new(None);
        for (n, axis) in self.model.axes.iter().enumerate() {
            let [speed, acceleration, jerk] = limits(axis, &self.peaks);
            input.current_position[n] = self.start.arm()[n];
            input.target_position[n] = self.target.arm()[n];
            input.max_velocity[n] = speed;
            input.max_acceleration[n] = acceleration;
            input.max_jerk[n] = jerk;
        }
        let mut trajectory = Trajectory::new(None);
        let planned = Ruckig::<6, ThrowErrorHandler>::new(None, 0.001).calculate(&input, &mut trajectory);
        planned.is_ok().then(|| trajectory.get_duration())
    }
}

/// The largest speed, acceleration and jerk of this axis.
fn limits(axis: &AxisModel, peaks: &Peaks) -> [f64; 3] {
    [peaks.speed, peaks.acceleration, peaks.jerk].map(|peak| axis.max_speed * peak)
}
