//! Worlds with a gateway: a hall with robots, one gateway before them, and its callers.

use std::time::Duration;

use r6_controller::fault::{Fault, LinkFault, TaskFault};
use r6_controller::scenario::{Scenario, Window};
use r6_traffic::random::Random;

use super::{Blow, CALM, Drivers, Plan, RobotPlan, ms};
use crate::fault::Class;

/// How long a robot is slow (G1).
const SLOW_FOR: Duration = Duration::from_secs(30);

/// After a fault of a robot or of the gateway, values may need this long to be fresh again: the longest wait
/// between two attempts to connect is 5 s, and a connection needs some round trips.
const SETTLES: Duration = Duration::from_secs(9);

/// What a caller of the gateway does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Reads all robots again and again, and shows at the end that everything works. It has the role admin.
    Inspector,
    /// Has a token that may only read, and tries what it may not do.
    Viewer,
    /// Takes, renews and loses the lease of its robot, and commands it.
    Operator,
    /// Stops robots.
    Stopper,
    /// Takes the lease of its robot from others.
    Admin,
    /// Adds, changes and removes a robot while the gateway runs (G6).
    Engineer,
    /// Follows the values, and for a time reads nothing (G5).
    Reader,
    /// Sends what no client of good will sends (G13).
    Hostile,
}

/// A caller of the gateway.
#[derive(Clone, Copy, Debug)]
pub struct CallerPlan {
    /// What it does.
    pub part: Part,
    /// Its robot.
    pub robot: usize,
    /// The seed for its random numbers.
    pub seed: u64,
}

/// The gateway and its callers.
#[derive(Clone, Debug)]
pub struct HallPlan {
    /// How often the gateway reads each robot.
    pub periods: Vec<Duration>,
    /// The callers. The first is the inspector.
    pub callers: Vec<CallerPlan>,
    /// The robot that is not in the configuration of the gateway: the engineer adds it.
    pub added: Option<usize>,
    /// When values of each robot cannot be expected, because of a fault of its own.
    pub unsound: Vec<Vec<(Duration, Duration)>>,
    /// When the first robot answers hardly or not at all (G1).
    pub slow: Option<(Duration, Duration)>,
    /// When nothing can be expected of the gateway.
    pub away: Vec<(Duration, Duration)>,
}

impl HallPlan {
    /// Whether the plan has no reason why the gateway should not answer, or not have the values of a robot.
    #[must_use]
    pub fn is_sound(&self, robot: usize, at: Duration) -> bool {
        let mut spans = self.unsound[robot].iter().chain(&self.away);
        self.added != Some(robot) && !spans.any(|(from, to)| (*from..=*to).contains(&at))
    }

    /// Whether nothing can be expected of the gateway at some time of this span.
    #[must_use]
    pub fn is_away(&self, from: Duration, to: Duration) -> bool {
        self.away.iter().any(|(begin, end)| *begin <= to && from <= *end)
    }

    /// Whether another robot than this one is slow.
    #[must_use]
    pub fn another_is_slow(&self, robot: usize, at: Duration) -> bool {
        robot != 0 && self.slow.is_some_and(|(from, to)| (from..=to).contains(&at))
    }
}

impl Plan {
    /// A world with a gateway.
    #[must_use]
    pub fn with_gateway(seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0x6761_7465_7761_7921);
        let is_slow = random.strikes(0.2);
        let lasts = if is_slow { SLOW_FOR + ms(1000) } else { ms(9000) + random.up_to(ms(7000)) };
        let plan = Self {
            seed,
            latency: ms(2) + random.up_to(ms(18)),
            robots: Vec::new(),
            clients: Vec::new(),
            cameras: Vec::new(),
            blows: Vec::new(),
            over: CALM + lasts,
            classes: Vec::new(),
            trap: None,
            drivers: Drivers::AsTheyCome,
            hall: None,
        };
        let robots = if is_slow { 2 + random.below(3) } else { [1, 1, 2, 2, 3, 4][random.below(6)] };
        let hall = HallPlan {
            periods: Vec::new(),
            callers: Vec::new(),
            added: None,
            unsound: vec![Vec::new(); robots],
            slow: None,
            away: Vec::new(),
        };
        let mut draw = Draw { plan, hall, random };
        for _ in 0..robots {
            draw.robot();
        }
        draw.callers();
        if is_slow {
            draw.slow_robot();
        }
        for _ in 0..draw.random.below(4) {
            draw.robot_fault();
        }
        for _ in 0..1 + draw.random.below(3) {
            draw.gateway_fault();
        }
        draw.finish()
    }
}

struct Draw {
    plan: Plan,
    hall: HallPlan,
    random: Random,
}

impl Draw {
    fn seed(&mut self) -> u64 {
        u64::try_from(self.random.below(usize::MAX)).unwrap_or(0)
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.random.below(from.len())]
    }

    /// A time during the faults, and a later one.
    fn span(&mut self, shortest: u64, longest: u64) -> (Duration, Duration) {
        let from = CALM + self.random.up_to(self.plan.over - CALM - ms(shortest + 500));
        let left = (self.plan.over - from).min(ms(longest));
        (from, from + ms(shortest) + self.random.up_to(left.saturating_sub(ms(shortest))))
    }

    fn robot(&mut self) {
        let robot = RobotPlan {
            profile: self.pick(&["hc1", "hc1", "hc1", "r6-host"]),
            program: self.pick(&["remote", "palletise", "pick-and-place"]),
            keeps: self.random.strikes(0.3),
            seed: self.seed(),
            scenario: Scenario { seed: self.seed(), ..Scenario::default() },
            people: Vec::new(),
            photos: Vec::new(),
            looked_at: self.pick(&[ms(5), ms(10)]),
            tells_values: true,
            does_what_it_says: true,
            arms_itself: false,
        };
        self.plan.robots.push(robot);
        let period = self.pick(&[ms(50), ms(100), ms(100), ms(250), ms(1000)]);
        self.hall.periods.push(period);
    }

    fn caller(&mut self, part: Part, robot: usize) {
        let seed = self.seed();
        self.hall.callers.push(CallerPlan { part, robot, seed });
    }

    fn any_robot(&mut self) -> usize {
        self.random.below(self.plan.robots.len())
    }

    fn callers(&mut self) {
        let robots = self.plan.robots.len();
        self.caller(Part::Inspector, 0);
        for robot in 0..robots {
            self.caller(Part::Operator, robot);
        }
        let any = self.any_robot();
        self.caller(Part::Stopper, any);
        for (part, chance) in
            [(Part::Operator, 0.5), (Part::Viewer, 0.5), (Part::Admin, 0.4), (Part::Reader, 0.5)]
        {
            if self.random.strikes(chance) {
                let robot = self.any_robot();
                self.caller(part, robot);
                if part == Part::Reader {
                    self.plan.classes.push(Class::G5);
                }
            }
        }
        if self.random.strikes(0.5) {
            self.caller(Part::Hostile, 0);
            self.plan.classes.push(Class::G13);
        }
        if robots > 1 && self.random.strikes(0.5) {
            self.hall.added = Some(robots - 1);
            self.caller(Part::Engineer, robots - 1);
            self.plan.classes.push(Class::G6);
        }
    }

    fn fault(&mut self, robot: usize, fault: Fault, chance: f64, (from, to): (Duration, Duration)) {
        let window = Window { fault, from, lasts: Some(to - from), chance };
        self.plan.robots[robot].scenario.faults.push(window);
        self.hall.unsound[robot].push((from, to + SETTLES));
    }

    /// One robot answers hardly or not at all for half a minute.
    fn slow_robot(&mut self) {
        let delay = ms(3000);
        let latency = LinkFault::Latency { to_controller: delay, to_client: delay, spread: ms(500) };
        let fault = self.pick_fault(&[latency, LinkFault::Silence, LinkFault::Slow { bytes_per_second: 20 }]);
        let span = (CALM, CALM + SLOW_FOR);
        self.fault(0, Fault::Link(fault), 1.0, span);
        // People see that it is slow, and stop it.
        self.caller(Part::Stopper, 0);
        self.caller(Part::Stopper, 0);
        self.hall.slow = Some(span);
        self.plan.classes.push(Class::G1);
    }

    fn pick_fault(&mut self, from: &[LinkFault]) -> LinkFault {
        from[self.random.below(from.len())]
    }

    /// A fault of the link of a robot, or of its power.
    fn robot_fault(&mut self) {
        use Class::{C4, P10, T1, T2, T3, T4, T5, T7, T8};
        let link = Fault::Link;
        let robot = self.any_robot();
        let short = self.random.up_to(ms(60));
        let late = self.random.up_to(ms(400));
        let latency = LinkFault::Latency { to_controller: short, to_client: late, spread: short };
        let all = [
            (T1, link(LinkFault::Refuse), 1.0),
            (T2, link(LinkFault::BlackHole), 1.0),
            (T3, link(LinkFault::Silence), 1.0),
            (T4, link(LinkFault::ResetMidFrame { after: None }), 0.1),
            (T5, link(LinkFault::CloseBeforeReply), 0.1),
            (T7, link(LinkFault::Pieces { bytes: 7 }), 1.0),
            (T8, link(latency), 1.0),
            (P10, Fault::Task(TaskFault::NotAcknowledged), 0.5),
            (P10, Fault::Task(TaskFault::NotAcknowledged), 0.5),
        ];
        if self.random.strikes(0.3) {
            let (from, to) = self.span(800, 3000);
            if self.may_restart(from, to) {
                self.plan.blows.extend([(from, Blow::CutPower { robot }), (to, Blow::Boot { robot })]);
                self.hall.unsound[robot].push((from, to + SETTLES));
                self.plan.classes.push(C4);
            }
            return;
        }
        let (class, fault, chance) = all[self.random.below(all.len())].clone();
        let span = self.span(400, 4000);
        self.fault(robot, fault, chance, span);
        self.plan.classes.push(class);
    }

    /// Restarts do not overlap, so that no running host is started again.
    fn may_restart(&self, from: Duration, to: Duration) -> bool {
        let restarts = |blow: &Blow| {
            matches!(
                blow,
                Blow::CutPower { .. } | Blow::Boot { .. } | Blow::KillGateway {} | Blow::StartGateway {}
            )
        };
        let near = from.saturating_sub(ms(4200))..=to + ms(200);
        !self.plan.blows.iter().any(|(at, blow)| restarts(blow) && near.contains(at))
    }

    /// A fault of the gateway's system.
    fn gateway_fault(&mut self) {
        match self.random.below(6) {
            0..3 => {
                let (from, to) = self.span(100, 2000);
                if self.may_restart(from, to) {
                    self.plan.blows.extend([(from, Blow::KillGateway {}), (to, Blow::StartGateway {})]);
                    self.hall.away.push((from, to + SETTLES));
                    self.plan.classes.push(Class::S4);
                }
            }
            3 => {
                let (from, to) = self.span(500, 4000);
                let no_pages = self.random.strikes(0.5);
                let full = if no_pages { Blow::StoreHasNoPages {} } else { Blow::StoreIsFull {} };
                self.plan.blows.extend([(from, full), (to, Blow::StoreHasRoom {})]);
                self.plan.classes.push(Class::S1);
            }
            4 => {
                let (from, to) = self.span(500, 4000);
                self.plan.blows.extend([(from, Blow::StoreIsSlow {}), (to, Blow::StoreIsFast {})]);
                self.plan.classes.push(Class::S5);
            }
            _ => {
                let (from, to) = self.span(500, 4000);
                self.plan.blows.extend([(from, Blow::NoFiles {}), (to, Blow::FilesAgain {})]);
                self.hall.away.push((from, to + SETTLES));
                self.plan.classes.push(Class::G10);
            }
        }
    }

    fn finish(mut self) -> Plan {
        self.plan.blows.sort_by_key(|(at, _)| *at);
        self.plan.classes.dedup();
        self.plan.hall = Some(self.hall);
        self.plan
    }
}
