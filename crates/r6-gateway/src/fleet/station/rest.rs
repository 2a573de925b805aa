//! Whether the arm of a robot is at rest.

use r6_api::AddressValue;
use r6_api::gateway::{LeaseEnd, Signal, SignalQuality};
use r6_client::Address;
use r6_proto::time::Instant;

use super::{FRESH_FOR, MAX_COMMANDS, MAX_STOPS, Station};
use crate::clock;

impl Station {
    /// Whether readings after the last command show that the arm stands, and that the list is empty. A robot
    /// that does not tell the length of its list counts as one with an empty list.
    pub(crate) fn is_at_rest(&self) -> (bool, bool) {
        let now = clock::now();
        let (moving, list, has_no_length) = {
            let board = self.board();
            let read = |address| board.signal(now, address);
            (
                read(Address::IsMoving),
                read(Address::RemoteCmdLen),
                board.is_unsupported(Address::RemoteCmdLen),
            )
        };
        let fresh = self.fresh();
        // Of a robot that is read seldom, a reading may be fresh and from before the arm began to move.
        let shows = |read: &(Signal, Option<Instant>)| {
            read.1.is_some_and(|asked_at| fresh.shows_all(asked_at) && now.since(asked_at) <= FRESH_FOR)
        };
        let stands = |read: &(Signal, _)| {
            read.0.quality == SignalQuality::Fresh && read.0.value == Some(AddressValue::Flag(false))
        };
        let is_empty = |read: &(Signal, _)| match read.0.quality {
            SignalQuality::Fresh => read.0.value == Some(AddressValue::Integer(0)),
            // It may have come and be unreadable.
            SignalQuality::None => has_no_length,
            SignalQuality::Stale => false,
        };
        (
            moving.is_some_and(|read| stands(&read) && shows(&read)),
            list.is_some_and(|read| is_empty(&read) && shows(&read)),
        )
    }

    /// Whether no command and no stop is under way.
    pub(super) fn is_idle(&self) -> bool {
        self.commands.available_permits() == MAX_COMMANDS as usize
            && self.stops.available_permits() == MAX_STOPS as usize
            && self.stop_commands.available_permits() == MAX_STOPS as usize
    }

    /// Takes leave of a robot with which nothing happens here, so that another gateway can have it: it is at
    /// rest, its lease is free, no run, command or stop is under way or owed, its controller waits for no
    /// photo, and no other robot answers in its place. From then on nothing is permitted. `false`: it stays
    /// as it is.
    pub(crate) fn leave_if_idle(&self) -> bool {
        let rests = self.is_at_rest() == (true, true) && self.is_written();
        let is_free = self.is_idle() && self.beginning.try_lock().is_ok();
        self.seat(|seat, now| {
            let is_idle = seat.lease(now).is_none()
                && !self.cameras.may_wait(now)
                && !seat.has_run()
                && !seat.owes_stop()
                && seat.stops().1 == 0
                && seat.is_up()
                && seat.identity_change().is_none();
            let leaves = rests && is_free && is_idle;
            if leaves {
                seat.close(LeaseEnd::OwnerChanged);
            }
            leaves
        })
    }
}
