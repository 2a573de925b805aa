//! The lease of scripts that know no leases.
//!
//! It begins with the first command that changes or moves. It ends 10 s after the last frame from its source,
//! once the list is empty and the arm stands. The seat still decides about each command.

use std::net::IpAddr;
use std::time::Duration;

use r6_proto::time::Instant;

use crate::core::seat::Key;

/// How long a source keeps the lease after its last frame: scripts connect, send, and close.
pub const KEPT_FOR: Duration = Duration::from_secs(10);

/// Who holds it: an address under a rule. All scripts of one computer are one holder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// The address.
    pub address: IpAddr,
    /// The rule, as its source is written.
    pub rule: String,
}

impl Holder {
    /// What others see of it.
    #[must_use]
    pub fn label(&self) -> String {
        format!("raw {} (rule {})", self.address, self.rule)
    }
}

/// What is known of the robot when the lease is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Rest {
    /// A reading after the last command shows that the arm stands.
    pub stands: bool,
    /// One shows that the list is empty.
    pub list_is_empty: bool,
    /// A stop holds.
    pub stopped: bool,
}

/// What has to be done with the lease.
#[derive(Clone, Copy, Debug)]
pub enum Due {
    /// There is no lease.
    Nothing,
    /// Let it last longer.
    Renew(Key),
    /// Give it back.
    Release(Key),
}

/// The implicit lease of one robot.
#[derive(Debug, Default)]
pub struct ImplicitLease {
    held: Option<Held>,
}

#[derive(Debug)]
struct Held {
    holder: Holder,
    key: Key,
    last_frame: Instant,
    /// How many commands are under way with it.
    in_use: u32,
    /// Whether what is in the list may be its own.
    has_list: bool,
}

impl ImplicitLease {
    /// The key of this holder, if it has the lease. The lease is in use until [`Self::used`].
    ///
    /// Also: whether what is in the list may be its own.
    pub fn begin_use(&mut self, holder: &Holder) -> Option<(Key, bool)> {
        let held = self.held.as_mut().filter(|held| held.holder == *holder)?;
        held.in_use = held.in_use.saturating_add(1);
        Some((held.key, held.has_list))
    }

    /// The controller accepted a list of the holder of this key.
    pub fn has_list(&mut self, key: Key) {
        if let Some(held) = self.held.as_mut().filter(|held| held.key.number == key.number) {
            held.has_list = true;
        }
    }

    /// The seat gave the lease to this holder. It is in use until [`Self::used`].
    pub fn granted(&mut self, now: Instant, holder: Holder, key: Key) {
        self.held = Some(Held { holder, key, last_frame: now, in_use: 1, has_list: false });
    }

    /// A command with this key came to its end.
    pub fn used(&mut self, key: Key) {
        if let Some(held) = self.held.as_mut().filter(|held| held.key.number == key.number) {
            held.in_use = held.in_use.saturating_sub(1);
        }
    }

    /// The seat does not know this key any more: the lease has ended.
    pub fn lost(&mut self, key: Key) {
        self.held.take_if(|held| held.key.number == key.number);
    }

    /// A frame came from this holder.
    pub fn frame(&mut self, now: Instant, holder: &Holder) {
        if let Some(held) = self.held.as_mut().filter(|held| held.holder == *holder) {
            held.last_frame = held.last_frame.max(now);
        }
    }

    /// What has to be done now. A stop that holds ends the lease as soon as the arm stands, because its
    /// holder cannot clear the stop, and the person who clears it needs the lease.
    #[must_use]
    pub fn due(&mut self, now: Instant, rest: Rest) -> Due {
        let Some(held) = &mut self.held else { return Due::Nothing };
        if rest.stands && rest.list_is_empty && held.in_use == 0 {
            held.has_list = false;
        }
        let is_gone = rest.list_is_empty && now.since(held.last_frame) >= KEPT_FOR;
        if held.in_use == 0 && rest.stands && (rest.stopped || is_gone) {
            Due::Release(held.key)
        } else {
            Due::Renew(held.key)
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::core::seat::{Ask, Saved, Seat, Secret, USUAL_LEASE};

    #[derive(Clone, Debug)]
    enum Step {
        Wait { ms: u64 },
        Frame { who: u8 },
        Use { who: u8 },
        Used,
        Look { stands: bool, list_is_empty: bool },
        Stops,
        Clears,
        Taken,
    }

    fn step() -> impl Strategy<Value = Step> {
        prop_oneof![
            3 => (0..6_000_u64).prop_map(|ms| Step::Wait { ms }),
            3 => (0..2_u8).prop_map(|who| Step::Frame { who }),
            3 => (0..2_u8).prop_map(|who| Step::Use { who }),
            3 => Just(Step::Used),
            4 => (any::<bool>(), any::<bool>())
                .prop_map(|(stands, list_is_empty)| Step::Look { stands, list_is_empty }),
            1 => Just(Step::Stops),
            1 => Just(Step::Clears),
            1 => Just(Step::Taken),
        ]
    }

    fn holder(who: u8) -> Holder {
        Holder { address: IpAddr::from([10, 0, 0, who]), rule: "10.0.0.0/8".to_owned() }
    }

    #[test]
    fn frames_under_another_rule_do_not_keep_it_and_a_list_counts_until_it_is_done() {
        let begin = Instant::ORIGIN + Duration::from_secs(1);
        let now = |seconds| begin + Duration::from_secs(seconds);
        let rest = Rest { stands: true, list_is_empty: true, stopped: false };
        let key = Key { number: 7, secret: Secret([0; 16]) };
        let mut lease = ImplicitLease::default();
        lease.granted(now(0), holder(1), key);
        lease.has_list(key);
        lease.used(key);
        assert!(lease.begin_use(&holder(1)).unwrap().1);
        assert!(matches!(lease.due(now(1), rest), Due::Renew(_)), "it is in use");
        assert!(lease.begin_use(&holder(1)).unwrap().1, "a command is under way, so the list may be its own");
        lease.used(key);
        lease.used(key);
        assert!(matches!(lease.due(now(2), rest), Due::Renew(_)));
        assert!(!lease.begin_use(&holder(1)).unwrap().1, "the list was seen empty");
        lease.used(key);
        // Its rule was withdrawn; another one lets the address read.
        lease.frame(now(9), &Holder { rule: "10.0.0.0/16".to_owned(), ..holder(1) });
        assert!(matches!(lease.due(now(10), rest), Due::Release(_)));
    }

    proptest! {
        /// Beside a seat: a source never gets the lease of another. It is given back exactly when no command
        /// uses it, the arm stands, and a stop holds or 10 s are over since the last frame and the list is
        /// empty.
        #[test]
        fn it_ends_when_it_should_and_never_while_it_is_used(steps in prop::collection::vec(step(), 1..80)) {
            let mut now = Instant::ORIGIN + Duration::from_secs(1);
            let mut seat = Seat::new(Saved::default(), Duration::from_secs(2));
            let mut lease = ImplicitLease::default();
            let mut uses: Vec<Key> = Vec::new();
            let mut last: Option<(u8, u64, Instant)> = None;
            for (number, step) in (1_u128..).zip(steps) {
                match step {
                    Step::Wait { ms } => now += Duration::from_millis(ms),
                    Step::Frame { who } => {
                        lease.frame(now, &holder(who));
                        if let Some((owner, _, at)) = &mut last && *owner == who {
                            *at = now;
                        }
                    }
                    Step::Use { who } => {
                        let had = lease.begin_use(&holder(who));
                        if let Some((key, _)) = had {
                            prop_assert_eq!(last.map(|(owner, number, _)| (owner, number)), Some((who, key.number)));
                            uses.push(key);
                            if seat.renew(now, key, USUAL_LEASE).is_ok() {
                                continue;
                            }
                            lease.lost(key);
                            last = None;
                        }
                        let secret = Secret(number.to_be_bytes());
                        let ask = Ask { holder: holder(who).label(), lasts: USUAL_LEASE, secret };
                        match seat.acquire(now, ask) {
                            Ok(granted) => {
                                lease.granted(now, holder(who), granted.key);
                                uses.push(granted.key);
                                last = Some((who, granted.key.number, now));
                            }
                            Err(_) => prop_assert!(seat.lease(now).is_some()),
                        }
                    }
                    Step::Used => {
                        if let Some(key) = uses.pop() {
                            lease.used(key);
                        }
                    }
                    Step::Look { stands, list_is_empty } => {
                        let stopped = seat.stops().0;
                        match (lease.due(now, Rest { stands, list_is_empty, stopped }), last) {
                            (Due::Nothing, None) => {}
                            (Due::Release(key), Some((_, number, at))) => {
                                prop_assert_eq!(key.number, number);
                                let is_gone = list_is_empty && now.since(at) >= KEPT_FOR;
                                prop_assert!(stands && (stopped || is_gone));
                                prop_assert!(!uses.iter().any(|using| using.number == number));
                                let _ = seat.release(now, key);
                                lease.lost(key);
                                last = None;
                            }
                            (Due::Renew(key), Some((_, number, at))) => {
                                prop_assert_eq!(key.number, number);
                                let used = uses.iter().any(|using| using.number == number);
                                let is_gone = list_is_empty && now.since(at) >= KEPT_FOR;
                                prop_assert!(used || !stands || (!stopped && !is_gone));
                                if seat.renew(now, key, USUAL_LEASE).is_err() {
                                    lease.lost(key);
                                    last = None;
                                }
                            }
                            other => prop_assert!(false, "{other:?}"),
                        }
                    }
                    Step::Stops => {
                        seat.stop_begins();
                        seat.stop_ends();
                    }
                    Step::Clears => {
                        // An admin takes it and clears the stop.
                        seat.begin_taking(now).unwrap();
                        let ask = Ask {
                            holder: "admin".to_owned(), lasts: USUAL_LEASE, secret: Secret(number.to_be_bytes()),
                        };
                        let granted = seat.end_taking(now, ask).unwrap();
                        seat.clear(now, granted.key, None).unwrap();
                        seat.release(now, granted.key).unwrap();
                    }
                    Step::Taken => {
                        seat.begin_taking(now).unwrap();
                        let ask = Ask {
                            holder: "admin".to_owned(), lasts: USUAL_LEASE, secret: Secret(number.to_be_bytes()),
                        };
                        seat.end_taking(now, ask).unwrap();
                    }
                }
            }
        }
    }
}
