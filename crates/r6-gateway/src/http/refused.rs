//! Requests that were refused: they are counted, and those of strangers are not written down one by one, so
//! that they cannot fill the disk.

use std::fmt;
use std::net::IpAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::extract::{Request, State as Of};
use axum::http::StatusCode;
use axum::middleware::Next;
use axum::response::Response;
use r6_http::Peer;

use crate::clock;

/// What is counted: [`Refused::counts`].
const COUNTED: [StatusCode; 4] = [
    StatusCode::UNAUTHORIZED,
    StatusCode::FORBIDDEN,
    StatusCode::PAYLOAD_TOO_LARGE,
    StatusCode::TOO_MANY_REQUESTS,
];

/// How often the log has a line of them.
const LOG_EVERY: Duration = Duration::from_secs(60);

/// The counts since the gateway started.
#[derive(Debug, Default)]
pub struct Refused {
    counts: [AtomicU64; COUNTED.len()],
    /// What the log has no line of yet.
    untold: Mutex<Option<Untold>>,
}

/// What the log has no line of yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Untold {
    /// How many requests got which status, in the order of [`COUNTED`].
    counts: [u64; COUNTED.len()],
    /// Where the last one came from.
    last: Option<IpAddr>,
}

/// `6 x 401, 1 x 403`.
impl fmt::Display for Untold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = COUNTED.iter().zip(self.counts).filter(|(_, count)| *count > 0);
        for (place, (status, count)) in counts.enumerate() {
            write!(f, "{}{count} x {}", if place == 0 { "" } else { ", " }, status.as_u16())?;
        }
        Ok(())
    }
}

impl Refused {
    /// How many requests got which status: 401 for no valid token, session or password, 403 for a role that
    /// is too low, a page from elsewhere or a wrong host, 413 for a body that is too long, and 429 for too
    /// many requests.
    pub fn counts(&self) -> impl Iterator<Item = (u16, u64)> {
        let now = self.counts.iter().map(|count| count.load(Ordering::Relaxed));
        COUNTED.map(|status| status.as_u16()).into_iter().zip(now)
    }

    /// Counts an answer, if it refuses.
    fn count(&self, status: StatusCode, from: Option<IpAddr>) {
        let mut untold = self.untold.lock().unwrap_or_else(PoisonError::into_inner);
        let Untold { mut counts, .. } = untold.unwrap_or_default();
        for ((counted, all), of_minute) in COUNTED.iter().zip(&self.counts).zip(&mut counts) {
            if *counted == status {
                all.fetch_add(1, Ordering::Relaxed);
                *of_minute += 1;
                *untold = Some(Untold { counts, last: from });
                return;
            }
        }
    }

    /// What the log has no line of yet, once.
    fn take_untold(&self) -> Option<Untold> {
        self.untold.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Writes a line a minute into the log, if requests were refused, for as long as this is polled.
    pub async fn keep_log(&self) {
        let mut lines = clock::every(LOG_EVERY);
        loop {
            lines.tick().await;
            if let Some(untold) = self.take_untold() {
                let last = untold.last.map(tracing::field::display);
                tracing::info!(
                    requests = %untold,
                    last,
                    "requests were refused in the last minute; /metrics counts them"
                );
            }
        }
    }
}

/// Counts the answers that refuse: a layer around all others.
pub async fn count(Of(refused): Of<Arc<Refused>>, request: Request, next: Next) -> Response {
    let peer = request.extensions().get::<Peer>().map(|Peer(peer)| peer.ip());
    let answer = next.run(request).await;
    refused.count(answer.status(), peer);
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_counted_and_the_next_line_of_the_log_has_all() {
        let (refused, from) = (Refused::default(), Some(IpAddr::from([10, 0, 0, 9])));
        for number in 0..150 {
            let status = if number % 3 == 0 { StatusCode::UNAUTHORIZED } else { StatusCode::FORBIDDEN };
            refused.count(status, from);
            refused.count(StatusCode::OK, from);
        }
        let untold = Untold { counts: [50, 100, 0, 0], last: from };
        assert_eq!((refused.take_untold(), refused.take_untold()), (Some(untold), None));
        assert_eq!(untold.to_string(), "50 x 401, 100 x 403");
        refused.count(StatusCode::TOO_MANY_REQUESTS, None);
        assert_eq!(refused.take_untold().unwrap().to_string(), "1 x 429");
        assert_eq!(refused.counts().collect::<Vec<_>>(), [(401, 50), (403, 100), (413, 0), (429, 1)]);
    }
}
