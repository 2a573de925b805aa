//! The instruction list: the instructions from AddRCC, and the controller's position in it.

use r6_proto::message::Instruction;

/// How many instructions a list holds at most. The limit of real controllers is unknown. The longest list a
/// client is known to stream has a few hundred instructions; the bound keeps a hostile sender from filling
/// the memory.
pub const MAX_INSTRUCTIONS: usize = 1000;

/// The error of a list without enough room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListFull;

/// The queue of remote instructions and a position in it.
#[derive(Clone, Debug, Default)]
pub struct InstructionList {
    steps: Vec<Instruction>,
    next: usize,
    /// How many instructions have run to their end.
    completed: u64,
}

/// What comes after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum After {
    /// Another step of this pass.
    Next,
    /// The pass is over. Steps remain, and the list starts again.
    PassOver,
    /// The list is empty.
    Empty,
}

impl InstructionList {
    /// Appends instructions.
    ///
    /// # Errors
    /// [`ListFull`]: no instruction was appended.
    pub fn append(&mut self, instructions: &[Instruction]) -> Result<(), ListFull> {
        if self.steps.len() + instructions.len() > MAX_INSTRUCTIONS {
            return Err(ListFull);
        }
        self.steps.extend_from_slice(instructions);
        Ok(())
    }

    /// Removes all instructions.
    pub fn clear(&mut self) {
        self.steps.clear();
        self.next = 0;
    }

    /// Goes back to the first instruction.
    pub fn rewind(&mut self) {
        self.next = 0;
    }

    /// The current instruction.
    #[must_use]
    pub fn current(&self) -> Option<&Instruction> {
        self.steps.get(self.next)
    }

    /// The instruction `steps` after the current one, in this pass; 0 is the current one.
    #[must_use]
    pub fn ahead(&self, steps: usize) -> Option<&Instruction> {
        self.steps.get(self.next.checked_add(steps)?)
    }

    /// The index of the current instruction.
    #[must_use]
    pub fn position(&self) -> usize {
        self.next
    }

    /// Ends the current instruction: a one-shot is removed, any other stays.
    pub fn finish_current(&mut self) -> After {
        self.completed += 1;
        match self.steps.get(self.next) {
            Some(step) if step.oneshot => {
                self.steps.remove(self.next);
            }
            Some(_) => self.next += 1,
            None => {}
        }
        if self.next < self.steps.len() {
            return After::Next;
        }
        self.next = 0;
        if self.steps.is_empty() { After::Empty } else { After::PassOver }
    }

    /// How many instructions are left, as `RemoteCmdLen` reports.
    #[must_use]
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether the list is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// How many instructions ran to their end since the controller was switched on.
    #[must_use]
    pub fn completed(&self) -> u64 {
        self.completed
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::Workbench;
    use r6_proto::message::{Action, Instruction};

    use super::*;

    fn step(oneshot: bool, id: u32) -> Instruction {
        Instruction { oneshot, action: Action::Workbench(Workbench { id }) }
    }

    #[test]
    fn one_shots_go_and_the_rest_comes_again() {
        let mut list = InstructionList::default();
        list.append(&[step(true, 1), step(false, 2), step(true, 3)]).unwrap();
        assert_eq!(list.finish_current(), After::Next);
        assert_eq!(list.current(), Some(&step(false, 2)));
        assert_eq!(list.finish_current(), After::Next);
        assert_eq!(list.current(), Some(&step(true, 3)));
        assert_eq!(list.finish_current(), After::PassOver);
        assert_eq!((list.len(), list.current()), (1, Some(&step(false, 2))));
        assert_eq!(list.finish_current(), After::PassOver);
        assert_eq!(list.completed(), 4);
    }

    #[test]
    fn the_last_one_shot_empties_the_list() {
        let mut list = InstructionList::default();
        list.append(&[step(true, 1)]).unwrap();
        assert_eq!(list.finish_current(), After::Empty);
        assert!(list.is_empty());
    }

    #[test]
    fn a_full_list_takes_nothing() {
        let mut list = InstructionList::default();
        list.append(&[step(true, 1); MAX_INSTRUCTIONS]).unwrap();
        assert_eq!(list.append(&[step(true, 1)]), Err(ListFull));
        assert_eq!(list.len(), MAX_INSTRUCTIONS);
    }
}
