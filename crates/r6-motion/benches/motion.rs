//! Inverse kinematics, planning and evaluation, each compared with a library that does the same, called
//! directly.
//!
//! Only the ratios matter (`tools/ratios` prints them), because times differ between machines. Every case
//! goes through 1 024 different inputs in shuffled order. Before any timing both sides compute all of them,
//! and have to agree where they can. They take turns, a slice of a quarter of a second each, in fifteen
//! rounds.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::UnitQuaternion;
use r6_motion::kinematics::{all_solutions, forward};
use r6_motion::speed_profile::Profile;
use r6_motion::{
    Axes, Conditions, Frame, Frames, Geometry, Move, MoveMask, MoveSpeed, MoveTarget, Movement, Pose, Ramps,
    RobotModel, Turning,
};
use rs_opw_kinematics::glam::{DQuat, DVec3};
use rs_opw_kinematics::kinematic_traits::{Kinematics, Pose as SolverPose};
use rs_opw_kinematics::kinematics_impl::OPWKinematics;
use rs_opw_kinematics::parameters::opw_kinematics::Parameters;
use rsruckig::prelude::*;

/// How many inputs each case has: enough that a branch predictor cannot learn them by heart.
const CASES: usize = 1024;

/// How often the contenders take turns.
const ROUNDS: usize = 15;

const GLOBAL: f64 = 0.5;
const PERCENT: f64 = 60.0;

/// A multiplicative generator: it gives the same numbers in every run.
struct Random(u64);

impl Random {
    /// A number between 0 and 1.
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Axes anywhere in the soft limits.
    fn axes(&mut self) -> Axes {
        let arm = model().axes.map(|axis| axis.soft.min + self.part() * (axis.soft.max - axis.soft.min));
        Axes::of_arm(arm).expect("soft limits are axis positions")
    }
}

fn model() -> &'static RobotModel {
    RobotModel::named("BRTIRUS0707A").expect("a model that comes with the crate")
}

/// The work of one contender for the input with this number. The number it returns depends on the result, so
/// that the compiler removes nothing.
type Work<'a> = Box<dyn FnMut(usize) -> f64 + 'a>;

/// Lets the contenders take turns.
fn compare(criterion: &mut Criterion, name: &str, contenders: &mut [(&str, Work<'_>)]) {
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10).nresamples(1001).warm_up_time(Duration::from_millis(50));
    group.measurement_time(Duration::from_millis(200));
    for round in 0..ROUNDS {
        for (contender, work) in contenders.iter_mut() {
            let mut turn = 0_usize;
            group.bench_function(BenchmarkId::new(*contender, round), |bencher| {
                bencher.iter(|| {
                    // The step is odd, so every input comes once in each pass.
                    turn = (turn + 389) % CASES;
                    work(black_box(turn))
                });
            });
        }
    }
    group.finish();
}

/// The solver with the numbers of our model.
fn bare_solver() -> OPWKinematics {
    let Geometry::SixAxis(g) = &model().geometry else { panic!("a six-axis arm") };
    let mut offsets = model().axes.map(|axis| -axis.offset.to_radians());
    offsets[2] -= std::f64::consts::FRAC_PI_2;
    let sign_corrections = model().axes.map(|axis| axis.sign);
    OPWKinematics::new(Parameters {
        a1: g.a1,
        a2: -g.a3,
        b: g.b,
        c1: g.d1,
        c2: g.a2,
        c3: g.d4,
        c4: g.d6 + g.tool_offset,
        offsets,
        sign_corrections,
        dof: 6,
    })
}

fn solver_pose(pose: &Pose) -> SolverPose {
    let at = pose.to_isometry().expect("a pose of finite numbers");
    let (t, r): (_, UnitQuaternion<f64>) = (at.translation.vector, at.rotation);
    SolverPose::from_parts(DVec3::new(t.x, t.y, t.z), DQuat::from_xyzw(r.i, r.j, r.k, r.w))
}

fn same_arm(ours: &Axes, theirs: &[f64; 6]) -> bool {
    ours.arm().iter().zip(theirs).all(|(ours, theirs)| {
        let turn = (ours - theirs.to_degrees()).rem_euclid(360.0);
        turn.min(360.0 - turn) < 1e-6
    })
}

/// Whether whole turns can bring each axis into its soft limits.
fn allowed(arm: &[f64; 6]) -> bool {
    arm.iter().zip(&model().axes).all(|(radians, axis)| {
        [-360.0, 0.0, 360.0].iter().any(|turn| axis.soft.contains(radians.to_degrees() + turn))
    })
}

/// All configurations of the arm for a pose, nearest first: ours with limits, whole turns and degrees, theirs
/// without.
fn inverse(criterion: &mut Criterion) {
    let (mut random, tool, solver) = (Random(1), Frame::identity(), bare_solver());
    let nears: Vec<Axes> = (0..CASES).map(|_| random.axes()).collect();
    let poses: Vec<Pose> = (0..CASES).map(|_| forward(model(), &random.axes(), &tool)).collect();
    let their_poses: Vec<SolverPose> = poses.iter().map(solver_pose).collect();
    let their_nears: Vec<[f64; 6]> = nears.iter().map(|near| near.arm().map(f64::to_radians)).collect();
    for at in 0..CASES {
        let ours = all_solutions(model(), &poses[at], &tool, &nears[at]);
        let theirs = solver.inverse_continuing(&their_poses[at], &their_nears[at]);
        assert!(
            ours.iter().all(|arm| theirs.iter().any(|other| same_arm(arm, other))),
            "{ours:?} {theirs:?}"
        );
        assert_eq!(ours.len(), theirs.iter().filter(|arm| allowed(arm)).count(), "{ours:?} {theirs:?}");
        assert!(!ours.is_empty());
    }
    let mut contenders: [(&str, Work<'_>); 2] = [
        (
            "r6",
            Box::new(|at| {
                all_solutions(model(), &poses[at], &tool, &nears[at]).iter().map(|arm| arm.arm()[0]).sum()
            }),
        ),
        (
            "rs-opw-kinematics",
            Box::new(|at| {
                solver.inverse_continuing(&their_poses[at], &their_nears[at]).iter().map(|arm| arm[0]).sum()
            }),
        ),
    ];
    compare(criterion, "inverse kinematics, all solutions", &mut contenders);
}

/// Our moves, and for rsruckig the same axis moves under the limits of our plan.
struct Moves {
    orders: Vec<(Axes, Move)>,
    inputs: Vec<InputParameter<6>>,
    conditions: Conditions,
}

impl Moves {
    fn axis() -> Self {
        let mut random = Random(2);
        let order = |random: &mut Random| (random.axes(), order(MoveTarget::Axes(random.axes())));
        Self::of((0..CASES).map(|_| order(&mut random)).collect())
    }

    /// Lines of up to 200 mm that can be planned.
    fn linear() -> Self {
        let mut random = Random(3);
        let line = |random: &mut Random| loop {
            let start = random.axes();
            let from = forward(model(), &start, &Frame::identity());
            let [x, y, z] = [from.x, from.y, from.z].map(|at| at + 230.0 * (random.part() - 0.5));
            let order = order(MoveTarget::Line(Pose { x, y, z, ..from }));
            if Movement::plan(model(), &start, &order, &conditions()).is_ok() {
                break (start, order);
            }
        };
        Self::of((0..CASES).map(|_| line(&mut random)).collect())
    }

    fn of(orders: Vec<(Axes, Move)>) -> Self {
        let conditions = conditions();
        let input = |(start, order): &(Axes, Move)| {
            let movement = Movement::plan(model(), start, order, &conditions).expect("it was possible");
            let path = movement.path();
            let top = (PERCENT / 100.0 * GLOBAL).min(path.top_speed());
            let profile = Profile::plan(path.length(), top, conditions.ramps).expect("a profile");
            let peaks = profile.peaks();
            let mut input = InputParameter::<6>::new(None);
            for (n, axis) in model().axes.iter().enumerate() {
                input.current_position[n] = start.arm()[n];
                input.target_position[n] = movement.end().arm()[n];
                input.max_velocity[n] = axis.max_speed * peaks.speed;
                input.max_acceleration[n] = axis.max_speed * peaks.acceleration;
                input.max_jerk[n] = axis.max_speed * peaks.jerk;
            }
            input
        };
        let inputs = orders.iter().map(input).collect();
        Self { orders, inputs, conditions }
    }

    fn ours(&self, at: usize) -> Movement {
        let (start, order) = &self.orders[at];
        Movement::plan(model(), start, order, &self.conditions).expect("it was possible")
    }

    fn theirs(&self, at: usize) -> Trajectory<6> {
        let mut trajectory = Trajectory::new(None);
        let mut planner = Ruckig::<6, ThrowErrorHandler>::new(None, 0.001);
        planner.calculate(&self.inputs[at], &mut trajectory).expect("it was possible");
        trajectory
    }

    /// Checks that both begin and end at the same positions. On axis moves theirs takes no longer, and ours
    /// not much longer.
    fn agree(&self, straight: bool) {
        for at in 0..CASES {
            let (ours, theirs) = (self.ours(at), self.theirs(at));
            let (slow, fast) = (ours.duration(), theirs.get_duration());
            assert!(!straight || (fast <= slow * (1.0 + 1e-9) && slow < 1.5 * fast), "{slow} s, {fast} s");
            for (mine, yours) in [(0.0, 0.0), (slow, fast)] {
                let state = evaluated(&theirs, yours);
                for (a, b) in ours.state_at(mine).axes.arm().into_iter().zip(state.iter()) {
                    assert!((a - b).abs() < 1e-6, "{a} {b}");
                }
            }
        }
    }
}

fn order(target: MoveTarget) -> Move {
    Move { target, mask: MoveMask::SIX, speed: MoveSpeed::PercentOfMax(PERCENT), delay: 0.0 }
}

fn conditions() -> Conditions {
    Conditions {
        global: GLOBAL,
        ramps: Ramps::default(),
        frames: Frames::default(),
        turning: Turning::Shortest,
    }
}

/// The axes according to rsruckig, which also computes speeds and accelerations here.
fn evaluated(trajectory: &Trajectory<6>, time: f64) -> DataArrayOrVec<f64, 6> {
    let [mut position, mut speed, mut acceleration] = [(); 3].map(|()| DataArrayOrVec::new(None, 0.0));
    let (at, by, of) = (&mut Some(&mut position), &mut Some(&mut speed), &mut Some(&mut acceleration));
    trajectory.at_time(time, at, by, of, &mut None, &mut None);
    black_box((speed, acceleration));
    position
}

/// Our plan compared with one of rsruckig for six axes from the same start to the same target.
fn plan(criterion: &mut Criterion) {
    for (name, moves, straight) in
        [("plan an axis move", Moves::axis(), true), ("plan a line", Moves::linear(), false)]
    {
        moves.agree(straight);
        let mut planner = Ruckig::<6, ThrowErrorHandler>::new(None, 0.001);
        let mut trajectory = Trajectory::new(None);
        let mut contenders: [(&str, Work<'_>); 2] = [
            ("r6", Box::new(|at| black_box(moves.ours(at)).duration())),
            (
                "rsruckig",
                Box::new(|at| {
                    planner.calculate(&moves.inputs[at], &mut trajectory).expect("it was possible");
                    trajectory.get_duration()
                }),
            ),
        ];
        compare(criterion, name, &mut contenders);
    }
}

/// Our state (axes, speeds and pose) compared with one of rsruckig (axes, speeds and accelerations).
fn evaluate(criterion: &mut Criterion) {
    for (name, moves) in [("a state of an axis move", Moves::axis()), ("a state of a line", Moves::linear())]
    {
        let mut random = Random(4);
        let ours: Vec<Movement> = (0..CASES).map(|at| moves.ours(at)).collect();
        let theirs: Vec<Trajectory<6>> = (0..CASES).map(|at| moves.theirs(at)).collect();
        let parts: Vec<f64> = (0..CASES).map(|_| random.part()).collect();
        let our_times: Vec<f64> =
            parts.iter().zip(&ours).map(|(part, ours)| part * ours.duration()).collect();
        let their_times: Vec<f64> =
            parts.iter().zip(&theirs).map(|(part, theirs)| part * theirs.get_duration()).collect();
        let mut contenders: [(&str, Work<'_>); 2] = [
            ("r6", Box::new(|at| black_box(ours[at].state_at(our_times[at])).axes.arm()[0])),
            ("rsruckig", Box::new(|at| black_box(evaluated(&theirs[at], their_times[at]))[0])),
        ];
        compare(criterion, name, &mut contenders);
    }
}

criterion_group!(benches, inverse, plan, evaluate);
criterion_main!(benches);
