//! A look at the rows of the owners: what this gateway takes, lets go of and gives to others.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use r6_api::gateway::LeaseEnd;
use tokio::sync::watch;

use super::far::Links;
use super::{Inner, term};
use crate::clock;
use crate::core::name::RobotName;
use crate::core::owner::{Claim, Life, Own, Owned, Reign, Verdict, Watch};
use crate::fleet::config::RobotConfig;
use crate::outage::Outage;
use crate::ownership::Ownership;
use crate::peers::Door;
use crate::store::postgres::owner::{Looked, OwnerRows, Wanted};

/// How many robots this gateway gives to others at a time: each of them has no gateway for a moment.
const GIVEN_AT_ONCE: usize = 4;

/// What the looks have in common.
#[derive(Debug, Default)]
pub struct Look {
    watch: Watch,
    outage: Outage,
    /// The gateways whose files say something else of the robots, as they were told of last.
    differing: BTreeSet<String>,
    /// The added robots that do not fit, as they were told of last.
    unfit: BTreeSet<RobotName>,
    /// What could not be taken because an arm has one name, and why, as it was told of last.
    tied: BTreeMap<Owned, String>,
    /// What other gateways tell of their robots.
    links: Links,
}

impl Look {
    /// Looks once, takes what there is to take, and lets go of what is too much. Returns how long to wait,
    /// and what waits until the gateway has begun with what it took.
    pub async fn once(
        &mut self,
        inner: &Arc<Inner>,
        rows: &mut OwnerRows,
    ) -> (Duration, impl Future<Output = ()> + use<>) {
        let mut begun = Vec::new();
        let looked = rows.look().await;
        self.outage.note("it is not known which gateway owns which robot", &looked);
        let Ok(looked) = looked else { return (crate::core::owner::LOOK, join_all(begun)) };
        let now = clock::now();
        let (robots, unfit) = inner.sharing.robots(&looked.robots);
        for robot in unfit.difference(&self.unfit) {
            tracing::error!(%robot, "it was added over the API, and a robot of the file has its name or its address");
        }
        self.unfit = unfit;
        let files_differ = self.compare_files(inner, &looked);
        inner.owners.looked(&looked, &robots);
        self.links.update(inner, &robots).await;
        let places = places(&robots);
        let rivals = rivals(&places, &looked.addresses);
        let known: BTreeSet<_> = robots.into_keys().map(Owned::Robot).chain([Owned::Hall]).collect();
        let held = inner.owners.held();
        let shunned = inner.shunned(now);
        // While files differ, another arm could get the name of the arm that the owner before had.
        let is_withheld = |owned: &Owned| {
            let before = looked.addresses.get(owned);
            files_differ
                && before.is_some_and(|before| places.get(owned).is_some_and(|place| place != before))
        };
        let takes: BTreeSet<_> = known.iter().filter(|owned| !is_withheld(owned)).cloned().collect();
        let own =
            Own { number: inner.number, known: &takes, held: &held, shunned: &shunned, rivals: &rivals };
        match self.watch.look(now, &looked.seen, own) {
            Verdict::Behind { of, highest } => {
                tracing::error!(%of, highest, "the store is older than what it said before: nothing is taken from it");
            }
            Verdict::Take(wanted) if !wanted.is_empty() => {
                let placed = wanted.into_iter().map(|owned| (owned.clone(), places.get(&owned).cloned()));
                let wanted = placed.collect();
                begun.extend(self.take(inner, rows, &wanted, &looked).await);
            }
            Verdict::Take(_) => {}
        }
        // Robots that were removed, or are not in the file any more.
        held.difference(&known).for_each(|owned| inner.leave(owned, LeaseEnd::Removed));
        // What could not be given back when this gateway lost it, and is not in its file any more.
        for (owned, owner) in &looked.seen.owners {
            let is_left =
                owner.gateway == Some(inner.number) && !held.contains(owned) && !known.contains(owned);
            let claim = Claim { of: owned.clone(), fence: owner.fence };
            if is_left && let Err(error) = rows.release(inner.number, &claim).await {
                tracing::warn!(of = %claim.of, %error, "it was not given back");
            }
        }
        // A gateway with another file may not take what it is given.
        if !files_differ {
            inner.give(self.watch.surplus(now, &looked.seen, inner.number).min(GIVEN_AT_ONCE));
        }
        (self.watch.pause(clock::now()), join_all(begun))
    }

    /// Whether the file of a gateway that lives says something else of the robots than the one of this
    /// gateway. The log tells of it, and that it is over.
    fn compare_files(&mut self, inner: &Inner, looked: &Looked) -> bool {
        let own = inner.sharing.file();
        let lives =
            |number: &u64| looked.seen.gateways.get(number).is_some_and(|seen| seen.life == Life::Alive);
        // The row of this gateway is as old as its last beat.
        let is_other = |number: &u64| *number != inner.number && lives(number);
        let others = looked.files.iter().filter(|(number, file)| is_other(number) && **file != own);
        let urls = others.filter_map(|(number, _)| looked.doors.get(number)).map(|door| door.url.clone());
        let differing: BTreeSet<_> = urls.collect();
        if differing != self.differing {
            if differing.is_empty() {
                tracing::info!("the files of all gateways name the same robots and addresses again");
            } else {
                let others = differing.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
                tracing::error!(
                    %others,
                    "the file of this gateway names other robots or addresses than those of other gateways: no robot is \
                     given to another gateway, or taken at another address than before, until all have read the same file"
                );
            }
            self.differing = differing;
        }
        !self.differing.is_empty()
    }

    async fn take(
        &mut self,
        inner: &Arc<Inner>,
        rows: &mut OwnerRows,
        wanted: &Wanted,
        looked: &Looked,
    ) -> Option<tokio::task::JoinHandle<()>> {
        let asked = clock::now();
        let taken = match rows.take(inner.number, wanted, &looked.seen).await {
            Ok(taken) => taken,
            Err(error) => {
                tracing::warn!(%error, "what has no owner could not be taken");
                return None;
            }
        };
        let answered = clock::now();
        self.tied.retain(|owned, _| !wanted.contains_key(owned) || taken.tied.contains_key(owned));
        for (owned, why) in taken.tied {
            inner.shun(&owned);
            let why = why.to_string();
            if self.tied.get(&owned) != Some(&why) {
                tracing::error!(of = %owned, "no gateway takes it: {why}");
                self.tied.insert(owned, why);
            }
        }
        let claims = taken.claims;
        // Another gateway was faster.
        if claims.is_empty() {
            return None;
        }
        let mut begins = Vec::new();
        for claim in claims {
            let before = looked.seen.owners.get(&claim.of).and_then(|row| row.gateway);
            let before = before.filter(|number| *number != inner.number);
            match before.and_then(|number| looked.doors.get(&number)) {
                Some(Door { url, .. }) => {
                    tracing::warn!(of = %claim.of, before = %url, "its gateway does not live any more: this gateway has it now");
                }
                None => tracing::info!(of = %claim.of, "this gateway has it from now on"),
            }
            let address = wanted.get(&claim.of).cloned().flatten();
            let moved = looked.addresses.get(&claim.of).filter(|before| Some(*before) != address.as_ref());
            if let (Some(robot), Some(before)) = (claim.of.robot(), moved) {
                tracing::warn!(%robot, %before, now = address, "it has another address than it had with its last gateway");
                inner.moved.lock().unwrap_or_else(PoisonError::into_inner).insert(robot.clone());
            }
            self.watch.had(&claim);
            let ownership = Ownership::owns(Reign::begin(asked));
            inner.leaving().insert(claim.of.clone(), watch::Sender::new(None));
            inner.owners.begin(claim.clone(), ownership.clone(), answered);
            begins.push((claim, ownership));
        }
        Some(tokio::spawn(term::begin(Arc::clone(inner), begins)))
    }
}

/// Where this gateway would reach each robot.
fn places(robots: &BTreeMap<RobotName, RobotConfig>) -> BTreeMap<Owned, String> {
    robots.iter().map(|(name, robot)| (Owned::Robot(name.clone()), robot.place())).collect()
}

/// For each robot the other names under which a gateway had its arm last.
fn rivals(
    places: &BTreeMap<Owned, String>,
    addresses: &BTreeMap<Owned, String>,
) -> BTreeMap<Owned, Vec<Owned>> {
    let mut names = BTreeMap::<&str, Vec<&Owned>>::new();
    for (owned, address) in addresses {
        names.entry(address).or_default().push(owned);
    }
    let of = |(owned, place): (&Owned, &String)| {
        let others = names.get(place.as_str()).into_iter().flatten().filter(|other| **other != owned);
        (owned.clone(), others.map(|other| (*other).clone()).collect())
    };
    places.iter().map(of).collect()
}

async fn join_all(begun: Vec<tokio::task::JoinHandle<()>>) {
    for begun in begun {
        let _ = begun.await;
    }
}
