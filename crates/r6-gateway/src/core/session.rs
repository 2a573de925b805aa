//! Sessions of browsers, whose owner is a user or a token.
//!
//! A session ends 15 minutes after its last request, 8 hours after it began, when its owner changes, or when
//! it is signed out. Times are those of a clock that counts suspend.

use std::collections::BTreeMap;
use std::time::Duration;

use r6_proto::time::Instant;

/// A session ends so long after its last request: a screen that somebody left must not stay open.
pub const IDLE: Duration = Duration::from_secs(15 * 60);

/// A session ends so long after it began: a shift.
pub const LONGEST: Duration = Duration::from_secs(8 * 3600);

/// How many sessions an owner has at once: a few screens. A new one ends the session whose last request is
/// oldest.
pub const MAX_OF_OWNER: usize = 8;

/// How many sessions there are at once, each of some hundred bytes. A new one ends the session whose
/// last request is oldest.
pub const MAX_ALL: usize = 2_000;

/// SHA-256 of the secret of a session: the secret itself is in the browser only.
pub type SessionId = [u8; 32];

/// A session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Session<O> {
    /// Whose it is.
    pub owner: O,
    /// Which state of its owner it is for: see [`Sessions::retain`].
    pub stamp: u64,
    begun: Instant,
    used: Instant,
}

impl<O> Session<O> {
    /// When it ends if no request comes, and when it ends in any case.
    #[must_use]
    pub fn ends(&self) -> (Instant, Instant) {
        let last = self.begun + LONGEST;
        ((self.used + IDLE).min(last), last)
    }

    fn is_open(&self, now: Instant) -> bool {
        now < self.ends().0
    }
}

/// All sessions of owners of one kind.
#[derive(Debug)]
pub struct Sessions<O> {
    open: BTreeMap<SessionId, Session<O>>,
}

impl<O> Default for Sessions<O> {
    fn default() -> Self {
        Self { open: BTreeMap::new() }
    }
}

impl<O: Clone + PartialEq> Sessions<O> {
    /// Begins a session. The caller draws `id` at random.
    pub fn begin(&mut self, id: SessionId, owner: O, stamp: u64, now: Instant) {
        self.open.retain(|_, session| session.is_open(now));
        let of_owner = |session: &Session<O>| session.owner == owner;
        if self.open.values().filter(|session| of_owner(session)).count() >= MAX_OF_OWNER {
            self.end_least_used(of_owner);
        }
        if self.open.len() >= MAX_ALL {
            self.end_least_used(|_| true);
        }
        self.open.insert(id, Session { owner, stamp, begun: now, used: now });
    }

    /// The session, if it is open. This is a request: the time until it ends begins anew.
    pub fn request(&mut self, id: &SessionId, now: Instant) -> Option<Session<O>> {
        let session = self.open.get_mut(id).filter(|session| session.is_open(now))?;
        session.used = session.used.max(now);
        Some(session.clone())
    }

    /// The session, if it is open. To look is not to use it.
    #[must_use]
    pub fn look(&self, id: &SessionId, now: Instant) -> Option<&Session<O>> {
        self.open.get(id).filter(|session| session.is_open(now))
    }

    /// Ends a session. Whose it was; `None` if it was not open.
    pub fn end(&mut self, id: &SessionId, now: Instant) -> Option<O> {
        self.open.remove(id).filter(|session| session.is_open(now)).map(|session| session.owner)
    }

    /// Ends all sessions that are over, and those of owners that changed: `stamp` says the present stamp of
    /// an owner, `None` if it cannot be used.
    pub fn retain(&mut self, now: Instant, stamp: impl Fn(&O) -> Option<u64>) {
        self.open.retain(|_, session| {
            session.is_open(now) && stamp(&session.owner).is_some_and(|stamp| stamp <= session.stamp)
        });
    }

    /// Lets a session go on over a change of its owner, to the state with this stamp.
    pub fn renew(&mut self, id: &SessionId, stamp: u64) {
        if let Some(session) = self.open.get_mut(id) {
            session.stamp = session.stamp.max(stamp);
        }
    }

    /// How many there are, those that are over and were not removed yet included.
    #[cfg(test)]
    fn count(&self) -> usize {
        self.open.len()
    }

    fn end_least_used(&mut self, of: impl Fn(&Session<O>) -> bool) {
        let of_these = self.open.iter().filter(|(_, session)| of(session));
        if let Some(id) = of_these.min_by_key(|(_, session)| session.used).map(|(id, _)| *id) {
            self.open.remove(&id);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::core::account::UserName;

    fn user(number: usize) -> UserName {
        UserName::new(&format!("u{number}")).unwrap()
    }

    fn id(number: u32) -> SessionId {
        let mut id = [0; 32];
        id[..4].copy_from_slice(&number.to_be_bytes());
        id
    }

    #[derive(Clone, Debug)]
    enum Act {
        Begin(usize),
        Request(prop::sample::Index),
        End(prop::sample::Index),
        Change(usize),
        Disable(usize),
        Renew(prop::sample::Index),
    }

    fn acts() -> impl Strategy<Value = (Act, u64)> {
        let act = prop_oneof![
            3 => (0..3_usize).prop_map(Act::Begin),
            6 => any::<prop::sample::Index>().prop_map(Act::Request),
            1 => any::<prop::sample::Index>().prop_map(Act::End),
            1 => (0..3_usize).prop_map(Act::Change),
            1 => (0..3_usize).prop_map(Act::Disable),
            1 => any::<prop::sample::Index>().prop_map(Act::Renew),
        ];
        (act, 0..1_000_u64)
    }

    proptest! {
        /// A model that knows only the history of each session says when it is open. No more are open than
        /// the limit, and the limit ends no session that was used later than the others of its user.
        #[test]
        fn a_session_is_open_as_long_as_it_should_be(acts in prop::collection::vec(acts(), 1..200)) {
            struct Known { owner: usize, stamp: u64, begun: Instant, used: Instant, is_ended: bool }
            let mut sessions = Sessions::<UserName>::default();
            let mut known: Vec<Known> = Vec::new();
            let mut stamps = [Some(1_u64); 3];
            let mut last_stamp = 1;
            let mut now = Instant::ORIGIN + Duration::from_secs(1);
            for (act, wait) in acts {
                now += Duration::from_secs(wait);
                match act {
                    Act::Begin(owner) => if let Some(stamp) = stamps[owner] {
                        let open = |one: &Known| !one.is_ended && now < one.used + IDLE && now < one.begun + LONGEST;
                        let mine: Vec<_> = (0..known.len()).filter(|at| known[*at].owner == owner && open(&known[*at])).collect();
                        if mine.len() >= MAX_OF_OWNER {
                            let oldest = mine.iter().map(|at| known[*at].used).min().unwrap();
                            // Of those that were used at the same time, any may go.
                            let gone: Vec<_> = mine.into_iter().filter(|at| known[*at].used == oldest).collect();
                            sessions.begin(id(known.len() as u32), user(owner), stamp, now);
                            let lost: Vec<_> = gone.into_iter().filter(|at| sessions.look(&id(*at as u32), now).is_none()).collect();
                            prop_assert_eq!(lost.len(), 1);
                            known[lost[0]].is_ended = true;
                        } else {
                            sessions.begin(id(known.len() as u32), user(owner), stamp, now);
                        }
                        known.push(Known { owner, stamp, begun: now, used: now, is_ended: false });
                    },
                    Act::Request(at) => if !known.is_empty() {
                        let at = at.index(known.len());
                        if sessions.request(&id(at as u32), now).is_some() {
                            known[at].used = now;
                        }
                    },
                    Act::End(at) => if !known.is_empty() {
                        let at = at.index(known.len());
                        sessions.end(&id(at as u32), now);
                        known[at].is_ended = true;
                    },
                    Act::Change(owner) => {
                        last_stamp += 1;
                        stamps[owner] = Some(last_stamp);
                    }
                    Act::Disable(owner) => stamps[owner] = None,
                    Act::Renew(at) => if !known.is_empty() {
                        let at = at.index(known.len());
                        if let Some(stamp) = stamps[known[at].owner] {
                            sessions.renew(&id(at as u32), stamp);
                            known[at].stamp = stamp;
                        }
                    },
                }
                sessions.retain(now, |name| (0..3).find(|owner| user(*owner) == *name).and_then(|owner| stamps[owner]));
                for (at, one) in known.iter_mut().enumerate() {
                    one.is_ended |= stamps[one.owner].is_none_or(|stamp| stamp > one.stamp);
                    let open = !one.is_ended && now < one.used + IDLE && now < one.begun + LONGEST;
                    prop_assert_eq!(sessions.look(&id(at as u32), now).is_some(), open, "{}", at);
                }
                prop_assert!(sessions.count() <= 3 * MAX_OF_OWNER);
            }
        }
    }

    #[test]
    fn all_sessions_together_have_a_limit() {
        let mut sessions = Sessions::<UserName>::default();
        let now = Instant::ORIGIN + Duration::from_secs(1);
        for number in 0..u32::try_from(MAX_ALL).unwrap() + 100 {
            let at = now + Duration::from_millis(number.into());
            sessions.begin(id(number), user(number as usize), 1, at);
        }
        assert_eq!(sessions.count(), MAX_ALL);
        assert!(sessions.look(&id(99), now).is_none() && sessions.look(&id(100), now).is_some());
    }

    #[test]
    fn requests_do_not_keep_a_session_beyond_a_shift() {
        let mut sessions = Sessions::<UserName>::default();
        let begun = Instant::ORIGIN + Duration::from_secs(1);
        sessions.begin(id(1), user(1), 1, begun);
        let step = Duration::from_secs(14 * 60);
        let requests = (1..).map(|number| begun + step * number);
        let passed = requests.take_while(|at| sessions.request(&id(1), *at).is_some()).count();
        assert_eq!(passed, 34, "8 h are 34.3 times 14 min");
    }
}
