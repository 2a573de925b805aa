//! Events of a session as owned values, and starts found in the log.

use r6_proto::client::{Event, StrayReason};
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

pub fn told(event: Event<'_>) -> SessionEvent {
    match event {
        Event::Reply { ticket, message, .. } => SessionEvent::Reply {
            ticket: ticket.number(),
            frame: message.frame().to_vec(),
            body: said(&message),
        },
        Event::Photo { message, .. } => SessionEvent::Photo(message.frame().to_vec()),
        Event::Stray { reason, message } => SessionEvent::Stray(reason, message.frame().to_vec()),
        Event::BadFrame(_) | Event::NotJson(_) => SessionEvent::Broken,
        Event::TimedOut(ticket) => SessionEvent::TimedOut(ticket.number()),
        Event::Lost { ticket, .. } => SessionEvent::Lost(ticket.number()),
        Event::OutOfStep => SessionEvent::OutOfStep,
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

/// Whether one of these lines is a start that the machine did not refuse, of an operator or over the wire.
/// Nothing else may start an arm at rest: no stop, no choice of a program, no list without a program that
/// waits for it.
pub fn is_started(lines: &[String]) -> bool {
    let pressed = |button: &str| {
        let press = format!("scenario: button {button}");
        let refusal = format!("{press}: ");
        let accepted = lines.iter().filter(|line| **line == press).count();
        // Without mains a press is not even logged as one.
        let refused =
            lines.iter().filter(|line| line.starts_with(&refusal) && !line.contains("the mains have failed"));
        accepted > refused.count()
    };
    let over_the_wire = |line: &String| line.starts_with("connection ") && line.ends_with(": startButton");
    ["start", "single-cycle", "single-step"].into_iter().any(pressed)
        || lines.iter().any(|line| line == "person: start" || over_the_wire(line))
}
