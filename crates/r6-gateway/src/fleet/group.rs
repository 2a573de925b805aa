//! Poll groups: values of a robot that are read with a period of their own.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use r6_api::gateway;
use r6_client::{Address, AxisIndex};

use super::config::{MODE_PERIOD, PERIODS};

/// The most groups of a robot: more periods than anybody needs, each with a subscription of the client.
pub const MAX_GROUPS: usize = 32;

/// The most addresses of a group, as of a subscription of the client: more than all that are not registers.
pub const MAX_OF_GROUP: usize = 256;

/// Values that tell the state of a robot. They are in no group: events, leases and the figures of production
/// are made of readings of one moment, which the history keeps.
const STATE: [Address; 8] = [
    Address::CurMode,
    Address::CurAlarm,
    Address::IsMoving,
    Address::Origin,
    Address::RemoteCmdLen,
    Address::CurMold,
    Address::CurCycle,
    Address::LastCycle,
];

/// Values of a robot that are read with a period of their own.
#[derive(Clone, Debug, PartialEq)]
pub struct PollGroup {
    /// How often they are read: [`PERIODS`].
    pub period: Duration,
    /// Their addresses: at most [`MAX_OF_GROUP`], in no other group of the robot.
    pub addresses: Vec<Address>,
    /// Whether the history keeps them.
    pub is_kept: bool,
    /// A value is kept if it differs from the last kept one by more than this; `None`: as the history is set.
    pub deadband: Option<f64>,
}

impl PollGroup {
    /// A group that the history keeps in the usual way.
    #[must_use]
    pub fn new(period: Duration, addresses: Vec<Address>) -> Self {
        Self { period, addresses, is_kept: true, deadband: None }
    }

    /// A group as the API has it.
    ///
    /// # Errors
    /// An address that is unknown.
    pub fn read(wanted: &gateway::PollGroup) -> Result<Self, String> {
        let gateway::PollGroup { period_ms, read, keep, deadband } = wanted;
        let addresses = read.iter().map(|address| Address::parse(address)).collect::<Result<_, _>>();
        Ok(Self {
            period: Duration::from_millis(*period_ms),
            addresses: addresses.map_err(|unknown| unknown.to_string())?,
            is_kept: *keep,
            deadband: *deadband,
        })
    }

    /// This group as the API has it.
    #[must_use]
    pub fn told(&self) -> gateway::PollGroup {
        gateway::PollGroup {
            period_ms: u64::try_from(self.period.as_millis()).unwrap_or(u64::MAX),
            read: self.addresses.iter().map(Address::to_string).collect(),
            keep: self.is_kept,
            deadband: self.deadband,
        }
    }
}

/// The axes and the coordinates that each robot tells.
fn first_six() -> impl Iterator<Item = AxisIndex> {
    AxisIndex::ALL.into_iter().take(6)
}

/// How often these addresses are read of a robot that another gateway tells of.
pub fn periods<'s>(
    addresses: impl Iterator<Item = &'s str>,
    period_ms: u64,
    groups: &[gateway::PollGroup],
) -> Vec<Duration> {
    let of_groups =
        groups.iter().flat_map(|group| group.read.iter().map(|read| (read.as_str(), group.period_ms)));
    let of_groups: BTreeMap<_, _> = of_groups.collect();
    let mode = Address::CurMode.to_string();
    let period = |address: &str| {
        let period = Duration::from_millis(of_groups.get(address).copied().unwrap_or(period_ms));
        if address == mode { period.min(MODE_PERIOD) } else { period }
    };
    addresses.map(period).collect()
}

/// Checks the groups of a robot that reads these addresses besides the usual ones.
///
/// # Errors
/// What is wrong with them.
pub(super) fn check(groups: &[PollGroup], read: &[Address]) -> Result<(), String> {
    if groups.len() > MAX_GROUPS {
        return Err(format!("it has at most {MAX_GROUPS} groups"));
    }
    let (shortest, longest) = PERIODS;
    let mut seen: BTreeSet<_> = read.iter().copied().collect();
    for (number, group) in (1..).zip(groups) {
        let PollGroup { period, addresses, deadband, is_kept: _ } = group;
        if !(shortest..=longest).contains(period) {
            return Err(format!("group {number}: its period is from {shortest:?} to {longest:?}"));
        }
        if addresses.is_empty() || addresses.len() > MAX_OF_GROUP {
            return Err(format!("group {number}: it reads 1 to {MAX_OF_GROUP} addresses"));
        }
        if deadband.is_some_and(|by| !(0.0..).contains(&by)) {
            return Err(format!("group {number}: its deadband is a number from 0"));
        }
        if let Some(state) = addresses.iter().find(|address| STATE.contains(address)) {
            return Err(format!(
                "group {number}: `{state}` is read with the period of the robot, as events, leases and figures need it"
            ));
        }
        for (kind, of) in [("axis", Address::Axis as fn(AxisIndex) -> Address), ("world", Address::World)] {
            let count = first_six().filter(|at| addresses.contains(&of(*at))).count();
            if count != 0 && count != 6 {
                return Err(format!(
                    "group {number}: it has {count} of `{kind}-0` to `{kind}-5`: it may have all or none, so that they \
                     are of one moment"
                ));
            }
        }
        if let Some(twice) = addresses.iter().find(|address| !seen.insert(**address)) {
            return Err(format!(
                "group {number}: `{twice}` is read twice: give each address once, in `read` or in one group"
            ));
        }
    }
    Ok(())
}
