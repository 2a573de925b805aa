//! The only place from which a command or a list that changes or moves leaves the gateway.

use r6_client::{Accepted, Conditions, NotSent, RequestError, Robot};

use super::station::Station;
use crate::clock;
use crate::core::order::Order;
use crate::core::seat::Permit;

impl Station {
    /// Sends the command or the list of a permit. The client looks again, in the call that writes the first
    /// byte, whether the permit is void or too old, and whether the connection is another one.
    pub(super) async fn send(&self, robot: &Robot, permit: Permit) -> Result<Accepted, RequestError> {
        let Some(permission) = self.permission(permit.generation()) else {
            return Err(NotSent::Withdrawn.into());
        };
        let latest = permit.latest();
        let conditions = Conditions {
            leave_within: Some(latest.since(clock::now())),
            only_on: Some(permit.connection()),
            // The client's clock stands while the machine sleeps. The clock of the lease goes on.
            permission: Some(permission.only_while(move || clock::now() < latest)),
        };
        match permit.into_order() {
            Order::Command(command) => robot.command_under(conditions, command).await,
            Order::List { replace, steps } => robot.add_rcc_under(conditions, replace, steps).await,
        }
    }
}
