//! The virtual controller: several connections to one machine.
//!
//! The shell that owns the sockets gives it bytes and points in time, and sends its frames and keeps its
//! deadlines:
//!
//! ```text
//! connect → handle_input(now, id, bytes) → poll_transmit(now, id) … → poll_timeout → handle_timeout(now)
//! ```

mod advance;
mod cameras;
mod dispatch;
pub(crate) mod pace;
mod scenario;

use std::collections::{BTreeMap, VecDeque};
use std::fmt;

use r6_proto::alarm::AlarmCode;
use r6_proto::frame::Limits;
use r6_proto::reply::encode_photo;
use r6_proto::server::ServerSession;
use r6_proto::time::Instant;
use r6_proto::{Address, Reading};

use cameras::{Cameras, Route};
use dispatch::Dispatcher;
use scenario::Breakage;
pub use scenario::FaultInForce;

use crate::event::{AlarmCause, Detail, Event, ShellEvent};
use crate::fault::{Fault, LinkFault, LinkFaultNow};
use crate::io::OutputPoint;
use crate::log::{Log, LogEntry};
use crate::machine::Machine;
use crate::mode::Key;
use crate::panel::{PanelAction, Refused};
use crate::profile::Profile;
use crate::saved::SavedState;
use crate::settings::ControllerSettings;
use crate::snapshot::ControllerSnapshot;

/// Limits on frames that the controller reads. The largest frame of the manual is below 4 KiB. A camera that
/// sends every point it can see stays below 64 KiB.
const LIMITS: Limits = Limits { max_frame_bytes: 65_536, max_depth: r6_proto::MAX_DEPTH };

/// How many connections are accepted, served or not. Beyond that, the oldest connection that is not served is
/// closed. A cabinet has few sockets; this bound only keeps a flood of connections from filling the memory.
pub const MAX_ACCEPTED: usize = 1024;

/// One connection of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ConnectionId(u64);

impl ConnectionId {
    /// A number that no other connection of this controller has or gets.
    #[must_use]
    pub fn number(self) -> u64 {
        self.0
    }
}

/// Whether a connection is served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Service {
    /// It counts towards `Profile::max_connections` and is served.
    Served,
    /// It came when no place was free: accepted, never answered (`Profile::max_connections`).
    Ignored,
    /// It has a place, but its peer is gone and the controller has not noticed.
    Wedged,
    /// The shell has to reset it (an AddRCC over `Profile::add_rcc_reset_over`) or close it.
    Over,
}

#[derive(Debug)]
struct Connection {
    /// In a box: a node of the map has room for eleven connections, and a controller has one or two.
    session: Box<ServerSession>,
    service: Service,
    /// The controller opened it: it does not count towards [`Profile::max_connections`].
    opened: bool,
}

impl Connection {
    /// Whether it takes one of the places of [`Profile::max_connections`], as far as the controller knows.
    fn takes_a_place(&self) -> bool {
        matches!(self.service, Service::Served | Service::Wedged)
    }
}

/// A virtual controller.
#[derive(Debug)]
pub struct Controller {
    machine: Machine,
    connections: BTreeMap<ConnectionId, Connection>,
    next_connection: u64,
    cameras: Cameras,
    woken: VecDeque<ConnectionId>,
    /// How many unrequested frames were sent.
    pushes: u64,
    /// The scenario and the faults in force, if there is a scenario or a fault was given.
    breakage: Option<Box<Breakage>>,
    /// How it was switched on: at a power cut the machine is made from this again.
    settings: Box<ControllerSettings>,
    /// The link faults in force.
    link_faults: Vec<LinkFaultNow>,
    /// How often the link faults have changed.
    link_changes: u64,
    log: Log,
}

impl Controller {
    /// A controller that was just switched on, without connections.
    #[must_use]
    pub fn new(settings: ControllerSettings, now: Instant) -> Self {
        let breakage = Self::breakage(&settings, now);
        let machine = Machine::new(settings.clone(), now);
        Self { breakage, ..Self::of(machine, settings) }.begun(now)
    }

    /// A controller that was just switched on, with the state that a power cut left. The saved state takes
    /// precedence over the settings.
    #[must_use]
    pub fn restored(settings: ControllerSettings, saved: &SavedState, now: Instant) -> Self {
        let breakage = Self::breakage(&settings, now);
        let machine = Machine::restored(settings.clone(), saved, now);
        Self { breakage, ..Self::of(machine, settings) }.begun(now)
    }

    fn breakage(settings: &ControllerSettings, now: Instant) -> Option<Box<Breakage>> {
        let scenario = settings.scenario.clone()?;
        Some(Box::new(Breakage::new(scenario, settings.seed, now)))
    }

    /// Carries out what the scenario does at once.
    fn begun(mut self, now: Instant) -> Self {
        self.advance(now);
        self
    }

    fn of(machine: Machine, settings: ControllerSettings) -> Self {
        Self {
            machine,
            settings: Box::new(settings),
            connections: BTreeMap::new(),
            next_connection: 0,
            cameras: Cameras::default(),
            woken: VecDeque::new(),
            pushes: 0,
            breakage: None,
            link_faults: Vec::new(),
            link_changes: 0,
            log: Log::default(),
        }
    }

    /// Raises an alarm, as a failure in the cabinet does, or to see what happens then.
    pub fn raise(&mut self, now: Instant, alarm: AlarmCode, why: impl fmt::Display) {
        self.advance(now);
        self.machine.raise(alarm, AlarmCause::Other { why: Detail::of(why) });
        self.collect_machine_events();
    }

    /// Takes a new connection. Beyond the profile's limit it is accepted, but never answered.
    pub fn connect(&mut self, now: Instant) -> ConnectionId {
        self.advance(now);
        if self.connections.len() >= MAX_ACCEPTED {
            self.drop_an_ignored_one();
        }
        let id = self.next_id();
        let accepted = self.connections.values().filter(|connection| !connection.opened);
        let served = accepted.filter(|connection| connection.takes_a_place()).count();
        let limit = self.machine.profile.max_connections;
        let service = if served < limit { Service::Served } else { Service::Ignored };
        if service == Service::Ignored {
            self.log.add(now, Some(id), Event::TooManyConnections { limit });
        }
        self.insert(id, service, false);
        id
    }

    /// Says that the shell dials a camera from now on: camera `cam_id`, or with `None` a camera that stands
    /// for all. While it is not connected, its photo requests go only to a connection that has spoken as this
    /// camera.
    pub fn expect_camera(&mut self, cam_id: Option<i64>) {
        self.cameras.expect(cam_id);
    }

    /// Takes a connection that the shell opened to a camera. It is served even beyond the profile's limit,
    /// which counts accepted connections only. It gets the photo requests for this camera; with `None`, the
    /// requests for every camera without a connection of its own.
    pub fn connect_camera(&mut self, now: Instant, cam_id: Option<i64>) -> ConnectionId {
        self.advance(now);
        let id = self.next_id();
        // Without mains the controller does not dial: this tells the shell to close the connection.
        let service = if self.is_off() { Service::Over } else { Service::Served };
        self.insert(id, service, true);
        self.cameras.connect(id, cam_id);
        id
    }

    fn next_id(&mut self) -> ConnectionId {
        let id = ConnectionId(self.next_connection);
        self.next_connection += 1;
        id
    }

    fn insert(&mut self, id: ConnectionId, service: Service, opened: bool) {
        self.connections
            .insert(id, Connection { session: Box::new(ServerSession::new(LIMITS)), service, opened });
    }

    /// Adds an event of the shell (sockets, cameras, files) to the log.
    pub fn log(&mut self, now: Instant, connection: Option<ConnectionId>, event: ShellEvent) {
        self.log.add(now, connection, Event::Shell(event));
    }

    /// Logs that a link fault has struck a connection or its bytes.
    pub fn struck(&mut self, now: Instant, connection: ConnectionId, fault: LinkFault) {
        self.log.add(now, Some(connection), Event::Struck { fault: Fault::Link(fault) });
    }

    fn served(&self) -> usize {
        self.connections.values().filter(|connection| connection.takes_a_place()).count()
    }

    fn drop_an_ignored_one(&mut self) {
        let ignored = self.connections.iter_mut().find(|(_, other)| other.service == Service::Ignored);
        if let Some((id, connection)) = ignored {
            connection.service = Service::Over;
            self.woken.push_back(*id);
        }
    }

    /// Removes a connection that has ended.
    pub fn disconnect(&mut self, id: ConnectionId) {
        self.connections.remove(&id);
        self.log.forget(self.machine.now(), id);
        self.cameras.disconnect(id);
        if let Some(breakage) = &mut self.breakage {
            breakage.disconnect(id);
        }
    }

    /// Takes a connection that has ended without the controller noticing
    /// ([`crate::fault::LinkFault::HalfOpen`]). If it was served, its place stays taken until the power is
    /// cut, as on real cabinets; it gets and costs nothing else. A connection that has no place, or that was
    /// opened to a camera, is removed.
    pub fn lose(&mut self, id: ConnectionId) {
        self.cameras.disconnect(id);
        match self.connections.get_mut(&id) {
            Some(connection) if connection.service == Service::Served && !connection.opened => {
                connection.service = Service::Wedged;
                self.log.forget(self.machine.now(), id);
                *connection.session = ServerSession::new(LIMITS);
            }
            Some(_) | None => self.disconnect(id),
        }
    }

    /// Takes bytes from a connection and carries out what they ask.
    pub fn handle_input(&mut self, now: Instant, id: ConnectionId, bytes: &[u8]) {
        self.advance(now);
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.take_input(now, id, rest);
            if taken == 0 {
                return;
            }
            rest = rest.get(taken..).unwrap_or_default();
            while self.serve_next(now, id) {}
        }
    }

    /// Takes as many bytes from a connection as there is room for; 0 if it is not served.
    pub(crate) fn take_input(&mut self, now: Instant, id: ConnectionId, bytes: &[u8]) -> usize {
        let is_off = self.is_off();
        match self.connections.get_mut(&id) {
            Some(connection) if connection.service == Service::Served && !is_off => {
                connection.session.split().0.push(now, bytes)
            }
            Some(_) | None => 0,
        }
    }

    /// Carries out the next message of a connection. Returns false if more bytes are needed.
    pub(crate) fn serve_next(&mut self, now: Instant, id: ConnectionId) -> bool {
        let Some(connection) = self.connections.get_mut(&id) else { return false };
        if connection.service != Service::Served {
            return false;
        }
        if self.breakage.as_ref().is_some_and(|breakage| breakage.is_in_the_way()) {
            return self.serve_broken(now, id);
        }
        let (inbox, outbox) = connection.session.split();
        let mut dispatcher = Dispatcher::new(now, id, &mut self.machine, &mut self.log, &mut self.cameras);
        let served = dispatcher.serve_next(inbox, outbox);
        if dispatcher.reset || outbox.is_overfull() {
            connection.service = Service::Over;
        }
        self.collect_machine_events();
        self.react(now);
        served
    }

    /// Lets time pass, and does everything that is due.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.advance(now);
        for (id, connection) in &mut self.connections {
            let (inbox, _) = connection.session.split();
            if let Some(error) = inbox.handle_timeout(now) {
                self.log.warn(now, *id, Event::NotUnderstood { problem: error.into() });
            }
        }
        self.log.handle_timeout(now);
        self.collect_machine_events();
    }

    /// When [`Self::handle_timeout`] has to be called next. Delayed frames have their own time:
    /// [`Self::next_transmit`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let sessions = self.connections.values().filter_map(|connection| connection.session.poll_timeout());
        let rest = [self.machine.next_event(), self.next_of_scenario(), self.log.poll_timeout()];
        sessions.chain(rest.into_iter().flatten()).min()
    }

    /// The next frame for a connection. The shell writes it in one piece.
    pub fn poll_transmit(&mut self, now: Instant, id: ConnectionId) -> Option<&[u8]> {
        self.connections.get_mut(&id)?.session.split().1.poll_transmit(now)
    }

    /// Whether a connection has to be reset: it sent an AddRCC that real controllers answer with a reset, or
    /// it reads nothing, or it is closed.
    #[must_use]
    pub fn is_over(&self, id: ConnectionId) -> bool {
        self.connections.get(&id).is_none_or(|connection| connection.service == Service::Over)
    }

    /// When the next delayed frame of a connection is sent.
    #[must_use]
    pub fn next_transmit(&self, id: ConnectionId) -> Option<Instant> {
        self.connections.get(&id)?.session.next_transmit()
    }

    /// The next connection that has something to write or has to be reset, although it sent nothing itself.
    pub fn poll_woken(&mut self) -> Option<ConnectionId> {
        self.woken.pop_front()
    }

    /// The link faults in force. The shell that owns the sockets applies them. Every connection is woken when
    /// they change.
    #[must_use]
    pub fn link_faults(&self) -> &[LinkFaultNow] {
        &self.link_faults
    }

    /// How often [`Self::link_faults`] has changed. While this number stays the same, so do the faults.
    #[must_use]
    pub fn link_changes(&self) -> u64 {
        self.link_changes
    }

    /// Sets the link faults of this controller.
    pub fn set_link_faults(&mut self, faults: Vec<LinkFaultNow>) {
        self.link_faults = faults;
        self.link_changes += 1;
        self.woken.extend(self.connections.keys());
    }

    /// The next entry of the log, oldest first.
    pub fn poll_log(&mut self) -> Option<LogEntry> {
        self.log.poll()
    }

    /// Asks a camera for a photo. The request goes over the connection that was opened to the camera; else
    /// over the connection that last spoke as it; else over the connection that last spoke as any camera;
    /// else over all. If no connection gets it, the log says so.
    pub fn request_photo(&mut self, now: Instant, cam_id: i64) {
        self.advance(now);
        self.push_photo(now, cam_id);
    }

    fn push_photo(&mut self, now: Instant, cam_id: i64) {
        if self.is_off() {
            return;
        }
        let route = self.cameras.route(cam_id);
        let mut asked = 0;
        for (id, connection) in &mut self.connections {
            let is_meant = match route {
                Route::To(camera) => camera == *id,
                Route::ToAll => !self.cameras.is_of_another(*id, cam_id),
                Route::Away => false,
            };
            if is_meant && connection.service == Service::Served {
                let (_, outbox) = connection.session.split();
                outbox.send(|out| encode_photo(cam_id, None, out));
                if outbox.is_overfull() {
                    connection.service = Service::Over;
                }
                self.woken.push_back(*id);
                asked += 1;
            }
        }
        self.pushes += asked;
        let camera = match route {
            Route::To(camera) => Some(camera),
            Route::ToAll | Route::Away => None,
        };
        if asked > 0 {
            self.log.add(now, camera, Event::PhotoRequested { camera: cam_id });
        } else {
            let away = route == Route::Away;
            self.log.add(now, camera, Event::PhotoLost { camera: cam_id, away });
        }
    }

    /// Does what an operator does at the machine.
    ///
    /// # Errors
    /// Why the machine refused, and what to do about it. Nothing has changed then.
    pub fn operate(&mut self, now: Instant, action: &PanelAction) -> Result<(), Refused> {
        self.advance(now);
        if self.is_off() && !action.needs_no_power() {
            return Err(Refused::PowerOff);
        }
        let done = self.machine.operate(action);
        self.collect_machine_events();
        self.react(now);
        done
    }

    /// Sets an input, as [`PanelAction::SetInput`] does. An input that does not exist changes nothing.
    pub fn set_input(&mut self, now: Instant, board: u8, point: u8, on: bool) {
        let _ = self.operate(now, &PanelAction::SetInput { board, point, on });
    }

    /// Turns the mode key, as [`PanelAction::TurnKey`] does. This is never refused.
    pub fn turn_key(&mut self, now: Instant, key: Key) {
        let _ = self.operate(now, &PanelAction::TurnKey(key));
    }

    /// Runs the program in use from its first step to the end of one pass. The mode is then
    /// [`OperationMode::Auto`]. Unlike [`Button::SingleCycle`], the program waits at every wait. At a step
    /// that waits for remote commands the run ends with [`ModeReason::ProgramIsEmpty`].
    ///
    /// # Errors
    /// Why the machine refused. Nothing has changed then.
    ///
    /// [`OperationMode::Auto`]: r6_proto::OperationMode::Auto
    /// [`Button::SingleCycle`]: crate::Button::SingleCycle
    /// [`ModeReason::ProgramIsEmpty`]: crate::event::ModeReason::ProgramIsEmpty
    pub fn run_one_pass(&mut self, now: Instant) -> Result<(), Refused> {
        self.advance(now);
        let done = self.machine.run_one_pass();
        self.collect_machine_events();
        self.react(now);
        done
    }

    /// Whether an output is on.
    pub fn output(&mut self, now: Instant, point: OutputPoint) -> bool {
        self.advance(now);
        self.machine.io().is_set(point)
    }

    /// The machine behind the connections, as of the last call with a point in time.
    #[must_use]
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The profile of this controller.
    #[must_use]
    pub fn profile(&self) -> &Profile {
        &self.machine.profile
    }

    /// The state of the machine that an operator can see, now.
    pub fn snapshot(&mut self, now: Instant) -> ControllerSnapshot {
        self.advance(now);
        self.collect_machine_events();
        let seen = ControllerSnapshot::of(&self.machine, self.served());
        ControllerSnapshot { power_off: self.is_off(), ..seen }
    }

    /// The value that a client would read now; `None` if this firmware lacks the address. It can differ from
    /// the machine's own value, because a firmware rounds.
    pub fn reading(&mut self, now: Instant, address: Address) -> Option<Reading> {
        self.advance(now);
        crate::answer::reading(&self.machine, address)
    }

    fn collect_machine_events(&mut self) {
        while let Some(cam_id) = self.machine.poll_photo() {
            self.push_photo(self.machine.now(), cam_id);
        }
        while let Some(event) = self.machine.poll_event() {
            self.log.add(event.at, None, event.event);
        }
    }
}
