//! Which gateway owns what, as far as this one knows.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use axum::http::Method;
use hyper::Response;
use hyper::body::Incoming;
use r6_api::Code;
use r6_proto::time::Instant;

use super::Ownership;
use crate::auditor::Auditor;
use crate::core::name::RobotName;
use crate::core::owner::{Claim, Life, Owned};
use crate::core::pass::{self, Pass};
use crate::fleet::config::RobotConfig;
use crate::peers::{Door, Failed, Onward, Peers};
use crate::problem::Problem;
use crate::store::Keeper;
use crate::store::postgres::owner::Looked;

/// Where the owner of something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// It is this gateway.
    Here,
    /// It is the gateway with this number, which lives.
    There(u64),
    /// There is none, or it does not live.
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
    /// What it owns, by what it is.
    terms: BTreeMap<Owned, Term>,
    /// What others own that live, and their numbers.
    others: BTreeMap<Owned, u64>,
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

    /// Whether no other gateway shares the store.
    #[must_use]
    pub fn is_alone(&self) -> bool {
        self.0.is_none()
    }

    /// This gateway has this number from now on.
    pub fn set_number(&self, number: u64) {
        self.with(|held| held.number = number);
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

    /// The rows were seen, and these are all robots; `None` if the store does not answer.
    pub fn looked(&self, looked: Option<(&Looked, &BTreeMap<RobotName, RobotConfig>)>) {
        self.with(|held| {
            held.others.clear();
            let Some((Looked { seen, doors, .. }, robots)) = looked else { return };
            held.robots.clone_from(robots);
            held.doors.clone_from(doors);
            for (owned, owner) in &seen.owners {
                let Some(number) = owner.gateway.filter(|number| *number != held.number) else { continue };
                let is_alive = seen.gateways.get(&number).is_some_and(|seen| seen.life == Life::Alive);
                if is_alive && !held.terms.contains_key(owned) {
                    held.others.insert(owned.clone(), number);
                }
            }
        });
        if let (Some(both), Some((Looked { doors, .. }, _))) = (&self.0, looked) {
            both.peers.retain(|number| doors.contains_key(&number));
        }
    }

    /// Who owns this.
    #[must_use]
    pub fn place(&self, owned: &Owned) -> Place {
        let place = |held: &mut Held| {
            if held.terms.contains_key(owned) {
                return Place::Here;
            }
            held.others.get(owned).map_or(Place::Nowhere, |number| Place::There(*number))
        };
        self.with(place).unwrap_or(Place::Here)
    }

    /// Whether the hall has this robot.
    #[must_use]
    pub fn is_known(&self, name: &RobotName) -> bool {
        self.with(|held| held.robots.contains_key(name)).unwrap_or(false)
    }

    /// Passes a request on to the gateway that owns this, once.
    ///
    /// # Errors
    /// [`Failed`].
    pub async fn send(&self, owned: &Owned, onward: Onward) -> Result<Response<Incoming>, Failed> {
        let to = self.with(|held| {
            let number = *held.others.get(owned)?;
            Some((held.number, number, held.doors.get(&number)?.clone()))
        });
        let (Some(both), Some(Some((own, number, door)))) = (&self.0, to) else {
            return Err(Failed::NotSent("no gateway owns it at the moment".to_owned()));
        };
        both.peers.send((own, number), &door, onward).await
    }

    /// Whether this gateway knows the one that a pass says that it is of.
    #[must_use]
    pub fn knows_sender(&self, text: &str) -> bool {
        let from = pass::claimed(text);
        self.with(|held| from.is_some_and(|from| held.doors.contains_key(&from))).unwrap_or(false)
    }

    /// The pass in this text, if it is of another gateway, for a request with this method, path and body.
    #[must_use]
    pub fn admit(&self, text: &str, request: (&Method, &str, &[u8])) -> Option<Pass> {
        let both = self.0.as_ref()?;
        let (own, doors) = self.with(|held| (held.number, held.doors.clone()))?;
        let key = |number| doors.get(&number).map(|door| door.key.clone());
        both.peers.admit(text, own, request, key)
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
            let is_known = held.others.contains_key(&owned) || held.robots.contains_key(&name);
            is_known.then(|| no_owner(held, &owned))
        })?
    }

    /// Why nobody here does what is asked for.
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
    let other = held.others.get(owned).and_then(|number| held.doors.get(number));
    let message = match other {
        Some(Door { url, .. }) => format!("another gateway owns {what}: {url}. Ask there"),
        None => format!("no gateway owns {what} at the moment: ask again"),
    };
    Problem::new(Code::NoOwner, message)
}
