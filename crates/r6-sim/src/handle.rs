//! One running virtual controller, as the rest of the program sees it.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_controller::{ConnectionId, Controller, ControllerSnapshot, Level, LogLine, PanelAction, Refused};
use r6_proto::time::Instant;
use tokio::sync::{Notify, broadcast};
use tracing::{info, warn};

/// How many log lines a slow reader may fall behind before it loses the oldest.
const LOG_BACKLOG: usize = 256;

/// A running virtual controller. Clones are the same controller.
#[derive(Clone, Debug)]
pub struct ControllerHandle {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    address: SocketAddr,
    started: tokio::time::Instant,
    state: Mutex<State>,
    /// The next deadline may have changed.
    timers: Notify,
    log: broadcast::Sender<LogLine>,
}

#[derive(Debug)]
struct State {
    controller: Controller,
    connections: BTreeMap<ConnectionId, Arc<Notify>>,
}

impl ControllerHandle {
    pub(crate) fn new(address: SocketAddr, started: tokio::time::Instant, controller: Controller) -> Self {
        let state = Mutex::new(State { controller, connections: BTreeMap::new() });
        let log = broadcast::Sender::new(LOG_BACKLOG);
        Self { shared: Arc::new(Shared { address, started, state, timers: Notify::new(), log }) }
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.shared.address
    }

    /// What a person would see at the machine, now.
    #[must_use]
    pub fn snapshot(&self) -> ControllerSnapshot {
        self.with(Controller::snapshot)
    }

    /// What happens from now on. A reader that falls behind loses the oldest lines and is told how many.
    #[must_use]
    pub fn log(&self) -> broadcast::Receiver<LogLine> {
        self.shared.log.subscribe()
    }

    /// Asks the camera for a photo, as a program does: the connection that last spoke as the camera, else all.
    pub fn request_photo(&self, cam_id: i64) {
        self.with(|controller, now| controller.request_photo(now, cam_id));
    }

    /// Does what a person does at the machine, or a machine in the cell where inputs are concerned.
    ///
    /// # Errors
    /// Why the machine did not do it, and what to do; nothing has changed.
    pub fn operate(&self, action: &PanelAction) -> Result<(), Refused> {
        self.with(|controller, now| controller.operate(now, action))
    }

    /// The present time, as this controller counts it.
    pub(crate) fn now(&self) -> Instant {
        let elapsed = self.shared.started.elapsed();
        Instant::from_nanos(u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX))
    }

    /// How long it is until a point in time.
    pub(crate) fn until(&self, due: Instant) -> Duration {
        due.since(self.now())
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic while the lock was held would leave a machine between two events, never broken data.
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with the controller, then passes on what follows from it: log lines, wake-ups, timers.
    pub(crate) fn with<T>(&self, act: impl FnOnce(&mut Controller, Instant) -> T) -> T {
        let mut state = self.state();
        let before = state.controller.poll_timeout();
        let result = act(&mut state.controller, self.now());
        let mut lines = Vec::new();
        while let Some(line) = state.controller.poll_log() {
            // Within the lock, so that the order stays; it does not wait. Nobody may be listening.
            let _ = self.shared.log.send(line.clone());
            lines.push(line);
        }
        while let Some(id) = state.controller.poll_woken() {
            if let Some(connection) = state.connections.get(&id) {
                connection.notify_one();
            }
        }
        if state.controller.poll_timeout() != before {
            self.shared.timers.notify_one();
        }
        drop(state);
        self.trace(&lines);
        result
    }

    /// Tells the program's own log. Without the lock: whoever writes that log may wait for its reader.
    fn trace(&self, lines: &[LogLine]) {
        let address = self.shared.address;
        for line in lines {
            match line.level {
                Level::Info => info!(controller = %address, "{line}"),
                Level::Warning => warn!(controller = %address, "{line}"),
            }
        }
    }

    /// Takes a new connection; the notice wakes its task when it has something to write.
    pub(crate) fn connect(&self) -> (ConnectionId, Arc<Notify>) {
        let id = self.with(|controller, now| controller.connect(now));
        let notice = Arc::new(Notify::new());
        self.state().connections.insert(id, Arc::clone(&notice));
        (id, notice)
    }

    pub(crate) fn disconnect(&self, id: ConnectionId) {
        self.with(|controller, _| controller.disconnect(id));
        self.state().connections.remove(&id);
    }

    /// Lets the controller's own deadlines happen, for as long as it runs.
    pub(crate) async fn run_timers(self) {
        loop {
            let due = self.state().controller.poll_timeout();
            match due {
                None => self.shared.timers.notified().await,
                Some(due) => {
                    tokio::select! {
                        () = tokio::time::sleep(self.until(due)) => {
                            self.with(|controller, now| controller.handle_timeout(now));
                        }
                        () = self.shared.timers.notified() => {}
                    }
                }
            }
        }
    }
}
