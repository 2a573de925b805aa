//! The virtual controller: connections in front, one machine behind.
//!
//! A shell gives it bytes and points in time and carries its frames and deadlines away:
//!
//! ```text
//! connect → handle_input(now, id, bytes) → poll_transmit(now, id) … → poll_timeout → handle_timeout(now)
//! ```

mod cameras;
pub(crate) mod pace;

use std::collections::{BTreeMap, VecDeque};

use r6_proto::frame::Limits;
use r6_proto::message::{AddPoints, AddRcc, Body, CommandWords, Header, Message, Query, Rejection};
use r6_proto::reply::{ReplyWriter, Verdict, encode_photo};
use r6_proto::server::{Inbox, InputError, Outbox, ServerSession};
use r6_proto::time::Instant;
use r6_proto::{Address, RequestType};

use cameras::{Cameras, Route};

use crate::fault::LinkFaultNow;
use crate::io::OutputPoint;
use crate::log::{Level, Log, LogLine};
use crate::machine::Machine;
use crate::mode::Key;
use crate::panel::{PanelAction, Refused};
use crate::profile::Profile;
use crate::saved::SavedState;
use crate::settings::ControllerSettings;
use crate::snapshot::ControllerSnapshot;

/// The longest frame that is read. The largest frame of the manual is below 4 KiB; a camera that sends every point
/// it can see stays below 64 KiB.
const LIMITS: Limits = Limits { max_frame_bytes: 65_536, max_depth: r6_proto::MAX_DEPTH };

/// How many connections are accepted at all, served or not. Beyond, the oldest that is not served is closed.
/// A cabinet's sockets are few; this bound only keeps a flood from filling the memory.
pub const MAX_ACCEPTED: usize = 1024;

/// How many oddities of one message are explained, each with its nearest right word.
const MAX_EXPLAINED: usize = 8;

/// One connection of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ConnectionId(u64);

impl ConnectionId {
    /// A number that no other connection of this controller had or will have.
    #[must_use]
    pub fn number(self) -> u64 {
        self.0
    }
}

/// Whether a connection is served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Service {
    /// It is one of the few.
    Served,
    /// It came when there was no room: accepted, never answered (`Profile::max_connections`).
    Ignored,
    /// It is one of the few, and its peer is gone without the controller's knowledge.
    Wedged,
    /// It has to be reset (an AddRCC over `Profile::add_rcc_reset_over`) or closed.
    Over,
}

#[derive(Debug)]
struct Connection {
    session: ServerSession,
    service: Service,
    /// The controller opened it itself: it takes none of the sockets of [`Profile::max_connections`].
    opened: bool,
}

impl Connection {
    /// Whether it is one of those that are served, as far as the controller knows.
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
    /// How many frames were sent that nobody had asked for.
    pushes: u64,
    /// What is wrong with the link now.
    link_faults: Vec<LinkFaultNow>,
    /// How often that has changed.
    link_changes: u64,
    log: Log,
}

impl Controller {
    /// A controller that was just switched on, without connections.
    #[must_use]
    pub fn new(settings: ControllerSettings, now: Instant) -> Self {
        Self::of(Machine::new(settings, now))
    }

    /// A controller that was just switched on, with what a power cut left in place of what the settings say of it.
    #[must_use]
    pub fn restored(settings: ControllerSettings, saved: &SavedState, now: Instant) -> Self {
        Self::of(Machine::restored(settings, saved, now))
    }

    fn of(machine: Machine) -> Self {
        Self {
            machine,
            connections: BTreeMap::new(),
            next_connection: 0,
            cameras: Cameras::default(),
            woken: VecDeque::new(),
            pushes: 0,
            link_faults: Vec::new(),
            link_changes: 0,
            log: Log::default(),
        }
    }

    /// Raises an alarm: something is wrong in the cabinet, or a person wants to see what happens then.
    pub fn raise(&mut self, now: Instant, alarm: u32, why: String) {
        self.machine.advance(now);
        self.machine.raise(alarm, why);
        self.collect_machine_events();
    }

    /// Takes a new connection. Beyond the profile's limit it is accepted, but never answered.
    pub fn connect(&mut self, now: Instant) -> ConnectionId {
        self.machine.advance(now);
        if self.connections.len() >= MAX_ACCEPTED {
            self.drop_an_ignored_one();
        }
        let id = self.next_id();
        let accepted = self.connections.values().filter(|connection| !connection.opened);
        let served = accepted.filter(|connection| connection.takes_a_place()).count();
        let limit = self.machine.profile.max_connections;
        let service = if served < limit { Service::Served } else { Service::Ignored };
        if service == Service::Ignored {
            let text = format!("{limit} connections are served already: this one will not be answered");
            self.log.add(now, Some(id), Level::Warning, text);
        }
        self.insert(id, service, false);
        id
    }

    /// The shell dials a camera from now on, this one or (`None`) the one that is every camera: while it is away, its photo
    /// requests go to nobody who never spoke as this camera.
    pub fn expect_camera(&mut self, cam_id: Option<i64>) {
        self.cameras.expect(cam_id);
    }

    /// Takes a connection that the shell opened to a camera. It is served whatever the profile's limit says, which is that of the
    /// sockets that accept, and gets the photo requests for this camera, or with `None` for every one that has no connection of
    /// its own.
    pub fn connect_camera(&mut self, now: Instant, cam_id: Option<i64>) -> ConnectionId {
        self.machine.advance(now);
        let id = self.next_id();
        self.insert(id, Service::Served, true);
        self.cameras.connect(id, cam_id);
        id
    }

    fn next_id(&mut self) -> ConnectionId {
        let id = ConnectionId(self.next_connection);
        self.next_connection += 1;
        id
    }

    fn insert(&mut self, id: ConnectionId, service: Service, opened: bool) {
        self.connections.insert(id, Connection { session: ServerSession::new(LIMITS), service, opened });
    }

    /// Adds a line of the shell's to the log.
    pub fn log(&mut self, now: Instant, connection: Option<ConnectionId>, level: Level, text: String) {
        self.log.add(now, connection, level, text);
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

    /// A connection has ended.
    pub fn disconnect(&mut self, id: ConnectionId) {
        self.connections.remove(&id);
        self.cameras.disconnect(id);
    }

    /// A connection has ended, and the controller does not notice ([`crate::fault::LinkFault::HalfOpen`]). If it was one of those
    /// that are served, its place stays taken for as long as the controller is switched on, as on cabinets that only
    /// a power cut brings back; it gets and costs nothing else. A connection without such a place, or that was opened to
    /// a camera, is gone.
    pub fn lose(&mut self, id: ConnectionId) {
        self.cameras.disconnect(id);
        match self.connections.get_mut(&id) {
            Some(connection) if connection.service == Service::Served && !connection.opened => {
                connection.service = Service::Wedged;
                connection.session = ServerSession::new(LIMITS);
            }
            Some(_) | None => self.disconnect(id),
        }
    }

    /// Takes bytes from a connection and carries out what they ask.
    pub fn handle_input(&mut self, now: Instant, id: ConnectionId, bytes: &[u8]) {
        self.machine.advance(now);
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

    /// Takes as many bytes from a connection as there is room for; none once it is not served.
    pub(crate) fn take_input(&mut self, now: Instant, id: ConnectionId, bytes: &[u8]) -> usize {
        match self.connections.get_mut(&id) {
            Some(connection) if connection.service == Service::Served => {
                connection.session.split().0.push(now, bytes)
            }
            Some(_) | None => 0,
        }
    }

    /// Carries out the next message of a connection; false once more bytes are needed.
    pub(crate) fn serve_next(&mut self, now: Instant, id: ConnectionId) -> bool {
        let Some(connection) = self.connections.get_mut(&id) else { return false };
        if connection.service != Service::Served {
            return false;
        }
        let (inbox, outbox) = connection.session.split();
        let mut desk = Desk {
            now,
            id,
            machine: &mut self.machine,
            log: &mut self.log,
            cameras: &mut self.cameras,
            reset: false,
        };
        let served = desk.serve_next(inbox, outbox);
        if desk.reset || outbox.is_overfull() {
            connection.service = Service::Over;
        }
        self.collect_machine_events();
        served
    }

    /// Lets time pass: what is due happens.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.machine.advance(now);
        for (id, connection) in &mut self.connections {
            let (inbox, _) = connection.session.split();
            if let Some(error) = inbox.handle_timeout(now) {
                self.log.add(now, Some(*id), Level::Warning, format!("{error}; not answered"));
            }
        }
        self.collect_machine_events();
    }

    /// When [`Self::handle_timeout`] has to be called next. Frames that are held back have their own time:
    /// [`Self::next_transmit`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let sessions = self.connections.values().filter_map(|connection| connection.session.poll_timeout());
        sessions.chain(self.machine.next_event()).min()
    }

    /// The next frame for a connection, to be written as one piece.
    pub fn poll_transmit(&mut self, now: Instant, id: ConnectionId) -> Option<&[u8]> {
        self.connections.get_mut(&id)?.session.split().1.poll_transmit(now)
    }

    /// Whether a connection has to be reset: it sent an AddRCC that no controller survives, or reads nothing.
    #[must_use]
    pub fn is_over(&self, id: ConnectionId) -> bool {
        self.connections.get(&id).is_none_or(|connection| connection.service == Service::Over)
    }

    /// When the next frame of a connection leaves that is held back now.
    #[must_use]
    pub fn next_transmit(&self, id: ConnectionId) -> Option<Instant> {
        self.connections.get(&id)?.session.next_transmit()
    }

    /// A connection that has something to write, or has to be reset, although it sent nothing itself.
    pub fn poll_woken(&mut self) -> Option<ConnectionId> {
        self.woken.pop_front()
    }

    /// What is wrong with the link now: the shell that owns the sockets brings it about. Every connection is woken when it
    /// changes.
    #[must_use]
    pub fn link_faults(&self) -> &[LinkFaultNow] {
        &self.link_faults
    }

    /// How often [`Self::link_faults`] has changed: whoever saw this number saw these faults.
    #[must_use]
    pub fn link_changes(&self) -> u64 {
        self.link_changes
    }

    /// Has the link be like this from now on.
    pub fn set_link_faults(&mut self, faults: Vec<LinkFaultNow>) {
        self.link_faults = faults;
        self.link_changes += 1;
        self.woken.extend(self.connections.keys());
    }

    /// What happened, oldest first.
    pub fn poll_log(&mut self) -> Option<LogLine> {
        self.log.poll()
    }

    /// Asks a camera for a photo: over the connection that was opened to it; else over the one that last spoke as it; else over
    /// the one that last spoke as any camera; else over all. A request that reaches nobody is told in the log.
    pub fn request_photo(&mut self, now: Instant, cam_id: i64) {
        self.machine.advance(now);
        self.push_photo(now, cam_id);
    }

    fn push_photo(&mut self, now: Instant, cam_id: i64) {
        let route = self.cameras.route(cam_id);
        let mut asked = 0;
        for (id, connection) in &mut self.connections {
            let is_meant = match route {
                Route::To(camera) => camera == *id,
                Route::ToAll => !self.cameras.is_of_another(*id, cam_id),
                Route::Away => false,
            };
            if is_meant && connection.service == Service::Served {
                connection.session.split().1.send(|out| encode_photo(cam_id, None, out));
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
            self.log.add(now, camera, Level::Info, format!("photo requested from camera {cam_id}"));
        } else {
            let why =
                if route == Route::Away { "the camera is not connected" } else { "no connection can be its" };
            let text = format!("photo requested from camera {cam_id}, but {why}: the request is lost");
            self.log.add(now, camera, Level::Warning, text);
        }
    }

    /// Does what a person does at the machine.
    ///
    /// # Errors
    /// Why the machine did not do it, and what to do; nothing has changed.
    pub fn operate(&mut self, now: Instant, action: &PanelAction) -> Result<(), Refused> {
        self.machine.advance(now);
        let done = self.machine.operate(action);
        self.collect_machine_events();
        done
    }

    /// Sets an input, as [`PanelAction::SetInput`] does; one that is not there changes nothing.
    pub fn set_input(&mut self, now: Instant, board: u8, point: u8, on: bool) {
        let _ = self.operate(now, &PanelAction::SetInput { board, point, on });
    }

    /// Turns the mode key, as [`PanelAction::TurnKey`] does: that is never refused.
    pub fn turn_key(&mut self, now: Instant, key: Key) {
        let _ = self.operate(now, &PanelAction::TurnKey(key));
    }

    /// Whether an output is on.
    pub fn output(&mut self, now: Instant, point: OutputPoint) -> bool {
        self.machine.advance(now);
        self.machine.io().is_set(point)
    }

    /// The machine behind the connections, as of the last call with a point in time.
    #[must_use]
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The profile it plays.
    #[must_use]
    pub fn profile(&self) -> &Profile {
        &self.machine.profile
    }

    /// What a person would see at the machine, now.
    pub fn snapshot(&mut self, now: Instant) -> ControllerSnapshot {
        self.machine.advance(now);
        self.collect_machine_events();
        ControllerSnapshot::of(&self.machine, self.served())
    }

    fn collect_machine_events(&mut self) {
        while let Some(cam_id) = self.machine.poll_photo() {
            self.push_photo(self.machine.now(), cam_id);
        }
        while let Some(event) = self.machine.poll_event() {
            self.log.add(event.at, None, Level::Info, event.text);
        }
    }
}

/// Where the messages of one connection are dealt with.
struct Desk<'c> {
    now: Instant,
    id: ConnectionId,
    machine: &'c mut Machine,
    log: &'c mut Log,
    cameras: &'c mut Cameras,
    reset: bool,
}

impl Desk<'_> {
    /// Deals with the next message that is complete; false if there is none.
    fn serve_next(&mut self, inbox: &mut Inbox, outbox: &mut Outbox) -> bool {
        match inbox.next_message() {
            Some(Ok(message)) => self.handle(&message, outbox),
            Some(Err(error)) => self.malformed(&error),
            None => return false,
        }
        true
    }

    /// Logs what is odd about a message: the first few with the nearest right word, the rest by their number. A hostile
    /// peer can put thousands of wrong words into one frame, and each explanation costs a search.
    fn explain(&mut self, oddities: impl Iterator<Item = impl std::fmt::Display>) {
        let mut oddities = oddities;
        for oddity in oddities.by_ref().take(MAX_EXPLAINED) {
            self.warn(oddity.to_string());
        }
        match oddities.count() {
            0 => {}
            more => self.warn(format!("and {more} more of the kind")),
        }
    }

    fn info(&mut self, text: String) {
        self.log.add(self.now, Some(self.id), Level::Info, text);
    }

    fn warn(&mut self, text: String) {
        self.log.add(self.now, Some(self.id), Level::Warning, text);
    }

    /// Malformed input gets silence and a log line.
    fn malformed(&mut self, error: &InputError) {
        self.warn(format!("{error}; not answered"));
    }

    fn handle(&mut self, message: &Message<'_>, outbox: &mut Outbox) {
        self.explain(message.extras());
        let header = &message.header;
        match &message.body {
            Body::Query(query) => self.query(header, query, outbox),
            Body::Command(words) => self.command(header, words, outbox),
            Body::Heartbreak => self.heartbreak(header, outbox),
            Body::PhotoAnswer(answer) => {
                self.speaks_as(answer.cam_id);
                self.info(format!("camera {} answers: ret {}", answer.cam_id, answer.ret));
                self.machine.photo_answered(answer.cam_id, answer.ret == 1);
            }
            Body::AddPoints(points) => self.add_points(header, points, outbox),
            Body::AddRcc(list) => self.add_rcc(message, list, outbox),
            Body::Rejected(rejection) => self.rejected(message, rejection, outbox),
            Body::Unknown(unknown) => self.warn(format!("{unknown}; not answered")),
            Body::QueryReply(_) | Body::CommandReply(_) | Body::Photo(_) => {
                self.warn("a reply came, but a controller asks nothing; not answered".to_owned());
            }
        }
    }

    /// Lets `write` append a reply, unless the request had no type (manual 5.2, 6: no reply without it).
    fn reply(
        &mut self,
        header: &Header<'_>,
        request: RequestType,
        outbox: &mut Outbox,
        write: impl FnOnce(&ReplyWriter<'_>, &Machine, &mut Vec<u8>),
    ) {
        if header.type_word.is_none() {
            self.warn(format!("{request} without `reqType`: carried out, not answered"));
            return;
        }
        let writer = ReplyWriter::new(self.machine.profile.dialect, *header, request);
        let Profile { add_rcc_ack: ack, add_rcc_ack_spread: spread, .. } = self.machine.profile;
        let delay = (request == RequestType::AddRcc && !ack.is_zero())
            .then(|| self.machine.random.around(ack, spread));
        let machine = &*self.machine;
        if let Some(delay) = delay {
            outbox.send_in_turn(self.now + delay, |out| write(&writer, machine, out));
        } else {
            outbox.send(|out| write(&writer, machine, out));
        }
    }

    fn verdict(
        &mut self,
        header: &Header<'_>,
        request: RequestType,
        word: &str,
        verdict: Verdict<'_>,
        outbox: &mut Outbox,
    ) {
        self.reply(header, request, outbox, |writer, _, out| writer.verdict(word, verdict, out));
    }

    fn query(&mut self, header: &Header<'_>, query: &Query<'_>, outbox: &mut Outbox) {
        self.explain(query.resolved().filter_map(|(_, address)| address.err()));
        self.reply(header, RequestType::Query, outbox, |writer, machine, out| {
            writer.query(query.addresses, out, |data| {
                for word in query.addresses.iter() {
                    if let Some(address) = known(word) {
                        machine.answer(address, data);
                    }
                }
            });
        });
    }

    fn command(&mut self, header: &Header<'_>, words: &CommandWords<'_>, outbox: &mut Outbox) {
        let word = words.word();
        match self.machine.execute(words) {
            Ok(()) => {
                let arguments = words.arguments();
                let text =
                    if arguments.is_empty() { word.to_string() } else { format!("{word} {arguments:?}") };
                self.info(text);
                self.verdict(header, RequestType::Command, &word, Verdict::Ok, outbox);
            }
            Err(reason) => {
                self.warn(format!("command {word} refused: {reason}"));
                self.verdict(header, RequestType::Command, &word, Verdict::Err(&reason), outbox);
            }
        }
    }

    fn heartbreak(&mut self, header: &Header<'_>, outbox: &mut Outbox) {
        self.machine.watchdog.feed(self.now);
        if self.machine.profile.answers_heartbreak {
            self.verdict(header, RequestType::Heartbreak, "heartbreak", Verdict::Ok, outbox);
        }
    }

    /// This connection is a camera's.
    fn speaks_as(&mut self, cam_id: i64) {
        if let Some(oddity) = self.cameras.spoke(self.id, cam_id) {
            self.warn(oddity);
        }
    }

    fn add_points(&mut self, header: &Header<'_>, points: &AddPoints<'_>, outbox: &mut Outbox) {
        for (cam_id, points) in points.sets() {
            self.speaks_as(cam_id);
            self.machine.take_points(cam_id, points);
        }
        self.verdict(header, RequestType::AddPoints, "AddPoints", Verdict::Points(points.len()), outbox);
    }

    fn add_rcc(&mut self, message: &Message<'_>, list: &AddRcc<'_>, outbox: &mut Outbox) {
        if !self.fits(message) {
            return;
        }
        for step in list.instructions {
            if let r6_proto::message::Action::Unknown(unknown) = &step.action {
                self.warn(format!("AddRCC refused: action {} is not known", unknown.number()));
                self.verdict(&message.header, RequestType::AddRcc, "AddRCC", Verdict::BareErr, outbox);
                return;
            }
        }
        let taken = self.machine.add_instructions(list.empty_list.unwrap_or(false), list.instructions);
        let verdict = match taken {
            Ok(()) => {
                let how = if list.empty_list == Some(true) { "replaced" } else { "appended to" };
                self.info(format!("AddRCC: {} instructions, list {how}", list.instructions.len()));
                Verdict::Ok
            }
            Err(crate::machine::NotTaken::Refused(reason)) => {
                self.warn(format!("AddRCC refused: {reason}"));
                Verdict::BareErr
            }
            Err(crate::machine::NotTaken::Silent(reason)) => {
                self.warn(format!("AddRCC neither executed nor answered: {reason}"));
                return;
            }
        };
        self.verdict(&message.header, RequestType::AddRcc, "AddRCC", verdict, outbox);
    }

    /// Whether an AddRCC is short enough to be looked at at all.
    fn fits(&mut self, message: &Message<'_>) -> bool {
        let bytes = message.frame().len();
        let profile = &self.machine.profile;
        let over = |limit: Option<usize>| limit.is_some_and(|limit| bytes > limit);
        if over(profile.add_rcc_reset_over) {
            self.reset = true;
            self.warn(format!("AddRCC of {bytes} bytes: the connection is reset, as real controllers do"));
            return false;
        }
        if over(profile.add_rcc_silent_over) {
            self.warn(format!(
                "AddRCC of {bytes} bytes: neither executed nor answered, as real controllers do; send fewer \
                 instructions in one list and append the rest"
            ));
            return false;
        }
        true
    }

    /// A known type with a wrong field: what the protocol lets us say is `err`.
    fn rejected(&mut self, message: &Message<'_>, rejection: &Rejection<'_>, outbox: &mut Outbox) {
        let reason = rejection.error.to_string();
        self.warn(format!("{} refused: {reason}", rejection.request));
        let header = &message.header;
        match rejection.request {
            RequestType::AddRcc if !self.fits(message) => {}
            RequestType::AddRcc => {
                self.verdict(header, RequestType::AddRcc, "AddRCC", Verdict::BareErr, outbox);
            }
            RequestType::AddPoints => {
                self.verdict(header, RequestType::AddPoints, "AddPoints", Verdict::BareErr, outbox);
            }
            RequestType::Command => {
                self.verdict(header, RequestType::Command, "", Verdict::Err(&reason), outbox);
            }
            RequestType::Query => self.reply(header, RequestType::Query, outbox, |writer, _, out| {
                writer.query(r6_proto::value::Values::EMPTY, out, |_| {});
            }),
            RequestType::Heartbreak | RequestType::Photo => {}
        }
    }
}

fn known(word: r6_proto::value::Value<'_>) -> Option<Address> {
    Address::parse(&word.text()).ok()
}
