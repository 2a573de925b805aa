//! Requests that were refused before a route looked at them: they are counted, and not written down one by
//! one, so that strangers cannot fill the disk.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::extract::{Request, State as Of};
use axum::http::StatusCode;
use axum::middleware::Next;
use axum::response::Response;
use r6_http::Peer;
use r6_proto::time::Instant;

use crate::clock;

/// What is counted: no or a wrong token, no role, a body that is too long, and too many requests.
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
    /// When the log had a line, and how many were counted since.
    logged: Mutex<(Option<Instant>, u64)>,
}

impl Refused {
    /// How many requests got which status.
    pub fn counts(&self) -> impl Iterator<Item = (u16, u64)> {
        let now = self.counts.iter().map(|count| count.load(Ordering::Relaxed));
        COUNTED.map(|status| status.as_u16()).into_iter().zip(now)
    }

    /// Counts an answer, if it refuses. Returns how many there were since the last line of the log, if it is
    /// time for another.
    fn count(&self, status: StatusCode, now: Instant) -> Option<u64> {
        let place = COUNTED.iter().position(|counted| *counted == status)?;
        self.counts[place].fetch_add(1, Ordering::Relaxed);
        let mut logged = self.logged.lock().unwrap_or_else(PoisonError::into_inner);
        let (at, since) = *logged;
        let is_due = at.is_none_or(|at| now.since(at) >= LOG_EVERY);
        *logged = if is_due { (Some(now), 0) } else { (at, since + 1) };
        is_due.then_some(since + 1)
    }
}

/// Counts the answers that refuse: a layer around all others.
pub async fn count(Of(refused): Of<Arc<Refused>>, request: Request, next: Next) -> Response {
    let peer = request.extensions().get::<Peer>().map(|Peer(peer)| peer.ip());
    let answer = next.run(request).await;
    let status = answer.status();
    if let Some(requests) = refused.count(status, clock::now()) {
        let (last, from) = (status.as_u16(), peer.map(tracing::field::display));
        tracing::info!(
            requests,
            last,
            from,
            "requests were refused since the last line; /metrics has the counts"
        );
    }
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_counted_and_the_log_has_a_line_a_minute() {
        let (refused, begun) = (Refused::default(), Instant::ORIGIN);
        let mut lines = Vec::new();
        for second in 0..150_u64 {
            let status = if second % 2 == 0 { StatusCode::UNAUTHORIZED } else { StatusCode::FORBIDDEN };
            lines.extend(refused.count(status, begun + Duration::from_secs(second)));
        }
        assert_eq!(lines, [1, 60, 60]);
        assert_eq!(refused.count(StatusCode::OK, begun), None);
        assert_eq!(refused.counts().collect::<Vec<_>>(), [(401, 75), (403, 75), (413, 0), (429, 0)]);
    }
}
