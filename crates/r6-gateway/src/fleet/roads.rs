//! How connections to robots are made: over TCP, or in a simulation over its own network.

use r6_client::{RequestError, Robot, RobotSettings};

/// The ways to the robots.
#[derive(Clone, Debug, Default)]
pub enum Roads {
    /// TCP.
    #[default]
    Tcp,
    /// The network of a simulation.
    #[cfg(feature = "simulation")]
    Simulated(crate::simulated::Roads),
}

impl Roads {
    /// Connects to the robot at an address, as [`Robot::connect`].
    ///
    /// # Errors
    /// As there.
    pub async fn connect(&self, address: &str, settings: RobotSettings) -> Result<Robot, RequestError> {
        match self {
            Self::Tcp => Robot::connect(address, settings).await,
            #[cfg(feature = "simulation")]
            Self::Simulated(roads) => roads.connect(address, settings).await,
        }
    }
}
