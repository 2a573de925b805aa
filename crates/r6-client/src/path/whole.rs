//! The statement "a list that was sent as a whole was carried out".
//!
//! Such a list is appended behind others, or repeats. The client does not know what else is in the
//! controller's list, so the length of that list does not tell how far this one is. The client can only see
//! where the arm stands when nothing is left.

use std::time::Duration;

use crate::done::EndProof;
use crate::evidence::Sample;
use crate::path::place::Place;
use crate::path::progress::PathProgress;
use crate::path::track::{Track, standing_time};
use crate::stream::error::{Cause, NotProved};

impl PathProgress {
    /// Judges one look at an arm at rest, and returns the proof that the appended list was carried out.
    /// `moved`: the arm was seen to move since the list was sent.
    ///
    /// An "ok" proves nothing, and neither does an empty list: controllers drop instructions that they
    /// answered with ok, and another client may have cleared the list.
    ///
    /// # Errors
    /// [`Cause::Elsewhere`] if the arm stands elsewhere, [`Cause::NotProved`] if it cannot be judged.
    pub fn carried_out(&self, sample: &Sample, moved: bool) -> Result<EndProof, Cause> {
        let (place, watched) = self.track().end_of(self.accepted);
        if place == Place::Same {
            return Ok(EndProof::AtRest);
        }
        if !place.is_compared() {
            return Err(Cause::NotProved(NotProved::NoTarget));
        }
        match place.missed(sample) {
            None if was_gone(self.track(), self.accepted, &place, sample, moved) => Ok(EndProof::Reached),
            None => Err(Cause::NotProved(NotProved::WasThere)),
            Some(missed) if watched && missed.found.is_some() => {
                Err(Cause::NotProved(NotProved::MayBeCut(missed)))
            }
            Some(missed) => Err(Cause::Elsewhere(missed)),
        }
    }

    /// How long the steps let the arm stand before its first move; `None`: for ever.
    pub fn lead_time(&self) -> Option<Duration> {
        let steps = self.track().steps();
        let first = steps.iter().position(|step| Place::of(&step.action) != Place::Same);
        let until = first.map_or(steps.len(), |first| first + 1);
        steps
            .iter()
            .take(until)
            .try_fold(Duration::ZERO, |sum, step| Some(sum.saturating_add(standing_time(step)?)))
    }
}

/// Whether an arm at the end of the list must have moved there: it was elsewhere before, or was seen to move,
/// or no step leads away.
fn was_gone(track: &Track, accepted: usize, end: &Place, now: &Sample, moved: bool) -> bool {
    let before = track.begun_at();
    // If the arm was already moving, the earlier contents of the list may move it.
    let stood = before.moving == Some(false) && before.list_length.is_none_or(|length| length == 0);
    let was_elsewhere = end.missed(before).is_some_and(|missed| missed.found.is_some());
    let leads_away = track.places(0..accepted).iter().any(|place| match place {
        Place::Same => false,
        place => !place.is_compared() || place.missed(now).is_some(),
    });
    was_elsewhere || stood && moved || !leads_away
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::{Coordinates, Manner, Move, StopOnSignal, Wait, Workbench};
    use r6_proto::message::instruction::{WaitCondition, WaitSource};
    use r6_proto::message::{Action, Instruction};
    use r6_proto::time::Instant;
    use r6_proto::{AXES, AxisMask, OperationMode};

    use super::*;
    use crate::path::place::Missed;

    fn at(j1: f64) -> Sample {
        let values = [Some(j1), Some(0.0), Some(0.0), Some(0.0), Some(0.0), Some(0.0), None, None];
        Sample {
            moving: Some(false),
            alarm: Some(0),
            mode: Some(OperationMode::Running),
            list_length: Some(0),
            axes: values,
            pose: values,
        }
    }

    fn step(action: Action) -> Instruction {
        Instruction { oneshot: true, action }
    }

    fn to(j1: f64) -> Instruction {
        let manner = Manner { mask: Some(AxisMask::from_bits(0b01)), ..Manner::default() };
        step(Action::AxisMove(Move { target: Coordinates::from_slice(&[j1]), manner }))
    }

    fn line(manner: Manner) -> Instruction {
        let target = Coordinates::from_slice(&[400.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        step(Action::LinearMove(Move { target, manner }))
    }

    fn watch(in_use: bool) -> Instruction {
        step(Action::StopOnSignal(StopOnSignal { in_use, input: 0, on: true }))
    }

    /// Judges a list that was appended while the arm was at `from`, and that ends with the arm at `now`.
    fn judged(steps: &[Instruction], from: Sample, now: Sample, moved: bool) -> Result<EndProof, Cause> {
        let mut path = PathProgress::new(steps.to_vec(), from, Instant::ORIGIN);
        path.accepted = steps.len();
        path.carried_out(&now, moved)
    }

    fn not_proved(why: NotProved) -> Result<EndProof, Cause> {
        Err(Cause::NotProved(why))
    }

    #[test]
    fn an_arm_at_the_end_must_have_gone_there() {
        assert_eq!(judged(&[to(30.0)], at(0.0), at(30.001), false), Ok(EndProof::Reached));
        // The arm was there before, and no step leads away.
        assert_eq!(judged(&[to(30.0)], at(30.0), at(30.0), false), Ok(EndProof::Reached));
        let there_and_back = [to(30.0), to(0.0)];
        assert_eq!(judged(&there_and_back, at(0.0), at(0.0), false), not_proved(NotProved::WasThere));
        assert_eq!(judged(&there_and_back, at(0.0), at(0.0), true), Ok(EndProof::Reached));
        // The earlier contents of the list may have moved it.
        for before in [Sample { moving: Some(true), ..at(0.0) }, Sample { list_length: Some(1), ..at(0.0) }] {
            assert_eq!(judged(&there_and_back, before, at(0.0), true), not_proved(NotProved::WasThere));
        }
    }

    #[test]
    fn an_arm_elsewhere_is_told_with_its_place() {
        let Err(Cause::Elsewhere(missed)) = judged(&[to(30.0)], at(0.0), at(12.0), true) else {
            panic!("it is not there");
        };
        assert_eq!(missed.to_string(), "J1 is at 12.000, not at 30.000 deg or mm");
        let unread = Sample { axes: [None; AXES], ..at(30.0) };
        let Err(Cause::Elsewhere(missed)) = judged(&[watch(true), to(30.0)], at(0.0), unread, true) else {
            panic!("its place is unknown");
        };
        assert_eq!(missed.found, None);
        // A value that is known to be wrong says more than a value that could not be read.
        let mut both = Sample { axes: [None; AXES], ..at(0.0) };
        both.axes[1] = Some(f64::NAN);
        let two = Action::AxisMove(Move {
            target: Coordinates::from_slice(&[1.0, 2.0]),
            manner: Manner { mask: Some(AxisMask::from_bits(0b11)), ..Manner::default() },
        });
        let result = judged(&[step(two)], at(0.0), both, true);
        assert!(matches!(result, Err(Cause::Elsewhere(Missed { wanted: 2.0, .. }))), "{result:?}");
    }

    #[test]
    fn an_input_may_have_cut_the_last_move_only() {
        let cut = |steps: &[Instruction]| judged(steps, at(0.0), at(12.0), true);
        let is_cut = |result| matches!(result, Err(Cause::NotProved(NotProved::MayBeCut(_))));
        assert!(is_cut(cut(&[watch(true), to(30.0)])));
        assert!(is_cut(cut(&[watch(true), to(30.0), watch(false)])), "the last move is what counts");
        assert!(!is_cut(cut(&[watch(true), to(20.0), watch(false), to(30.0)])));
    }

    #[test]
    fn what_cannot_be_compared_is_not_told_as_known() {
        let bench = step(Action::Workbench(Workbench { id: 1 }));
        assert_eq!(judged(&[bench], at(0.0), at(0.0), false), Ok(EndProof::AtRest), "it moves nothing");
        let only = |mask| Manner { mask: Some(AxisMask::from_bits(mask)), ..Manner::default() };
        let beyond = Move { target: Coordinates::from_slice(&[1.0; 8]), manner: only(0x40) };
        for steps in [
            &[bench, line(Manner::default())][..],
            &[line(Manner { tool: Some(1), ..Manner::default() })],
            &[line(Manner { coord: Some(1), ..Manner::default() })],
            // The orientation alone, and an axis that is not read.
            &[line(only(0x38))],
            &[step(Action::AxisMove(beyond))],
        ] {
            assert_eq!(judged(steps, at(0.0), at(400.0), true), not_proved(NotProved::NoTarget), "{steps:?}");
        }
        assert_eq!(judged(&[line(Manner::default())], at(0.0), at(400.0), true), Ok(EndProof::Reached));
        // Axes are the same in every frame.
        assert_eq!(judged(&[bench, to(30.0)], at(0.0), at(30.0), true), Ok(EndProof::Reached));
    }

    #[test]
    fn the_time_before_the_first_move_is_that_of_its_waits_and_its_delay() {
        let wait = |limit, unlimited| {
            let (source, condition) = (WaitSource::Time, WaitCondition::Off);
            step(Action::Wait(Wait { source, condition, limit, unlimited }))
        };
        let late = {
            let manner = Manner { delay: Some(0.5), ..Manner::default() };
            step(Action::AxisMove(Move { target: Coordinates::from_slice(&[1.0]), manner }))
        };
        let lead =
            |steps: &[Instruction]| PathProgress::new(steps.to_vec(), at(0.0), Instant::ORIGIN).lead_time();
        assert_eq!(lead(&[wait(2.0, false), late, wait(9.0, false)]), Some(Duration::from_millis(2500)));
        assert_eq!(lead(&[to(1.0), wait(9.0, true)]), Some(Duration::ZERO));
        assert_eq!(lead(&[wait(0.0, true), late]), None);
    }
}
