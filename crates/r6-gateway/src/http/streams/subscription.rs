//! What a reader of a stream asks for: read, and checked against what it may see.

use std::collections::BTreeSet;

use axum::http::StatusCode;
use r6_api::Code;
use r6_api::gateway::{LiveResume, LiveSubscribe, LiveSubscribed};
use r6_client::Address;
use r6_http::Refusal;
use serde::Deserialize;
use utoipa::IntoParams;

use super::super::State;
use super::super::caller::Caller;
use super::super::refusal;
use crate::core::live::follower::Begin;
use crate::core::live::point::Point;
use crate::core::role::Right;
use crate::fleet::roster::MAX_ROBOTS;

/// The most values that one reader names: a robot has at most some hundred.
const MAX_SIGNALS: usize = 1_000;

/// Which robot.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Which {
    /// Only this robot; all that the token may see if it is missing.
    pub robot: Option<String>,
}

/// What to follow, and from where.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Followed {
    /// Only these robots: names with commas between them. All that the token may see if it is missing.
    robot: Option<String>,
    /// Only these values: query addresses with commas between them, such as `axis-0,isMoving`. All if it is
    /// missing.
    signal: Option<String>,
    /// `true`: events too.
    #[serde(default)]
    events: bool,
    /// Go on at this place: the `resume` of a message, or the id of a server-sent event.
    resume: Option<String>,
    /// `later`: send nothing until the first `subscribe`. Only for WebSockets.
    #[param(inline)]
    subscribe: Option<Later>,
    /// `true`: a message `alive` every 2 s. A script of a browser does not see the pings of a WebSocket, and
    /// values that do not change are not sent again. Only for WebSockets.
    #[serde(default)]
    alive: bool,
}

/// How a WebSocket goes on, whatever it follows.
#[derive(Clone, Copy, Debug)]
pub struct Manner {
    /// Whether nothing is sent until the first `subscribe`.
    pub begins_later: bool,
    /// Whether signs of life are sent.
    pub tells_alive: bool,
}

/// When a WebSocket begins to send.
#[derive(Clone, Copy, Debug, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum Later {
    /// After the first `subscribe`.
    Later,
}

impl Followed {
    /// How the WebSocket goes on.
    pub fn manner(&self) -> Manner {
        Manner { begins_later: matches!(self.subscribe, Some(Later::Later)), tells_alive: self.alive }
    }
}

/// What a reader follows, and what it has.
#[derive(Clone, Debug)]
pub struct Subscription {
    /// The robots; `None` for all that the caller may see.
    pub robots: Option<BTreeSet<String>>,
    /// The values; `None` for all.
    pub signals: Option<BTreeSet<String>>,
    /// Where to begin with the values.
    pub begin: Begin,
    /// Where to begin with the events; `None` without events.
    pub events: Option<BeginEvents>,
}

/// Where to begin with the events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeginEvents {
    /// With those that happen from now on.
    Now,
    /// After this one; `None` for one of another start of the gateway.
    After(Option<u64>),
}

impl Subscription {
    /// What the query asks for. The browser sends the last id by itself, so it counts more than `resume`.
    ///
    /// # Errors
    /// `not_allowed`, `no_such_robot`, `bad_value`.
    pub fn of_query(
        caller: &Caller,
        state: &State,
        followed: Followed,
        last_id: Option<&str>,
    ) -> Result<Self, Refusal> {
        let Followed { robot, signal, events, resume, subscribe: _, alive: _ } = followed;
        let words = |words: String| words.split(',').map(str::to_owned).collect::<Vec<_>>();
        let point = match (last_id, &resume) {
            // An id that this gateway did not give out is the id of something else that was lost.
            (Some(id), _) => Some(Point::parse(id)),
            (None, Some(text)) => {
                let point = Point::parse(text)
                    .ok_or_else(|| bad_value(format!("resume: it has to be {}", Point::WANTED)))?;
                Some(Some(point))
            }
            (None, None) => None,
        };
        let (begin, event) = match point {
            None => (Begin::New, BeginEvents::Now),
            Some(Some(point)) if point.epoch == state.shared.epoch => {
                let event = point.event.map_or(BeginEvents::Now, |id| BeginEvents::After(Some(id)));
                (Begin::After(point.number), event)
            }
            Some(_) => (Begin::Lost, BeginEvents::After(None)),
        };
        let events = events.then_some(event);
        Self::checked(caller, state, robot.map(words), signal.map(words), begin, events)
    }

    /// What a message asks for.
    ///
    /// # Errors
    /// `not_allowed`, `no_such_robot`, `bad_value`.
    pub fn of_message(caller: &Caller, state: &State, asked: LiveSubscribe) -> Result<Self, Refusal> {
        let LiveSubscribe { robots, signals, events, resume } = asked;
        let (begin, event) = match resume {
            None => (Begin::New, BeginEvents::Now),
            Some(LiveResume { epoch, robots, event }) if epoch == state.shared.epoch => {
                if robots.len() > MAX_ROBOTS {
                    return Err(bad_value(format!("resume: it has more than {MAX_ROBOTS} robots")));
                }
                let event = event.map_or(BeginEvents::Now, |id| BeginEvents::After(Some(id)));
                (Begin::Each(robots), event)
            }
            Some(_) => (Begin::Lost, BeginEvents::After(None)),
        };
        Self::checked(caller, state, robots, signals, begin, events.then_some(event))
    }

    fn checked(
        caller: &Caller,
        state: &State,
        robots: Option<Vec<String>>,
        signals: Option<Vec<String>>,
        begin: Begin,
        events: Option<BeginEvents>,
    ) -> Result<Self, Refusal> {
        if robots.as_ref().is_some_and(|robots| robots.len() > MAX_ROBOTS) {
            return Err(bad_value(format!("robot: more than {MAX_ROBOTS}")));
        }
        if signals.as_ref().is_some_and(|signals| signals.len() > MAX_SIGNALS) {
            return Err(bad_value(format!("signal: more than {MAX_SIGNALS}")));
        }
        // Where a reader goes on, a robot may be gone meanwhile: the stream tells it.
        let is_new = matches!(begin, Begin::New);
        let one = |robot: String| {
            if is_new { only(caller, state, robot) } else { caller.must(Right::Read, &robot).map(|()| robot) }
        };
        let robots = robots.map(|robots| robots.into_iter().map(one).collect::<Result<_, _>>());
        let mut subscription = Self { robots: robots.transpose()?, signals: None, begin, events };
        let Some(signals) = signals else { return Ok(subscription) };
        let read = |word: &String| Address::parse(word);
        let wanted = signals.iter().map(read).collect::<Result<BTreeSet<_>, _>>();
        let wanted = wanted.map_err(|error| bad_value(format!("signal: {error}")))?;
        if is_new {
            subscription.must_be_read(caller, state, wanted.clone())?;
        }
        // As the values are named.
        subscription.signals = Some(wanted.iter().map(ToString::to_string).collect());
        Ok(subscription)
    }

    /// Refuses a value that no robot of the reader has among those that are read.
    fn must_be_read(
        &self,
        caller: &Caller,
        state: &State,
        mut wanted: BTreeSet<Address>,
    ) -> Result<(), Refusal> {
        let here = state.fleet.stations().into_iter().map(|station| station.config());
        for config in here.chain(state.shared.owners.robots()) {
            if wanted.is_empty() {
                break;
            }
            if self.covers(caller, config.name.as_str()) {
                for address in config.all_addresses() {
                    wanted.remove(&address);
                }
            }
        }
        let Some(address) = wanted.first() else { return Ok(()) };
        let advice = "name it in `read` of the robot";
        Err(bad_value(format!("signal: `{address}` is not read from any robot: {advice}")))
    }

    /// Whether the reader follows this robot, and may.
    pub fn covers(&self, caller: &Caller, robot: &str) -> bool {
        caller.grant().covers(robot) && self.robots.as_ref().is_none_or(|robots| robots.contains(robot))
    }

    /// What is followed, for the reader.
    pub fn told(&self) -> LiveSubscribed {
        let list = |set: &Option<BTreeSet<String>>| set.as_ref().map(|set| set.iter().cloned().collect());
        LiveSubscribed {
            robots: list(&self.robots),
            signals: list(&self.signals),
            events: self.events.is_some(),
        }
    }
}

/// The robot that the caller wants to see, if it may.
pub fn only(caller: &Caller, state: &State, robot: String) -> Result<String, Refusal> {
    caller.must(Right::Read, &robot)?;
    let is_there = state.fleet.station(&robot).is_some() || state.shared.far.one(&robot).is_some();
    if is_there {
        return Ok(robot);
    }
    Err(match state.shared.owners.absent(&robot) {
        Some(problem) => refusal::of(problem),
        None => Refusal::not_found(Code::NoSuchRobot, "there is no robot with this name"),
    })
}

/// A refusal of what is asked for.
pub fn bad_value(message: String) -> Refusal {
    Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, Code::BadValue, message)
}
