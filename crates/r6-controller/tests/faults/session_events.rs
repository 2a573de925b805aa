//! Events of a session as owned values, and starts found in the log.

use r6_controller::event::{Detail, DidNot, ShellEvent};
use r6_controller::scenario::Happening;
use r6_controller::{Button, Event, LogEntry, PanelAction, Refused};
use r6_proto::CommandName;
use r6_proto::client::{self, StrayReason};
use r6_proto::message::{Body, Message};

/// An event.
pub enum SessionEvent {
    Reply { ticket: u64, frame: Vec<u8>, body: Said },
    Photo(Vec<u8>),
    Stray(StrayReason, Vec<u8>),
    Broken,
    TimedOut(u64),
    Lost(u64),
    OutOfStep,
}

pub enum Said {
    Values(Vec<String>),
    Verdict(bool),
    Rejected,
}

pub fn told(event: client::Event<'_>) -> SessionEvent {
    match event {
        client::Event::Reply { ticket, message, .. } => SessionEvent::Reply {
            ticket: ticket.number(),
            frame: message.frame().to_vec(),
            body: said(&message),
        },
        client::Event::Photo { message, .. } => SessionEvent::Photo(message.frame().to_vec()),
        client::Event::Stray { reason, message } => SessionEvent::Stray(reason, message.frame().to_vec()),
        client::Event::BadFrame(_) | client::Event::NotJson(_) => SessionEvent::Broken,
        client::Event::TimedOut(ticket) => SessionEvent::TimedOut(ticket.number()),
        client::Event::Lost { ticket, .. } => SessionEvent::Lost(ticket.number()),
        client::Event::OutOfStep => SessionEvent::OutOfStep,
    }
}

fn said(message: &Message<'_>) -> Said {
    match &message.body {
        Body::QueryReply(reply) => {
            Said::Values(reply.values.iter().map(|value| value.text().into_owned()).collect())
        }
        Body::CommandReply(_) => Said::Verdict(String::from_utf8_lossy(message.frame()).contains("\"ok\"")),
        _ => Said::Rejected,
    }
}

pub fn word(reason: StrayReason) -> &'static str {
    match reason {
        StrayReason::UnknownPackId => "unknown packID",
        StrayReason::Contradiction => "contradiction",
        StrayReason::NothingWaits => "nothing waits",
        StrayReason::Echo => "echo",
        StrayReason::OutOfStep => "out of step",
        StrayReason::NoReply => "no reply",
    }
}

/// Whether one of these entries is a start that the machine did not refuse, of an operator or over the wire.
/// Nothing else may start an arm at rest: no stop, no choice of a program, no list without a program that
/// waits for it.
pub fn is_started(entries: &[LogEntry]) -> bool {
    let starts = |what: &Happening| {
        use Button::{SingleCycle, SingleStep, Start};
        matches!(what, Happening::Panel(PanelAction::Press(Start | SingleCycle | SingleStep)))
    };
    let pressed = |what: &Happening| {
        let accepted = entries
            .iter()
            .filter(|entry| matches!(&entry.event, Event::Happens { what: press } if press == what))
            .count();
        let refused = entries.iter().filter(|entry| match &entry.event {
            // Without mains a press is not even logged as one.
            Event::DidNotHappen { why: DidNot::Refused { why: Refused::PowerOff }, .. } => false,
            Event::DidNotHappen { what: press, .. } => press == what,
            _ => false,
        });
        accepted > refused.count()
    };
    entries.iter().any(|entry| match &entry.event {
        Event::Happens { what } => starts(what) && pressed(what),
        Event::Shell(note) => *note == operator_starts(),
        Event::CommandAccepted { command, done, .. } => {
            command.as_str() == CommandName::StartButton.word() && entry.connection.is_some() && *done
        }
        _ => false,
    })
}

/// The note that the log has when the operator of a test presses start.
pub fn operator_starts() -> ShellEvent {
    ShellEvent::Note { text: Detail::of("person: start") }
}
