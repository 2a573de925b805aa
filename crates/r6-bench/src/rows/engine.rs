//! What the SDK itself costs: complete polls over a transport that is memory, so that no system call is in it.

use std::fmt;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};
use std::time::Instant;

use r6_client::{Connect, Robot, RobotSettings};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::runtime::Builder;

use super::echo;
use crate::measure::{Contender, SLICE, compare, time_of_this_thread};
use crate::report::{Figure, Goal, Row};

/// Nanoseconds of one of a million in a second.
const A_MILLIONTH: f64 = 1000.0;

/// A connection whose other end has answered as soon as a query is written.
#[derive(Default)]
struct Answering {
    input: Vec<u8>,
    output: Vec<u8>,
    read: usize,
    reader: Option<Waker>,
}

impl AsyncWrite for Answering {
    fn poll_write(self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        this.input.extend_from_slice(bytes);
        if this.read == this.output.len() {
            this.output.clear();
            this.read = 0;
        }
        let taken = echo::answer(&this.input, &mut this.output);
        this.input.drain(..taken);
        if let Some(reader) = this.reader.take() {
            reader.wake();
        }
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

impl AsyncRead for Answering {
    fn poll_read(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        let rest = &this.output[this.read..];
        if rest.is_empty() {
            this.reader = Some(cx.waker().clone());
            return Poll::Pending;
        }
        let count = rest.len().min(buffer.remaining());
        buffer.put_slice(&rest[..count]);
        this.read += count;
        Poll::Ready(Ok(()))
    }
}

struct Memory;

impl fmt::Display for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("memory")
    }
}

impl Connect for Memory {
    type Stream = Answering;

    async fn connect(&mut self) -> io::Result<Answering> {
        Ok(Answering::default())
    }
}

/// Nanoseconds of processor time for each poll of twelve addresses through a handle, one after the other.
fn nanoseconds_per_poll() -> f64 {
    let addresses = echo::addresses();
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let robot = Robot::connect_with(Memory, RobotSettings::default()).await.expect("memory connects");
        let asking = tokio::spawn(async move {
            let (begun, before) = (Instant::now(), time_of_this_thread());
            let mut polls = 0_u32;
            while begun.elapsed() < SLICE {
                for _ in 0..100 {
                    let result = robot.query(&addresses).await.expect("an answer");
                    assert!(result.decimal(addresses[0]).is_some());
                    polls += 1;
                }
            }
            (time_of_this_thread() - before).as_secs_f64() * 1e9 / f64::from(polls)
        });
        asking.await.expect("it does not panic")
    })
}

/// Beside a million polls a second.
pub fn rows() -> Vec<Row> {
    let mut contenders: Vec<Contender<'_>> =
        vec![Box::new(|| vec![A_MILLIONTH]), Box::new(|| vec![nanoseconds_per_poll()])];
    let ratio = compare(&mut contenders).remove(0).remove(0);
    vec![Row {
        what: "the SDK over memory in place of a network, complete polls of 12 addresses per second and core"
            .to_owned(),
        against: "one million",
        goal: Some(Goal::AtLeastFast(1.0)),
        figure: Figure::Ratio(ratio),
        in_the_way: "nothing by itself: a third is finding, decoding and reading the reply with its twelve names and twelve numbers, a tenth the \
                     other end, which is in memory here; the rest is spread over the queue to the connection's task and the way back, three \
                     allocations and three looks at the clock",
    }]
}
