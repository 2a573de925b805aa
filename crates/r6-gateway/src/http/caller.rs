//! Who calls, and whether they may: the first thing that each route asks for.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::Arc;

use axum::extract::{FromRequestParts, Path};
use axum::http::StatusCode;
use axum::http::header::AUTHORIZATION;
use axum::http::request::Parts;
use r6_api::Code;
use r6_http::{Peer, Refusal};

use super::State;
use crate::core::role::Right;
use crate::fleet::station::{By, Station};
use crate::tokens::Known;

/// Somebody with a valid token.
#[derive(Clone, Debug)]
pub struct Caller {
    /// The token.
    pub token: Arc<Known>,
    source: Option<String>,
}

impl Caller {
    /// Who it is, for the audit log.
    pub fn by(&self) -> By {
        By { actor: self.token.label.clone(), source: self.source.clone() }
    }

    /// Refuses unless the token allows this for this robot.
    pub fn must(&self, right: Right, robot: &str) -> Result<(), Refusal> {
        let grant = &self.token.grant;
        if grant.allows(right, robot) {
            return Ok(());
        }
        let message = if grant.covers(robot) {
            format!(
                "this needs the role {}, and the token is {}",
                right.lowest_role().word(),
                grant.role.word()
            )
        } else {
            "the token is for another robot".to_owned()
        };
        Err(Refusal::new(StatusCode::FORBIDDEN, Code::NotAllowed, message))
    }

    /// Refuses unless the token allows this for all robots.
    pub fn must_for_all(&self, right: Right) -> Result<(), Refusal> {
        match &self.token.grant.only {
            None => self.must(right, ""),
            Some(_) => {
                let message = "the token is for one robot, and programs are for all of them";
                Err(Refusal::new(StatusCode::FORBIDDEN, Code::NotAllowed, message))
            }
        }
    }

    /// Counts a request of this token. A stop is not counted: it must never be refused for this.
    ///
    /// # Errors
    /// `too_many_requests`.
    pub fn count(&self, state: &State) -> Result<(), Refusal> {
        state.tokens.request(self.token.number).map_err(Refusal::too_many)
    }

    /// Whether the caller could come again now: streams end within a second when it could not.
    pub fn is_still_valid(&self, state: &State) -> bool {
        state.tokens.is_valid(self.token.number)
    }

    /// The caller with a valid token, whose request is not counted.
    async fn known(parts: &Parts, state: &State) -> Result<Self, Refusal> {
        let mut headers = parts.headers.get_all(AUTHORIZATION).iter();
        let text = match (headers.next().and_then(|header| header.to_str().ok()), headers.next()) {
            (Some(header), None) => header.split_once(' '),
            _ => None,
        };
        let token =
            text.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer")).map(|(_, token)| token.trim());
        let known = match token {
            Some(token) => state.tokens.find(token).await,
            None => None,
        };
        let token = known.ok_or_else(|| {
            let message = "send `Authorization: Bearer TOKEN`; `r6 gateway token` makes one";
            Refusal::new(StatusCode::UNAUTHORIZED, Code::NoToken, message)
        })?;
        let source = parts.extensions.get::<Peer>().map(|peer| peer.0.to_string());
        Ok(Self { token, source })
    }
}

impl FromRequestParts<State> for Caller {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, state: &State) -> Result<Self, Refusal> {
        let caller = Self::known(parts, state).await?;
        caller.count(state)?;
        Ok(caller)
    }
}

/// Somebody who may store and remove programs.
#[derive(Debug)]
pub struct Librarian(pub Caller);

impl FromRequestParts<State> for Librarian {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, state: &State) -> Result<Self, Refusal> {
        let caller = Caller::from_request_parts(parts, state).await?;
        caller.must_for_all(Right::StorePrograms)?;
        Ok(Self(caller))
    }
}

/// What a route needs, as a type: a route about a robot cannot be written without it.
pub trait Needs: Send + Sync + 'static {
    /// The right.
    const RIGHT: Right;
}

macro_rules! needs {
    ($($(#[$doc:meta])* $name:ident)*) => {$(
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $name;
        impl Needs for $name {
            const RIGHT: Right = Right::$name;
        }
    )*};
}

needs! {
    /// Reading.
    Read
    /// Stopping.
    Stop
    /// Holding the lease.
    Command
    /// Accepting another robot.
    AcceptIdentity
    /// Adding, changing and removing robots.
    Configure
}

/// The name in a path, for a caller who has the right `R` for a robot of this name. There may be no such
/// robot.
#[derive(Debug)]
pub struct Named<R> {
    /// Who calls.
    pub caller: Caller,
    /// The name, as the caller wrote it.
    pub name: String,
    right: PhantomData<R>,
}

impl<R: Needs> FromRequestParts<State> for Named<R> {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, state: &State) -> Result<Self, Refusal> {
        let caller = Caller::known(parts, state).await?;
        if R::RIGHT != Right::Stop {
            caller.count(state)?;
        }
        let names = Path::<BTreeMap<String, String>>::from_request_parts(parts, state).await;
        let name = names.ok().and_then(|Path(mut names)| names.remove("name")).unwrap_or_default();
        if let Err(refusal) = caller.must(R::RIGHT, &name) {
            if R::RIGHT != Right::Read
                && let Some(station) = state.fleet.station(&name)
            {
                station.note_refused(&caller.by(), parts.uri.path(), Code::NotAllowed);
            }
            return Err(refusal);
        }
        Ok(Self { caller, name, right: PhantomData })
    }
}

/// The robot that a path names, for a caller who has the right `R` for it.
#[derive(Debug)]
pub struct Robot<R> {
    /// Who calls.
    pub caller: Caller,
    /// The robot.
    pub station: Arc<Station>,
    right: PhantomData<R>,
}

impl<R: Needs> FromRequestParts<State> for Robot<R> {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, state: &State) -> Result<Self, Refusal> {
        let Named { caller, name, right } = Named::<R>::from_request_parts(parts, state).await?;
        let station = state.fleet.station(&name).ok_or_else(|| {
            let name: String = name.chars().take(40).collect();
            Refusal::not_found(Code::NoSuchRobot, format!("there is no robot `{name}`"))
        })?;
        Ok(Self { caller, station, right })
    }
}
