//! What the loop over one connection waits for: five things, looked at in the order of their importance.

use std::future::{Future, poll_fn};
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::mpsc;
use tokio::time::{Instant, Sleep, sleep_until};

use crate::clock::Clock;
use crate::driver::Urgent;
use crate::job::Job;
use crate::link::{Lane, Link};

/// Replies are below 4 KiB; a longer one is read in pieces.
const READ_BUFFER: usize = 4096;

/// What the loop over one connection was woken by.
pub(super) enum Woken {
    Urgent(Option<Urgent>),
    Written(io::Result<usize>),
    Time,
    Ordinary(Option<Job>),
    /// So many bytes are in the buffer.
    Read(io::Result<usize>),
}

/// What a loop keeps from one wait to the next.
pub(super) struct Waiter {
    /// One timer for all waits. It is set again only for an earlier deadline: a request whose reply came leaves the timer as
    /// it is, and the timer's waking for nothing, once in a reply's time-out, is cheaper than setting it for each.
    timer: Pin<Box<Sleep>>,
    buffer: Box<[u8; READ_BUFFER]>,
}

impl Waiter {
    pub fn new() -> Self {
        let far = Clock::start().at(None);
        Self { timer: Box::pin(sleep_until(far)), buffer: Box::new([0; READ_BUFFER]) }
    }

    /// The bytes of the last read.
    pub fn bytes(&self, count: usize) -> &[u8] {
        self.buffer.get(..count).unwrap_or_default()
    }

    /// Waits for what comes first. In this order: a stop before all, writing before reading, so that no flood of input delays
    /// a stop.
    pub async fn woken<S: AsyncRead + AsyncWrite + Unpin>(
        &mut self,
        stream: &mut S,
        link: &mut Link,
        urgent: &mut mpsc::Receiver<Urgent>,
        ordinary: &mut mpsc::Receiver<Job>,
        clock: Clock,
    ) -> Woken {
        poll_fn(|cx| {
            if link.has_room(Lane::Urgent)
                && let Poll::Ready(job) = at_hand(urgent, cx)
            {
                return Poll::Ready(Woken::Urgent(job));
            }
            if !link.output().is_empty()
                && let Poll::Ready(written) = write(stream, link, cx)
            {
                return Poll::Ready(Woken::Written(written));
            }
            if self.timer.is_elapsed() && self.is_due(deadline(link, clock)) {
                return Poll::Ready(Woken::Time);
            }
            if link.has_room(Lane::Ordinary)
                && let Poll::Ready(job) = at_hand(ordinary, cx)
            {
                return Poll::Ready(Woken::Ordinary(job));
            }
            let mut buffer = ReadBuf::new(self.buffer.as_mut_slice());
            if let Poll::Ready(read) = Pin::new(&mut *stream).poll_read(cx, &mut buffer) {
                return Poll::Ready(Woken::Read(read.map(|()| buffer.filled().len())));
            }
            // Nothing is at hand. Only now the others are told whom to wake, which costs more than to look.
            if link.has_room(Lane::Urgent)
                && let Poll::Ready(job) = urgent.poll_recv(cx)
            {
                return Poll::Ready(Woken::Urgent(job));
            }
            if let Poll::Ready(()) = self.deadline(deadline(link, clock), cx) {
                return Poll::Ready(Woken::Time);
            }
            if link.has_room(Lane::Ordinary)
                && let Poll::Ready(job) = ordinary.poll_recv(cx)
            {
                return Poll::Ready(Woken::Ordinary(job));
            }
            Poll::Pending
        })
        .await
    }

    /// Whether the deadline was over when the timer went off. If not, the timer is set for it: whoever always has something to
    /// read comes no further than here.
    fn is_due(&mut self, deadline: Option<Instant>) -> bool {
        let Some(deadline) = deadline else { return false };
        let due = deadline <= self.timer.deadline();
        if !due {
            self.timer.as_mut().reset(deadline);
        }
        due
    }

    /// Ready once the deadline is over; never without one.
    fn deadline(&mut self, deadline: Option<Instant>, cx: &mut Context<'_>) -> Poll<()> {
        let Some(deadline) = deadline else { return Poll::Pending };
        if deadline < self.timer.deadline() {
            self.timer.as_mut().reset(deadline);
        }
        while self.timer.as_mut().poll(cx).is_ready() {
            if deadline <= self.timer.deadline() {
                return Poll::Ready(());
            }
            self.timer.as_mut().reset(deadline);
        }
        Poll::Pending
    }
}

/// When the link's next deadline is.
fn deadline(link: &Link, clock: Clock) -> Option<Instant> {
    link.deadline().map(|due| clock.at(Some(due)))
}

/// What a lane has now: a job, or `None` where none will ever come again. Most have nothing, and to see that costs less than to
/// ask to be woken. What is there is taken as everywhere: in turn with other tasks, and without waiting for a sender that is
/// not done yet.
fn at_hand<T>(lane: &mut mpsc::Receiver<T>, cx: &mut Context<'_>) -> Poll<Option<T>> {
    if lane.is_empty() && !lane.is_closed() { Poll::Pending } else { lane.poll_recv(cx) }
}

/// Gives to the stream what it takes. Whoever gave up while it took nothing has not asked for anything any more.
fn write<S: AsyncWrite + Unpin>(
    stream: &mut S,
    link: &mut Link,
    cx: &mut Context<'_>,
) -> Poll<io::Result<usize>> {
    link.withdraw_moot();
    if link.output().is_empty() {
        return Poll::Pending;
    }
    Pin::new(stream).poll_write(cx, link.output())
}
