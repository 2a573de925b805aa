//! The statement "this value is fresh" (docs/EVIDENCE.md): it is made only for a value of the live
//! connection, and of that robot.

use std::time::Duration;

use r6_client::{Address, OutcomeUnknown, Quality, RequestError};
use r6_testkit::hostile::{Cabinet, Character, Links, Swap, SwapWhen};

use crate::hands::{on_every_hand, pause};
use crate::robot_at;

on_every_hand! {
    b8_a_query_does_not_hand_out_the_values_of_another_robot,
    b9_no_value_of_an_earlier_connection_is_fresh,
}

fn another() -> Swap {
    let to = Cabinet { name: "cell 5".to_owned(), axes: [77.0; 8], ..Cabinet::default() };
    Swap { when: SwapWhen::Told, links: Links::End, to }
}

const J1: Address = Address::Axis(r6_client::AxisIndex::ALL[0]);

async fn b8_a_query_does_not_hand_out_the_values_of_another_robot() {
    let (controller, robot) = robot_at(Character { swap: Some(another()), ..Character::default() }).await;
    robot.status().await.unwrap();
    controller.arm(|arm, now| arm.swap(now));
    let mut told = None;
    for _ in 0..50 {
        match robot.query(&[J1]).await {
            Ok(values) => assert_eq!(values.decimal(J1), Some(0.0), "cell 5 stands at 77"),
            Err(RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { found, .. })) => {
                told = Some(found)
            }
            Err(_connecting) => {}
        }
        pause(Duration::from_millis(50)).await;
    }
    let found = told.expect("it is told who is there instead");
    // The newly accepted robot is read again.
    robot.accept_identity(*found);
    assert_eq!(robot.query(&[J1]).await.unwrap().decimal(J1), Some(77.0));
}

async fn b9_no_value_of_an_earlier_connection_is_fresh() {
    for swapped in [false, true] {
        let swap = swapped.then(another);
        let (controller, robot) = robot_at(Character { swap, ..Character::default() }).await;
        robot.status().await.unwrap();
        let mut seen = robot.subscribe(&[J1], Duration::from_secs(10)).unwrap();
        while seen.next().await.unwrap().fresh(J1).is_none() {}
        controller.arm(|arm, now| if swapped { arm.swap(now) } else { arm.break_links(now) });
        let before = controller.arm(|arm, _| arm.log().len());
        for _ in 0..400 {
            let snapshot = seen.latest();
            let value = snapshot.value(J1).unwrap();
            let read_again = controller.arm(|arm, _| {
                arm.log()
                    .iter()
                    .skip(before)
                    .any(|entry| entry.frame.to_string().contains("axis-0") && entry.connection > 1)
            });
            assert!(
                read_again || value.quality != Quality::Fresh || robot_is_on_first(&controller),
                "{value:?}"
            );
            if swapped {
                assert!(
                    snapshot.fresh(J1).is_none_or(|j1| *j1 == r6_client::Reading::Decimal(0.0)),
                    "{snapshot:?}"
                );
            }
            pause(Duration::from_millis(5)).await;
        }
        if !swapped {
            assert!(seen.latest().fresh(J1).is_some(), "it is read again on the next connection");
        }
    }
}

/// Whether the end of the first connection was not noticed yet. Then its values belong to the live
/// connection.
fn robot_is_on_first(controller: &r6_testkit::hostile::serve::HostileController) -> bool {
    controller.arm(|arm, _| arm.log().iter().all(|entry| entry.connection <= 1))
}
