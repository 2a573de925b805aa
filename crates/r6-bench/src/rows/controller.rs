//! The cost of the virtual controller.

use std::time::Duration;

use r6_controller::{Controller, ControllerSettings, Profile, RobotModel, StartState};

use super::echo;
use super::load::Load;
use crate::measure::{Contender, beside, compare, processor_time};
use crate::report::{Figure, Goal, Row};
use crate::serve::Server;

/// Its frames per second of processor time, with many requests in flight, compared with a server that only
/// copies.
pub fn rows() -> Vec<Row> {
    let (canned, controller) = (Server::Canned.start(), Server::Controller.start());
    let (mut canned, mut controller) = (Load::of_queries(&canned), Load::of_queries(&controller));
    let mut contenders: Vec<Contender<'_>> = vec![Box::new(|| canned.cost()), Box::new(|| controller.cost())];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    vec![Row {
        what: "virtual controller, 16 connections × 16 queries under way, frames per second of its processor time".to_owned(),
        against: "server that sends canned bytes, a reply at a time",
        goal: Some(Goal::AtLeastFast(0.6)),
        figure: Figure::Ratio(ratio),
        in_the_way: "what is not the kernel's is mostly reading the twelve names and writing twelve numbers with six decimals",
    }]
}

/// The simulated time of one run of a moving arm.
const SIMULATED: Duration = Duration::from_secs(3600);

/// How many simulated seconds one second of the processor covers, with a moving arm that is polled ten times
/// a second.
pub fn simulated() -> Vec<Row> {
    let speed = || {
        let before = processor_time();
        an_hour();
        let spent = processor_time() - before;
        vec![spent.as_secs_f64() / SIMULATED.as_secs_f64()]
    };
    let ratio = beside(1.0, Box::new(speed));
    vec![Row {
        what: "simulated seconds per second, one moving robot polled at 10 Hz".to_owned(),
        against: "real time",
        goal: Some(Goal::AtLeastFast(10_000.0)),
        figure: Figure::Ratio(ratio),
        in_the_way: "",
    }]
}

fn an_hour() {
    use r6_proto::time::Instant;
    let model = RobotModel::named("BRTIRUS0707A").expect("a model that comes with r6-motion").clone();
    let profile = Profile::named("hc1").expect("a profile that comes with the crate");
    let settings =
        ControllerSettings { start: StartState::Waiting, ..ControllerSettings::new(profile, model) };
    let mut controller = Controller::new(settings, Instant::ORIGIN);
    let id = controller.connect(Instant::ORIGIN);
    // Its steps stay in the list, so the list repeats.
    let step = |j1: i32| {
        format!(
            r#"{{"oneshot":"0","action":"4","m0":"{j1}","m1":"10","m2":"-20","m3":"0","m4":"30","m5":"0","ckStatus":"0x3F","speed":"50","delay":"0","smooth":"3"}}"#
        )
    };
    let list = format!(
        r#"{{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","packID":"1","instructions":[{},{}]}}"#,
        step(40),
        step(-40)
    );
    controller.handle_input(Instant::ORIGIN, id, list.as_bytes());
    let query = echo::query_bytes();
    let mut moved = 0_u32;
    let polls = SIMULATED.as_millis() / 100;
    for poll in 1..=polls {
        let now = Instant::ORIGIN + Duration::from_millis(100) * u32::try_from(poll).unwrap_or(u32::MAX);
        controller.handle_timeout(now);
        controller.handle_input(now, id, query.as_bytes());
        while let Some(frame) = controller.poll_transmit(now, id) {
            moved += u32::from(!frame.is_empty());
        }
    }
    assert!(moved >= u32::try_from(polls).unwrap_or(u32::MAX), "every poll is answered");
    assert!(controller.machine().is_moving(), "the arm moves all the time");
}
