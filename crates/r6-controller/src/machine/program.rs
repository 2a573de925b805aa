//! The programs that are driven by registers: the other way in which PCs move these arms.
//!
//! A PC writes six axes, in degrees × 1000. One program runs freely and moves whenever registers 850 to 855 are written.
//! The other takes registers 800 to 805: a pulse of M011, or a single cycle, lets it
//! move there, count counter 0 and ask the camera for a photo. What a taught program does more is to come.

use r6_proto::message::instruction::{Coordinates, Manner, Move, Wait, WaitCondition, WaitSource};
use r6_proto::message::{Action, Instruction};
use r6_proto::{OperationMode, RegisterIndex};

use super::Machine;
use super::execution::Activity;
use crate::settings::{FOLLOW_MOLD, REGISTER_MOLD};

/// The first of the six registers with the target.
const BASE: u16 = RegisterIndex::FIRST;

/// The first of the six registers that the free-running program follows.
const FOLLOWED: u16 = 850;

/// M011: board 0, point 1 of the M points (`modifyOutput` board 4).
const TRIGGER: WaitSource = WaitSource::M { board: 0, point: 1 };

/// The counter that counts the moves, and the camera that is asked.
const COUNTER: u32 = 0;
const CAMERA: i64 = 0;

/// How many photo requests wait to be sent; a photo that nobody fetches is not worth more.
const MAX_PHOTOS: usize = 16;

/// Where the register-driven program is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ProgramStep {
    /// Before its trigger.
    #[default]
    Trigger,
    /// Waiting for the trigger, or just triggered.
    Move,
    /// Moving.
    Count,
}

impl Machine {
    /// Puts the next step of the program into the list, where the program in use has steps of its own.
    pub(super) fn next_program_step(&mut self) -> bool {
        if !self.runs() {
            return false;
        }
        if self.mold == FOLLOW_MOLD {
            let written = std::mem::take(&mut self.target_written);
            return written && self.append_own(self.move_to(FOLLOWED));
        }
        if self.mold != REGISTER_MOLD {
            return false;
        }
        let action = match self.program_step {
            ProgramStep::Trigger => {
                self.program_step = ProgramStep::Move;
                if self.mode == OperationMode::SingleCycle {
                    return self.next_program_step();
                }
                let condition = WaitCondition::RisingEdge;
                Action::Wait(Wait { source: TRIGGER, condition, limit: 0.0, unlimited: true })
            }
            ProgramStep::Move => {
                self.program_step = ProgramStep::Count;
                self.move_to(BASE)
            }
            ProgramStep::Count => {
                self.program_step = ProgramStep::Trigger;
                self.close_cycle();
                if let Some(counter) = self.counters.get_mut(&COUNTER) {
                    counter.current += 1;
                }
                if self.photos.len() < MAX_PHOTOS {
                    self.photos.push_back(CAMERA);
                }
                if self.last_pass {
                    self.leave_running("the program has ended");
                    return false;
                }
                return self.next_program_step();
            }
        };
        self.append_own(action)
    }

    fn append_own(&mut self, action: Action) -> bool {
        self.list.append(&[Instruction { oneshot: true, action }]).is_ok()
    }

    /// Registers were written: the free-running program sees whether its target is among them.
    pub(super) fn registers_written(&mut self, first: RegisterIndex, count: usize) {
        let first = usize::from(first.number());
        let followed = usize::from(FOLLOWED)..usize::from(FOLLOWED) + 6;
        if self.mold == FOLLOW_MOLD && first < followed.end && first + count > followed.start {
            self.target_written = true;
            self.run_list();
        }
    }

    /// Whether the program in use puts steps of its own into the list.
    pub(crate) fn has_own_steps(&self) -> bool {
        self.mold == REGISTER_MOLD || self.mold == FOLLOW_MOLD
    }

    /// Whether the program stands before its move, so that no cycle has begun.
    pub(super) fn awaits_trigger(&self) -> bool {
        self.mold == REGISTER_MOLD && self.program_step == ProgramStep::Move
    }

    /// Goes back to the beginning of the program, unless something of it is only interrupted.
    pub(super) fn restart_program(&mut self) {
        if self.has_own_steps() && matches!(self.activity, Activity::Idle) {
            self.list.clear();
            self.target_written = false;
            self.program_step = ProgramStep::Trigger;
        }
    }

    /// In single cycle the program does not wait for its trigger.
    pub(super) fn skip_trigger(&mut self) {
        let waits = matches!(self.activity, Activity::Waiting { .. } | Activity::Suspended(..));
        if self.awaits_trigger() && waits {
            self.activity = Activity::Idle;
            self.list.clear();
        }
    }

    /// A move to the six axes in the registers from `base` on.
    fn move_to(&self, base: u16) -> Action {
        let mut degrees = [0.0; 6];
        for (slot, number) in degrees.iter_mut().zip(base..) {
            let value =
                RegisterIndex::new(number).and_then(|register| self.registers.get(&register).copied());
            // A register has 32 bits; what a peer wrote beyond them lies beyond every limit all the same.
            let value = i32::try_from(value.unwrap_or(0)).unwrap_or(i32::MAX);
            *slot = f64::from(value) / 1000.0;
        }
        Action::AxisMove(Move { target: Coordinates::from_slice(&degrees), manner: full_speed() })
    }

    /// A camera that a program asks for a photo.
    pub(crate) fn poll_photo(&mut self) -> Option<i64> {
        self.photos.pop_front()
    }
}

fn full_speed() -> Manner {
    Manner { speed: Some(100.0), ..Manner::default() }
}
