//! With any input at any time: nothing panics, only what may be answered is answered, and other connections
//! are served.

mod common;

use common::{Cell, STOPS_AND_STARTS};
use proptest::prelude::*;
use proptest::sample::Index;
use r6_controller::{Profile, RobotModel};
use r6_testkit::vector;
use serde_json::{Value, json};

/// An event at a controller.
#[derive(Clone, Debug)]
enum Event {
    /// A golden frame arrives.
    Vector(Index),
    /// A golden frame arrives with one byte changed.
    Mutated(Index, Index, u8),
    /// Bytes arrive.
    Bytes(Vec<u8>),
    /// A short list arrives.
    List(Vec<Value>, bool),
    /// A command arrives.
    Command(Index),
    /// An input changes.
    Input(u8, bool),
    /// Time passes, in milliseconds.
    Pass(u32),
    /// The connection is lost, and a new one is made.
    Reconnect,
}

fn instruction() -> impl Strategy<Value = Value> {
    let angle = -200.0..200.0_f64;
    prop_oneof![
        (prop::array::uniform6(angle), prop::sample::select(vec!["4", "10"]), 0.0..120.0_f64, any::<bool>()).prop_map(
            |(to, action, speed, oneshot)| {
                let mut step = json!({"oneshot": u8::from(oneshot), "action": action, "speed": format!("{speed:.1}")});
                for (n, value) in to.into_iter().enumerate() {
                    step[format!("m{n}")] = json!(format!("{value:.3}"));
                }
                step
            }
        ),
        (0..9_u8, 0..32_u8, 0..4_u8, 0.0..2.0_f64, any::<bool>()).prop_map(|(kind, point, status, limit, unlimited)| {
            json!({"oneshot": "1", "action": "100", "type": kind.to_string(), "point": point.to_string(),
                "io_status": status.to_string(), "limit": format!("{limit:.1}"), "isUnlimit": u8::from(unlimited)})
        }),
        (0..33_u8, any::<bool>()).prop_map(|(point, on)| {
            json!({"oneshot": "1", "action": "200", "type": "100", "io_status": u8::from(on), "point": point, "delay": "0.5"})
        }),
        (0..32_u8, any::<bool>()).prop_map(|(input, used)| {
            json!({"oneshot": "1", "action": "52", "isUse": u8::from(used), "ioNumber": input, "io_status": "1"})
        }),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        2 => any::<Index>().prop_map(Event::Vector),
        1 => (any::<Index>(), any::<Index>(), any::<u8>()).prop_map(|(a, b, c)| Event::Mutated(a, b, c)),
        1 => prop::collection::vec(any::<u8>(), 0..200).prop_map(Event::Bytes),
        3 => (prop::collection::vec(instruction(), 0..4), any::<bool>()).prop_map(|(a, b)| Event::List(a, b)),
        3 => any::<Index>().prop_map(Event::Command),
        1 => (0..32_u8, any::<bool>()).prop_map(|(point, on)| Event::Input(point, on)),
        4 => (0..4_000_u32).prop_map(Event::Pass),
        1 => Just(Event::Reconnect),
    ]
}

fn apply(cell: &mut Cell, vectors: &[Vec<u8>], event: &Event) {
    match event {
        Event::Vector(index) => cell.send(index.get(vectors)),
        Event::Mutated(index, at, byte) => {
            let mut frame = index.get(vectors).clone();
            let at = at.index(frame.len());
            frame[at] = *byte;
            cell.send(frame);
        }
        Event::Bytes(bytes) => cell.send(bytes),
        Event::List(steps, replace) => cell.add_rcc(if *replace { "1" } else { "0" }, &json!(steps)),
        Event::Command(index) => {
            cell.send(json!({"reqType": "command", "cmdData": index.get(&STOPS_AND_STARTS)}).to_string());
        }
        Event::Input(point, on) => cell.controller.set_input(cell.now, 0, *point, *on),
        Event::Pass(ms) => cell.pass(f64::from(*ms) / 1000.0),
        Event::Reconnect => {
            cell.controller.disconnect(cell.id);
            cell.id = cell.controller.connect(cell.now);
        }
    }
    if cell.controller.is_over(cell.id) {
        cell.controller.disconnect(cell.id);
        cell.id = cell.controller.connect(cell.now);
    }
}

/// The state read over a second connection, as one JSON object.
fn look(cell: &mut Cell) -> Value {
    let id = cell.controller.connect(cell.now);
    let query = br#"{"reqType":"query","queryAddr":["curMode","curAlarm","isMoving","RemoteCmdLen","axis-0","axis-1","axis-2","axis-3","axis-4","axis-5"]}"#;
    cell.controller.handle_input(cell.now, id, query);
    let reply = cell.controller.poll_transmit(cell.now, id).expect("a second connection is served").to_vec();
    cell.controller.disconnect(id);
    serde_json::from_slice(&reply).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_happens_the_controller_holds_together(events in prop::collection::vec(event(), 1..40), profile in 0..4_usize) {
        let vectors: Vec<Vec<u8>> = vector::all().into_iter().map(|vector| vector.frame).collect();
        let limits = RobotModel::named("BRTIRUS0707A").unwrap().soft_limits();
        let profile = Profile::named(Profile::names()[profile]).unwrap();
        let legacy = profile.name != "hc1";
        let mut cell = Cell::with(profile, Default::default());
        for event in &events {
            apply(&mut cell, &vectors, event);
            while let Some(frame) = cell.frame() {
                prop_assert!(serde_json::from_str::<Value>(&frame).is_ok(), "{}", frame);
            }
            let seen = look(&mut cell);
            let data = seen["queryData"].as_array().unwrap();
            // RemoteCmdLen is not in V6.0: those profiles leave it out.
            prop_assert_eq!(data.len(), if legacy { 9 } else { 10 });
            let axes = &data[data.len() - 6..];
            for (axis, limit) in axes.iter().zip(limits) {
                let degrees: f64 = axis.as_str().unwrap().parse().unwrap();
                prop_assert!((limit.min - 1e-6..=limit.max + 1e-6).contains(&degrees), "{} outside {:?}", degrees, limit);
            }
            let (mode, alarm) = (data[0].as_str().unwrap(), data[1].as_str().unwrap());
            prop_assert!(alarm == "0" || mode == "2", "mode {} with alarm {}", mode, alarm);
        }
    }

    #[test]
    fn the_same_events_give_the_same_bytes(events in prop::collection::vec(event(), 1..20)) {
        let vectors: Vec<Vec<u8>> = vector::all().into_iter().map(|vector| vector.frame).collect();
        let run = || {
            let mut cell = Cell::new();
            let mut bytes = Vec::new();
            for event in &events {
                apply(&mut cell, &vectors, event);
                while let Some(frame) = cell.frame() {
                    bytes.push(frame);
                }
                bytes.push(look(&mut cell).to_string());
            }
            bytes
        };
        prop_assert_eq!(run(), run());
    }
}
