//! Errors in a step of a motion, in words.

use std::fmt;

use r6_proto::error::EncodeError;
use r6_proto::grid::Nearest;

/// An error in a step of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepError {
    /// The step, counted from 1; 0 if the error concerns the whole motion.
    pub step: usize,
    /// The name of the field on the wire; for an option, the name of the option.
    pub field: &'static str,
    /// The condition that the field has to meet.
    pub wanted: &'static str,
    /// The nearest values that can be sent, if the value lies between two of them.
    pub nearest: Option<Nearest>,
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.step {
            0 => f.write_str("the motion: ")?,
            step => write!(f, "step {step}: ")?,
        }
        match in_words(self.field) {
            Some(words) => write!(f, "{words} has to be {}", self.wanted)?,
            None => write!(f, "`{}` has to be {}", self.field, self.wanted)?,
        }
        match self.nearest {
            Some(nearest) => write!(f, "; nearest: {nearest}"),
            None => Ok(()),
        }
    }
}

/// The name of a wire field in plain words; `None` if its own name is used.
fn in_words(field: &str) -> Option<&'static str> {
    Some(match field {
        "m0" => "J1 (X of a pose)",
        "m1" => "J2 (Y of a pose)",
        "m2" => "J3 (Z of a pose)",
        "m3" => "J4 (U of a pose)",
        "m4" => "J5 (V of a pose)",
        "m5" => "J6 (W of a pose)",
        "m6" => "J7",
        "m7" => "J8",
        "ckStatus" => "the axes that move",
        "smooth" => "the blend",
        _ => return None,
    })
}

impl std::error::Error for StepError {}

impl StepError {
    pub(crate) fn of(step: usize, error: &EncodeError) -> Self {
        Self { step, field: error.field, wanted: error.wanted, nearest: error.nearest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_the_wire_are_told_in_words() {
        let said = |field| StepError { step: 2, field, wanted: "1", nearest: None }.to_string();
        let axes = ["J1 (X of", "J2 (Y of", "J3 (Z of", "J4 (U of", "J5 (V of", "J6 (W of", "J7 ", "J8 "];
        for (field, words) in ["m0", "m1", "m2", "m3", "m4", "m5", "m6", "m7"].into_iter().zip(axes) {
            assert!(said(field).starts_with(&format!("step 2: {words}")), "{}", said(field));
        }
        assert_eq!(said("ckStatus"), "step 2: the axes that move has to be 1");
        assert_eq!(said("smooth"), "step 2: the blend has to be 1");
        assert_eq!(said("speed"), "step 2: `speed` has to be 1");
    }
}
