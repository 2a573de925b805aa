//! Asks the given addresses which controllers answer.

use tokio::task::JoinSet;

use crate::error::RequestError;
use crate::identity::Identity;
use crate::robot::Robot;
use crate::settings::{Heartbeat, RobotSettings};

/// Addresses that are asked at the same time: more than a cell has, and few enough for any switch.
const AT_ONCE: usize = 16;

/// The result for one address.
#[derive(Clone, Debug, PartialEq)]
pub struct Discovered {
    /// The address as the caller gave it.
    pub address: String,
    /// The identity of the controller, or why there is no answer.
    pub who: Result<Identity, RequestError>,
}

/// Asks each of these addresses for its identity (`version`, `machineName`, `axisNum`). It opens one
/// connection per address and closes it in order. The results have the order of the addresses. This only
/// reads: it sends no heartbreak, even if [`RobotSettings::heartbeat`] asks for one.
///
/// Name only addresses where controllers may be, with the ports that their pendants may be set to (9760;
/// others were seen on 9700, 502, 503, 3388 and 8888). Do not scan a network. Controllers have very few
/// connections, and a half-open connection can make the port useless until the controller is switched off and
/// on (reported, unit A). An address to which another program is connected may not answer.
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
        // A task fails only if the runtime ends.
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
    // The first heartbreak would start a watchdog, which raises an alarm once this connection is closed.
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
