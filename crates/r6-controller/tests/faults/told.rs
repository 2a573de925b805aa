//! What a session tells, without what it borrows.

use r6_proto::client::{Event, StrayReason};
use r6_proto::message::{Body, Message};

/// An event.
pub enum Told {
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

pub fn told(event: Event<'_>) -> Told {
    match event {
        Event::Reply { ticket, message, .. } => {
            Told::Reply { ticket: ticket.number(), frame: message.frame().to_vec(), body: said(&message) }
        }
        Event::Photo { message, .. } => Told::Photo(message.frame().to_vec()),
        Event::Stray { reason, message } => Told::Stray(reason, message.frame().to_vec()),
        Event::BadFrame(_) | Event::NotJson(_) => Told::Broken,
        Event::TimedOut(ticket) => Told::TimedOut(ticket.number()),
        Event::Lost { ticket, .. } => Told::Lost(ticket.number()),
        Event::OutOfStep => Told::OutOfStep,
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
