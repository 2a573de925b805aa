//! Sending instructions, and waiting until their motion has ended.

use r6_proto::message::Instruction;

use crate::conditions::Conditions;
pub use crate::done::{Done, EndProof, WaitError, WaitOptions};
use crate::error::{Invalid, NotSent, RequestError};
use crate::evidence::Observation;
use crate::evidence::rest::Rest;
use crate::guard::Start;
use crate::job::{Accepted, Terms, Work};
use crate::link::Lane;
use crate::moves::Motion;
use crate::robot::Robot;
use crate::units::position::AxisUnits;

/// Failed reads in a row after which waiting ends: one lost reply says nothing about the arm.
const MAX_FAILED_READS: u32 = 3;

impl Robot {
    /// Sends instructions (manual 6): `replace` empties the list first, otherwise they are appended.
    ///
    /// `Ok` says that the list was accepted, not that it runs: see [`Robot::wait_until_done`]. Replacing the
    /// list of a moving arm has raised alarm 200 (reported, unit A).
    ///
    /// # Errors
    /// [`RequestError`]. The client never resends it. If a guard needs the position of the arm, the list is
    /// sent only on the connection that the position was read on ([`NotSent::Disconnected`]). A list longer
    /// than [`crate::RobotSettings::max_frame_bytes`] is not sent at all: send fewer instructions and append
    /// the rest.
    pub async fn add_rcc(
        &self,
        replace: bool,
        instructions: Vec<Instruction>,
    ) -> Result<Accepted, RequestError> {
        self.drive(self.add_list(Conditions::default(), replace, instructions, &[])).await
    }

    /// Sends instructions as [`Self::add_rcc`], but only under these conditions.
    ///
    /// # Errors
    /// As [`Self::add_rcc`], and the errors that [`Conditions`] names.
    pub async fn add_rcc_under(
        &self,
        conditions: Conditions,
        replace: bool,
        instructions: Vec<Instruction>,
    ) -> Result<Accepted, RequestError> {
        self.drive(self.add_list(conditions, replace, instructions, &[])).await
    }

    /// Sends the steps of a motion as one list, as [`Self::add_rcc`] does. The guard gets the units of its
    /// axes.
    ///
    /// # Errors
    /// [`RequestError`], as there; [`Invalid::Step`] if a step is wrong.
    pub async fn add_motion(&self, replace: bool, motion: &Motion) -> Result<Accepted, RequestError> {
        let steps = motion.instructions().map_err(Invalid::Step)?.to_vec();
        self.drive(self.add_list(Conditions::default(), replace, steps, motion.units())).await
    }

    async fn add_list(
        &self,
        conditions: Conditions,
        replace: bool,
        instructions: Vec<Instruction>,
        units: &[AxisUnits],
    ) -> Result<Accepted, RequestError> {
        // Read this before any wait: a stop that is asked for meanwhile withdraws this list.
        let stops_before = Some(self.hub().stops_asked());
        let Conditions { leave_within, only_on, permission } = conditions;
        let leave_by = leave_within.map(|within| self.now() + within);
        // An empty list is the same wherever the arm stands.
        let _turn = if instructions.is_empty() { None } else { Some(self.lists().await) };
        let checked_on = self.held_against_guard(replace, &instructions, units).await?;
        if let (Some(wanted), Some(checked)) = (only_on, checked_on)
            && wanted != checked
        {
            return Err(NotSent::Disconnected.into());
        }
        let terms = Terms { leave_by, only_on: only_on.or(checked_on), stops_before, permission };
        self.accepted_on(terms, Work::AddRcc { replace, instructions }, Lane::Ordinary).await
    }

    /// Checks a list against the guard of this handle, if it has one. If the check depends on the position of
    /// the arm, returns the connection that it was read on, because on another one the arm may stand
    /// elsewhere.
    async fn held_against_guard(
        &self,
        replace: bool,
        instructions: &[Instruction],
        units: &[AxisUnits],
    ) -> Result<Option<u64>, RequestError> {
        let Some(envelope) = self.guard() else { return Ok(None) };
        let (mut from, mut only_on) = (None, None);
        if envelope.needs_start() && !instructions.is_empty() {
            let Observation { connection, values: sample, .. } = self.observe_lately().await?;
            only_on = Some(connection);
            // Appended steps begin where the list ends, and that place is unknown.
            let at_rest = sample.moving == Some(false) && (replace || sample.list_length == Some(0));
            from = at_rest.then_some(Start { axes: sample.axes, pose: sample.pose });
        }
        envelope.check(instructions, units, from, self.reckoning()).map_err(Invalid::OutsideEnvelope)?;
        Ok(only_on)
    }

    /// Empties the instruction list, so that nothing left in it runs at the next start.
    ///
    /// # Errors
    /// [`RequestError`].
    pub async fn clear_list(&self) -> Result<Accepted, RequestError> {
        self.add_rcc(true, Vec::new()).await
    }

    /// Waits until the arm stands and the list is done. It judges by the state, not by answers to commands.
    ///
    /// While a motion of [`Robot::run`] is under way over this connection, this waits for its end. If the
    /// last motion did not come to its end and the program has not read its error, this returns that error
    /// once ([`WaitError::Motion`]). Otherwise it watches the state: call it right after the instructions
    /// were accepted ([`Robot::add_rcc`]).
    ///
    /// Instructions that are not one-shot run again and again: then it ends with the timeout. Dropping the
    /// future ends the watching, not the motion.
    ///
    /// # Errors
    /// [`WaitError`]. An alarm from before the call counts too. If a connection answers other than the one
    /// that accepted the instructions, their end cannot be seen ([`WaitError::AnotherConnection`]). That is
    /// reported once, and the next call watches the present connection.
    pub async fn wait_until_done(&self, options: WaitOptions) -> Result<Done, WaitError> {
        self.drive(self.until_done(options)).await
    }

    async fn until_done(&self, options: WaitOptions) -> Result<Done, WaitError> {
        let time = &self.hub().time;
        let begun = time.now();
        let deadline = begun + options.timeout;
        let timed_out = |list_length| WaitError::TimedOut { after: options.timeout, list_length };
        match time.timeout_at(deadline, self.motions().end_of_last()).await {
            Ok(Some(Ok(done))) => return Ok(done),
            Ok(Some(Err(error))) => return Err(WaitError::Motion(Box::new(error))),
            Ok(None) => {}
            Err(_elapsed) => return Err(timed_out(None)),
        }
        let about = self.motions().sent_on().unwrap_or_else(|| self.about());
        let mut rest = Rest::new(options, about.clone(), begun);
        let mut failed = 0;
        loop {
            let Ok(read) = time.timeout_at(deadline, self.observe(Lane::Ordinary)).await else {
                return Err(timed_out(rest.list_length()));
            };
            match read {
                Ok(seen) => {
                    failed = 0;
                    let at_rest = match rest.judge(&seen, time.now()) {
                        Ok(at_rest) => at_rest,
                        Err(error) if seen.connection == about.connection => return Err(error),
                        Err(error) => {
                            self.motions().forget_sent_on();
                            let restart = self.restart_since(&about, &seen, options.idle_mode).await;
                            return Err(restart.map_or(error, WaitError::Restarted));
                        }
                    };
                    if at_rest {
                        self.motions().forget_sent_on();
                        let (moved, took) = (rest.moved, time.now() - begun);
                        return Ok(Done::of(None, EndProof::AtRest, &seen.values, moved, took));
                    }
                }
                Err(error) => {
                    rest.missed();
                    failed += 1;
                    if failed >= MAX_FAILED_READS || error == RequestError::NotSent(NotSent::Closed) {
                        return Err(WaitError::Request(error));
                    }
                }
            }
            if time.timeout_at(deadline, time.sleep(options.interval)).await.is_err() {
                return Err(timed_out(rest.list_length()));
            }
        }
    }
}
