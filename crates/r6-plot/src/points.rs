//! When inputs, outputs and M points changed.

use std::collections::BTreeMap;

use r6_controller::io::{BOARDS, Io};
use r6_proto::io_point::{IoPoint, PointKind};

/// One point that changed.
#[derive(Clone, Debug, PartialEq)]
pub struct PointTrack {
    /// Which point.
    pub point: IoPoint,
    /// Its changes: seconds, and whether it is on from then on. There is at least one.
    pub changes: Vec<(f64, bool)>,
}

impl PointTrack {
    /// When the point is on, each time from its beginning to its end. `until` is the end of the recording.
    pub fn on(&self, until: f64) -> Vec<(f64, f64)> {
        let mut spans = Vec::new();
        let first = self.changes.first().is_some_and(|(_, on)| !on);
        let mut on_since = first.then_some(0.0);
        for &(at, on) in &self.changes {
            match (on_since, on) {
                (Some(since), false) => {
                    spans.push((since, at));
                    on_since = None;
                }
                (None, true) => on_since = Some(at),
                (Some(_), true) | (None, false) => {}
            }
        }
        spans.extend(on_since.map(|since| (since, until)));
        spans
    }
}

/// The kinds of points, in the order in which they are drawn.
const KINDS: [PointKind; 5] = [PointKind::X, PointKind::Eux, PointKind::Y, PointKind::M, PointKind::Euy];

/// The words of a kind, by board.
fn words(io: &Io, kind: PointKind) -> [u32; BOARDS] {
    let first = |word| {
        let mut words = [0; BOARDS];
        words[0] = word;
        words
    };
    match kind {
        PointKind::X => io.inputs,
        PointKind::Y => io.outputs,
        PointKind::M => io.m,
        PointKind::Eux => first(io.eu_inputs),
        PointKind::Euy => first(io.eu_outputs),
    }
}

/// Records changes of points.
pub(crate) struct PointRecorder {
    last: Io,
    /// The changes by kind (its place in [`KINDS`]), board and point.
    tracks: BTreeMap<(usize, u8, u8), Vec<(f64, bool)>>,
}

impl PointRecorder {
    pub(crate) fn new(io: &Io) -> Self {
        Self { last: io.clone(), tracks: BTreeMap::new() }
    }

    /// Notes the points that are not as they were at the last look.
    pub(crate) fn look(&mut self, at: f64, io: &Io) {
        if *io == self.last {
            return;
        }
        for (place, kind) in KINDS.into_iter().enumerate() {
            let boards = words(&self.last, kind).into_iter().zip(words(io, kind));
            for (board, (before, now)) in (0..).zip(boards) {
                let changed = before ^ now;
                for point in (0..32_u8).filter(|point| changed >> point & 1 == 1) {
                    let track = self.tracks.entry((place, board, point)).or_default();
                    track.push((at, now >> point & 1 == 1));
                }
            }
        }
        self.last = io.clone();
    }

    pub(crate) fn finish(self) -> Vec<PointTrack> {
        let track = |((place, board, point), changes): ((usize, u8, u8), Vec<(f64, bool)>)| {
            let kind = KINDS.get(place).copied()?;
            Some(PointTrack { point: IoPoint { kind, board, point }, changes })
        };
        self.tracks.into_iter().filter_map(track).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_change_have_spans() {
        let mut io = Io { m: [1, 0, 0, 0, 0, 0, 0, 0], ..Io::default() };
        let mut recorder = PointRecorder::new(&io);
        recorder.look(0.0, &io);
        io.outputs[0] = 0b10;
        io.set_input(1, 0, true);
        recorder.look(1.0, &io);
        io.m[0] = 0;
        io.outputs[0] = 0b11;
        recorder.look(2.5, &io);
        io.outputs[0] = 0b01;
        recorder.look(3.0, &io);
        let tracks = recorder.finish();
        let told: Vec<_> = tracks.iter().map(|track| (track.point.to_string(), track.on(4.0))).collect();
        let row = |name: &str, from, to| (name.to_owned(), vec![(from, to)]);
        assert_eq!(
            told,
            [row("X1.010", 1.0, 4.0), row("Y010", 2.5, 4.0), row("Y011", 1.0, 3.0), row("M010", 0.0, 2.5)]
        );
    }
}
