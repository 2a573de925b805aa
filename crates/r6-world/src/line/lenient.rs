//! Reads a received frame as tolerantly as possible.

use r6_client::Reading;
use serde_json::Value;

/// Whether a reply has the number of a request, or no number at all.
pub fn answers(reply: &str, request: &Value) -> bool {
    let number = request["packID"].as_str().unwrap_or_default();
    !reply.contains("\"packID\"") || reply.contains(&format!("\"packID\":\"{number}\""))
}

/// Whether a reply says ok.
pub fn says_ok(reply: &str) -> bool {
    reply.to_ascii_lowercase().contains("ok")
}

/// Whether a frame has this value for this address, at the place of the address in its list. If there is no
/// list of addresses of the same length, the value may be anywhere in its list.
pub fn tells(frame: &str, address: &str, reading: &Reading) -> bool {
    let is_it = |text: &String| is(text, reading);
    let fits = |asked: &Vec<String>, values: &Vec<String>| {
        asked.iter().zip(values).any(|(asked, value)| asked == address && is_it(value))
    };
    let (asked, values) = (lists(frame, "queryAddr"), lists(frame, "queryData"));
    values.iter().any(|values| {
        let mut asked = asked.iter().filter(|asked| asked.len() == values.len()).peekable();
        if asked.peek().is_some() { asked.any(|asked| fits(asked, values)) } else { values.iter().any(is_it) }
    })
}

/// Whether this text is that value. Only numbers are queried here, so other kinds never match.
fn is(text: &str, reading: &Reading) -> bool {
    let is_number = |number: f64| text.trim().parse::<f64>().is_ok_and(|said| said == number);
    match reading {
        #[expect(clippy::cast_precision_loss, reason = "modes, alarms and lengths are small")]
        Reading::Integer(number) => is_number(*number as f64),
        Reading::Decimal(number) => is_number(*number),
        Reading::Text(_) | Reading::Word(_) | Reading::Flag(_) | Reading::Texts(_) | Reading::Counter(_) => {
            false
        }
    }
}

/// Every list with this name in a frame, with its members as text, quoted or not. Frames with invalid JSON
/// are read too, like a reader that accepts the list in spite of an error elsewhere.
fn lists(frame: &str, name: &str) -> Vec<Vec<String>> {
    let name = format!("\"{name}\"");
    let begins = frame.match_indices(&name).filter_map(|(at, _)| frame.get(at + name.len()..));
    let list = |rest: &str| members(rest.trim_start().strip_prefix(':')?.trim_start().strip_prefix('[')?);
    begins.filter_map(list).collect()
}

/// The members of a list, from the byte after its bracket; `None` if the list does not end.
fn members(rest: &str) -> Option<Vec<String>> {
    let (mut members, mut member) = (Vec::new(), String::new());
    let (mut depth, mut in_text, mut escaped) = (0_u32, false, false);
    for letter in rest.chars() {
        match letter {
            _ if escaped => {
                escaped = false;
                member.push(letter);
            }
            '\\' if in_text => escaped = true,
            '"' => in_text = !in_text,
            ',' if !in_text && depth == 0 => members.push(std::mem::take(&mut member)),
            ']' if !in_text && depth == 0 => {
                let is_empty = members.is_empty() && member.trim().is_empty();
                members.extend((!is_empty).then_some(member));
                return Some(members);
            }
            _ => {
                depth += u32::from(!in_text && matches!(letter, '[' | '{'));
                depth = depth.saturating_sub(u32::from(!in_text && matches!(letter, ']' | '}')));
                member.push(letter);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(frame: &str, mode: i64) -> bool {
        tells(frame, "curMode", &Reading::Integer(mode))
    }

    #[test]
    fn a_frame_tells_what_stands_at_the_place_of_the_address() {
        let frame = r#"{"reqType":"query","queryAddr":["curMode","curAlarm"],"queryData":["7", 5]}"#;
        assert!(mode(frame, 7) && !mode(frame, 5));
        assert!(tells(frame, "curAlarm", &Reading::Decimal(5.0)));
        // Firmware may repeat no addresses. Then any of its values may be the one.
        let frame = r#"{"reqType":"query","queryData":["7","5"]}"#;
        assert!(mode(frame, 7) && mode(frame, 5) && !mode(frame, 6));
        assert!(!tells(frame, "curMode", &Reading::Flag(true)));
    }

    #[test]
    fn a_frame_that_is_no_json_tells_its_own_values_and_no_others() {
        let nan = r#"{"queryAddr":["axis-0","curMode"],"queryData":[NaN,"7"],"x":{}"#;
        assert!(mode(nan, 7) && !mode(nan, 2));
        for none in [r#"{"queryData":7}"#, r#"{"queryData":["7""#, r#"{"queryDatb":["7"]}"#, "queryData", ""]
        {
            assert!(!mode(none, 7), "{none}");
        }
        let twice = r#"{"queryData":["7"],"queryData":["2"]}"#;
        assert!(mode(twice, 7) && mode(twice, 2));
    }
}
