//! The raw ports of a gateway when it starts.

use std::sync::Arc;

use tokio::net::TcpListener;

use super::GatewayError;
use super::front::Front;
use crate::fleet::Fleet;
use crate::fleet::config::RobotConfig;
use crate::raw_port::{Door, RawPort, SharedPolicy};

/// Refuses raw ports of robots that are not there, and two of one robot.
pub(super) fn check(ports: &[RawPort], robots: &[RobotConfig]) -> Result<(), GatewayError> {
    for (at, port) in ports.iter().enumerate() {
        let name = &port.robot;
        if !robots.iter().any(|robot| robot.name == *name) {
            return Err(GatewayError::Raw(format!("a raw port is for `{name}`, and there is no such robot")));
        }
        if ports.iter().take(at).any(|other| other.robot == *name) {
            return Err(GatewayError::Raw(format!(
                "`{name}` has two raw ports: one is enough for all clients"
            )));
        }
    }
    Ok(())
}

/// Refuses raw ports of gateways that share a store.
pub(super) fn check_shared(ports: &[RawPort]) -> Result<(), GatewayError> {
    match ports {
        [] => Ok(()),
        [..] => Err(GatewayError::Sharing("raw ports cannot be used with --store yet")),
    }
}

/// Opens the raw ports: each with the address that it listens on.
pub(super) fn open(
    ports: Vec<RawPort>,
    fleet: &Arc<Fleet>,
    policy: &SharedPolicy,
    front: &Front,
) -> Result<Vec<(RawPort, Door, TcpListener)>, GatewayError> {
    let opened = ports.into_iter().map(|port| {
        let address = port.listen;
        let failed = |error| GatewayError::Listen { option: "--raw", address, error };
        let (door, listener) = Door::open(&port, Arc::clone(fleet), policy.clone()).map_err(failed)?;
        let listen = listener.local_addr().map_err(failed)?;
        let listener = front.hear(listener).map_err(failed)?;
        Ok((RawPort { listen, ..port }, door, listener))
    });
    opened.collect()
}
