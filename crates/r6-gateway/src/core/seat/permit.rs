//! The permit to send one command or list, or what a camera sends, and why it is not given.

use std::fmt;
use std::time::Duration;

use r6_proto::Effect;
use r6_proto::time::Instant;

use super::{Key, Link, Seat};
use crate::core::camera::Standing;
use crate::core::order::Order;

/// A permitted command does not leave later than this after it was permitted: later it would be a surprise.
const LEAVE_WITHIN: Duration = Duration::from_secs(1);

/// How long a request may wait for the disk and the connection before it is permitted: later it would be a
/// surprise, too. A slow disk takes a second.
const WAIT_WITHIN: Duration = Duration::from_secs(3);

/// When something was asked for.
///
/// A stop that begins after it withdraws it, even if the stop is cleared again before the disk has written
/// the intent: the person who cleared the stop does not know of it.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    at: Instant,
    generation: u64,
}

impl Asked {
    /// The permit, if it comes soon enough and nothing has voided permits since this was asked for.
    ///
    /// # Errors
    /// [`Denied::Overtaken`].
    pub fn admit(self, now: Instant, permit: Permit) -> Result<Permit, Denied> {
        self.check(now, permit.generation).map(|()| permit)
    }

    fn check(self, now: Instant, generation: u64) -> Result<(), Denied> {
        let is_late = now > self.at + WAIT_WITHIN;
        if is_late || generation != self.generation { Err(Denied::Overtaken) } else { Ok(()) }
    }
}

/// What a permit rests on, and so what voids it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    /// The lease of its caller.
    Lease,
    /// The standing grant of a camera: the end of a lease voids nothing.
    Grant,
}

/// The right to send one command or list once: on one connection, until a time. Only a [`Seat`] makes one:
/// [`Seat::permit`] for the holder of the lease, [`Seat::permit_granted`] for a camera.
///
/// It is void once [`Seat::generation`] of its ground differs from [`Self::generation`].
#[derive(Debug)]
#[must_use = "the command leaves only if the permit is used"]
pub struct Permit {
    order: Order,
    connection: u64,
    latest: Instant,
    ground: Ground,
    generation: u64,
}

impl Permit {
    /// The connection that it is for.
    #[must_use]
    pub fn connection(&self) -> u64 {
        self.connection
    }

    /// The latest time at which it may leave.
    #[must_use]
    pub fn latest(&self) -> Instant {
        self.latest
    }

    /// What it rests on.
    #[must_use]
    pub fn ground(&self) -> Ground {
        self.ground
    }

    /// The generation of the seat that made it.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Uses the permit up: what to send.
    #[must_use]
    pub fn into_order(self) -> Order {
        self.order
    }
}

/// Why something is not permitted now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Denied {
    /// The caller does not hold the lease.
    NoLease,
    /// The caller has no grant for this camera, or it was revoked.
    NoGrant,
    /// Another holds the lease.
    Leased {
        /// Who.
        holder: String,
        /// For how long, unless it is renewed.
        left: Duration,
        /// Whether the holder has the name of the caller: another program or window of the same person, token
        /// or address.
        same_name: bool,
    },
    /// An admin is taking the lease.
    BeingTaken,
    /// A stop holds.
    Stopped,
    /// A stop is still under way.
    StopUnderWay,
    /// Another stop has begun since the caller looked.
    StoppedSince,
    /// Another robot than before answers.
    IdentityChanged,
    /// Another robot than the accepted one answers.
    AnotherIdentity,
    /// The robot does not answer, or its state was not read for too long.
    NotUp,
    /// The robot is in manual mode: the pendant leads.
    Manual,
    /// The robot was removed, or the gateway ends.
    Closed,
    /// The robot is being configured anew.
    Reconfiguring,
    /// A run of a program has the robot.
    RunUnderWay,
    /// The run was cut short, or is over.
    RunOver,
    /// The lease has ended, and its run is being stopped.
    RunEnding,
    /// A list of an earlier run, or of a run that was cut short, may still be at the robot.
    ListLeft,
    /// No stop is owed.
    NothingOwed,
    /// A stop is owed, and the robot answers, or another one does.
    InReach,
    /// No stop holds.
    NoStopHolds,
    /// It waited too long, or permits were voided while it waited.
    Overtaken,
    /// A command that stops needs no permit.
    NeedsNone,
}

impl fmt::Display for Denied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoLease => f.write_str(
                "you do not hold the lease of this robot, or it has ended: acquire one, and send its number and \
                 secret with each command",
            ),
            Self::NoGrant => f.write_str(
                "you have no grant to feed this camera of this robot, or it was revoked: an admin gives one to a token",
            ),
            Self::Leased { holder, left, same_name } => {
                let left = left.as_millis();
                write!(f, "{holder} holds the lease for {left} ms more, unless it is renewed")?;
                if *same_name {
                    f.write_str("; that is your own name: another program or window of yours took it")?;
                }
                Ok(())
            }
            Self::BeingTaken => f.write_str("an admin is taking the lease, and the robot is being stopped"),
            Self::Stopped => f.write_str(
                "the robot was stopped: look at it, then let the holder of the lease clear the stop \
                 (POST …/clear-stopped)",
            ),
            Self::StoppedSince => f.write_str(
                "another stop was made since: nothing was cleared; look at the robot, then clear the stop again",
            ),
            Self::StopUnderWay => f.write_str("a stop is still under way: wait for its end"),
            Self::IdentityChanged => f.write_str(
                "another robot than before answers at this address: an engineer has to accept it first \
                 (POST …/accept-identity)",
            ),
            Self::AnotherIdentity => {
                f.write_str("this is not the robot that answers now: read identity_changed.found again")
            }
            Self::NotUp => f.write_str("the robot does not answer, or its state could not be read lately"),
            Self::Manual => f.write_str("the robot is in manual mode: the pendant leads"),
            Self::Closed => f.write_str("the robot was removed from the gateway, goes to another one, or the gateway ends"),
            Self::Reconfiguring => f.write_str("the robot is being configured anew: ask again"),
            Self::RunUnderWay => f.write_str(
                "a program runs on this robot: until its end, commands that move, lists, and changes of the tool or the \
                 work frame are not sent; a stop ends it",
            ),
            Self::RunOver => f.write_str("the run of the program was cut short"),
            Self::RunEnding => {
                f.write_str("the lease has ended, and the program that ran with it is being stopped: ask again")
            }
            Self::ListLeft => f.write_str(
                "a list of a program that the gateway ran may still be at the robot: the gateway stops it as soon as the \
                 robot answers; wait for that",
            ),
            Self::NothingOwed => {
                f.write_str("no list of a run is left at this robot: there is nothing to forget")
            }
            Self::InReach => f.write_str(
                "a robot answers at this address: the gateway stops the list of the run by itself, or an engineer accepts \
                 the robot that answers (POST …/accept-identity)",
            ),
            Self::NoStopHolds => f.write_str(
                "stop the robot first: the stop holds, also if it does not reach the robot, until it is cleared",
            ),
            Self::Overtaken => f.write_str(
                "nothing was sent: while the request waited for the disk, a stop or another change came in between, or \
                 it waited too long; look at the robot, then ask again",
            ),
            Self::NeedsNone => f.write_str("a command that stops needs no lease"),
        }
    }
}

impl std::error::Error for Denied {}

impl Seat {
    /// Permits one command or list, if the caller holds the lease and the robot may get it.
    ///
    /// # Errors
    /// [`Denied`].
    pub fn permit(&mut self, now: Instant, key: Key, order: impl Into<Order>) -> Result<Permit, Denied> {
        let order = order.into();
        self.check_order(now, key, &order)?;
        self.permit_any(now, key, order)
    }

    /// Permits what a camera sends, if the robot may get it. The caller has a standing grant for the camera.
    /// It needs no lease, and another caller may hold that. It is checked as a command that moves: a program
    /// may wait for it.
    ///
    /// # Errors
    /// [`Denied`]; [`Denied::NoGrant`] for what another camera or no camera sends.
    pub fn permit_granted(
        &mut self,
        now: Instant,
        standing: Standing,
        order: Order,
    ) -> Result<Permit, Denied> {
        let connection = self.check_granted(now, standing, &order)?;
        let (ground, generation) = (Ground::Grant, self.standing_generation);
        Ok(Permit { order, connection, latest: now + LEAVE_WITHIN, ground, generation })
    }

    /// The connection, if what a camera sends would be permitted now.
    ///
    /// # Errors
    /// [`Denied`].
    pub fn check_granted(&mut self, now: Instant, standing: Standing, order: &Order) -> Result<u64, Denied> {
        if order.camera() != Some(standing.camera()) {
            return Err(Denied::NoGrant);
        }
        self.handle_timeout(now);
        self.is_this_robot()?;
        if self.has_run() {
            return Err(Denied::RunUnderWay);
        }
        self.is_fit(now, Effect::Moves)
    }

    /// What is asked for now.
    #[must_use]
    pub fn asked(&self, now: Instant) -> Asked {
        Asked { at: now, generation: self.generation }
    }

    /// What a camera asks for now.
    #[must_use]
    pub fn asked_by_camera(&self, now: Instant) -> Asked {
        Asked { at: now, generation: self.standing_generation }
    }

    /// Whether what was asked for then may still be done.
    ///
    /// # Errors
    /// [`Denied::Overtaken`].
    pub fn check_asked(&self, now: Instant, asked: Asked) -> Result<(), Denied> {
        asked.check(now, self.generation)
    }

    /// Whether this command or list would be permitted now.
    ///
    /// # Errors
    /// [`Denied`].
    pub fn check_order(&mut self, now: Instant, key: Key, order: &Order) -> Result<(), Denied> {
        if order.camera().is_some() {
            return Err(Denied::NoGrant);
        }
        if self.has_run() && order.disturbs_run() {
            self.held(now, key)?;
            return Err(Denied::RunUnderWay);
        }
        self.check(now, key, order.effect())
    }

    /// As [`Self::permit`], also for the run that has the robot.
    pub(super) fn permit_any(&mut self, now: Instant, key: Key, order: Order) -> Result<Permit, Denied> {
        let (connection, until) = self.may(now, key, order.effect())?;
        let latest = until.min(now + LEAVE_WITHIN);
        let (ground, generation) = (Ground::Lease, self.generation);
        Ok(Permit { order, connection, latest, ground, generation })
    }

    /// Whether a command with this effect would be permitted now.
    ///
    /// # Errors
    /// [`Denied`].
    pub fn check(&mut self, now: Instant, key: Key, effect: Effect) -> Result<(), Denied> {
        self.may(now, key, effect).map(|_| ())
    }

    /// Whether a command with this effect would be permitted now to a caller that gets the lease for it.
    ///
    /// # Errors
    /// [`Denied`].
    pub fn check_before_lease(&self, now: Instant, effect: Effect) -> Result<(), Denied> {
        self.is_fit(now, effect).map(|_| ())
    }

    /// The connection, and until when the caller holds the lease.
    pub(super) fn may(&mut self, now: Instant, key: Key, effect: Effect) -> Result<(u64, Instant), Denied> {
        self.is_this_robot()?;
        let until = self.held(now, key)?.until;
        Ok((self.is_fit(now, effect)?, until))
    }

    /// The connection, if the robot may get a command with this effect from the holder of the lease.
    fn is_fit(&self, now: Instant, effect: Effect) -> Result<u64, Denied> {
        let link = self.fit_link(now, effect)?;
        if link.manual { Err(Denied::Manual) } else { Ok(link.connection) }
    }

    /// Refuses if the robot gets nothing any more, or if another one answers.
    pub(super) fn is_this_robot(&self) -> Result<(), Denied> {
        if self.closed {
            return Err(Denied::Closed);
        }
        if self.stranger.is_some() {
            return Err(Denied::IdentityChanged);
        }
        Ok(())
    }

    /// The connection, if the robot may get something with this effect, but for its mode.
    pub(super) fn fit_link(&self, now: Instant, effect: Effect) -> Result<Link, Denied> {
        self.is_this_robot()?;
        if self.reconfiguring {
            return Err(Denied::Reconfiguring);
        }
        match effect {
            Effect::Stops | Effect::Reads => return Err(Denied::NeedsNone),
            Effect::Moves if self.saved.stopped => return Err(Denied::Stopped),
            Effect::Moves | Effect::Changes if self.stops_under_way > 0 => return Err(Denied::StopUnderWay),
            Effect::Moves | Effect::Changes if self.owes_stop() || self.run_cut().is_some() => {
                return Err(Denied::ListLeft);
            }
            Effect::Moves | Effect::Changes => {}
        }
        self.link.filter(|link| now.since(link.seen_at) <= self.fresh_for).ok_or(Denied::NotUp)
    }
}

#[cfg(test)]
mod tests {
    use r6_api::gateway::RobotIdentity;
    use r6_proto::Command;

    use super::*;
    use crate::core::seat::{Ask, Saved, Secret};

    const NOW: Instant = Instant::ORIGIN;

    #[test]
    fn what_waited_too_long_or_was_overtaken_by_a_stop_is_not_sent() {
        let mut seat = Seat::new(Saved::default(), Duration::from_secs(60));
        let ask = Ask { holder: "anna".to_owned(), lasts: Duration::from_secs(60), secret: Secret([7; 16]) };
        let key = seat.acquire(NOW, ask).unwrap().key;
        seat.identified(RobotIdentity { axis_count: Some(6), ..RobotIdentity::default() });
        seat.observed(NOW, 1, false);
        let asked = seat.asked(NOW);
        let mut admitted = |now, asked: Asked| {
            let permit = seat.permit(now, key, Command::StartButton)?;
            asked.admit(now, permit).map(drop)
        };
        assert_eq!(admitted(NOW + WAIT_WITHIN, asked), Ok(()));
        let late = NOW + WAIT_WITHIN + Duration::from_millis(1);
        assert_eq!(admitted(late, asked), Err(Denied::Overtaken));
        seat.stop_begins();
        seat.stop_ends();
        seat.clear(NOW, key, None).unwrap();
        let permit = seat.permit(NOW, key, Command::StartButton).unwrap();
        assert_eq!(asked.admit(NOW, permit).map(drop), Err(Denied::Overtaken));
        assert_eq!(seat.check_asked(NOW, asked), Err(Denied::Overtaken));
        assert_eq!(seat.check_asked(NOW, seat.asked(NOW)), Ok(()));
    }
}
