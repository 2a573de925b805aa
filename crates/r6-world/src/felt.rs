//! Which faults took effect at a controller: what its log says of them, and what people did.

use std::collections::BTreeSet;

use r6_controller::fault::file::FAULTS;
use r6_controller::{Key, Level, LogLine, PanelAction};

use crate::fault::{CLASSES, Class};
use crate::record::Record;

/// What the log says of what a fault struck; the fault's word follows.
const STRUCK: [&str; 7] = [
    "the connection was struck by fault ",
    "a reply was struck by fault ",
    "not answered: fault ",
    "answered with old values: fault ",
    "answered ok and not carried out (fault ",
    "answered err and not carried out (fault ",
    "at its point (fault ",
];

/// How lines of the log begin, or what they have, that tell of a fault without its word.
const SAYS: [(&str, Class); 8] = [
    ("AddRCC refused: the instruction list is full", Class::P11),
    ("AddRCC refused: an instruction in the middle", Class::P12),
    ("scenario: another master speaks", Class::P14),
    ("scenario: the mains fail", Class::C4),
    ("scenario: counter ", Class::C5),
    ("scenario: input ", Class::C8),
    ("scenario: output ", Class::C8),
    (" beyond its soft limit", Class::C6),
];

/// What a scenario has in force at a controller.
#[derive(Debug, Default)]
pub struct Felt {
    in_force: BTreeSet<String>,
    /// Instructions that wait have been seen since the list was frozen.
    waits: bool,
    /// Another master speaks: what the next line tells is his.
    master_speaks: bool,
}

impl Felt {
    /// Whether the scenario has this fault in force.
    #[must_use]
    pub fn is_in_force(&self, word: &str) -> bool {
        self.in_force.contains(word)
    }

    /// It was switched off: its scenario begins anew.
    pub fn boots(&mut self) {
        *self = Self::default();
    }

    /// A line of the log; `moves`: whether the arm moves after it.
    pub fn read(&mut self, line: &LogLine, moves: bool, record: &mut Record) {
        let text = line.text.as_str();
        if let Some(window) = text.strip_prefix("scenario: fault ") {
            return self.change(window);
        }
        let struck = STRUCK.iter().find_map(|says| text.split_once(says)).map(|(_, fault)| word(fault));
        // Without mains every connection is half-open, which no fault has done.
        if let Some(word) = struck.filter(|word| *word != "half-open" || self.is_in_force(word))
            && let Some(class) = class_of(word)
        {
            record.strikes(class);
        }
        let is_masters =
            std::mem::replace(&mut self.master_speaks, text == "scenario: another master speaks");
        if is_masters && text.starts_with("AddRCC: 0 instructions, list replaced") && moves {
            record.strikes(Class::E5);
        }
        // What the machine refused is told once more, as a warning.
        let is_told_of = |says: &str| {
            let is_done = line.level == Level::Info || !says.starts_with("scenario: ");
            is_done && if says.starts_with(' ') { text.contains(says) } else { text.starts_with(says) }
        };
        for (_, class) in SAYS.iter().filter(|(says, _)| is_told_of(says)) {
            record.strikes(*class);
        }
        let is_pace = ["modifyGSPD ", "actionPause"].iter().any(|word| text.starts_with(word));
        if is_pace && moves && !text.contains("not carried out") {
            record.strikes(Class::C7);
        }
    }

    /// A fault begins or ends.
    fn change(&mut self, window: &str) {
        let word = word(window).to_owned();
        if window.ends_with("begins") {
            self.in_force.insert(word);
        } else if self.in_force.remove(&word) && word == "list-frozen" {
            self.waits = false;
        }
    }

    /// The machine may run, and has instructions that it does not begin where its list is frozen.
    pub fn has_instructions(&mut self, record: &mut Record) {
        if self.is_in_force("list-frozen") && !std::mem::replace(&mut self.waits, true) {
            record.strikes(Class::P11);
        }
    }
}

/// The word of a fault that a line goes on with.
fn word(text: &str) -> &str {
    text.split([' ', ')']).next().unwrap_or_default()
}

fn class_of(word: &str) -> Option<Class> {
    let (_, name) = FAULTS.iter().find(|(other, _)| *other == word)?;
    CLASSES.iter().map(|(class, ..)| *class).find(|class| format!("{class:?}") == *name)
}

/// The class of what a person does at a panel, once it is done.
#[must_use]
pub fn class_of_deed(action: &PanelAction) -> Option<Class> {
    match action {
        PanelAction::TurnKey(Key::Manual | Key::Stop) => Some(Class::C1),
        PanelAction::EmergencyStop => Some(Class::C2),
        PanelAction::RaiseAlarm(crate::plan::NOBODYS_ALARM) => Some(Class::P9),
        PanelAction::RaiseAlarm(_) => Some(Class::C3),
        PanelAction::LoadProgram { .. } => Some(Class::C10),
        PanelAction::TurnKey(Key::Auto)
        | PanelAction::Press(_)
        | PanelAction::ReleaseEmergencyStop
        | PanelAction::ClearAlarm
        | PanelAction::Jog { .. }
        | PanelAction::SwitchProgram(_)
        | PanelAction::SetInput { .. }
        | PanelAction::SetEuInput { .. }
        | PanelAction::Home => None,
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::time::Instant;

    use super::*;

    fn strikes(lines: &[(Level, &str)]) -> Vec<(Class, u64)> {
        let (mut felt, mut record) = (Felt::default(), Record::new(false));
        for (level, text) in lines {
            let line =
                LogLine { at: Instant::ORIGIN, connection: None, level: *level, text: (*text).to_owned() };
            felt.read(&line, false, &mut record);
        }
        let struck = CLASSES.iter().map(|(class, ..)| (*class, record.tally.faults[class.index()].strikes));
        struck.filter(|(_, strikes)| *strikes > 0).collect()
    }

    #[test]
    fn every_fault_of_a_scenario_has_a_class_here() {
        for (word, _) in FAULTS {
            assert!(class_of(word).is_some(), "{word}");
        }
    }

    #[test]
    fn only_what_struck_counts() {
        let info = |text| (Level::Info, text);
        let begins = (Level::Warning, "scenario: fault half-open begins");
        let half_open = info("the connection was struck by fault half-open");
        assert_eq!(strikes(&[begins]), []);
        assert_eq!(strikes(&[half_open]), []);
        assert_eq!(strikes(&[begins, half_open]), [(Class::T6, 1)]);
        assert_eq!(strikes(&[info("a reply was struck by fault bad-list (short)")]), [(Class::P5, 1)]);
        let not_done = "actionStop: answered ok and not carried out (fault not-executed)";
        assert_eq!(strikes(&[info(not_done)]), [(Class::P10, 1)]);
        let counter = "scenario: counter 0 is set to 7";
        assert_eq!(strikes(&[info(counter)]), [(Class::C5, 1)]);
        assert_eq!(strikes(&[(Level::Warning, counter)]), []);
    }
}
