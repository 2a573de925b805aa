//! The users, for admins.

use axum::Json;
use axum::extract::State as Of;
use axum::http::StatusCode;
use r6_api::gateway::{Role, User, UserWanted, Users};
use r6_api::{Code, Problem};
use r6_http::Refusal;

use super::State;
use super::body;
use super::caller::{ManageUsers, Manager};
use super::described::{OfBody, OfChange, OfRight};
use super::refusal::{self, bad_value};
use crate::core::account::{Decided, UserName, Wish};
use crate::core::role::GrantRobots;
use crate::problem;
use crate::store::StoredUser;

/// All users, without their passwords.
#[utoipa::path(get, path = "/v1/users", operation_id = "users", responses(
    (status = 200, description = "In the order of their names", body = Users),
    OfRight,
))]
pub async fn list(_manager: Manager<ManageUsers>, Of(state): Of<State>) -> Json<Users> {
    Json(Users { users: state.accounts.users().iter().map(|user| shown(user)).collect() })
}

/// Makes a user, or changes the user of this name. If something changes, all sessions of the user end. Leases
/// stay until they end by themselves. Without `password` the old password stays; a new user cannot sign in
/// until a password is set.
#[utoipa::path(
    put,
    path = "/v1/users/{name}",
    operation_id = "put_user",
    params((
        "name" = String,
        Path,
        description = "The name: 1 to 64 characters of a to z, digits, -, _ and ., a letter first"
    )),
    request_body = UserWanted,
    responses(
        (status = 201, description = "The user was made"),
        (status = 204, description = "The user is as wanted"),
        (status = 409, description = "`last_admin`; `no_room` for another user", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`overloaded`, `store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn put(
    manager: Manager<ManageUsers>,
    Of(state): Of<State>,
    body::Json(wanted): body::Json<UserWanted>,
) -> Result<StatusCode, Refusal> {
    let UserWanted { role, robot, disabled, password } = wanted;
    let name = UserName::new(&manager.named)
        .ok_or_else(|| bad_value(format!("name: a user has {}", UserName::WANTED)))?;
    let robots = robot.map(|robot| robots_of(robot, role)).transpose()?;
    let author = manager.caller.author();
    let work = tokio::spawn(async move {
        let password = match password {
            Some(password) => Some(state.accounts.hash(password).await?),
            None => None,
        };
        state.accounts.change(name, Wish::Put { role, robots, disabled, password }, author).await
    });
    let decided = work.await.map_err(refusal::of_lost_work)?.map_err(refusal::of)?;
    Ok(if matches!(decided, Decided::Made(_)) { StatusCode::CREATED } else { StatusCode::NO_CONTENT })
}

/// Removes a user. All sessions of the user end. Leases stay until they end by themselves.
#[utoipa::path(
    delete,
    path = "/v1/users/{name}",
    operation_id = "remove_user",
    params(("name" = String, Path, description = "The name")),
    responses(
        (status = 204, description = "The user was removed"),
        (status = 404, description = "`no_such_user`", body = Problem),
        (status = 409, description = "`last_admin`", body = Problem),
        (status = 503, description = "`store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
    )
)]
pub async fn remove(manager: Manager<ManageUsers>, Of(state): Of<State>) -> Result<StatusCode, Refusal> {
    let no_such = || refusal::of(problem::Problem::new(Code::NoSuchUser, "there is no user with this name"));
    let name = UserName::new(&manager.named).ok_or_else(no_such)?;
    let author = manager.caller.author();
    let work = tokio::spawn(async move { state.accounts.change(name, Wish::Remove, author).await });
    let removed = work.await.map_err(refusal::of_lost_work)?;
    removed.map(|_| StatusCode::NO_CONTENT).map_err(refusal::of)
}

/// The robots that a body names, with their roles, none above this one. There need not be such robots yet.
///
/// # Errors
/// `bad_value`.
pub(super) fn robots_of(robot: Option<String>, most: Role) -> Result<Option<GrantRobots>, Refusal> {
    let read = |robots: String| GrantRobots::read(&robots)?.within(most);
    robot.map(read).transpose().map_err(|error| bad_value(format!("robot: {error}")))
}

fn shown(user: &StoredUser) -> User {
    let StoredUser { account, created, .. } = user;
    User {
        name: account.name.to_string(),
        role: account.grant.role,
        robot: account.grant.robots.as_ref().map(ToString::to_string),
        disabled: account.disabled,
        has_password: account.password.is_some(),
        created: created.clone(),
    }
}
