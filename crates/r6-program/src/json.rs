//! Programs in JSON: AddRCC frames in the form that the manual prints.

use r6_proto::error::{JsonError, JsonFault};
use r6_proto::message::{Action, AddRcc, ExtraKind, Message, Place, action};
use r6_proto::{Body, Decoder};

use crate::lines;
use crate::mistakes::{MAX_MISTAKES, Mistake, Mistakes};
use crate::run::{MotionList, MotionProgram};

/// Reads one or more consecutive frames, with `//` comments. Invalid JSON ends the reading; a wrong frame
/// does not.
pub fn read(text: &str) -> Result<MotionProgram, Mistakes> {
    let text = text.trim_start_matches('\u{feff}');
    let stripped = lines::without_comments(text);
    let mut program = MotionProgram { lists: Vec::new(), remarks: Vec::new() };
    let mut decoder = Decoder::new();
    let mut wrong = Wrong::default();
    let mut frames = 0;
    let mut from = 0;
    let mut place = lines::Forward::new();
    loop {
        let rest = stripped.get(from..).unwrap_or_default();
        let blanks = rest.len() - rest.trim_start().len();
        from += blanks;
        let rest = rest.trim_start();
        if rest.is_empty() {
            break;
        }
        frames += 1;
        let length = match frame_length(&mut decoder, rest) {
            Ok(length) => length,
            Err(error) => {
                wrong.note(at_fault(text, from, &error));
                break;
            }
        };
        let frame = rest.get(..length).unwrap_or(rest);
        match decoder.decode(frame.as_bytes()) {
            Ok(message) => take(&mut program, &message, place.to(text, from), &mut wrong),
            Err(_) if wrong.is_full() => wrong.more += 1,
            Err(error) => wrong.note(at_fault(text, from, &error)),
        }
        from += length;
    }
    if frames == 0 {
        wrong.note(Mistake::of_the_file("there is no frame in it", None));
    }
    match Mistakes::new(wrong.listed, wrong.more) {
        Some(mistakes) => Err(mistakes),
        None => Ok(program),
    }
}

/// The mistakes so far.
#[derive(Default)]
struct Wrong {
    listed: Vec<Mistake>,
    more: usize,
}

impl Wrong {
    fn is_full(&self) -> bool {
        self.listed.len() >= MAX_MISTAKES
    }

    fn note(&mut self, mistake: Mistake) {
        if !self.is_full() {
            self.listed.push(mistake);
        } else {
            self.more += 1;
        }
    }
}

/// The length of the first frame: the whole text, or up to the point where the decoder expects nothing more.
fn frame_length(decoder: &mut Decoder, text: &str) -> Result<usize, JsonError> {
    match decoder.decode(text.as_bytes()) {
        Ok(_) => Ok(text.len()),
        Err(JsonError { at, fault: JsonFault::Expected("nothing more"), found: Some(b'{') }) => Ok(at),
        Err(error) => Err(error),
    }
}

fn at_fault(text: &str, frame: usize, error: &JsonError) -> Mistake {
    let offset = frame + error.at;
    let found = match error.found {
        None => "the file ends".to_owned(),
        Some(byte @ 0x20..=0x7E) => format!("`{}` stands there", char::from(byte)),
        Some(byte) => format!("byte 0x{byte:02X} stands there"),
    };
    let (what, advice) = match &error.fault {
        JsonFault::KeyWithoutValue(key) => (
            format!("key `{key}` has no value: `:` and a value are due, {found}"),
            (key == "ckStatus").then(|| {
                "the manual misprints this line in 6.1.1; for six axes write \"ckStatus\":\"0x3F\"".to_owned()
            }),
        ),
        JsonFault::Expected("`,` or `]`") => {
            let opened = lines::open_list(text, offset).map(|at| lines::position(text, at));
            let advice = opened.map(|(line, column)| {
                format!("the list that begins at {line}:{column} is not closed: a `]` is missing (as in manual 6.1.1)")
            });
            (format!("`,` or `]` is due, {found}"), advice)
        }
        JsonFault::Expected("a key in double quotes") if error.found == Some(b'}') => (
            "a key is due behind the `,`, `}` stands there".to_owned(),
            Some("take the last `,` away".to_owned()),
        ),
        JsonFault::Expected(due) => (format!("{due} is due, {found}"), None),
        JsonFault::StringNotClosed
        | JsonFault::ControlByteInString
        | JsonFault::BadEscape
        | JsonFault::NumberOutOfRange
        | JsonFault::TooDeep => (error.to_string(), None),
    };
    Mistake { at: Some(lines::position(text, offset)), what, advice }
}

/// Adds the instructions of a frame to the program, or notes all mistakes of the frame.
fn take(program: &mut MotionProgram, message: &Message<'_>, start: (usize, usize), wrong: &mut Wrong) {
    let mistake = |what: String, advice: Option<String>| Mistake { at: Some(start), what, advice };
    let list = match &message.body {
        Body::AddRcc(list) => list,
        Body::Rejected(rejection) => return wrong.note(mistake(rejection.error.to_string(), None)),
        Body::Unknown(unknown) => return wrong.note(mistake(unknown.to_string(), None)),
        Body::Query(_)
        | Body::QueryReply(_)
        | Body::Command(_)
        | Body::CommandReply(_)
        | Body::Heartbreak
        | Body::Photo(_)
        | Body::PhotoAnswer(_)
        | Body::AddPoints(_) => {
            let what = "this frame has no instructions: `r6 run` takes AddRCC frames".to_owned();
            let advice = "read with `r6 query`, send commands with `r6 command`".to_owned();
            return wrong.note(mistake(what, Some(advice)));
        }
    };
    for (number, instruction) in list.instructions.iter().enumerate() {
        if let Action::Unknown(unknown) = &instruction.action {
            let what = format!(
                "instructions[{number}] has action {}, which is not known, so it is not sent",
                unknown.number()
            );
            wrong.note(mistake(what, Some(format!("known actions: {}", action::numbers()))));
        }
    }
    let misspelt = message.extras().filter(|extra| {
        let in_a_step = matches!(extra.place, Place::Instruction(_));
        in_a_step && extra.kind == ExtraKind::UnknownKey && extra.nearest().is_some()
    });
    for extra in misspelt {
        let advice =
            "a step without what this key should say is another step: correct it, or take it out".to_owned();
        wrong.note(mistake(format!("{extra}; nothing is sent"), Some(advice)));
    }
    let replace = list.empty_list.unwrap_or(program.lists.is_empty());
    if replace && !program.lists.is_empty() {
        let advice = "give it \"emptyList\":\"0\", or run the frames from files of their own".to_owned();
        let what = "a later frame replaces the list while the first one runs".to_owned();
        wrong.note(mistake(what, Some(advice)));
    }
    remark(program, message, list, start);
    program.lists.push(MotionList { replace, instructions: list.instructions.to_vec() });
}

fn remark(program: &mut MotionProgram, message: &Message<'_>, list: &AddRcc<'_>, (line, _): (usize, usize)) {
    for extra in message.extras() {
        program.remarks.push(format!("frame at line {line}: {extra}; not sent"));
    }
    if list.shape_2020 {
        program.remarks.push(format!(
            "frame at line {line}: it has the shape of 2020 (`dsData`); sent in today's shape"
        ));
    }
    if list.empty_list.is_none() {
        let means = if program.lists.is_empty() { "1: the list is replaced" } else { "0: it is appended" };
        program.remarks.push(format!("frame at line {line}: `emptyList` is missing, taken as {means}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: &str = r#"{"oneshot":"1","action":"4","m0":"10.0","ckStatus":"0x01","speed":"20"}"#;

    fn frame(head: &str, steps: &[&str]) -> String {
        format!(
            "{{\"dsID\":\"HCRemoteCommand\",\"reqType\":\"AddRCC\"{head},\"instructions\":[{}]}}",
            steps.join(",")
        )
    }

    /// The only mistake of a text.
    fn first(text: &str) -> Mistake {
        let mistakes = read(text).unwrap_err();
        assert_eq!((mistakes.iter().count(), mistakes.more()), (1, 0));
        mistakes.first().clone()
    }

    #[test]
    fn every_frame_that_is_wrong_is_told() {
        let unknown = r#"{"oneshot":"1","action":"14","m0":"1"}"#;
        let misspelt = STEP.replace("speed", "sped");
        let text = [
            frame("", &[unknown, &misspelt]),
            r#"{"dsID":"x","reqType":"query","queryAddr":["version"]}"#.to_owned(),
            frame(",\"emptyList\":\"1\"", &[STEP]),
            "{\"dsID\" 5}".to_owned(),
        ]
        .join("\n");
        let mistakes = read(&text).unwrap_err();
        let found: Vec<_> = mistakes.iter().map(|mistake| (mistake.at.unwrap(), &mistake.what)).collect();
        assert_eq!(
            found.iter().map(|(at, _)| *at).collect::<Vec<_>>(),
            [(1, 1), (1, 1), (2, 1), (3, 1), (4, 9)]
        );
        let parts = ["action 14", "sped", "no instructions", "a later frame replaces the list", "due"];
        assert!(found.iter().zip(parts).all(|((_, what), part)| what.contains(part)), "{found:?}");
        let many = read(&vec![frame("", &[unknown]); MAX_MISTAKES + 5].join(" ")).unwrap_err();
        assert_eq!((many.iter().count(), many.more()), (MAX_MISTAKES, 5));
    }

    #[test]
    fn a_misspelt_key_of_a_step_is_refused_and_a_strange_one_is_remarked() {
        let step = STEP.replace("speed", "sped");
        let error = read(&frame(",\"emptyList\":\"1\"", &[&step])).expect_err("a refusal");
        let text = format!("{error:?}");
        assert!(text.contains("sped") && text.contains("speed"), "{text}");
        let step = STEP.replace("\"speed\"", "\"remark\":\"x\",\"speed\"");
        assert_eq!(read(&frame(",\"emptyList\":\"1\"", &[&step])).unwrap().remarks.len(), 1);
    }

    #[test]
    fn frames_stand_one_behind_the_other() {
        let text = format!(
            "// first\n{}\n{}",
            frame(",\"emptyList\":\"1\"", &[STEP, STEP]),
            frame(",\"emptyList\":\"0\"", &[STEP])
        );
        let program = read(&text).unwrap();
        let shape: Vec<_> =
            program.lists.iter().map(|list| (list.replace, list.instructions.len())).collect();
        assert_eq!(shape, [(true, 2), (false, 1)]);
        assert_eq!(program.remarks, [""; 0]);
    }

    #[test]
    fn what_is_odd_is_remarked() {
        let step = r#"{"oneshot":"1","action":"4","m0":"1","speed":"20","m0":"2","remark":"red"}"#;
        let program = read(&frame("", &[step])).unwrap();
        assert_eq!(program.remarks.len(), 3, "{:?}", program.remarks);
        assert!(
            program.remarks[0].contains("`m0`") && program.remarks[1].contains("`remark`"),
            "{:?}",
            program.remarks
        );
        assert!(program.remarks[2].contains("emptyList"));
        assert!(program.lists[0].replace);
    }

    #[test]
    fn the_misprints_of_the_manual_are_pointed_at() {
        let printed = "{\n  \"reqType\":\"AddRCC\", //x\n  \"instructions\":\n  [\n    {\n      \"action\":\"4\",\n      \"ckStatus\",   //y\n    }\n}";
        let error = first(printed);
        assert_eq!(error.at, Some((7, 17)));
        assert!(error.what.starts_with("key `ckStatus` has no value"), "{}", error.what);
        assert!(error.advice.unwrap().contains("0x3F"));
        let error = first(&printed.replace("\"ckStatus\",", "\"ckStatus\":\"0x3F\""));
        assert_eq!((error.at, error.what.as_str()), (Some((9, 1)), "`,` or `]` is due, `}` stands there"));
        assert!(error.advice.unwrap().contains("begins at 4:3"));
    }

    #[test]
    fn only_instructions_are_run() {
        let query = r#"{"dsID":"x","reqType":"query","queryAddr":["version"]}"#;
        assert!(first(query).what.contains("no instructions"));
        assert!(first("").what.contains("no frame"));
        let error = first(&frame("", &[r#"{"oneshot":"1","action":"14","m0":"1"}"#]));
        assert!(error.what.contains("action 14"), "{}", error.what);
        let error = first(&frame("", &[r#"{"oneshot":"1","action":"4","m0":"ten"}"#]));
        assert!(error.what.contains("instructions[0].m0"), "{}", error.what);
    }
}
