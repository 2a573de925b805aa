//! The settings of the hall: its time zone and its shifts.

use axum::extract::State as Of;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use r6_api::Problem;
use r6_api::gateway::{HallSettings, Settings};
use r6_http::Refusal;

use super::State;
use super::body;
use super::caller::{Caller, ManageSettings, Manager};
use super::described::{OfBody, OfChange, OfToken};
use super::etag::{condition, with_etag};
use super::refusal::{self, of_lost_work};
use crate::settings::Known;

/// The time zone and the shifts of the hall.
#[utoipa::path(
    get,
    path = "/v1/settings",
    operation_id = "settings",
    responses(
        (
            status = 200,
            description = "The settings",
            body = Settings,
            headers(("ETag" = String, description = "Which settings these are"))
        ),
        OfToken,
    )
)]
pub async fn show(_caller: Caller, Of(state): Of<State>) -> Response {
    answer(&state.settings.now())
}

/// Changes the time zone and the shifts of the hall. Figures of shifts that were before are those of the new
/// shifts from then on.
#[utoipa::path(
    put,
    path = "/v1/settings",
    operation_id = "change_settings",
    params(("If-Match" = String, Header, description = "The `ETag` of the settings that the change began from")),
    request_body = HallSettings,
    responses(
        (
            status = 200,
            description = "They hold",
            body = Settings,
            headers(("ETag" = String, description = "The new settings"))
        ),
        (status = 409, description = "`managed_by_file`: the file of the gateway has them", body = Problem),
        (status = 412, description = "`not_this_version`: they were changed", body = Problem),
        (status = 422, description = "`bad_value`: every mistake with its place", body = Problem),
        (status = 428, description = "`needs_if_match`", body = Problem),
        (status = 503, description = "`store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn put(
    manager: Manager<ManageSettings>,
    Of(state): Of<State>,
    headers: HeaderMap,
    body::Json(wanted): body::Json<HallSettings>,
) -> Result<Response, Refusal> {
    let (condition, by) = (condition(&headers)?, manager.caller.author());
    let keeper = state.shared.owners.hall_keeper(&state.shared.keeper).map_err(refusal::of)?;
    let work = tokio::spawn(async move { state.settings.put(wanted, &condition, &by, &keeper).await });
    work.await.map_err(of_lost_work)?.map(|known| answer(&known)).map_err(refusal::of)
}

fn answer(known: &Known) -> Response {
    let (hall, etag) = (known.hall.settings().clone(), known.tag.etag());
    let HallSettings { time_zone, shifts } = hall;
    let settings = Settings { time_zone, shifts, managed_by: known.managed_by, etag: etag.clone() };
    with_etag(StatusCode::OK, etag, &settings)
}
