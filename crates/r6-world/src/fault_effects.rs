//! Which faults took effect at a controller, from its log and from what people did.

use std::collections::BTreeSet;

use r6_controller::event::{AlarmCause, ListRefusal};
use r6_controller::fault::file::FAULTS;
use r6_controller::fault::{Fault, TaskFault};
use r6_controller::scenario::Happening;
use r6_controller::{Event, Key, LogEntry, PanelAction};

use crate::fault::{CLASSES, Class};
use crate::record::Record;

/// The faults of a scenario that are in force at a controller.
#[derive(Debug, Default)]
pub struct FaultEffects {
    in_force: BTreeSet<String>,
    /// Whether waiting instructions were seen since the list was frozen.
    waits: bool,
    /// Whether another master sends, so that the next line of the log is about its request.
    master_speaks: bool,
}

impl FaultEffects {
    /// Whether this fault of the scenario is in force.
    #[must_use]
    pub fn is_in_force(&self, word: &str) -> bool {
        self.in_force.contains(word)
    }

    /// The controller was started again, and its scenario starts again.
    pub fn boots(&mut self) {
        *self = Self::default();
    }

    /// Reads an entry of the log. `moves`: whether the arm moves after it.
    pub fn read(&mut self, entry: &LogEntry, moves: bool, record: &mut Record) {
        let is_masters = std::mem::take(&mut self.master_speaks);
        let pause = |command: &str| ["modifyGSPD", "actionPause"].contains(&command);
        let class = match &entry.event {
            Event::FaultBegins { fault } => {
                self.in_force.insert(fault.word().to_owned());
                None
            }
            Event::FaultEnds { fault } => {
                if self.in_force.remove(fault.word()) && fault.word() == "list-frozen" {
                    self.waits = false;
                }
                None
            }
            Event::Struck { fault } => self.class_in_force(fault),
            Event::NotAnswered { fault } | Event::OldValues { fault } => {
                self.class_in_force(&Fault::Task(*fault))
            }
            Event::StopIgnored { how, .. } => self.class_in_force(&Fault::Task(TaskFault::StopIgnored(*how))),
            Event::Dwells { rest } => self.class_in_force(&Fault::Task(TaskFault::Dwell { rest: *rest })),
            Event::ListComesLate { .. } => class_of("late-list"),
            Event::CommandAccepted { done: false, .. } | Event::ListTaken { done: false, .. } => {
                class_of("not-executed")
            }
            Event::ListTaken { instructions: 0, replaced: true, .. } if is_masters && moves => {
                Some(Class::E5)
            }
            Event::CommandAccepted { command, .. } if moves && pause(command.as_str()) => Some(Class::C7),
            Event::ListRefused { why: ListRefusal::ListFull } => Some(Class::P11),
            Event::ListRefused { why: ListRefusal::InTheMiddle } => Some(Class::P12),
            Event::AlarmRaised { alarm, why: AlarmCause::Step { .. } } if alarm.is_soft_limit() => {
                Some(Class::C6)
            }
            Event::Happens { what } => {
                self.master_speaks = matches!(what, Happening::Request(_));
                class_of_happening(what)
            }
            _ => None,
        };
        if let Some(class) = class {
            record.strikes(class);
        }
    }

    /// The class of a fault that struck. Without mains every connection is half-open, which does not count as
    /// a fault.
    fn class_in_force(&self, fault: &Fault) -> Option<Class> {
        let word = fault.word();
        (word != "half-open" || self.is_in_force(word)).then(|| class_of(word)).flatten()
    }

    /// Records that the machine may run and has instructions. If the list is frozen, it does not begin them.
    pub fn has_instructions(&mut self, record: &mut Record) {
        if self.is_in_force("list-frozen") && !std::mem::replace(&mut self.waits, true) {
            record.strikes(Class::P11);
        }
    }
}

/// The class of an event in a scenario.
fn class_of_happening(what: &Happening) -> Option<Class> {
    match what {
        Happening::Request(_) => Some(Class::P14),
        Happening::PowerCut { .. } => Some(Class::C4),
        Happening::Counter { .. } => Some(Class::C5),
        Happening::Output(..)
        | Happening::Bounce(_)
        | Happening::Panel(PanelAction::SetInput { .. } | PanelAction::SetEuInput { .. }) => Some(Class::C8),
        Happening::Panel(_) | Happening::Photo(_) => None,
    }
}

fn class_of(word: &str) -> Option<Class> {
    let (_, name) = FAULTS.iter().find(|(other, _)| *other == word)?;
    CLASSES.iter().map(|(class, ..)| *class).find(|class| format!("{class:?}") == *name)
}

/// The class of a person's action at a panel, after it is done.
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
        | PanelAction::ClearPoints
        | PanelAction::Jog { .. }
        | PanelAction::HoldJog { .. }
        | PanelAction::KeepJog
        | PanelAction::EndJog
        | PanelAction::SwitchProgram(_)
        | PanelAction::SetInput { .. }
        | PanelAction::SetEuInput { .. }
        | PanelAction::Home => None,
    }
}

#[cfg(test)]
mod tests {
    use r6_controller::event::{Detail, DidNot};
    use r6_controller::fault::{BadList, LinkFault, ReplyFault};
    use r6_proto::time::Instant;

    use super::*;

    fn strikes(events: &[Event]) -> Vec<(Class, u64)> {
        let (mut felt, mut record) = (FaultEffects::default(), Record::new(false));
        for event in events {
            let entry = LogEntry { at: Instant::ORIGIN, connection: None, event: event.clone() };
            felt.read(&entry, false, &mut record);
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
        let half_open = Fault::Link(LinkFault::HalfOpen);
        let begins = Event::FaultBegins { fault: half_open.clone() };
        let struck = Event::Struck { fault: half_open };
        assert_eq!(strikes(std::slice::from_ref(&begins)), []);
        assert_eq!(strikes(std::slice::from_ref(&struck)), []);
        assert_eq!(strikes(&[begins, struck]), [(Class::T6, 1)]);
        let short = Event::Struck { fault: Fault::Reply(ReplyFault::BadList(BadList::Short)) };
        assert_eq!(strikes(&[short]), [(Class::P5, 1)]);
        let not_done =
            Event::CommandAccepted { command: Detail::of("actionStop"), arguments: Vec::new(), done: false };
        assert_eq!(strikes(&[not_done]), [(Class::P10, 1)]);
        let what = Happening::Counter { id: 0, current: 7, target: None };
        let refused = DidNot::TooManyCounters { limit: 1 };
        assert_eq!(strikes(&[Event::Happens { what: what.clone() }]), [(Class::C5, 1)]);
        assert_eq!(strikes(&[Event::DidNotHappen { what, why: refused }]), []);
    }
}
