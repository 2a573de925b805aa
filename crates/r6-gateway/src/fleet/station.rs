//! What the gateway knows of one robot, and who may send commands to it.

mod pending;
mod rest;
mod shared;
mod told;

use std::cmp::Ordering::{Equal, Greater, Less};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_api::gateway::{ActedBy, AuditRecord, Deed, Happened, LeaseEnd, RobotIdentity, Run};
use r6_client::{Permission, Robot};
use r6_proto::time::Instant;
use tokio::sync::{Mutex as AsyncMutex, Notify, Semaphore, watch};

use self::pending::Pending;
pub use self::shared::Shared;
use crate::clock;
use crate::core::alarms;
use crate::core::name::RobotName;
use crate::core::raw::fresh::Freshness;
use crate::core::refusals::Refusals;
use crate::core::seat::{Cut, Denied, Ground, Key, Noticed, Permit, Saved, Seat, Ticket};
use crate::fleet::config::RobotConfig;
use crate::fleet::counts::Counts;
use crate::fleet::desk::Desk;
use crate::fleet::photos::Cameras;
use crate::live::board::{Board, Source};
use crate::ownership::Ownership;
use crate::store::Keeper;

/// How many commands of one robot are under way at once, those that wait included. A controller takes about
/// 20 ms for one.
pub(super) const MAX_COMMANDS: u32 = 16;

/// How many queries of one robot are under way at once over HTTP. They share the connection with the polls,
/// and the longest takes seconds.
pub(super) const MAX_QUERIES: usize = 4;

/// How many stops of one robot are under way at once, and how many commands that stop. More would not stop
/// it sooner.
pub(super) const MAX_STOPS: u32 = 16;

/// For how long a reading counts as evidence for commands, leases and plans. Longer than the period of the
/// mode by the client's own limit for a value that is suspect.
pub(super) const FRESH_FOR: Duration = Duration::from_millis(1500);

/// What the store has of a robot.
#[derive(Clone, Debug, Default)]
pub struct Kept {
    /// Of its seat.
    pub seat: Saved,
    /// Of its alarms.
    pub alarms: alarms::Saved,
}

/// The time for which a gateway has a robot: until it ends, if no other gateway shares its store.
#[derive(Clone, Debug)]
pub struct Term {
    /// What it writes about the robot goes here.
    pub keeper: Keeper,
    /// Whether it owns the robot now.
    pub ownership: Ownership,
}

impl Term {
    /// No other gateway shares the store.
    #[must_use]
    pub fn alone(keeper: Keeper) -> Self {
        Self { keeper, ownership: Ownership::alone() }
    }
}

/// Who asks for something.
#[derive(Clone, Debug)]
pub struct By {
    /// The name of the user, or `token` with its number and its name.
    pub actor: String,
    /// The address that the request came from.
    pub source: Option<String>,
}

impl By {
    /// The caller, who acts now.
    pub(super) fn acts(&self) -> ActedBy {
        ActedBy { by: self.actor.clone(), at: clock::time_of_day() }
    }
}

/// The gateway, for what it does by itself.
pub(crate) fn by_itself() -> By {
    By { actor: "gateway".to_owned(), source: None }
}

/// Who answers at the address of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answers {
    /// The robot that the name stands for.
    This,
    /// Another one, which was not accepted.
    Another,
    /// It did not say yet.
    Unknown,
    /// There is a later connection: this one is over.
    Gone,
}

/// One robot.
#[derive(Debug)]
pub struct Station {
    name: RobotName,
    config: Mutex<RobotConfig>,
    /// Until when this gateway has it.
    pub(crate) term: Term,
    pub(super) shared: Arc<Shared>,
    /// What happened, counted.
    pub counts: Counts,
    held: Mutex<Held>,
    board: Mutex<Board>,
    /// Its alarms.
    pub(super) desk: Desk,
    /// What is known of its cameras.
    pub(super) cameras: Cameras,
    /// The client's handle, once there was a connection to the present address.
    pub(super) robot: watch::Sender<Option<Robot>>,
    /// Wakes the task that keeps the connection.
    pub(super) try_now: Notify,
    /// Wakes the task that writes down.
    pub(super) to_write: Notify,
    /// Wakes those who wait until that task has written.
    pub(super) wrote: Notify,
    pub(super) commands: Semaphore,
    /// Queries that somebody waits for.
    pub(super) queries: Semaphore,
    /// Stops and commands that stop have places of their own: a stop must not wait for pauses.
    pub(super) stops: Semaphore,
    pub(super) stop_commands: Semaphore,
    /// The connection over which the robot last said who it is, plus one; 0 before that.
    introduced_on: AtomicU64,
    /// Whether a robot has said who it is at this address since the start.
    is_met: AtomicBool,
    /// The connection over which the robot answers, for clients that must not outlive it.
    pub(crate) link: watch::Sender<Option<u64>>,
    /// The last run, as it stands.
    pub(super) runs: watch::Sender<Option<Run>>,
    /// Locked while a run begins, until it is in the store: the same request that comes twice at once finds
    /// it there.
    pub(super) beginning: AsyncMutex<()>,
    /// What cut the run short that has the robot.
    pub(super) cut: watch::Sender<Option<(Ticket, Cut)>>,
    /// Which readings show the effect of all commands.
    fresh: Mutex<Freshness>,
    /// Locked while a query of a raw client is under way: those behind it may be answered by its values.
    pub(crate) asking: AsyncMutex<()>,
    /// Locked while the seat is saved, so that an older state never overwrites a newer one.
    saving: AsyncMutex<()>,
    /// The records that wait for the audit log.
    pending: Arc<Pending>,
    /// Which refusals and repeated stops stand in the audit log.
    refusals: Mutex<Refusals>,
    /// Which stops that were not confirmed stand in it. Refusals do not push them out.
    unconfirmed: Mutex<Refusals>,
}

#[derive(Debug)]
struct Held {
    seat: Seat,
    /// The permission of all permits of this generation that rest on the lease.
    permission: Permission,
    /// The same of those that rest on a standing grant.
    standing: Permission,
    /// What the store has of the seat.
    stored: Saved,
    /// The lease that was given back last, and by whom: its end may come later, after a run of it.
    given_back: Option<(u64, By)>,
}

impl Station {
    /// A robot as it was saved.
    #[must_use]
    pub fn new(config: RobotConfig, saved: Kept, term: Term, shared: Arc<Shared>) -> Self {
        let Kept { seat: saved, alarms } = saved;
        // More microseconds pass between two begins of a robot than it has stops in between.
        let begun = u64::try_from(clock::system().0).unwrap_or_default();
        let mut seat = Seat::new(saved.clone(), FRESH_FOR).with_stops_behind(begun);
        if config.twin_of.is_some() {
            // The process has just started it.
            seat.forget_identity();
        }
        let held = Held {
            seat,
            permission: Permission::new(),
            standing: Permission::new(),
            stored: saved,
            given_back: None,
        };
        Self {
            name: config.name.clone(),
            board: Mutex::new(shared.new_board(&config)),
            config: Mutex::new(config),
            term,
            shared,
            counts: Counts::default(),
            held: Mutex::new(held),
            desk: Desk::new(alarms),
            cameras: Cameras::default(),
            robot: watch::Sender::new(None),
            try_now: Notify::new(),
            to_write: Notify::new(),
            wrote: Notify::new(),
            refusals: Mutex::default(),
            unconfirmed: Mutex::default(),
            commands: Semaphore::new(MAX_COMMANDS as usize),
            queries: Semaphore::new(MAX_QUERIES),
            stops: Semaphore::new(MAX_STOPS as usize),
            stop_commands: Semaphore::new(MAX_STOPS as usize),
            introduced_on: AtomicU64::new(0),
            is_met: AtomicBool::new(false),
            link: watch::Sender::new(None),
            runs: watch::Sender::new(None),
            beginning: AsyncMutex::default(),
            cut: watch::Sender::new(None),
            fresh: Mutex::default(),
            asking: AsyncMutex::default(),
            saving: AsyncMutex::default(),
            pending: Arc::default(),
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        self.name.as_str()
    }

    /// Its name, as the store has it.
    pub(crate) fn robot_name(&self) -> &RobotName {
        &self.name
    }

    /// How it is configured now.
    #[must_use]
    pub fn config(&self) -> RobotConfig {
        self.config.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Configures it anew. The caller has ended the task that keeps the connection, and starts another one.
    pub(super) fn configure(&self, config: RobotConfig) {
        if config.twin_of.is_some() {
            // It is another virtual controller, perhaps of another model, that has just been started.
            self.seat(|seat, _| seat.forget_identity());
        }
        if self.config().address != config.address {
            self.is_met.store(false, Ordering::SeqCst);
        }
        // Before the board: who sees the new values is told their periods.
        *self.config.lock().unwrap_or_else(PoisonError::into_inner) = config.clone();
        {
            // Its number is drawn under the lock.
            let mut board = self.board();
            *board = self.shared.new_board(&config);
        }
        self.shared.wake_readers();
    }

    /// Over this connection the robot said who it is; `None`: over none yet.
    pub(super) fn introduced(&self, connection: Option<u64>) {
        let number = connection.map_or(0, |connection| connection.saturating_add(1));
        self.introduced_on.store(number, Ordering::SeqCst);
        if let Some(connection) = connection {
            self.is_met.store(true, Ordering::SeqCst);
            self.tell_held_photos(connection);
        }
    }

    /// Who answers over this connection.
    pub(super) fn answers(&self, connection: u64) -> Answers {
        // Before the seat: what the robot says goes there first.
        let introduced_on = self.introduced_on.load(Ordering::SeqCst);
        if self.seat(|seat, _| seat.identity_change().is_some()) {
            return Answers::Another;
        }
        match introduced_on.cmp(&connection.saturating_add(1)) {
            Less => Answers::Unknown,
            Equal => Answers::This,
            Greater => Answers::Gone,
        }
    }

    /// Whether values of this connection are those of this robot. A robot of which nothing is known yet has
    /// no other to be taken for.
    pub(super) fn source_of(&self, connection: u64) -> Source {
        match self.answers(connection) {
            Answers::This => Source::This,
            Answers::Another => Source::Doubtful,
            Answers::Unknown | Answers::Gone if self.seat(|seat, _| seat.is_identified()) => Source::Doubtful,
            Answers::Unknown | Answers::Gone => Source::This,
        }
    }

    /// Uses the seat. If permits became void, the commands that have not left yet are taken back before this
    /// returns.
    pub(crate) fn seat<T>(&self, act: impl FnOnce(&mut Seat, Instant) -> T) -> T {
        self.seat_noting(|seat, now| (act(seat, now), None))
    }

    /// The same, with a record that is noted before anybody else uses the seat.
    pub(super) fn seat_noting<T>(
        &self,
        act: impl FnOnce(&mut Seat, Instant) -> (T, Option<AuditRecord>),
    ) -> T {
        self.hold(|held, now| act(&mut held.seat, now))
    }

    fn hold<T>(&self, act: impl FnOnce(&mut Held, Instant) -> (T, Option<AuditRecord>)) -> T {
        let mut held = self.held();
        let now = clock::now();
        let generations = [Ground::Lease, Ground::Grant].map(|ground| held.seat.generation(ground));
        let was_stopped = held.seat.stops().0;
        held.seat.handle_timeout(now);
        let (result, record) = act(&mut held, now);
        if held.seat.stops().0 && !was_stopped && held.seat.saved().stopped_by.is_none() {
            // A stop of a caller has its name already. Without one, the gateway lets a stop hold.
            let by = by_itself();
            held.seat.name_stop(&by.acts());
            let number = held.seat.stop_is_told();
            self.publish(Happened::StopBegan { by: by.actor, holds: true, number });
            self.publish(Happened::StopEnded { confirmed: false });
        }
        let [of_lease, of_grant] = generations;
        if held.seat.generation(Ground::Lease) != of_lease {
            std::mem::take(&mut held.permission).withdraw();
        }
        if held.seat.generation(Ground::Grant) != of_grant {
            std::mem::take(&mut held.standing).withdraw();
        }
        let cut = held.seat.run_cut();
        self.cut.send_if_modified(|known| std::mem::replace(known, cut) != cut);
        let link = held.seat.connection();
        self.link.send_if_modified(|known| std::mem::replace(known, link) != link);
        let mut writes = held.seat.saved() != &held.stored;
        while let Some(noticed) = held.seat.poll_noticed() {
            writes |= self.tell(&mut held, noticed);
        }
        if let Some(record) = record {
            self.pending.push(record);
            writes = true;
        }
        drop(held);
        if writes {
            self.to_write.notify_one();
        }
        result
    }

    /// Gives the lease back. The entry about its end names this caller, who has its secret: this need not be
    /// the holder.
    pub(super) fn release_by(&self, by: &By, key: Key) -> Result<(), Denied> {
        self.hold(|held, now| {
            let released = held.seat.release(now, key);
            if released.is_ok() {
                held.given_back = Some((key.number, by.clone()));
            }
            (released, None)
        })
    }

    /// A command or a stop is about to leave. It is over when the returned value is dropped.
    pub(super) fn sending(&self) -> Sending<'_> {
        self.fresh().begins();
        Sending(self)
    }

    /// Which readings show the effect of all commands.
    pub(crate) fn fresh(&self) -> MutexGuard<'_, Freshness> {
        self.fresh.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the robot here at once: nothing is permitted any more, and there is no connection.
    pub(super) fn cut(&self, cause: LeaseEnd) {
        self.seat(|seat, _| seat.close(cause));
        if let Some(robot) = self.robot.send_replace(None) {
            robot.disconnect();
        }
    }

    /// The client's handle, if there ever was a connection to the present address.
    pub(crate) fn robot(&self) -> Option<Robot> {
        self.robot.borrow().clone()
    }

    /// The permission of this permit; `None` if it is void.
    pub(super) fn permission(&self, permit: &Permit) -> Option<Permission> {
        let held = self.held();
        let permission = match permit.ground() {
            Ground::Lease => &held.permission,
            Ground::Grant => &held.standing,
        };
        (held.seat.generation(permit.ground()) == permit.generation()).then(|| permission.clone())
    }

    /// Publishes an event.
    pub(super) fn publish(&self, happened: Happened) {
        self.publish_of(clock::time_of_day(), happened);
    }

    /// Publishes an event of this time.
    pub(super) fn publish_of(&self, time: String, happened: Happened) {
        self.shared.news.add(time, self.name(), happened);
    }

    /// Publishes what the seat noticed. Returns whether there is something to write.
    fn tell(&self, held: &mut Held, noticed: Noticed) -> bool {
        let robot = self.name();
        let mut by = by_itself();
        let (happened, deed) = match noticed {
            Noticed::LeaseBegan { number, holder } => {
                tracing::info!(robot, lease = number, %holder, "a lease began");
                // Its record is written before it is given out.
                (Happened::LeaseBegan { lease: number, holder }, None)
            }
            Noticed::LeaseEnded { number, holder, cause } => {
                tracing::info!(robot, lease = number, %holder, ?cause, "a lease ended");
                let given_back = held.given_back.take_if(|(lease, _)| *lease == number);
                if let Some((_, caller)) = given_back.filter(|_| cause == LeaseEnd::Released) {
                    by = caller;
                }
                let deed = Deed::LeaseEnded { lease: number, holder: holder.clone(), cause };
                (Happened::LeaseEnded { lease: number, holder, cause }, Some(deed))
            }
            Noticed::IdentityChanged(change) => {
                let (expected, found) = (shown(&change.expected), shown(&change.found));
                tracing::warn!(robot, expected, found, "another robot answers: its commands are refused");
                (Happened::IdentityChanged(change.clone()), Some(Deed::IdentityChanged(change)))
            }
            Noticed::LinkUp => {
                tracing::info!(robot, address = self.config().address, "the robot answers");
                (Happened::LinkUp {}, None)
            }
            Noticed::LinkDown => {
                tracing::warn!(
                    robot,
                    address = self.config().address,
                    "there is no connection to the robot any more"
                );
                (Happened::LinkDown {}, None)
            }
            Noticed::GlobalSpeed(set) => (Happened::GlobalSpeed { set }, None),
        };
        self.publish(happened);
        let writes = deed.is_some();
        deed.into_iter().for_each(|deed| self.pending.push(self.record(&by, deed)));
        writes
    }

    /// Its values.
    pub(super) fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that the robot can be seen from now on. To be called under the lock of the list of robots.
    pub(super) fn appear(&self) {
        let mut board = self.board();
        board.bear(self.shared.draw());
    }
}

/// A robot by what it says of itself, for the log.
fn shown(identity: &RobotIdentity) -> String {
    let RobotIdentity { firmware, machine_name, axis_count } = identity;
    let text = |text: &Option<String>| text.clone().unwrap_or_else(|| "?".to_owned());
    let axes = axis_count.map_or_else(|| "?".to_owned(), |axes| axes.to_string());
    format!("{}, firmware {}, {axes} axes", text(machine_name), text(firmware))
}

/// A command or a stop that is under way.
#[must_use = "it is over when this is dropped"]
pub(super) struct Sending<'s>(&'s Station);

impl Drop for Sending<'_> {
    fn drop(&mut self) {
        self.0.fresh().ends(clock::now());
    }
}

/// Whole milliseconds.
pub(super) fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
