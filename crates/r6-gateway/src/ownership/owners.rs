//! Which gateway owns what, as far as this one knows.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use hyper::Response;
use hyper::body::Incoming;
use r6_api::Code;
use r6_api::gateway::ManagedBy;
use r6_proto::time::Instant;

use super::Ownership;
use crate::auditor::Auditor;
use crate::clock;
use crate::core::name::RobotName;
use crate::core::owner::{Claim, EXPIRES, Life, Owned, SeenGateway, WATCHED};
use crate::core::pass::{self, Pass};
use crate::fleet::config::RobotConfig;
use crate::peers::{Door, Failed, LiveStream, Onward, Peers};
use crate::problem::Problem;
use crate::store::Keeper;
use crate::store::postgres::owner::Looked;

/// For how long the owner takes a pass, in milliseconds of the store's clock. Who gave up says that the
/// request may be carried out: that is so for this long.
const PASS_LASTS: u64 = 2_000;

/// How far the clocks of the store may be apart, as two gateways know them, in milliseconds.
const PASS_AHEAD: u64 = 1_000;

/// Where the owner of something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// It is this gateway.
    Here,
    /// It is the gateway with this number, which lives.
    There(u64),
    /// There is no such gateway, or it does not live.
    Nowhere,
}

/// Who owns what. With a store of its own, a gateway owns everything.
#[derive(Clone, Debug, Default)]
pub struct Owners(Option<Arc<Both>>);

#[derive(Debug)]
struct Both {
    held: Mutex<Held>,
    peers: Peers,
}

#[derive(Debug, Default)]
struct Held {
    /// The number of this gateway.
    number: u64,
    /// Where it is found.
    url: String,
    /// What it owns, by what it is.
    terms: BTreeMap<Owned, Term>,
    /// What others own that live, and their numbers, at the last look that the store answered.
    others: BTreeMap<Owned, u64>,
    /// When that was.
    looked: Option<Instant>,
    /// The store's clock in milliseconds, and when it said so.
    time: Option<(u64, Instant)>,
    /// The other gateways that live.
    alive: BTreeSet<u64>,
    /// The last beat of each gateway that was seen, and since when.
    beats: BTreeMap<u64, (u64, Instant)>,
    /// How to find all gateways.
    doors: BTreeMap<u64, Door>,
    /// All robots of the hall.
    robots: BTreeMap<RobotName, RobotConfig>,
    /// What signs the heads of the audit log, while this gateway owns the hall.
    auditor: Option<Arc<Auditor>>,
}

#[derive(Clone, Debug)]
struct Term {
    claim: Claim,
    ownership: Ownership,
    /// When the store's answer came. A beat that was sent before it may not know of it.
    since: Instant,
}

impl Held {
    /// The gateway that owns this, which is another one and lives.
    fn other(&self, owned: &Owned) -> Option<u64> {
        self.others.get(owned).copied().filter(|_| !self.is_blind())
    }

    fn is_blind(&self) -> bool {
        self.looked.is_none_or(|looked| clock::now().since(looked) >= EXPIRES)
    }
}

impl Owners {
    /// This gateway owns everything.
    #[must_use]
    pub fn alone() -> Self {
        Self(None)
    }

    /// It shares its store, and owns nothing yet.
    #[must_use]
    pub fn shared(peers: Peers) -> Self {
        Self(Some(Arc::new(Both { held: Mutex::default(), peers })))
    }

    /// Where this gateway is found, if others share its store.
    #[must_use]
    pub fn url(&self) -> Option<String> {
        self.with(|held| held.url.clone())
    }

    /// Whether no other gateway shares the store.
    #[must_use]
    pub fn is_alone(&self) -> bool {
        self.0.is_none()
    }

    /// This gateway has this number from now on, and is found there.
    pub fn set_number(&self, number: u64, url: &str) {
        self.with(|held| (held.number, held.url) = (number, url.to_owned()));
    }

    /// This gateway has taken this. `answered`: when the store said so.
    pub fn begin(&self, claim: Claim, ownership: Ownership, answered: Instant) {
        self.with(|held| {
            held.others.remove(&claim.of);
            let of = claim.of.clone();
            held.terms.insert(of, Term { claim, ownership, since: answered });
        });
    }

    /// The term of this is over.
    pub fn end(&self, claim: &Claim) {
        self.with(|held| {
            if held.terms.get(&claim.of).is_some_and(|term| term.claim == *claim) {
                held.terms.remove(&claim.of);
            }
            if claim.of == Owned::Hall {
                held.auditor = None;
            }
        });
    }

    /// What this gateway owns, or lets go of.
    #[must_use]
    pub fn held(&self) -> BTreeSet<Owned> {
        self.with(|held| held.terms.keys().cloned().collect()).unwrap_or_default()
    }

    /// The store took the beat that was sent at this time, and says that this gateway owns this. `None`: it
    /// owns nothing.
    pub fn beaten(&self, sent: Instant, owned: Option<&BTreeMap<Owned, u64>>) {
        let terms = self.with(|held| held.terms.values().cloned().collect::<Vec<_>>());
        for Term { claim, ownership, since } in terms.unwrap_or_default() {
            let fence = owned.and_then(|owned| owned.get(&claim.of));
            if fence == Some(&claim.fence) {
                ownership.beaten(sent);
            } else if since <= sent {
                tracing::error!(of = %claim.of, fence = claim.fence, "another gateway owns this");
                ownership.refused();
            }
        }
    }

    /// The rows were seen, and these are all robots. A look that fails changes nothing: an owner is taken to
    /// be one for [`EXPIRES`].
    pub fn looked(&self, looked: &Looked, robots: &BTreeMap<RobotName, RobotConfig>) {
        let Looked { seen, doors, .. } = looked;
        self.with(|held| {
            held.others.clear();
            let now = clock::now();
            held.looked = Some(now);
            held.time = looked.time.map(|time| (time, now)).or(held.time);
            held.robots.clone_from(robots);
            // What a gateway that ended has signed is not taken any more.
            let has_ended =
                |number: &u64| seen.gateways.get(number).is_none_or(|seen| seen.life == Life::Ended);
            held.doors = doors.clone();
            held.doors.retain(|number, _| !has_ended(number));
            held.beats.retain(|number, _| seen.gateways.contains_key(number));
            for (number, seen) in &seen.gateways {
                let beat = held.beats.entry(*number).or_insert((seen.beat, now));
                if beat.0 != seen.beat {
                    *beat = (seen.beat, now);
                }
            }
            // The clock of the store may have been set forward: a gateway lives while its beats come.
            let beats = |number: &u64| {
                let since = held.beats.get(number).map(|(_, since)| *since);
                held.alive.contains(number) && since.is_some_and(|since| now.since(since) < WATCHED)
            };
            let lives = |(number, seen): &(&u64, &SeenGateway)| match seen.life {
                Life::Alive | Life::Ahead => true,
                Life::Expired => beats(number),
                Life::Ended => false,
            };
            let others = seen.gateways.iter().filter(|(number, _)| **number != held.number);
            held.alive = others.filter(lives).map(|(number, _)| *number).collect();
            for (owned, owner) in &seen.owners {
                let Some(number) = owner.gateway else { continue };
                if held.alive.contains(&number) && !held.terms.contains_key(owned) {
                    held.others.insert(owned.clone(), number);
                }
            }
        });
        if let (Some(both), Some(now)) = (&self.0, self.store_time()) {
            let lives = |number| seen.gateways.get(&number).is_some_and(|seen| seen.life != Life::Expired);
            both.peers.retain(now, |number| doors.contains_key(&number) && lives(number));
        }
    }

    /// The file has these robots now. The next look has those that were added over the API, too.
    pub fn reconfigured(&self, robots: &[RobotConfig]) {
        self.with(|held| {
            held.robots.retain(|_, robot| robot.managed_by == ManagedBy::Api);
            held.robots.extend(robots.iter().map(|robot| (robot.name.clone(), robot.clone())));
        });
    }

    /// Who owns this.
    #[must_use]
    pub fn place(&self, owned: &Owned) -> Place {
        let place = |held: &mut Held| {
            if held.terms.contains_key(owned) {
                return Place::Here;
            }
            held.other(owned).map_or(Place::Nowhere, Place::There)
        };
        self.with(place).unwrap_or(Place::Here)
    }

    /// Whether the store has not answered for so long that it is not known who owns what.
    #[must_use]
    pub fn is_blind(&self) -> bool {
        self.with(|held| held.is_blind()).unwrap_or(false)
    }

    /// Whether the hall has this robot.
    #[must_use]
    pub fn is_known(&self, name: &RobotName) -> bool {
        self.with(|held| held.robots.contains_key(name)).unwrap_or(false)
    }

    /// The other gateways that live, at the last look that the store answered.
    #[must_use]
    pub fn alive(&self) -> BTreeSet<u64> {
        self.with(|held| held.alive.clone()).unwrap_or_default()
    }

    /// Whether there is a gateway with this number.
    #[must_use]
    pub fn has_gateway(&self, number: u64) -> bool {
        self.with(|held| held.doors.contains_key(&number)).unwrap_or(false)
    }

    /// Passes a request on to the gateway with this number, once.
    ///
    /// # Errors
    /// [`Failed`].
    pub async fn send(&self, to: u64, onward: Onward) -> Result<Response<Incoming>, Failed> {
        let Some((both, own, door)) = self.way_to(to) else {
            return Err(Failed::NotSent("it has ended".to_owned()));
        };
        both.peers.send((own, to), &door, onward, || self.pass_ends()).await
    }

    /// Opens a WebSocket to the gateway with this number.
    ///
    /// # Errors
    /// Why it could not be opened, for people.
    pub async fn open_stream(&self, to: u64, onward: Onward) -> Result<LiveStream, String> {
        let (both, own, door) = self.way_to(to).ok_or("it has ended")?;
        both.peers.open_stream((own, to), &door, onward, || self.pass_ends()).await
    }

    /// How this gateway reaches another one: with which number of its own, and where.
    fn way_to(&self, to: u64) -> Option<(&Both, u64, Door)> {
        let (own, door) = self.with(|held| Some((held.number, held.doors.get(&to)?.clone())))??;
        Some((self.0.as_ref()?, own, door))
    }

    /// Until when a pass is taken that is made now.
    fn pass_ends(&self) -> u64 {
        self.store_time().map_or(0, |now| now + PASS_LASTS)
    }

    /// Whether a pass says that it is for this gateway, and is of a gateway, or came with the SHA-256 of a
    /// certificate, that this one does not know yet.
    #[must_use]
    pub fn is_from_unknown(&self, text: &str, shown: Option<&str>) -> bool {
        let (Some((from, to)), Some(both)) = (pass::claimed(text), &self.0) else { return false };
        let is_new = |held: &mut Held| {
            let door = held.doors.get(&from);
            to == held.number && door.is_none_or(|door| shown.is_some() && !both.peers.fits(door, shown))
        };
        self.with(is_new).unwrap_or(false)
    }

    /// The pass in this text, if it is of another gateway, for a request with this head, which came with the
    /// SHA-256 of this certificate.
    #[must_use]
    pub fn open(&self, text: &str, head: &[u8; 32], shown: Option<&str>) -> Option<Pass> {
        let (own, doors) = self.with(|held| (held.number, held.doors.clone()))?;
        self.0.as_ref()?.peers.open(text, own, (head, shown), |number| doors.get(&number))
    }

    /// The pass, if it is for this body, is not too old and was not taken before.
    #[must_use]
    pub fn admit(&self, pass: Pass, body: &[u8]) -> Option<Pass> {
        let now = self.store_time()?;
        // Far ahead it is after the clock of the store was set back: it may have been held back for long.
        let is_for_now = (now..=now + PASS_LASTS + PASS_AHEAD).contains(&pass.until);
        self.0.as_ref().filter(|_| is_for_now)?.peers.admit(pass, body)
    }

    /// The store's clock now, as far as this gateway knows, in milliseconds.
    fn store_time(&self) -> Option<u64> {
        let (time, since) = self.with(|held| held.time)??;
        Some(time.saturating_add(u64::try_from(clock::now().since(since).as_millis()).unwrap_or(u64::MAX)))
    }

    /// How many robots this gateway owns, and how many there are.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        let counts = |held: &mut Held| {
            let own = held.terms.keys().filter(|owned| owned.robot().is_some());
            (own.count(), held.robots.len())
        };
        self.with(counts).unwrap_or_default()
    }

    /// All robots of the hall that this gateway knows of.
    #[must_use]
    pub fn robots(&self) -> Vec<RobotConfig> {
        self.with(|held| held.robots.values().cloned().collect()).unwrap_or_default()
    }

    /// A robot of the hall with this name.
    #[must_use]
    pub fn robot(&self, name: &str) -> Option<RobotConfig> {
        let name = RobotName::new(name)?;
        self.with(|held| held.robots.get(&name).cloned())?
    }

    /// Why a robot is not here; `None` if there is no such robot.
    #[must_use]
    pub fn absent(&self, name: &str) -> Option<Problem> {
        let name = RobotName::new(name)?;
        self.with(|held| {
            let owned = Owned::Robot(name.clone());
            let is_known = held.other(&owned).is_some() || held.robots.contains_key(&name);
            is_known.then(|| no_owner(held, &owned))
        })?
    }

    /// Why this gateway does not do what is asked for.
    #[must_use]
    pub fn no_owner(&self, owned: &Owned) -> Problem {
        self.with(|held| no_owner(held, owned)).unwrap_or_else(|| no_owner(&Held::default(), owned))
    }

    /// Refuses what the gateway alone does that owns the hall.
    ///
    /// # Errors
    /// `no_owner`.
    pub fn check_hall(&self) -> Result<(), Problem> {
        self.hall().map(drop)
    }

    /// The claim to the hall; `None` if no other gateway shares the store.
    ///
    /// # Errors
    /// `no_owner`.
    pub fn hall(&self) -> Result<Option<Claim>, Problem> {
        let hall = self.with(|held| {
            let term = held.terms.get(&Owned::Hall).cloned();
            term.ok_or_else(|| no_owner(held, &Owned::Hall))
        });
        match hall {
            None => Ok(None),
            Some(term) => {
                let Term { claim, ownership, .. } = term?;
                ownership.check().map(|()| Some(claim))
            }
        }
    }

    /// A handle on the store for what the owner of the hall writes.
    ///
    /// # Errors
    /// `no_owner`.
    pub fn hall_keeper(&self, keeper: &Keeper) -> Result<Keeper, Problem> {
        Ok(self.hall()?.map_or_else(|| keeper.clone(), |claim| keeper.under(claim)))
    }

    /// This gateway owns the hall, and this signs the heads of the audit log.
    pub fn set_auditor(&self, auditor: Arc<Auditor>) {
        self.with(|held| held.auditor = Some(auditor));
    }

    /// What signs the heads of the audit log, if this gateway owns the hall.
    #[must_use]
    pub fn auditor(&self) -> Option<Arc<Auditor>> {
        self.with(|held| held.auditor.clone())?
    }

    fn with<T>(&self, act: impl FnOnce(&mut Held) -> T) -> Option<T> {
        let both = self.0.as_ref()?;
        let mut held = both.held.lock().unwrap_or_else(PoisonError::into_inner);
        Some(act(&mut held))
    }
}

fn no_owner(held: &Held, owned: &Owned) -> Problem {
    let what = match owned {
        Owned::Hall => "what is for all robots".to_owned(),
        Owned::Robot(name) => format!("the robot `{name}`"),
    };
    let other = held.other(owned).and_then(|number| held.doors.get(&number));
    let message = match other {
        Some(Door { url, .. }) => format!("another gateway owns {what}: {url}. Ask there"),
        None if held.is_blind() => format!(
            "this gateway cannot reach the database, so it is not known which gateway owns {what}: ask again once \
             /readyz tells that the store answers"
        ),
        None => format!("no gateway owns {what} at the moment: ask again in some seconds"),
    };
    Problem::new(Code::NoOwner, message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::owner::{Seen, SeenOwner};
    use crate::core::pass::Bearer;

    fn pass(until: u64) -> Pass {
        let body = *b"\xe3\xb0\xc4\x42\x98\xfc\x1c\x14\x9a\xfb\xf4\xc8\x99\x6f\xb9\x24\x27\xae\x41\xe4\x64\x9b\x93\x4c\xa4\x95\x99\x1b\x78\x52\xb8\x55";
        Pass {
            from: 1,
            to: 2,
            number: until,
            until,
            head: [0; 32],
            body,
            bearer: Bearer::Token(1),
            source: None,
        }
    }

    #[test]
    fn a_pass_has_an_end_and_an_owner_lasts_as_long_as_its_beat() {
        let owners = Owners::shared(Peers::new(None).unwrap());
        owners.set_number(2, "http://here");
        assert!(owners.admit(pass(u64::MAX), b"").is_none(), "the time is not known");
        let press = Owned::Robot(RobotName::new("press").unwrap());
        let seen = Seen {
            gateways: [(1, SeenGateway { beat: 1, life: Life::Alive })].into(),
            owners: [(press.clone(), SeenOwner { fence: 1, gateway: Some(1) })].into(),
        };
        owners.looked(&Looked { seen, time: Some(10_000), ..Looked::default() }, &BTreeMap::new());
        assert!(owners.admit(pass(9_999), b"").is_none(), "it was held back");
        assert!(owners.admit(pass(20_000), b"").is_none(), "it was made before the clock was set back");
        assert!(owners.admit(pass(11_000), b"x").is_none(), "it is for another body");
        assert!(owners.admit(pass(11_001), b"").is_some());
        assert!(owners.admit(pass(11_001), b"").is_none(), "it is taken once");
        assert_eq!((owners.place(&press), owners.is_blind()), (Place::There(1), false));
        // The clock of the store is set forward, and nothing else happens.
        let later = |beat, life| Seen {
            gateways: [(1, SeenGateway { beat, life })].into(),
            owners: [(press.clone(), SeenOwner { fence: 1, gateway: Some(1) })].into(),
        };
        let look =
            |seen| owners.looked(&Looked { seen, time: Some(90_000), ..Looked::default() }, &BTreeMap::new());
        look(later(1, Life::Expired));
        assert_eq!(owners.place(&press), Place::There(1), "its beat was seen a moment ago");
        owners.with(|held| held.beats.insert(1, (1, Instant::ORIGIN)));
        look(later(1, Life::Expired));
        assert_eq!(owners.place(&press) == Place::Nowhere, clock::now().since(Instant::ORIGIN) >= WATCHED);
        look(later(2, Life::Expired));
        assert_eq!(owners.place(&press), Place::Nowhere, "an ended gateway does not come back like this");
        look(later(3, Life::Alive));
        owners.with(|held| held.looked = held.looked.map(|_| Instant::ORIGIN));
        let is_old = clock::now().since(Instant::ORIGIN) >= EXPIRES;
        assert_eq!(owners.is_blind(), is_old);
        assert_eq!(owners.place(&press) == Place::Nowhere, is_old);
    }
}
