//! The checks of a single frame.

use std::borrow::Cow;

use r6_proto::dialect::DsIdForm;
use r6_proto::message::{Action, AddRcc, CommandWords, Message, TypeKey};
use r6_proto::request::LONGEST_ADD_RCC;
use r6_proto::{Body, CommandName, RequestType};

use super::problem::counted;
use super::{Finding, Note, Problem};

/// Judges `dsID` and the type.
pub fn header(message: &Message<'_>, finding: &mut Finding) {
    let known = || {
        RequestType::ALL.into_iter().flat_map(|r| [DsIdForm::Long, DsIdForm::Short].map(|form| form.ds_id(r)))
    };
    match message.header.ds_id.map(|ds_id| ds_id.text().into_owned()) {
        None => finding.problems.push(Problem::NoDsId),
        Some(ds_id) if known().any(|known| known == ds_id) => {}
        Some(ds_id) => {
            let nearest = r6_proto::nearest(&ds_id, known());
            finding.problems.push(Problem::UnknownDsId { ds_id, nearest });
        }
    }
    let reply = matches!(&message.body, Body::QueryReply(_) | Body::CommandReply(_));
    match message.header.type_key {
        TypeKey::ReqType => {}
        TypeKey::CmdType => finding.notes.push(Note::OldTypeKey),
        TypeKey::Absent if reply || matches!(&message.body, Body::Unknown(_)) => {}
        TypeKey::Absent => finding.problems.push(Problem::NoType),
    }
    if message.header.type_word.is_some_and(|word| word.text() == "AddrCC") {
        finding.problems.push(Problem::MisprintedAddRcc);
    }
}

/// Reports every unknown, repeated, misspelt or misplaced key.
pub fn extras(message: &Message<'_>, finding: &mut Finding) {
    finding.problems.extend(message.extras().map(|extra| Problem::Key(extra.to_key())));
}

/// Judges a command and its arguments.
pub fn command(command: &CommandWords<'_>, finding: &mut Finding) {
    let arguments = command.arguments().iter().map(|argument| argument.text());
    let words: Vec<_> = [command.word()].into_iter().chain(arguments).collect();
    finding.summary = words.join(" ");
    if let Err(error) = command.read() {
        finding.problems.push(Problem::WrongCommand(error));
        return;
    }
    let Some(name) = command.name() else { return };
    let (takes, given) = (name.info().arguments.len(), command.arguments().len());
    if given > takes && name != CommandName::RewriteDataList {
        finding.notes.push(Note::SpareArguments { command: name, takes, given });
    }
}

/// Judges instructions.
pub fn list(message: &Message<'_>, list: &AddRcc<'_>, finding: &mut Finding) {
    let count = counted(list.instructions.len(), "instruction");
    let how = match list.empty_list {
        Some(true) => "replace the list",
        Some(false) => "append",
        None => "`emptyList` is missing",
    };
    let mut actions: Vec<Cow<'_, str>> = list.instructions.iter().map(|one| one.action.name()).collect();
    actions.dedup();
    finding.summary = format!("{count}, {how}: {}", actions.join(", "));
    for (instruction, one) in list.instructions.iter().enumerate() {
        if let Action::Unknown(unknown) = &one.action {
            finding.problems.push(Problem::UnknownAction { instruction, action: unknown.number() });
        }
    }
    if list.instructions.iter().any(|instruction| !instruction.oneshot) {
        finding.notes.push(Note::Repeats);
    }
    if list.shape_2020 {
        finding.notes.push(Note::Shape2020);
    }
    let bytes = message.frame().len();
    if bytes > LONGEST_ADD_RCC {
        finding.problems.push(Problem::TooLongAddRcc { bytes });
    }
}
