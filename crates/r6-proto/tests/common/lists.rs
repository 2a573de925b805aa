//! Compares the decoded lists of a frame with serde_json's values, by the rules in [`super::listed`].

use std::collections::BTreeMap;

use r6_proto::RequestType;
use r6_proto::message::{Action, AddPoints, AddRcc, Instruction, Rejection};
use serde_json::{Map, Value};

use super::listed::{self, Does, flag, integer};
use super::value;

/// The two spellings of a point's angle. If both are present, the later one counts. serde_json's map does not
/// tell which one came later.
const SPELLINGS: [[&str; 2]; 2] = [["Angel", "Angle"], ["Angle", "Angel"]];

/// Compares the cameras and every member of each point.
pub fn points(ours: &AddPoints<'_>, theirs: &Map<String, Value>) {
    let sets = theirs["dsData"].as_array().expect("sets");
    assert_eq!(ours.sets().len(), sets.len());
    for ((cam_id, points), theirs) in ours.sets().zip(sets) {
        assert_eq!(Some(cam_id), integer(&theirs["camID"]));
        let theirs = theirs["data"].as_array().expect("points");
        assert_eq!(points.len(), theirs.len());
        for (point, theirs) in points.iter().zip(theirs) {
            let said = SPELLINGS.map(|keys| listed::point(theirs, keys));
            assert!(said.contains(&Some(*point)), "{point:?} and {theirs}");
        }
    }
}

/// Compares the instructions in either shape, and `emptyList`.
pub fn instructions(list: &AddRcc<'_>, theirs: &Map<String, Value>) {
    assert_eq!(list.shape_2020, !theirs.contains_key("instructions"));
    assert_eq!(list.empty_list, theirs.get("emptyList").and_then(flag));
    assert_eq!(list.empty_list.is_some(), theirs.contains_key("emptyList"));
    let theirs = match theirs.get("instructions") {
        Some(list) => list.as_array().expect("instructions").clone(),
        None => listed::from_2020(&theirs["dsData"]),
    };
    assert_eq!(list.instructions.len(), theirs.len());
    for (ours, theirs) in list.instructions.iter().zip(&theirs) {
        instruction(list, ours, theirs);
    }
}

/// Every member of the instruction must agree, and absent members must stay absent.
fn instruction(list: &AddRcc<'_>, ours: &Instruction, theirs: &Value) {
    let (oneshot, does) =
        listed::instruction(theirs).unwrap_or_else(|| panic!("only we read it: {ours:?} and {theirs}"));
    assert_eq!(ours.oneshot, oneshot, "{theirs}");
    match (&ours.action, does) {
        (Action::Unknown(unknown), Does::Unknown(number)) => {
            assert_eq!(unknown.number(), number);
            // If a member occurs twice, the later one counts.
            let fields: BTreeMap<_, _> =
                list.unknown_fields(unknown).map(|(name, value)| (name.text().into_owned(), value)).collect();
            let theirs = theirs.as_object().expect("it was read");
            for key in theirs.keys().filter(|key| !["oneshot", "action"].contains(&key.as_str())) {
                value(key, fields.get(key).copied(), theirs.get(key));
            }
            assert!(fields.keys().all(|key| theirs.contains_key(key)), "{fields:?} and {theirs:?}");
        }
        (ours, does) => assert_eq!(does, Does::Known(*ours), "{theirs}"),
    }
}

/// A rejected frame must have an error in it.
pub fn rejected(rejection: &Rejection<'_>, frame: &[u8], theirs: &Map<String, Value>) {
    // A bare number of more than 64 characters is not read, and serde_json's value does not show its length.
    let is_number = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let long_number = frame.split(|byte| !is_number(byte)).any(|run| run.len() > 64);
    let sound = match rejection.request {
        _ if theirs.contains_key("cmdReply") => return,
        RequestType::AddRcc => {
            theirs.get("emptyList").is_none_or(|value| flag(value).is_some())
                && theirs.get("instructions").and_then(Value::as_array).is_some_and(|list| {
                    list.iter().all(|instruction| listed::instruction(instruction).is_some())
                })
        }
        RequestType::AddPoints => theirs.get("dsData").and_then(Value::as_array).is_some_and(|sets| {
            sets.iter().all(|set| {
                let readable =
                    |point: &Value| SPELLINGS.into_iter().all(|keys| listed::point(point, keys).is_some());
                set.get("camID").is_some_and(|id| integer(id).is_some())
                    && set["data"].as_array().is_some_and(|points| points.iter().all(readable))
            })
        }),
        RequestType::Query | RequestType::Command | RequestType::Heartbreak | RequestType::Photo => return,
    };
    let frame = frame.escape_ascii();
    assert!(long_number || !sound, "nothing is wrong, and it was refused: {:?} {frame}", rejection.error);
}
