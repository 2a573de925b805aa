//! Whether the gateway works.

use axum::Json;
use axum::extract::State as Of;
use axum::http::StatusCode;
use r6_api::Problem;
use r6_api::gateway::{HistoryState, Ready, RobotLink};

use super::State;
use super::caller::Caller;
use super::described::OfToken;

/// Whether the gateway answers. It needs no token.
#[utoipa::path(get, path = "/healthz", security(()), responses(
    (status = 204, description = "It answers"),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
))]
pub async fn healthz() -> StatusCode {
    StatusCode::NO_CONTENT
}

/// Whether the gateway can be used: the store answers. Robots that are down do not count, nor a history that
/// pauses. A gateway that shares its store counts the robots that it owns.
#[utoipa::path(get, path = "/readyz", responses(
    (status = 200, description = "It is ready", body = Ready),
    (status = 503, description = "The store does not answer", body = Ready),
    OfToken,
))]
pub async fn readyz(caller: Caller, Of(state): Of<State>) -> (StatusCode, Json<Ready>) {
    // An empty append takes the way of a real one to the disk, and adds no entry.
    let store = state.shared.keeper.append(Vec::new()).await.is_ok();
    let stations = state.fleet.stations();
    let seen = stations.iter().filter(|station| caller.grant().covers(station.name()));
    let links = seen.map(|station| station.summary().link);
    let (robots, robots_up) =
        links.fold((0, 0), |(all, up), link| (all + 1, up + usize::from(link == RobotLink::Up)));
    let status = if store { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    let history = match &state.shared.history {
        None => HistoryState::Off,
        Some(history) if history.is_paused() => HistoryState::Paused,
        Some(_) => HistoryState::Kept,
    };
    (status, Json(Ready { store, robots, robots_up, history }))
}
