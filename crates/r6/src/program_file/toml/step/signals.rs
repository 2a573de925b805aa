//! Steps about signals: waits and outputs.

use r6_proto::grid::Grid;
use r6_proto::io_point::{IoPoint, PairMask, PointKind};
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    BoardOutput, Output, OutputBoard, OutputKind, Wait, WaitCondition, WaitSource,
};

use super::{OutputWord, PointWord, SourceWord, Step, UntilWord, point, required, seconds, up_to};

impl Step {
    /// A wait for a time or for a signal.
    pub(super) fn wait(&self) -> Result<Action, String> {
        if let Some(time) = self.seconds {
            self.uses(&["seconds"])?;
            return Ok(Action::Wait(Wait {
                source: WaitSource::Time,
                condition: WaitCondition::Off,
                limit: seconds("seconds", time, Grid::TENTHS_OF_A_SECOND)?,
                unlimited: false,
            }));
        }
        self.uses(&["seconds", "source", "board", "point", "until", "limit"])?;
        let source = match self.named(&["source", "board"])? {
            Some(named) => awaited(named)?,
            None => self.counted_source()?,
        };
        let condition = match required("until", self.until)? {
            UntilWord::Off => WaitCondition::Off,
            UntilWord::On => WaitCondition::On,
            UntilWord::Rising => WaitCondition::RisingEdge,
            UntilWord::Falling => WaitCondition::FallingEdge,
        };
        let limit = seconds("limit", self.limit.unwrap_or(0.0), Grid::TENTHS_OF_A_SECOND)?;
        Ok(Action::Wait(Wait { source, condition, limit, unlimited: self.limit.is_none() }))
    }

    /// What is waited for, where it is told by `source`, `board` and `point`.
    fn counted_source(&self) -> Result<WaitSource, String> {
        let source = self.source.ok_or("`seconds` is missing, or `source` with `point` and `until`")?;
        let point = point(self.counted()?)?;
        let board = self.board.unwrap_or(0);
        Ok(match source {
            SourceWord::Input => WaitSource::Input { board: up_to("board", board, 4)?, point },
            SourceWord::M => WaitSource::M { board: up_to("board", board, 2)?, point },
            SourceWord::Eu => WaitSource::Eu { point },
        })
    }

    /// The signal, where `point` is its name, which tells the rest: these keys must not say it again.
    fn named(&self, told: &[&str]) -> Result<Option<IoPoint>, String> {
        let Some(PointWord::Name(name)) = &self.point else { return Ok(None) };
        let named: IoPoint = name.parse().map_err(|wrong| format!("`point`: {wrong}"))?;
        match self.given().find(|key| told.contains(key)) {
            Some(key) => Err(format!("`{key}` goes with a point that is a number; {named} tells all of it")),
            None => Ok(Some(named)),
        }
    }

    /// The point, where it is a number.
    fn counted(&self) -> Result<u8, String> {
        match required("point", self.point.as_ref())? {
            PointWord::Number(number) => Ok(*number),
            PointWord::Name(name) => Err(format!("`point` is \"{name}\", but has to be a number here")),
        }
    }

    /// The input of a stop on a signal: those of the first board alone.
    pub(super) fn watched_input(&self) -> Result<u8, String> {
        match self.named(&[])? {
            Some(IoPoint { kind: PointKind::X, board: 0, point }) => Ok(point),
            Some(other) => Err(format!("{other} cannot stop a move: X010 to X047 can")),
            None => point(self.counted()?),
        }
    }

    /// One output, or a pulse on it.
    pub(super) fn output(&self) -> Result<Action, String> {
        self.uses(&["kind", "point", "on", "delay", "pulse"])?;
        let (kind, point) = match self.named(&["kind"])? {
            Some(named) => set_by_name(named)?,
            None => {
                let kind = match self.kind.unwrap_or(OutputWord::Y) {
                    OutputWord::Y => OutputKind::Y,
                    OutputWord::M => OutputKind::M,
                    OutputWord::Euy => OutputKind::Euy,
                };
                (kind, self.counted()?)
            }
        };
        let point = up_to("point", point, 32)?;
        let Some(pulse) = self.pulse else {
            let on = required("on", self.on)?;
            let delay = seconds("delay", self.delay.unwrap_or(0.0), Grid::MILLISECONDS)?;
            return Ok(Action::Output(Output { kind, point, on, delay }));
        };
        if kind != OutputKind::Y || self.delay.is_some() {
            return Err("`pulse` is for kind \"y\" and goes without `delay`".to_owned());
        }
        let on = self.on.unwrap_or(true);
        Ok(Action::Output(Output {
            kind: OutputKind::TimedY,
            point,
            on,
            delay: seconds("pulse", pulse, Grid::MILLISECONDS)?,
        }))
    }

    /// Many outputs of one board.
    pub(super) fn board_output(&self) -> Result<Action, String> {
        self.uses(&["kind", "board", "set", "clear"])?;
        let board = up_to("board", self.board.unwrap_or(0), 1)?;
        let board = match self.kind.unwrap_or(OutputWord::Y) {
            OutputWord::Y => OutputBoard::Y(board),
            OutputWord::M => OutputBoard::M(board),
            OutputWord::Euy => return Err("`kind` has to be \"y\" or \"m\" for a whole board".to_owned()),
        };
        // Two bits for each point: 10 sets, 01 clears, 00 leaves it.
        let mut halves = [0_u32; 2];
        let set = self.set.iter().flatten().map(|number| (*number, 0b10));
        let clear = self.clear.iter().flatten().map(|number| (*number, 0b01));
        for (number, bits) in set.chain(clear) {
            let number = u32::from(point(number)?);
            let (half, shift) = if number < 16 { (0, 2 * number) } else { (1, 2 * (number - 16)) };
            let Some(word) = halves.get_mut(half) else { continue };
            if *word & (0b11 << shift) != 0 {
                return Err(format!("point {number} is named twice"));
            }
            *word |= bits << shift;
        }
        let [low, high] = halves.map(PairMask::from_bits);
        Ok(Action::BoardOutput(BoardOutput { board, low, high }))
    }
}

/// What is waited for, by its name.
fn awaited(named: IoPoint) -> Result<WaitSource, String> {
    let IoPoint { kind, board, point } = named;
    match kind {
        PointKind::X => Ok(WaitSource::Input { board: up_to("board", board, 4)?, point }),
        PointKind::M => Ok(WaitSource::M { board: up_to("board", board, 2)?, point }),
        PointKind::Eux => Ok(WaitSource::Eu { point }),
        PointKind::Y | PointKind::Euy => Err(format!("{named} is an output, and is not waited for")),
    }
}

/// What is set, by its name: kind and point.
fn set_by_name(named: IoPoint) -> Result<(OutputKind, u8), String> {
    let IoPoint { kind, board, point } = named;
    let kind = match kind {
        PointKind::Y => OutputKind::Y,
        PointKind::M => OutputKind::M,
        PointKind::Euy => OutputKind::Euy,
        PointKind::X | PointKind::Eux => return Err(format!("{named} is an input, and is not set")),
    };
    // Point 32 is the first one of the next board, and the last that this instruction has.
    let point = u16::from(board) * 32 + u16::from(point);
    match u8::try_from(point).ok().filter(|point| *point <= 32) {
        Some(point) => Ok((kind, point)),
        None => Err(format!("{named} is beyond this instruction, which ends with the first of board 1")),
    }
}
