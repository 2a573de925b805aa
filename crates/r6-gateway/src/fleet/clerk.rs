//! Ends leases in time, and writes down what need not be written before something happens.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;

use super::station::Station;
use crate::outage::Outage;

/// The longest time between two looks. A lease can begin any time, so it is no longer than the shortest one.
/// It is also the time after which a store that failed is tried again.
const LOOK: Duration = Duration::from_secs(1);

/// How long the last records may take at the end.
const LAST_WRITE: Duration = Duration::from_secs(5);

/// Works until `end` is true. Then it writes what is left.
pub async fn work(station: Arc<Station>, mut end: watch::Receiver<bool>) {
    let (mut store_failed, mut outage) = (false, Outage::default());
    loop {
        let until = station.seat(|seat, now| seat.poll_timeout().map(|until| until.since(now)));
        // The clock that leases count on goes on while the machine sleeps, and tokio's does not.
        let wait = until.unwrap_or(LOOK).min(LOOK);
        // Records may come again and again: they must keep no lease from its end.
        tokio::select! {
            biased;
            () = tokio::time::sleep(wait) => {
                station.seat(|seat, now| seat.handle_timeout(now));
                // At most once a second, also for alarms that come and go at each reading.
                if station.tidy_alarms() || store_failed {
                    store_failed = !write(&station, &mut outage).await;
                }
            }
            () = ended(&mut end) => break,
            () = station.to_write.notified(), if !store_failed => {
                store_failed = !write(&station, &mut outage).await;
            }
        }
    }
    if tokio::time::timeout(LAST_WRITE, write(&station, &mut outage)).await != Ok(true) {
        let records = station.records_waiting();
        tracing::error!(robot = station.name(), records, "the audit log does not have the last records");
    }
}

/// Waits until `end` is true, or the gateway was dropped.
pub(super) async fn ended(end: &mut watch::Receiver<bool>) {
    let _ = end.wait_for(|end| *end).await;
}

/// Writes all that waits. `false` if the store failed.
async fn write(station: &Station, outage: &mut Outage) -> bool {
    // A stop first: on a disk that is almost full, its row fits in where no record does.
    let saved = station.save().await;
    let written = async {
        station.write_pending().await?;
        station.save_alarms().await
    };
    let written = written.await.and(saved);
    outage.note(&format!("what happens at {} cannot be written down", station.name()), &written);
    if written.is_ok() {
        station.wrote.notify_waiters();
    }
    written.is_ok()
}
