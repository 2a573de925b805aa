//! Properties of a seat, whatever the interleaving of its callers.

use proptest::prelude::*;
use r6_proto::Command;
use r6_proto::message::instruction::PathSpeed;
use r6_proto::message::{Action, Instruction, Point};

use super::*;
use crate::core::camera::{Camera, standing};
use crate::core::order::Order;

/// Something that a caller, the robot or the clock does.
#[derive(Clone, Debug)]
enum Step {
    Wait {
        ms: u64,
    },
    Acquire {
        lasts_s: u64,
    },
    /// With the key of an earlier lease, or a made-up one.
    Renew {
        which: usize,
    },
    Release {
        which: usize,
    },
    Take,
    StopBegins,
    StopEnds,
    Clear {
        which: usize,
    },
    Answers {
        robot: u8,
    },
    Accept,
    Observed {
        manual: bool,
    },
    LinkLost,
    Reconfigured,
    Closed,
    Command {
        which: usize,
        moves: bool,
    },
    BeginRun {
        which: usize,
    },
    /// Of the run that is under way, or of an earlier one.
    List {
        back: usize,
    },
    EndRun {
        left: Left,
    },
    OwedStopMade {
        confirmed: bool,
    },
    /// A camera with a grant for camera 0 sends something as this one.
    Camera {
        number: u16,
        photo: bool,
    },
    GrantRevoked,
    Restart,
}

fn step() -> impl Strategy<Value = Step> {
    let which = 0..4_usize;
    prop_oneof![
        3 => (0..4_000_u64).prop_map(|ms| Step::Wait { ms }),
        3 => (0..20_u64).prop_map(|lasts_s| Step::Acquire { lasts_s }),
        2 => which.clone().prop_map(|which| Step::Renew { which }),
        1 => which.clone().prop_map(|which| Step::Release { which }),
        1 => Just(Step::Take),
        1 => Just(Step::StopBegins),
        2 => Just(Step::StopEnds),
        2 => which.clone().prop_map(|which| Step::Clear { which }),
        1 => (0..8_u8).prop_map(|robot| Step::Answers { robot: robot / 7 }),
        1 => Just(Step::Accept),
        4 => (0..8_u8).prop_map(|mode| Step::Observed { manual: mode == 0 }),
        1 => Just(Step::LinkLost),
        1 => Just(Step::Reconfigured),
        1 => (0..8_u8).prop_map(|number| if number == 0 { Step::Closed } else { Step::LinkLost }),
        6 => (which.clone(), any::<bool>()).prop_map(|(which, moves)| Step::Command { which, moves }),
        4 => which.prop_map(|which| Step::BeginRun { which: which / 3 }),
        5 => (0..8_usize).prop_map(|back| Step::List { back: back / 6 }),
        2 => (0..6_u8).prop_map(|left| Step::EndRun { left: match left {
            0 => Left::NotStopped,
            1 => Left::OutOfReach,
            _ => Left::Nothing,
        } }),
        1 => any::<bool>().prop_map(|confirmed| Step::OwedStopMade { confirmed }),
        5 => (0..8_u16, any::<bool>()).prop_map(|(camera, photo)| Step::Camera { number: camera / 7, photo }),
        1 => Just(Step::GrantRevoked),
        1 => Just(Step::Restart),
    ]
}

const STEP: Instruction =
    Instruction { oneshot: true, action: Action::PathSpeed(PathSpeed { in_use: false, speed: None }) };

const FRESH_FOR: Duration = Duration::from_secs(2);

fn robot(number: u8) -> RobotIdentity {
    RobotIdentity { machine_name: Some(format!("robot {number}")), ..RobotIdentity::default() }
}

/// What the callers saw: the plain opposite of the seat.
#[derive(Debug, Default)]
struct Model {
    /// Every lease that was given out: its key and when it ends; `None` once it has ended.
    leases: Vec<(Key, Option<Instant>)>,
    /// The last stop was not cleared.
    stopped: bool,
    stops_under_way: u32,
    seen: Option<(Instant, bool)>,
    expected: Option<u8>,
    answers: Option<u8>,
    closed: bool,
    /// Permits that were given out: their generations.
    permits: Vec<u64>,
    /// The same of cameras.
    of_cameras: Vec<u64>,
    /// The tickets that were given out, the latest last.
    tickets: Vec<Ticket>,
    /// The run that has the robot.
    run: Option<ModelRun>,
    /// A lease that has ended and waits for the end of its run.
    waiting: Option<u64>,
    owes_stop: bool,
}

#[derive(Debug)]
struct ModelRun {
    key: Key,
    cut: bool,
    elsewhere: bool,
}

impl Model {
    fn live(&self, now: Instant) -> Vec<Key> {
        let is_live = |until: &Option<Instant>| until.is_some_and(|until| now < until);
        self.leases.iter().filter(|(_, until)| is_live(until)).map(|(key, _)| *key).collect()
    }

    fn end_all(&mut self) {
        self.leases.iter_mut().for_each(|(_, until)| *until = None);
        self.waiting = None;
        self.cut();
    }

    fn cut(&mut self) {
        self.run.iter_mut().for_each(|run| run.cut = true);
    }

    /// A lease that is over waits if its run is under way.
    fn look(&mut self, now: Instant) {
        let Some(run) = &mut self.run else { return };
        let lease = self.leases.iter_mut().find(|(key, _)| key.number == run.key.number);
        let Some((key, until)) = lease else { return };
        if until.is_some_and(|until| until <= now) {
            (*until, self.waiting, run.cut) = (None, Some(key.number), true);
        }
    }

    /// Whether the robot can get something that moves from this caller.
    fn may_move(&self, now: Instant, key: Key) -> bool {
        self.holds(now, key) && self.is_fit(now)
    }

    /// Whether the robot can get something that moves.
    fn is_fit(&self, now: Instant) -> bool {
        let seen = self.seen.is_some_and(|(at, manual)| now.since(at) <= FRESH_FOR && !manual);
        self.stops_under_way == 0
            && !self.stopped
            && !self.is_stranger()
            && !self.closed
            && !self.owes_stop
            && seen
    }

    fn is_stranger(&self) -> bool {
        self.expected.is_some() && self.answers.is_some() && self.expected != self.answers
    }

    /// One of the keys that were given out, the newest first, or a key that was never given out.
    fn key(&self, which: usize) -> Key {
        let given = self.leases.iter().rev().nth(which).map(|(key, _)| *key);
        given.unwrap_or(Key { number: self.leases.len() as u64, secret: Secret([0; 16]) })
    }

    fn holds(&self, now: Instant, key: Key) -> bool {
        let fits = |live: &Key| live.number == key.number && live.secret.0 == key.secret.0;
        self.live(now).iter().any(fits)
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    /// Never two live leases; numbers only grow; nothing moves after a stop until it is cleared; no permit
    /// for another robot, in manual mode, or for a robot that was not seen lately. None without the lease but
    /// for what a camera sends, and that needs its grant: the lease permits none of it, a grant nothing else.
    /// The end of a lease does not touch it. A stop, a revoked grant and all else that voids permits do.
    #[test]
    fn a_permit_needs_all_that_it_stands_for(steps in prop::collection::vec(step(), 1..80)) {
        let mut now = Instant::ORIGIN + Duration::from_secs(1);
        let mut seat = Seat::new(Saved::default(), FRESH_FOR);
        let mut model = Model::default();
        for (number, step) in (1_u128..).zip(steps) {
            let ask = |lasts: u64| Ask {
                holder: "one".to_owned(),
                lasts: Duration::from_secs(lasts),
                secret: Secret(number.to_be_bytes()),
            };
            match step {
                Step::Wait { ms } => {
                    now += Duration::from_millis(ms);
                    if ms % 2 == 0 {
                        seat.handle_timeout(now);
                    }
                    model.look(now);
                }
                Step::Acquire { lasts_s } => {
                    let free = model.live(now).is_empty()
                        && model.waiting.is_none()
                        && !model.is_stranger()
                        && !model.closed;
                    let granted = seat.acquire(now, ask(lasts_s));
                    prop_assert_eq!(granted.is_ok(), free, "{:?}", granted);
                    if let Ok(granted) = granted {
                        prop_assert!(model.leases.last().is_none_or(|(key, _)| key.number < granted.key.number));
                        let lasts = granted.until.since(now);
                        prop_assert!((SHORTEST_LEASE..=LONGEST_LEASE).contains(&lasts));
                        model.leases.push((granted.key, Some(granted.until)));
                    }
                }
                Step::Renew { which } => {
                    let key = model.key(which);
                    let renewed = seat.renew(now, key, USUAL_LEASE);
                    prop_assert_eq!(renewed.is_ok(), model.holds(now, key));
                    if let Ok(granted) = renewed {
                        let lease = model.leases.iter_mut().find(|(given, _)| given.number == key.number);
                        lease.unwrap().1 = Some(granted.until);
                    }
                }
                Step::Release { which } => {
                    let key = model.key(which);
                    let held = model.holds(now, key);
                    prop_assert_eq!(seat.release(now, key).is_ok(), held);
                    let has_run = model.run.as_ref().is_some_and(|run| run.key.number == key.number);
                    if held {
                        model.leases.iter_mut().for_each(|(_, until)| *until = None);
                    }
                    if held && has_run {
                        model.waiting = Some(key.number);
                        model.cut();
                    }
                }
                Step::Take => {
                    let begun = seat.begin_taking(now);
                    prop_assert_eq!(begun.is_ok(), !model.is_stranger() && !model.closed);
                    if begun.is_err() {
                        continue;
                    }
                    model.end_all();
                    seat.stop_begins();
                    model.stopped = true;
                    // Meanwhile no other caller gets it.
                    prop_assert!(seat.acquire(now, ask(3)).is_err());
                    prop_assert!(seat.begin_taking(now).is_err());
                    seat.stop_ends();
                    let granted = seat.end_taking(now, ask(5)).unwrap();
                    prop_assert!(model.leases.last().is_none_or(|(key, _)| key.number < granted.key.number));
                    model.leases.push((granted.key, Some(granted.until)));
                }
                Step::StopBegins => {
                    seat.stop_begins();
                    (model.stopped, model.stops_under_way) = (true, model.stops_under_way + 1);
                    model.cut();
                }
                Step::StopEnds => {
                    seat.stop_ends();
                    model.stops_under_way = model.stops_under_way.saturating_sub(1);
                }
                Step::Clear { which } => {
                    let key = model.key(which);
                    let clears = model.holds(now, key) && model.stops_under_way == 0;
                    prop_assert_eq!(seat.clear(now, key, None).is_ok(), clears);
                    model.stopped &= !clears;
                }
                Step::Answers { robot: number } => {
                    seat.identified(robot(number));
                    model.answers = Some(number);
                    model.expected.get_or_insert(number);
                    if model.is_stranger() {
                        model.end_all();
                    }
                }
                Step::Accept => {
                    let answers = model.answers.unwrap_or(9);
                    prop_assert_eq!(seat.accept_identity(&robot(answers)).is_ok(), model.is_stranger());
                    model.owes_stop &= !model.is_stranger();
                    let is_another = model.is_stranger();
                    model.run.iter_mut().for_each(|run| run.elsewhere |= is_another);
                    model.expected = model.answers.or(model.expected);
                }
                Step::Observed { manual } => {
                    seat.observed(now, 1, manual);
                    model.seen = Some((now, manual));
                }
                Step::LinkLost => {
                    let was_up = model.seen.is_some();
                    seat.link_lost();
                    if was_up {
                        model.cut();
                    }
                    model.seen = None;
                }
                Step::Reconfigured => {
                    // The shell stops a run over the connection that it has.
                    seat.will_be_reconfigured();
                    let key = model.key(0);
                    prop_assert!(seat.acquire(now, ask(3)).is_err() && seat.begin_run(now, key).is_err());
                    let order = Order::from(Command::ModifyGspd { percent: 5.0 });
                    prop_assert!(seat.permit(now, key, order).is_err());
                    seat.reconfigured();
                    model.end_all();
                    (model.seen, model.answers) = (None, None);
                }
                Step::Closed => {
                    seat.close(LeaseEnd::Removed);
                    model.end_all();
                    model.closed = true;
                }
                Step::Command { which, moves } => {
                    let key = model.key(which);
                    let order = match (moves, number % 2) {
                        (true, 0) => Order::from(Command::StartButton),
                        (true, _) => Order::List { replace: false, steps: vec![STEP] },
                        (false, 0) => Command::ModifyGspd { percent: 5.0 }.into(),
                        (false, _) => Order::List { replace: true, steps: Vec::new() },
                    };
                    // With an even number it is a start or a change of the speed, else a list.
                    let is_cut = model.run.as_ref().is_some_and(|run| run.cut);
                    let is_busy = is_cut || model.run.is_some() && (moves || number % 2 == 1);
                    let permit = seat.permit(now, key, order);
                    let seen = model.seen.is_some_and(|(at, manual)| now.since(at) <= FRESH_FOR && !manual);
                    let is_stopped = model.stops_under_way > 0 || moves && model.stopped;
                    let permitted = model.holds(now, key)
                        && !is_stopped
                        && !model.is_stranger()
                        && !model.closed
                        && !model.owes_stop
                        && !is_busy
                        && seen;
                    prop_assert_eq!(permit.is_ok(), permitted, "{:?}", permit);
                    if let Ok(permit) = permit {
                        prop_assert_eq!(permit.generation(), seat.generation(Ground::Lease));
                        let until = model.leases.iter().rev().find_map(|(_, until)| *until).unwrap();
                        prop_assert!(now <= permit.latest() && permit.latest() <= until);
                        model.permits.push(permit.generation());
                    }
                }
                Step::Camera { number: camera, photo } => {
                    let fits = camera == 0 && model.run.is_none() && model.is_fit(now);
                    let camera = Camera::new(camera.into()).unwrap();
                    let order = if photo {
                        Order::Photo { camera, taken: true }
                    } else {
                        Order::Points { camera, points: vec![Point::default()] }
                    };
                    // Not even the holder of the lease sends it without the grant.
                    prop_assert!(seat.permit(now, model.key(0), order.clone()).is_err());
                    let asked = seat.asked_by_camera(now);
                    let permit = seat.permit_granted(now, standing(0), order);
                    prop_assert_eq!(permit.is_ok(), fits, "{:?}", permit);
                    if let Ok(permit) = permit {
                        prop_assert_eq!(permit.generation(), seat.generation(Ground::Grant));
                        prop_assert!(now <= permit.latest());
                        model.of_cameras.push(permit.generation());
                        prop_assert!(asked.admit(now, permit).is_ok());
                    }
                    let command = Order::from(Command::StartButton);
                    prop_assert!(seat.permit_granted(now, standing(0), command).is_err());
                }
                Step::GrantRevoked => {
                    let before = seat.generation(Ground::Lease);
                    seat.grant_is_revoked();
                    prop_assert!(!model.of_cameras.contains(&seat.generation(Ground::Grant)));
                    prop_assert_eq!(seat.generation(Ground::Lease), before);
                }
                Step::BeginRun { which } => {
                    let key = model.key(which);
                    let begins = model.may_move(now, key) && model.run.is_none();
                    let begun = seat.begin_run(now, key);
                    prop_assert_eq!(begun.is_ok(), begins, "{:?}", begun);
                    if let Ok(ticket) = begun {
                        prop_assert!(!model.tickets.contains(&ticket));
                        prop_assert!(!model.permits.contains(&seat.generation(Ground::Lease)), "of before the run");
                        model.tickets.push(ticket);
                        model.run = Some(ModelRun { key, cut: false, elsewhere: false });
                    }
                }
                Step::List { back } => {
                    let Some(ticket) = model.tickets.iter().rev().nth(back).copied() else { continue };
                    let run = model.run.as_ref().filter(|run| back == 0 && !run.cut);
                    let permitted = run.is_some_and(|run| model.may_move(now, run.key));
                    let list = Order::List { replace: number % 2 == 0, steps: vec![STEP] };
                    let permit = seat.permit_list(now, ticket, list);
                    prop_assert_eq!(permit.is_ok(), permitted, "{:?}", permit);
                    if let Ok(permit) = permit {
                        prop_assert_eq!(permit.generation(), seat.generation(Ground::Lease));
                        let until = model.leases.iter().rev().find_map(|(_, until)| *until).unwrap();
                        prop_assert!(now <= permit.latest() && permit.latest() <= until);
                        model.permits.push(permit.generation());
                    }
                }
                Step::EndRun { left } => {
                    let Some(ticket) = model.tickets.last().copied() else { continue };
                    let is_cut = seat.cut(ticket).is_some();
                    prop_assert_eq!(is_cut, model.run.as_ref().is_some_and(|run| run.cut));
                    let owes = left == Left::OutOfReach && model.run.as_ref().is_some_and(|run| !run.elsewhere);
                    if number % 2 == 0 {
                        seat.leave(ticket, left);
                        prop_assert_eq!(seat.owes_stop(), model.owes_stop || owes);
                        // It was said: what is said later does not count.
                        seat.end_run(ticket, Left::NotStopped);
                    } else {
                        seat.end_run(ticket, left);
                    }
                    if model.run.take().is_some() {
                        model.stopped |= left == Left::NotStopped;
                        model.owes_stop |= owes;
                        model.waiting = None;
                    }
                    prop_assert!(!seat.has_run());
                }
                Step::OwedStopMade { confirmed } => {
                    let can = model.owes_stop && model.seen.is_some() && !model.is_stranger() && !model.closed;
                    prop_assert_eq!(seat.can_make_owed_stop(), can);
                    if can {
                        seat.owed_stop_made(confirmed);
                        model.owes_stop = false;
                        model.stopped |= !confirmed;
                    }
                }
                Step::Restart => {
                    seat = Seat::new(seat.saved().clone(), FRESH_FOR);
                    // As the store tells the next start.
                    if model.run.is_some() || model.owes_stop {
                        seat.owe_stop();
                        model.owes_stop = true;
                    }
                    (model.run, model.tickets) = (None, Vec::new());
                    model.end_all();
                    (model.seen, model.answers, model.stops_under_way) = (None, None, 0);
                    model.closed = false;
                    model.permits.clear();
                    model.of_cameras.clear();
                }
            }
            let live = model.live(now);
            prop_assert!(live.len() <= 1, "{:?}", live);
            let seen = live.first().map(|key| key.number).or(model.waiting);
            prop_assert_eq!(seat.lease(now).map(|lease| lease.number), seen);
            prop_assert_eq!(seat.stops().0, model.stopped);
            // Permits of a lease that has ended, or from before a stop, are void, once the seat knows the
            // time.
            seat.handle_timeout(now);
            // Those of cameras are void as soon as no camera would get one, but for a mode that was read or a
            // reading that is old: these are looked at when it is sent.
            if model.stopped || model.is_stranger() || model.closed || model.seen.is_none() || model.run.is_some()
            {
                prop_assert!(!model.of_cameras.contains(&seat.generation(Ground::Grant)), "{:?}", model.of_cameras);
            }
            if live.is_empty() || model.stops_under_way > 0 || model.is_stranger() || model.closed {
                prop_assert!(!model.permits.contains(&seat.generation(Ground::Lease)), "{:?}", model.permits);
            }
        }
    }
}

#[test]
fn a_part_of_an_identity_that_was_not_read_is_no_change_and_is_added_later() {
    let mut seat = Seat::new(Saved::default(), FRESH_FOR);
    let part = RobotIdentity { firmware: Some("7".to_owned()), ..RobotIdentity::default() };
    seat.identified(part.clone());
    let whole = RobotIdentity { machine_name: Some("press".to_owned()), axis_count: Some(6), ..part };
    seat.identified(whole.clone());
    assert_eq!((seat.identity_change(), seat.saved().identity.clone()), (None, Some(whole.clone())));
    let other = RobotIdentity { axis_count: Some(4), ..whole.clone() };
    seat.identified(other.clone());
    assert_eq!(seat.identity_change(), Some(IdentityChange { expected: whole.clone(), found: other }));
    // The cable is put back.
    seat.identified(whole);
    assert_eq!(seat.identity_change(), None);
}

fn held() -> (Instant, Seat, Key) {
    let now = Instant::ORIGIN + Duration::from_secs(1);
    let mut seat = Seat::new(Saved::default(), FRESH_FOR);
    seat.observed(now, 1, false);
    let ask = Ask { holder: "one".to_owned(), lasts: SHORTEST_LEASE, secret: Secret([1; 16]) };
    let key = seat.acquire(now, ask).unwrap().key;
    (now, seat, key)
}

#[test]
fn a_lease_that_expires_stays_with_its_holder_until_the_arm_stands() {
    let (now, mut seat, key) = held();
    let ticket = seat.begin_run(now, key).unwrap();
    let late = now + SHORTEST_LEASE;
    seat.handle_timeout(late);
    assert_eq!(seat.cut(ticket), Some(Cut::Lease(LeaseEnd::Expired)));
    let ask = Ask { holder: "two".to_owned(), lasts: SHORTEST_LEASE, secret: Secret([2; 16]) };
    assert_eq!(seat.acquire(late, ask.clone()).unwrap_err(), Denied::RunEnding);
    assert_eq!(seat.renew(late, key, USUAL_LEASE).unwrap_err(), Denied::NoLease);
    seat.end_run(ticket, Left::Nothing);
    assert!(seat.acquire(late, ask).is_ok());
    assert!(!seat.stops().0, "the next holder can move the arm");
}

#[test]
fn what_a_run_leaves_is_dealt_with_before_the_run_is_over() {
    let (now, mut seat, key) = held();
    let ticket = seat.begin_run(now, key).unwrap();
    seat.link_lost();
    // It answers again while the gateway still ends the run.
    seat.observed(now, 2, false);
    let order = Order::from(Command::ModifyGspd { percent: 5.0 });
    assert_eq!(seat.permit(now, key, order.clone()).unwrap_err(), Denied::ListLeft);
    assert!(!seat.can_make_owed_stop(), "it may still be stopped");
    seat.leave(ticket, Left::OutOfReach);
    assert!(seat.can_make_owed_stop());
    seat.owed_stop_made(true);
    assert_eq!(seat.permit(now, key, order.clone()).unwrap_err(), Denied::ListLeft);
    seat.end_run(ticket, Left::OutOfReach);
    assert!(!seat.owes_stop(), "one stop is enough");
    assert!(seat.permit(now, key, order).is_ok());
}

#[test]
fn a_robot_that_comes_out_of_reach_after_a_stop_was_asked_for_is_owed_one() {
    let (now, mut seat, key) = held();
    let ticket = seat.begin_run(now, key).unwrap();
    seat.stop_begins();
    assert_eq!(seat.cut(ticket), Some(Cut::Stop));
    seat.link_lost();
    assert_eq!(seat.cut(ticket), Some(Cut::LinkLost));
    seat.end_run(ticket, Left::OutOfReach);
    seat.stop_ends();
    assert!(seat.owes_stop() && !seat.can_make_owed_stop());
    seat.observed(now, 2, false);
    seat.clear(now, key, None).unwrap();
    let order = Order::from(Command::ModifyGspd { percent: 5.0 });
    assert_eq!(seat.permit(now, key, order.clone()).unwrap_err(), Denied::ListLeft);
    assert!(seat.can_make_owed_stop());
    seat.owed_stop_made(true);
    assert!(seat.permit(now, key, order).is_ok());
}

#[test]
fn what_a_camera_sends_outlives_a_lease_and_no_stop() {
    let (now, mut seat, key) = held();
    let camera = Camera::new(0).unwrap();
    let order = Order::Points { camera, points: vec![Point::default()] };
    let permit = |seat: &mut Seat| seat.permit_granted(now, standing(0), order.clone());
    let is_void = |seat: &Seat, permit: &Permit| seat.generation(permit.ground()) != permit.generation();
    let of_camera = permit(&mut seat).unwrap();
    let of_lease = seat.permit(now, key, Command::StartButton).unwrap();
    seat.release(now, key).unwrap();
    assert!(is_void(&seat, &of_lease) && !is_void(&seat, &of_camera));
    seat.stop_begins();
    assert!(is_void(&seat, &of_camera));
    assert_eq!(permit(&mut seat).unwrap_err(), Denied::Stopped);
    assert_eq!(
        seat.permit_granted(now, standing(1), order.clone()).unwrap_err(),
        Denied::NoGrant,
        "the grant is for another camera"
    );
}
