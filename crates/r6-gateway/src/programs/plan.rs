//! Plans a program: plays it on a virtual clock, and thins the samples of the arm.

use std::time::Duration;

use r6_api::gateway::{
    PlanEnd, PlanProblem, PlanProblemType, PlanSample, PlannedAxis, PlannedStep, ProgramPlan,
};
use r6_api::{Code, Unit};
use r6_motion::robot_model::AxisMotion;
use r6_motion::{PlanError, RobotModel};
use r6_plot::play::{self, Cell, Limits};
use r6_plot::{Ending, PlayError, Recording, Sample, Turn, words};
use r6_program::MotionProgram;
use r6_program::check::{AnyProgram, Checked};
use r6_proto::message::Action;

use super::check::{self, in_frames};
use crate::problem::Problem;

/// The most samples of an answer: two megabytes of JSON, more than a screen has columns.
pub const MAX_SAMPLES: usize = 5_000;

/// What is played at most: an hour of the program, some seconds of computing.
const LIMITS: Limits = Limits { longest: Duration::from_secs(3_600), instructions: 2_000, looks: 250_000 };

/// A step that is done within this time, in seconds, moves nothing. The shortest motion takes longer.
const NO_TIME: f64 = 0.000_5;

/// The number of the curve among the actions, and those of the other moves.
const CURVE_MOVE: i64 = 17;
const MOVES: [i64; 2] = [4, 10];

/// A program to plan.
#[derive(Clone, Debug)]
pub struct Wish {
    /// Its text.
    pub text: String,
    /// The arm.
    pub model: &'static RobotModel,
    /// Where the axes stand.
    pub from: Vec<f64>,
    /// In percent.
    pub global_speed: f64,
    /// The time between two samples.
    pub sample_ms: f64,
}

/// Plays a program.
///
/// # Errors
/// `bad_program`: it has mistakes, or it cannot be played. `bad_value`: the start cannot be reached.
pub fn plan(wish: Wish) -> Result<ProgramPlan, Problem> {
    let Wish { text, model, from, global_speed, sample_ms } = wish;
    let Checked { kind, program, mut remarks, .. } = check::read(&text);
    let bad_program = |message: String| Problem::new(Code::BadProgram, message);
    let program = program.map_err(|mistakes| bad_program(mistakes.to_string()))?;
    let cell = Cell { limits: LIMITS, ..Cell::of_model(model.clone(), global_speed, from) };
    let recording = match program {
        AnyProgram::Motion(motion) => {
            if let Some(wrong) = missing_axis(&motion, model) {
                return Err(bad_program(wrong));
            }
            if motion.lists.iter().flat_map(|list| &list.instructions).any(|step| !step.oneshot) {
                remarks.push("this list repeats until it is stopped; it was played once".to_owned());
            }
            play_motion(cell, &motion)
        }
        AnyProgram::Taught(program) => play::program(cell, &program, &mut |_| {}),
    };
    let recording = recording.map_err(|error| match error {
        PlayError::StartNotReached { alarm, why } => {
            let message = format!("the arm cannot stand at `from`: alarm {alarm}: {why}");
            Problem::new(Code::BadValue, message)
        }
        error => bad_program(error.to_string()),
    })?;
    let (sample_ms, samples) = thinned(&recording, sample_ms, model.axis_count());
    remarks.extend(still_moves(&recording));
    Ok(ProgramPlan {
        model: model.name.to_string(),
        kind: check::kind(kind),
        ended: ended(&recording.ending),
        duration_ms: ms(recording.duration),
        tool_path_mm: rounded(recording.tool_path),
        axes: axes(&recording, model),
        steps: steps(&recording),
        problems: passed_over(&recording).chain(problem(&recording)).collect(),
        sample_ms,
        samples,
        remarks,
    })
}

/// The first step that moves an axis which the model does not have: the player leaves such numbers out, and a
/// robot refuses them. Zeros are allowed, because people write all six.
fn missing_axis(motion: &MotionProgram, model: &RobotModel) -> Option<String> {
    let steps = motion.lists.iter().flat_map(|list| &list.instructions);
    (1..).zip(steps).find_map(|(number, step)| {
        let Action::AxisMove(to) = &step.action else { return None };
        let has = model.axis_count();
        let asked = to.manner.mask.map_or(to.target.given(), |mask| mask.and(to.target.given()));
        let axis = asked
            .axes()
            .find(|axis| axis.index() >= has && to.target.at(*axis).is_some_and(|place| place != 0.0))?;
        Some(format!("step {number} moves J{}, and {} has {has} axes", axis.index() + 1, model.name))
    })
}

fn play_motion(cell: Cell, motion: &MotionProgram) -> Result<Recording, PlayError> {
    let append = motion.lists.first().is_some_and(|list| !list.replace);
    play::motion(cell, &in_frames(motion), append, &mut |_| {})
}

fn ended(ending: &Ending) -> PlanEnd {
    match ending {
        Ending::Done => PlanEnd::Done,
        Ending::Alarm(_) => PlanEnd::Alarm,
        Ending::Waiting => PlanEnd::Waiting,
        Ending::TooLong => PlanEnd::TooLong,
        Ending::Endless => PlanEnd::Endless,
    }
}

fn axes(recording: &Recording, model: &RobotModel) -> Vec<PlannedAxis> {
    let axes = (1..).zip(recording.axes.iter().zip(model.drives()));
    axes.map(|(number, (axis, drive))| PlannedAxis {
        name: format!("J{number}"),
        unit: unit(drive.motion).to_owned(),
        lowest: rounded(axis.range.0),
        highest: rounded(axis.range.1),
        limits: [drive.soft.min, drive.soft.max],
        top_speed: rounded(axis.top_speed),
        full_speed: drive.max_speed,
    })
    .collect()
}

fn steps(recording: &Recording) -> Vec<PlannedStep> {
    let turns = recording.turns.iter().take(LIMITS.instructions);
    turns
        .map(|turn| PlannedStep {
            number: turn.step.number,
            text: turn.step.text.clone(),
            begin_ms: ms(turn.begin),
            end_ms: turn.end.map(ms),
        })
        .collect()
}

/// The unit of an axis: `deg` or `mm`.
pub fn unit(motion: AxisMotion) -> &'static str {
    match motion {
        AxisMotion::Turns => Unit::Degrees,
        AxisMotion::Slides => Unit::Millimetres,
    }
    .word()
}

/// Whether a step was done as soon as it began.
fn takes_no_time(turn: &Turn) -> bool {
    turn.end.is_some_and(|end| end - turn.begin < NO_TIME)
}

/// The curves that the controller passed over.
fn passed_over(recording: &Recording) -> impl Iterator<Item = PlanProblem> {
    let curves = recording.turns.iter().take(LIMITS.instructions);
    let curves = curves.filter(|turn| turn.step.action == Some(CURVE_MOVE) && takes_no_time(turn));
    curves.map(|turn| {
        let number = turn.step.number;
        PlanProblem {
            kind: PlanProblemType::PassedOver,
            step: Some(number),
            at_ms: ms(turn.begin),
            axis: None,
            alarm: None,
            message: format!(
                "step {number} is passed over: a curve begins where a straight move before it in the list ends"
            ),
        }
    })
}

/// What is to be said about the other moves that took no time.
fn still_moves(recording: &Recording) -> Option<String> {
    let is_still = |turn: &&Turn| {
        let is_move = turn.step.action.is_some_and(|action| MOVES.contains(&action));
        is_move && takes_no_time(turn)
    };
    let numbers: Vec<_> = recording.turns.iter().filter(is_still).map(|turn| turn.step.number).collect();
    let (first, more) = (numbers.first()?, numbers.len() - 1);
    let others = if more == 0 { String::new() } else { format!(" (and {more} more)") };
    Some(format!(
        "step {first}{others} moves nothing: the arm stands at its target, or a signal ends the move at once"
    ))
}

/// Why it does not run to its end.
fn problem(recording: &Recording) -> Option<PlanProblem> {
    let step = recording.ended_at.as_ref().map(|step| step.number);
    let message = words::trouble(recording)?;
    let (kind, axis, alarm, at) = match &recording.ending {
        Ending::Done => return None,
        Ending::Alarm(alarm) => {
            let (kind, axis) = match alarm.plan {
                Some(PlanError::OutsideLimits { axis, .. }) => {
                    (PlanProblemType::Limit, Some(axis.to_string()))
                }
                Some(PlanError::Singular { axis }) => (PlanProblemType::Singular, Some(axis.to_string())),
                Some(PlanError::Unreachable) => (PlanProblemType::OutOfReach, None),
                Some(PlanError::CurvePoints | PlanError::Speed | PlanError::NotFinite) | None => {
                    (PlanProblemType::Alarm, None)
                }
            };
            (kind, axis, Some(alarm.code.0), alarm.at)
        }
        Ending::Waiting => (PlanProblemType::Waiting, None, None, recording.duration),
        Ending::TooLong | Ending::Endless => (PlanProblemType::NoEnd, None, None, recording.duration),
    };
    let message = match (&recording.ending, step) {
        // The words are those of longer limits.
        (Ending::TooLong, Some(step)) => format!("step {step} is not done after an hour of the program"),
        (Ending::TooLong, None) => "the program is not done after an hour".to_owned(),
        _ => message,
    };
    Some(PlanProblem { kind, step, at_ms: ms(at), axis, alarm, message })
}

/// The samples of an answer, and the time between two of them in ms.
///
/// Kept are the first and the last, those where a step or a motion begins or ends, and of the others each
/// that is so long after the one before. If these are too many, the time is doubled until they fit. If the
/// begins and ends alone are too many, they are thinned as the others.
fn thinned(recording: &Recording, sample_ms: f64, axes: usize) -> (f64, Vec<PlanSample>) {
    let all = &recording.samples;
    let last = all.len().saturating_sub(1);
    let events = all.iter().filter(|sample| sample.is_event()).count();
    let keeps_events = events <= MAX_SAMPLES / 2;
    let mut every = sample_ms;
    loop {
        let mut before: Option<f64> = None;
        let mut kept = Vec::new();
        for (place, sample) in all.iter().enumerate() {
            let is_due = before.is_none_or(|before| sample.at * 1e3 - before >= every - 0.001);
            if is_due || place == last || keeps_events && sample.is_event() {
                kept.push(place);
                before = Some(sample.at * 1e3);
            }
        }
        if kept.len() <= MAX_SAMPLES {
            let samples = kept.into_iter().filter_map(|place| sample(all, place, axes));
            return (every, samples.collect());
        }
        every *= 2.0;
    }
}

/// One sample. The speed of the tool is that since the sample before, of those that were played.
fn sample(all: &[Sample], place: usize, axes: usize) -> Option<PlanSample> {
    let now = all.get(place)?;
    let before = place.checked_sub(1).and_then(|before| all.get(before));
    let moves = now.speeds.iter().any(|speed| *speed != 0.0);
    let tool_speed = before.filter(|before| moves && before.at < now.at).map_or(0.0, |before| {
        let squares = now.tool.iter().zip(before.tool).map(|(now, before)| (now - before) * (now - before));
        squares.sum::<f64>().sqrt() / (now.at - before.at)
    });
    let ([x, y, z], [u, v, w]) = (now.tool, now.orientation);
    Some(PlanSample {
        time_ms: ms(now.at),
        axes: now.axes.iter().take(axes).copied().map(rounded).collect(),
        axis_speeds: now.speeds.iter().take(axes).copied().map(rounded).collect(),
        pose: [x, y, z, u, v, w].map(rounded),
        tool_speed: rounded(tool_speed),
    })
}

/// Milliseconds, to a microsecond.
fn ms(seconds: f64) -> f64 {
    rounded(seconds * 1e3)
}

/// To a thousandth, so that numbers are short. A zero has no sign.
fn rounded(number: f64) -> f64 {
    (number * 1e3).round() / 1e3 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wish(text: &str) -> Wish {
        let model = super::super::model("BRTIRUS0707A").unwrap();
        let text = text.to_owned();
        Wish { text, model, from: Vec::new(), global_speed: 100.0, sample_ms: 20.0 }
    }

    const THERE_AND_BACK: &str = "[[instruction]]\ndo = \"axis-move\"\nto = [30, 0, 0, 0, 0, 0]\nspeed = 10\n\
                                  [[instruction]]\ndo = \"wait\"\nseconds = 5\n\
                                  [[instruction]]\ndo = \"axis-move\"\nto = [0, 0, 0, 0, 0, 0]\nspeed = 10\n";

    #[test]
    fn a_plan_is_what_the_virtual_controller_does() {
        let plan = plan(wish(THERE_AND_BACK)).unwrap();
        assert_eq!((plan.ended, plan.problems.len()), (PlanEnd::Done, 0));
        assert_eq!(plan.steps.iter().map(|step| step.number).collect::<Vec<_>>(), [1, 2, 3]);
        assert!(plan.steps[1].end_ms.unwrap() - plan.steps[1].begin_ms >= 5_000.0);
        assert_eq!((plan.axes[0].lowest, plan.axes[0].highest), (0.0, 30.0));
        let last = plan.samples.last().unwrap();
        assert!((last.time_ms - plan.duration_ms).abs() < 0.01 && last.axes[0] == 0.0, "{last:?}");
        // The rest has two ends and nothing between.
        let rests = plan.samples.windows(2).filter(|pair| pair[1].time_ms - pair[0].time_ms > 4_900.0);
        let rests: Vec<_> = rests.collect();
        assert_eq!(rests.len(), 1);
        assert!((rests[0][0].axes[0] - 30.0).abs() < 0.01 && (rests[0][1].axes[0] - 30.0).abs() < 0.01);
        // The tool moves on a circle about J1, as fast as its radius says.
        let fastest =
            plan.samples.iter().max_by(|a, b| a.axis_speeds[0].total_cmp(&b.axis_speeds[0])).unwrap();
        let radius = fastest.pose[0].hypot(fastest.pose[1]);
        let wanted = radius * fastest.axis_speeds[0].to_radians();
        assert!((fastest.tool_speed - wanted).abs() < 0.02 * wanted, "{fastest:?}");
        assert!(fastest.axis_speeds[0] <= 0.101 * plan.axes[0].full_speed);
    }

    #[test]
    fn a_step_that_moves_nothing_is_told() {
        // A curve behind an axis move is passed over by the controller.
        let curve = "[[instruction]]\ndo = \"axis-move\"\nto = [0, 10, -20, 0, -80, 0]\nspeed = 50\n\
                     [[instruction]]\ndo = \"curve-move\"\nthrough = [410, 30, 500, 180, 0, 180]\n\
                     to = [440, 0, 500, 180, 0, 180]\nspeed = 5\n";
        let planned = plan(wish(curve)).unwrap();
        let [problem] = &planned.problems[..] else { panic!("{:?}", planned.problems) };
        assert_eq!((problem.kind, problem.step), (PlanProblemType::PassedOver, Some(2)));
        assert!(planned.remarks.is_empty(), "{:?}", planned.remarks);
        let here = "[[instruction]]\ndo = \"axis-move\"\nto = [0, 0, 0, 0, 0, 0]\nspeed = 10\n";
        let planned = plan(wish(here)).unwrap();
        assert!(planned.problems.is_empty());
        assert!(planned.remarks[0].contains("step 1 moves nothing"), "{:?}", planned.remarks);
        assert!(plan(wish(THERE_AND_BACK)).unwrap().remarks.is_empty());
    }

    #[test]
    fn samples_are_as_dense_as_asked_for_until_there_are_too_many() {
        let coarse = plan(Wish { sample_ms: 100.0, ..wish(THERE_AND_BACK) }).unwrap();
        let fine = plan(Wish { sample_ms: 2.0, ..wish(THERE_AND_BACK) }).unwrap();
        assert_eq!((coarse.sample_ms, fine.sample_ms), (100.0, 2.0));
        assert!(coarse.samples.len() * 10 < fine.samples.len());
        assert_eq!(coarse.duration_ms, fine.duration_ms);
        let slow = THERE_AND_BACK.replace("speed = 10", "speed = 0.1");
        let long = plan(Wish { sample_ms: 2.0, ..wish(&slow) }).unwrap();
        assert!(long.samples.len() <= MAX_SAMPLES && long.samples.len() > MAX_SAMPLES / 4);
        assert!(long.sample_ms > 2.0 && long.ended == PlanEnd::Done, "{}", long.sample_ms);
    }

    #[test]
    fn limits_and_singularities_come_with_their_step_and_axis() {
        let step = |line: &str| format!("{THERE_AND_BACK}[[instruction]]\n{line}\n");
        let of = |line: &str| {
            let plan = plan(wish(&step(line))).unwrap();
            assert_eq!((plan.ended, plan.problems.len()), (PlanEnd::Alarm, 1), "{line}");
            plan.problems.into_iter().next().unwrap()
        };
        let limit = of("do = \"axis-move\"\nto = [0, 0, 0, 0, 999, 0]\nspeed = 5");
        assert_eq!(
            (limit.kind, limit.step, limit.axis.as_deref()),
            (PlanProblemType::Limit, Some(4), Some("J5"))
        );
        assert_eq!(limit.alarm, Some(134));
        let far = of("do = \"linear-move\"\nto = [9000, 0, 0]\nspeed = 5");
        assert_eq!((far.kind, far.step, far.axis), (PlanProblemType::OutOfReach, Some(4), None));
        let waits = plan(wish("[[instruction]]\ndo = \"wait\"\npoint = \"X010\"\n")).unwrap();
        assert_eq!(waits.ended, PlanEnd::Waiting);
        assert_eq!((waits.problems[0].kind, waits.problems[0].step), (PlanProblemType::Waiting, Some(1)));
    }

    #[test]
    fn a_taught_program_is_played_once_and_one_without_an_end_is_given_up() {
        let taught = "[[step]]\ndo = \"label\"\nname = \"a\"\n\
                      [[step]]\ndo = \"axis-move\"\nto = [10]\nspeed = 50\n\
                      [[step]]\ndo = \"axis-move\"\nto = [0]\nspeed = 50\n";
        let once = plan(wish(taught)).unwrap();
        assert_eq!((once.ended, once.kind), (PlanEnd::Done, r6_api::gateway::ProgramType::Taught));
        let endless = plan(wish(&format!("{taught}[[step]]\ndo = \"jump\"\nto = \"a\"\n"))).unwrap();
        assert!(matches!(endless.ended, PlanEnd::Endless | PlanEnd::TooLong), "{:?}", endless.ended);
        assert_eq!(endless.problems[0].kind, PlanProblemType::NoEnd);
        assert!(endless.samples.len() <= MAX_SAMPLES && endless.steps.len() <= LIMITS.instructions);
    }

    #[test]
    fn a_step_that_moves_an_axis_which_the_model_lacks_is_told() {
        let scara = |text: &str| Wish { model: super::super::model("GENERIC-SCARA").unwrap(), ..wish(text) };
        let step = |to: &str| format!("[[instruction]]\ndo = \"axis-move\"\nto = {to}\nspeed = 10\n");
        let six = step("[5, 0, 0, 0, 0, 0]") + &step("[5, 0, 0, 0, -30, 0]");
        let problem = plan(scara(&six)).unwrap_err();
        assert_eq!(problem.code, Code::BadProgram);
        assert_eq!(problem.message, "step 2 moves J5, and GENERIC-SCARA has 4 axes");
        assert_eq!(plan(scara(&step("[5, 0, 0, 0, 0, 0]"))).unwrap().ended, PlanEnd::Done);
        assert_eq!(plan(wish(&six)).unwrap().ended, PlanEnd::Done);
    }

    #[test]
    fn what_cannot_be_played_is_told() {
        let code = |wish: Wish| plan(wish).unwrap_err().code;
        assert_eq!(code(wish("[[instruction]]\ndo = \"jump\"")), Code::BadProgram);
        assert_eq!(code(wish("[[step]]\ndo = \"call\"\nprogram = \"other\"")), Code::BadProgram);
        assert_eq!(code(Wish { from: vec![999.0], ..wish(THERE_AND_BACK) }), Code::BadValue);
        let many = "[[instruction]]\ndo = \"workbench\"\nnumber = 1\n".repeat(LIMITS.instructions + 1);
        assert_eq!(code(wish(&many)), Code::BadProgram);
    }
}
