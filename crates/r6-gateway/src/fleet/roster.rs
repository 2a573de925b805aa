//! Adds, changes and removes robots while the gateway runs. The other robots go on.
//!
//! One change is made at a time. It is on the disk and in the audit log before it takes effect.

use std::collections::{BTreeMap, BTreeSet};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

use futures_util::future::join_all;
use r6_api::Code;
use r6_api::gateway::{AuditRecord, Deed, Happened, LeaseEnd, ManagedBy};
use r6_client::{Address, RobotSettings};

use super::address::RobotAddress;
use super::config::{self, RobotConfig};
use super::guard::Guard;
use super::station::{By, Kept, Station, Term, millis};
use super::{Fleet, Post, Work, link};
use crate::clock;
use crate::core::name::RobotName;
use crate::fleet::group::PollGroup;
use crate::problem::Problem;
use crate::store::{Keeper, Store, StoreError, StoredRobot};

/// The most robots of one gateway: each has a task, a connection and some hundred kilobytes.
pub const MAX_ROBOTS: usize = 1_000;

/// What became of a robot that was put.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Put {
    /// It was added.
    Added,
    /// It was changed, or it was so already.
    Changed,
}

/// What a new configuration changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// How many robots were added.
    pub added: usize,
    /// How many were changed: their leases have ended.
    pub changed: usize,
    /// How many were removed.
    pub removed: usize,
}

/// Checks that each robot can be looked after, and that no two have one name or one address.
///
/// # Errors
/// `bad_value`, `address_taken`.
pub fn check<'r>(robots: impl IntoIterator<Item = &'r RobotConfig>) -> Result<(), Problem> {
    let bad_value = |message| Problem::new(Code::BadValue, message);
    let (mut names, mut addresses) = (BTreeSet::new(), BTreeMap::new());
    let all: Vec<_> = robots.into_iter().collect();
    for robot in &all {
        let name = &robot.name;
        let address = robot.check().map_err(|wrong| bad_value(format!("robot `{name}`: {wrong}")))?;
        if !names.insert(name) {
            return Err(bad_value(format!("two robots are called `{name}`")));
        }
        if let Some(other) = addresses.insert(address.clone(), name) {
            let message = format!("`{name}` and `{other}` both have the address {address}");
            return Err(Problem::new(Code::AddressTaken, message));
        }
    }
    check_ports(&all)?;
    check_twins(&all, &addresses)?;
    if names.len() > MAX_ROBOTS {
        return Err(bad_value(format!("a gateway has at most {MAX_ROBOTS} robots")));
    }
    Ok(())
}

/// Refuses two robots that connect to one port.
fn check_ports(robots: &[&RobotConfig]) -> Result<(), Problem> {
    let addresses =
        robots.iter().filter_map(|robot| Some((&robot.name, RobotAddress::read(&robot.address).ok()?)));
    let dials_in: Vec<_> = addresses.filter(|(_, address)| address.dials_in()).collect();
    for (at, (name, address)) in dials_in.iter().enumerate() {
        let mut before = dials_in.iter().take(at);
        if let Some((other, port)) =
            before.find_map(|(other, known)| Some((other, address.shares_port(known)?)))
        {
            let message = format!("`{name}` and `{other}` both connect to port {port} here");
            return Err(Problem::new(Code::AddressTaken, message));
        }
    }
    Ok(())
}

/// Checks the same of gateways that share their store, and that each of them can reach each robot.
///
/// # Errors
/// `bad_value`, `address_taken`.
pub fn check_shared<'r>(robots: impl IntoIterator<Item = &'r RobotConfig> + Clone) -> Result<(), Problem> {
    check(robots.clone())?;
    robots.into_iter().try_for_each(refuse_if_dials_in)
}

fn refuse_if_dials_in(robot: &RobotConfig) -> Result<(), Problem> {
    if !robot.dials_in() {
        return Ok(());
    }
    let message = format!(
        "robot `{}`: it connects to this machine, so no other gateway could take it over: with --store, set the \
         robot to server mode at its pendant, and give its own address",
        robot.name
    );
    Err(Problem::new(Code::BadValue, message))
}

/// Refuses a robot that may be at the address of a twin. Twins listen on a port of this machine, which has
/// several names and addresses.
fn check_twins(robots: &[&RobotConfig], addresses: &BTreeMap<String, &RobotName>) -> Result<(), Problem> {
    let twins = || robots.iter().filter(|robot| robot.twin_of.is_some());
    if twins().next().is_none() {
        return Ok(());
    }
    let names: BTreeSet<_> = twins().map(|twin| &twin.name).collect();
    let of_twin = |name: &RobotName| names.contains(name);
    let ports: BTreeMap<_, _> = addresses.iter().filter(|(_, name)| of_twin(name)).collect();
    let ports: BTreeMap<_, _> = ports.into_iter().map(|(at, name)| (split(at).1, *name)).collect();
    for (address, name) in addresses.iter().filter(|(_, name)| !of_twin(name)) {
        let (host, port) = split(address);
        if let Some(twin) = ports.get(port).filter(|_| may_be_here(host)) {
            let message = format!("`{name}` may be at the address of the twin `{twin}`: {address}");
            return Err(Problem::new(Code::AddressTaken, message));
        }
    }
    Ok(())
}

/// Host and port of an address that has a port.
fn split(address: &str) -> (&str, &str) {
    address.rsplit_once(':').unwrap_or((address, ""))
}

/// Whether this host may be this machine: each name may be.
fn may_be_here(host: &str) -> bool {
    match host.trim_matches(['[', ']']).parse::<IpAddr>() {
        Ok(ip) => ip.to_canonical().is_loopback() || ip.is_unspecified(),
        Err(_name) => true,
    }
}

/// Refuses twins with the name of a robot that was added through the API.
///
/// # Errors
/// `bad_value`.
pub fn check_names_of_twins<'n>(
    configured: &[RobotConfig],
    mut added: impl Iterator<Item = &'n RobotName>,
) -> Result<(), Problem> {
    let is_twin =
        |name: &RobotName| configured.iter().any(|robot| robot.twin_of.is_some() && robot.name == *name);
    match added.find(|name| is_twin(name)) {
        None => Ok(()),
        Some(name) => {
            let message =
                format!("`{name}` is a robot that was added over the API, and a twin would have its name");
            Err(Problem::new(Code::BadValue, message))
        }
    }
}

/// What changes if the robots of the file are these, and no longer those.
pub fn changes(before: &[RobotConfig], now: &[RobotConfig]) -> Changes {
    let known = |robot: &&RobotConfig| before.iter().find(|known| known.name == robot.name);
    let is_new = |robot: &&RobotConfig| known(robot).is_none();
    let is_changed = |robot: &&RobotConfig| known(robot).is_some_and(|known| !known.is_as(robot));
    let is_gone = |robot: &&RobotConfig| !now.iter().any(|there| there.name == robot.name);
    Changes {
        added: now.iter().filter(is_new).count(),
        changed: now.iter().filter(is_changed).count(),
        removed: before.iter().filter(is_gone).count(),
    }
}

impl Fleet {
    /// Adds a robot, or changes a robot that this function has added before. A change ends the robot's lease.
    ///
    /// # Errors
    /// `managed_by_file`, `address_taken`, `bad_value`, `store_unavailable`; `not_ready` if the gateway ends;
    /// `no_owner` if another gateway owns the robot, or for a new one the hall. For another address also
    /// those of [`Self::part`].
    pub async fn put(&self, by: &By, wanted: RobotConfig) -> Result<Put, Problem> {
        let ended = self.ended.lock().await;
        refuse_if(*ended)?;
        let owners = &self.shared.owners;
        if !owners.is_alone() {
            refuse_if_dials_in(&wanted)?;
        }
        let now = if owners.is_alone() { self.configs() } else { owners.robots() };
        let (mut known, others): (Vec<_>, Vec<_>) = now.iter().partition(|robot| robot.name == wanted.name);
        let known = known.pop();
        let keeper = match known {
            Some(_) => self.keeper_of(&wanted.name)?,
            None => owners.hall_keeper(&self.shared.keeper)?,
        };
        known.map_or(Ok(()), refuse_if_of_file)?;
        check(others.into_iter().chain([&wanted]))?;
        if known.is_some_and(|known| known.is_as(&wanted)) {
            return Ok(Put::Changed);
        }
        let is_moved = known.is_some_and(|known| known.address != wanted.address);
        let parted: Vec<_> = is_moved.then(|| wanted.name.clone()).into_iter().collect();
        let _parted = self.part(&parted).await?;
        let record = record(by, &wanted.name, configured(&wanted));
        keeper.put_robot(stored(&wanted), record).await?;
        match known {
            Some(_) => {
                self.change(wanted).await;
                Ok(Put::Changed)
            }
            // The gateway that has the fewest robots takes it within a second.
            None if !owners.is_alone() => Ok(Put::Added),
            None => {
                self.add(wanted).await?;
                Ok(Put::Added)
            }
        }
    }

    /// Removes a robot that [`Self::put`] has added. Its lease ends, and the arm goes on with what it does.
    ///
    /// # Errors
    /// `no_such_robot`, `managed_by_file`, `store_unavailable`; `not_ready` if the gateway ends; those of
    /// [`Self::part`].
    pub async fn remove(&self, by: &By, name: &RobotName) -> Result<(), Problem> {
        let ended = self.ended.lock().await;
        refuse_if(*ended)?;
        let station = self
            .station(name.as_str())
            .ok_or_else(|| Problem::new(Code::NoSuchRobot, format!("there is no robot `{name}`")))?;
        refuse_if_of_file(&station.config())?;
        let _parted = self.part(std::slice::from_ref(name)).await?;
        let record = record(by, name, Deed::RobotRemoved {});
        self.keeper_of(name)?.remove_robot(name.clone(), vec![record]).await?;
        self.take_out(name).await;
        Ok(())
    }

    /// Makes the robots of the configuration these. Robots that were added through the API stay, unless one
    /// of these has their name. With a shared store, only robots of this gateway are changed and removed:
    /// what other gateways own is theirs to change, and what is new has no owner yet.
    ///
    /// # Errors
    /// `bad_value`, `address_taken`, `not_ready` (the gateway ends) and those of [`Self::part`]: nothing was
    /// changed.
    /// `store_unavailable`: some robots may be changed; to call it again does the rest.
    pub async fn reload(&self, robots: Vec<RobotConfig>) -> Result<Changes, Problem> {
        let ended = self.ended.lock().await;
        refuse_if(*ended)?;
        let now = self.configs();
        let names: BTreeSet<_> = robots.iter().map(|robot| robot.name.clone()).collect();
        let of_api = now.iter().filter(|robot| robot.managed_by == ManagedBy::Api);
        check_names_of_twins(&robots, of_api.clone().map(|robot| &robot.name))?;
        check(of_api.filter(|robot| !names.contains(&robot.name)).chain(&robots))?;

        let by = By { actor: "gateway".to_owned(), source: None };
        let gone = |robot: &&RobotConfig| robot.managed_by == ManagedBy::File && !names.contains(&robot.name);
        let gone: Vec<_> = now.iter().filter(gone).map(|robot| robot.name.clone()).collect();
        let (mut added, mut changed) = (Vec::new(), Vec::new());
        for robot in robots {
            match now.iter().find(|known| known.name == robot.name) {
                None if self.shared.owners.is_alone() => added.push(robot),
                None => {}
                Some(known) if known.managed_by == robot.managed_by && known.is_as(&robot) => {}
                Some(_) => changed.push(robot),
            }
        }
        let is_moved = |robot: &&RobotConfig| {
            now.iter().any(|known| known.name == robot.name && known.address != robot.address)
        };
        let moved = changed.iter().filter(is_moved).map(|robot| &robot.name);
        let parted: Vec<_> = gone.iter().chain(moved).cloned().collect();
        let _parted = self.part(&parted).await?;
        self.tie(&changed, &gone).await?;
        let changes = Changes { added: added.len(), changed: changed.len(), removed: gone.len() };
        let records = gone.iter().map(|name| record(&by, name, Deed::RobotRemoved {}));
        let news = added.iter().chain(&changed).map(|robot| record(&by, &robot.name, configured(robot)));
        self.write_changes(records.chain(news).collect()).await?;
        join_all(gone.iter().map(|name| self.take_out(name))).await;
        let changed = changed.into_iter().map(|robot| async {
            // If it was added through the API, it belongs to the configuration from now on.
            self.keeper_of(&robot.name)?.remove_robot(robot.name.clone(), Vec::new()).await?;
            self.change(robot).await;
            Ok(())
        });
        let changed: Vec<Result<(), Problem>> = join_all(changed).await;
        let added = join_all(added.into_iter().map(|robot| self.add(robot))).await;
        changed.into_iter().chain(added).collect::<Result<(), Problem>>()?;
        Ok(changes)
    }

    /// Gets ready to take these names from their arms: each robot will be removed, or get another address.
    /// Runs are stopped first. No lease, command or run begins until the result is dropped.
    ///
    /// # Errors
    /// A robot that is stopped, or may still carry out a list of the gateway, keeps its arm: at another name
    /// the arm could be moved before a person has looked. `stopped` if a stop holds, `not_ready` if a stop is
    /// owed or a run could not be stopped. Then nothing else has changed.
    async fn part(&self, names: &[RobotName]) -> Result<Parted, Problem> {
        let stations: Vec<_> = names.iter().filter_map(|name| self.station(name.as_str())).collect();
        // A twin has no arm.
        let arms = || stations.iter().filter(|station| station.config().twin_of.is_none());
        arms().try_for_each(|station| refuse_if_tied(station))?;
        let parted = Parted(stations.clone());
        for station in &parted.0 {
            station.seat(|seat, _| seat.will_be_reconfigured());
        }
        let over = join_all(parted.0.iter().map(|station| station.run_is_over())).await;
        // A run that was just stopped may have left something, and a person may have stopped the robot.
        arms().try_for_each(|station| refuse_if_tied(station))?;
        if over.contains(&false) {
            return Err(Problem::new(
                Code::NotReady,
                "a run is being stopped and is not over yet: ask again",
            ));
        }
        Ok(parted)
    }

    /// Notes the addresses of robots that change, in a store that others share. Robots that go give theirs
    /// up.
    async fn tie(&self, changed: &[RobotConfig], gone: &[RobotName]) -> Result<(), Problem> {
        if self.shared.owners.is_alone() || changed.is_empty() {
            return Ok(());
        }
        let keepers = changed.iter().map(|robot| self.keeper_of(&robot.name));
        let keepers = keepers.collect::<Result<Vec<_>, _>>()?;
        let claims: Vec<_> = keepers.iter().filter_map(Keeper::claim).cloned().collect();
        let places: Vec<_> = changed.iter().map(|robot| (robot.name.clone(), robot.place())).collect();
        let gone = gone.to_vec();
        let work = move |store: &mut dyn Store| {
            store.hold(&claims);
            store.tie(&places, &gone)
        };
        Ok(self.shared.keeper.work(work).await?)
    }

    /// What writes about this robot.
    fn keeper_of(&self, name: &RobotName) -> Result<Keeper, Problem> {
        let absent = || {
            let problem = self.shared.owners.absent(name.as_str());
            problem.unwrap_or_else(|| Problem::new(Code::NoSuchRobot, format!("there is no robot `{name}`")))
        };
        let station = self.station(name.as_str()).ok_or_else(absent)?;
        station.term.ownership.check()?;
        Ok(station.term.keeper.clone())
    }

    /// Writes records, all at once, or with a shared store each under the claim of its robot.
    async fn write_changes(&self, records: Vec<AuditRecord>) -> Result<(), Problem> {
        if self.shared.owners.is_alone() {
            self.shared.keeper.append(records).await?;
            return Ok(());
        }
        for record in records {
            let name = record.robot.as_deref().and_then(RobotName::new);
            let keeper = name.map_or_else(|| Ok(self.shared.keeper.clone()), |name| self.keeper_of(&name))?;
            keeper.append(vec![record]).await?;
        }
        Ok(())
    }

    fn configs(&self) -> Vec<RobotConfig> {
        self.read().values().map(|post| post.station.config()).collect()
    }

    async fn add(&self, robot: RobotConfig) -> Result<(), Problem> {
        let name = robot.name.clone();
        let keeper = &self.shared.keeper;
        let (seat, alarms) = (keeper.seat(name.clone()).await?, keeper.alarms(name.clone()).await?);
        let owes_stop = keeper.owed_stops().await?.contains(&name);
        let saved = Kept { seat, alarms };
        let term = Term::alone(keeper.clone());
        let post = Post::start(robot, saved, owes_stop, term, &self.shared);
        post.station.publish(Happened::RobotAdded {});
        {
            let mut posts = self.write();
            post.station.appear();
            posts.insert(name, post);
        }
        self.shared.wake_readers();
        Ok(())
    }

    /// Ends the connection of a robot, and makes the new one.
    async fn change(&self, robot: RobotConfig) {
        let name = robot.name.clone();
        let old = self.write().get_mut(&name).map(|post| (Arc::clone(&post.station), post.link.take()));
        let Some((station, link)) = old else { return };
        station.seat(|seat, _| seat.will_be_reconfigured());
        station.run_is_over().await;
        if let Some(link) = link {
            link.end().await;
        }
        station.seat(|seat, _| seat.reconfigured());
        station.configure(robot);
        station.publish(Happened::RobotChanged {});
        let link = Work::start(&self.shared, |end| link::keep(Arc::clone(&station), end));
        // Meanwhile the robot may have been lost, and taken again: then it has a connection of its own.
        let mut posts = self.write();
        let post = posts.get_mut(&name).filter(|post| Arc::ptr_eq(&post.station, &station));
        if let Some(post) = post {
            post.link = Some(link);
        }
    }

    async fn take_out(&self, name: &RobotName) {
        if let Some(post) = self.take_from_list(name) {
            let station = Arc::clone(&post.station);
            post.end(LeaseEnd::Removed).await;
            station.publish(Happened::RobotRemoved {});
            self.shared.wake_readers();
        }
    }
}

/// Robots that are about to be removed, or to get another address. When this is dropped, those that are still
/// there take leases again.
#[derive(Debug)]
struct Parted(Vec<Arc<Station>>);

impl Drop for Parted {
    fn drop(&mut self) {
        for station in &self.0 {
            station.seat(|seat, _| seat.is_configured());
        }
    }
}

/// Refuses to take the name of this robot from its arm ([`Fleet::part`]).
fn refuse_if_tied(station: &Station) -> Result<(), Problem> {
    let (is_stopped, is_owed) = station.seat(|seat, _| (seat.stops().0, seat.owes_stop()));
    refuse_tied(station.name(), is_stopped, is_owed)
}

/// The same, of a robot that another gateway may have.
///
/// # Errors
/// Those of [`Fleet::part`].
pub fn refuse_tied(name: &str, is_stopped: bool, is_owed: bool) -> Result<(), Problem> {
    if is_owed {
        let message = format!(
            "a list of a run may still move the arm of `{name}`, so `{name}` is not removed and keeps its address: the \
             list is stopped as soon as the robot answers. If it never will, because the arm is gone: an admin of all \
             robots says so (POST …/forget-owed-stop)"
        );
        return Err(Problem::new(Code::NotReady, message));
    }
    if is_stopped {
        let message = format!(
            "`{name}` was stopped, so it is not removed and keeps its address: look at it, clear the stop \
             (POST …/clear-stopped, for which it need not answer), and try again"
        );
        return Err(Problem::new(Code::Stopped, message));
    }
    Ok(())
}

fn refuse_if(ended: bool) -> Result<(), Problem> {
    if ended { Err(Problem::new(Code::NotReady, "the gateway ends")) } else { Ok(()) }
}

fn refuse_if_of_file(robot: &RobotConfig) -> Result<(), Problem> {
    match robot.managed_by {
        ManagedBy::Api => Ok(()),
        ManagedBy::File => {
            let message = "this robot is in the file or on the command line of the gateway: change it there";
            Err(Problem::new(Code::ManagedByFile, message))
        }
    }
}

fn record(by: &By, robot: &RobotName, deed: Deed) -> AuditRecord {
    AuditRecord {
        time: clock::time_of_day(),
        actor: by.actor.clone(),
        source: by.source.clone(),
        robot: Some(robot.to_string()),
        deed,
    }
}

impl Station {
    /// Tells the audit log how the gateway has this robot from now on.
    pub(crate) fn note_configured(&self) {
        let by = By { actor: "gateway".to_owned(), source: None };
        self.note(&by, configured(&self.config()));
    }
}

fn configured(robot: &RobotConfig) -> Deed {
    let StoredRobot { name: _, address, period_ms, read, groups, model, parts, guard } = stored(robot);
    Deed::RobotConfigured { address, period_ms, read, groups, model, parts, guard }
}

fn stored(robot: &RobotConfig) -> StoredRobot {
    StoredRobot {
        name: robot.name.clone(),
        address: robot.address.clone(),
        period_ms: millis(robot.period),
        read: robot.addresses.iter().map(Address::to_string).collect(),
        groups: robot.groups.iter().map(PollGroup::told).collect(),
        model: robot.model.clone(),
        parts: robot.parts.map(|address| address.to_string()),
        guard: robot.guard.as_deref().map(|guard| Box::new(guard.wanted().clone())),
    }
}

/// A robot as it was stored.
///
/// # Errors
/// Its addresses cannot be read.
pub fn of_store(robot: &StoredRobot, settings: RobotSettings) -> Result<RobotConfig, StoreError> {
    let addresses = robot.read.iter().map(|address| Address::parse(address)).collect::<Result<_, _>>();
    let groups = robot.groups.iter().map(PollGroup::read).collect::<Result<_, _>>();
    let parts = robot.parts.as_deref().map(config::counter).transpose();
    // Without its limits it would be sent more than it may be.
    let guard = robot.guard.as_deref().map(Guard::read).transpose();
    let unreadable = || StoreError::Unreadable(format!("the robot `{}`", robot.name));
    Ok(RobotConfig {
        period: Duration::from_millis(robot.period_ms),
        addresses: addresses.map_err(|_| unreadable())?,
        groups: groups.map_err(|_| unreadable())?,
        model: robot.model.clone(),
        parts: parts.map_err(|_| unreadable())?,
        guard: guard.map_err(|_| unreadable())?.map(Arc::new),
        settings,
        managed_by: ManagedBy::Api,
        ..RobotConfig::new(robot.name.clone(), robot.address.clone())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(name: &str, address: &str) -> RobotConfig {
        RobotConfig::new(RobotName::new(name).unwrap(), address)
    }

    #[test]
    fn two_robots_have_neither_one_name_nor_one_address() {
        assert!(check(&[robot("a", "10.0.0.1"), robot("b", "10.0.0.1:9761")]).is_ok());
        let same = check(&[robot("a", "10.0.0.1"), robot("b", "10.0.0.1:9760")]).unwrap_err();
        assert_eq!(same.code, Code::AddressTaken);
        assert_eq!(same.message, "`b` and `a` both have the address 10.0.0.1:9760");
        assert_eq!(check(&[robot("a", "x"), robot("a", "y")]).unwrap_err().code, Code::BadValue);
        assert_eq!(check(&[robot("a", "x y")]).unwrap_err().code, Code::BadValue);
        let twin = RobotConfig { twin_of: RobotName::new("a"), ..robot("a-twin", "127.0.0.1:5000") };
        for here in ["localhost:5000", "127.0.0.2:5000", "hall-pc.local:5000", "[::1]:5000", "0.0.0.0:5000"] {
            let wrong = check(&[robot("a", here), twin.clone()]).unwrap_err();
            assert_eq!(wrong.code, Code::AddressTaken, "{here}");
        }
        let listen = |address: &str, from: &str| format!("listen:{address}:5000,from:{from}");
        let (one, all) = (listen("192.168.1.2", "10.0.0.1"), listen("0.0.0.0", "10.0.0.2"));
        let wrong = check(&[robot("a", &one), robot("b", &all)]).unwrap_err();
        assert_eq!(wrong.message, "`b` and `a` both connect to port 5000 here");
        assert_eq!(check(&[robot("a", &all), twin.clone()]).unwrap_err().code, Code::AddressTaken);
        assert!(check(&[robot("a", &one), robot("b", &listen("192.168.1.3", "10.0.0.2"))]).is_ok());
        let shared = check_shared(&[robot("c", "10.0.0.3"), robot("a", &one)]).unwrap_err();
        assert!(shared.code == Code::BadValue && shared.message.contains("`a`"), "{}", shared.message);
        for elsewhere in ["192.168.1.10:5000", "localhost:5001", "[2001:db8::1]:5000"] {
            assert!(check(&[robot("a", elsewhere), twin.clone()]).is_ok(), "{elsewhere}");
        }
        let many: Vec<_> =
            (0..=MAX_ROBOTS).map(|number| robot(&format!("r{number}"), &format!("h{number}"))).collect();
        assert!(check(&many[1..]).is_ok());
        assert!(check(&many).unwrap_err().message.contains("at most 1000"));
    }
}
