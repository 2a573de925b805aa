//! What a program does after the faults are over: it shows that everything works again, on the same handle.

use r6_client::{Command, OperationMode, RegisterIndex, Unmet, WaitOptions};
use tokio::time::sleep;

use super::writing::WRITTEN;
use super::{Work, ms};

impl Work {
    /// Waits until all programs of this robot have finished their work, and until the clients before this one
    /// have recovered.
    pub(super) async fn wait_for_turn(&self) {
        loop {
            let my_turn = {
                let state = self.shared.state();
                let mut others = self.shared.plan.clients.iter().zip(&state.lines).enumerate();
                state.floors[self.plan.robot].is_seen_to
                    && others.all(|(number, (plan, line))| {
                        plan.robot != self.plan.robot
                            || (line.is_done && (number >= self.index || line.is_well))
                    })
            };
            if my_turn {
                return;
            }
            sleep(ms(20)).await;
        }
    }

    /// The faults are over and a person has restored the machine. A query, a command, a motion and a stop
    /// must succeed on the same handle.
    pub(super) async fn all_is_well(mut self) -> Result<(), String> {
        self.make_ready().await?;
        let register = RegisterIndex::new(WRITTEN).ok_or("no register")?;
        let value = self.next_value();
        let written = self.robot.command(Command::RewriteData { register, savable: false, value }).await;
        written.map_err(|error| format!("a command: {error}"))?;
        // The client completes a motion that the program dropped. It does not matter here how it ended.
        let patience = WaitOptions { timeout: ms(30_000), ..WaitOptions::default() };
        drop(self.robot.wait_until_done(patience).await);
        self.make_ready().await?;
        self.move_to_the_end().await?;
        let report = self.robot.stop().await.map_err(|error| format!("a stop: {error}"))?;
        if report.confirmed { Ok(()) } else { Err(format!("a stop: {report}")) }
    }

    /// Makes the machine ready for motions, with the means of a program.
    async fn make_ready(&mut self) -> Result<(), String> {
        let mut last = String::new();
        // A person takes about a second to restore it.
        for _ in 0..60 {
            sleep(ms(250)).await;
            let status = match self.robot.status().await {
                Ok(status) => status,
                Err(error) => {
                    last = error.to_string();
                    continue;
                }
            };
            let unmet = status.unmet();
            let Some(first) = unmet.first() else { return Ok(()) };
            last = format!("{unmet:?}");
            match first {
                Unmet::LeftoverList { .. } => drop(self.robot.clear_list().await),
                Unmet::Mode { found: OperationMode::Auto } => self.start().await,
                Unmet::Alarm { .. } => drop(self.robot.command(Command::ClearAlarm).await),
                Unmet::Mode { .. }
                | Unmet::NotHomed
                | Unmet::Moving
                | Unmet::OtherProgram
                | Unmet::Unknown { .. } => {}
            }
        }
        Err(format!("never ready: {last}"))
    }
}
