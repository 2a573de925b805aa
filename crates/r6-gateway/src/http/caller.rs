//! Who calls, and whether they may: the first thing that each route asks for.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::net::SocketAddr;
use std::sync::Arc;

use axum::extract::{FromRequestParts, Path};
use axum::http::header::{AUTHORIZATION, ORIGIN, UPGRADE};
use axum::http::request::Parts;
use axum::http::{Method, StatusCode};
use r6_api::Code;
use r6_api::gateway::Role;
use r6_http::{Guest, Peer, Refusal};

use super::body::Json;
use super::forward::Passed;
use super::{State, refusal};
use crate::accounts::{self, SignedIn};
use crate::clock;
use crate::core::owner::Phase;
use crate::core::pass::Bearer;
use crate::core::role::{Grant, Right};
use crate::fleet::station::{By, Station};
use crate::secret;
use crate::store::{Author, StoredUser};
use crate::tokens::{Known, Page};

/// The header that proves that a page belongs to a session.
const CSRF_HEADER: &str = "x-csrf-token";

/// How much of a path the audit log tells, in characters.
const MAX_TOLD: usize = 100;

/// Somebody with a valid token or an open session.
#[derive(Clone, Debug)]
pub struct Caller {
    who: Who,
    source: Option<SocketAddr>,
    /// Whether another gateway passes the request on.
    is_passed: bool,
}

/// What a caller has proved to be.
#[derive(Clone, Debug)]
pub enum Who {
    /// A token was sent.
    Token(Arc<Known>),
    /// A browser with a session for this token.
    Page(Arc<Known>, Page),
    /// A browser with a session of a user.
    User(SignedIn),
    /// A user with a session at another gateway, which passes the request on.
    Passed(Arc<StoredUser>),
    /// Another gateway that shares the store: it reads what this one has, and no more.
    Gateway(u64),
}

/// What another gateway may do.
static OF_GATEWAY: Grant = Grant { role: Role::Viewer, robots: None };

/// `part`: with which robot, if the caller has not the same role for all.
fn role_is_too_low(right: Right, role: Role, part: &str) -> Refusal {
    let (needed, role) = (right.lowest_role().word(), role.word());
    not_allowed(format!("this needs the role {needed}, and the caller is {role}{part}"))
}

impl Caller {
    /// What the caller has proved to be.
    pub fn who(&self) -> &Who {
        &self.who
    }

    /// Who it is, for the audit log.
    pub fn by(&self) -> By {
        let actor = match &self.who {
            Who::Token(token) | Who::Page(token, _) => token.label.clone(),
            Who::User(signed_in) => signed_in.user.account.name.to_string(),
            Who::Passed(user) => user.account.name.to_string(),
            Who::Gateway(number) => format!("gateway {number}"),
        };
        By { actor, source: self.source.map(|source| source.to_string()) }
    }

    /// Who it is, for a change of users, tokens or programs.
    pub fn author(&self) -> Author {
        let By { actor, source } = self.by();
        Author { time: clock::time_of_day(), actor, source }
    }

    /// What the caller may do.
    pub fn grant(&self) -> &Grant {
        match &self.who {
            Who::Token(token) | Who::Page(token, _) => &token.grant,
            Who::User(signed_in) => &signed_in.user.account.grant,
            Who::Passed(user) => &user.account.grant,
            Who::Gateway(_) => &OF_GATEWAY,
        }
    }

    /// The address that the request came from.
    pub fn source(&self) -> Option<SocketAddr> {
        self.source
    }

    /// The number of the token; `None` for a user.
    pub fn token(&self) -> Option<i64> {
        match &self.who {
            Who::Token(token) | Who::Page(token, _) => Some(token.number),
            Who::User(_) | Who::Passed(_) | Who::Gateway(_) => None,
        }
    }

    /// The session of a user; `None` for a token.
    pub fn session(&self) -> Option<&SignedIn> {
        match &self.who {
            Who::Token(_) | Who::Page(..) | Who::Passed(_) | Who::Gateway(_) => None,
            Who::User(signed_in) => Some(signed_in),
        }
    }

    /// The session of a browser for a token; `None` for a user, and for a token that was sent itself.
    pub fn page(&self) -> Option<&Page> {
        match &self.who {
            Who::Page(_, page) => Some(page),
            Who::Token(_) | Who::User(_) | Who::Passed(_) | Who::Gateway(_) => None,
        }
    }

    /// Whether another gateway passes the request on: it asks the others itself.
    pub fn is_passed(&self) -> bool {
        self.is_passed
    }

    /// Whether another gateway asks, to tell its own readers.
    pub fn is_gateway(&self) -> bool {
        matches!(self.who, Who::Gateway(_))
    }

    /// Whether the request came with a session, of a user or for a token.
    pub fn has_session(&self) -> bool {
        !matches!(self.who, Who::Token(_))
    }

    /// Refuses unless the caller may do this with this robot.
    pub fn must(&self, right: Right, robot: &str) -> Result<(), Refusal> {
        let grant = self.grant();
        let Some(role) = grant.role_for(robot) else {
            let only = grant.robots.as_ref().map(ToString::to_string).unwrap_or_default();
            return Err(not_allowed(format!("the token or the user is only for {only}")));
        };
        if role >= right.lowest_role() {
            return Ok(());
        }
        let part = if grant.is_for_all() { String::new() } else { format!(" for {robot}") };
        Err(role_is_too_low(right, role, &part))
    }

    /// Refuses unless the caller may do this with one robot at least.
    pub fn must_somewhere(&self, right: Right) -> Result<(), Refusal> {
        let grant = self.grant();
        if grant.allows_somewhere(right) { Ok(()) } else { Err(role_is_too_low(right, grant.highest(), "")) }
    }

    /// Refuses unless the caller may do this for all robots alike.
    pub fn must_for_all(&self, right: Right) -> Result<(), Refusal> {
        let grant = self.grant();
        if grant.allows_for_all(right) {
            return Ok(());
        }
        let (needed, role) = (right.lowest_role().word(), grant.role.word());
        let given = match &grant.robots {
            None => role.to_owned(),
            Some(robots) => format!("{role} with the list `{robots}`"),
        };
        Err(not_allowed(format!(
            "this needs the role {needed} without a list of robots, and the caller is {given}"
        )))
    }

    /// The same, and tells the audit log what it refuses.
    pub fn must_manage(&self, right: Right, state: &State, path: &str) -> Result<(), Refusal> {
        self.must_for_all(right).inspect_err(|_| {
            if let Some(source) = self.source {
                let request = path.chars().take(MAX_TOLD).collect();
                state.accounts.ledger.refused(&self.by(), source.ip(), request, Code::NotAllowed);
            }
        })
    }

    /// Counts a request of this token or user. A stop is not counted: it must never be refused for this.
    ///
    /// # Errors
    /// `too_many_requests`.
    pub fn count(&self, state: &State) -> Result<(), Refusal> {
        let counted = match &self.who {
            Who::Token(token) | Who::Page(token, _) => state.tokens.request(token.number),
            Who::User(signed_in) => state.accounts.request(&signed_in.user.account.name),
            Who::Passed(user) => state.accounts.request(&user.account.name),
            Who::Gateway(_) => Ok(()),
        };
        counted.map_err(Refusal::too_many)
    }

    /// The body of a request that may be a stop. What cannot be read is no stop, and counts as any request.
    ///
    /// # Errors
    /// `too_many_requests`; what is wrong with the body.
    pub fn of_body<T>(&self, state: &State, body: Result<Json<T>, Refusal>) -> Result<T, Refusal> {
        match body {
            Ok(Json(request)) => Ok(request),
            Err(refusal) => {
                self.count(state)?;
                Err(refusal)
            }
        }
    }

    /// Whether the caller could come again now: streams end within a second when it could not.
    pub fn is_still_valid(&self, state: &State) -> bool {
        match &self.who {
            Who::Token(token) => state.tokens.is_valid(token.number),
            Who::Page(_, page) => state.tokens.is_open(&page.id),
            Who::User(signed_in) => state.accounts.is_open(&signed_in.id),
            Who::Passed(user) => state.accounts.has(&user.account.name),
            Who::Gateway(number) => state.shared.owners.has_gateway(*number),
        }
    }

    /// Who asks, for another gateway.
    pub fn bearer(&self) -> Bearer {
        match &self.who {
            Who::Token(token) | Who::Page(token, _) => Bearer::Token(token.number),
            Who::User(signed_in) => Bearer::User(signed_in.user.account.name.to_string()),
            Who::Passed(user) => Bearer::User(user.account.name.to_string()),
            Who::Gateway(_) => Bearer::Gateway,
        }
    }

    /// The caller, whose request is not counted. From now on strangers cannot push the request out.
    pub(super) async fn known(parts: &Parts, state: &State) -> Result<Self, Refusal> {
        let caller = Self::look_up(parts, state).await?;
        if let Some(guest) = parts.extensions.get::<Guest>() {
            guest.keep();
        }
        Ok(caller)
    }

    /// The caller. With a token the cookie does not matter. A token that is in memory and a session need no
    /// disk.
    async fn look_up(parts: &Parts, state: &State) -> Result<Self, Refusal> {
        if let Some(passed) = parts.extensions.get::<Passed>() {
            return Self::of_pass(passed, state).await;
        }
        let source = parts.extensions.get::<Peer>().map(|peer| peer.0);
        let mut headers = parts.headers.get_all(AUTHORIZATION).iter();
        let text = match (headers.next(), headers.next()) {
            (None, _) => match &state.cookie.candidates(&parts.headers)[..] {
                [] => None,
                texts => return Self::of_session(texts, parts, state, source),
            },
            (Some(header), None) => header.to_str().ok().and_then(|header| header.split_once(' ')),
            (Some(_), Some(_)) => None,
        };
        let token =
            text.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer")).map(|(_, token)| token.trim());
        let known = match token {
            Some(token) => state.tokens.find(token).await,
            None => None,
        };
        let token = known.ok_or_else(|| {
            let message = match token {
                Some(_) if state.shared.owners.is_alone() => {
                    "this token is not valid: it was revoked, it has ended, or it is of another gateway"
                }
                Some(_) => "this token is not valid: it was revoked, it has ended, or it is of another store",
                None => "send `Authorization: Bearer TOKEN`; `r6 gateway token` makes one",
            };
            Refusal::new(StatusCode::UNAUTHORIZED, Code::NoToken, message)
        })?;
        Ok(Self { who: Who::Token(token), source, is_passed: false })
    }

    /// The caller whose request another gateway passes on. What it may do is looked up here.
    async fn of_pass(passed: &Passed, state: &State) -> Result<Self, Refusal> {
        let source = passed.source;
        let who = match &passed.bearer {
            Bearer::Token(number) => state.tokens.find_number(*number).await.map(Who::Token),
            Bearer::User(name) => state.accounts.find(name).await.map(Who::Passed),
            Bearer::Gateway => Some(Who::Gateway(passed.from)),
        };
        let who = who.ok_or_else(|| {
            let message = "the token or the user is not valid any more";
            Refusal::new(StatusCode::UNAUTHORIZED, Code::NoToken, message)
        })?;
        Ok(Self { who, source, is_passed: true })
    }

    /// The caller with these cookies, which a page of another port of this host can add to: the session of
    /// which the request has the proof, or the first that is open. Browsers send cookies by themselves. So a
    /// request that is no `GET` has to prove that its page belongs to the session, and a WebSocket, which has
    /// no such header, has to name the page's origin; whether that is ours was checked before
    /// (`r6-http/src/access.rs`).
    fn of_session(
        texts: &[&str],
        parts: &Parts,
        state: &State,
        source: Option<SocketAddr>,
    ) -> Result<Self, Refusal> {
        let is_read = matches!(parts.method, Method::GET | Method::HEAD);
        let mut sent = parts.headers.get_all(CSRF_HEADER).iter();
        let sent = match (sent.next().and_then(|header| header.to_str().ok()), sent.next()) {
            (Some(sent), None) => sent,
            _ => "",
        };
        let is_open = |id| state.accounts.is_open(&id) || state.tokens.is_open(&id);
        let open: Vec<_> = texts.iter().filter(|text| is_open(secret::hash(text))).collect();
        let proved = open.iter().find(|text| secret::is_same(sent, &accounts::csrf(text).0));
        if proved.is_none() && !is_read && !open.is_empty() {
            let message = "send the header `X-CSRF-Token` with the `csrf` of `GET /v1/session`";
            return Err(Refusal::new(StatusCode::FORBIDDEN, Code::BadCsrf, message));
        }
        let text = proved.or_else(|| open.first()).map(|text| **text);
        let of_token = |text: &str| state.tokens.session(text).map(|(token, page)| Who::Page(token, page));
        let of_user = |text: &str| state.accounts.session(text).map(Who::User);
        let who = text.and_then(|text| of_user(text).or_else(|| of_token(text))).ok_or_else(|| {
            let message = "the session has ended: sign in again with `POST /v1/session`";
            Refusal::new(StatusCode::UNAUTHORIZED, Code::NoSession, message)
        })?;
        if is_read && parts.headers.contains_key(UPGRADE) && !parts.headers.contains_key(ORIGIN) {
            let message = "with a cookie, a WebSocket needs the header `Origin`";
            return Err(Refusal::new(StatusCode::FORBIDDEN, Code::ForeignOrigin, message));
        }
        Ok(Self { who, source, is_passed: false })
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

fn not_allowed(message: String) -> Refusal {
    Refusal::new(StatusCode::FORBIDDEN, Code::NotAllowed, message)
}

/// Refuses what the gateway may not do with a robot now, because it is about to lose it.
fn check_owner(parts: &Parts, station: &Station, is_stop: bool) -> Result<(), Refusal> {
    let ownership = &station.term.ownership;
    let is_read = matches!(parts.method, Method::GET | Method::HEAD);
    // A stop may leave for as long as the robot has not been let go of.
    let passes = (is_read || is_stop) && ownership.phase() < Phase::StopLists;
    if passes { Ok(()) } else { ownership.check().map_err(refusal::of) }
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
    /// Acknowledging an alarm.
    AcknowledgeAlarm
    /// Shelving the alarms of a code.
    ShelveAlarm
    /// Accepting another robot.
    AcceptIdentity
    /// Giving and revoking grants of cameras.
    GrantCamera
    /// Adding, changing and removing robots.
    Configure
    /// Changing users and tokens.
    ManageUsers
    /// Closing all raw ports.
    CloseRawPorts
    /// Changing the settings of the hall.
    ManageSettings
    /// Storing and removing programs and points.
    StorePrograms
}

/// A caller who has the right `R`, which is for no single robot, for all robots.
#[derive(Debug)]
pub struct Manager<R> {
    /// Who calls.
    pub caller: Caller,
    /// What the path names, as the caller wrote it; empty if it names nothing.
    pub named: String,
    right: PhantomData<R>,
}

impl<R: Needs> FromRequestParts<State> for Manager<R> {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, state: &State) -> Result<Self, Refusal> {
        let caller = Caller::from_request_parts(parts, state).await?;
        caller.must_manage(R::RIGHT, state, parts.uri.path())?;
        let named = Path::<BTreeMap<String, String>>::from_request_parts(parts, state).await;
        let named = named.ok().and_then(|Path(named)| named.into_values().next()).unwrap_or_default();
        Ok(Self { caller, named, right: PhantomData })
    }
}

/// A caller with a session.
#[derive(Debug)]
pub struct User {
    /// Who calls.
    pub caller: Caller,
    /// The session.
    pub signed_in: SignedIn,
}

impl FromRequestParts<State> for User {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, state: &State) -> Result<Self, Refusal> {
        let caller = Caller::from_request_parts(parts, state).await?;
        let signed_in = caller.session().cloned().ok_or_else(|| {
            let message = "this is for users who signed in, and the request has a token";
            Refusal::new(StatusCode::FORBIDDEN, Code::NotAllowed, message)
        })?;
        Ok(Self { caller, signed_in })
    }
}

/// The address that a request came from, for a route that needs no caller.
#[derive(Clone, Copy, Debug)]
pub struct Source(pub SocketAddr);

impl FromRequestParts<State> for Source {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, _state: &State) -> Result<Self, Refusal> {
        // Our server always names the peer.
        let unknown = SocketAddr::from(([0, 0, 0, 0], 0));
        Ok(Self(parts.extensions.get::<Peer>().map_or(unknown, |peer| peer.0)))
    }
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
        let name = match names {
            Ok(Path(mut names)) => names.remove("name").unwrap_or_default(),
            // One of the names in the path is no text. If it is that of the robot, there is no such robot.
            Err(_) => as_written(parts.uri.path()).to_owned(),
        };
        if let Err(refusal) = caller.must(R::RIGHT, &name) {
            if R::RIGHT == Right::Stop {
                // What is refused is no stop.
                caller.count(state)?;
            }
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

/// The name of the robot in the path of a route about it, as it stands there. Real names need no `%`.
fn as_written(path: &str) -> &str {
    path.strip_prefix("/v1/robots/").and_then(|rest| rest.split('/').next()).unwrap_or_default()
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
            if let Some(problem) = state.shared.owners.absent(&name) {
                return refusal::of(problem);
            }
            let name: String = name.chars().take(40).collect();
            let stations = state.fleet.stations();
            // What the caller may not see is not told.
            let known =
                stations.iter().map(|known| known.name()).filter(|known| caller.grant().covers(known));
            let nearest =
                r6_proto::nearest(&name, known).map_or(String::new(), |near| format!("; nearest: `{near}`"));
            Refusal::not_found(Code::NoSuchRobot, format!("there is no robot `{name}`{nearest}"))
        })?;
        check_owner(parts, &station, R::RIGHT == Right::Stop)?;
        Ok(Self { caller, station, right })
    }
}
