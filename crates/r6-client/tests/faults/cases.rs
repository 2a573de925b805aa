//! Which faults there are, what goes wrong in each case, and how it is felt.

use r6_client::Cause;

use crate::work::Fate;
use crate::world::Outcome;

/// What goes wrong.
#[derive(Clone, Copy, Debug)]
pub enum Text {
    /// A file of `examples/scenarios`.
    File,
    /// A scenario of its own.
    Own(&'static str),
}

/// One case.
#[derive(Clone, Copy)]
pub struct Case {
    /// The fault's number, and what is told apart within it.
    pub name: &'static str,
    pub text: Text,
    pub profile: &'static str,
    /// How much later than the fault's end what it held up is through, ms.
    pub held_up: u64,
    /// Whether the client had to feel it, as this shows. Without the fault it does not.
    pub felt: fn(&Outcome) -> bool,
}

const fn file(name: &'static str, felt: fn(&Outcome) -> bool) -> Case {
    Case { name, text: Text::File, profile: "hc1", held_up: 0, felt }
}

/// Every case but the two of the client's own (`cancelled.rs`, `killed.rs`).
pub const CASES: &[Case] = &[
    file("T1-refuse", |seen| seen.line.refused > 5),
    file("T2-black-hole", |seen| seen.line.unanswered > 0),
    file("T3-silence", |seen| seen.line.sent.len() > 2 && seen.quality.timeouts > 1),
    file("T4-reset-mid-frame", |seen| seen.line.resets > 3),
    file("T5-close-before-reply", |seen| seen.line.ends > 3),
    file("T6-half-open", |seen| seen.quality.timeouts > 1 && seen.line.sent.len() > 1),
    file("T7-pieces", |seen| seen.line.parts > 300),
    file("T7-coalesce", |seen| seen.line.together > 5),
    Case { held_up: 3000, ..file("T8-latency", |seen| seen.quality.timeouts > 1) },
    file("T9-slow", |seen| seen.quality.timeouts > 1),
    file("T14-stall", |seen| seen.line.parts > 10),
    file("P1-bad-json", |seen| seen.quality.garbled > 5),
    file("P2-bad-field", |seen| seen.notes.unreadable + seen.notes.failures > 1),
    file("P3-bad-pack-id", |seen| seen.quality.strays > 5),
    file("P3-late-reply", |seen| seen.quality.strays > 1 && seen.quality.timeouts > 1),
    file("P6-echo", |seen| seen.quality.strays > 5 && seen.quality.timeouts > 1),
    file("P7-unsolicited", |seen| seen.quality.strays > 5),
    file("P10-not-executed", |seen| seen.notes.ended(|cause| matches!(cause, Cause::Elsewhere(_))) > 0),
    file("P10-not-acknowledged", |seen| seen.notes.commands(&Fate::Unknown) > 0),
    file("P11-list-full", |seen| seen.notes.ended(|cause| matches!(cause, Cause::Refused(_))) > 0),
    file("P11-list-frozen", |seen| seen.notes.ended(|cause| matches!(cause, Cause::Stalled { .. })) > 0),
    file("P12-rejected-mid-batch", |seen| seen.notes.ended(|cause| matches!(cause, Cause::Refused(_))) > 0),
    file("P13-task-dead", |seen| seen.quality.timeouts > 3 && seen.line.sent.len() > 1),
];
