//! The panel of a virtual robot.

use axum::extract::State as Of;
use axum::http::HeaderMap;
use r6_api::Problem;
use r6_api::gateway::{PanelDone, PanelRequest};
use r6_api::panel::{Faults, Snapshot};
use r6_http::Refusal;
use r6_proto::Effect;

use super::body::{Json, key};
use super::caller::{Read, Robot, Stop};
use super::described::{OfBody, OfChange, OfRight};
use super::{State, deadline, refusal};
use crate::core::panel::{Needs, Press};
use crate::core::seat::Denied;
use crate::problem;

/// What a person sees at the machine. Only virtual robots of the gateway's own process have a panel: twins,
/// and the robot of `r6 up`.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/panel",
    operation_id = "panel",
    params(("name" = String, Path, description = "The name of the robot")),
    responses(
        (status = 200, description = "Now", body = Snapshot),
        (status = 404, description = "`no_such_robot`; `no_panel`: it is not such a virtual robot", body = Problem),
        (status = 504, description = "`no_reply`: the panel does not answer", body = Problem),
        OfRight,
    )
)]
pub async fn show(robot: Robot<Read>) -> Result<axum::Json<Snapshot>, Refusal> {
    robot.station.panel_state().await.map(axum::Json).map_err(refusal::of)
}

/// The faults that the robot can be given at its panel: those of the scenarios of virtual controllers. Those
/// that are in force are in the state of the panel.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/panel/faults",
    operation_id = "panel_faults",
    params(("name" = String, Path, description = "The name of the robot")),
    responses(
        (status = 200, description = "All of them", body = Faults),
        (status = 404, description = "`no_such_robot`; `no_panel`: it is not such a virtual robot", body = Problem),
        (status = 504, description = "`no_reply`: the panel does not answer", body = Problem),
        OfRight,
    )
)]
pub async fn faults(robot: Robot<Read>) -> Result<axum::Json<Faults>, Refusal> {
    robot.station.panel_faults().await.map(axum::Json).map_err(refusal::of)
}

/// Does what a person does at the machine. The buttons stop and pause and the emergency stop need no lease,
/// and hold as a stop does. Everything else needs the lease, except the end of faults; the mode key, inputs,
/// alarms, faults and points need the role engineer. A start and moves by hand are refused while a stop
/// holds. The audit log has the intent before, and the outcome after. A move whose button is held
/// (`hold_jog`) ends 200 ms after the last `keep_jog`; `keep_jog` and `end_jog` are not in the audit log.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/panel",
    operation_id = "act_at_panel",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        deadline::Deadline
    ),
    request_body = PanelRequest,
    responses(
        (status = 200, description = "Done; a move has begun", body = PanelDone),
        (status = 404, description = "`no_such_robot`; `no_panel`: it is not such a virtual robot", body = Problem),
        (
            status = 409,
            description = "`no_lease`, `stopped`, `not_ready`, `identity_changed`, `run_under_way`, `leftover_list`, `too_late`; the \
                           machine refuses it now: `power_off`, `emergency_stop`, `alarm`, `not_homed`, `not_auto`, \
                           `not_manual`, `moving`, `not_held`, `no_global_speed`, `program`, `no_path`, `no_room`",
            body = Problem
        ),
        (
            status = 422,
            description = "`bad_value`, or an action that is never possible: `bad_action`, `no_such_input`, \
                           `no_such_axis`, `no_distance`, `bad_speed`, `bad_fault`",
            body = Problem
        ),
        (status = 503, description = "`store_unavailable`, `overloaded`: nothing was sent", body = Problem),
        (status = 504, description = "`outcome_unknown`: it may have acted", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn act(
    robot: Robot<Stop>,
    Of(state): Of<State>,
    headers: HeaderMap,
    body: Result<Json<PanelRequest>, Refusal>,
) -> Result<axum::Json<PanelDone>, Refusal> {
    let Robot { caller, station, .. } = robot;
    let request = caller.of_body(&state, body)?;
    let press = Press::new(request.action);
    let by = caller.by();
    let work = if press.effect == Effect::Stops {
        tokio::spawn(async move {
            let written = station.is_stop_written(&by, &press.to_string());
            let done = station.panel_stop(&by, &press, written).await;
            let written = station.written_for_others().await;
            done.and_then(|done| written.map(|()| done))
        })
    } else {
        caller.count(&state)?;
        if let Err(refused) = caller.must(press.right, station.name()) {
            station.note_refused(&by, &press.to_string(), r6_api::Code::NotAllowed);
            return Err(refused);
        }
        deadline::check(&headers)?;
        // Before the lease: a caller who wants a real robot should not look for one.
        station.panel().map_err(refusal::of)?;
        let key = if press.needs == Needs::Nothing {
            None
        } else {
            let held = request.lease.as_ref().ok_or_else(|| Denied::NoLease.into()).and_then(key);
            Some(held.map_err(|problem: problem::Problem| {
                station.note_refused(&by, &press.to_string(), problem.code);
                refusal::of(problem)
            })?)
        };
        let run_leftover = request.run_leftover;
        tokio::spawn(async move { station.panel_action(&by, key, &press, run_leftover).await })
    };
    work.await.map_err(refusal::of_lost_work)?.map(axum::Json).map_err(refusal::of)
}
