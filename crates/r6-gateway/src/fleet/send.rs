//! The only place from which a command or a list that changes or moves leaves the gateway, and what cameras
//! send.

use std::sync::Arc;
use std::time::Duration;

use r6_client::{Accepted, CameraSet, Conditions, ListGate, NotSent, PhotoAnswer, RequestError, Robot};

use super::station::Station;
use crate::clock;
use crate::core::order::Order;
use crate::core::seat::{Permit, Ticket};

/// A condition beside the permit, which has to hold until the first byte is written.
#[derive(Clone)]
pub struct Still {
    holds: Arc<dyn Fn() -> bool + Send + Sync>,
    /// What a caller is told if it does not hold any more.
    pub otherwise: &'static str,
}

impl Still {
    /// `holds` is asked in the call that writes the first byte, so it has to return at once.
    pub fn new(holds: impl Fn() -> bool + Send + Sync + 'static, otherwise: &'static str) -> Self {
        Self { holds: Arc::new(holds), otherwise }
    }

    /// Whether it holds.
    pub fn holds(&self) -> bool {
        (self.holds)()
    }
}

impl Station {
    /// Sends the command or the list of a permit. The client looks again, in the call that writes the first
    /// byte, whether the permit is void or too old, and whether the connection is another one.
    ///
    /// For an answer to a photo there is no reply: `Ok` means that it left.
    pub(super) async fn send(
        &self,
        robot: &Robot,
        permit: Permit,
        still: Option<Still>,
    ) -> Result<Accepted, RequestError> {
        let Some(conditions) = self.conditions(&permit, still) else {
            return Err(NotSent::Withdrawn.into());
        };
        match permit.into_order() {
            Order::Command(command) => robot.command_under(conditions, command).await,
            Order::List { replace, steps } => {
                self.guarded(robot).add_rcc_under(conditions, replace, steps).await
            }
            Order::Points { camera, points } => {
                let set = CameraSet { cam_id: camera.number().into(), points };
                robot.add_points_under(conditions, vec![set]).await
            }
            Order::Photo { camera, taken } => {
                let answer = PhotoAnswer { cam_id: camera.number().into(), ret: taken.into() };
                let left = robot.answer_photo_under(conditions, answer).await;
                left.map(|()| Accepted { after: Duration::ZERO, points: None })
            }
        }
    }

    /// The robot behind its guard, if it has one: lists with a step beyond a limit are not sent. Its
    /// workspace is that of the tool and the work frame that are in use now.
    pub(super) fn guarded(&self, robot: &Robot) -> Robot {
        match &self.config().guard {
            Some(guard) => robot.with_guard(guard.envelope().clone()),
            None => robot.clone(),
        }
    }

    /// The gate of a run: the client asks it before each list, and sends the list under the conditions of its
    /// permit. It does not keep the station alive: the client holds the gate, and the station the client.
    pub(super) fn gate(station: &Arc<Self>, ticket: Ticket) -> ListGate {
        let station = Arc::downgrade(station);
        ListGate::new(move |replace, steps| {
            let station = station.upgrade()?;
            let list = Order::List { replace, steps: steps.to_vec() };
            let permit = station.seat(|seat, now| seat.permit_list(now, ticket, list));
            let permit = permit.inspect_err(|denied| {
                tracing::info!(robot = station.name(), %denied, "a list of a run is not permitted");
            });
            station.conditions(&permit.ok()?, None)
        })
    }

    /// The conditions of a permit; `None` if it is void.
    fn conditions(&self, permit: &Permit, still: Option<Still>) -> Option<Conditions> {
        let permission = self.permission(permit)?;
        let (latest, ownership) = (permit.latest(), self.term.ownership.clone());
        Some(Conditions {
            leave_within: Some(latest.since(clock::now())),
            only_on: Some(permit.connection()),
            // The client's clock stands while the machine sleeps. The clock of the lease goes on, and so does
            // that of the ownership: a process that was frozen sends nothing when it goes on.
            permission: Some(permission.only_while(move || {
                let may = still.as_ref().is_none_or(Still::holds);
                may && clock::now() < latest && ownership.may_move()
            })),
        })
    }
}
