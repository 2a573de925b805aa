//! Worlds with a single fault that must not deceive a statement about an arm.

use std::time::Duration;

use r6_controller::fault::{Fault, IgnoredStop, LinkFault, TaskFault};
use r6_controller::scenario::{Entry, Happening, Scenario, Window};
use r6_traffic::random::Random;

use super::{Blow, CALM, ClientPlan, Drivers, Mishap, Plan, RobotPlan, ms};
use crate::fault::Class;

/// The classes that can be the only fault of a world.
pub const TRAPS: [Class; 9] =
    [Class::E1, Class::E2, Class::E3, Class::E4, Class::E5, Class::E6, Class::E7, Class::E8, Class::P10];

/// The name of a program that moves without remote commands and stands in between, like a program that waits
/// for inputs.
pub const DWELLS: &str = "dwells";

/// The text of that program.
pub const DWELLS_TEXT: &str = "\
[[step]]\ndo = \"axis-move\"\nto = [25, -3, 4, 0, 5, 0]\nspeed = 40\n\
[[step]]\ndo = \"wait\"\nseconds = 0.3\n\
[[step]]\ndo = \"axis-move\"\nto = [0, -1, 4, 0, 5, 0]\nspeed = 40\n\
[[step]]\ndo = \"wait\"\nseconds = 0.8\n";

/// A frame that clears the instruction list.
const CLEAR: &[u8] =
    b"{\"dsID\":\"www.hc-system.com.HCRemoteCommand\",\"reqType\":\"AddRCC\",\"packID\":\"1\",\
    \"emptyList\":\"1\",\"instructions\":[]}";

impl Plan {
    /// A world with this class as its only fault. A class that is not in [`TRAPS`] gives a world without
    /// faults.
    #[must_use]
    pub fn trapped(class: Class, seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0x7472_6170_7065_6421);
        let over = CALM + ms(14_000) + random.up_to(ms(4000));
        let mut plan = Self {
            seed,
            latency: ms(2) + random.up_to(ms(10)),
            robots: Vec::new(),
            clients: Vec::new(),
            cameras: Vec::new(),
            blows: Vec::new(),
            over,
            classes: vec![Class::C7, class],
            trap: Some(class),
            drivers: Drivers::AsTheyCome,
            hall: None,
        };
        let robots = if class == Class::E6 { 2 } else { 1 };
        for robot in 0..robots {
            plan.robots.push(robot_of(&mut random));
            plan.clients.push(client_of(robot, &mut random));
        }
        plan.set(class, &mut random);
        plan
    }

    /// A world with one trap, each class in turn.
    #[must_use]
    pub fn any_trap(seed: u64) -> Self {
        let count = u64::try_from(TRAPS.len()).unwrap_or(1);
        let turn = usize::try_from(seed % count).unwrap_or(0);
        Self::trapped(TRAPS[turn], seed)
    }

    fn set(&mut self, class: Class, random: &mut Random) {
        let (from, lasts) = (CALM, self.over - CALM);
        let task = |fault| Window { fault: Fault::Task(fault), from, lasts: Some(lasts), chance: 1.0 };
        let (robot, client) = (&mut self.robots[0], &mut self.clients[0]);
        let faults = &mut robot.scenario.faults;
        match class {
            Class::E1 => {
                let how = [IgnoredStop::Ok, IgnoredStop::Err, IgnoredStop::Every][random.below(3)];
                faults.push(task(TaskFault::StopIgnored(how)));
                // The arm stands in between, longer than two observations of the client.
                faults.push(task(TaskFault::Dwell { rest: ms(250) + random.up_to(ms(100)) }));
                client.mishap = Some(Mishap::Stopped);
                if random.strikes(0.5) {
                    // The program moves without remote commands, and stands in between.
                    robot.program = DWELLS;
                    client.mishap = Some(Mishap::StopsOthers);
                }
            }
            Class::E2 => {
                faults.push(task(TaskFault::Dwell { rest: ms(250) + random.up_to(ms(1000)) }));
                client.mishap = random.strikes(0.3).then_some(Mishap::Stopped);
                if random.strikes(0.6) {
                    // This profile does not report how many instructions are left.
                    robot.profile = "r6-host";
                }
            }
            Class::E3 => {
                for turn in 0..3 {
                    let from = CALM + ms(turn * 4500) + random.up_to(ms(2000));
                    let fault = Fault::Link(LinkFault::HalfOpen);
                    faults.push(Window { fault, from, lasts: Some(ms(200)), chance: 1.0 });
                }
                client.mishap = Some(Mishap::StopsWhenDeaf);
            }
            Class::E4 => {
                let delay = client.patience + ms(200) + random.up_to(ms(1500));
                faults.push(Window { chance: 0.3, ..task(TaskFault::LateList { delay }) });
                robot.arms_itself = true;
                client.mishap = random.strikes(0.7).then_some(Mishap::Stopped);
            }
            Class::E5 => {
                for _ in 0..4 + random.below(6) {
                    let at = CALM + random.up_to(self.over - CALM - ms(500));
                    let what = Happening::Request(CLEAR.to_vec());
                    let (spread, every, times) = (Duration::ZERO, None, Some(1));
                    robot.scenario.timeline.push(Entry { at, spread, every, times, what });
                }
            }
            Class::E6 => {
                // Other values would show the swap first.
                let turn = random.below(3);
                (client.watches, client.asks) = (turn == 0, turn == 1);
                let mut at = CALM + random.up_to(ms(1500));
                while at + ms(4000) < self.over {
                    let back = at + ms(800) + random.up_to(ms(2500));
                    self.blows.push((at, Blow::Swap { client: 0, to: Some(1) }));
                    self.blows.push((back, Blow::Swap { client: 0, to: None }));
                    at = back + ms(500) + random.up_to(ms(2000));
                }
            }
            Class::E7 => client.mishap = Some(Mishap::OutputFails),
            Class::E8 => client.mishap = Some(Mishap::Interrupted),
            Class::P10 => {
                // Commands are rare, and only lists count here.
                faults.push(Window { chance: 0.3, ..task(TaskFault::NotExecuted) });
                (client.watches, client.asks) = (false, false);
            }
            _ => {}
        }
    }
}

fn robot_of(random: &mut Random) -> RobotPlan {
    RobotPlan {
        profile: "hc1",
        program: "remote",
        keeps: false,
        seed: number(random),
        scenario: Scenario { seed: number(random), ..Scenario::default() },
        people: Vec::new(),
        photos: Vec::new(),
        looked_at: ms(3),
        tells_values: true,
        does_what_it_says: true,
        arms_itself: random.strikes(0.5),
    }
}

fn client_of(robot: usize, random: &mut Random) -> ClientPlan {
    ClientPlan {
        robot,
        seed: number(random),
        every: [ms(50), ms(100), ms(250)][random.below(3)],
        patience: [ms(300), ms(1000), ms(2000)][random.below(3)],
        beats: false,
        moves: true,
        drops: false,
        mishap: None,
        watches: true,
        asks: true,
    }
}

fn number(random: &mut Random) -> u64 {
    u64::try_from(random.below(usize::MAX)).unwrap_or(0)
}
