//! Who may use the panel of a virtual robot now.

use r6_proto::time::Instant;

use super::{Denied, Key, Seat};
use crate::core::panel::{Needs, Press};

impl Seat {
    /// Whether the panel may get this action from the caller, with the key of the lease if it has one. In
    /// manual mode, too: the panel is the pendant. Actions that stop are not asked for here.
    ///
    /// # Errors
    /// [`Denied`].
    pub fn check_press(&mut self, now: Instant, key: Option<Key>, press: &Press) -> Result<(), Denied> {
        if self.closed {
            return Err(Denied::Closed);
        }
        if press.needs == Needs::Nothing {
            return Ok(());
        }
        self.is_this_robot()?;
        self.held(now, key.ok_or(Denied::NoLease)?)?;
        if press.needs == Needs::Lease {
            return Ok(());
        }
        if press.disturbs_run && self.has_run() {
            return Err(Denied::RunUnderWay);
        }
        self.fit_link(now, press.effect).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use r6_api::gateway::{LeaseEnd, RobotIdentity};

    use super::*;
    use crate::core::seat::{Ask, Saved, Secret};

    const NOW: Instant = Instant::ORIGIN;

    /// A seat with a lease, whose robot is in manual mode, and its key.
    fn seat() -> (Seat, Key) {
        let mut seat = Seat::new(Saved::default(), Duration::from_secs(1));
        let ask = Ask { holder: "anna".to_owned(), lasts: Duration::from_secs(60), secret: Secret([7; 16]) };
        let key = seat.acquire(NOW, ask).unwrap().key;
        seat.identified(RobotIdentity { axis_count: Some(6), ..RobotIdentity::default() });
        seat.observed(NOW, 1, true);
        (seat, key)
    }

    fn press(json: &str) -> Press {
        Press::new(serde_json::from_str(json).unwrap())
    }

    fn jog() -> Press {
        press(r#"{"do":"jog","axis":"J1","by":10}"#)
    }

    fn key_to_auto() -> Press {
        press(r#"{"do":"turn_key","key":"auto"}"#)
    }

    #[test]
    fn the_panel_leads_in_manual_mode_and_commands_do_not() {
        let (mut seat, key) = seat();
        for press in [jog(), key_to_auto()] {
            assert_eq!(seat.check_press(NOW, Some(key), &press), Ok(()), "{press}");
            assert_eq!(seat.check(NOW, key, press.effect), Err(Denied::Manual), "{press}");
        }
    }

    #[test]
    fn nothing_moves_while_a_stop_holds_and_nothing_changes_while_it_is_under_way() {
        let (mut seat, key) = seat();
        seat.stop_begins();
        assert_eq!(seat.check_press(NOW, Some(key), &jog()), Err(Denied::Stopped));
        assert_eq!(seat.check_press(NOW, Some(key), &key_to_auto()), Err(Denied::StopUnderWay));
        seat.stop_ends();
        assert_eq!(seat.check_press(NOW, Some(key), &jog()), Err(Denied::Stopped));
        assert_eq!(seat.check_press(NOW, Some(key), &key_to_auto()), Ok(()));
        seat.clear(NOW, key, None).unwrap();
        assert_eq!(seat.check_press(NOW, Some(key), &jog()), Ok(()));
    }

    #[test]
    fn a_run_is_not_disturbed_and_meets_faults_and_inputs() {
        let (mut seat, key) = seat();
        seat.observed(NOW, 1, false);
        seat.begin_run(NOW, key).unwrap();
        assert_eq!(seat.check_press(NOW, Some(key), &jog()), Err(Denied::RunUnderWay));
        let start = press(r#"{"do":"press","button":"start"}"#);
        assert_eq!(seat.check_press(NOW, Some(key), &start), Err(Denied::RunUnderWay));
        for json in [r#"{"do":"raise_alarm","alarm":850}"#, r#"{"do":"set_input","point":"X010","on":true}"#]
        {
            assert_eq!(seat.check_press(NOW, Some(key), &press(json)), Ok(()), "{json}");
        }
    }

    #[test]
    fn only_the_holder_of_this_robot_uses_a_panel_that_answers() {
        let (mut seat, key) = seat();
        let other = Key { number: key.number, secret: Secret([8; 16]) };
        assert_eq!(seat.check_press(NOW, Some(other), &jog()), Err(Denied::NoLease));
        let late = NOW + Duration::from_secs(2);
        assert_eq!(seat.check_press(late, Some(key), &jog()), Err(Denied::NotUp), "its state is too old");
        let over = NOW + Duration::from_secs(61);
        assert_eq!(seat.check_press(over, Some(key), &jog()), Err(Denied::NoLease));
        let (mut seat, key) = self::seat();
        seat.link_lost();
        assert_eq!(seat.check_press(NOW, Some(key), &jog()), Err(Denied::NotUp));
        let (mut seat, key) = self::seat();
        seat.identified(RobotIdentity { axis_count: Some(4), ..RobotIdentity::default() });
        assert_eq!(seat.check_press(NOW, Some(key), &jog()), Err(Denied::IdentityChanged));
        let (mut seat, key) = self::seat();
        seat.close(LeaseEnd::GatewayEnded);
        assert_eq!(seat.check_press(NOW, Some(key), &jog()), Err(Denied::Closed));
    }

    #[test]
    fn faults_begin_at_a_robot_that_does_not_answer_and_end_without_a_lease() {
        let (mut seat, key) = seat();
        let begin = press(r#"{"do":"begin_fault","fault":"silence"}"#);
        let end = press(r#"{"do":"end_faults"}"#);
        let let_go = press(r#"{"do":"end_jog"}"#);
        seat.stop_begins();
        seat.link_lost();
        for press in [&begin, &let_go] {
            assert_eq!(seat.check_press(NOW, Some(key), press), Ok(()), "{press}");
            assert_eq!(seat.check_press(NOW, None, press), Err(Denied::NoLease), "{press}");
        }
        assert_eq!(seat.check_press(NOW, None, &end), Ok(()));
        seat.identified(RobotIdentity { axis_count: Some(4), ..RobotIdentity::default() });
        assert_eq!(seat.check_press(NOW, Some(key), &begin), Err(Denied::IdentityChanged));
        assert_eq!(seat.check_press(NOW, None, &end), Ok(()), "a fault can make the robot look like another");
        seat.close(LeaseEnd::GatewayEnded);
        assert_eq!(seat.check_press(NOW, None, &end), Err(Denied::Closed));
    }

    #[test]
    fn a_button_that_is_held_moves_nothing_once_a_stop_holds_or_the_lease_is_gone() {
        let (mut seat, key) = seat();
        let hold = press(r#"{"do":"hold_jog","axis":"J1","up":true}"#);
        let keep = press(r#"{"do":"keep_jog"}"#);
        for press in [&hold, &keep] {
            assert_eq!(seat.check_press(NOW, Some(key), press), Ok(()));
        }
        seat.stop_begins();
        seat.stop_ends();
        assert_eq!(seat.check_press(NOW, Some(key), &keep), Err(Denied::Stopped));
        let over = NOW + Duration::from_secs(61);
        assert_eq!(seat.check_press(over, Some(key), &keep), Err(Denied::NoLease));
    }
}
