//! The registers that a program writes. The controller saves some of them, and others not.

use r6_client::{Address, Command, RegisterIndex, RequestError};
use tokio::time::sleep;

use super::{Work, ms};
use crate::fault::Promise;
use crate::saved_registers::look_at_disk;
use crate::shared::{State, now};

/// The registers that clients write. Each client has one register that is saved, and another that is not.
const KEPT: u16 = 860;
pub(super) const WRITTEN: u16 = 880;

impl Work {
    /// Returns a value that no other client writes, and that this client writes only once.
    pub(super) fn next_value(&self) -> i64 {
        let mut state = self.shared.state();
        let line = &mut state.lines[self.index];
        line.next_value += 1;
        i64::try_from(self.index).unwrap_or(0) * 1_000_000 + 1_000_000 + line.next_value
    }

    async fn write_value(&mut self, first: u16, savable: bool) {
        let number = first + u16::try_from(self.index).unwrap_or(0);
        let Some(register) = RegisterIndex::new(number) else { return };
        let value = self.next_value();
        if savable {
            self.shared.state().floors[self.plan.robot].kept.entry(register.number()).or_default().sent =
                value;
        }
        let begun = now();
        let robot = self.robot.clone();
        let command = robot.command(Command::RewriteData { register, savable, value });
        let Some(result) = self.perhaps("a command", command).await else { return };
        self.count(&result);
        let at = now();
        let says_truly = self.robot_plan().does_what_it_says;
        {
            let mut state = self.shared.state();
            let State { record, lines, floors, disks, .. } = &mut *state;
            let line = &mut lines[self.index];
            let times = line.times_sent(value);
            let holds = match &result {
                Err(RequestError::NotSent(_) | RequestError::Invalid(_)) => times == 0,
                Ok(_) | Err(RequestError::Refused(_)) => times == 1,
                // A part of it may have left.
                Err(RequestError::OutcomeUnknown(_)) => times <= 1,
            };
            record.check(Promise::Once, at, holds, || {
                format!("{value} left {times} times, and they say {result:?}")
            });
            if result.is_ok() {
                line.answered(value, begun, at, record);
                if savable && says_truly {
                    let number = register.number();
                    floors[self.plan.robot].kept.entry(number).or_default().acknowledged = value;
                    if self.robot_plan().keeps {
                        look_at_disk(&disks[self.plan.robot], (number, value), at, record);
                    }
                }
            }
        }
        if result.is_err() {
            // After a reconnect, the program has to read the status before a command can be sent.
            let robot = self.robot.clone();
            drop(self.bounded("a look", robot.query(&[Address::CurMode, Address::CurAlarm])).await);
        }
    }

    pub(super) async fn write(mut self) {
        while !self.is_over() {
            self.write_value(WRITTEN, false).await;
            sleep(ms(100) + self.random.up_to(ms(300))).await;
        }
    }

    pub(super) async fn keep(mut self) {
        while !self.is_over() {
            self.write_value(KEPT, true).await;
            sleep(ms(200) + self.random.up_to(ms(500))).await;
        }
    }
}
