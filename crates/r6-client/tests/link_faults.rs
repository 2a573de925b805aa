//! The client over a link with injected faults: it reports unknown outcomes as unknown, and it reconnects.

#[allow(dead_code, unused_imports, unused_macros, reason = "it has more than these tests need")]
#[path = "hands/hands.rs"]
mod hands;

use r6_controller::Event;
use r6_controller::event::ShellEvent;
use std::time::Duration;

use r6_client::{NotSent, OutcomeUnknown, Reconnect, RequestError, Robot, RobotSettings};
use r6_controller::Scenario;
use r6_controller::fault::{LinkFault, LinkFaultNow};
use r6_proto::{Address, Command, RegisterIndex};
use r6_sim::VirtualController;
use tokio::time::timeout;

use hands::on_every_hand;

on_every_hand! { in Real:
    a_reply_that_breaks_off_is_no_reply,
    a_link_that_says_nothing_is_noticed,
    a_refusal_is_told_and_ends,
    late_cut_and_gathered_replies_are_still_replies,
    a_time_out_tells_what_came,
}

#[cfg(target_os = "linux")]
on_every_hand! { in Real:
    a_black_hole_is_given_up_in_time,
}

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(20);

fn settings() -> RobotSettings {
    RobotSettings {
        reply_timeout: Duration::from_millis(300),
        connect_timeout: Duration::from_millis(300),
        reconnect: Reconnect {
            first_wait: Duration::from_millis(1),
            cap: Duration::from_millis(2),
            jitter_seed: Some(1),
        },
        ..RobotSettings::default()
    }
}

async fn cell() -> (VirtualController, Robot) {
    let controller = VirtualController::start().await.unwrap();
    let robot = hands::connect(&controller.address().to_string(), settings()).await.unwrap();
    robot.status().await.unwrap();
    (controller, robot)
}

fn set(controller: &VirtualController, faults: &[LinkFault]) {
    let always = |fault| LinkFaultNow { fault, chance: 1.0 };
    controller.handle().set_link_faults(faults.iter().copied().map(always).collect());
}

async fn told(controller: &VirtualController, faults: &[LinkFault], what: ShellEvent) {
    let what = Event::Shell(what);
    let mut log = controller.handle().log();
    set(controller, faults);
    let told = async { while log.recv().await.unwrap().event != what {} };
    timeout(PATIENCE, told).await.expect("it is told");
}

/// Sends queries until one is answered; each failure is one after which a query may safely be repeated. On
/// the new connection, nothing changes anything before the state was read.
async fn assert_finds_its_way_back(robot: &Robot) {
    let answered = async {
        while let Err(error) = robot.query(&[Address::CurMode]).await {
            assert!(error.may_send_again(), "{error}");
        }
    };
    timeout(PATIENCE, answered).await.expect("it is answered");
    let refused = write(robot, 2).await.unwrap_err();
    assert!(matches!(refused, RequestError::NotSent(NotSent::StateNotRead)), "{refused}");
    robot.status().await.unwrap();
    write(robot, 2).await.unwrap();
}

async fn write(robot: &Robot, value: i64) -> Result<(), RequestError> {
    let register = RegisterIndex::new(800).unwrap();
    robot.command(Command::RewriteData { register, savable: false, value }).await.map(|_| ())
}

async fn a_reply_that_breaks_off_is_no_reply() {
    for fault in [LinkFault::ResetMidFrame { after: None }, LinkFault::CloseBeforeReply] {
        let (controller, robot) = cell().await;
        set(&controller, &[fault]);
        let error = write(&robot, 1).await.unwrap_err();
        let lost = matches!(&error, RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { .. }));
        assert!(lost, "{fault:?}: {error}");
        assert!(!error.may_send_again(), "the controller has carried it out");
        set(&controller, &[]);
        assert_finds_its_way_back(&robot).await;
    }
}

async fn a_link_that_says_nothing_is_noticed() {
    let (controller, robot) = cell().await;
    set(&controller, &[LinkFault::HalfOpen]);
    let error = write(&robot, 1).await.unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { .. })), "{error}");
    assert_finds_its_way_back(&robot).await;
}

async fn a_refusal_is_told_and_ends() {
    let (controller, robot) = cell().await;
    told(&controller, &[LinkFault::Refuse], ShellEvent::Refuses).await;
    let other = hands::connect(&controller.address().to_string(), settings()).await.unwrap_err();
    assert!(matches!(other, RequestError::NotSent(NotSent::Unreachable { .. })), "{other}");
    // A connected client does not notice until its connection is lost too.
    write(&robot, 1).await.unwrap();
    set(&controller, &[LinkFault::Refuse, LinkFault::CloseBeforeReply]);
    write(&robot, 1).await.unwrap_err();
    robot.query(&[Address::CurMode]).await.unwrap_err();
    told(&controller, &[], ShellEvent::TakesAgain).await;
    assert_finds_its_way_back(&robot).await;
}

#[cfg(target_os = "linux")]
async fn a_black_hole_is_given_up_in_time() {
    let (controller, robot) = cell().await;
    told(&controller, &[LinkFault::BlackHole], ShellEvent::GivesNoAnswer).await;
    let other = hands::connect(&controller.address().to_string(), settings()).await.unwrap_err();
    assert!(matches!(other, RequestError::NotSent(NotSent::ConnectTimedOut { .. })), "{other}");
    write(&robot, 1).await.unwrap();
    told(&controller, &[], ShellEvent::TakesAgain).await;
    let other = hands::connect(&controller.address().to_string(), settings()).await.unwrap();
    write(&other, 2).await.unwrap();
    write(&robot, 3).await.unwrap();
}

async fn late_cut_and_gathered_replies_are_still_replies() {
    let (controller, robot) = cell().await;
    let ms = Duration::from_millis;
    for faults in [
        vec![LinkFault::Pieces { bytes: 1 }],
        vec![LinkFault::Stall { delay: ms(20) }],
        vec![LinkFault::Coalesce { frames: 4, within: ms(20) }],
        vec![LinkFault::Latency { to_controller: ms(10), to_client: ms(10), spread: ms(10) }],
        vec![
            LinkFault::Pieces { bytes: 3 },
            LinkFault::Stall { delay: ms(5) },
            LinkFault::Latency { to_controller: ms(2), to_client: ms(2), spread: ms(2) },
            LinkFault::Slow { bytes_per_second: 20_000 },
        ],
    ] {
        set(&controller, &faults);
        for value in 1..=5 {
            write(&robot, value).await.unwrap_or_else(|error| panic!("{faults:?}: {error}"));
            let read = robot.query(&[Address::CurMode]).await;
            assert_eq!(read.unwrap().integer(Address::CurMode), Some(7), "{faults:?}");
        }
    }
    set(&controller, &[]);
    write(&robot, 6).await.unwrap();
}

/// A timeout error contains what came in place of the reply, because a broken cable and a firmware that
/// answers nonsense are not the same.
async fn a_time_out_tells_what_came() {
    for (fault, heard) in [
        ("task-dead\"", None),
        ("echo\"", Some("the request itself")),
        ("bad-pack-id\"\nkind = \"wrong\"", Some("a reply with a packID that nothing waits for")),
        ("bad-json\"\nkind = \"truncated\"", Some("no whole frame")),
    ] {
        let scenario = Scenario::read(&format!("[[fault]]\nfault = \"{fault}")).unwrap();
        let controller = VirtualController::builder().scenario(scenario).start().await.unwrap();
        let robot = hands::connect(&controller.address().to_string(), settings()).await.unwrap();
        let error = robot.query(&[Address::CurMode]).await.unwrap_err();
        let RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { heard: told, .. }) = &error else {
            panic!("{fault}: {error}")
        };
        assert_eq!(told.as_deref(), heard, "{fault}");
        assert_eq!(error.to_string().contains("no usable reply within 300ms"), heard.is_some(), "{error}");
    }
}
