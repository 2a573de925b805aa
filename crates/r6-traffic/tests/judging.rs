//! Tests that the judge accepts any frames: it never panics, and its findings and its memory are bounded.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use r6_testkit::vector;
use r6_traffic::conversation::{MAX_OPEN, Side};
use r6_traffic::judge::{FrameKind, Judge, SUMMARY_CHARS};
use r6_traffic::recording::Recording;

/// Frames of the golden vectors with some bytes changed, and random bytes.
fn frame() -> impl Strategy<Value = Vec<u8>> {
    let frames: Vec<_> = vector::all().into_iter().map(|vector| vector.frame).collect();
    let changes = vec((any::<Index>(), any::<u8>()), 0..4);
    let changed = (select(frames), changes).prop_map(|(mut frame, changes)| {
        for (at, byte) in changes {
            let at = at.index(frame.len());
            frame[at] = byte;
        }
        frame
    });
    prop_oneof![9 => changed, 1 => vec(any::<u8>(), 0..40)]
}

fn side() -> impl Strategy<Value = Option<Side>> {
    select(vec![None, Some(Side::Pc), Some(Side::Controller)])
}

proptest! {
    #[test]
    fn any_frames_are_judged_within_bounds(frames in vec((frame(), side()), 1..40)) {
        let mut judge = Judge::default();
        for (number, (frame, from)) in (1..).zip(&frames) {
            let finding = judge.frame(frame, *from, None);
            prop_assert!(finding.problems.len() <= frame.len().max(1), "{finding:?}");
            prop_assert!(finding.summary.chars().count() <= SUMMARY_CHARS + 1);
            prop_assert!(finding.problems.iter().all(|problem| !problem.to_string().is_empty()));
            prop_assert!(finding.notes.iter().all(|note| !note.to_string().is_empty()));
            prop_assert!(judge.conversation().open().len() <= MAX_OPEN.min(number));
        }
    }
}

#[test]
fn requests_that_nobody_answers_are_forgotten() {
    let mut judge = Judge::default();
    for number in 0..3 * MAX_OPEN {
        let frame = format!("{{\"reqType\":\"query\",\"packID\":{number},\"queryAddr\":[\"version\"]}}");
        judge.frame(frame.as_bytes(), Some(Side::Pc), None);
    }
    assert_eq!(judge.conversation().open().len(), MAX_OPEN);
}

#[test]
fn right_frames_of_the_vectors_are_not_called_broken() {
    let mut judged = 0;
    for vector in vector::all() {
        let Some(frame) = vector.decodable() else { continue };
        let recording = Recording::read(frame).unwrap();
        let [captured] = &recording.frames[..] else { panic!("{}: {recording:?}", vector.stem) };
        let finding = Judge::default().captured(captured);
        assert!(
            !matches!(finding.kind, FrameKind::Broken | FrameKind::NoJson),
            "{}: {finding:?}",
            vector.stem
        );
        judged += 1;
    }
    assert!(judged > 50, "only {judged}");
}
