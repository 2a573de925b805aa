//! The seat at one robot: who may send commands to it now.
//!
//! A [`Seat`] knows the lease, the stop that holds, the identity and the link of one robot. It alone makes a
//! [`Permit`], and the fleet sends nothing that changes or moves without one. Times are those of one clock
//! that counts suspend. [`Seat::generation`] grows whenever all permits made so far on a ground are void.
//! `run.rs` has the run of a program, `panel.rs` the panel of a virtual robot, which needs no permit.
//! `speed.rs` knows the global speed as it was last set.

mod panel;
mod permit;
mod run;
mod speed;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;

use r6_api::gateway::{ActedBy, GlobalSpeed, IdentityChange, LeaseEnd, RobotIdentity};
use r6_proto::time::Instant;

pub use permit::{Asked, Denied, Ground, Permit};
pub use run::{Cut, Left, Ticket};
pub use speed::SpeedAnswer;

/// The shortest lease that can be asked for.
pub const SHORTEST_LEASE: Duration = Duration::from_secs(2);

/// The longest lease that can be asked for.
pub const LONGEST_LEASE: Duration = Duration::from_secs(300);

/// A lease lasts this long if nothing else is asked for.
pub const USUAL_LEASE: Duration = Duration::from_secs(10);

/// What proves that a caller holds a lease: random bytes that the shell draws.
#[derive(Clone, Copy)]
pub struct Secret(pub [u8; 16]);

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret(..)")
    }
}

impl Secret {
    /// Compares in a time that does not depend on where the two differ.
    fn is(self, other: Self) -> bool {
        self.0.iter().zip(other.0).fold(0, |all, (a, b)| all | (a ^ b)) == 0
    }
}

/// The number and the secret of a lease, as a caller names it.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// The number.
    pub number: u64,
    /// The secret.
    pub secret: Secret,
}

/// A request for a new lease.
#[derive(Clone, Debug)]
pub struct Ask {
    /// Who asks: what others see.
    pub holder: String,
    /// How long it lasts; limited to [`SHORTEST_LEASE`] and [`LONGEST_LEASE`].
    pub lasts: Duration,
    /// The secret of the new lease.
    pub secret: Secret,
}

/// What a caller gets.
#[derive(Clone, Copy, Debug)]
pub struct Granted {
    /// The lease.
    pub key: Key,
    /// When it ends.
    pub until: Instant,
}

/// What survives the end of the process.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Saved {
    /// The number of the last lease.
    pub number: u64,
    /// Whether a stop holds.
    pub stopped: bool,
    /// Who made the stop that holds, and when; `None` if none holds or that is not known.
    pub stopped_by: Option<ActedBy>,
    /// The robot that this name stands for; `None` until one has answered.
    pub identity: Option<RobotIdentity>,
}

/// Something that a seat noticed, for the log and for streams.
#[derive(Clone, Debug, PartialEq)]
pub enum Noticed {
    /// A lease began.
    LeaseBegan {
        /// Its number.
        number: u64,
        /// Its holder.
        holder: String,
    },
    /// A lease ended.
    LeaseEnded {
        /// Its number.
        number: u64,
        /// Its holder.
        holder: String,
        /// Why.
        cause: LeaseEnd,
    },
    /// Another robot answers.
    IdentityChanged(IdentityChange),
    /// It answers, and its state was read.
    LinkUp,
    /// It does not answer.
    LinkDown,
    /// The global speed was set, or it is not known any more.
    GlobalSpeed(Option<GlobalSpeed>),
}

#[derive(Clone, Debug)]
struct Lease {
    number: u64,
    secret: Secret,
    holder: String,
    until: Instant,
    /// Why it ends, if it only waits for the end of its run. It permits nothing any more.
    ends: Option<LeaseEnd>,
}

/// What is known of a connection whose robot was read.
#[derive(Clone, Copy, Debug)]
struct Link {
    connection: u64,
    /// When the mode was last asked for and answered.
    seen_at: Instant,
    manual: bool,
}

/// The seat at one robot.
#[derive(Debug)]
pub struct Seat {
    saved: Saved,
    lease: Option<Lease>,
    /// Whether an admin takes the lease: the robot is being stopped for that.
    taking: bool,
    stops_under_way: u32,
    /// How many stops have begun.
    stops_begun: u64,
    /// The number of the last stop that was told to all who follow the robot.
    stop_number: u64,
    /// The robot that answers, if it is another than expected.
    stranger: Option<RobotIdentity>,
    link: Option<Link>,
    /// Whether this robot gets no command any more.
    closed: bool,
    /// Whether the robot is being configured anew: it gets no command until that is done.
    reconfiguring: bool,
    /// The run that has the robot.
    run: Option<run::Run>,
    /// How many runs there were.
    runs: u64,
    /// Whether a list of an earlier run may still be at the robot.
    owes_stop: bool,
    /// The global speed as it was last set.
    speed: speed::Speed,
    /// For how long an observation of the mode counts.
    fresh_for: Duration,
    /// Of permits that rest on the lease.
    generation: u64,
    /// Of permits that rest on a standing grant.
    standing_generation: u64,
    noticed: VecDeque<Noticed>,
}

/// The lease as everybody may see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeaseView {
    /// Its number.
    pub number: u64,
    /// Its holder.
    pub holder: String,
    /// How long it lasts.
    pub left: Duration,
}

impl Seat {
    /// The seat of a robot, as it was saved. No lease outlives the process.
    ///
    /// `fresh_for`: a command needs an observation of the robot's mode that is no older.
    #[must_use]
    pub fn new(saved: Saved, fresh_for: Duration) -> Self {
        Self {
            saved,
            lease: None,
            taking: false,
            stops_under_way: 0,
            stops_begun: 0,
            stop_number: 0,
            stranger: None,
            link: None,
            closed: false,
            reconfiguring: false,
            run: None,
            runs: 0,
            owes_stop: false,
            speed: speed::Speed::default(),
            fresh_for,
            generation: 0,
            standing_generation: 0,
            noticed: VecDeque::new(),
        }
    }

    /// Stops get numbers behind this one. Give a number that no stop of the robot had yet, also not before a
    /// restart or at another gateway: else a caller could clear a stop that it has not seen.
    #[must_use]
    pub fn with_stops_behind(mut self, number: u64) -> Self {
        self.stop_number = number;
        self
    }

    /// What has to be saved.
    #[must_use]
    pub fn saved(&self) -> &Saved {
        &self.saved
    }

    /// Grows whenever all permits made so far on this ground are void.
    #[must_use]
    pub fn generation(&self, ground: Ground) -> u64 {
        match ground {
            Ground::Lease => self.generation,
            Ground::Grant => self.standing_generation,
        }
    }

    /// A standing grant was revoked: what cameras have asked for and has not left yet does not leave.
    pub fn grant_is_revoked(&mut self) {
        self.standing_generation += 1;
    }

    /// The next thing that was noticed.
    pub fn poll_noticed(&mut self) -> Option<Noticed> {
        self.noticed.pop_front()
    }

    /// When to call [`Self::handle_timeout`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.lease.as_ref().filter(|lease| lease.ends.is_none()).map(|lease| lease.until)
    }

    /// Ends a lease whose time is up.
    pub fn handle_timeout(&mut self, now: Instant) {
        if self.lease.as_ref().is_some_and(|lease| lease.ends.is_none() && lease.until <= now) {
            self.finish_lease(LeaseEnd::Expired);
        }
    }

    /// The lease, if there is one. It may wait for the end of its run.
    #[must_use]
    pub fn lease(&self, now: Instant) -> Option<LeaseView> {
        let is_there = |lease: &&Lease| now < lease.until || self.is_of_run(lease.number);
        self.lease.as_ref().filter(is_there).map(|lease| LeaseView {
            number: lease.number,
            holder: lease.holder.clone(),
            left: lease.until.since(now),
        })
    }

    /// Whether a stop holds, and how many stops are under way.
    #[must_use]
    pub fn stops(&self) -> (bool, u32) {
        (self.saved.stopped, self.stops_under_way)
    }

    /// How many stops have begun until now, also those that were cleared.
    #[must_use]
    pub fn stops_begun(&self) -> u64 {
        self.stops_begun
    }

    /// Whether the robot answers and its state was read on this connection.
    #[must_use]
    pub fn is_up(&self) -> bool {
        self.link.is_some()
    }

    /// The connection over which the robot answers.
    #[must_use]
    pub fn connection(&self) -> Option<u64> {
        self.link.map(|link| link.connection)
    }

    /// Whether it is known which robot has to answer.
    #[must_use]
    pub fn is_identified(&self) -> bool {
        self.saved.identity.is_some()
    }

    /// The robot that answers in place of the expected one.
    #[must_use]
    pub fn identity_change(&self) -> Option<IdentityChange> {
        let found = self.stranger.clone()?;
        Some(IdentityChange { expected: self.saved.identity.clone().unwrap_or_default(), found })
    }

    /// Gives out the lease if it is free.
    ///
    /// # Errors
    /// [`Denied::Leased`], [`Denied::RunEnding`], [`Denied::BeingTaken`], [`Denied::IdentityChanged`],
    /// [`Denied::Reconfiguring`], [`Denied::Closed`].
    pub fn acquire(&mut self, now: Instant, ask: Ask) -> Result<Granted, Denied> {
        self.handle_timeout(now);
        if self.closed {
            return Err(Denied::Closed);
        }
        if self.reconfiguring {
            return Err(Denied::Reconfiguring);
        }
        if self.stranger.is_some() {
            return Err(Denied::IdentityChanged);
        }
        if self.lease.as_ref().is_some_and(|lease| lease.ends.is_some()) {
            return Err(Denied::RunEnding);
        }
        if let Some(lease) = self.lease(now) {
            let same_name = lease.holder == ask.holder;
            return Err(Denied::Leased { holder: lease.holder, left: lease.left, same_name });
        }
        if self.taking {
            return Err(Denied::BeingTaken);
        }
        Ok(self.grant(now, ask))
    }

    /// Lets the lease last longer, from now on.
    ///
    /// # Errors
    /// [`Denied::NoLease`].
    pub fn renew(&mut self, now: Instant, key: Key, lasts: Duration) -> Result<Granted, Denied> {
        self.handle_timeout(now);
        let until = now + lasts.clamp(SHORTEST_LEASE, LONGEST_LEASE);
        let lease = self.lease.as_mut().filter(|lease| lease.fits(key)).ok_or(Denied::NoLease)?;
        lease.until = until;
        Ok(Granted { key, until })
    }

    /// Gives the lease back. A run of it is cut short, and the lease is free once that is over.
    ///
    /// # Errors
    /// [`Denied::NoLease`].
    pub fn release(&mut self, now: Instant, key: Key) -> Result<(), Denied> {
        self.held(now, key)?;
        self.finish_lease(LeaseEnd::Released);
        Ok(())
    }

    /// Takes the lease from its holder. The caller stops the robot, and then ends this with
    /// [`Self::end_taking`].
    ///
    /// # Errors
    /// [`Denied::BeingTaken`], [`Denied::IdentityChanged`], [`Denied::Closed`].
    pub fn begin_taking(&mut self, now: Instant) -> Result<(), Denied> {
        self.handle_timeout(now);
        if self.closed {
            return Err(Denied::Closed);
        }
        if self.stranger.is_some() {
            return Err(Denied::IdentityChanged);
        }
        if self.taking {
            return Err(Denied::BeingTaken);
        }
        self.taking = true;
        self.end_lease(LeaseEnd::Taken);
        Ok(())
    }

    /// Gives the lease to the caller that took it, after the robot was stopped. The stop still holds.
    ///
    /// # Errors
    /// [`Denied::IdentityChanged`]: another robot answers by now. [`Denied::Closed`].
    pub fn end_taking(&mut self, now: Instant, ask: Ask) -> Result<Granted, Denied> {
        self.taking = false;
        if self.closed {
            return Err(Denied::Closed);
        }
        if self.stranger.is_some() {
            return Err(Denied::IdentityChanged);
        }
        Ok(self.grant(now, ask))
    }

    /// A stop or a pause was asked for. It holds until [`Self::clear`].
    pub fn stop_begins(&mut self) {
        self.saved.stopped = true;
        self.stops_under_way = self.stops_under_way.saturating_add(1);
        self.stops_begun += 1;
        self.cut_run(Cut::Stop);
        self.void_permits();
    }

    /// Notes who made the stop that holds, unless that is known, and of a run who cut it short.
    pub fn name_stop(&mut self, who: &ActedBy) {
        if self.saved.stopped {
            self.saved.stopped_by.get_or_insert_with(|| who.clone());
        }
        self.name_cut(who);
    }

    /// A stop or a pause came to its end, whatever its outcome.
    pub fn stop_ends(&mut self) {
        self.stops_under_way = self.stops_under_way.saturating_sub(1);
    }

    /// The stop that has just begun is told to all who follow the robot. Returns its number. Not each one
    /// is: a caller that stops a stopped robot again and again must not push the events of others out.
    pub fn stop_is_told(&mut self) -> u64 {
        self.stop_number += 1;
        self.stop_number
    }

    /// The number of the last stop that was told.
    #[must_use]
    pub fn stop_number(&self) -> u64 {
        self.stop_number
    }

    /// Lets the robot move again. `seen`: the number of the last stop that the caller was told of; `None`
    /// clears any.
    ///
    /// # Errors
    /// [`Denied::NoLease`], [`Denied::StopUnderWay`], [`Denied::StoppedSince`].
    pub fn clear(&mut self, now: Instant, key: Key, seen: Option<u64>) -> Result<(), Denied> {
        self.held(now, key)?;
        if seen.is_some_and(|seen| seen != self.stop_number) {
            return Err(Denied::StoppedSince);
        }
        if self.stops_under_way > 0 {
            return Err(Denied::StopUnderWay);
        }
        self.saved.stopped = false;
        self.saved.stopped_by = None;
        Ok(())
    }

    /// A robot answered and said who it is. The first one is the robot that this name stands for.
    pub fn identified(&mut self, found: RobotIdentity) {
        match &mut self.saved.identity {
            None => self.saved.identity = Some(found),
            Some(expected) if is_same(expected, &found) => {
                complete(expected, found);
                self.stranger = None;
            }
            Some(_) if self.stranger.as_ref() == Some(&found) => {}
            Some(_) => {
                self.stranger = Some(found);
                self.forget_speed();
                self.void_permits();
                self.end_lease(LeaseEnd::IdentityChanged);
                self.noticed.extend(self.identity_change().map(Noticed::IdentityChanged));
            }
        }
    }

    /// From now on this name stands for the robot that answers. The person who accepts it has looked at it:
    /// a stop holds only if it held before.
    ///
    /// # Errors
    /// [`Denied::AnotherIdentity`]: this is not the robot that answers.
    pub fn accept_identity(&mut self, accepted: &RobotIdentity) -> Result<(), Denied> {
        if self.stranger.as_ref() != Some(accepted) {
            return Err(Denied::AnotherIdentity);
        }
        self.saved.identity = self.stranger.take();
        // Another robot has no list of an earlier run, and a speed of its own.
        self.owes_stop = false;
        self.forget_speed();
        self.run.iter_mut().for_each(|run| run.is_elsewhere = true);
        Ok(())
    }

    /// Forgets which robot this name stands for. The next robot that answers is the robot of this name.
    pub fn forget_identity(&mut self) {
        self.forget_speed();
        self.saved.identity = None;
        self.stranger = None;
    }

    /// The robot's state was read on this connection.
    pub fn observed(&mut self, asked_at: Instant, connection: u64, manual: bool) {
        match self.link {
            None => self.noticed.push_back(Noticed::LinkUp),
            Some(link) if link.connection != connection => {
                self.cut_run(Cut::LinkLost);
                self.void_permits();
            }
            Some(_) => {}
        }
        self.seen_for_speed(connection, asked_at);
        self.link = Some(Link { connection, seen_at: asked_at, manual });
    }

    /// The connection ended, or nothing comes back over it.
    pub fn link_lost(&mut self) {
        if self.link.take().is_some() {
            self.cut_run(Cut::LinkLost);
            self.void_permits();
            self.noticed.push_back(Noticed::LinkDown);
        }
    }

    /// The robot is configured anew: the lease ends, and who answers has to be asked again. A stop still
    /// holds.
    pub fn reconfigured(&mut self) {
        self.reconfiguring = false;
        self.end_lease(LeaseEnd::Reconfigured);
        self.forget_speed();
        self.link_lost();
        self.stranger = None;
    }

    /// No command is permitted any more: the robot was removed, or the gateway ends.
    pub fn close(&mut self, cause: LeaseEnd) {
        self.closed = true;
        self.end_lease(cause);
        self.cut_run(Cut::Lease(cause));
        self.void_permits();
    }

    fn grant(&mut self, now: Instant, ask: Ask) -> Granted {
        self.saved.number += 1;
        let number = self.saved.number;
        let until = now + ask.lasts.clamp(SHORTEST_LEASE, LONGEST_LEASE);
        self.noticed.push_back(Noticed::LeaseBegan { number, holder: ask.holder.clone() });
        self.lease = Some(Lease { number, secret: ask.secret, holder: ask.holder, until, ends: None });
        Granted { key: Key { number, secret: ask.secret }, until }
    }

    fn held(&mut self, now: Instant, key: Key) -> Result<&Lease, Denied> {
        self.handle_timeout(now);
        self.lease.as_ref().filter(|lease| lease.fits(key)).ok_or(Denied::NoLease)
    }

    /// Ends the lease once its run is over: at once without a run.
    fn finish_lease(&mut self, cause: LeaseEnd) {
        let of_run = self.lease.as_ref().is_some_and(|lease| self.is_of_run(lease.number));
        match &mut self.lease {
            Some(lease) if of_run => {
                lease.ends = Some(cause);
                self.cut_run(Cut::Lease(cause));
                self.generation += 1;
            }
            _ => self.end_lease(cause),
        }
    }

    fn end_lease(&mut self, cause: LeaseEnd) {
        if let Some(Lease { number, holder, .. }) = self.lease.take() {
            if self.is_of_run(number) {
                self.cut_run(Cut::Lease(cause));
            }
            // Cameras need no lease.
            self.generation += 1;
            self.noticed.push_back(Noticed::LeaseEnded { number, holder, cause });
        }
    }

    fn void_permits(&mut self) {
        self.generation += 1;
        self.standing_generation += 1;
    }
}

impl Lease {
    /// Whether this is its key, and it does not end.
    fn fits(&self, key: Key) -> bool {
        self.ends.is_none() && self.number == key.number && self.secret.is(key.secret)
    }
}

/// Whether two identities can be of one robot: no value that both have differs.
fn is_same(expected: &RobotIdentity, found: &RobotIdentity) -> bool {
    fn agree<T: PartialEq>(one: Option<&T>, other: Option<&T>) -> bool {
        one.is_none() || other.is_none() || one == other
    }
    agree(expected.firmware.as_ref(), found.firmware.as_ref())
        && agree(expected.machine_name.as_ref(), found.machine_name.as_ref())
        && agree(expected.axis_count.as_ref(), found.axis_count.as_ref())
}

/// Takes over what was not known yet.
fn complete(expected: &mut RobotIdentity, found: RobotIdentity) {
    let RobotIdentity { firmware, machine_name, axis_count } = found;
    expected.firmware = expected.firmware.take().or(firmware);
    expected.machine_name = expected.machine_name.take().or(machine_name);
    expected.axis_count = expected.axis_count.or(axis_count);
}
