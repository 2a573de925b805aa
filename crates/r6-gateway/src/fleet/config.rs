//! What the gateway has to know of a robot to look after it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use r6_api::gateway::ManagedBy;
use r6_client::{Address, AxisIndex, RobotSettings};
use r6_motion::RobotModel;

use crate::core::name::RobotName;
use crate::fleet::address::RobotAddress;
use crate::fleet::group::{self, PollGroup};
use crate::fleet::guard::Guard;
use crate::fleet::panel::line::Panel;
use crate::programs;

/// How often the values are read if nothing else is said.
pub const USUAL_PERIOD: Duration = Duration::from_millis(100);

/// The shortest and the longest time between two readings: those of the client.
pub const PERIODS: (Duration, Duration) = (Duration::from_millis(20), Duration::from_secs(3_600));

/// The most addresses of one robot that are read with its period, besides the usual ones: a subscription of
/// the client has 256.
pub const MAX_READ: usize = 200;

/// The mode is read at least this often, whatever the period of the values: a command needs it.
pub(super) const MODE_PERIOD: Duration = Duration::from_millis(500);

/// One robot to look after.
#[derive(Clone, Debug)]
pub struct RobotConfig {
    /// Its name.
    pub name: RobotName,
    /// Host and port, as [`r6_client::Robot::connect`] takes them; or where the gateway listens for it, as
    /// [`RobotAddress::read`] takes it.
    pub address: String,
    /// How often its values are read, besides those of its groups: [`PERIODS`].
    pub period: Duration,
    /// The addresses to read, besides the usual ones: at most [`MAX_READ`].
    pub addresses: Vec<Address>,
    /// Values with a period of their own, usual ones too.
    pub groups: Vec<PollGroup>,
    /// The model of its arm: a name that [`RobotModel::named`] knows. Plans need it.
    pub model: Option<String>,
    /// The limits that each list is checked against before it is sent.
    pub guard: Option<Arc<Guard>>,
    /// The counter of parts, a `counter-n`; `None` for the first counter of [`Self::addresses`] or of the
    /// groups, if there is one.
    pub parts: Option<Address>,
    /// The robot that this virtual controller is the twin of; `None` for every other robot.
    pub twin_of: Option<RobotName>,
    /// The twin of this robot, if it has one.
    pub twin: Option<RobotName>,
    /// Its panel, if it is a virtual robot of this process; `None` for every other robot.
    pub panel: Option<Panel>,
    /// How to communicate with it.
    pub settings: RobotSettings,
    /// Who may change all this.
    pub managed_by: ManagedBy,
}

impl RobotConfig {
    /// A robot of the configuration with the usual settings.
    #[must_use]
    pub fn new(name: RobotName, address: impl Into<String>) -> Self {
        Self {
            name,
            address: address.into(),
            period: USUAL_PERIOD,
            addresses: Vec::new(),
            groups: Vec::new(),
            model: None,
            guard: None,
            parts: None,
            twin_of: None,
            twin: None,
            panel: None,
            settings: RobotSettings::default(),
            managed_by: ManagedBy::File,
        }
    }

    /// Its address with the port: two robots must not have the same one.
    ///
    /// # Errors
    /// What is wrong with this robot.
    pub fn check(&self) -> Result<String, String> {
        let (shortest, longest) = PERIODS;
        if !(shortest..=longest).contains(&self.period) {
            return Err(format!("its period is from {shortest:?} to {longest:?}"));
        }
        if self.addresses.len() > MAX_READ {
            return Err(format!("it reads at most {MAX_READ} addresses besides the usual ones"));
        }
        group::check(&self.groups, &self.addresses)?;
        if let Some(parts) = self.parts()
            && self.group_of(parts).is_some_and(|group| !group.is_kept)
        {
            return Err(format!("`{parts}` counts parts: it cannot be in a group that is not kept"));
        }
        if let Some(model) = &self.model {
            programs::model(model)?;
        }
        Ok(RobotAddress::read(&self.address)?.place())
    }

    /// Its address with a port, by which two robots at one address are found.
    #[must_use]
    pub fn place(&self) -> String {
        RobotAddress::read(&self.address).map_or_else(|_| self.address.clone(), |address| address.place())
    }

    /// Whether the robot connects to the gateway.
    #[must_use]
    pub fn dials_in(&self) -> bool {
        RobotAddress::read(&self.address).is_ok_and(|address| address.dials_in())
    }

    /// Whether the robot is the same, is read in the same way, and has the same model, limits, twin and
    /// panel.
    #[must_use]
    pub fn is_as(&self, other: &Self) -> bool {
        let read =
            (&self.addresses, &self.groups, self.parts) == (&other.addresses, &other.groups, other.parts);
        let twins = (&self.twin_of, &self.twin, self.panel) == (&other.twin_of, &other.twin, other.panel);
        let way = (&self.address, self.period) == (&other.address, other.period);
        way && read && twins && (&self.model, &self.guard) == (&other.model, &other.guard)
    }

    /// The model of its arm, if one is configured.
    #[must_use]
    pub fn arm(&self) -> Option<&'static RobotModel> {
        self.model.as_deref().and_then(RobotModel::named)
    }

    /// The counter of parts, if there is one.
    #[must_use]
    pub fn parts(&self) -> Option<Address> {
        let is_counter = |address: &Address| matches!(address, Address::Counter(_));
        let mut read = self.addresses.iter().chain(self.of_groups()).copied();
        self.parts.or_else(|| read.find(is_counter)).filter(is_counter)
    }

    /// All addresses that are read: the usual ones first, each once.
    #[must_use]
    pub fn all_addresses(&self) -> Vec<Address> {
        let axes = AxisIndex::ALL.into_iter().take(6);
        let usual = [Address::CurMode, Address::CurAlarm, Address::IsMoving, Address::Origin];
        let rest = [Address::RemoteCmdLen, Address::CurMold, Address::CurCycle, Address::LastCycle];
        let all = usual
            .into_iter()
            .chain(axes.clone().map(Address::Axis))
            .chain(axes.map(Address::World))
            .chain(rest)
            .chain(self.addresses.iter().copied())
            .chain(self.of_groups().copied())
            .chain(self.parts());
        let mut once = Vec::new();
        all.for_each(|address| {
            if !once.contains(&address) {
                once.push(address);
            }
        });
        once
    }

    fn of_groups(&self) -> impl Iterator<Item = &Address> {
        self.groups.iter().flat_map(|group| &group.addresses)
    }

    /// The group of an address, if it is in one.
    #[must_use]
    pub fn group_of(&self, address: Address) -> Option<&PollGroup> {
        self.groups.iter().find(|group| group.addresses.contains(&address))
    }

    /// How often an address is read.
    #[must_use]
    pub fn period_of(&self, address: Address) -> Duration {
        let period = self.group_of(address).map_or(self.period, |group| group.period);
        if address == Address::CurMode { period.min(MODE_PERIOD) } else { period }
    }

    /// What is read with which period: [`Self::all_addresses`], each once.
    #[must_use]
    pub fn by_period(&self) -> BTreeMap<Duration, Vec<Address>> {
        let mut all: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for address in self.all_addresses() {
            all.entry(self.period_of(address)).or_default().push(address);
        }
        all
    }
}

/// A counter of parts.
///
/// # Errors
/// It is no counter.
pub fn counter(text: &str) -> Result<Address, String> {
    match Address::parse(text) {
        Ok(counter @ Address::Counter(_)) => Ok(counter),
        Ok(_) => Err(format!("`parts` is a counter, such as `counter-0`, but this is `{text}`")),
        Err(unknown) => Err(unknown.to_string()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::*;

    fn read(addresses: &[&str]) -> Vec<Address> {
        addresses.iter().map(|address| Address::parse(address).unwrap()).collect()
    }

    #[test]
    fn each_address_is_read_once_with_the_period_of_its_group_and_the_mode_twice_a_second() {
        let (minute, second) = (Duration::from_secs(60), Duration::from_secs(1));
        let config = RobotConfig {
            period: minute,
            addresses: read(&["Addr-800", "axis-1"]),
            groups: vec![PollGroup::new(second, read(&["axis-7", "counter-2"]))],
            ..RobotConfig::new(RobotName::new("saw").unwrap(), "10.0.0.1")
        };
        assert!(config.check().is_ok());
        let by_period = config.by_period();
        let periods: Vec<_> = by_period.keys().copied().collect();
        assert_eq!(periods, [MODE_PERIOD, second, minute]);
        assert_eq!(by_period[&MODE_PERIOD], read(&["curMode"]));
        assert_eq!(by_period[&second], read(&["axis-7", "counter-2"]));
        assert_eq!(by_period.values().map(Vec::len).sum::<usize>(), config.all_addresses().len());
        assert_eq!(config.parts(), Some(Address::parse("counter-2").unwrap()));
        let groups: Vec<_> = config.groups.iter().map(PollGroup::told).collect();
        let all = config.all_addresses();
        let texts: Vec<_> = all.iter().map(Address::to_string).collect();
        let copied = group::periods(texts.iter().map(String::as_str), 60_000, &groups);
        let own: Vec<_> = all.iter().map(|address| config.period_of(*address)).collect();
        assert_eq!(copied, own, "as another gateway tells of it");
    }
}
