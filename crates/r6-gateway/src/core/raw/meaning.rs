//! Whether a list, or the points of a camera, mean the same in our own encoding.

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
    change_of_each("instruction", &theirs, &ours, exact)
}

/// What our encoding would change in the points of a camera, for people; `None` if nothing. Both are whole
/// `AddPoints` frames with one set of points.
///
/// As for instructions. But numbers may have more decimals than we send, because cameras compute them.
#[must_use]
pub fn change_of_points(theirs: &[u8], ours: &[u8]) -> Option<String> {
    let (Some((their_set, theirs)), Some((our_set, ours))) = (points(theirs), points(ours)) else {
        return Some("the points cannot be compared with our encoding of them".to_owned());
    };
    if theirs.len() != ours.len() {
        return Some(format!("of {} points, {} would be sent", theirs.len(), ours.len()));
    }
    let change = difference(&their_set, &our_set, exact).map(|what| format!("the set of points: {what}"));
    change.or_else(|| change_of_each("point", &theirs, &ours, is_rounded))
}

fn change_of_each(what: &str, theirs: &[Value], ours: &[Value], is_same: Compare) -> Option<String> {
    let mut pairs = (1..).zip(theirs.iter().zip(ours));
    pairs.find_map(|(number, (theirs, ours))| {
        let (Value::Object(theirs), Value::Object(ours)) = (theirs, ours) else {
            return Some(format!("{what} {number} is no object"));
        };
        difference(theirs, ours, is_same).map(|change| format!("{what} {number}: {change}"))
    })
}

/// Whether two values of a key are the same.
type Compare = fn(&str, &Value, &Value) -> bool;

/// The instructions of a frame that has no other place for instructions.
fn instructions(frame: &[u8]) -> Option<Vec<Value>> {
    let Ok(Value::Object(mut frame)) = serde_json::from_slice(frame) else { return None };
    match frame.remove("instructions") {
        Some(Value::Array(instructions)) if !frame.contains_key("dsData") => Some(instructions),
        _ => None,
    }
}

/// The set of points of a frame that has one, without its points; and these.
fn points(frame: &[u8]) -> Option<(Map<String, Value>, Vec<Value>)> {
    let Ok(Value::Object(mut frame)) = serde_json::from_slice(frame) else { return None };
    let Some(Value::Array(sets)) = frame.remove("dsData") else { return None };
    let Ok([Value::Object(mut set)]) = <[Value; 1]>::try_from(sets) else { return None };
    match set.remove("data") {
        Some(Value::Array(points)) if !frame.contains_key("instructions") => Some((set, points)),
        _ => None,
    }
}

fn difference(theirs: &Map<String, Value>, ours: &Map<String, Value>, is_same: Compare) -> Option<String> {
    if let Some(key) = theirs.keys().find(|key| !ours.contains_key(*key)) {
        let key: String = key.chars().take(48).collect();
        return Some(format!("the gateway does not send the key `{key}`"));
    }
    ours.iter().find_map(|(key, ours)| match theirs.get(key) {
        None => Some(format!("`{key}` is missing, and firmware may take another value for it than we do")),
        Some(theirs) if !is_same(key, theirs, ours) => Some(format!("`{key}` would be sent as {ours}")),
        Some(_) => None,
    })
}

/// Whether two values are the same, but for the form of a number.
fn is_same(theirs: &Value, ours: &Value) -> bool {
    match (theirs, ours) {
        (Value::Array(theirs), Value::Array(ours)) => {
            theirs.len() == ours.len() && theirs.iter().zip(ours).all(|(theirs, ours)| is_same(theirs, ours))
        }
        (Value::Object(theirs), Value::Object(ours)) => difference(theirs, ours, exact).is_none(),
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

/// [`is_same`], whatever the key.
fn exact(_key: &str, theirs: &Value, ours: &Value) -> bool {
    is_same(theirs, ours)
}

/// The same, or the number rounded to the decimals that we send. Numbers with an exponent are taken, too:
/// programs write those that are almost 0 so.
fn is_rounded(key: &str, theirs: &Value, ours: &Value) -> bool {
    let half = match key {
        "X" | "Y" | "Z" | "U" | "V" | "Angel" => 0.000_000_5,
        "Similarity" => 0.000_5,
        _ => return is_same(theirs, ours),
    };
    let numeric = |byte: u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+' | b'e' | b'E');
    let number = |value: &Value| {
        let text = text(value)?;
        text.parse::<f64>().ok().filter(|_| text.bytes().all(numeric))
    };
    // A little more: 0.0005 has no exact form.
    number(theirs).zip(number(ours)).is_some_and(|(theirs, ours)| (theirs - ours).abs() <= half * 1.001)
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

    fn set(points: &str) -> Vec<u8> {
        format!(r#"{{"reqType":"AddPoints","packID":"1","dsData":[{{"camID":0,"data":[{points}]}}]}}"#)
            .into_bytes()
    }

    const OUR_POINT: &str =
        r#"{"ModelID":0,"X":888.001,"Y":-12.250,"Angel":0.000012,"Similarity":0.988,"Rel":0}"#;

    #[test]
    fn points_may_have_other_forms_and_more_decimals() {
        for theirs in [
            OUR_POINT,
            r#"{"ModelID":"0","X":"888.001","Y":"-12.25","Angel":"1.2e-05","Similarity":"0.98765","Rel":"0"}"#,
            r#"{"Rel":0,"ModelID":0,"X":888.0010004,"Y":-12.2499996,"Angel":1.24e-05,"Similarity":0.9884}"#,
        ] {
            assert_eq!(change_of_points(&set(theirs), &set(OUR_POINT)), None, "{theirs}");
        }
        // Ours may have no decimals.
        for (theirs, ours) in [("0.9997", "1"), ("1e-9", "0"), ("0.0003", "0.000"), ("99.9996", "100")] {
            let point = |similarity: &str| OUR_POINT.replace("0.988", similarity);
            assert_eq!(change_of_points(&set(&point(theirs)), &set(&point(ours))), None, "{theirs}");
        }
    }

    #[test]
    fn what_would_be_changed_in_points_is_named() {
        let point = |from: &str, to: &str| OUR_POINT.replace(from, to);
        for (theirs, part) in [
            (point("\"Rel\":0", "\"Rel\":1"), "point 1: `Rel` would be sent as 0"),
            (point(",\"Rel\":0", ""), "point 1: `Rel` is missing"),
            (point("\"Rel\":0", "\"Rel\":0,\"W\":3"), "point 1: the gateway does not send the key `W`"),
            (point("888.001", "888.002"), "point 1: `X` would be sent"),
            (point("888.001", "888.0010006"), "point 1: `X` would be sent"),
            (point("0.988", "0.9886"), "point 1: `Similarity` would be sent"),
            (point("888.001", "null"), "point 1: `X` would be sent"),
            (point("\"ModelID\":0", "\"ModelID\":0.4"), "point 1: `ModelID` would be sent"),
            (format!("{OUR_POINT},{OUR_POINT}"), "of 2 points, 1 would be sent"),
        ] {
            let told = change_of_points(&set(&theirs), &set(OUR_POINT)).unwrap();
            assert!(told.contains(part), "{theirs}: {told}");
        }
        let of_set =
            String::from_utf8(set(OUR_POINT)).unwrap().replace("\"camID\":0", "\"camID\":0,\"time\":1");
        let told = change_of_points(of_set.as_bytes(), &set(OUR_POINT)).unwrap();
        assert!(told.contains("the set of points: the gateway does not send the key `time`"), "{told}");
        for beside in [
            br#"{"dsData":[{"camID":0,"data":[]},{"camID":1,"data":[]}]}"#.as_slice(),
            br#"{"dsData":[{"camID":0,"data":[]}],"instructions":[]}"#,
            br#"{"dsData":{"camID":0,"data":[]}}"#,
        ] {
            assert!(change_of_points(beside, &set("")).unwrap().contains("cannot be compared"));
        }
    }
}
