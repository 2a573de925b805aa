//! The second robot of `r6 up --demo`. It runs a program from the start, so something moves.

use std::net::{Ipv4Addr, SocketAddr};

use r6_controller::Library;
use r6_gateway::Panel;
use r6_sim::{Clock, SimSettings, Simulation};

use super::gateway::Cell;
use crate::cmd::sim::given;
use crate::exit::Failure;

/// Its name in the gateway, and that of its program.
const NAME: &str = "demo";

/// The model of its arm: its program is for this one.
const MODEL: &str = "BRTIRUS0707A";

const PROGRAM: &str = include_str!("demo.toml");

/// Starts it, on ports of its own. It runs its program at once.
pub async fn start(clock: Clock) -> Result<Simulation, Failure> {
    let mut library = Library::default();
    library.insert(given::program_of(PROGRAM, NAME, "demo.toml")?).map_err(Failure::usage)?;
    let here = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let settings = SimSettings {
        listen: vec![here],
        panel: Some(here),
        model: given::model(MODEL)?,
        library,
        mold: NAME.to_owned(),
        clock,
        ..SimSettings::default()
    };
    Simulation::start(settings).await.map_err(Failure::usage)
}

/// Puts it behind the gateway of this cell.
pub fn add_to(cell: &mut Cell, demo: &Simulation) -> Result<(), Failure> {
    let panel = demo.panel().and_then(|panel| Panel::new(panel, 1));
    for robot in demo.controllers() {
        cell.add(NAME, robot.local_address(), panel, Some(MODEL.to_owned()))?;
    }
    Ok(())
}
