//! The client asks for the identity on the first connection too (docs/SAFETY.md): so even a handle that only
//! reads notices another robot.

use std::time::Duration;

use r6_client::{
    Address, AxisIndex, Command, NotSent, OutcomeUnknown, Reading, RequestError, Robot, RobotSettings,
};
use r6_testkit::hostile::serve::HostileController;
use r6_testkit::hostile::{Cabinet, Character, Kind, Links, Lost, Swap, SwapWhen};
use tokio::time::{Instant, sleep};

use crate::hands::{self, On, on, on_every_hand, pause, spawn};
use crate::robot_at;

on_every_hand! {
    a_handle_that_only_read_one_value_knows_that_another_robot_answers,
    a_stop_right_after_the_swap_does_not_stop_the_other_robot,
    a_stop_that_leaves_while_the_robots_are_swapped_does_not_stop_the_other_robot,
    a_subscription_alone_knows_that_another_robot_answers,
    who_is_there_is_asked_once_and_before_the_first_query,
    a_controller_that_does_not_say_who_it_is_answers_all_else_as_before,
    a_stop_does_not_wait_on_the_first_connection,
    where_values_were_read_of_nobody_a_stop_on_the_next_connection_proves_nothing,
    one_query_never_mixes_the_values_of_two_robots,
    where_no_question_fits_into_a_frame_a_query_is_refused_at_once,
    a_robot_whose_name_cannot_be_read_is_not_taken_for_the_one_before,
}

const J1: Address = Address::Axis(AxisIndex::ALL[0]);

/// Two robots. The second one stands at 77 degrees.
fn two() -> Character {
    let to = Cabinet { name: "cell 5".to_owned(), axes: [77.0; 8], ..Cabinet::default() };
    Character { swap: Some(Swap { when: SwapWhen::Told, links: Links::End, to }), ..Character::default() }
}

/// Two robots. The answers to these queries never arrive.
fn losing(queries: &[u32]) -> Character {
    let lost = queries.iter().map(|nth| Lost { kind: Kind::Query, nth: *nth }).collect();
    Character { lost, ..two() }
}

/// The requests that the second robot received, except queries.
fn told_to_the_second(controller: &HostileController) -> Vec<String> {
    let told = |entry: &r6_testkit::hostile::Entry| entry.robot == 2 && entry.kind != Kind::Query;
    controller.arm(|arm, _| {
        let log = arm.log().iter().filter(|entry| told(entry) && !entry.frame.is_null());
        log.map(|entry| entry.frame.to_string()).collect()
    })
}

/// The queries that arrived.
fn asked(controller: &HostileController) -> Vec<String> {
    controller.arm(|arm, _| {
        let log = arm.log().iter().filter(|entry| entry.kind == Kind::Query && !entry.frame.is_null());
        log.map(|entry| entry.frame["queryAddr"].to_string()).collect()
    })
}

async fn another_is_told(robot: &Robot) {
    let mut told = false;
    for _ in 0..50 {
        match robot.query(&[J1]).await {
            Ok(values) => assert_eq!(values.decimal(J1), Some(0.0), "cell 5 stands at 77"),
            Err(RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. })) => told = true,
            Err(_connecting) => {}
        }
        pause(Duration::from_millis(50)).await;
    }
    assert!(told, "it is told that another robot answers");
}

async fn a_handle_that_only_read_one_value_knows_that_another_robot_answers() {
    let (controller, robot) = robot_at(two()).await;
    assert_eq!(robot.query(&[J1]).await.unwrap().decimal(J1), Some(0.0));
    controller.arm(|arm, now| arm.swap(now));
    another_is_told(&robot).await;
    let refused = robot.stop().await.unwrap_err();
    let RequestError::NotSent(NotSent::NotStopped(why)) = &refused else { panic!("{refused:?}") };
    assert!(matches!(**why, NotSent::AnotherRobot { .. }), "{why:?}");
    assert_eq!(told_to_the_second(&controller), Vec::<String>::new());
}

async fn a_stop_right_after_the_swap_does_not_stop_the_other_robot() {
    let (controller, robot) = robot_at(two()).await;
    robot.query(&[J1]).await.unwrap();
    controller.arm(|arm, now| arm.swap(now));
    // The link has ended by now.
    pause(Duration::from_millis(1)).await;
    let refused = robot.stop().await.unwrap_err();
    assert!(matches!(refused, RequestError::NotSent(NotSent::NotStopped(_))), "{refused:?}");
    assert_eq!(told_to_the_second(&controller), Vec::<String>::new());
}

async fn a_stop_that_leaves_while_the_robots_are_swapped_does_not_stop_the_other_robot() {
    let (controller, robot) = robot_at(two()).await;
    robot.query(&[J1]).await.unwrap();
    controller.arm(|arm, now| arm.swap(now));
    let refused = robot.stop().await.unwrap_err();
    let as_told = match &refused {
        RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { .. }) => on() != On::Callback,
        // An event loop runs before the stop is sent, and then sees that the link has ended.
        RequestError::NotSent(NotSent::NotStopped(_)) => on() == On::Callback,
        _ => false,
    };
    assert!(as_told, "{refused:?}");
    assert_eq!(told_to_the_second(&controller), Vec::<String>::new());
}

async fn a_subscription_alone_knows_that_another_robot_answers() {
    let (controller, robot) = robot_at(two()).await;
    let mut seen = robot.subscribe(&[J1], Duration::from_millis(100)).unwrap();
    while seen.next().await.unwrap().fresh(J1).is_none() {}
    controller.arm(|arm, now| arm.swap(now));
    let mut told = false;
    for _ in 0..100 {
        let snapshot = seen.latest();
        let fresh = snapshot.fresh(J1);
        assert!(fresh.is_none_or(|j1| *j1 == Reading::Decimal(0.0)), "{snapshot:?}");
        let another = |error: &RequestError| {
            matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. }))
        };
        told |= snapshot.failure().is_some_and(another);
        pause(Duration::from_millis(20)).await;
    }
    assert!(told);
}

async fn who_is_there_is_asked_once_and_before_the_first_query() {
    let (controller, robot) = robot_at(two()).await;
    let begun = Instant::now();
    for _ in 0..3 {
        robot.query(&[J1]).await.unwrap();
    }
    let who = r#"["version","machineName","axisNum"]"#;
    assert_eq!(asked(&controller), [who, r#"["axis-0"]"#, r#"["axis-0"]"#, r#"["axis-0"]"#]);
    assert!(begun.elapsed() < Duration::from_millis(100), "{:?}", begun.elapsed());
    assert_eq!(robot.identity().unwrap().machine_name.as_deref(), Some("cell 4"));
}

async fn a_controller_that_does_not_say_who_it_is_answers_all_else_as_before() {
    // The second query is the caller's own.
    let (controller, robot) = robot_at(losing(&[1, 3])).await;
    let begun = Instant::now();
    assert_eq!(robot.query(&[J1]).await.unwrap().decimal(J1), Some(0.0));
    assert!(begun.elapsed() < Duration::from_millis(600), "{:?}", begun.elapsed());
    pause(Duration::from_millis(1800)).await;
    for _ in 0..20 {
        let begun = Instant::now();
        robot.query(&[J1]).await.unwrap();
        assert!(begun.elapsed() < Duration::from_millis(100), "{:?}", begun.elapsed());
        pause(Duration::from_millis(200)).await;
    }
    assert_eq!(asked(&controller).iter().filter(|asked| asked.contains("version")).count(), 2);
    // A command asks again, and is sent over the same connection.
    robot.command(Command::ClearAlarm).await.unwrap();
    assert_eq!(robot.identity().unwrap().machine_name.as_deref(), Some("cell 4"));
    assert!(controller.arm(|arm, _| arm.log().iter().all(|entry| entry.connection <= 1)));
}

async fn a_stop_does_not_wait_on_the_first_connection() {
    let (controller, robot) = robot_at(losing(&[1])).await;
    let begun = controller.now();
    let reader = robot.clone();
    let read = spawn(async move { reader.query(&[J1]).await });
    pause(Duration::from_millis(5)).await;
    assert!(robot.stop().await.unwrap().confirmed);
    read.await.unwrap().unwrap();
    let left = controller.arm(|arm, _| {
        let stop = arm.log().iter().find(|entry| entry.frame.to_string().contains("actionStop"));
        stop.unwrap().at - begun
    });
    assert!(left < Duration::from_millis(20), "{left:?}");
}

async fn where_values_were_read_of_nobody_a_stop_on_the_next_connection_proves_nothing() {
    for looked in [false, true] {
        let (controller, robot) = robot_at(losing(&[1])).await;
        assert_eq!(robot.query(&[J1]).await.unwrap().decimal(J1), Some(0.0));
        assert_eq!(robot.identity(), None);
        controller.arm(|arm, now| arm.swap(now));
        pause(Duration::from_millis(10)).await;
        if looked {
            // The caller sees which robot is there now: that robot becomes the intended one.
            robot.status().await.unwrap();
            assert_eq!(robot.identity().unwrap().machine_name.as_deref(), Some("cell 5"));
        }
        let report = robot.stop().await.unwrap();
        assert_eq!(report.confirmed, looked, "{report:?}");
    }
}

/// The axes that may appear in a query of many addresses.
fn all_axes() -> Vec<Address> {
    let axes = || AxisIndex::ALL.into_iter().take(6);
    let (first, last) = (axes().take(3).map(Address::Axis), axes().skip(3).map(Address::Axis));
    first.chain(axes().map(Address::World)).chain(last).collect()
}

async fn one_query_never_mixes_the_values_of_two_robots() {
    let mut cut = 0;
    for known in [true, false] {
        for at in (0..400).step_by(3) {
            let to = Cabinet { name: "cell 5".to_owned(), axes: [77.0; 8], ..Cabinet::default() };
            let swap = Swap { when: SwapWhen::Told, links: Links::End, to };
            let controller = HostileController::new(Character { swap: Some(swap), ..Character::default() });
            // About six addresses in a frame.
            let settings = RobotSettings { max_frame_bytes: 260, ..RobotSettings::default() };
            let cable = crate::cable::Cable(std::sync::Arc::clone(&controller));
            let robot = hands::connect_with(cable, settings).await.unwrap();
            if known {
                robot.status().await.unwrap();
            }
            let swapping = async {
                sleep(Duration::from_millis(at)).await;
                controller.arm(|arm, now| arm.swap(now));
            };
            let asking = async {
                // The robot that was read first is the intended one.
                let mut meant = known.then_some(0.0);
                for _ in 0..4 {
                    let Ok(read) = robot.query(&all_axes()).await else { continue };
                    let axes = read.rows().iter().filter(|(address, _)| matches!(address, Address::Axis(_)));
                    let axes: Vec<f64> = axes.filter_map(|(address, _)| read.decimal(*address)).collect();
                    let first = *meant.get_or_insert(axes[0]);
                    assert!(axes.iter().all(|axis| *axis == first), "{at} ms, known: {known}: {axes:?}");
                }
            };
            tokio::join!(swapping, asking);
            let frames = asked(&controller).iter().filter(|asked| asked.contains("axis-")).count();
            cut = cut.max(frames);
        }
    }
    assert!(cut > 12, "a query is cut in parts: {cut}");
}

async fn where_no_question_fits_into_a_frame_a_query_is_refused_at_once() {
    let cable = crate::cable::Cable(HostileController::new(two()));
    let settings = RobotSettings { max_frame_bytes: 60, ..RobotSettings::default() };
    let robot = hands::connect_with(cable, settings).await.unwrap();
    let refused = tokio::time::timeout(Duration::from_secs(60), robot.query(&[J1])).await;
    assert!(matches!(refused, Ok(Err(RequestError::Invalid(_)))), "{refused:?}");
}

/// A robot of the same model and firmware. Only the name would show that it is another robot.
async fn a_robot_whose_name_cannot_be_read_is_not_taken_for_the_one_before() {
    let mut character = two();
    if let Some(swap) = &mut character.swap {
        swap.to.name_in_a_list = true;
    }
    let (controller, robot) = robot_at(character).await;
    robot.status().await.unwrap();
    controller.arm(|arm, now| arm.swap(now));
    // The handle notices that the connection has ended.
    robot.query(&[J1]).await.ok();
    assert_eq!(robot.identity(), None, "nothing proves that it is cell 4");
    let refused = robot.clear_list().await.unwrap_err();
    assert_eq!(refused, NotSent::StateNotRead.into());
    let report = robot.stop().await;
    assert!(report.as_ref().is_ok_and(|report| !report.confirmed) || report.is_err(), "{report:?}");
}
