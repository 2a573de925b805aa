//! One running virtual controller, for the rest of the program.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_controller::event::{Detail, ShellEvent};
use r6_controller::fault::{Fault, LinkFaultNow};
use r6_controller::{
    ConnectionId, Controller, ControllerSnapshot, FaultInForce, Level, LogEntry, PanelAction, Refused,
    SavedState,
};
use r6_proto::time::Instant;
use r6_traffic::link::{Door, Link};
use tokio::sync::{Notify, broadcast, mpsc, watch};
use tracing::{info, warn};

use crate::camera::Camera;
use crate::clock::Pace;
use crate::connection;
use crate::door::knock;
use crate::keeper::{Changes, FINISH_TIME, Keeper};
use crate::memory::MemoryStream;
use crate::state::StateError;
use crate::wire::Wire;

/// How many log lines a slow reader may be behind before it loses the oldest.
const LOG_BACKLOG: usize = 256;

/// A running virtual controller. Clones refer to the same controller.
#[derive(Clone, Debug)]
pub struct ControllerHandle {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    address: SocketAddr,
    state: Mutex<State>,
    /// Writes the state to the disk, if it is saved.
    keeper: Option<Keeper>,
    /// Notified when the next deadline may have changed.
    timers: Notify,
    /// Entries are shared: the channel has a slot for each line of the backlog from the start.
    log: broadcast::Sender<Arc<LogEntry>>,
    /// A receiver of the log from the start, until the first reader takes it.
    log_from_start: Mutex<Option<broadcast::Receiver<Arc<LogEntry>>>>,
    /// How attempts to connect are treated.
    door: watch::Sender<Door>,
    /// Takes connections in memory, if the controller is reached that way.
    entrance: Option<mpsc::Sender<MemoryStream>>,
    /// The seed for the random values of the links.
    seed: u64,
}

#[derive(Debug)]
struct State {
    controller: Controller,
    pace: Pace,
    changes: Changes,
    connections: BTreeMap<ConnectionId, Connected>,
    /// The number of link changes that the door has.
    link_changes: u64,
    observers: Vec<Observer>,
}

/// What to write to a connection next.
pub(crate) enum Next {
    /// A frame.
    Frame,
    /// Nothing now.
    Nothing {
        /// Whether the connection has to be reset.
        over: bool,
        /// How long it takes, in real time, until the next delayed frame is sent.
        due: Option<Duration>,
    },
    /// The link faults have changed: apply them first.
    LinkChanged,
}

/// A callback that sees everything.
struct Observer(Box<Observe>);

type Observe = dyn FnMut(Instant, &Controller, &[LogEntry]) + Send;

impl fmt::Debug for Observer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Observer")
    }
}

#[derive(Debug)]
struct Connected {
    notice: Arc<Notify>,
    /// The number of the last change from a request of this connection.
    changed: u64,
}

impl ControllerHandle {
    pub(crate) fn new(
        address: SocketAddr,
        controller: Controller,
        pace: Pace,
        keeper: Option<Keeper>,
        entrance: Option<mpsc::Sender<MemoryStream>>,
        seed: u64,
    ) -> Self {
        // Switching on is the first change.
        let changes = Changes { number: 1, mark: controller.machine().saved_mark() };
        let connections = BTreeMap::new();
        let door = watch::Sender::new(Door::of(controller.link_faults()));
        let link_changes = controller.link_changes();
        let observers = Vec::new();
        let state = State { controller, pace, changes, connections, link_changes, observers };
        let state = Mutex::new(state);
        let (log, first) = broadcast::channel(LOG_BACKLOG);
        let log_from_start = Mutex::new(Some(first));
        let timers = Notify::new();
        let shared = Shared { address, state, keeper, timers, log, log_from_start, door, entrance, seed };
        let handle = Self { shared: Arc::new(shared) };
        // Publish the events of switching on now, not at the first call.
        handle.look(|_, _| ());
        handle
    }

    /// The address that it listens on; only a name if it is reached in memory.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.shared.address
    }

    /// The address at which programs of this machine reach it: [`Self::address`], and 127.0.0.1 or ::1 if it
    /// listens on all addresses.
    #[must_use]
    pub fn local_address(&self) -> SocketAddr {
        crate::door::reachable(self.shared.address)
    }

    /// Connects to it without a network ([`crate::Simulation::start_in_memory`]). Door and link faults work
    /// as over TCP. While attempts to connect get no answer, this retries after 1 s, 2 s, 4 s, as a real
    /// system does.
    ///
    /// # Errors
    /// `ConnectionRefused` if it is refused, or the simulation has ended; `Unsupported` if it listens on TCP.
    pub async fn dial(&self) -> io::Result<MemoryStream> {
        let entrance = self.shared.entrance.as_ref().ok_or(io::ErrorKind::Unsupported)?;
        knock(&self.door(), entrance).await
    }

    /// Serves a connection that was accepted elsewhere, until it ends. It may come over a simulated network,
    /// or over another that this crate does not know. The caller decides whether to accept.
    pub async fn serve<W: Wire>(&self, wire: W) {
        connection::serve(self.clone(), wire).await;
    }

    /// The same for a connection that was opened to a camera.
    pub async fn serve_camera<W: Wire>(&self, wire: W, camera: Camera) {
        connection::serve_camera(self, wire, camera).await;
    }

    /// Calls this function after everything that happens to the controller, from now on, with the time and
    /// the new log lines. Tests use it to check promises at every step, or to count what the controller
    /// carries out. The function must not wait, and must not call the handle, because the controller is
    /// locked meanwhile.
    pub fn observe(&self, observer: impl FnMut(Instant, &Controller, &[LogEntry]) + Send + 'static) {
        self.state().observers.push(Observer(Box::new(observer)));
    }

    /// The state of the machine that an operator can see, now.
    #[must_use]
    pub fn snapshot(&self) -> ControllerSnapshot {
        self.look(Controller::snapshot)
    }

    /// The log from now on. A reader that falls behind loses the oldest lines and gets their number.
    #[must_use]
    pub fn log(&self) -> broadcast::Receiver<Arc<LogEntry>> {
        self.shared.log.subscribe()
    }

    /// Sets the link faults of this controller: see [`Controller::set_link_faults`]. They are in force when
    /// this returns. A log line says when attempts to connect are treated differently.
    pub fn set_link_faults(&self, faults: Vec<LinkFaultNow>) {
        self.with(|controller, _| controller.set_link_faults(faults));
    }

    /// How attempts to connect are treated, now and after each change.
    pub(crate) fn door(&self) -> watch::Receiver<Door> {
        self.shared.door.subscribe()
    }

    /// The link of a connection that is opened now.
    pub(crate) fn new_link(&self, id: ConnectionId, now: Instant, faults: &[LinkFaultNow]) -> Link {
        Link::new(self.shared.seed.rotate_left(32).wrapping_add(id.number()), now, faults)
    }

    /// The time that counts for something due at `due`. With a clock that only the input drives, this is not
    /// waited for.
    pub(crate) fn reach(&self, due: Option<Instant>) -> Instant {
        self.state().pace.reach(due)
    }

    /// How long it takes, in real time, until `due`.
    pub(crate) fn until(&self, due: Instant) -> Duration {
        self.state().pace.until(due)
    }

    /// The log from the start for the first caller; from now on for all others.
    #[must_use]
    pub fn log_from_start(&self) -> broadcast::Receiver<Arc<LogEntry>> {
        let first = self.shared.log_from_start.lock().unwrap_or_else(PoisonError::into_inner).take();
        first.unwrap_or_else(|| self.log())
    }

    /// Asks a camera for a photo, as a program does: see [`Controller::request_photo`].
    pub fn request_photo(&self, cam_id: i64) {
        self.with(|controller, now| controller.request_photo(now, cam_id));
    }

    /// Does what an operator does at the machine. A machine in the cell can also set inputs.
    ///
    /// # Errors
    /// Why the machine refused, and what to do about it. Nothing has changed then.
    pub fn operate(&self, action: &PanelAction) -> Result<(), Refused> {
        self.with(|controller, now| controller.operate(now, action))
    }

    /// Gives the controller a fault: see [`Controller::begin_fault`]. Returns its number.
    ///
    /// # Errors
    /// Too many faults are in force.
    pub fn begin_fault(&self, fault: Fault, chance: f64, lasts: Option<Duration>) -> Result<usize, Refused> {
        self.with(|controller, now| controller.begin_fault(now, fault, chance, lasts))
    }

    /// Ends a fault that is in force: see [`Controller::end_fault`].
    pub fn end_fault(&self, number: usize) {
        self.with(|controller, now| controller.end_fault(now, number));
    }

    /// The faults in force, now.
    #[must_use]
    pub fn faults(&self) -> Vec<FaultInForce> {
        self.look(Controller::faults)
    }

    /// The mains fail now, for this long.
    pub fn cut_power(&self, off: Duration) {
        self.with(|controller, now| controller.cut_power(now, off));
    }

    /// The same as [`Self::operate`], but waits until the change survives a power cut.
    pub(crate) async fn operate_and_keep(&self, action: &PanelAction) -> Result<(), Refused> {
        self.operate(action)?;
        if let Some(keeper) = &self.shared.keeper {
            let number = self.state().changes.number;
            keeper.durable(number).await;
        }
        Ok(())
    }

    /// How long it takes, in real time, until the next delayed frame of a connection is sent.
    pub(crate) fn next_transmit(&self, id: ConnectionId) -> Option<Duration> {
        let state = self.state();
        state.controller.next_transmit(id).map(|due| state.pace.until(due))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // After a panic with the lock held the machine would be between two events, but its data would not be
        // broken.
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does to the controller what an operator or a machine in the cell does; time then passes.
    pub(crate) fn with<T>(&self, act: impl FnOnce(&mut Controller, Instant) -> T) -> T {
        self.handle(|state| state.pace.act(&mut state.controller, act))
    }

    /// Accesses the controller, now. A clock that only the input drives does not advance.
    pub(crate) fn look<T>(&self, look: impl FnOnce(&mut Controller, Instant) -> T) -> T {
        self.handle(|state| look(&mut state.controller, state.pace.now()))
    }

    /// Takes bytes from a connection.
    pub(crate) fn handle_input(&self, id: ConnectionId, bytes: &[u8]) {
        let kept = self.shared.keeper.is_some();
        self.handle(|state| {
            state.pace.handle_input(&mut state.controller, id, bytes);
            if kept
                && state.note_change()
                && let Some(connection) = state.connections.get_mut(&id)
            {
                connection.changed = state.changes.number;
            }
        });
    }

    /// Waits until the changes from requests of this connection survive a power cut.
    pub(crate) async fn kept(&self, id: ConnectionId) {
        if let Some(keeper) = &self.shared.keeper {
            let changed = self.state().connections.get(&id).map_or(0, |connection| connection.changed);
            keeper.durable(changed).await;
        }
    }

    /// The state that a power cut would leave now, and the number of its last change.
    pub(crate) fn saved(&self) -> (u64, SavedState) {
        let state = self.state();
        (state.changes.number, state.controller.machine().saved())
    }

    /// Saves the state on the disk while this runs.
    pub(crate) async fn run_keeper(self) {
        if let Some(keeper) = &self.shared.keeper {
            keeper.run(&self).await;
        }
    }

    /// Writes the changes that no connection waited for, when the simulation ends in good order. The log says
    /// what was not saved.
    pub(crate) async fn finish(self) -> Result<(), StateError> {
        if self.shared.keeper.is_none() {
            return Ok(());
        }
        let controller = self.clone();
        let write = tokio::task::spawn_blocking(move || match &controller.shared.keeper {
            Some(keeper) => keeper.finish(&controller),
            None => Ok(()),
        });
        let kept = match tokio::time::timeout(FINISH_TIME, write).await {
            Ok(Ok(kept)) => kept,
            // It fails only if the runtime ends; then no caller waits for it.
            Ok(Err(gone)) => Err(self.not_finished(io::Error::other(gone))),
            Err(_) => Err(self.not_finished(io::ErrorKind::TimedOut.into())),
        };
        if let Err(error) = &kept {
            self.tell(None, ShellEvent::LastStateLost { why: Detail::of(error) });
        }
        kept
    }

    fn not_finished(&self, error: io::Error) -> StateError {
        let path = self.shared.keeper.as_ref().map(|keeper| keeper.path().to_owned()).unwrap_or_default();
        StateError::Io { path, tried: "written", error }
    }

    /// Writes the next due frame of a connection to `frame`, unless the link faults have changed since change
    /// number `link_changes`.
    ///
    /// Sending a frame changes nothing that others wait for, so only observers are called: they see
    /// everything.
    pub(crate) fn next_frame(&self, id: ConnectionId, link_changes: u64, frame: &mut Vec<u8>) -> Next {
        let mut state = self.state();
        let State { observers, controller, pace, .. } = &mut *state;
        if controller.link_changes() != link_changes {
            return Next::LinkChanged;
        }
        let now = pace.now();
        let Some(bytes) = controller.poll_transmit(now, id) else {
            let due = controller.next_transmit(id).map(|due| pace.until(due));
            return Next::Nothing { over: controller.is_over(id), due };
        };
        frame.extend_from_slice(bytes);
        observers.iter_mut().for_each(|Observer(observe)| observe(now, controller, &[]));
        Next::Frame
    }

    /// Does something with the controller, then passes on the consequences: log lines, wake-ups, timers,
    /// writes.
    fn handle<T>(&self, act: impl FnOnce(&mut State) -> T) -> T {
        let mut state = self.state();
        let before = state.pace.deadline(&state.controller);
        let number = state.changes.number;
        let result = act(&mut state);
        if let Some(keeper) = &self.shared.keeper {
            state.note_change();
            if state.changes.number != number {
                keeper.change();
            }
        }
        let mut lines = Vec::new();
        while let Some(line) = state.controller.poll_log() {
            // Within the lock, to keep the order; it does not wait. There may be no receiver.
            let _ = self.shared.log.send(Arc::new(line.clone()));
            lines.push(line);
        }
        while let Some(id) = state.controller.poll_woken() {
            if let Some(connection) = state.connections.get(&id) {
                connection.notice.notify_one();
            }
        }
        let link_changes = state.controller.link_changes();
        if state.link_changes != link_changes {
            state.link_changes = link_changes;
            let door = Door::of(state.controller.link_faults());
            self.shared.door.send_if_modified(|before| std::mem::replace(before, door) != door);
        }
        if state.pace.deadline(&state.controller) != before {
            self.shared.timers.notify_one();
        }
        let State { observers, controller, pace, .. } = &mut *state;
        observers.iter_mut().for_each(|Observer(observe)| observe(pace.now(), controller, &lines));
        drop(state);
        self.trace(&lines);
        result
    }

    /// Writes to the program's own log, without the lock, because that log may wait for its reader.
    fn trace(&self, lines: &[LogEntry]) {
        let address = self.shared.address;
        for line in lines {
            match line.level() {
                Level::Info => info!(controller = %address, "{line}"),
                Level::Warning => warn!(controller = %address, "{line}"),
            }
        }
    }

    /// Takes a new connection; the notice wakes its task when it has something to write.
    pub(crate) fn connect(&self) -> (ConnectionId, Arc<Notify>) {
        let id = self.look(|controller, now| controller.connect(now));
        self.enter(id)
    }

    /// Takes a connection that was opened to a camera, in the same way.
    pub(crate) fn connect_camera(&self, cam_id: Option<i64>) -> (ConnectionId, Arc<Notify>) {
        let id = self.look(|controller, now| controller.connect_camera(now, cam_id));
        self.enter(id)
    }

    /// Adds a line to the log.
    pub(crate) fn tell(&self, connection: Option<ConnectionId>, event: ShellEvent) {
        self.look(|controller, now| controller.log(now, connection, event));
    }

    fn enter(&self, id: ConnectionId) -> (ConnectionId, Arc<Notify>) {
        let notice = Arc::new(Notify::new());
        let connected = Connected { notice: Arc::clone(&notice), changed: 0 };
        self.state().connections.insert(id, connected);
        (id, notice)
    }

    pub(crate) fn disconnect(&self, id: ConnectionId) {
        self.look(|controller, _| controller.disconnect(id));
        self.state().connections.remove(&id);
    }

    /// Takes a connection that has ended without the controller noticing.
    pub(crate) fn lose(&self, id: ConnectionId) {
        self.look(|controller, _| controller.lose(id));
        self.state().connections.remove(&id);
    }

    /// Handles the controller's own deadlines while this runs.
    pub(crate) async fn run_timers(self) {
        loop {
            let pause = {
                let state = self.state();
                state.pace.pause(&state.controller)
            };
            match pause {
                None => self.shared.timers.notified().await,
                Some(pause) => {
                    tokio::select! {
                        biased;
                        () = tokio::time::sleep(pause) => {
                            self.handle(|state| state.pace.handle_timeout(&mut state.controller));
                        }
                        () = self.shared.timers.notified() => {}
                    }
                }
            }
        }
    }
}

impl State {
    /// Gives a change the next number. Returns whether anything has changed.
    fn note_change(&mut self) -> bool {
        let mark = self.controller.machine().saved_mark();
        let changed = mark != self.changes.mark;
        if changed {
            self.changes = Changes { number: self.changes.number + 1, mark };
        }
        changed
    }
}
