//! An event loop for the callback driver, on the runtime of the test. One task per connection calls the
//! driver, and nothing else does.

use std::io;
use std::pin::{Pin, pin};
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use r6_client::callback::{Another, CallbackHand, EventLoop};
use r6_client::{LostReason, NotSent, RequestError, Robot, RobotSettings};
use tokio::io::{AsyncRead as _, AsyncWrite as _, ReadBuf};
use tokio::time::{Instant, Sleep, sleep_until, timeout};

use super::dial::{Attempt, Carrier, Dial};

/// Stands for "no deadline".
const FAR: Duration = Duration::from_secs(86_400);

/// The number of reads in a row before other tasks run.
const MOST_READS: usize = 16;

/// The part of the loop for one connection.
struct Line {
    begun: Instant,
    dialler: Arc<dyn Dial>,
    /// How long an attempt to connect may take.
    within: Duration,
    /// Wakes the task that serves this line.
    task: Mutex<Option<Waker>>,
    own: Mutex<Own>,
    soon: Mutex<bool>,
}

#[derive(Default)]
struct Own {
    stream: Option<Box<dyn Carrier>>,
    attempt: Option<Attempt>,
    call_at: Option<Instant>,
    /// Whether the last write accepted fewer bytes than it was given.
    is_full: bool,
    /// The failure that a write found.
    broken: Option<LostReason>,
    /// Whether our side has to be shut down, and whether it was.
    ends: bool,
    ended: bool,
    others: Vec<Another>,
}

fn reason(read: io::Result<usize>) -> LostReason {
    read.map_or_else(|error| LostReason::Io(error.kind()), |_none| LostReason::ClosedByPeer)
}

impl Line {
    fn over(stream: Box<dyn Carrier>, dialler: Arc<dyn Dial>, within: Duration, begun: Instant) -> Arc<Self> {
        let own = Own { stream: Some(stream), ..Own::default() };
        Arc::new(Self {
            begun,
            dialler,
            within,
            task: Mutex::default(),
            own: Mutex::new(own),
            soon: Mutex::default(),
        })
    }

    fn wake(&self) {
        let task = self.task.lock().unwrap().clone();
        task.iter().for_each(Waker::wake_by_ref);
    }

    /// Do not call the driver while this is held, because the driver calls back.
    fn own(&self) -> MutexGuard<'_, Own> {
        self.own.lock().unwrap()
    }
}

impl EventLoop for Line {
    fn now(&self) -> Duration {
        self.begun.elapsed()
    }

    fn soon(&self) {
        *self.soon.lock().unwrap() = true;
        self.wake();
    }

    fn write(&self, bytes: &[u8]) -> usize {
        let mut own = self.own();
        let own = &mut *own;
        let Some(stream) = &mut own.stream else { return 0 };
        // Before the first turn there is nothing to write.
        let Some(waker) = self.task.lock().unwrap().clone() else { return 0 };
        let written = Pin::new(stream).poll_write(&mut Context::from_waker(&waker), bytes);
        let (taken, broken) = match written {
            Poll::Ready(Ok(taken)) => (taken, None),
            Poll::Ready(Err(error)) => (0, Some(reason(Err(error)))),
            Poll::Pending => (0, None),
        };
        own.is_full = taken < bytes.len();
        if own.is_full && (taken > 0 || broken.is_some()) {
            // Nothing else reports that there is room for the rest, or that there is no connection.
            own.broken = broken;
            waker.wake();
        }
        taken
    }

    fn connect(&self) {
        self.own().attempt = Some(Arc::clone(&self.dialler).dial());
        self.wake();
    }

    fn end(&self) {
        self.own().ends = true;
        self.wake();
    }

    fn let_go(&self) {
        let mut own = self.own();
        let let_go = (own.stream.take(), own.attempt.take(), own.broken.take());
        (own.is_full, own.ends, own.ended) = (false, false, false);
        drop(own);
        drop(let_go);
    }

    fn call_at(&self, at: Duration) {
        self.own().call_at = Some(self.begun + at);
        self.wake();
    }

    fn another(&self, another: Another) {
        self.own().others.push(another);
        self.wake();
    }
}

/// Runs one turn of the loop for this line. Returns whether anything happened.
fn turn(line: &Arc<Line>, hand: &CallbackHand, timer: &mut Pin<&mut Sleep>, cx: &mut Context<'_>) -> bool {
    let soon = std::mem::take(&mut *line.soon.lock().unwrap());
    if soon {
        hand.run();
    }
    let attempted = {
        let mut own = line.own();
        let made = own.attempt.as_mut().map(|attempt| attempt.as_mut().poll(cx));
        match made {
            Some(Poll::Ready(made)) => {
                own.attempt = None;
                Some(made.map(|stream| own.stream = Some(stream)))
            }
            Some(Poll::Pending) | None => None,
        }
    };
    let connected = attempted.is_some();
    match attempted {
        Some(Ok(())) => hand.connected(),
        Some(Err(error)) => hand.not_connected(error),
        None => {}
    }
    {
        let mut own = line.own();
        let own = &mut *own;
        if own.ends
            && !own.ended
            && let Some(stream) = &mut own.stream
        {
            match Pin::new(stream).poll_shutdown(cx) {
                Poll::Ready(Ok(())) => own.ended = true,
                Poll::Ready(Err(error)) => own.broken = Some(reason(Err(error))),
                Poll::Pending => {}
            }
        }
    }
    let read = read(line, hand, cx);
    let broken = line.own().broken.take();
    let broke = broken.is_some();
    if let Some(broken) = broken {
        line.own().stream = None;
        hand.lost(broken);
    }
    let full = std::mem::take(&mut line.own().is_full);
    if full {
        hand.writable();
    }
    let others = std::mem::take(&mut line.own().others);
    for another in others {
        tokio::spawn(serve_another(another, Arc::clone(&line.dialler), line.within, line.begun));
    }
    let call_at = line.own().call_at;
    timer.as_mut().reset(call_at.unwrap_or_else(|| Instant::now() + FAR));
    let due = timer.as_mut().poll(cx).is_ready();
    if due {
        line.own().call_at = None;
        hand.due();
    }
    soon || connected || read || broke || due
}

/// Reads the bytes that are there. Returns whether there were any.
fn read(line: &Line, hand: &CallbackHand, cx: &mut Context<'_>) -> bool {
    let mut bytes = [0; 4096];
    for reads in 0..MOST_READS {
        let read = {
            let mut own = line.own();
            let Some(stream) = &mut own.stream else { return reads > 0 };
            let mut buffer = ReadBuf::new(&mut bytes);
            let read = Pin::new(stream).poll_read(cx, &mut buffer);
            match read.map_ok(|()| buffer.filled().len()) {
                Poll::Ready(read) => read,
                Poll::Pending => return reads > 0,
            }
        };
        match read {
            Ok(count @ 1..) => hand.received(&bytes[..count]),
            ended => {
                line.own().stream = None;
                hand.lost(reason(ended));
                return true;
            }
        }
    }
    true
}

/// The task of one connection.
async fn serve(line: Arc<Line>, hand: Arc<CallbackHand>) {
    let mut timer = pin!(sleep_until(Instant::now() + FAR));
    std::future::poll_fn(|cx| {
        *line.task.lock().unwrap() = Some(cx.waker().clone());
        let happened = turn(&line, &hand, &mut timer, cx);
        if hand.is_over() {
            return Poll::Ready(());
        }
        if happened {
            cx.waker().wake_by_ref();
        }
        Poll::Pending
    })
    .await;
}

async fn serve_another(another: Another, dialler: Arc<dyn Dial>, within: Duration, begun: Instant) {
    match timeout(within, Arc::clone(&dialler).dial()).await {
        Ok(Ok(stream)) => {
            let line = Line::over(stream, dialler, within, begun);
            if let Some(hand) = another.connected(Arc::clone(&line) as Arc<dyn EventLoop>) {
                serve(line, Arc::new(hand)).await;
            }
        }
        Ok(Err(error)) => another.not_connected(&error),
        Err(_elapsed) => another.not_connected(&io::ErrorKind::TimedOut.into()),
    }
}

/// Connects a robot that such a loop serves. Returns it with its driver.
pub async fn connect(
    name: String,
    dialler: Arc<dyn Dial>,
    settings: RobotSettings,
) -> Result<(Robot, Arc<CallbackHand>), RequestError> {
    let within = settings.connect_timeout;
    let begun = Instant::now();
    let stream = match timeout(within, Arc::clone(&dialler).dial()).await {
        Ok(Ok(stream)) => stream,
        Ok(Err(error)) => {
            let (kind, detail) = (error.kind(), error.to_string());
            return Err(NotSent::Unreachable { address: name, kind, detail }.into());
        }
        Err(_elapsed) => return Err(NotSent::ConnectTimedOut { address: name, after: within }.into()),
    };
    let line = Line::over(stream, dialler, within, begun);
    let (hand, robot) = CallbackHand::start(&name, settings, Arc::clone(&line) as Arc<dyn EventLoop>);
    let hand = Arc::new(hand);
    tokio::spawn(serve(line, Arc::clone(&hand)));
    Ok((robot, hand))
}
