//! The beats of this gateway, in a task of their own.

use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinHandle;

use super::Inner;
use crate::certificate::Certificate;
use crate::clock;
use crate::core::owner::BEAT;
use crate::outage::Outage;
use crate::store::postgres::owner::OwnerRows;

/// After a beat that failed, the next one comes so soon.
const AFTER_FAILURE: Duration = Duration::from_millis(100);

/// The task. It ends when this is dropped.
#[derive(Debug)]
pub struct Beats(JoinHandle<()>);

impl Beats {
    pub fn start(inner: &Arc<Inner>) -> Self {
        Self(tokio::spawn(beat(Arc::clone(inner))))
    }
}

impl Drop for Beats {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// Says again and again that this gateway lives, and learns what it owns.
async fn beat(inner: Arc<Inner>) {
    let mut rows = OwnerRows::new(inner.sharing.database.clone());
    let mut outage = Outage::default();
    loop {
        let sent = clock::now();
        let certificate = inner.sharing.certificate.as_ref().map(Certificate::fingerprint_now);
        let beaten = rows.beat(inner.number, certificate.as_deref(), &inner.sharing.file()).await;
        outage.note("the database does not take that this gateway lives", &beaten);
        let wait = match beaten {
            Ok(owned) => {
                inner.owners.beaten(sent, owned.as_ref());
                if owned.is_none() {
                    tracing::error!("the store has no row of this gateway any more: it makes one");
                    if let Err(error) = rows.register(inner.number, &inner.door, &inner.sharing.file()).await
                    {
                        tracing::error!(%error, "the store takes no row of this gateway");
                    }
                }
                BEAT.saturating_sub(clock::now().since(sent))
            }
            Err(_) => AFTER_FAILURE,
        };
        tokio::time::sleep(wait).await;
    }
}
