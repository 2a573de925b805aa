//! The global speed as it was last set over the gateway.
//!
//! The protocol does not tell the global speed, so it is known from commands alone. It is forgotten as soon
//! as another one may hold: after a command whose outcome is not known, after commands that overlapped, after
//! a time without a connection in which the controller may have been switched off and on, and if another
//! robot answers. A person at the pendant can change it, and no forgetting helps against that.

use std::time::Duration;

use r6_api::gateway::GlobalSpeed;
use r6_proto::time::Instant;

use super::{Noticed, Seat};

/// A controller may have been switched off and on if it was not seen for longer, and answers over another
/// connection. Real ones take longer to start; a connection that is lost and made again takes less.
const MAY_RESTART: Duration = Duration::from_secs(1);

/// What became of a command that sets the global speed.
#[derive(Clone, Debug, PartialEq)]
pub enum SpeedAnswer {
    /// The controller accepted it.
    Set(GlobalSpeed),
    /// It did not leave, or the controller refused it.
    Unchanged,
    /// The controller may have accepted it.
    Unknown,
}

/// What is known.
#[derive(Debug, Default)]
pub(super) struct Speed {
    set: Option<GlobalSpeed>,
    /// How many commands that set it are under way.
    under_way: u32,
    /// Whether two of them were under way at once: which one came last is not known.
    overlaps: bool,
    /// Over which connection the robot was seen last, and when.
    seen: Option<(u64, Instant)>,
}

impl Seat {
    /// The global speed as it was last set, if that is known.
    #[must_use]
    pub fn global_speed(&self, now: Instant) -> Option<&GlobalSpeed> {
        let is_lost = |(_, seen): (u64, Instant)| self.link.is_none() && now.since(seen) > MAY_RESTART;
        self.speed.set.as_ref().filter(|_| !self.speed.seen.is_some_and(is_lost))
    }

    /// A command that sets the global speed is about to leave.
    pub fn speed_leaves(&mut self) {
        self.speed.overlaps |= self.speed.under_way > 0;
        self.speed.under_way = self.speed.under_way.saturating_add(1);
    }

    /// It was answered, or it will not be.
    pub fn speed_answered(&mut self, answer: SpeedAnswer) {
        self.speed.under_way = self.speed.under_way.saturating_sub(1);
        let overlaps = self.speed.overlaps;
        self.speed.overlaps &= self.speed.under_way > 0;
        match answer {
            SpeedAnswer::Set(set) if !overlaps && self.stranger.is_none() => {
                self.speed.set = Some(set.clone());
                self.noticed.push_back(Noticed::GlobalSpeed(Some(set)));
            }
            SpeedAnswer::Unchanged => {}
            SpeedAnswer::Set(_) | SpeedAnswer::Unknown => self.forget_speed(),
        }
    }

    /// Another speed may hold.
    pub(super) fn forget_speed(&mut self) {
        self.speed.seen = None;
        if self.speed.set.take().is_some() {
            self.noticed.push_back(Noticed::GlobalSpeed(None));
        }
    }

    /// The robot was seen.
    pub(super) fn seen_for_speed(&mut self, connection: u64, asked_at: Instant) {
        let may_have_restarted =
            |(on, seen): (u64, Instant)| on != connection && asked_at.since(seen) > MAY_RESTART;
        if self.speed.seen.is_some_and(may_have_restarted) {
            self.forget_speed();
        }
        self.speed.seen = Some((connection, asked_at));
    }
}

#[cfg(test)]
mod tests {
    use r6_api::gateway::RobotIdentity;

    use super::super::Saved;
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(millis)
    }

    fn speed(percent: f64) -> GlobalSpeed {
        GlobalSpeed { percent, by: "anna".to_owned(), at: "now".to_owned() }
    }

    /// A seat whose robot was seen on connection 1, with a speed that was set.
    fn seat() -> Seat {
        let mut seat = Seat::new(Saved::default(), Duration::from_secs(1));
        seat.identified(RobotIdentity { axis_count: Some(6), ..RobotIdentity::default() });
        seat.observed(at(0), 1, false);
        seat.speed_leaves();
        seat.speed_answered(SpeedAnswer::Set(speed(5.0)));
        assert_eq!(seat.global_speed(at(10)), Some(&speed(5.0)));
        seat
    }

    #[test]
    fn a_lost_connection_is_forgiven_and_a_time_in_which_the_controller_may_restart_is_not() {
        let mut seat = seat();
        seat.observed(at(500), 1, false);
        seat.link_lost();
        assert!(seat.global_speed(at(1_500)).is_some());
        assert_eq!(seat.global_speed(at(1_501)), None, "it may be off by now");
        seat.observed(at(1_500), 2, false);
        assert!(seat.global_speed(at(9_000)).is_some(), "the connection was made again at once");
        // The connection held, so the controller was not off.
        seat.link_lost();
        seat.observed(at(9_000), 2, false);
        assert!(seat.global_speed(at(9_000)).is_some());
        seat.link_lost();
        seat.observed(at(10_001), 3, false);
        assert_eq!(seat.global_speed(at(10_001)), None);
        let noticed: Vec<_> = std::iter::from_fn(|| seat.poll_noticed()).collect();
        let mut of_speed = noticed.iter().filter(|noticed| matches!(noticed, Noticed::GlobalSpeed(_)));
        assert_eq!(of_speed.next_back(), Some(&Noticed::GlobalSpeed(None)));
    }

    #[test]
    fn only_an_accepted_command_sets_it_and_one_with_an_unknown_outcome_forgets_it() {
        let mut seat = seat();
        seat.speed_leaves();
        seat.speed_answered(SpeedAnswer::Unchanged);
        assert_eq!(seat.global_speed(at(10)), Some(&speed(5.0)));
        seat.speed_leaves();
        seat.speed_answered(SpeedAnswer::Unknown);
        assert_eq!(seat.global_speed(at(10)), None);
    }

    #[test]
    fn of_two_commands_at_once_it_is_not_known_which_one_holds() {
        let mut seat = seat();
        seat.speed_leaves();
        seat.speed_leaves();
        seat.speed_answered(SpeedAnswer::Set(speed(50.0)));
        seat.speed_answered(SpeedAnswer::Set(speed(70.0)));
        assert_eq!(seat.global_speed(at(10)), None);
        seat.speed_leaves();
        seat.speed_answered(SpeedAnswer::Set(speed(80.0)));
        assert_eq!(seat.global_speed(at(10)), Some(&speed(80.0)));
    }

    #[test]
    fn another_robot_has_a_speed_of_its_own() {
        let another = || RobotIdentity { axis_count: Some(4), ..RobotIdentity::default() };
        let mut seat = seat();
        seat.identified(another());
        assert_eq!(seat.global_speed(at(10)), None);
        seat.speed_leaves();
        seat.speed_answered(SpeedAnswer::Set(speed(50.0)));
        assert_eq!(seat.global_speed(at(10)), None, "it was for the other one");
        let mut seat = self::seat();
        seat.reconfigured();
        assert_eq!(seat.global_speed(at(10)), None);
    }
}
