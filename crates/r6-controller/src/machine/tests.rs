//! Cases that no frame can cause: no command defines a workbench, so every workbench that a client can name
//! is the base.

use r6_motion::Turning;
use r6_motion::kinematics::forward;
use r6_proto::alarm::AlarmCode;
use r6_proto::message::instruction::{BlendLevel, Coordinates, Manner, Move, Workbench};
use r6_proto::message::{Action, Instruction};

use super::*;
use crate::profile::ReplaceInMotion;

/// Where workbench 2 is.
const BENCH: [f64; 3] = [60.0, -40.0, 25.0];

/// The arm with its tool down, and a workbench 2 off the base.
fn machine() -> Machine {
    let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
    let mut machine = Machine::new(ControllerSettings::new(Profile::hc1(), model), Instant::ORIGIN);
    let [x, y, z] = BENCH;
    let offset = [x, y, z, 0.0, 0.0, 0.0];
    let frame = Frame::at(&Pose::from_components(offset)).unwrap();
    machine.frames.benches.insert(2, Placed { offset, frame });
    machine.axes = Axes::of_arm([0.0, -10.0, 10.0, 0.0, -90.0, 0.0]).unwrap();
    machine
}

/// The pose of the tool in the base frame.
fn tool_at(machine: &Machine) -> Pose {
    forward(&machine.model, &machine.motion().axes, &Frame::identity())
}

fn once(action: Action) -> Instruction {
    Instruction { oneshot: true, action }
}

/// A line to a pose, given in the work frame `coord`, or in the one in use.
fn line(to: Pose, coord: Option<u32>, blend: u8) -> Instruction {
    let manner = Manner { speed: Some(5.0), smooth: BlendLevel::new(blend), coord, ..Manner::default() };
    once(Action::LinearMove(Move { target: Coordinates::from_slice(&to.components()), manner }))
}

/// A place of the base frame, in coordinates of workbench 2.
fn on_bench_2(place: Pose) -> Pose {
    let [x, y, z] = BENCH;
    Pose { x: place.x - x, y: place.y - y, z: place.z - z, ..place }
}

fn pass(machine: &mut Machine, seconds: f64) {
    machine.advance(machine.now + Duration::from_secs_f64(seconds));
}

#[track_caller]
fn assert_at(machine: &Machine, place: Pose) {
    let here = tool_at(machine);
    for (found, wanted) in here.components().into_iter().zip(place.components()).take(3) {
        assert!((found - wanted).abs() < 1e-3, "the tool is at {here:?}, not at {place:?}");
    }
    assert_eq!((machine.alarm, machine.list.len()), (AlarmCode::NONE, 0));
}

#[test]
fn a_step_is_told_in_its_own_workbench_whichever_is_in_use() {
    for (in_use, coord, told_on) in
        [(0, Some(2), 2), (2, Some(0), 0), (2, None, 2), (0, None, 0), (0, Some(5), 0)]
    {
        let mut machine = machine();
        machine.frames.bench = in_use;
        let from = tool_at(&machine);
        let place = Pose { y: from.y + 50.0, ..from };
        let told = if told_on == 2 { on_bench_2(place) } else { place };
        machine.add_instructions(true, &[line(told, coord, 0)]).unwrap();
        pass(&mut machine, 10.0);
        assert_at(&machine, place);
        assert_eq!(machine.frames.bench, in_use, "only the step is told in another");
    }
}

#[test]
fn a_workbench_between_two_lines_counts_for_the_second_round_the_corner() {
    let mut machine = machine();
    let from = tool_at(&machine);
    let (corner, end) = (Pose { y: from.y + 50.0, ..from }, Pose { y: from.y + 100.0, ..from });
    let switch = once(Action::Workbench(Workbench { id: 2 }));
    let steps = [line(corner, None, 9), switch, line(on_bench_2(end), None, 0)];
    machine.add_instructions(true, &steps).unwrap();
    let mut rounded = false;
    for _ in 0..1000 {
        pass(&mut machine, 0.01);
        rounded |= matches!(&machine.activity, Activity::Moving(run) if run.joined > 0);
    }
    assert!(rounded, "the second line begins at the corner");
    assert_at(&machine, end);
}

/// A pass is timed from the take-over, however long the list before it ran.
#[test]
fn a_list_that_takes_over_begins_a_pass_of_its_own() {
    let mut machine = machine();
    machine.profile.replace_in_motion = ReplaceInMotion::TakeOver;
    // W reads ±180 here. Rounding decides the sign. With `AsTold`, the other sign would be a whole turn.
    machine.profile.turning = Turning::Shortest;
    let from = tool_at(&machine);
    machine.add_instructions(true, &[line(Pose { y: from.y + 100.0, ..from }, None, 0)]).unwrap();
    pass(&mut machine, 0.5);
    machine.add_instructions(true, &[line(Pose { y: from.y + 50.0, ..from }, None, 0)]).unwrap();
    assert!(machine.is_moving());
    assert_eq!((machine.cycle.started, machine.cycle.pass_started), (Some(machine.now), machine.now));
}

/// A machine has to be able to read what it saves: no step can use a workbench that cannot be defined.
#[test]
fn a_workbench_that_cannot_be_defined_raises_an_alarm() {
    for (id, alarm) in [(MAX_FRAMES - 1, 0), (MAX_FRAMES, 27), (u32::MAX, 27)] {
        let mut machine = machine();
        machine.add_instructions(true, &[once(Action::Workbench(Workbench { id }))]).unwrap();
        pass(&mut machine, 1.0);
        assert_eq!(machine.alarm, alarm, "workbench {id}");
        assert_eq!(machine.frames.bench, if alarm == 0 { id } else { 0 });
        SavedState::from_json(&machine.saved().to_json()).unwrap();
    }
}

#[test]
fn of_too_many_timed_outputs_the_earliest_goes_back_at_once() {
    let mut machine = machine();
    let points: Vec<OutputPoint> =
        (0..=MAX_PULSES).map(|at| OutputPoint::M(0, u8::try_from(at).unwrap())).collect();
    // The third is due first.
    let due = |at: usize| machine.now + Duration::from_secs(if at == 2 { 1 } else { 10 });
    let pulses: Vec<_> = points.iter().enumerate().map(|(at, point)| (due(at), *point)).collect();
    for (due, point) in pulses {
        machine.pulse(due, point, false);
    }
    let waiting: Vec<OutputPoint> = machine.pulses.iter().map(|(_, point, _)| *point).collect();
    assert_eq!(waiting.len(), MAX_PULSES);
    let gone: Vec<_> = points.into_iter().filter(|point| !waiting.contains(point)).collect();
    assert_eq!(gone, [OutputPoint::M(0, 2)]);
}
