//! A term of this gateway: from when it took a robot, or the hall, to when it has let go of it.

use std::sync::Arc;
use std::time::Duration;

use r6_api::gateway::LeaseEnd;

use tokio::sync::watch;

use super::{Inner, ended};
use crate::auditor::{self, Auditor, open_key};
use crate::core::name::RobotName;
use crate::core::owner::{Claim, Owned};
use crate::fleet::station::{Kept, Term};
use crate::gateway;
use crate::ownership::Ownership;
use crate::store::StoreError;

/// How long a robot waits for a history that has no room.
const HISTORY_TIME: Duration = Duration::from_millis(500);

/// Begins with what was taken at once: for each a task that ends with its term.
pub async fn begin(inner: Arc<Inner>, begins: Vec<(Claim, Ownership)>) {
    let (robots, hall): (Vec<_>, Vec<_>) = begins.into_iter().partition(|(claim, _)| claim.of != Owned::Hall);
    for (claim, ownership) in hall {
        if let Err(error) = begin_hall(&inner, &claim).await {
            give_up(&inner, &claim, &ownership, &error).await;
        } else {
            tokio::spawn(keep_hall(Arc::clone(&inner), claim, ownership));
        }
    }
    match begin_robots(&inner, &robots).await {
        Ok(()) => {}
        Err(_) if robots.len() > 1 => {
            // One of them is another gateway's by now, or was given another address since it was taken, or
            // cannot be written about. The others go on.
            for robot in robots {
                let begun = match robot.1.may_move() {
                    true => begin_robots(&inner, std::slice::from_ref(&robot)).await,
                    false => Err(StoreError::NotOwner),
                };
                if let Err(error) = begun {
                    give_up(&inner, &robot.0, &robot.1, &error).await;
                }
            }
        }
        Err(error) => {
            for (claim, ownership) in &robots {
                give_up(&inner, claim, ownership, &error).await;
            }
        }
    }
}

async fn give_up(inner: &Inner, claim: &Claim, ownership: &Ownership, error: &StoreError) {
    tracing::error!(of = %claim.of, %error, "this gateway cannot begin with it, and gives it back");
    // Without time left it cannot be given back (it was frozen), so no other gateway would take it while this
    // one lives.
    if ownership.may_move() {
        inner.shun(&claim.of);
    }
    inner.end_term(claim, ownership).await;
}

/// Begins with robots: what the owner before left undone is written down.
async fn begin_robots(inner: &Arc<Inner>, robots: &[(Claim, Ownership)]) -> Result<(), StoreError> {
    if robots.is_empty() {
        return Ok(());
    }
    let shared = &inner.state.shared;
    let claims: Vec<_> = robots.iter().map(|(claim, _)| claim.clone()).collect();
    let (all, of_store) = (claims.clone(), Arc::clone(inner));
    let (kept, owed) = shared
        .keeper
        .work(move |store| {
            store.hold(&all);
            // As they are now, under the fence.
            let (mut known, _) = of_store.sharing.robots(&store.robots()?);
            let configs: Vec<_> = all.iter().filter_map(|claim| known.remove(claim.of.robot()?)).collect();
            let places: Vec<_> = configs.iter().map(|robot| (robot.name.clone(), robot.place())).collect();
            store.tie(&places, &[])?;
            let (mut kept, owed) = gateway::take_over(store, configs)?;
            for (kept, config) in &mut kept {
                let unsaved = of_store.unsaved_stop(&all, &config.name).filter(|_| !kept.seat.stopped);
                if let Some(unsaved) = unsaved {
                    (kept.seat.stopped, kept.seat.stopped_by) = (true, unsaved.stopped_by);
                    store.save_seat(&config.name, &kept.seat)?;
                }
            }
            Ok((kept, owed))
        })
        .await?;
    if let Some(history) = &shared.history {
        // The history learns it in any case. Stops do not wait for a history that hangs.
        let _ = tokio::time::timeout(HISTORY_TIME, history.take_over(claims)).await;
    }
    let mut kept: std::collections::BTreeMap<RobotName, _> =
        kept.into_iter().map(|(kept, config)| (config.name.clone(), (kept, config))).collect();
    for (claim, ownership) in robots {
        let begun = claim.of.robot().and_then(|name| Some((name.clone(), kept.remove(name)?)));
        // The store took its time: another gateway may have the robot by now. Or it was removed.
        let Some((name, (saved, config))) = begun.filter(|_| ownership.may_move()) else {
            inner.end_term(claim, ownership).await;
            continue;
        };
        let term = Term { keeper: shared.keeper.under(claim.clone()), ownership: ownership.clone() };
        let saved: Kept = saved;
        inner.state.fleet.take_in(saved, config.clone(), owed.contains(&name), term);
        inner.unsaved_stops().remove(&name);
        inner.tell_if_moved(&name);
        tokio::spawn(keep_robot(Arc::clone(inner), name, claim.clone(), ownership.clone()));
        // The file may have been read again since.
        inner.leave_if_changed(&config);
    }
    Ok(())
}

/// Keeps a robot until it is lost, or is to be given back. Then it has no connection any more.
async fn keep_robot(inner: Arc<Inner>, name: RobotName, claim: Claim, ownership: Ownership) {
    let cause = until_left(&inner, &claim, &ownership).await;
    let station = inner.state.fleet.station(name.as_str());
    inner.let_go(&name, cause, ownership.until_over()).await;
    if let Some(unsaved) = station.and_then(|station| station.unsaved_stop()) {
        inner.unsaved_stops().insert(name, (claim.fence, unsaved));
    }
    inner.end_term(&claim, &ownership).await;
}

/// Begins with the hall.
async fn begin_hall(inner: &Arc<Inner>, claim: &Claim) -> Result<(), StoreError> {
    let keeper = inner.state.shared.keeper.under(claim.clone());
    let of_store = Arc::clone(inner);
    let signer = keeper
        .work(move |store| {
            let signer = open_key(&of_store.sharing.data)?;
            auditor::begin(store, &signer)?;
            // A link that an earlier owner printed ends with it.
            store.remove_setup_link()?;
            let (known, _) = of_store.sharing.robots(&store.robots()?);
            // Robots of the file take the place of those that were added with their names.
            for added in store.robots()?.into_iter().filter(|added| {
                known.get(&added.name).is_some_and(|robot| robot.managed_by == r6_api::gateway::ManagedBy::File)
            }) {
                tracing::warn!(robot = %added.name, "it was added through the API: from now on it is as configured");
                store.remove_robot(&added.name, &[])?;
            }
            // What robots left undone that no gateway takes, because they are gone.
            gateway::close_open(store, &|robot| !known.keys().any(|known| known.as_str() == robot))?;
            Ok(signer)
        })
        .await?;
    inner.state.settings.refresh().await?;
    let auditor = Auditor::new(keeper, signer, inner.sharing.audit);
    inner.owners.set_auditor(Arc::new(auditor));
    Ok(())
}

/// Does what the owner of the hall does, until it is lost or is to be given back.
async fn keep_hall(inner: Arc<Inner>, claim: Claim, ownership: Ownership) {
    let auditor = inner.owners.auditor();
    let work = async {
        match &auditor {
            Some(auditor) => auditor.keep().await,
            None => std::future::pending().await,
        }
    };
    tokio::select! {
        () = work => {}
        _ = until_left(&inner, &claim, &ownership) => {}
    }
    if let Some(auditor) = auditor.filter(|_| ownership.may_move())
        && let Err(error) = auditor.put_head().await
    {
        tracing::error!(%error, "the last head of the audit log was not stored");
    }
    inner.end_term(&claim, &ownership).await;
}

/// Waits until this is lost, is to be given back, or the gateway ends. Returns why the leases end with it.
async fn until_left(inner: &Inner, claim: &Claim, ownership: &Ownership) -> LeaseEnd {
    let leaves = inner.leaving().get(&claim.of).map(watch::Sender::subscribe);
    let mut ends = inner.ends.clone();
    let left = async {
        let Some(mut leaves) = leaves else { return std::future::pending().await };
        match leaves.wait_for(Option::is_some).await.map(|why| *why) {
            Ok(Some(why)) => why,
            Ok(None) | Err(_) => std::future::pending().await,
        }
    };
    tokio::select! {
        biased;
        () = ownership.until_lost() => {
            tracing::error!(
                of = %claim.of,
                "the database did not confirm in time that this gateway still has it, or another one has it: its \
                 connection is closed"
            );
            LeaseEnd::OwnerChanged
        }
        why = left => why,
        () = ended(&mut ends) => LeaseEnd::GatewayEnded,
    }
}
