//! What a program does when the faults are over: everything works again, on the handle that was there all the
//! time.

use r6_client::{Command, OperationMode, RegisterIndex, Unmet, WaitOptions};
use tokio::time::sleep;

use super::writing::WRITTEN;
use super::{Work, ms};

impl Work {
    /// Waits until all programs of this robot have done their work, and those before it are well.
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

    /// The faults are over and somebody has seen to the machine: a query, a command, a motion and a stop
    /// succeed on the handle that was there all the time.
    pub(super) async fn all_is_well(mut self) -> Result<(), String> {
        self.make_ready().await?;
        let register = RegisterIndex::new(WRITTEN).ok_or("no register")?;
        let value = self.next_value();
        let written = self.robot.command(Command::RewriteData { register, savable: false, value }).await;
        written.map_err(|error| format!("a command: {error}"))?;
        // The client carries a motion to its end that the program dropped. How it ended is no matter here.
        let patience = WaitOptions { timeout: ms(30_000), ..WaitOptions::default() };
        drop(self.robot.wait_until_done(patience).await);
        self.make_ready().await?;
        self.move_to_the_end().await?;
        let report = self.robot.stop().await.map_err(|error| format!("a stop: {error}"))?;
        if report.confirmed { Ok(()) } else { Err(format!("a stop: {report}")) }
    }

    /// Brings the machine to where it takes motions, by what a program may do.
    async fn make_ready(&mut self) -> Result<(), String> {
        let mut last = String::new();
        // A person needs about a second to see to it.
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
                Unmet::Mode { .. } | Unmet::NotHomed | Unmet::Moving | Unmet::Unknown { .. } => {}
            }
        }
        Err(format!("never ready: {last}"))
    }
}
