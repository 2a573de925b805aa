//! The program that is driven by registers: the other way in which PCs move these arms.
//!
//! A PC writes six axes, in degrees × 1000, into registers 800 to 805. A pulse of M011, or a single cycle, lets the program
//! move there, count counter 0 and ask the camera for a photo. What a taught program does more is to come.

use r6_proto::message::instruction::{Coordinates, Manner, Move, Wait, WaitCondition, WaitSource};
use r6_proto::message::{Action, Instruction};
use r6_proto::{OperationMode, RegisterIndex};

use super::Machine;
use super::execution::Activity;
use crate::settings::REGISTER_MOLD;

/// The first of the six registers with the target.
const BASE: u16 = RegisterIndex::FIRST;

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
        if self.mold != REGISTER_MOLD || !self.runs() {
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
                Action::AxisMove(Move { target: self.registers_as_axes(), manner: full_speed() })
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
        self.list.append(&[Instruction { oneshot: true, action }]).is_ok()
    }

    /// Whether the program stands before its move, so that no cycle has begun.
    pub(super) fn awaits_trigger(&self) -> bool {
        self.mold == REGISTER_MOLD && self.program_step == ProgramStep::Move
    }

    /// Goes back to the beginning of the program, unless something of it is only interrupted.
    pub(super) fn restart_program(&mut self) {
        if self.mold == REGISTER_MOLD && matches!(self.activity, Activity::Idle) {
            self.list.clear();
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

    fn registers_as_axes(&self) -> Coordinates {
        let mut degrees = [0.0; 6];
        for (slot, number) in degrees.iter_mut().zip(BASE..) {
            let value =
                RegisterIndex::new(number).and_then(|register| self.registers.get(&register).copied());
            // A register has 32 bits; what a peer wrote beyond them lies beyond every limit all the same.
            let value = i32::try_from(value.unwrap_or(0)).unwrap_or(i32::MAX);
            *slot = f64::from(value) / 1000.0;
        }
        Coordinates::from_slice(&degrees)
    }

    /// A camera that a program asks for a photo.
    pub(crate) fn poll_photo(&mut self) -> Option<i64> {
        self.photos.pop_front()
    }
}

fn full_speed() -> Manner {
    Manner { speed: Some(100.0), ..Manner::default() }
}
