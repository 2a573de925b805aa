//! Who answers at which address: asked, never guessed.

use tokio::task::JoinSet;

use crate::error::RequestError;
use crate::identity::Identity;
use crate::robot::Robot;
use crate::settings::{Heartbeat, RobotSettings};

/// Addresses that are asked at the same time: more than cells have, few enough for any switch.
const AT_ONCE: usize = 16;

/// What was found at one address.
#[derive(Clone, Debug, PartialEq)]
pub struct Discovered {
    /// As it was given.
    pub address: String,
    /// Who answered, or why nobody did.
    pub who: Result<Identity, RequestError>,
}

/// Asks at these addresses who is there (`version`, `machineName`, `axisNum`), each over one connection that is closed in order.
/// The answers come in the order of the addresses. It only reads: no heartbreak is sent, whatever [`RobotSettings::heartbeat`] says.
///
/// Name the addresses where controllers may be, and the ports that their pendants may be set to (9760; others were seen on
/// 9700, 502, 503, 3388 and 8888). Do not scan a network: controllers have very few connections, and one that is left half
/// open can make the port useless until the controller is switched off and on (reported, unit A). An address at which another
/// program is connected already may not answer.
///
/// ```
/// # #[tokio::main(flavor = "current_thread")]
/// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let controller = r6_sim::VirtualController::start().await?;
/// # let address = controller.address().to_string();
/// use r6_client::{RobotSettings, discover};
///
/// for found in discover(&[&address], &RobotSettings::default()).await {
///     match found.who {
///         Ok(identity) => println!("{}: {identity}", found.address),
///         Err(error) => println!("{}: {error}", found.address),
///     }
/// }
/// # Ok(()) }
/// ```
pub async fn discover(addresses: &[&str], settings: &RobotSettings) -> Vec<Discovered> {
    let mut found: Vec<Option<Discovered>> = vec![None; addresses.len()];
    let mut asking = JoinSet::new();
    let mut waiting = addresses.iter().enumerate();
    loop {
        while asking.len() < AT_ONCE
            && let Some((at, address)) = waiting.next()
        {
            let (address, settings) = ((*address).to_owned(), settings.clone());
            asking.spawn(async move {
                let who = ask(&address, settings).await;
                (at, Discovered { address, who })
            });
        }
        // A task fails only where the runtime ends.
        let Some(asked) = asking.join_next().await else { break };
        if let Ok((at, discovered)) = asked
            && let Some(slot) = found.get_mut(at)
        {
            *slot = Some(discovered);
        }
    }
    found.into_iter().flatten().collect()
}

async fn ask(address: &str, settings: RobotSettings) -> Result<Identity, RequestError> {
    // The first heartbreak would arm a watchdog that raises an alarm once this connection is closed.
    let settings = RobotSettings { heartbeat: Heartbeat::Off, ..settings };
    let robot = Robot::connect(address, settings).await?;
    let read = robot.status().await;
    let identity = robot.identity();
    robot.close().await;
    let status = read?;
    Ok(identity.unwrap_or(Identity {
        firmware: status.firmware,
        machine_name: status.machine_name,
        axis_count: status.axis_count,
    }))
}
