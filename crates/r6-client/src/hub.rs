//! What is known over a connection besides its requests: who answers, what the firmware lacks, how good the
//! link is.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use r6_proto::address::{Address, AddressMap};
use r6_proto::client::LearnedDialect;
use r6_proto::message::QueryReply;
use r6_proto::time::Instant;
use tokio::sync::{broadcast, watch};

use crate::board::Board;
use crate::doubt::Doubts;
use crate::error::NotSent;
use crate::event::Event;
use crate::identity::{Found, Identity};
use crate::link_quality::Meter;
use crate::pushed::{KEPT_FOR_SUBSCRIBERS, LostReason, Pushed};
use crate::raw::RawValues;
use crate::reply::Places;
use crate::time::Time;

/// State that a connection shares with its handles, besides answers.
#[derive(Debug)]
pub(crate) struct Hub {
    /// The clock.
    pub time: Arc<Time>,
    /// Whether the handle was closed and nothing is under way any more.
    pub closed: watch::Sender<bool>,
    /// The controller's name in messages, once there is a connection.
    pub name: OnceLock<Box<str>>,
    /// `None` once the handle is closed, which ends every receiver.
    pushed: Mutex<Option<broadcast::Sender<Pushed>>>,
    /// `None` once the handle is closed, which ends every receiver.
    events: Mutex<Option<broadcast::Sender<Event>>>,
    known: Mutex<Known>,
    meter: Mutex<Meter>,
    pub board: Board,
    /// Frames that can move the arm and have an open outcome.
    pub doubts: Doubts,
    /// The places that answers are written to.
    pub places: Places,
    /// How many stops and pauses were asked for.
    stops_asked: AtomicU64,
}

/// What is known of the controller behind the present connection.
#[derive(Debug, Default)]
pub(crate) struct Known {
    pub learned: LearnedDialect,
    /// The version, once asked for; inner `None` if the controller has none.
    pub firmware: Option<Option<String>>,
    /// Addresses that it does not support.
    pub unsupported: BTreeSet<Address>,
    /// Addresses that some controllers lack but that had a value here.
    pub supported: AddressMap<()>,
    /// Whether the last query had a reply with an unexplained number of values.
    pub doubts_lists: bool,
    /// How often lists were doubted, over all connections.
    pub doubts: u64,
    /// For addresses that should have a value: how often in a row one had none when asked for alone.
    pub empty: BTreeMap<Address, u8>,
    /// Counts the connections, so that no answer of one is kept for the next.
    pub connection: u64,
    /// The robot that is there, once its identity was read.
    pub present: Option<Identity>,
    /// The expected robot: the first one on this handle, or the one accepted since.
    pub expected: Option<Identity>,
    /// Whether values were handed out over the present connection.
    pub handed_out: bool,
    /// Whether values were handed out over a connection that ended before its robot was identified, and no
    /// caller has read mode and alarm since. Then those values may come from a robot other than the present
    /// one.
    pub read_of_nobody: bool,
    /// The unexpected robot that answered on the connection before this one, if there was one.
    pub stranger_before: Option<Identity>,
    /// The last values as the controller wrote them.
    pub raw: RawValues,
}

impl Known {
    /// Records that a reply on this connection had an unexplained number of values.
    pub fn doubt_lists(&mut self, connection: u64) {
        if self.connection == connection {
            self.doubts_lists = true;
            self.doubts += 1;
            self.raw.forget();
        }
    }

    /// Keeps the values of a reply as the controller wrote them, if each is known to belong to its address.
    pub fn keep_raw(
        &mut self,
        asked: &[Address],
        reply: &QueryReply<'_>,
        connection: u64,
        asked_at: Instant,
    ) {
        if self.connection == connection && (asked.len() == 1 || !self.doubts_lists) {
            self.raw.keep(asked, reply, asked_at);
        }
    }
}

impl Default for Hub {
    fn default() -> Self {
        let time = Arc::<Time>::default();
        Self {
            time: Arc::clone(&time),
            closed: watch::Sender::new(false),
            name: OnceLock::new(),
            pushed: Mutex::new(Some(broadcast::Sender::new(KEPT_FOR_SUBSCRIBERS))),
            events: Mutex::new(Some(broadcast::Sender::new(KEPT_FOR_SUBSCRIBERS))),
            known: Mutex::default(),
            meter: Mutex::default(),
            board: Board::new(Arc::clone(&time)),
            doubts: Doubts::new(time),
            places: Places::default(),
            stops_asked: AtomicU64::new(0),
        }
    }
}

impl Hub {
    /// What is known. No caller holds this guard across an await, and nothing can panic while holding it.
    pub fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The counts of the link, under the same rules as [`Self::known`].
    pub fn meter(&self) -> MutexGuard<'_, Meter> {
        self.meter.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in the answer to the identity query.
    ///
    /// `certain`: every part of it could be read. If some parts could not be read and the others match the
    /// expected robot, the controller stays unknown, because another robot of the same model may differ in
    /// those parts alone.
    pub fn introduced(&self, mut found: Found, certain: bool, first: bool) {
        {
            let mut known = self.known();
            let unproved = match &known.expected {
                Some(expected) => !certain && found.identity.is_part_of(expected),
                None => false,
            };
            if certain {
                known.expected.get_or_insert_with(|| found.identity.clone());
            }
            let differs = known.expected.as_ref().is_some_and(|expected| *expected != found.identity);
            found.another = differs && !unproved;
            known.present = (!unproved).then(|| found.identity.clone());
        }
        if found.another {
            self.happened(Event::AnotherRobot { found: found.identity.clone() });
        }
        if !first {
            self.push(Pushed::Reconnected(found));
        }
    }

    /// Whether the expected robot is known but the present one is not.
    pub fn is_unidentified(&self) -> bool {
        let known = self.known();
        known.expected.is_some() && known.present.is_none()
    }

    /// Notes that the next connection may lead to another robot. If the expected robot is not known, nothing
    /// that is read there confirms a stop until a caller has read mode and alarm.
    pub fn doubt_who_answers(&self) {
        let mut known = self.known();
        known.read_of_nobody |= known.expected.is_none();
    }

    /// The robot on this connection. `None` if it is not the present connection, or its identity has not been
    /// read.
    pub fn identity_on(&self, connection: u64) -> Option<Identity> {
        let known = self.known();
        if known.connection == connection { known.present.clone() } else { None }
    }

    /// The expected robot, and the different one found on this connection or on the one before.
    pub fn stranger_on(&self, connection: u64) -> Option<(Identity, Identity)> {
        let known = self.known();
        let expected = known.expected.as_ref()?;
        let found = match known.connection.checked_sub(connection)? {
            0 => known.present.as_ref()?,
            1 => known.stranger_before.as_ref()?,
            _earlier => return None,
        };
        (expected != found).then(|| (expected.clone(), found.clone()))
    }

    /// Why no command may be sent: a robot other than the expected one is there.
    pub fn stranger(&self) -> Option<NotSent> {
        let connection = self.known().connection;
        let (expected, found) = self.stranger_on(connection)?;
        Some(NotSent::AnotherRobot { expected: Box::new(expected), found: Box::new(found) })
    }

    /// Counts a stop or a pause that was asked for.
    pub fn stop_asked(&self) {
        self.stops_asked.fetch_add(1, Ordering::SeqCst);
    }

    /// How many stops and pauses were asked for so far.
    pub fn stops_asked(&self) -> u64 {
        self.stops_asked.load(Ordering::SeqCst)
    }

    /// Receives unsolicited events from now on.
    pub fn subscribe_to_pushed(&self) -> broadcast::Receiver<Pushed> {
        let pushed = self.pushed.lock().unwrap_or_else(PoisonError::into_inner);
        // After the handle is closed its sender is gone: this receiver ends at once.
        pushed.as_ref().map_or_else(|| broadcast::Sender::new(1).subscribe(), broadcast::Sender::subscribe)
    }

    /// The handle is closed: ends all receivers.
    pub fn end(&self) {
        self.board.close();
        // Ends the receivers of [`crate::Robot::pushed`].
        self.pushed.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.events.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.closed.send_replace(true);
    }

    /// Whether there is a receiver of unsolicited events.
    pub fn is_watched(&self) -> bool {
        let pushed = self.pushed.lock().unwrap_or_else(PoisonError::into_inner);
        pushed.as_ref().is_some_and(|pushed| pushed.receiver_count() > 0)
    }

    /// Sends to the subscribers; there may be none.
    pub fn push(&self, pushed: Pushed) {
        tracing::debug!(?pushed);
        if let Some(sender) = &*self.pushed.lock().unwrap_or_else(PoisonError::into_inner) {
            sender.send(pushed).ok();
        }
    }

    /// Receives the client's own events, from now on.
    pub fn subscribe_to_events(&self) -> broadcast::Receiver<Event> {
        let events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        events.as_ref().map_or_else(|| broadcast::Sender::new(1).subscribe(), broadcast::Sender::subscribe)
    }

    /// Writes to the log and to the subscribers; there may be none.
    pub fn happened(&self, event: Event) {
        event.log(self.name.get().map_or("", |name| name));
        if let Some(sender) = &*self.events.lock().unwrap_or_else(PoisonError::into_inner) {
            sender.send(event).ok();
        }
    }

    pub fn learn(&self, learned: LearnedDialect) {
        self.known().learned = learned;
    }

    /// Forgets what was known, except the expected robot: the next connection may lead to another controller.
    pub fn connection_lost(&self, reason: LostReason) {
        {
            let mut known = self.known();
            let connection = known.connection + 1;
            let (expected, present) = (known.expected.take(), known.present.take());
            let read_of_nobody = known.read_of_nobody || (known.handed_out && expected.is_none());
            let stranger_before = present.filter(|present| expected.as_ref().is_some_and(|it| it != present));
            let (doubts, raw) = (known.doubts, known.raw.on_next_connection());
            *known = Known {
                connection,
                expected,
                read_of_nobody,
                stranger_before,
                doubts,
                raw,
                ..Known::default()
            };
        }
        self.meter().disconnected(self.time.now());
        self.board.connection_lost();
        self.push(Pushed::ConnectionLost(reason));
    }
}
