//! Which gateway owns what, as far as this one knows.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use r6_api::Code;
use r6_proto::time::Instant;

use super::Ownership;
use crate::auditor::Auditor;
use crate::core::name::RobotName;
use crate::core::owner::{Claim, Life, Owned};
use crate::fleet::config::RobotConfig;
use crate::problem::Problem;
use crate::store::Keeper;
use crate::store::postgres::owner::Looked;

/// Who owns what. With a store of its own, a gateway owns everything.
#[derive(Clone, Debug, Default)]
pub struct Owners(Option<Arc<Mutex<Held>>>);

#[derive(Debug, Default)]
struct Held {
    /// The number of this gateway.
    number: u64,
    /// What it owns, by what it is.
    terms: BTreeMap<Owned, Term>,
    /// What others own: the number of each, and where callers find it.
    others: BTreeMap<Owned, (u64, String)>,
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
    pub fn shared() -> Self {
        Self(Some(Arc::default()))
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
            let Some((Looked { seen, names, .. }, robots)) = looked else { return };
            held.robots.clone_from(robots);
            for (owned, owner) in &seen.owners {
                let Some(number) = owner.gateway.filter(|number| *number != held.number) else { continue };
                let is_alive = seen.gateways.get(&number).is_some_and(|seen| seen.life == Life::Alive);
                if let Some(name) = names.get(&number).filter(|_| is_alive)
                    && !held.terms.contains_key(owned)
                {
                    held.others.insert(owned.clone(), (number, name.clone()));
                }
            }
        });
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

    /// Why a robot is not here; `None` if there is no such robot.
    #[must_use]
    pub fn absent(&self, name: &str) -> Option<Problem> {
        let name = RobotName::new(name)?;
        self.with(|held| {
            let owned = Owned::Robot(name.clone());
            let other = held.others.get(&owned).map(|(_, at)| at.clone());
            let is_known = other.is_some() || held.robots.contains_key(&name);
            is_known.then(|| no_owner(&format!("the robot `{name}`"), other))
        })?
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
            (term, held.others.get(&Owned::Hall).map(|(_, at)| at.clone()))
        });
        match hall {
            None => Ok(None),
            Some((Some(term), _)) => term.ownership.check().map(|()| Some(term.claim)),
            Some((None, other)) => Err(no_owner("what is for all robots", other)),
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
        let held = self.0.as_ref()?;
        let mut held: MutexGuard<'_, Held> = held.lock().unwrap_or_else(PoisonError::into_inner);
        Some(act(&mut held))
    }
}

fn no_owner(what: &str, other: Option<String>) -> Problem {
    let message = match other {
        Some(other) => format!("another gateway owns {what}: {other}. Ask there"),
        None => format!("no gateway owns {what} at the moment: ask again"),
    };
    Problem::new(Code::NoOwner, message)
}
