//! The raw ports, and the switch that closes all of them.

use axum::Json;
use axum::extract::State as Of;
use r6_api::gateway::{RawPortState, RawPorts, RawPortsWanted};
use r6_api::{Code, Problem};
use r6_http::Refusal;

use super::caller::{Caller, CloseRawPorts, Manager};
use super::described::{OfBody, OfChange, OfToken};
use super::refusal::of_lost_work;
use super::{State, body, refusal};
use crate::core::role::Right;
use crate::problem;

/// The raw ports of the robots that the caller may see, and whether they are open.
#[utoipa::path(get, path = "/v1/raw-ports", operation_id = "raw_ports", responses(
    (status = 200, description = "The ports", body = RawPorts),
    OfToken,
))]
pub async fn show(caller: Caller, Of(state): Of<State>) -> Json<RawPorts> {
    Json(told(&caller, &state))
}

/// Closes all raw ports, or opens them again for the clients that the rules let in. Closing needs the role
/// engineer, opening the role admin. Lists that the arms have go on; stop the robots if they shall not.
#[utoipa::path(
    put,
    path = "/v1/raw-ports",
    operation_id = "switch_raw_ports",
    request_body = RawPortsWanted,
    responses(
        (status = 200, description = "They are so", body = RawPorts),
        (
            status = 409,
            description = "`not_ready`: this gateway can have no raw ports, or they were closed again meanwhile",
            body = Problem
        ),
        (status = 422, description = "`bad_value`", body = Problem),
        (
            status = 503,
            description = "`store_unavailable`: they are closed all the same, and would be open after a restart; or they are not opened",
            body = Problem
        ),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn put(
    manager: Manager<CloseRawPorts>,
    Of(state): Of<State>,
    body::Json(wanted): body::Json<RawPortsWanted>,
) -> Result<Json<RawPorts>, Refusal> {
    let caller = manager.caller;
    if wanted.open {
        caller.must_manage(Right::OpenRawPorts, &state, "/v1/raw-ports")?;
    }
    let switch = state.raw_ports.clone().ok_or_else(|| {
        let message = "this gateway has no raw ports: they cannot be used with --store yet";
        refusal::of(problem::Problem::new(Code::NotReady, message))
    })?;
    let (by, of_work) = (caller.by(), state.clone());
    let work = tokio::spawn(async move {
        let State { fleet, accounts, .. } = of_work;
        if wanted.open {
            switch.open(&by, &accounts).await
        } else {
            switch.close(&by, &fleet, &accounts).await
        }
    });
    work.await.map_err(of_lost_work)?.map_err(refusal::of)?;
    Ok(Json(told(&caller, &state)))
}

fn told(caller: &Caller, state: &State) -> RawPorts {
    let Some(switch) = &state.raw_ports else {
        return RawPorts { closed: None, kept: true, ports: Vec::new() };
    };
    let ports = switch.ports().iter().filter(|port| caller.grant().covers(port.robot.as_str()));
    let told = ports.map(|port| {
        let station = state.fleet.station(port.robot.as_str());
        let clients = station.map_or(0, |station| station.counts.raw.now().0);
        RawPortState { robot: port.robot.to_string(), listen: port.listen.to_string(), clients }
    });
    RawPorts { closed: switch.policy.closed(), kept: switch.policy.is_kept(), ports: told.collect() }
}
