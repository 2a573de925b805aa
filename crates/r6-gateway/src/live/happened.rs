//! What was seen at a robot, for readers: times are texts, and alarms have their meaning.

use r6_api::Alarm;
use r6_api::gateway::Happened;
use r6_proto::Address;
use r6_proto::alarm::AlarmCode;

use crate::clock;
use crate::core::history::event::Observed;

/// What was seen, as readers get it.
pub fn happened(observed: Observed) -> Happened {
    match observed {
        Observed::AlarmBegan { code } => {
            let Alarm { text, remedy, .. } = Alarm::of(AlarmCode(code));
            Happened::AlarmBegan { code, text, remedy }
        }
        Observed::AlarmEnded { code, lasted_ms } => {
            let Alarm { text, .. } = Alarm::of(AlarmCode(code));
            Happened::AlarmEnded { code, text, lasted_ms }
        }
        Observed::ModeChanged { from, to } => Happened::ModeChanged { from, to },
        Observed::ProgramChanged { from, to } => Happened::ProgramChanged { from, to },
        Observed::CycleDone { count, at_least, ms, at } => {
            Happened::CycleDone { count, at_least, ms, at: clock::text(at) }
        }
        Observed::Parts { counter, added, total } => Happened::Parts { counter: name(counter), added, total },
        Observed::PartsReset { counter, from, to } => {
            Happened::PartsReset { counter: name(counter), from, to }
        }
        Observed::LinkLost {} => Happened::LinkLost {},
        Observed::LinkBack {} => Happened::LinkBack {},
        Observed::Unseen { from, to, because } => {
            Happened::Unseen { from: from.map(clock::text), to: clock::text(to), because }
        }
    }
}

/// The address of a counter.
fn name(counter: u32) -> String {
    Address::Counter(counter).to_string()
}
