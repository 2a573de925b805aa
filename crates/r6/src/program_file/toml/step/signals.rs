//! Steps about signals: waits and outputs.

use r6_proto::io_point::PairMask;
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    BoardOutput, Output, OutputBoard, OutputKind, Wait, WaitCondition, WaitSource,
};

use super::{OutputWord, SourceWord, Step, UntilWord, point, required, seconds, up_to};

impl Step {
    /// A wait for a time or for a signal.
    pub(super) fn wait(&self) -> Result<Action, String> {
        if let Some(time) = self.seconds {
            self.uses(&["seconds"])?;
            return Ok(Action::Wait(Wait {
                source: WaitSource::Time,
                condition: WaitCondition::Off,
                limit: seconds("seconds", time)?,
                unlimited: false,
            }));
        }
        self.uses(&["seconds", "source", "board", "point", "until", "limit"])?;
        let source = self.source.ok_or("`seconds` is missing, or `source` with `point` and `until`")?;
        let point = point(required("point", self.point)?)?;
        let board = self.board.unwrap_or(0);
        let source = match source {
            SourceWord::Input => WaitSource::Input { board: up_to("board", board, 4)?, point },
            SourceWord::M => WaitSource::M { board: up_to("board", board, 2)?, point },
            SourceWord::Eu => WaitSource::Eu { point },
        };
        let condition = match required("until", self.until)? {
            UntilWord::Off => WaitCondition::Off,
            UntilWord::On => WaitCondition::On,
            UntilWord::Rising => WaitCondition::RisingEdge,
            UntilWord::Falling => WaitCondition::FallingEdge,
        };
        let limit = seconds("limit", self.limit.unwrap_or(0.0))?;
        Ok(Action::Wait(Wait { source, condition, limit, unlimited: self.limit.is_none() }))
    }

    /// One output, or a pulse on it.
    pub(super) fn output(&self) -> Result<Action, String> {
        self.uses(&["kind", "point", "on", "delay", "pulse"])?;
        let point = up_to("point", required("point", self.point)?, 32)?;
        let kind = match self.kind.unwrap_or(OutputWord::Y) {
            OutputWord::Y => OutputKind::Y,
            OutputWord::M => OutputKind::M,
            OutputWord::Euy => OutputKind::Euy,
        };
        let Some(pulse) = self.pulse else {
            let on = required("on", self.on)?;
            let delay = seconds("delay", self.delay.unwrap_or(0.0))?;
            return Ok(Action::Output(Output { kind, point, on, delay }));
        };
        if kind != OutputKind::Y || self.delay.is_some() {
            return Err("`pulse` is for kind \"y\" and goes without `delay`".to_owned());
        }
        let on = self.on.unwrap_or(true);
        Ok(Action::Output(Output { kind: OutputKind::TimedY, point, on, delay: seconds("pulse", pulse)? }))
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
