//! The panel of a virtual robot: the person at the machine, with roles, leases, stops and the audit log.
//!
//! A panel has no login, so the gateway is the way to it for others. It is reached over HTTP on this machine
//! (`panel/line.rs`). What an action needs is in `core/panel.rs`.
//!
//! 1. `http/panel.rs` reads the action and asks for the right.
//! 2. An action that stops makes the stop hold, and goes to the panel at once.
//! 3. Every other action needs the lease. Its intent is written, then the panel is connected to, then the
//!    seat is asked again, and only then the action is sent. A stop that begins while it is on its way is
//!    sent again behind it.

pub mod line;

use r6_api::Code;
use r6_api::gateway::{CommandOutcome, PanelDone};
use r6_api::panel::{Faults, Snapshot};
use r6_proto::Effect;

use self::line::Failed;
pub use self::line::Panel;
use super::command::{Told, check_list};
use super::station::{By, MAX_STOPS, Station, by_itself};
use crate::core::panel::{Needs, Press};
use crate::core::seat::{Denied, Key};
use crate::problem::Problem;

impl Station {
    /// What a person sees at the machine.
    ///
    /// # Errors
    /// `no_panel`, `no_reply`.
    pub async fn panel_state(&self) -> Result<Snapshot, Problem> {
        let line = self.panel()?.connect().await.map_err(|why| no_reply(&why))?;
        line.look().await.map_err(unread)
    }

    /// The faults that the robot can be given at its panel.
    ///
    /// # Errors
    /// `no_panel`, `no_reply`.
    pub async fn panel_faults(&self) -> Result<Faults, Problem> {
        let line = self.panel()?.connect().await.map_err(|why| no_reply(&why))?;
        line.faults().await.map_err(unread)
    }

    /// Does something at the panel that stops the robot. It needs no lease, and holds as a stop does.
    ///
    /// `written`: whether the audit log and the events tell it.
    ///
    /// # Errors
    /// `no_panel`, before the stop holds; `not_ready`, `overloaded`, `outcome_unknown`.
    pub async fn panel_stop(&self, by: &By, press: &Press, written: bool) -> Result<PanelDone, Problem> {
        let panel = self.panel()?;
        let word = press.to_string();
        let sending = self.sending();
        self.begin_stop(by, &word, written);
        let answer = match self.stop_commands.try_acquire() {
            Ok(_place) => match panel.connect().await {
                Ok(line) => line.act(&press.action).await.map_err(|failed| problem_of(failed).1),
                Err(why) => Err(unreachable(&why)),
            },
            Err(_) => {
                let message = format!("{MAX_STOPS} commands that stop this robot are under way");
                Err(Problem::new(Code::Overloaded, message))
            }
        };
        drop(sending);
        let detail = answer.as_ref().err().map(|problem| problem.message.clone()).unwrap_or_default();
        self.end_stop(by, &word, (answer.is_ok(), detail), written);
        Ok(PanelDone { command_id: None, panel: answer? })
    }

    /// Does something else at the panel. Its intent is on the disk before it leaves, its outcome after.
    ///
    /// # Errors
    /// `no_panel`, `no_lease`, `stopped`, `not_ready`, `identity_changed`, `run_under_way`, `leftover_list`,
    /// `overloaded`, `store_unavailable`, `outcome_unknown`, and why the panel refuses.
    pub async fn panel_action(
        &self,
        by: &By,
        key: Option<Key>,
        press: &Press,
        run_leftover: bool,
    ) -> Result<PanelDone, Problem> {
        let done = self.try_panel_action(by, key, press, run_leftover).await;
        if let Err((problem, Told::No)) = &done
            && press.is_written()
        {
            self.note_refused(by, &press.to_string(), problem.code);
        }
        done.map_err(|(problem, _)| problem)
    }

    async fn try_panel_action(
        &self,
        by: &By,
        key: Option<Key>,
        press: &Press,
        run_leftover: bool,
    ) -> Result<PanelDone, (Problem, Told)> {
        let untold = |problem: Problem| (problem, Told::No);
        let panel = self.panel().map_err(untold)?;
        let _slot = self.commands.try_acquire().map_err(|_| {
            untold(Problem::new(Code::Overloaded, "too many commands of this robot are under way"))
        })?;
        let asked = self.seat(|seat, now| seat.check_press(now, key, press).map(|()| seat.asked(now)));
        let asked = asked.map_err(|denied| untold(denied.into()))?;
        if press.runs_leftover && !run_leftover {
            let robot = self.robot();
            let robot =
                robot.ok_or_else(|| untold(Problem::new(Code::NotReady, "there is no connection yet")))?;
            check_list(&robot).await.map_err(untold)?;
        }
        let mut stops_before = None;
        let act = async {
            let line = panel.connect().await.map_err(|why| (CommandOutcome::NotSent, unreachable(&why)))?;
            // What was true before the disk and the connection had their turn may not be true any more.
            let checked = self.seat(|seat, now| {
                seat.check_press(now, key, press)?;
                // Whether the robot answers does not matter to a fault, nor what came in between.
                if press.needs == Needs::Link {
                    seat.check_asked(now, asked)?;
                }
                Ok::<_, Denied>(seat.stops_begun())
            });
            stops_before = Some(checked.map_err(|denied| (CommandOutcome::NotSent, denied.into()))?);
            self.term.ownership.check().map_err(|problem| (CommandOutcome::NotSent, problem))?;
            let _sending = self.sending();
            line.act(&press.action).await.map_err(problem_of)
        };
        if !press.is_written() {
            // It begins no move, so a stop that began since needs nothing to be sent behind it.
            let panel = act.await.map_err(|(_, problem)| (problem, Told::Yes))?;
            return Ok(PanelDone { command_id: None, panel });
        }
        let lease = key.map_or(NO_LEASE, |key| key.number);
        let done = self.recorded(by, &press.to_string(), lease, act).await;
        let begun = self.seat(|seat, _| seat.stops_begun());
        if press.effect == Effect::Moves && stops_before.is_some_and(|before| before != begun) {
            // A stop that began since may have come to the machine before it, also if it was confirmed and
            // cleared by now.
            let _ = self.stop(&by_itself()).await;
        }
        let (command_id, panel) = done?;
        Ok(PanelDone { command_id: Some(command_id), panel })
    }

    /// Where its panel is.
    ///
    /// # Errors
    /// `no_panel`.
    pub fn panel(&self) -> Result<Panel, Problem> {
        self.config().panel.ok_or_else(|| {
            let name = self.name();
            let message = format!(
                "`{name}` has no panel here, and nothing was done or stopped: only twins and the robot of `r6 up` have one. \
                 To stop `{name}`: POST /v1/robots/{name}/stop, which works without a panel"
            );
            Problem::new(Code::NoPanel, message)
        })
    }
}

/// The number of a lease in the audit log, for what needs none: leases count from 1.
const NO_LEASE: u64 = 0;

fn no_reply(why: &str) -> Problem {
    Problem::new(Code::NoReply, format!("its panel did not answer: {why}"))
}

/// The problem of something that could not be read.
fn unread(failed: Failed) -> Problem {
    match failed {
        Failed::Refused(problem) => no_reply(&problem.message),
        Failed::NoAnswer(why) => no_reply(&why),
    }
}

fn unreachable(why: &str) -> Problem {
    Problem::new(Code::NotReady, format!("its panel cannot be reached, and nothing was sent: {why}"))
}

/// The outcome and the problem of an action that was not done, or that may have been done.
fn problem_of(failed: Failed) -> (CommandOutcome, Problem) {
    match failed {
        Failed::Refused(r6_api::Problem { code, message, .. }) => {
            let code = match code {
                // At the gateway, this is an alarm that somebody wants to acknowledge.
                Code::NoSuchAlarm => Code::BadValue,
                code => code,
            };
            (CommandOutcome::Refused, Problem::new(code, message))
        }
        Failed::NoAnswer(why) => {
            let message = format!("its panel gave no usable answer: {why}; look at the robot");
            (CommandOutcome::Unknown, Problem::new(Code::OutcomeUnknown, message))
        }
    }
}
