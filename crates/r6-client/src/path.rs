//! A path in the form that a controller takes: cut into frames, and the progress of the arm along it.

pub(crate) mod pace;
pub(crate) mod place;
pub(crate) mod progress;
pub(crate) mod track;
pub(crate) mod way;
pub(crate) mod whole;

use std::ops::Range;

use r6_proto::dialect::Addressing;
use r6_proto::error::EncodeError;
use r6_proto::message::Instruction;
use r6_proto::request::Request;

use crate::moves::step_error::StepError;
use crate::settings::{LONGEST_PACK_ID, RobotSettings};

/// The bytes of an instruction within a list.
pub(crate) fn encoded_bytes(instruction: &Instruction) -> Result<usize, EncodeError> {
    let with = frame(&Addressing::default(), false, std::slice::from_ref(instruction))?;
    let without = frame(&Addressing::default(), false, &[])?;
    Ok(with.len() - without.len())
}

/// The bytes of an AddRCC.
pub(crate) fn frame(
    addressing: &Addressing<'_>,
    replace: bool,
    instructions: &[Instruction],
) -> Result<Vec<u8>, EncodeError> {
    let mut frame = Vec::new();
    Request::AddRcc { empty_list: replace, instructions }.encode(addressing, &mut frame)?;
    Ok(frame)
}

/// Cuts a path into frames: as many instructions each as fit into the longest frame, at most `most`, in
/// order, without omitting any. Each step in `starts`, counted from 0 and in order, begins a frame.
///
/// # Errors
/// [`StepError`] for a step that cannot be encoded, or that is too long for a frame of its own.
pub(crate) fn cut(
    steps: &[Instruction],
    starts: &[usize],
    settings: &RobotSettings,
    most: usize,
) -> Result<Vec<Range<usize>>, StepError> {
    let around = frame(&settings.addressing(LONGEST_PACK_ID), true, &[])
        .map_err(|error| StepError::of(0, &error))?
        .len();
    let mut frames: Vec<Range<usize>> = Vec::new();
    let mut bytes = 0;
    for (at, step) in steps.iter().enumerate() {
        let own = encoded_bytes(step).map_err(|error| StepError::of(at + 1, &error))?;
        if around + own > settings.max_frame_bytes {
            let wanted =
                "short enough for a frame of its own: the longest frame of the settings is too short";
            return Err(StepError { step: at + 1, field: "instructions", wanted, nearest: None });
        }
        // Including a comma before it.
        bytes += own + 1;
        match frames.last_mut() {
            Some(frame)
                if frame.len() < most
                    && bytes <= settings.max_frame_bytes
                    && starts.binary_search(&at).is_err() =>
            {
                frame.end = at + 1;
            }
            Some(_) | None => {
                frames.push(at..at + 1);
                bytes = around + own;
            }
        }
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use r6_proto::message::Action;
    use r6_proto::message::instruction::{Coordinates, Manner, Move, Output, OutputKind, Wait};
    use r6_proto::message::instruction::{WaitCondition, WaitSource};

    use super::*;

    fn any_step() -> impl Strategy<Value = Instruction> {
        let axes = prop::collection::vec(-400.0..400.0_f64, 1..=8);
        let moves = (axes, 1_u32..=1000, any::<bool>()).prop_map(|(axes, speed, line)| {
            let speed = Some(f64::from(speed) / 10.0);
            let motion = Move {
                target: Coordinates::from_slice(&axes),
                manner: Manner { speed, ..Manner::default() },
            };
            if line { Action::LinearMove(motion) } else { Action::AxisMove(motion) }
        });
        let outputs = (0_u8..=32, any::<bool>())
            .prop_map(|(point, on)| Action::Output(Output { kind: OutputKind::Y, point, on, delay: 0.0 }));
        let waits = (0_u32..1000).prop_map(|tenths| {
            let limit = f64::from(tenths) / 10.0;
            let (source, condition) = (WaitSource::Time, WaitCondition::Off);
            Action::Wait(Wait { source, condition, limit, unlimited: false })
        });
        prop_oneof![4 => moves, 1 => outputs, 1 => waits]
            .prop_map(|action| Instruction { oneshot: true, action })
    }

    proptest! {
        #[test]
        fn no_step_is_lost_doubled_or_moved_and_every_frame_is_within_its_limits(
            steps in prop::collection::vec(any_step(), 0..200),
            starts in prop::collection::btree_set(0_usize..250, 0..5),
            most in 1_usize..12,
            max_frame_bytes in 700_usize..3000,
        ) {
            let settings = RobotSettings { max_frame_bytes, ..RobotSettings::default() };
            let starts: Vec<_> = starts.into_iter().collect();
            let frames = cut(&steps, &starts, &settings, most).unwrap();
            let joined: Vec<Instruction> =
                frames.iter().flat_map(|frame| &steps[frame.clone()]).copied().collect();
            prop_assert_eq!(joined, steps.clone());
            for range in &frames {
                prop_assert!((1..=most).contains(&range.len()));
                let bytes =
                    frame(&settings.addressing(LONGEST_PACK_ID), true, &steps[range.clone()]).unwrap().len();
                prop_assert!(bytes <= max_frame_bytes, "{} bytes", bytes);
                prop_assert!(!starts.iter().any(|at| (range.start + 1..range.end).contains(at)));
            }
            // No frame has room for the first step of the next one.
            for pair in frames.windows(2) {
                let together = &steps[pair[0].start..=pair[1].start];
                let bytes = frame(&settings.addressing(LONGEST_PACK_ID), true, together).unwrap().len();
                let starts = starts.contains(&pair[1].start);
                prop_assert!(together.len() > most || bytes > max_frame_bytes || starts);
            }
        }
    }

    #[test]
    fn what_fits_no_frame_and_what_the_wire_cannot_carry_is_named() {
        let target = Coordinates::from_slice(&[1.0; 8]);
        let step = |speed| Instruction {
            oneshot: true,
            action: Action::AxisMove(Move {
                target,
                manner: Manner { speed: Some(speed), ..Manner::default() },
            }),
        };
        let short = RobotSettings { max_frame_bytes: 200, ..RobotSettings::default() };
        assert_eq!(cut(&[step(1.0)], &[], &short, 8).unwrap_err().field, "instructions");
        let error = cut(&[step(1.0), step(101.0)], &[], &RobotSettings::default(), 8).unwrap_err();
        assert_eq!((error.step, error.field), (2, "speed"));
    }
}
