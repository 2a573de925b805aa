//! The twins of `r6 gateway --twins`: a virtual controller of its model and profile for each robot, to try
//! programs on. They run in this process, on ports of this machine. The gateway reaches them over the wire,
//! as it reaches robots, and their panels over HTTP.

use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, SocketAddr};

use r6_client::RobotSettings;
use r6_controller::{Profile, RobotModel};
use r6_gateway::{Panel, RobotConfig, RobotName};
use r6_sim::{SimSettings, Simulation};

use crate::exit::Failure;

/// What follows the name of the robot in the name of its twin.
pub const SUFFIX: &str = "-twin";

/// The model of a twin whose robot has none configured: the default of `r6 sim` and `r6 up`.
const USUAL_MODEL: &str = "BRTIRUS0707A";

/// The twins that run, by the names of their robots.
#[derive(Debug, Default)]
pub struct Twins {
    running: BTreeMap<RobotName, Twin>,
}

/// One virtual controller.
#[derive(Debug)]
struct Twin {
    name: RobotName,
    kind: Kind,
    address: SocketAddr,
    panel: Panel,
    simulation: Simulation,
}

/// What is simulated.
#[derive(Clone, Debug, PartialEq)]
struct Kind {
    model: &'static RobotModel,
    /// Whether the robot has a model, which is that of the twin.
    is_known: bool,
    profile: Profile,
}

/// Twins for a configuration that the gateway does not have yet. Those that are new run already. If this is
/// dropped, they end.
#[derive(Debug, Default)]
pub struct Prepared {
    new: BTreeMap<RobotName, Twin>,
    kept: BTreeSet<RobotName>,
}

impl Twins {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.running.len()
    }

    /// Returns the robots, each followed by its twin. Starts twins that are missing, on free ports.
    /// `profiles`: those of robots that name one. `avoided`: ports that other servers of this process need.
    /// Twins that go on have the same model and profile as before.
    ///
    /// # Errors
    /// A name that a twin cannot have, or no port. Nothing is left running.
    pub async fn prepare(
        &self,
        robots: Vec<RobotConfig>,
        profiles: &BTreeMap<RobotName, Profile>,
        avoided: &BTreeSet<u16>,
    ) -> Result<(Vec<RobotConfig>, Prepared), Failure> {
        let names = robots.iter().map(|robot| name_of_twin(&robot.name, &robots));
        let names = names.collect::<Result<Vec<_>, _>>()?;
        let of_robots = robots.iter().filter_map(port);
        let avoided: BTreeSet<_> = of_robots.chain(avoided.iter().copied()).collect();
        let (mut all, mut prepared) = (Vec::new(), Prepared::default());
        for (robot, name) in robots.into_iter().zip(names) {
            let (model, is_known) = model(&robot)?;
            let profile = profiles.get(&robot.name).cloned().unwrap_or_else(Profile::hc1);
            let kind = Kind { model, is_known, profile };
            let going_on = self.running.get(&robot.name);
            let going_on = going_on.filter(|twin| twin.kind == kind && !twin.is_on_any(&avoided));
            let (address, panel) = match going_on {
                Some(twin) => {
                    prepared.kept.insert(robot.name.clone());
                    (twin.address, twin.panel)
                }
                None => {
                    let twin = Twin::start(name.clone(), kind, &avoided).await?;
                    let places = (twin.address, twin.panel);
                    prepared.new.insert(robot.name.clone(), twin);
                    places
                }
            };
            let twin = RobotConfig {
                address: address.to_string(),
                panel: Some(panel),
                model: Some(model.name.to_string()),
                twin_of: Some(robot.name.clone()),
                // The options about the wire are for the robots.
                settings: RobotSettings::default(),
                name: name.clone(),
                ..robot.clone()
            };
            all.extend([RobotConfig { twin: Some(name), ..robot }, twin]);
        }
        Ok((all, prepared))
    }

    /// Takes over the twins of [`Self::prepare`], once the gateway has their robots, and ends those that are
    /// not needed any more. Returns a line for each twin that is new.
    pub async fn commit(&mut self, Prepared { new, kept }: Prepared) -> Vec<String> {
        let lines = new.iter().map(|(robot, twin)| twin.line(robot)).collect();
        let (going_on, over) =
            std::mem::take(&mut self.running).into_iter().partition(|(robot, _)| kept.contains(robot));
        self.running = going_on;
        self.running.extend(new);
        end_all(over).await;
        lines
    }

    /// Ends all of them, after the gateway.
    pub async fn end(self) {
        end_all(self.running).await;
    }
}

impl Twin {
    /// Starts a twin. It and its panel are on free ports of this machine, which are none of these.
    async fn start(name: RobotName, kind: Kind, avoided: &BTreeSet<u16>) -> Result<Self, Failure> {
        // Each try keeps its ports until the end, so the next one gets others.
        let mut tries = Vec::new();
        for _ in 0..=avoided.len() {
            let settings = SimSettings {
                model: kind.model.clone(),
                profile: kind.profile.clone(),
                panel: Some(SocketAddr::from((Ipv4Addr::LOCALHOST, 0))),
                ..SimSettings::default()
            };
            let simulation = Simulation::start(settings).await.map_err(Failure::usage)?;
            let address = simulation.controllers().first().map(r6_sim::ControllerHandle::address);
            let panel = simulation.panel().and_then(|panel| Panel::new(panel, 1));
            let (Some(address), Some(panel)) = (address, panel) else { break };
            let twin = Self { name: name.clone(), kind: kind.clone(), address, panel, simulation };
            if !twin.is_on_any(avoided) {
                return Ok(twin);
            }
            tries.push(twin);
        }
        Err(Failure::usage("there is no free port for a twin"))
    }

    /// Whether it or its panel is on one of these ports.
    fn is_on_any(&self, ports: &BTreeSet<u16>) -> bool {
        [self.address, self.panel.address()].iter().any(|place| ports.contains(&place.port()))
    }

    /// The line that names it.
    fn line(&self, robot: &RobotName) -> String {
        let Self { name, address, kind: Kind { model, is_known, profile }, .. } = self;
        let why = if *is_known { "" } else { " (the model of the robot is not configured)" };
        format!("twin of {robot}: {name} on {address}, {}{why}, profile {}", model.name, profile.name)
    }
}

async fn end_all(twins: BTreeMap<RobotName, Twin>) {
    for twin in twins.into_values() {
        // It keeps no state, so nothing can fail to be written.
        let _ = twin.simulation.shutdown().await;
    }
}

/// The name of the twin of a robot among these.
fn name_of_twin(robot: &RobotName, robots: &[RobotConfig]) -> Result<RobotName, Failure> {
    let name = RobotName::new(&format!("{robot}{SUFFIX}")).ok_or_else(|| {
        Failure::usage(format!("`{robot}{SUFFIX}`, the name of a twin, is longer than 32 characters"))
            .advise("with --twins, the name of a robot has 27 characters at most")
    })?;
    match robots.iter().any(|other| other.name == name) {
        true => Err(Failure::usage(format!("two robots are called `{name}`: one is the twin of `{robot}`"))
            .advise("give the robot another name, or leave --twins out")),
        false => Ok(name),
    }
}

/// The model of a twin, and whether it is that of its robot.
fn model(robot: &RobotConfig) -> Result<(&'static RobotModel, bool), Failure> {
    let name = robot.model.as_deref();
    let model = RobotModel::named(name.unwrap_or(USUAL_MODEL));
    let model = model.ok_or_else(|| Failure::usage(format!("`{}`: there is no such model", robot.name)))?;
    Ok((model, name.is_some()))
}

/// The port at which a robot is reached, or where the gateway listens for it.
fn port(robot: &RobotConfig) -> Option<u16> {
    robot.place().rsplit_once(':')?.1.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(name: &str) -> RobotConfig {
        RobotConfig::new(RobotName::new(name).unwrap(), "192.168.1.10")
    }

    /// Prepares twins whose robots have the usual profile.
    async fn prepare(twins: &Twins, robots: Vec<RobotConfig>) -> (Vec<RobotConfig>, Prepared) {
        twins.prepare(robots, &BTreeMap::new(), &BTreeSet::new()).await.unwrap()
    }

    #[tokio::test]
    async fn each_robot_has_a_twin_with_its_name_and_model_on_ports_of_its_own() {
        let press = RobotConfig { model: Some("GENERIC-SCARA".to_owned()), ..robot("press") };
        let (all, prepared) = prepare(&Twins::default(), vec![press, robot("saw")]).await;
        let told: Vec<_> = all.iter().map(|one| (one.name.as_str(), one.model.as_deref())).collect();
        let scara = Some("GENERIC-SCARA");
        let wanted =
            [("press", scara), ("press-twin", scara), ("saw", None), ("saw-twin", Some(USUAL_MODEL))];
        assert_eq!(told, wanted);
        for pair in all.chunks(2) {
            let [robot, twin] = pair else { panic!("{pair:?}") };
            assert_eq!((robot.twin.as_ref(), twin.twin_of.as_ref()), (Some(&twin.name), Some(&robot.name)));
            assert_eq!((&robot.twin_of, &twin.twin, robot.address.as_str()), (&None, &None, "192.168.1.10"));
            assert!(twin.address.starts_with("127.0.0.1:"), "{twin:?}");
            assert!(robot.panel.is_none() && twin.panel.is_some(), "{pair:?}");
        }
        assert_ne!(all[1].address, all[3].address);
        assert_ne!(all[1].panel, all[3].panel);
        assert_eq!(prepared.new.len(), 2);
    }

    #[tokio::test]
    async fn a_twin_goes_on_until_its_robot_goes_or_has_another_model_or_profile() {
        let mut twins = Twins::default();
        let (first, prepared) = prepare(&twins, vec![robot("press"), robot("saw")]).await;
        let lines = twins.commit(prepared).await;
        assert!(lines[0].starts_with("twin of press: press-twin on 127.0.0.1:"), "{lines:?}");
        let end = "BRTIRUS0707A (the model of the robot is not configured), profile hc1";
        assert!(lines[0].ends_with(end), "{lines:?}");
        let press = RobotConfig { model: Some("GENERIC-SCARA".to_owned()), ..robot("press") };
        let (second, prepared) = prepare(&twins, vec![press, robot("saw")]).await;
        assert_ne!(first[1].address, second[1].address);
        assert_eq!(first[3].address, second[3].address);
        assert_eq!(twins.commit(prepared).await.len(), 1, "the new one alone is told");
        let is_there = async |address: &str| tokio::net::TcpStream::connect(address).await.is_ok();
        let panel = |of: &RobotConfig| of.panel.unwrap().address().to_string();
        assert!(
            !is_there(&first[1].address).await && !is_there(&panel(&first[1])).await,
            "the old one ended"
        );
        assert!(is_there(&second[1].address).await && is_there(&panel(&second[1])).await);

        let legacy = Profile::named("legacy").unwrap();
        let profiles = [(robot("saw").name, legacy)].into();
        let prepared = twins.prepare(vec![robot("saw")], &profiles, &BTreeSet::new()).await;
        let (third, prepared) = prepared.unwrap();
        assert_ne!(second[3].address, third[1].address);
        let lines = twins.commit(prepared).await;
        assert!(lines.len() == 1 && lines[0].ends_with(", profile legacy"), "{lines:?}");
        let (_, prepared) = prepare(&twins, Vec::new()).await;
        twins.commit(prepared).await;
        assert_eq!(twins.count(), 0);
        for gone in [&second[1], &second[3], &third[1]] {
            assert!(!is_there(&gone.address).await && !is_there(&panel(gone)).await, "{gone:?}");
        }
    }

    #[tokio::test]
    async fn a_twin_never_has_a_port_of_a_robot_or_of_the_gateway() {
        let mut twins = Twins::default();
        let (all, prepared) = prepare(&twins, vec![robot("press")]).await;
        twins.commit(prepared).await;
        // The robot gets the address of its own twin: the twin moves away.
        let here = RobotConfig { address: all[1].address.clone(), ..robot("press") };
        let (moved, _prepared) = prepare(&twins, vec![here]).await;
        assert_ne!(moved[1].address, moved[0].address);
        // The same with a port that the gateway needs itself.
        let avoided = [all[1].panel.unwrap().address().port()].into();
        let moved = twins.prepare(vec![robot("press")], &BTreeMap::new(), &avoided).await;
        assert_ne!(moved.unwrap().0[1].panel, all[1].panel);
    }

    #[test]
    fn a_name_that_is_too_long_or_taken_is_a_mistake() {
        let (fits, long) = (robot(&"x".repeat(27)), robot(&"x".repeat(28)));
        assert_eq!(name_of_twin(&fits.name, &[]).unwrap().as_str().len(), 32);
        assert!(name_of_twin(&long.name, &[]).is_err());
        let taken = name_of_twin(&robot("a").name, &[robot("a"), robot("a-twin")]).unwrap_err();
        assert!(taken.to_string().contains("two robots are called `a-twin`"), "{taken}");
    }
}
