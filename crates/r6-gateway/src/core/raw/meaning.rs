//! Whether a list means the same in our own encoding.

use serde_json::{Map, Value};

/// What our encoding would change in a list, for people; `None` if nothing. Both are whole `AddRCC` frames.
///
/// The instructions need the same keys, with the same texts or numbers. A controller may take any value for a
/// key that is missing, and may know a key that we do not know.
#[must_use]
pub fn change(theirs: &[u8], ours: &[u8]) -> Option<String> {
    let (Some(theirs), Some(ours)) = (instructions(theirs), instructions(ours)) else {
        return Some("the instructions cannot be compared with our encoding of them".to_owned());
    };
    if theirs.len() != ours.len() {
        return Some(format!("of {} instructions, {} would be sent", theirs.len(), ours.len()));
    }
    let mut pairs = (1..).zip(theirs.iter().zip(&ours));
    pairs.find_map(|(number, (theirs, ours))| {
        let (Value::Object(theirs), Value::Object(ours)) = (theirs, ours) else {
            return Some(format!("instruction {number} is no object"));
        };
        difference(theirs, ours).map(|what| format!("instruction {number}: {what}"))
    })
}

/// The instructions of a frame that has no other place for instructions.
fn instructions(frame: &[u8]) -> Option<Vec<Value>> {
    let Ok(Value::Object(mut frame)) = serde_json::from_slice(frame) else { return None };
    match frame.remove("instructions") {
        Some(Value::Array(instructions)) if !frame.contains_key("dsData") => Some(instructions),
        _ => None,
    }
}

fn difference(theirs: &Map<String, Value>, ours: &Map<String, Value>) -> Option<String> {
    if let Some(key) = theirs.keys().find(|key| !ours.contains_key(*key)) {
        let key: String = key.chars().take(48).collect();
        return Some(format!("the gateway does not send the key `{key}`"));
    }
    ours.iter().find_map(|(key, ours)| match theirs.get(key) {
        None => Some(format!("`{key}` is missing, and firmware may take another value for it than we do")),
        Some(theirs) if !is_same(theirs, ours) => Some(format!("`{key}` would be sent as {ours}")),
        Some(_) => None,
    })
}

/// Whether two values are the same, but for the form of a number.
fn is_same(theirs: &Value, ours: &Value) -> bool {
    match (theirs, ours) {
        (Value::Array(theirs), Value::Array(ours)) => {
            theirs.len() == ours.len() && theirs.iter().zip(ours).all(|(theirs, ours)| is_same(theirs, ours))
        }
        (Value::Object(theirs), Value::Object(ours)) => difference(theirs, ours).is_none(),
        _ => match (text(theirs), text(ours)) {
            (Some(theirs), Some(ours)) => {
                theirs == ours
                    || number(&theirs).is_some_and(|theirs| Some(theirs) == number(&ours))
                    || mask(&theirs).is_some_and(|theirs| Some(theirs) == mask(&ours))
            }
            _ => false,
        },
    }
}

fn text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

/// A number with digits, a sign and a point only: of other forms it is not known how firmware reads them.
fn number(text: &str) -> Option<f64> {
    let plain = text.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'.' | b'-'));
    if plain { text.parse().ok() } else { None }
}

/// A mask with `0x`. Without it, firmware may read the digits in another base.
fn mask(text: &str) -> Option<u32> {
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"))?;
    u32::from_str_radix(digits, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(instruction: &str) -> Vec<u8> {
        format!(r#"{{"reqType":"AddRCC","packID":"1","emptyList":"1","instructions":[{instruction}]}}"#)
            .into_bytes()
    }

    const OURS: &str = r#"{"oneshot":"1","action":"4","m0":"10.000","ckStatus":"0x01","speed":"20.0"}"#;

    #[test]
    fn other_forms_of_the_same_numbers_are_the_same() {
        for theirs in [
            OURS,
            r#"{"action":"4","oneshot":"1","m0":"10","speed":"20","ckStatus":"0x1"}"#,
            r#"{"action":4,"oneshot":1,"m0":10.0,"speed":"20.00","ckStatus":"0X01"}"#,
        ] {
            assert_eq!(change(&frame(theirs), &frame(OURS)), None, "{theirs}");
        }
    }

    #[test]
    fn what_would_be_changed_is_named() {
        for (theirs, part) in [
            (r#"{"oneshot":"1","action":"4","m0":"10","speed":"20"}"#, "`ckStatus` is missing"),
            (
                r#"{"oneshot":"1","action":"4","m0":"10","ckStatus":"0x01","speed":"20","Speed":"5"}"#,
                "`Speed`",
            ),
            (
                r#"{"oneshot":"1","action":"4","m0":"10","ckStatus":"01","speed":"20"}"#,
                "`ckStatus` would be sent",
            ),
            (
                r#"{"oneshot":"1","action":"4","m0":"1e1","ckStatus":"0x01","speed":"20"}"#,
                "`m0` would be sent",
            ),
            (
                r#"{"oneshot":"1","action":"4","m0":true,"ckStatus":"0x01","speed":"20"}"#,
                "`m0` would be sent",
            ),
        ] {
            let told = change(&frame(theirs), &frame(OURS)).unwrap();
            assert!(told.starts_with("instruction 1: ") && told.contains(part), "{told}");
        }
        assert!(change(&frame(""), &frame(OURS)).unwrap().contains("of 0 instructions"));
        let beside = br#"{"instructions":[],"dsData":[{"camID":"0"}]}"#;
        assert!(change(beside, &frame("")).unwrap().contains("cannot be compared"));
    }
}
