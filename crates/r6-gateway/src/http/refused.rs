//! Requests that were refused: they are counted, and those of strangers are not written down one by one, so
//! that they cannot fill the disk.

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Untold {
    requests: u64,
    /// The status of the last one.
    last: StatusCode,
    /// Where it came from.
    from: Option<IpAddr>,
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
    fn count(&self, last: StatusCode, from: Option<IpAddr>) {
        let mut counts = COUNTED.iter().zip(&self.counts);
        let Some((_, count)) = counts.find(|(counted, _)| **counted == last) else { return };
        count.fetch_add(1, Ordering::Relaxed);
        let mut untold = self.untold.lock().unwrap_or_else(PoisonError::into_inner);
        let before = untold.map_or(0, |untold| untold.requests);
        *untold = Some(Untold { requests: before + 1, last, from });
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
            if let Some(Untold { requests, last, from }) = self.take_untold() {
                let (last, from) = (last.as_u16(), from.map(tracing::field::display));
                tracing::info!(
                    requests,
                    last,
                    from,
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
        let untold = Untold { requests: 150, last: StatusCode::FORBIDDEN, from };
        assert_eq!((refused.take_untold(), refused.take_untold()), (Some(untold), None));
        refused.count(StatusCode::TOO_MANY_REQUESTS, None);
        assert_eq!(refused.take_untold().map(|untold| untold.requests), Some(1));
        assert_eq!(refused.counts().collect::<Vec<_>>(), [(401, 50), (403, 100), (413, 0), (429, 1)]);
    }
}
