//! The two ways to move an arm, each for a hundred cycles over TCP: a PC that writes registers and lets a
//! taught program move to them, and a PC that sends lists. The tests judge completion by the state, never by
//! "ok".
//!
//! Each runs on a controller with a clock a thousand times as fast as real time, where client and machine
//! race as in a real cell, and on a controller that runs as fast as it can.

use std::time::Duration;

use r6_client::{Pushed, Refused, RequestError, Robot, RobotSettings};
use r6_controller::{Library, Profile};
use r6_proto::message::instruction::{Coordinates, Manner, Move};
use r6_proto::message::{Action, Instruction, PhotoAnswer};
use r6_proto::{Address, AxisIndex, AxisMask, Command, Reading, RegisterIndex};
use r6_sim::{Clock, ControllerHandle, SimSettings, Simulation};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::TryRecvError;

const CYCLES: i64 = 100;

/// Long enough for a loaded machine; a cycle takes some milliseconds.
const PATIENCE: Duration = Duration::from_secs(20);

const CLOCKS: [Clock; 2] = [Clock::Times(1000.0), Clock::AsFastAsPossible];

/// A program that carries out lists, and counts them.
const COUNTS_LISTS: &str = "[[step]]\ndo = \"remote\"\n[[step]]\ndo = \"counter\"\nnumber = 0\nby = 1\n";

/// A controller that runs a program, and a client that is connected to it.
struct Cell {
    simulation: Simulation,
    robot: Robot,
    random: u64,
}

impl Cell {
    async fn with(profile: Profile, clock: Clock, program: &str) -> Self {
        let mut library = Library::default();
        library.load("counts-lists", COUNTS_LISTS).unwrap();
        let settings =
            SimSettings { profile, clock, library, mold: program.to_owned(), ..SimSettings::default() };
        let simulation = Simulation::start(settings).await.unwrap();
        let address = simulation.controllers()[0].address().to_string();
        let robot = Robot::connect(&address, RobotSettings::default()).await.unwrap();
        Self { simulation, robot, random: 4 }
    }

    fn handle(&self) -> &ControllerHandle {
        &self.simulation.controllers()[0]
    }

    /// The next target: thousandths of a degree, within the soft limits of every axis.
    fn next_target(&mut self) -> [i64; 6] {
        let limits = self.handle().snapshot().axis_limits;
        std::array::from_fn(|axis| {
            self.random =
                self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (lowest, highest) = limits[axis];
            let share = f64::from(u32::try_from(self.random >> 32).unwrap()) / f64::from(u32::MAX);
            ((lowest + (highest - lowest) * share) * 1000.0).trunc() as i64
        })
    }

    async fn command(&self, command: Command<'static>) {
        self.robot.command(command).await.unwrap();
    }

    async fn write_registers(&self, target: [i64; 6]) {
        let first = RegisterIndex::new(800).unwrap();
        self.command(Command::RewriteDataList { first, savable: false, values: target.to_vec() }).await;
    }

    /// Sets M011 and resets it again.
    async fn pulse(&self) {
        for on in [true, false] {
            self.command(Command::ModifyOutput { board: 4, point: 1, on }).await;
        }
    }

    /// Checks that the arm rests at the target without an alarm.
    async fn assert_at(&self, target: [i64; 6], cycle: i64) {
        let asked = [Address::IsMoving, Address::CurAlarm].into_iter().chain(axes());
        let read = self.robot.query(&asked.collect::<Vec<_>>()).await.unwrap();
        assert_eq!(read.integer(Address::CurAlarm), Some(0), "cycle {cycle}");
        assert_eq!(read.flag(Address::IsMoving), Some(false), "cycle {cycle}");
        for (address, wanted) in axes().zip(target) {
            let found = read.decimal(address).unwrap();
            assert!(
                (found - wanted as f64 / 1000.0).abs() < 1e-6,
                "cycle {cycle}: {address} {found}, {wanted}"
            );
        }
    }

    async fn counted(&self) -> i64 {
        match self.robot.query(&[Address::Counter(0)]).await.unwrap().reading(Address::Counter(0)) {
            Some(Reading::Counter(counter)) => counter.current,
            other => panic!("{other:?}"),
        }
    }
}

fn axes() -> impl Iterator<Item = Address> {
    AxisIndex::ALL.into_iter().take(6).map(Address::Axis)
}

/// The only photo request that a cycle sends.
async fn photo(pushed: &mut Receiver<Pushed>, cycle: i64) {
    let event = tokio::time::timeout(PATIENCE, pushed.recv()).await.expect("a photo is asked for").unwrap();
    assert!(matches!(event, Pushed::Photo { cam_id: 0 }), "cycle {cycle}: {event:?}");
}

/// Checks that nothing else was pushed. Everything sent before the reply to an earlier request has arrived.
fn assert_no_more(pushed: &mut Receiver<Pushed>, cycle: i64) {
    let more = pushed.try_recv();
    assert!(matches!(more, Err(TryRecvError::Empty)), "cycle {cycle}: {more:?}");
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Trigger {
    Pulse,
    SingleCycle,
}

/// A hundred times: writes registers 800 to 805, triggers the program, waits for the photo and answers it.
async fn drive_by_registers(profile: Profile, clock: Clock, trigger: Trigger) {
    let mut cell = Cell::with(profile, clock, "remote").await;
    cell.command(Command::SwitchMold { mold: "register-move".into() }).await;
    let mut pushed = cell.robot.pushed();
    for cycle in 1..=CYCLES {
        let target = cell.next_target();
        cell.write_registers(target).await;
        match trigger {
            Trigger::Pulse => cell.pulse().await,
            Trigger::SingleCycle => cell.command(Command::ActionSingleCycle).await,
        }
        photo(&mut pushed, cycle).await;
        cell.robot.answer_photo(PhotoAnswer { cam_id: 0, ret: 1 }).await.unwrap();
        cell.assert_at(target, cycle).await;
        assert_no_more(&mut pushed, cycle);
        assert_eq!(cell.counted().await, cycle);
    }
    let mode = cell.robot.query(&[Address::CurMode]).await.unwrap().integer(Address::CurMode);
    assert_eq!(mode, Some(if trigger == Trigger::Pulse { 7 } else { 2 }), "{trigger:?}");
    assert_no_more(&mut pushed, CYCLES);
}

fn axis_move(target: [i64; 6]) -> Instruction {
    let manner = Manner { mask: Some(AxisMask::SIX), speed: Some(100.0), ..Manner::default() };
    let degrees = target.map(|thousandths| thousandths as f64 / 1000.0);
    Instruction {
        oneshot: true,
        action: Action::AxisMove(Move { target: Coordinates::from_slice(&degrees), manner }),
    }
}

/// A hundred times: replaces the list by two moves, and reads the state until the last move has ended.
async fn drive_by_lists(profile: Profile, clock: Clock) {
    let tells_length = profile.answers(Address::RemoteCmdLen);
    let mut cell = Cell::with(profile, clock, "counts-lists").await;
    let mut pushed = cell.robot.pushed();
    cell.robot.clear_list().await.unwrap();
    for cycle in 1..=CYCLES {
        let (way, target) = (cell.next_target(), cell.next_target());
        cell.robot.add_rcc(true, vec![axis_move(way), axis_move(target)]).await.unwrap();
        let done = tokio::time::timeout(PATIENCE, async {
            loop {
                let asked = [Address::IsMoving, Address::CurAlarm, Address::RemoteCmdLen];
                let asked: Vec<_> = asked.into_iter().chain(axes()).collect();
                let read = cell.robot.query(&asked).await.unwrap();
                assert_eq!(read.integer(Address::CurAlarm), Some(0), "cycle {cycle}");
                let left = read.integer(Address::RemoteCmdLen);
                assert_eq!(left.is_some(), tells_length);
                let rests = read.flag(Address::IsMoving) == Some(false) && left.unwrap_or(0) == 0;
                // Old firmware does not report how many steps are left, and an arm may rest between two
                // moves. So its position decides.
                let there = axes().zip(target).all(|(address, wanted)| {
                    read.decimal(address).is_some_and(|found| (found - wanted as f64 / 1000.0).abs() < 1e-6)
                });
                if rests && (tells_length || there) {
                    return;
                }
            }
        });
        done.await.unwrap_or_else(|_| panic!("cycle {cycle} does not end"));
        cell.assert_at(target, cycle).await;
        assert_eq!(cell.counted().await, cycle);
    }
    cell.robot.clear_list().await.unwrap();
    cell.robot.query(&[Address::CurMode]).await.unwrap();
    assert_eq!(cell.counted().await, CYCLES, "an empty list is no cycle");
    assert_no_more(&mut pushed, CYCLES);
}

/// On the 2020 firmware, the hand panel's port cannot set M points (manual 4.2.1 #8); the mainboard's port
/// could.
fn legacy_with_m_points() -> Profile {
    Profile::from_toml("base = \"legacy\"\nm_output_writable = true").unwrap()
}

fn legacy() -> Profile {
    Profile::named("legacy").unwrap()
}

#[tokio::test]
async fn a_hundred_cycles_by_registers_and_pulses() {
    for clock in CLOCKS {
        drive_by_registers(Profile::hc1(), clock, Trigger::Pulse).await;
    }
}

#[tokio::test]
async fn a_hundred_cycles_by_registers_and_pulses_on_old_firmware() {
    for clock in CLOCKS {
        drive_by_registers(legacy_with_m_points(), clock, Trigger::Pulse).await;
    }
}

#[tokio::test]
async fn a_hundred_single_cycles_by_registers() {
    for clock in CLOCKS {
        drive_by_registers(Profile::hc1(), clock, Trigger::SingleCycle).await;
    }
}

#[tokio::test]
async fn a_hundred_single_cycles_by_registers_on_old_firmware() {
    for clock in CLOCKS {
        drive_by_registers(legacy(), clock, Trigger::SingleCycle).await;
    }
}

#[tokio::test]
async fn a_hundred_lists() {
    for clock in CLOCKS {
        drive_by_lists(Profile::hc1(), clock).await;
    }
}

#[tokio::test]
async fn a_hundred_lists_on_old_firmware() {
    for clock in CLOCKS {
        drive_by_lists(legacy(), clock).await;
    }
}

/// Shows why old firmware's port for the pendant is driven by single cycles.
#[tokio::test]
async fn the_pendants_port_of_old_firmware_takes_no_pulse() {
    let cell = Cell::with(legacy(), Clock::AsFastAsPossible, "register-move").await;
    cell.write_registers([5000; 6]).await;
    let refused =
        cell.robot.command(Command::ModifyOutput { board: 4, point: 1, on: true }).await.unwrap_err();
    assert!(matches!(refused, RequestError::Refused(Refused::Command { .. })), "{refused}");
    cell.assert_at([0; 6], 0).await;
    assert_eq!(cell.counted().await, 0);
}
