//! Reads the same stream as a recording: any bytes are accepted, and every frame is at its reported place.

use r6_proto::time::Instant;
use r6_traffic::conversation::{MAX_OPEN, Side};
use r6_traffic::judge::{FrameKind, Judge};
use r6_traffic::recording::{BrokenFrame, Recording, transcript};

use super::FoundFrame;

/// Reads the stream as raw bytes or a log, and judges the frames.
pub(super) fn check_log(stream: &[u8]) {
    if transcript::writes(stream).is_some() {
        return;
    }
    let recording = Recording::read(stream).unwrap();
    let mut judge = Judge::default();
    let mut end = 0;
    let mut taken = recording.other_bytes;
    for captured in &recording.frames {
        let at = usize::try_from(captured.place.offset).unwrap();
        let newlines = stream[..at].iter().filter(|byte| **byte == b'\n').count();
        assert_eq!(captured.place.line, newlines + 1, "a frame is told with another line");
        assert!(at >= end, "frames overlap, or are out of order");
        end = at + 1;
        if let Ok(bytes) = &captured.frame {
            end = at + bytes.len();
            assert_eq!(stream.get(at..end), Some(&bytes[..]), "a frame is what stands in the recording");
            taken += bytes.len();
        }
        let finding = judge.captured(captured);
        let texts = finding.problems.iter().map(ToString::to_string);
        assert!(texts.chain(finding.notes.iter().map(ToString::to_string)).all(|text| !text.is_empty()));
        assert_eq!(captured.frame.is_err(), finding.kind == FrameKind::Broken);
        assert!(judge.conversation().open().len() <= MAX_OPEN);
    }
    assert!(taken <= stream.len(), "{taken} of {} bytes are told", stream.len());
}

/// Writes the stream as a transcript, in pieces of this length, and compares it with the events of a buffer.
pub(super) fn check_transcript(stream: &[u8], length: usize, told: &[FoundFrame]) {
    let lines = stream.chunks(length).map(|piece| transcript::line(Side::Controller, Instant::ORIGIN, piece));
    let recording = Recording::read(lines.collect::<String>().as_bytes()).unwrap();
    let read = recording.frames.into_iter().map(|captured| match captured.frame {
        Ok(bytes) => FoundFrame::Frame { offset: captured.place.offset, bytes },
        Err(BrokenFrame::Frame(error)) => FoundFrame::Fault(error),
        Err(other) => panic!("a transcript tells of frames alone: {other}"),
    });
    assert_eq!(read.collect::<Vec<_>>(), told, "as a transcript it is another stream");
}
