//! The audit log.

use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State as Of};
use r6_api::gateway::{Audit, AuditEntry, AuditHead};
use r6_api::{Code, Problem};
use r6_http::Refusal;
use serde::Deserialize;
use utoipa::IntoParams;

use super::State;
use super::caller::Caller;
use super::described::OfRight;
use super::range::check_limit;
use super::refusal;
use crate::core::role::Right;
use crate::problem;
use crate::store::MAX_PAGE;

/// Which entries.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Page {
    /// Only entries after this number.
    #[serde(default)]
    after: u64,
    /// The largest number of entries to look at, 1 to 1000.
    #[serde(default = "usual_limit")]
    #[param(minimum = 1, maximum = 1000, default = 100)]
    limit: usize,
}

fn usual_limit() -> usize {
    100
}

/// A page of the audit log, oldest first. A token for some robots sees the entries of those for which it has
/// the role engineer.
#[utoipa::path(get, path = "/v1/audit", operation_id = "audit", params(Page), responses(
    (status = 200, description = "The entries", body = Audit),
    (status = 422, description = "`bad_value`", body = Problem),
    (status = 503, description = "`store_unavailable`", body = Problem),
    OfRight,
))]
pub async fn page(
    caller: Caller,
    Of(state): Of<State>,
    page: Result<Query<Page>, QueryRejection>,
) -> Result<Json<Audit>, Refusal> {
    let grant = caller.grant();
    caller.must_somewhere(Right::ReadAudit)?;
    let Query(Page { after, limit }) = page.map_err(refusal::of_query)?;
    check_limit(limit, MAX_PAGE)?;
    let entries = state.shared.keeper.entries(after, limit).await;
    let entries = entries.map_err(|error| refusal::of(error.into()))?;
    let next_after = entries.last().filter(|_| entries.len() == limit).map(|entry| entry.number);
    let entries = entries.into_iter().map(|entry| {
        let record = serde_json::from_str(&entry.body).map_err(|error| {
            let message = format!("entry {} cannot be read: {error}", entry.number);
            refusal::of(problem::Problem::new(Code::StoreUnavailable, message))
        })?;
        Ok(AuditEntry { number: entry.number, record, hash: entry.hash.to_string() })
    });
    let entries = entries.collect::<Result<Vec<_>, Refusal>>()?;
    // Entries about no robot are for those alone who may read the log for all robots.
    let seen = |entry: &AuditEntry| match &entry.record.robot {
        None => grant.allows_for_all(Right::ReadAudit),
        Some(robot) => grant.allows(Right::ReadAudit, robot),
    };
    Ok(Json(Audit { entries: entries.into_iter().filter(seen).collect(), next_after }))
}

/// The present end of the audit log, signed. Keep the note on another machine: `r6 gateway verify --head`
/// finds with it whether the log was cut off or rewritten since.
#[utoipa::path(get, path = "/v1/audit/head", operation_id = "audit_head", responses(
    (status = 200, description = "The head", body = AuditHead),
    (status = 503, description = "`store_unavailable`", body = Problem),
    OfRight,
))]
pub async fn head(caller: Caller, Of(state): Of<State>) -> Result<Json<AuditHead>, Refusal> {
    caller.must_somewhere(Right::ReadAudit)?;
    let auditor = state.auditor().map_err(refusal::of)?;
    let (head, note) = auditor.head().await.map_err(|error| refusal::of(error.into()))?;
    let (number, hash, key) = (head.number, head.hash.to_string(), auditor.key().to_string());
    Ok(Json(AuditHead { number, hash, time: head.time, note, key }))
}
