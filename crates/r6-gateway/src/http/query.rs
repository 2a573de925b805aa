//! Values that are asked for once.

use axum::Json;
use axum::extract::Query;
use axum::extract::rejection::QueryRejection;
use r6_api::Problem;
use r6_api::gateway::Queried;
use r6_client::Address;
use r6_http::Refusal;
use serde::Deserialize;
use utoipa::IntoParams;

use super::caller::{Read, Robot};
use super::described::OfRight;
use super::refusal::{self, bad_value};
use crate::fleet::query::MAX_ADDRESSES;

/// Which values.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// Query addresses with commas between, 128 at most.
    #[param(example = "Addr-800,counter-1")]
    address: String,
}

/// Asks the robot for values, whether they are read again and again or not. It shares the one connection with
/// everything else. An address that the robot does not have is in `problems`, with the reason.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/query",
    operation_id = "query",
    params(("name" = String, Path, description = "The name of the robot"), Wanted),
    responses(
        (status = 200, description = "The values", body = Queried),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 409, description = "`not_ready`, `identity_changed`: it was not asked", body = Problem),
        (status = 422, description = "`bad_value`: an address is wrong", body = Problem),
        (status = 503, description = "`overloaded`: other queries are under way", body = Problem),
        (status = 504, description = "`no_reply`", body = Problem),
        OfRight,
    )
)]
pub async fn show(
    robot: Robot<Read>,
    wanted: Result<Query<Wanted>, QueryRejection>,
) -> Result<Json<Queried>, Refusal> {
    let Query(Wanted { address }) = wanted.map_err(refusal::of_query)?;
    let names: Vec<_> = address.split(',').map(str::trim).collect();
    if names.len() > MAX_ADDRESSES {
        return Err(bad_value(format!("a query has at most {MAX_ADDRESSES} addresses")));
    }
    let addresses =
        names.into_iter().map(|name| Address::parse(name).map_err(|unknown| bad_value(unknown.to_string())));
    let addresses = addresses.collect::<Result<Vec<_>, _>>()?;
    robot.station.query(&addresses).await.map(Json).map_err(refusal::of)
}
