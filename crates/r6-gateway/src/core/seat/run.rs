//! A run of a program at a seat: the gateway feeds its list, step by step.
//!
//! One run has the robot at a time. Each of its lists needs a permit of its own, with the lease of the run.
//! When something ends the run, no further list is permitted, and the shell has to stop the arm. A lease that
//! expires or is given back stays with its holder until that is done, so that no other caller moves the arm
//! meanwhile.
//!
//! If the robot is out of reach, its list may still run. Then the seat *owes a stop*: nothing that changes or
//! moves is permitted until the shell has stopped that list.

use r6_api::gateway::{ActedBy, LeaseEnd};
use r6_proto::time::Instant;

use super::permit::{Denied, Permit};
use super::{Key, Seat};
use crate::core::order::Order;

/// Names one run of a seat. Only [`Seat::begin_run`] makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket(u64);

/// What ends a run before its program does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Its lease ended.
    Lease(LeaseEnd),
    /// Somebody stopped or paused the robot.
    Stop,
    /// The connection ended, or nothing comes back over it.
    LinkLost,
}

impl Cut {
    /// Whether the robot can be told to stop now: it answers, and it is the robot of the run.
    #[must_use]
    pub fn is_in_reach(self) -> bool {
        !matches!(self, Self::LinkLost | Self::Lease(LeaseEnd::IdentityChanged))
    }
}

/// What a run leaves at the robot when it is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Left {
    /// Nothing: its list never left, or it was carried out, or it was stopped and cleared.
    Nothing,
    /// It was stopped, and nothing proves that the arm stands and the list is cleared. A person has to look:
    /// a stop holds.
    NotStopped,
    /// Its list may still run, and the robot is out of reach: a stop is owed.
    OutOfReach,
}

/// A run under way.
#[derive(Debug)]
pub(super) struct Run {
    ticket: Ticket,
    key: Key,
    pub(super) cut: Option<Cut>,
    /// Who made the stop that cut it short.
    stopped_by: Option<ActedBy>,
    /// Whether the seat knows what it leaves.
    has_left: bool,
    /// Whether another robot was accepted since. It has no list of this run.
    pub(super) is_elsewhere: bool,
}

impl Seat {
    /// Gives the robot to a run of the holder of the lease.
    ///
    /// # Errors
    /// [`Denied`]: as for a command that moves; [`Denied::RunUnderWay`].
    pub fn begin_run(&mut self, now: Instant, key: Key) -> Result<Ticket, Denied> {
        self.may(now, key, r6_proto::Effect::Moves)?;
        if self.run.is_some() {
            return Err(Denied::RunUnderWay);
        }
        // A command of before must not come between its lists.
        self.void_permits();
        self.runs += 1;
        let ticket = Ticket(self.runs);
        self.run =
            Some(Run { ticket, key, cut: None, stopped_by: None, has_left: false, is_elsewhere: false });
        Ok(ticket)
    }

    /// Permits one list of a run.
    ///
    /// # Errors
    /// [`Denied`]: [`Denied::RunOver`] once the run was cut or has ended.
    pub fn permit_list(&mut self, now: Instant, ticket: Ticket, list: Order) -> Result<Permit, Denied> {
        self.handle_timeout(now);
        let run = self.run.as_ref().filter(|run| run.ticket == ticket && run.cut.is_none());
        let key = run.ok_or(Denied::RunOver)?.key;
        self.permit_any(now, key, list)
    }

    /// What cut this run short; `None` while it may go on, and once it is over.
    #[must_use]
    pub fn cut(&self, ticket: Ticket) -> Option<Cut> {
        self.run.as_ref().filter(|run| run.ticket == ticket)?.cut
    }

    /// Who stopped the robot, if that cut this run short: by a stop, or to take the lease.
    #[must_use]
    pub fn run_stopped_by(&self, ticket: Ticket) -> Option<ActedBy> {
        self.run.as_ref().filter(|run| run.ticket == ticket)?.stopped_by.clone()
    }

    /// The run that was cut short and is not over, and by what.
    #[must_use]
    pub fn run_cut(&self) -> Option<(Ticket, Cut)> {
        let run = self.run.as_ref()?;
        Some((run.ticket, run.cut?))
    }

    /// Whether a run has the robot.
    #[must_use]
    pub fn has_run(&self) -> bool {
        self.run.is_some()
    }

    /// What a run that ends leaves at the robot, as soon as that is known. A stop that is owed may be made
    /// from then on. Only the first call of a run counts.
    pub fn leave(&mut self, ticket: Ticket, left: Left) {
        let Some(run) = self.run.as_mut().filter(|run| run.ticket == ticket && !run.has_left) else { return };
        run.has_left = true;
        match left {
            Left::Nothing => return,
            Left::NotStopped => self.saved.stopped = true,
            Left::OutOfReach => self.owes_stop |= !run.is_elsewhere,
        }
        self.void_permits();
    }

    /// A run is over. A lease that has waited for that ends now. `left` counts if [`Self::leave`] was not
    /// called. `false`: it was over before.
    pub fn end_run(&mut self, ticket: Ticket, left: Left) -> bool {
        self.leave(ticket, left);
        if self.run.take_if(|run| run.ticket == ticket).is_none() {
            return false;
        }
        self.void_permits();
        if let Some(cause) = self.lease.as_ref().and_then(|lease| lease.ends) {
            self.end_lease(cause);
        }
        true
    }

    /// A list of a run of an earlier start may still be at the robot.
    pub fn owe_stop(&mut self) {
        self.owes_stop = true;
        self.void_permits();
    }

    /// Whether a list of an earlier run may still be at the robot.
    #[must_use]
    pub fn owes_stop(&self) -> bool {
        self.owes_stop
    }

    /// Whether the robot answers that an owed stop is for.
    #[must_use]
    pub fn can_make_owed_stop(&self) -> bool {
        self.owes_stop && self.link.is_some() && self.stranger.is_none() && !self.closed
    }

    /// The owed stop was made. If nothing proves that the arm stands, a stop holds from now on.
    pub fn owed_stop_made(&mut self, confirmed: bool) {
        if std::mem::take(&mut self.owes_stop) && !confirmed {
            self.saved.stopped = true;
        }
    }

    /// Nothing is owed any more: a person says that the arm is gone. A stop has to hold, so that nothing
    /// moves what answers under this name later before a person clears it.
    ///
    /// # Errors
    /// [`Denied::NothingOwed`], [`Denied::InReach`], [`Denied::NoStopHolds`].
    pub fn forget_owed_stop(&mut self) -> Result<(), Denied> {
        if !self.owes_stop {
            return Err(Denied::NothingOwed);
        }
        if self.link.is_some() || self.stranger.is_some() {
            return Err(Denied::InReach);
        }
        if !self.saved.stopped {
            return Err(Denied::NoStopHolds);
        }
        self.owes_stop = false;
        Ok(())
    }

    /// Ends the lease of a run before the robot is configured anew, so that the run is stopped over its
    /// connection. Until [`Self::reconfigured`], no lease and no run begins, and nothing is permitted.
    pub fn will_be_reconfigured(&mut self) {
        self.reconfiguring = true;
        self.void_permits();
        if self.has_run() {
            self.end_lease(LeaseEnd::Reconfigured);
        }
    }

    /// The robot is configured, or it stays as it was: leases and runs may begin.
    pub fn is_configured(&mut self) {
        self.reconfiguring = false;
    }

    /// Cuts the run short, if there is one. The first cause counts, except that a robot that comes out of
    /// reach cannot be stopped any more.
    pub(super) fn cut_run(&mut self, cut: Cut) {
        if let Some(run) = &mut self.run
            && run.cut.is_none_or(|first| first.is_in_reach() && !cut.is_in_reach())
        {
            run.cut = Some(cut);
        }
    }

    /// Notes who made the stop that cut the run short: the first one.
    pub(super) fn name_cut(&mut self, who: &ActedBy) {
        if let Some(run) = &mut self.run
            && matches!(run.cut, Some(Cut::Stop | Cut::Lease(LeaseEnd::Taken)))
        {
            run.stopped_by.get_or_insert_with(|| who.clone());
        }
    }

    /// Whether the lease is that of the run: it has to wait for the end of the run.
    pub(super) fn is_of_run(&self, number: u64) -> bool {
        self.run.as_ref().is_some_and(|run| run.key.number == number)
    }
}
