//! One arm has one name: no robot is taken, and none gets an address, while another name has the same address
//! and a gateway owns that, a stop holds there, or one is owed. Otherwise two gateways would move one arm, or
//! a stop would not hold any more because the file calls the arm otherwise.
//!
//! Each row of `owner` has the address at which its last owner reached the robot. Who takes robots, or
//! changes an address, holds the addresses first until the end of the transaction: of two who want one, one
//! waits.

use std::collections::{BTreeMap, BTreeSet};

use tokio_postgres::Client;

use super::owner::{end_sessions, is_over};
use super::{signed, unsigned};
use crate::core::name::RobotName;
use crate::core::owner::{Owned, Seen};
use crate::store::StoreError;

/// What the locks of addresses are called: any number that nothing else here uses.
const LOCKS: i32 = 9_760;

/// After this time without a beat, a gateway has nothing any more, whatever was set at the clock.
const GONE_AFTER_SECONDS: f64 = 10.0;

/// Why a robot is not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tied {
    /// A gateway that may live owns this one, which has the same address.
    Owned(RobotName),
    /// At this one, which has the same address, a stop holds or is owed.
    Stopped(RobotName),
    /// It had this address when it was stopped, and would have another one now.
    Moved(String),
}

impl std::fmt::Display for Tied {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Owned(name) => {
                write!(f, "a gateway has the robot at its address as `{name}`: let all of them read the file")
            }
            Self::Stopped(name) => write!(
                f,
                "the robot at its address was stopped as `{name}`: let it be called so again, look at it, clear the stop, \
                 and change the name then"
            ),
            Self::Moved(address) => write!(
                f,
                "it was stopped at the address {address}: let it have that again, look at it, clear the stop, and \
                 change the address then"
            ),
        }
    }
}

/// A row with the same address and another name, or with the same name and another address.
struct Rival {
    wanted: String,
    robot: String,
    address: String,
    gateway: Option<u64>,
    /// Whether a stop holds there, or is owed.
    is_stopped: bool,
    /// Whether the gateway has a row, and has not been silent for too long.
    may_live: bool,
}

impl Rival {
    fn is_other(&self) -> bool {
        self.wanted != self.robot
    }

    fn name(&self) -> Result<RobotName, StoreError> {
        RobotName::new(&self.robot)
            .ok_or_else(|| StoreError::Unreadable(format!("the owner of `{}`", self.robot)))
    }
}

/// Lets no other gateway take a robot with one of these addresses before the end of the transaction.
async fn hold(client: &Client, addresses: &[&str]) -> Result<(), StoreError> {
    if addresses.is_empty() {
        return Ok(());
    }
    // A few locks for all of them, in one order, so that no two who take wait for each other.
    client
        .query(
            "SELECT pg_advisory_xact_lock($1, number) FROM (SELECT DISTINCT hashtext(address) & 63 AS number
             FROM unnest($2::text[]) AS address ORDER BY 1) AS locks",
            &[&LOCKS, &addresses],
        )
        .await?;
    Ok(())
}

async fn rivals(client: &Client, wanted: &[(&str, &str)]) -> Result<Vec<Rival>, StoreError> {
    if wanted.is_empty() {
        return Ok(Vec::new());
    }
    let (names, addresses): (Vec<_>, Vec<_>) = wanted.iter().copied().unzip();
    // A seat without a row is as that of the robot ''.
    let rows = client
        .query(
            "WITH wanted (robot, address) AS (SELECT * FROM unnest($1::text[], $2::text[])),
             rival AS (
                 SELECT wanted.robot AS wanted, owner.* FROM wanted
                 JOIN owner ON owner.address = wanted.address AND owner.robot <> wanted.robot
                 UNION ALL
                 SELECT wanted.robot AS wanted, owner.* FROM wanted
                 JOIN owner ON owner.robot = wanted.robot AND owner.address <> wanted.address
             )
             SELECT wanted, robot, address, gateway,
             coalesce((SELECT stopped FROM seat WHERE seat.robot = rival.robot),
                      (SELECT stopped FROM seat WHERE seat.robot = ''), false)
             OR EXISTS (SELECT 1 FROM run WHERE run.robot = rival.robot AND owed),
             EXISTS (SELECT 1 FROM gateway WHERE id = rival.gateway
                     AND beat_at > clock_timestamp() - make_interval(secs => $3))
             FROM rival",
            &[&names, &addresses, &GONE_AFTER_SECONDS],
        )
        .await?;
    rows.iter()
        .map(|row| {
            Ok(Rival {
                wanted: row.try_get(0)?,
                robot: row.try_get(1)?,
                address: row.try_get(2)?,
                gateway: row.try_get::<_, Option<i64>>(3)?.map(unsigned),
                is_stopped: row.try_get(4)?,
                may_live: row.try_get(5)?,
            })
        })
        .collect()
}

/// Which of these robots cannot be taken by the gateway `own`, and why. What an owner has that is over is
/// without an owner from then on.
pub async fn tied(
    client: &Client,
    own: u64,
    wanted: &[(&Owned, &str)],
    rows: &Seen,
) -> Result<BTreeMap<Owned, Tied>, StoreError> {
    let wanted: Vec<_> = wanted.iter().map(|(owned, address)| (owned.as_str(), *address)).collect();
    let addresses: Vec<_> = wanted.iter().map(|(_, address)| *address).collect();
    hold(client, &addresses).await?;
    let seen = rivals(client, &wanted).await?;
    let mut owners = BTreeMap::<u64, BTreeSet<&str>>::new();
    for rival in seen.iter().filter(|rival| rival.is_other()) {
        if let Some(gateway) = rival.gateway {
            owners.entry(gateway).or_default().insert(&rival.robot);
        }
    }
    for (gateway, robots) in owners {
        let robots: Vec<_> = robots.into_iter().collect();
        // What this gateway had itself, and holds no more, has no owner.
        if gateway == own || is_over(client, gateway, rows).await? {
            if gateway != own {
                end_sessions(client, gateway, &robots).await?;
            }
            client
                .query("SELECT 1 FROM owner WHERE robot = ANY($1) ORDER BY robot FOR UPDATE", &[&robots])
                .await?;
            client
                .execute(
                    "UPDATE owner SET fence = fence + 1, gateway = NULL WHERE robot = ANY($1) AND gateway = $2",
                    &[&robots, &signed(gateway)],
                )
                .await?;
        }
    }
    // Once more: an owner that is over may have written a stop until its rows were locked.
    let mut tied = BTreeMap::new();
    for rival in rivals(client, &wanted).await? {
        let why = match (rival.is_other(), rival.is_stopped, rival.gateway) {
            (true, true, _) => Tied::Stopped(rival.name()?),
            (true, false, Some(_)) => Tied::Owned(rival.name()?),
            (false, true, _) => Tied::Moved(rival.address),
            (_, false, _) => continue,
        };
        tied.extend(Owned::of_text(&rival.wanted).map(|owned| (owned, why)));
    }
    Ok(tied)
}

/// Notes the addresses of robots that this gateway owns, or that had no owner yet.
pub async fn tie(
    client: &Client,
    robots: &[(RobotName, String)],
    leaving: &[RobotName],
) -> Result<(), StoreError> {
    let wanted: Vec<_> = robots.iter().map(|(name, address)| (name.as_str(), address.as_str())).collect();
    let (names, addresses): (Vec<_>, Vec<_>) = wanted.iter().copied().unzip();
    hold(client, &addresses).await?;
    let goes = |name: &str| names.contains(&name) || leaving.iter().any(|leaving| leaving.as_str() == name);
    let others = rivals(client, &wanted).await?;
    let others = others.iter().filter(|rival| rival.is_other() && !goes(&rival.robot));
    for rival in others {
        if rival.is_stopped || (rival.gateway.is_some() && rival.may_live) {
            return Err(StoreError::AddressTaken(rival.name()?));
        }
    }
    client
        .execute(
            "UPDATE owner SET address = wanted.address
             FROM unnest($1::text[], $2::text[]) AS wanted (robot, address)
             WHERE owner.robot = wanted.robot AND owner.address IS DISTINCT FROM wanted.address",
            &[&names, &addresses],
        )
        .await?;
    Ok(())
}
