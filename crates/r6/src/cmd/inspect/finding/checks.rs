//! The checks that need no more than one frame.

use r6_proto::dialect::DsIdForm;
use r6_proto::message::{Action, AddRcc, CommandWords, ExtraKind, Message, TypeKey};
use r6_proto::{Body, RequestType};

use super::{Finding, excerpt};
use crate::output::{self, action};
use r6_proto::request::LONGEST_ADD_RCC;

/// Judges `dsID` and the type.
pub fn header(message: &Message<'_>, finding: &mut Finding) {
    let known = || {
        RequestType::ALL.into_iter().flat_map(|r| [DsIdForm::Long, DsIdForm::Short].map(|form| form.ds_id(r)))
    };
    match message.header.ds_id {
        None => finding.problems.push("`dsID` is missing".to_owned()),
        Some(ds_id) => {
            let ds_id = ds_id.text();
            if !known().any(|known| known == ds_id) {
                let near = r6_proto::nearest(&ds_id, known()).map(|near| format!("; nearest: `{near}`"));
                finding.problems.push(format!(
                    "`dsID` is `{}`, which is not known{}",
                    excerpt(&ds_id),
                    near.unwrap_or_default()
                ));
            }
        }
    }
    let reply = matches!(&message.body, Body::QueryReply(_) | Body::CommandReply(_));
    match message.header.type_key {
        TypeKey::ReqType => {}
        TypeKey::CmdType => finding.notes.push("`cmdType` is the key of older firmware".to_owned()),
        TypeKey::Absent if reply || matches!(&message.body, Body::Unknown(_)) => {}
        TypeKey::Absent => {
            finding.problems.push("`reqType` is missing: such a frame gets no reply".to_owned())
        }
    }
    if message.header.type_word.is_some_and(|word| word.text() == "AddrCC") {
        finding.problems.push("`AddrCC` is a misprint of the manual; nearest: `AddRCC`".to_owned());
    }
}

/// Names every key that does not belong where it stands.
pub fn extras(message: &Message<'_>, finding: &mut Finding) {
    for extra in message.extras() {
        match extra.kind {
            ExtraKind::UnknownKey
            | ExtraKind::DuplicateKey
            | ExtraKind::OtherSpelling
            | ExtraKind::OutOfPlace => {
                finding.problems.push(extra.to_string());
            }
        }
    }
}

/// Judges a command and its arguments.
pub fn command(command: &CommandWords<'_>, finding: &mut Finding) {
    let arguments: Vec<_> = command.arguments().iter().map(|argument| argument.text().into_owned()).collect();
    finding.summary = [vec![command.word().into_owned()], arguments].concat().join(" ");
    if let Err(error) = command.read() {
        finding.problems.push(error.to_string());
        return;
    }
    let Some(name) = command.name() else { return };
    let (wanted, given) = (name.info().arguments.len(), command.arguments().len());
    if given > wanted && name != r6_proto::CommandName::RewriteDataList {
        finding.notes.push(format!("{name} takes {}, {given} given", output::counted(wanted, "argument")));
    }
}

/// Judges instructions.
pub fn list(message: &Message<'_>, list: &AddRcc<'_>, finding: &mut Finding) {
    let count = list.instructions.len();
    let how = match list.empty_list {
        Some(true) => "replace the list",
        Some(false) => "append",
        None => "`emptyList` is missing",
    };
    let mut actions: Vec<String> = Vec::new();
    for instruction in list.instructions {
        let action = instruction.action.name().into_owned();
        if actions.last() != Some(&action) {
            actions.push(action);
        }
    }
    finding.summary = format!("{}, {how}: {}", action::instructions(count), actions.join(", "));
    for (number, instruction) in list.instructions.iter().enumerate() {
        if let Action::Unknown(unknown) = &instruction.action {
            finding
                .problems
                .push(format!("instructions[{number}]: action {} is not known", unknown.number()));
        }
    }
    if list.instructions.iter().any(|instruction| !instruction.oneshot) {
        finding.notes.push("`oneshot` is 0: the list starts over, for ever".to_owned());
    }
    if list.shape_2020 {
        finding.notes.push("the shape of 2020 (`dsData`, `xpos` …)".to_owned());
    }
    let bytes = message.frame().len();
    if bytes > LONGEST_ADD_RCC {
        finding.problems.push(format!(
            "{bytes} bytes: controllers neither answer nor execute more than {LONGEST_ADD_RCC}"
        ));
    }
}
