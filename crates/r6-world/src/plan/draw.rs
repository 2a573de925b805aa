//! Draws the plan of each robot and of the hosts around it.

use std::time::Duration;

use r6_controller::fault::{
    BadField, BadJson, BadList, Fault, LinkFault, PackIdFault, ReplyFault, TaskFault,
};
use r6_controller::io::OutputPoint;
use r6_controller::scenario::{Bounce, Entry, Happening, InputPoint, Scenario, Window};
use r6_controller::{Button, Key, PanelAction};
use r6_proto::AxisIndex;
use r6_proto::alarm::AlarmCode;
use r6_traffic::random::Random;

use super::{Blow, CALM, CameraPlan, ClientPlan, NOBODYS_ALARM, Plan, RobotPlan, Temper, ms};
use crate::fault::Class;

/// Draws one robot and the hosts around it.
pub(super) struct Draw<'p> {
    pub plan: &'p mut Plan,
    pub random: &'p mut Random,
    pub robot: usize,
    pub clients: usize,
}

impl Draw<'_> {
    fn seed(&mut self) -> u64 {
        u64::try_from(self.random.below(usize::MAX)).unwrap_or(0)
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.random.below(from.len())]
    }

    /// A time during the faults.
    fn at(&mut self) -> Duration {
        CALM + self.random.up_to(self.plan.over - CALM - ms(1500))
    }

    /// A time, and a later time before the faults are over.
    fn span(&mut self, longest: u64) -> (Duration, Duration) {
        let at = self.at();
        let left = (self.plan.over - at).min(ms(longest));
        (at, at + ms(300) + self.random.up_to(left.saturating_sub(ms(300))))
    }

    pub fn robot(mut self, has_camera: bool) {
        let profile = self.pick(&["hc1", "hc1", "hc1", "hc1", "legacy", "r6-host", "r6-pendant"]);
        let program = self.pick(&["remote", "remote", "remote", "remote", "palletise", "pick-and-place"]);
        let robot = RobotPlan {
            profile,
            program,
            keeps: self.random.strikes(0.6),
            seed: self.seed(),
            scenario: Scenario { seed: self.seed(), ..Scenario::default() },
            people: Vec::new(),
            photos: Vec::new(),
            looked_at: self.pick(&[ms(3), ms(5), ms(10)]),
            tells_values: true,
            does_what_it_says: true,
            arms_itself: false,
        };
        self.plan.robots.push(robot);
        if profile != "hc1" {
            self.plan.classes.push(Class::P8);
        }
        if self.clients > 1 {
            self.plan.classes.push(Class::P14);
        }
        let first = self.plan.clients.len();
        for _ in 0..self.clients {
            self.client();
        }
        if has_camera {
            self.camera();
        }
        for _ in 0..1 + self.random.below(4) {
            self.fault();
        }
        for _ in 0..self.random.below(3) {
            self.deed();
        }
        for _ in 0..self.random.below(3) {
            let client = first + self.random.below(self.clients);
            self.blow(client);
        }
    }

    fn client(&mut self) {
        let client = ClientPlan {
            robot: self.robot,
            seed: self.seed(),
            every: self.pick(&[ms(50), ms(100), ms(100), ms(250), ms(1000)]),
            patience: self.pick(&[ms(300), ms(1000), ms(2000)]),
            beats: self.random.strikes(0.2),
            moves: self.random.strikes(0.8),
            drops: self.random.strikes(0.4),
            mishap: None,
            watches: true,
            asks: true,
        };
        if client.drops {
            self.plan.classes.push(Class::K1);
        }
        if client.moves {
            self.plan.classes.push(Class::C6);
            self.plan.classes.push(Class::C7);
        }
        self.plan.clients.push(client);
    }

    fn camera(&mut self) {
        let temper = self.pick(&[Temper::Honest, Temper::Honest, Temper::Slow, Temper::Bad]);
        match temper {
            Temper::Honest => {}
            Temper::Slow => self.plan.classes.push(Class::V6),
            Temper::Bad => self.plan.classes.push(Class::V1),
        }
        let (robot, is_dialled, seed) = (self.robot, self.random.strikes(0.5), self.seed());
        self.plan.cameras.push(CameraPlan { robot, is_dialled, temper, seed });
        let count = 3 + self.random.below(6);
        let mut photos: Vec<_> = (0..count).map(|_| self.at()).collect();
        photos.sort();
        self.mine().photos = photos;
    }

    fn mine(&mut self) -> &mut RobotPlan {
        &mut self.plan.robots[self.robot]
    }

    /// A fault of the link, the replies or the controller's task, for a limited time.
    fn fault(&mut self) {
        use BadJson::*;
        use Class::*;
        let json = self.pick(&[
            Truncated,
            Oversized,
            Deep,
            DuplicateKeys,
            ByteOrderMark,
            BadUtf8,
            Nul,
            HugeNumber,
            NotANumber,
        ]);
        let field =
            self.pick(&[BadField::Missing, BadField::Unknown, BadField::Renamed, BadField::WrongType]);
        let list = self.pick(&[BadList::Short, BadList::Long, BadList::Shifted]);
        let late = PackIdFault::Late(ms(200) + self.random.up_to(ms(3000)));
        let pack_id = self.pick(&[PackIdFault::Wrong, PackIdFault::Repeated, PackIdFault::Reordered, late]);
        let short = self.random.up_to(ms(60));
        let latency =
            LinkFault::Latency { to_controller: short, to_client: self.random.up_to(ms(400)), spread: short };
        let rate = self.pick(&[1, 20, 200, 2000]);
        let pieces = self.pick(&[1, 1, 7, 60]);
        let together = LinkFault::Coalesce { frames: 2 + self.random.below(4), within: ms(100) };
        let link = Fault::Link;
        let reply = Fault::Reply;
        let task = Fault::Task;
        let all = [
            (T1, link(LinkFault::Refuse), 1.0),
            (T2, link(LinkFault::BlackHole), 1.0),
            (T3, link(LinkFault::Silence), 1.0),
            (T4, link(LinkFault::ResetMidFrame { after: None }), 0.1),
            (T5, link(LinkFault::CloseBeforeReply), 0.1),
            (T6, link(LinkFault::HalfOpen), 1.0),
            (T7, link(LinkFault::Pieces { bytes: pieces }), 1.0),
            (T7, link(together), 1.0),
            (T8, link(latency), 1.0),
            (T9, link(LinkFault::Slow { bytes_per_second: rate }), 1.0),
            (T11, link(LinkFault::Noise), 0.002),
            (T14, link(LinkFault::Stall { delay: ms(190) }), 0.5),
            (P1, reply(ReplyFault::BadJson(json)), 0.2),
            (P2, reply(ReplyFault::BadField(field)), 0.2),
            (P3, reply(ReplyFault::PackId(pack_id)), 0.2),
            (P4, reply(ReplyFault::CrossedReply), 0.5),
            (P5, reply(ReplyFault::BadList(list)), 0.3),
            (P6, reply(ReplyFault::Echo), 0.2),
            (P7, reply(ReplyFault::Unsolicited), 0.3),
            (P10, task(TaskFault::NotExecuted), 0.3),
            (P10, task(TaskFault::NotAcknowledged), 0.3),
            (P11, task(TaskFault::ListFull), 0.5),
            (P11, task(TaskFault::ListFrozen), 1.0),
            (P12, task(TaskFault::RejectedMidBatch), 0.5),
            (P13, task(TaskFault::TaskDead), 1.0),
            (C9, task(TaskFault::FrozenValues), 1.0),
        ];
        let (class, fault, chance) = self.random_of(&all);
        let once = matches!(fault, Fault::Link(LinkFault::HalfOpen));
        if once && self.mine().scenario.faults.iter().any(|window| window.fault == fault) {
            // A second half-open fault would occupy the places of all connections for good.
            return;
        }
        let has_numbers = self.mine().profile == "hc1";
        let lies = match class {
            T11 | C9 => true,
            P5 => list == BadList::Shifted || !has_numbers,
            P3 | P4 => !has_numbers,
            _ => false,
        };
        // A reply to another request with the same number and word cannot be distinguished from the right
        // one.
        let says_wrongly = lies || class == P4 || fault == Fault::Task(TaskFault::NotExecuted);
        let (from, to) = self.span(4000);
        let mine = self.mine();
        mine.tells_values &= !lies;
        mine.does_what_it_says &= !says_wrongly;
        mine.scenario.faults.push(Window { fault, from, lasts: Some(to - from), chance });
        self.plan.classes.push(class);
    }

    fn random_of(&mut self, all: &[(Class, Fault, f64)]) -> (Class, Fault, f64) {
        all[self.random.below(all.len())].clone()
    }

    fn entry(&mut self, at: Duration, what: Happening) {
        let entry = Entry { at, spread: Duration::ZERO, every: None, times: Some(1), what };
        self.mine().scenario.timeline.push(entry);
    }

    fn person(&mut self, at: Duration, action: PanelAction) {
        self.mine().people.push((at, action));
    }

    /// A person does something at the machine, or something happens to it.
    fn deed(&mut self) {
        use Class::*;
        let at = self.at();
        let soon = |millis| at + ms(millis);
        let class = self.pick(&[C1, C2, C3, C4, C5, C7, C8, C10, P9, P14]);
        match class {
            C1 => {
                let key = self.pick(&[Key::Manual, Key::Stop]);
                self.person(at, PanelAction::TurnKey(key));
                let jog = PanelAction::Jog { axis: AxisIndex::ALL[0], by: 400.0, percent: 80.0 };
                self.person(soon(200), jog);
                self.person(soon(900), PanelAction::Press(Button::Stop));
                self.person(soon(1300), PanelAction::TurnKey(Key::Auto));
                self.person(soon(1400), PanelAction::Press(Button::Start));
            }
            C2 => {
                self.person(at, PanelAction::EmergencyStop);
                let mut order = vec![
                    PanelAction::ReleaseEmergencyStop,
                    PanelAction::ClearAlarm,
                    PanelAction::TurnKey(Key::Auto),
                ];
                let turn = self.random.below(order.len());
                order.rotate_left(turn);
                for (n, action) in (0_u64..).zip(order.clone().into_iter().chain(order)) {
                    self.person(soon(900 + n * 100), action);
                }
                if self.random.strikes(0.7) {
                    self.person(soon(1800), PanelAction::Press(Button::Start));
                }
            }
            C3 | P9 => {
                let number = if class == P9 { NOBODYS_ALARM } else { AlarmCode(self.pick(&[5001, 42, 130])) };
                for n in 0..self.pick(&[1_u64, 1, 2, 6]) {
                    self.person(soon(n * 150), PanelAction::RaiseAlarm(number));
                    self.person(soon(n * 150 + 70), PanelAction::ClearAlarm);
                }
                self.person(soon(1200), PanelAction::ClearAlarm);
                self.person(soon(1300), PanelAction::Press(Button::Start));
            }
            C4 => {
                let off = ms(500) + self.random.up_to(ms(1000));
                self.entry(at, Happening::PowerCut { off, program: None });
                self.person(at + off + ms(200), PanelAction::Press(Button::Start));
            }
            C5 => {
                let current = self.pick(&[0, -1, i64::MAX, 7]);
                self.entry(at, Happening::Counter { id: 0, current, target: None });
            }
            C8 => {
                let bounce = Bounce { input: InputPoint::X(0, 0), times: 5, within: ms(20), on: true };
                self.entry(at, Happening::Bounce(bounce));
                self.entry(soon(100), Happening::Output(OutputPoint::Y(0, 0), true));
                self.entry(soon(300), Happening::Output(OutputPoint::Y(0, 0), false));
            }
            C10 => {
                let text = "[[step]]\ndo = \"axis-move\"\nto = [5, -3, 4, 0, 5, 0]\nspeed = 40\n\
                            [[step]]\ndo = \"axis-move\"\nto = [0, -1, 4, 0, 5, 0]\nspeed = 40\n";
                let load = PanelAction::LoadProgram { name: "cell".to_owned(), text: text.to_owned() };
                self.person(at, PanelAction::Press(Button::Stop));
                self.person(soon(100), PanelAction::Press(Button::Stop));
                self.person(soon(900), load);
                self.person(soon(1000), PanelAction::SwitchProgram("cell".to_owned()));
                self.person(soon(1100), PanelAction::Press(Button::Start));
            }
            // Another master queries, commands and sends; in the end it restores the speed.
            _ => {
                self.plan.classes.push(C7);
                let words = self.pick(&[
                    "[\"modifyGSPD\",\"300\"]",
                    "[\"modifyGSPD\",\"1000\"]",
                    "[\"actionPause\"]",
                    "[\"actionStop\"]",
                    "[\"startButton\"]",
                ]);
                let frame = format!("{{\"reqType\":\"command\",\"cmdData\":{words}}}");
                self.entry(at, Happening::Request(frame.into_bytes()));
                let frame = "{\"reqType\":\"command\",\"cmdData\":[\"modifyGSPD\",\"1000\"]}";
                self.entry(soon(700), Happening::Request(frame.as_bytes().to_vec()));
            }
        }
        self.plan.classes.push(class);
    }

    /// The network, a system or the mains fail.
    fn blow(&mut self, client: usize) {
        use Class::*;
        let robot = self.robot;
        let (class, from, to, longest) = match self.random.below(7) {
            0 | 1 => (T13, Blow::Hold { client }, Blow::Release { client }, 4000),
            2 => (T10, Blow::Deafen { client, deaf: true }, Blow::Deafen { client, deaf: false }, 3000),
            3 => (K2, Blow::KillClient { client }, Blow::StartClient { client }, 2000),
            4 if self.mine().keeps => {
                (S1, Blow::FillDisk { robot, full: true }, Blow::FillDisk { robot, full: false }, 3000)
            }
            4 | 5 => (C4, Blow::Kill { robot }, Blow::Boot { robot }, 1500),
            _ => (C4, Blow::CutPower { robot }, Blow::Boot { robot }, 3000),
        };
        let (begins, ends) = self.span(longest);
        // Restarts do not overlap, so that no running host is started again.
        let overlaps = self.plan.blows.iter().any(|(at, blow)| {
            std::mem::discriminant(blow) != std::mem::discriminant(&Blow::Hold { client })
                && (begins.saturating_sub(ms(4200))..=ends + ms(200)).contains(at)
        });
        if overlaps {
            return;
        }
        self.plan.blows.extend([(begins, from), (ends, to)]);
        self.plan.classes.push(class);
    }
}
