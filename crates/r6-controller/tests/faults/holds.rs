//! Promises of the scenario files that no case shows, tested with other commands and numbers.

use std::time::Duration;

use r6_controller::scenario::{Entry, Happening, Scenario};
use r6_controller::{Button, Key, PanelAction};
use r6_proto::time::Instant;
use serde_json::{Value, json};

use crate::client::Client;
use crate::world::World;

fn at(seconds: f64) -> Instant {
    Instant::ORIGIN + Duration::from_secs_f64(seconds)
}

fn once(seconds: f64, what: Happening) -> Entry {
    let at = Duration::from_secs_f64(seconds);
    Entry { at, spread: Duration::ZERO, every: None, times: Some(1), what }
}

fn by_hand(seconds: f64, action: &PanelAction) -> Entry {
    once(seconds, Happening::Panel(action.clone()))
}

fn says(seconds: f64, words: &[&str]) -> Entry {
    once(
        seconds,
        Happening::Request(json!({"reqType": "command", "cmdData": words}).to_string().into_bytes()),
    )
}

fn world(timeline: Vec<Entry>) -> World {
    let mut world = World::new(Scenario { timeline, ..Scenario::default() }, 0);
    world.watch();
    world
}

/// A time at which the arm is in motion, and comes to rest soon if it is not stopped.
const IN_MOTION: f64 = 3.1;

/// C2: after an emergency stop nothing moves until someone starts, in any order of release, clear and key.
#[test]
fn an_emergency_stop_is_left_in_any_order() {
    let actions = [
        PanelAction::ReleaseEmergencyStop,
        PanelAction::ClearAlarm,
        PanelAction::TurnKey(Key::Auto),
        PanelAction::SwitchProgram("remote".to_owned()),
        PanelAction::Press(Button::Stop),
    ];
    for orders in 0..actions.len().pow(4) {
        let chosen = (0_u32..4).map(|place| &actions[orders / actions.len().pow(place) % actions.len()]);
        let mut timeline = vec![by_hand(IN_MOTION, &PanelAction::EmergencyStop)];
        timeline.extend(chosen.zip([3.12, 3.5, 4.2, 4.6]).map(|(action, at)| by_hand(at, action)));
        let told: Vec<_> = timeline.iter().map(|entry| entry.what.to_string()).collect();
        let mut world = world(timeline);
        world.run_to(at(6.0));
        assert!(!world.stands(2.9, IN_MOTION), "it did not move");
        assert!(world.stands(3.75, 6.0), "it moves after {told:?}");
        world.make_ready();
        world.run_to(at(11.0));
        assert!(!world.stands(7.0, 11.0), "it does not go on after {told:?}");
    }
}

/// C5: counting up stops at the last number, counting down at the first.
#[test]
fn counting_on_from_the_last_one_stays_at_it() {
    let text = "[[step]]\ndo = \"counter\"\nnumber = 0\nby = 7\n\n[[step]]\ndo = \"counter\"\nnumber = 2\nby = -7\n\n\
                [[step]]\ndo = \"wait\"\nseconds = 60\n";
    let set = |id, current| once(0.5, Happening::Counter { id, current, target: Some(5) });
    let mut world = world(vec![
        set(0, i64::MAX - 3),
        set(2, i64::MIN + 3),
        by_hand(0.6, &PanelAction::TurnKey(Key::Auto)),
        by_hand(0.7, &PanelAction::LoadProgram { name: "count".to_owned(), text: text.to_owned() }),
        by_hand(0.8, &PanelAction::SwitchProgram("count".to_owned())),
        by_hand(1.0, &PanelAction::Press(Button::Start)),
    ]);
    world.run_to(at(3.0));
    assert!(world.reads(0.6, 1.0, "counter-0", &format!("[0,5,{}]", i64::MAX - 3)), "{:?}", world.all_read());
    assert!(world.reads(1.1, 3.0, "counter-0", &format!("[0,5,{}]", i64::MAX)), "{:?}", world.all_read());
    assert!(world.reads(1.1, 3.0, "counter-2", &format!("[2,5,{}]", i64::MIN)), "{:?}", world.all_read());
}

/// C7: at speed 0 the arm rests, and continues from there once the speed is above 0 again; a paused arm does
/// not.
#[test]
fn speed_nought_rests_and_goes_on_and_a_pause_waits_for_a_start() {
    let press = |seconds, button| by_hand(seconds, &PanelAction::Press(button));
    let mut world = world(vec![
        says(IN_MOTION, &["modifyGSPD", "0"]),
        says(6.0, &["modifyGSPD", "1000"]),
        says(12.1, &["actionPause"]),
        says(13.0, &["modifyGSPD", "500"]),
        says(14.0, &["modifyGSPD", "1000"]),
        press(16.0, Button::Start),
    ]);
    world.run_to(at(20.0));
    assert!(!world.stands(2.9, IN_MOTION), "it did not move");
    assert!(world.goes_on(3.75..6.0, 6.0..7.0), "speed 0");
    assert!(world.always(3.2, 6.0, |seen| seen.mode == 7), "it is not stopped");
    assert!(world.goes_on(12.75..16.0, 16.0..18.0), "a pause");
    for motion in &world.client.motions[..world.client.motions.len() - 1] {
        assert_eq!(world.visits(motion.target), 1, "{motion:?} in {:?}", world.rests);
    }
}

/// P7: each wanted photo causes one photo request.
#[test]
fn photos_are_asked_for() {
    let mut scenario = crate::scenario("P7-unsolicited");
    scenario.faults.clear();
    let mut world = World::new(scenario, 0);
    world.run_to(at(8.9));
    assert_eq!(world.client.seen.photos + world.other.seen.photos, 0);
    world.run_to(at(20.0));
    assert_eq!((world.client.seen.photos, world.other.seen.photos), (4, 4));
}

/// P13: only heartbreaks are answered.
#[test]
fn a_heartbeat_is_no_proof() {
    let mut world = World::new(crate::scenario("P13-task-dead"), 0);
    let answers = |world: &mut World, request: Value| {
        let id = world.controller.connect(world.now);
        world.controller.handle_input(world.now, id, request.to_string().as_bytes());
        let is_answered = world.controller.poll_transmit(world.now, id).is_some();
        world.controller.disconnect(id);
        is_answered
    };
    let heartbreak = json!({"reqType": "heartbreak"});
    let query = json!({"reqType": "query", "queryAddr": ["curMode"]});
    for (seconds, served) in [(4.0, true), (6.0, false), (12.9, false), (13.1, true)] {
        world.run_to(at(seconds));
        // This firmware answers heartbreaks only while the task is dead.
        assert_eq!(answers(&mut world, heartbreak.clone()), !served, "a heartbreak at {seconds} s");
        assert_eq!(answers(&mut world, query.clone()), served, "a query at {seconds} s");
    }
}

/// If two clients count alike, the echoed query shows whose reply it is.
#[test]
fn crossed_replies_with_the_same_numbers() {
    for seed in crate::SEEDS {
        let mut world = World::new(crate::scenario("P4-crossed-reply"), seed);
        world.other = Client::new(world.other.id, false, 1, world.now);
        world.run_to(at(20.0));
        assert!(world.other.seen.strays("contradiction") > 5, "{:?}", world.other.seen);
    }
}

/// C8: a scenario that presses no start moves nothing while the arm rests.
#[test]
fn a_scenario_moves_nothing_by_itself_at_rest() {
    let mut world = World::with(crate::scenario("C8-io"), 0, "remote", false);
    world.run_to(at(30.0));
    assert_eq!(world.rests.len(), 1, "{:?}", world.rests);
    let starts = |what: &Happening| matches!(what, Happening::Panel(PanelAction::Press(Button::Start)));
    assert!(!crate::scenario("C8-io").timeline.iter().any(|entry| starts(&entry.what)));
}
