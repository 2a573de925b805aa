//! Inputs, outputs and M points.

use r6_proto::io_point::{IoPoint, PointKind};
use r6_proto::message::instruction::{BoardOutput, OutputBoard, WaitSource};

/// How many boards of 32 points a command can name (`input-0` … `input-7`).
pub const BOARDS: usize = 8;

/// How many points a board has: 0 to 31.
pub const POINTS: u8 = 32;

/// All points of one controller, 32 to a word; bit 0 is the first point.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Io {
    /// Inputs X, by board.
    pub inputs: [u32; BOARDS],
    /// Outputs Y, by board.
    pub outputs: [u32; BOARDS],
    /// M points, by board.
    pub m: [u32; BOARDS],
    /// EU inputs.
    pub eu_inputs: u32,
    /// EU outputs.
    pub eu_outputs: u32,
}

impl Io {
    /// The names of the inputs that are on.
    #[must_use]
    pub fn inputs_on(&self) -> Vec<String> {
        let mut on = names_on(PointKind::X, &self.inputs);
        on.extend(names_on(PointKind::Eux, &[self.eu_inputs]));
        on
    }

    /// The names of the outputs that are on.
    #[must_use]
    pub fn outputs_on(&self) -> Vec<String> {
        let mut on = names_on(PointKind::Y, &self.outputs);
        on.extend(names_on(PointKind::Euy, &[self.eu_outputs]));
        on
    }

    /// The names of the M points that are on.
    #[must_use]
    pub fn m_on(&self) -> Vec<String> {
        names_on(PointKind::M, &self.m)
    }

    /// The names of all points that are on: inputs, outputs, M.
    #[must_use]
    pub fn names_on(&self) -> Vec<String> {
        [self.inputs_on(), self.outputs_on(), self.m_on()].concat()
    }
}

/// The names of the points of one kind that are on, board by board.
fn names_on(kind: PointKind, words: &[u32]) -> Vec<String> {
    let boards = (0_u8..).zip(words);
    let points = boards.flat_map(|(board, word)| (0..32_u8).map(move |point| (board, point, word >> point)));
    points
        .filter(|(_, _, bits)| bits & 1 == 1)
        .map(|(board, point, _)| IoPoint { kind, board, point }.to_string())
        .collect()
}

/// One point that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputPoint {
    /// Output Y: board, point.
    Y(u8, u8),
    /// M point: board, point.
    M(u8, u8),
    /// EU output: point.
    Eu(u8),
}

impl OutputPoint {
    /// The point for the numbers in `modifyOutput` ([`IoPoint::of_command`]).
    #[must_use]
    pub fn of_command(board: u8, point: u8) -> Option<Self> {
        IoPoint::of_command(board, point).and_then(Self::named)
    }

    /// The point with this name; `None` for an input.
    #[must_use]
    pub fn named(name: IoPoint) -> Option<Self> {
        let IoPoint { kind, board, point } = name;
        match kind {
            PointKind::Y => Some(Self::Y(board, point)),
            PointKind::M => Some(Self::M(board, point)),
            PointKind::Euy => Some(Self::Eu(point)),
            PointKind::X | PointKind::Eux => None,
        }
    }

    /// Its name on the pendant.
    #[must_use]
    pub fn name(self) -> IoPoint {
        let (kind, board, point) = match self {
            Self::Y(board, point) => (PointKind::Y, board, point),
            Self::M(board, point) => (PointKind::M, board, point),
            Self::Eu(point) => (PointKind::Euy, 0, point),
        };
        IoPoint { kind, board, point }
    }

    /// The same point, with its number within its board: point 32 of action 200 is the first point of the
    /// next board.
    #[must_use]
    pub fn on_first_boards(self) -> Self {
        match self {
            Self::Y(board, point) if point >= 32 => Self::Y(board + 1, point - 32),
            Self::M(board, point) if point >= 32 => Self::M(board + 1, point - 32),
            Self::Y(..) | Self::M(..) | Self::Eu(_) => self,
        }
    }
}

fn bit(word: u32, point: u8) -> bool {
    word.checked_shr(u32::from(point)).is_some_and(|word| word & 1 == 1)
}

fn write(word: &mut u32, point: u8, on: bool) {
    let mask = 1_u32.checked_shl(u32::from(point)).unwrap_or(0);
    *word = if on { *word | mask } else { *word & !mask };
}

impl Io {
    /// The word of one board; 0 for a board that does not exist.
    #[must_use]
    pub fn word(words: &[u32; BOARDS], board: u8) -> u32 {
        words.get(usize::from(board)).copied().unwrap_or(0)
    }

    /// Sets an input, as an operator or a machine in the cell does.
    pub fn set_input(&mut self, board: u8, point: u8, on: bool) {
        if let Some(word) = self.inputs.get_mut(usize::from(board)) {
            write(word, point, on);
        }
    }

    /// Sets an input of the EU board, as an operator or a machine in the cell does.
    pub fn set_eu_input(&mut self, point: u8, on: bool) {
        write(&mut self.eu_inputs, point, on);
    }

    /// Sets an output.
    pub fn set(&mut self, point: OutputPoint, on: bool) {
        let (word, point) = match point {
            OutputPoint::Y(board, point) => (self.outputs.get_mut(usize::from(board)), point),
            OutputPoint::M(board, point) => (self.m.get_mut(usize::from(board)), point),
            OutputPoint::Eu(point) => (Some(&mut self.eu_outputs), point),
        };
        if let Some(word) = word {
            write(word, point, on);
        }
    }

    /// Whether an output is on.
    #[must_use]
    pub fn is_set(&self, point: OutputPoint) -> bool {
        match point {
            OutputPoint::Y(board, point) => bit(Self::word(&self.outputs, board), point),
            OutputPoint::M(board, point) => bit(Self::word(&self.m, board), point),
            OutputPoint::Eu(point) => bit(self.eu_outputs, point),
        }
    }

    /// Whether an ordinary input of board 0 is on.
    #[must_use]
    pub fn input(&self, point: u8) -> bool {
        bit(Self::word(&self.inputs, 0), point)
    }

    /// The level of the point that a wait watches; `None` for a wait for time only.
    #[must_use]
    pub fn level(&self, source: WaitSource) -> Option<bool> {
        match source {
            WaitSource::Input { board, point } => Some(bit(Self::word(&self.inputs, board), point)),
            WaitSource::M { board, point } => Some(bit(Self::word(&self.m, board), point)),
            WaitSource::Eu { point } => Some(bit(self.eu_inputs, point)),
            WaitSource::Time => None,
        }
    }

    /// Sets many outputs of one board (action 204).
    pub fn set_board(&mut self, output: &BoardOutput) {
        for (offset, pairs) in [(0, output.low), (16, output.high)] {
            for (point, on) in pairs.points() {
                self.set(
                    match output.board {
                        OutputBoard::Y(board) => OutputPoint::Y(board, point + offset),
                        OutputBoard::M(board) => OutputPoint::M(board, point + offset),
                    },
                    on,
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_are_on_have_names() {
        assert_eq!(names_on(PointKind::Y, &[1 | 1 << 31, 0, 2]), ["Y010", "Y047", "Y2.011"]);
        let io = Io {
            inputs: [2, 0, 0, 0, 0, 0, 0, 0],
            eu_outputs: 1,
            m: [0, 1, 0, 0, 0, 0, 0, 0],
            ..Io::default()
        };
        assert_eq!(io.names_on(), ["X011", "EUY010", "M1.010"]);
    }
}
