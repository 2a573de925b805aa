//! How long an order may be on its way.
//!
//! A network can deliver an order long after it was given, and a browser sends one again if its connection
//! breaks before the answer. Meanwhile the arm, the program or who stopped it may be another. A caller who
//! knows the clock of the gateway says until when the order holds. Stops always pass.

use axum::http::HeaderMap;
use jiff::Timestamp;
use r6_api::Code;
use r6_http::Refusal;
use utoipa::IntoParams;

use super::refusal::{self, bad_value};
use crate::clock;
use crate::problem::Problem;

/// The header that says until when an order holds.
const VALID_UNTIL: &str = "valid-until";

/// That header in the description of the API.
#[derive(IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "describes the header, which `check` reads")]
pub struct Deadline {
    /// A time on the clock of the gateway: an order that comes later is refused (`too_late`)
    #[param(rename = "Valid-Until")]
    valid_until: Option<String>,
}

/// Refuses an order that came too late. Without the header, none does.
///
/// # Errors
/// `too_late`; `bad_value`: the header is there and is no time.
pub fn check(headers: &HeaderMap) -> Result<(), Refusal> {
    let mut given = headers.get_all(VALID_UNTIL).iter();
    let until = match (given.next(), given.next()) {
        (None, _) => return Ok(()),
        (Some(until), None) => until.to_str().ok().and_then(|until| until.parse::<Timestamp>().ok()),
        (Some(_), Some(_)) => None,
    };
    let Some(until) = until else {
        return Err(bad_value(
            "Valid-Until has to be one time such as 2026-11-27T18:06:17Z, on the clock of the gateway",
        ));
    };
    let late = clock::system().0.saturating_sub(until.as_microsecond());
    if late <= 0 {
        return Ok(());
    }
    let message = format!(
        "this order was valid until {until} and came {} ms later; look at the robot, then give it again",
        late / 1_000
    );
    Err(refusal::of(Problem::new(Code::TooLate, message)))
}
