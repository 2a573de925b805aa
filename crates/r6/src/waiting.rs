//! Says on stderr what r6 waits for, if that takes longer than a user expects.

use std::future::Future;
use std::io::IsTerminal;
use std::pin::pin;
use std::time::Duration;

use tokio::time::{Instant, interval_at, timeout};

use crate::output;

/// Work that is faster than this is not announced: controllers answer within 26 ms.
const SAID_AFTER: Duration = Duration::from_secs(1);

/// How often the seconds on a terminal are refreshed.
const REFRESH_EVERY: Duration = Duration::from_secs(1);

/// Runs `work`. After a second, stderr says what it waits for: a terminal shows the seconds, everything else
/// gets one line.
pub async fn told<T>(what: &str, work: impl Future<Output = T>) -> T {
    told_after(SAID_AFTER, what, work).await
}

/// The same after another time than a second.
pub async fn told_after<T>(after: Duration, what: &str, work: impl Future<Output = T>) -> T {
    let begun = Instant::now();
    let mut work = pin!(work);
    if let Ok(done) = timeout(after, &mut work).await {
        return done;
    }
    if !std::io::stderr().is_terminal() {
        output::note(format_args!("r6: {what} …"));
        return work.await;
    }
    let mut ticks = interval_at(begun + after, REFRESH_EVERY);
    loop {
        tokio::select! {
            biased;
            done = &mut work => {
                output::clear_line();
                return done;
            }
            _ = ticks.tick() => output::rewrite_line(format_args!("r6: {what} … {} s", begun.elapsed().as_secs())),
        }
    }
}
