//! The statement "the arm stands" (docs/EVIDENCE.md): it is made only for an arm that moves no more.

use std::sync::Arc;
use std::time::Duration;

use r6_client::{
    Cause, ListAfterStop, OperationMode, Robot, RunOptions, SecondConnection, StandProof, StopMeans,
};
use r6_client::{RequestError, RobotSettings, StopReport};
use r6_testkit::hostile::serve::HostileController;
use r6_testkit::hostile::{
    Cabinet, Character, Deaf, Delays, Did, Effect, Entry, Kind, Late, Links, Lost, Program, Reaction, Stops,
};
use r6_testkit::hostile::{Swap, SwapWhen};
use serde_json::json;
use tokio::time::{Instant, sleep};

use crate::hands::{on_every_hand, pause, spawn};
use crate::{robot_at, robot_with, there_and_on};

on_every_hand! {
    a1_a_dwell_is_no_standstill,
    a1_a_program_that_waits_for_an_input_is_no_standstill,
    a1_the_means_are_tried_in_turn_and_the_one_that_worked_is_told,
    a1_firmware_that_stays_in_mode_7_is_told_to_stand_after_a_long_rest_with_an_empty_list,
    a2_a_stop_whose_answers_get_lost_is_judged_by_the_state,
    a3_a_stop_behind_a_deaf_link_goes_over_another_connection,
    a3_what_a_second_connection_sees_counts_where_the_first_one_is_deaf,
    a3_a_second_connection_to_another_robot_stops_nobody,
    a3_a_second_connection_that_ends_is_not_made_anew,
    a4_a_list_that_is_taken_late_is_cleared_again,
    b7_a_stop_is_neither_sent_to_nor_confirmed_by_another_robot,
    a_stop_goes_on_to_its_end_when_its_caller_gives_up,
    the_first_answer_that_is_lost_alone_opens_no_wrong_confirmation,
    a4_a_stop_ends_within_its_time_whatever_gets_lost,
    a1_what_was_proved_is_not_told_of_a_machine_that_runs_again,
    a_stop_over_a_healthy_link_takes_effect_within_150_ms,
    a3_a_link_that_goes_deaf_after_the_first_answer_gets_a_second_connection_too,
}

const REFUSED: Reaction = reaction(Effect::Refused);
const NO_EFFECT: Reaction = reaction(Effect::NoEffect);

const fn reaction(effect: Effect) -> Reaction {
    Reaction { effect, mode: None, alarm: None, takes: Duration::ZERO }
}

/// No means stops this arm, and it stays in mode 7.
fn deaf_to_every_means(reaction: Reaction) -> Stops {
    Stops { action_stop: reaction, stop_button: reaction, action_pause: reaction, clear: reaction }
}

/// How far J1 moves in the next ten seconds.
async fn moves_on(controller: &HostileController) -> f64 {
    let told = controller.now();
    pause(Duration::from_secs(10)).await;
    controller.arm(|arm, _| arm.path_since(1, told)[0])
}

/// Starts a motion of many points. Returns after its first step has begun.
async fn under_way(character: Character) -> (Arc<HostileController>, Robot) {
    let (controller, robot) = robot_at(character).await;
    let handle = robot.run(&there_and_on(12), RunOptions::default()).await.unwrap();
    assert!(handle.step(1).unwrap().started().await);
    drop(handle);
    (controller, robot)
}

/// Settings that say that this controller stays in mode 7 after a stop.
fn stays_in_mode_7() -> RobotSettings {
    RobotSettings { stays_in_mode_7: true, ..RobotSettings::default() }
}

/// A controller that accepts lists late. A stop leaves it in a mode in which it accepts and runs lists.
async fn takes_lists_after_a_stop(late: Late) -> (Arc<HostileController>, Robot) {
    let stays = reaction(Effect::Works);
    let stops = Stops { action_stop: stays, stop_button: stays, action_pause: stays, clear: stays };
    robot_with(Character { late: vec![late], stops, ..Character::default() }, stays_in_mode_7()).await
}

/// Checks that an arm reported as standing does not move on.
async fn assert_true(controller: &HostileController, stopped: &Result<StopReport, RequestError>) {
    let says_so = matches!(stopped, Ok(report) if report.confirmed);
    let path = moves_on(controller).await;
    assert!(!says_so || path == 0.0, "told to stand, and moved {path} degrees on: {stopped:?}");
}

async fn a1_a_dwell_is_no_standstill() {
    for told_empty in [false, true] {
        for means in [REFUSED, NO_EFFECT] {
            let character = Character {
                dwell: Duration::from_millis(330),
                dwell_told_empty: told_empty,
                stops: deaf_to_every_means(means),
                ..Character::default()
            };
            let (controller, robot) = under_way(character).await;
            let stopped = robot.stop().await;
            let report = stopped.as_ref().unwrap();
            assert!(!report.confirmed && report.proof.is_none(), "{report}");
            assert!(report.to_string().starts_with("NOT CONFIRMED"), "{report}");
            assert!(report.to_string().contains("use the emergency stop"), "{report}");
            assert_true(&controller, &stopped).await;
        }
    }
}

async fn a1_a_program_that_waits_for_an_input_is_no_standstill() {
    // The list is cleared, but the program continues.
    let clears = Stops { clear: reaction(Effect::Works), ..deaf_to_every_means(REFUSED) };
    for (mode, stops) in [
        (7, deaf_to_every_means(REFUSED)),
        (7, deaf_to_every_means(NO_EFFECT)),
        (7, clears.clone()),
        (9, deaf_to_every_means(NO_EFFECT)),
        (9, deaf_to_every_means(REFUSED)),
        (8, deaf_to_every_means(NO_EFFECT)),
        (8, clears),
    ] {
        let wait = json!({ "action": "100", "type": "100", "limit": "8" });
        let moves = json!({ "action": "4", "m0": "40", "ckStatus": "0x3F", "speed": "10" });
        let program = Program { at: Duration::ZERO, steps: vec![wait, moves] };
        let character = Character {
            cabinet: Cabinet { mode, ..Cabinet::default() },
            program: Some(program),
            stops,
            ..Character::default()
        };
        let (controller, robot) = robot_at(character).await;
        let stopped = robot.stop().await;
        assert!(!stopped.as_ref().unwrap().confirmed, "mode {mode}: {stopped:?}");
        assert!(moves_on(&controller).await > 1.0, "it was going to move");
    }
}

async fn a1_the_means_are_tried_in_turn_and_the_one_that_worked_is_told() {
    let pauses = Reaction { mode: Some(2), ..reaction(Effect::Works) };
    let presses = Reaction { mode: Some(3), ..reaction(Effect::Works) };
    for (stops, worked) in [
        (Stops { action_stop: REFUSED, stop_button: presses, ..Stops::default() }, StopMeans::StopButton),
        (Stops { action_stop: NO_EFFECT, action_pause: pauses, ..Stops::default() }, StopMeans::ActionPause),
        (Stops::default(), StopMeans::ActionStop),
    ] {
        let (controller, robot) = under_way(Character { stops, ..Character::default() }).await;
        let stopped = robot.stop().await;
        let report = stopped.as_ref().unwrap();
        assert_eq!((report.confirmed, report.means), (true, Some(worked)), "{report}");
        assert!(matches!(report.proof, Some(StandProof::NotRunning(_))), "{report}");
        assert!(report.to_string().contains(worked.word()), "{report}");
        assert_true(&controller, &stopped).await;
    }
}

async fn a1_firmware_that_stays_in_mode_7_is_told_to_stand_after_a_long_rest_with_an_empty_list() {
    let stays = reaction(Effect::Works);
    let stops = Stops { action_stop: stays, stop_button: stays, action_pause: stays, clear: stays };
    let (controller, robot) =
        robot_with(Character { stops, ..Character::default() }, stays_in_mode_7()).await;
    let handle = robot.run(&there_and_on(12), RunOptions::default()).await.unwrap();
    assert!(handle.step(1).unwrap().started().await);
    let stopped = robot.stop().await;
    let report = stopped.as_ref().unwrap();
    let Some(StandProof::EmptyList(rest)) = report.proof else { panic!("{report:?}") };
    assert!(rest >= Duration::from_secs(2), "{rest:?}");
    assert_eq!(report.mode, Some(OperationMode::Running));
    assert!(report.to_string().contains("may move it"), "{report}");
    assert_true(&controller, &stopped).await;
}

async fn a2_a_stop_whose_answers_get_lost_is_judged_by_the_state() {
    let unanswered = Reaction { mode: Some(3), alarm: Some(42), ..reaction(Effect::WorksUnanswered) };
    let stops = Stops { action_stop: unanswered, ..Stops::default() };
    let (controller, robot) = under_way(Character { stops, ..Character::default() }).await;
    let begun = Instant::now();
    let stopped = robot.stop().await;
    let report = stopped.as_ref().unwrap();
    assert!(report.confirmed && !report.to_string().contains("emergency"), "{report}");
    assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
    assert_true(&controller, &stopped).await;
}

async fn a3_a_stop_behind_a_deaf_link_goes_over_another_connection() {
    let (controller, robot) = under_way(Character::default()).await;
    let deaf = Deaf { connection: Some(1), ..Deaf::default() };
    controller.arm(|arm, _| arm.character_mut().deaf.push(deaf));
    let stopped = robot.stop().await;
    let report = stopped.as_ref().unwrap();
    assert!(report.confirmed && report.took < Duration::from_millis(1500), "{report}");
    assert_eq!(report.second, Some(SecondConnection::Used));
    assert!(report.to_string().contains("second connection"), "{report}");
    assert_true(&controller, &stopped).await;
}

/// No stop works on the arm, and only the second connection can see that.
async fn a3_what_a_second_connection_sees_counts_where_the_first_one_is_deaf() {
    let (controller, robot) =
        under_way(Character { stops: deaf_to_every_means(NO_EFFECT), ..Character::default() }).await;
    // The first connection is reopened, and is deaf again.
    let deaf = [1, 3, 4, 5, 6].map(|number| Deaf { connection: Some(number), ..Deaf::default() });
    controller.arm(|arm, _| arm.character_mut().deaf.extend(deaf));
    let report = robot.stop().await.unwrap();
    assert!(!report.confirmed, "{report}");
    assert_eq!(report.second, Some(SecondConnection::Used), "{report}");
    assert_eq!(report.mode, Some(OperationMode::Running), "{report}");
}

async fn a3_a_second_connection_to_another_robot_stops_nobody() {
    let to = Cabinet { name: "cell 5".to_owned(), ..Cabinet::default() };
    let swap = Swap { when: SwapWhen::Connection(2), links: Links::End, to };
    let (controller, robot) = under_way(Character { swap: Some(swap), ..Character::default() }).await;
    let deaf = Deaf { connection: Some(1), ..Deaf::default() };
    controller.arm(|arm, _| arm.character_mut().deaf.push(deaf));
    let stopped = robot.stop().await;
    assert!(!matches!(&stopped, Ok(report) if report.confirmed), "{stopped:?}");
    let reached = controller.arm(|arm, _| {
        arm.log().iter().any(|entry| entry.robot == 2 && [Kind::Command, Kind::List].contains(&entry.kind))
    });
    assert!(!reached, "cell 5 was only asked who it is");
}

async fn a4_a_list_that_is_taken_late_is_cleared_again() {
    for (taken_after, answered_after) in [(1000, Some(1200)), (2500, None)] {
        let late = Late {
            nth: None,
            taken_after: Duration::from_millis(taken_after),
            answered_after: answered_after.map(Duration::from_millis),
        };
        let (controller, robot) = takes_lists_after_a_stop(late).await;
        let handle = robot.run(&there_and_on(6), RunOptions::default()).await.unwrap();
        pause(Duration::from_millis(200)).await;
        let stopped = robot.stop().await;
        let report = stopped.as_ref().unwrap();
        let doubt = report.doubt.clone().expect("a list was unanswered");
        let cleared = matches!(doubt.cleared, ListAfterStop::Cleared | ListAfterStop::WasEmpty);
        assert!(!doubt.still_open && cleared && report.confirmed, "{report}");
        assert!(report.to_string().contains("had no answer"), "{report}");
        assert_true(&controller, &stopped).await;
        assert_eq!(controller.arm(|arm, _| arm.list_length(1)), 0);
        // A list that starts late is stopped at once, and not only when no frame can be in doubt any more.
        let ran_on = controller.arm(|arm, _| {
            let came = arm.log().iter().find(|entry| entry.did == Did::TakesLater).unwrap().at;
            let taken = came + Duration::from_millis(taken_after);
            let stops = arm.log().iter().filter(|entry| entry.kind == Kind::Command && entry.at > taken);
            stops.map(|entry| entry.at - taken).min()
        });
        assert!(ran_on.is_some_and(|ran_on| ran_on < Duration::from_millis(300)), "{ran_on:?}");
        assert_eq!(handle.finished().await.unwrap_err().cause, Cause::StoppedHere);
    }
}

async fn b7_a_stop_is_neither_sent_to_nor_confirmed_by_another_robot() {
    let (controller, robot) = under_way(Character::default()).await;
    let to = Cabinet { name: "cell 5".to_owned(), mode: 3, ..Cabinet::default() };
    controller.arm(|arm, now| {
        arm.character_mut().swap = Some(Swap { when: SwapWhen::Told, links: Links::End, to });
        arm.swap(now);
    });
    // The link has ended by now.
    pause(Duration::from_millis(1)).await;
    let stopped = robot.stop().await;
    assert!(!matches!(&stopped, Ok(report) if report.confirmed), "{stopped:?}");
    let text = stopped.unwrap_err().to_string();
    assert!(text.contains("NOT") && text.contains("emergency stop") && text.contains("cell 5"), "{text}");
    let reached = controller.arm(|arm, _| {
        arm.log().iter().any(|entry| entry.robot == 2 && [Kind::Command, Kind::List].contains(&entry.kind))
    });
    assert!(!reached, "cell 5 was only asked who it is");
}

async fn a_stop_goes_on_to_its_end_when_its_caller_gives_up() {
    let slow = Delays { command: Duration::from_millis(200), ..Delays::default() };
    let (controller, robot) = under_way(Character { delays: slow, ..Character::default() }).await;
    let given_up = tokio::time::timeout(Duration::from_millis(20), robot.stop()).await;
    assert!(given_up.is_err());
    let cut = robot.close().await;
    assert!(cut.cut_short.is_none(), "the stop had ended the motion: {cut:?}");
    controller.arm(|arm, _| {
        assert_eq!(arm.list_length(1), 0, "closing waited for the stop, which cleared the list")
    });
    assert_eq!(moves_on(&controller).await, 0.0);
}

async fn the_first_answer_that_is_lost_alone_opens_no_wrong_confirmation() {
    let lost = vec![Lost { kind: Kind::Command, nth: 1 }];
    let (controller, robot) = under_way(Character { lost, ..Character::default() }).await;
    let stopped = robot.stop().await;
    assert!(stopped.as_ref().unwrap().confirmed, "{stopped:?}");
    assert_true(&controller, &stopped).await;
}

/// Every answer after the proof is lost, while a list is in doubt.
async fn a4_a_stop_ends_within_its_time_whatever_gets_lost() {
    for deaf_after in [100, 400, 1000, 2500, 4500, 6000, 9000] {
        let late = Late { nth: None, taken_after: Duration::from_millis(3500), answered_after: None };
        let (controller, robot) = takes_lists_after_a_stop(late).await;
        let handle = robot.run(&there_and_on(6), RunOptions::default()).await.unwrap();
        pause(Duration::from_millis(200)).await;
        controller.arm(|arm, now| {
            let at = now + Duration::from_millis(deaf_after);
            arm.character_mut().deaf.push(Deaf { at, ..Deaf::default() });
        });
        let begun = Instant::now();
        let stopped = robot.stop().await;
        let took = begun.elapsed();
        assert!(took <= r6_client::StopsUnderWay::WITHIN, "{took:?}: {stopped:?}");
        assert_true(&controller, &stopped).await;
        drop(handle);
    }
}

/// Another client's list starts the machine again right after the standstill was proved.
async fn a1_what_was_proved_is_not_told_of_a_machine_that_runs_again() {
    let step = json!({ "oneshot": "1", "action": "4", "m0": "80", "ckStatus": "0x3F", "speed": "10" });
    let mut disproved = 0;
    for after in (0..400).step_by(4) {
        let delays = Delays { query: Duration::from_millis(40), ..Delays::default() };
        // A stop leaves it in automatic, where the next list starts it.
        let stops =
            Stops { action_stop: Reaction { mode: Some(2), ..reaction(Effect::Works) }, ..Stops::default() };
        let (controller, robot) =
            under_way(Character { arms_itself: true, delays, stops, ..Character::default() }).await;
        let theirs = async {
            sleep(Duration::from_millis(after)).await;
            controller.arm(|arm, now| arm.foreign_list(now, false, vec![step.clone()]));
        };
        let (stopped, ()) = tokio::join!(robot.stop(), theirs);
        let report = stopped.as_ref().unwrap();
        // The last read in a report that confirms shows a machine that does not run.
        let runs = report.moving == Some(true) || report.mode.is_some_and(OperationMode::may_run);
        assert!(!(report.confirmed && runs), "{after} ms: {report}");
        disproved += u32::from(!report.confirmed && report.took < Duration::from_secs(1));
    }
    assert!(disproved > 0, "no list came between the proof and the last look");
}

async fn a_stop_over_a_healthy_link_takes_effect_within_150_ms() {
    // The slowest published answer time of a real controller: 26 ms.
    let slow =
        Delays { command: Duration::from_millis(26), query: Duration::from_millis(26), ..Delays::default() };
    let mut took = Vec::new();
    for after in 0..100 {
        let (controller, robot) = robot_at(Character { delays: slow, ..Character::default() }).await;
        let handle = robot.run(&there_and_on(12), RunOptions::default()).await.unwrap();
        assert!(handle.step(1).unwrap().started().await);
        pause(Duration::from_millis(after * 7)).await;
        let asked = controller.now();
        robot.stop().await.unwrap();
        let path = controller.arm(|arm, _| arm.path_since(1, asked)[0]);
        // The arm moves at 30 degrees a second.
        took.push(path / 30.0);
    }
    took.sort_by(f64::total_cmp);
    let p99 = took[98];
    assert!(p99 <= 0.15, "{p99} s");
}

/// The first read succeeds, then the link is deaf.
async fn a3_a_link_that_goes_deaf_after_the_first_answer_gets_a_second_connection_too() {
    for deaf_after in (0..500).step_by(20) {
        // The first two means do nothing, so that the link is deaf before the arm stands.
        let stops = Stops { action_stop: NO_EFFECT, stop_button: NO_EFFECT, ..Stops::default() };
        let (controller, robot) = under_way(Character { stops, ..Character::default() }).await;
        controller.arm(|arm, now| {
            let at = now + Duration::from_millis(deaf_after);
            arm.character_mut().deaf.push(Deaf { connection: Some(1), at, ..Deaf::default() });
        });
        let stopped = robot.stop().await;
        let report = stopped.as_ref().unwrap();
        // 300 ms without an answer, then the means in turn over the second connection.
        let most = Duration::from_millis(deaf_after + 300 + 1800);
        assert!(report.confirmed && report.took <= most, "deaf after {deaf_after} ms: {report}");
        assert_eq!(report.second, Some(SecondConnection::Used), "deaf after {deaf_after} ms: {report}");
        assert_true(&controller, &stopped).await;
    }
}

/// A stop opens one second connection. If that ends, the client opens no other, because a controller has few
/// connections.
async fn a3_a_second_connection_that_ends_is_not_made_anew() {
    let (controller, robot) =
        under_way(Character { stops: deaf_to_every_means(NO_EFFECT), ..Character::default() }).await;
    controller.arm(|arm, _| {
        arm.character_mut().deaf.push(Deaf { connection: Some(1), ..Deaf::default() });
    });
    let opened = || {
        let opened = |entry: &&Entry| entry.did == Did::Opened;
        controller.arm(|arm, _| arm.log().iter().filter(opened).map(|entry| entry.at).collect::<Vec<_>>())
    };
    let stopping = spawn(async move { robot.stop().await });
    while opened().len() < 2 {
        pause(Duration::from_millis(10)).await;
    }
    pause(Duration::from_millis(50)).await;
    controller.arm(|arm, now| arm.close(now, 2));
    let stopped = stopping.await.unwrap();
    assert!(!matches!(&stopped, Ok(report) if report.confirmed), "{stopped:?}");
    // The first connection is given up after some timeouts, and is reopened.
    let opened = opened();
    assert!(opened.len() == 3 && opened[2] > Duration::from_secs(2), "{opened:?}");
}
