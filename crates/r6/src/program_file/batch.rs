//! Cuts instructions into frames that controllers take.

use std::fmt;

use r6_proto::Request;
use r6_proto::dialect::Envelope;
use r6_proto::error::EncodeError;
use r6_proto::message::Instruction;

/// The longest AddRCC that controllers answer and execute, in bytes (inferred from the thresholds reported of unit A).
pub const MAX_FRAME_BYTES: usize = 2048;

/// The longest `packID` that is counted on, in digits.
const LONGEST_PACK_ID: &str = "18446744073709551615";

/// Instructions that go out in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// Whether they replace the list; else they are appended.
    pub replace: bool,
    /// The instructions.
    pub instructions: Vec<Instruction>,
}

impl Batch {
    /// The frame, with this correlation id.
    pub fn encode(&self, pack_id: &str) -> Result<Vec<u8>, EncodeError> {
        encode(self.replace, &self.instructions, pack_id)
    }
}

/// A step that the wire cannot carry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadStep {
    /// Which of all steps it is, counted from 1.
    pub step: usize,
    /// What is wrong with it.
    pub error: EncodeError,
}

impl fmt::Display for BadStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}: {}", self.step, self.error)
    }
}

impl std::error::Error for BadStep {}

/// Cuts lists so that no frame is too long: the first part of each replaces or appends as the whole does, the others append.
/// Every part can be encoded.
///
/// # Errors
/// [`BadStep`], wherever it stands: nothing is to be sent of a program of which the rest cannot be.
pub fn cut(batches: Vec<Batch>) -> Result<Vec<Batch>, BadStep> {
    let mut parts: Vec<Batch> = Vec::new();
    let mut step = 0;
    for batch in batches {
        let mut replace = batch.replace;
        let mut part: Vec<Instruction> = Vec::new();
        for instruction in batch.instructions {
            step += 1;
            part.push(instruction);
            let length =
                encode(replace, &part, LONGEST_PACK_ID).map_err(|error| BadStep { step, error })?.len();
            if part.len() > 1 && length > MAX_FRAME_BYTES {
                let next = part.split_off(part.len() - 1);
                parts.push(Batch { replace, instructions: std::mem::replace(&mut part, next) });
                replace = false;
            }
        }
        parts.push(Batch { replace, instructions: part });
    }
    Ok(parts)
}

fn encode(replace: bool, instructions: &[Instruction], pack_id: &str) -> Result<Vec<u8>, EncodeError> {
    let envelope = Envelope { pack_id: Some(pack_id), ..Envelope::default() };
    let mut frame = Vec::new();
    Request::AddRcc { empty_list: replace, instructions }.encode(&envelope, &mut frame)?;
    Ok(frame)
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::{Action, Coordinates, Manner, Move};

    use super::*;

    fn axis_move(degrees: f64) -> Instruction {
        let target = Coordinates::from_slice(&[degrees; 8]);
        let manner = Manner { speed: Some(10.0), ..Manner::default() };
        Instruction { oneshot: true, action: Action::AxisMove(Move { target, manner }) }
    }

    #[test]
    fn a_long_list_is_cut_and_nothing_of_it_is_lost() {
        let instructions: Vec<_> = (0..40).map(|n| axis_move(f64::from(n))).collect();
        let parts = cut(vec![Batch { replace: true, instructions: instructions.clone() }]).unwrap();
        assert!(parts.len() > 2, "{}", parts.len());
        let replace: Vec<_> = parts.iter().map(|part| part.replace).collect();
        assert_eq!(replace.iter().filter(|replace| **replace).count(), 1);
        assert_eq!(replace.first(), Some(&true));
        for part in &parts {
            assert!(part.encode(LONGEST_PACK_ID).unwrap().len() <= MAX_FRAME_BYTES);
        }
        // No frame has room for the first instruction of the next one.
        for pair in parts.windows(2) {
            let together = [pair[0].instructions.as_slice(), &pair[1].instructions[..1]].concat();
            assert!(encode(false, &together, LONGEST_PACK_ID).unwrap().len() > MAX_FRAME_BYTES);
        }
        let joined: Vec<_> = parts.into_iter().flat_map(|part| part.instructions).collect();
        assert_eq!(joined, instructions);
    }

    #[test]
    fn a_step_that_the_wire_cannot_carry_is_found_wherever_it_stands() {
        let instructions = vec![axis_move(1.0); 3];
        for bad in 0..instructions.len() {
            for count in bad + 1..=instructions.len() {
                let mut list = instructions[..count].to_vec();
                let Action::AxisMove(motion) = &mut list[bad].action else { panic!("a move") };
                motion.manner.speed = Some(0.0);
                let before = Batch { replace: true, instructions: vec![axis_move(1.0)] };
                let error = cut(vec![before, Batch { replace: false, instructions: list }]).unwrap_err();
                assert_eq!((error.step, error.error.field), (bad + 2, "speed"), "of {count}");
            }
        }
    }

    #[test]
    fn a_short_list_is_one_frame_and_an_empty_one_too() {
        for count in [0, 1, 3] {
            let batch = Batch { replace: true, instructions: vec![axis_move(1.0); count] };
            assert_eq!(cut(vec![batch.clone()]), Ok(vec![batch]));
        }
    }
}
