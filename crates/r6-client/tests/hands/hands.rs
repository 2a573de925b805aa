//! The driver ("hand") that a test runs on. The same test drives its robot over tokio, from an event loop,
//! and from blocking threads.
//!
//! ```text
//!  On::Tokio      the test is the runtime's main future; what it spawns are tasks
//!  On::Callback   the same; a task for each connection is its event loop (event_loop.rs), which runs what
//!                 the test spawns
//!  On::Blocking   the test is a thread, and so is what it spawns: each polls its future within the robot's
//!                 `block_on`. On a paused clock they take turns (lockstep.rs), on the real one they are
//!                 plain threads with plain sockets
//! ```
//!
//! A test of this kind is an `async fn` named in [`on_every_hand`]. It connects with [`connect_with`] or
//! [`connect`], and starts tasks with [`spawn`]. It waits with [`pause`] while nothing else of its own task
//! is under way.
//!
//! `lockstep.rs` makes the clock, the threads and the sockets of the blocking hand, which asks for them
//! through `src/hands/blocking/system.rs`.

mod dial;
mod event_loop;
mod lockstep;

use std::cell::RefCell;
use std::future::poll_fn;
use std::panic::resume_unwind;
use std::pin::{Pin, pin};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::task::{Context, Poll, Wake, Waker};
use std::thread;
use std::time::Duration;

use r6_client::blocking::simulated::{Driver, System as _};
use r6_client::callback::{Call, CallbackHand};
use r6_client::{Connect, RequestError, Robot, RobotSettings};
use tokio::runtime::{Builder, Handle, Runtime};
use tokio::sync::oneshot;
use tokio::task::AbortHandle;
use tokio::time::{Instant, sleep};

use self::dial::{Tcp, dialler};
use self::lockstep::{Its, Lockstep};

/// All threads of the robots have ended this long after a test.
const FAREWELL: Duration = Duration::from_secs(120);

/// The driver under test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum On {
    Tokio,
    Callback,
    Blocking,
}

/// The clock of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Time {
    /// The clock jumps to the next event.
    Paused,
    /// The real clock, with real sockets.
    Real,
}

/// Runs each of these tests on each driver: `name::tokio`, `name::callback`, `name::blocking`.
macro_rules! on_every_hand {
    ($($test:ident,)+) => { $crate::hands::on_every_hand! { in Paused: $($test,)+ } };
    (in $time:ident: $($test:ident,)+) => {$(
        mod $test {
            use $crate::hands::{On, Time, run};

            #[test]
            fn tokio() {
                run(On::Tokio, Time::$time, super::$test);
            }

            #[test]
            fn callback() {
                run(On::Callback, Time::$time, super::$test);
            }

            #[test]
            fn blocking() {
                run(On::Blocking, Time::$time, super::$test);
            }
        }
    )+};
}
pub(crate) use on_every_hand;

/// Calls each of these functions once per driver, with the driver as argument: `name::tokio`,
/// `name::callback`, `name::blocking`.
macro_rules! for_every_hand {
    ($($test:ident,)+) => {$(
        mod $test {
            use $crate::hands::On;

            #[test]
            fn tokio() {
                super::$test(On::Tokio);
            }

            #[test]
            fn callback() {
                super::$test(On::Callback);
            }

            #[test]
            fn blocking() {
                super::$test(On::Blocking);
            }
        }
    )+};
}
pub(crate) use for_every_hand;

/// The state that a thread has about the test that it runs.
#[derive(Clone)]
struct Here {
    on: On,
    lockstep: Option<Arc<Lockstep>>,
    /// The driver of the robot that was connected last, and how many robots were connected before.
    driver: Option<Driver>,
    connected: u32,
    hand: Weak<CallbackHand>,
    /// How long the thread has to wait without driving anything.
    pause: Option<Duration>,
    /// The tasks that this thread spawned, and those that all threads spawned.
    own: Arc<Spawned>,
    all: Arc<Mutex<Vec<Arc<Spawned>>>>,
}

thread_local! {
    static HERE: RefCell<Option<Here>> = const { RefCell::new(None) };
}

fn here<T>(look: impl FnOnce(&mut Here) -> T) -> T {
    HERE.with_borrow_mut(|here| look(here.as_mut().expect("the test runs on a hand")))
}

/// The driver that this test runs on.
pub fn on() -> On {
    here(|here| here.on)
}

/// A thread that runs a future.
#[derive(Default)]
struct Spawned {
    aborted: AtomicBool,
    waker: Mutex<Option<Waker>>,
}

impl Spawned {
    fn abort(&self) {
        self.aborted.store(true, Ordering::SeqCst);
        let waker = self.waker.lock().unwrap().take();
        waker.into_iter().for_each(Waker::wake);
    }
}

fn runtime(time: Time) -> Runtime {
    match time {
        Time::Paused => Builder::new_current_thread().enable_time().start_paused(true).build().unwrap(),
        Time::Real => Builder::new_current_thread().enable_all().build().unwrap(),
    }
}

/// Runs a test on a driver.
pub fn run<B, F, T>(on: On, time: Time, body: B) -> T
where
    B: FnOnce() -> F + Send + 'static,
    F: Future<Output = T>,
    T: Send + 'static,
{
    let runtime = runtime(time);
    let here = Here {
        on,
        lockstep: None,
        driver: None,
        connected: 0,
        hand: Weak::new(),
        pause: None,
        own: Arc::default(),
        all: Arc::default(),
    };
    match (on, time) {
        (On::Tokio | On::Callback, _) => {
            HERE.set(Some(here));
            let output = runtime.block_on(body());
            HERE.set(None);
            output
        }
        (On::Blocking, Time::Paused) => in_lockstep(&runtime, here, body),
        (On::Blocking, Time::Real) => {
            let inside = runtime.handle().clone();
            let (tell, told) = oneshot::channel();
            let test = thread::spawn(move || {
                let _inside = inside.enter();
                tell.send(drive(here, body)).ok();
            });
            let told = runtime.block_on(told);
            if let Err(panic) = test.join() {
                resume_unwind(panic);
            }
            told.ok().flatten().expect("nobody aborts the test itself")
        }
    }
}

fn in_lockstep<B, F, T>(runtime: &Runtime, here: Here, body: B) -> T
where
    B: FnOnce() -> F + Send + 'static,
    F: Future<Output = T>,
    T: Send + 'static,
{
    let system = Lockstep::new(runtime.handle().clone());
    let all = Arc::clone(&here.all);
    let here = Here { lockstep: Some(Arc::clone(&system)), ..here };
    let (tell, mut told) = oneshot::channel();
    system.start(
        "test",
        Box::new(move || {
            tell.send(drive(here, body)).ok();
        }),
    );
    let ended = runtime.block_on(async {
        let mut output = None;
        system
            .pump(|| {
                output = output.take().or_else(|| told.try_recv().ok());
                output.is_some()
            })
            .await?;
        // Futures that the test spawned and left are aborted. Then its robots are closed, and no thread is
        // left.
        all.lock().unwrap().iter().for_each(|spawned| spawned.abort());
        let until = Instant::now() + FAREWELL;
        let waits = tokio::spawn(tokio::time::sleep_until(until));
        system.pump(|| system.threads() == 0 || Instant::now() >= until).await?;
        waits.abort();
        Ok(output)
    });
    match ended {
        Err(panic) => resume_unwind(panic),
        Ok(output) => {
            assert_eq!(system.names(), Vec::<String>::new(), "these threads never end");
            output.flatten().expect("nobody aborts the test itself")
        }
    }
}

/// What a thread does after its future was polled.
enum Next<T> {
    Ends(Option<T>),
    Pauses(Duration),
    /// Another robot has become the last connected one.
    Turns,
}

/// Wakes a plain thread.
struct Unparks(thread::Thread);

impl Wake for Unparks {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

/// Runs a future to its end on this thread; `None`: it was aborted.
fn drive<B: FnOnce() -> F, F: Future>(begin: Here, body: B) -> Option<F::Output> {
    let own = Arc::clone(&begin.own);
    let lockstep = begin.lockstep.clone();
    HERE.set(Some(begin));
    let output = {
        let mut future = pin!(body());
        loop {
            let (driver, connected) = here(|here| (here.driver.clone(), here.connected));
            let next = poll_fn(|cx| {
                *own.waker.lock().unwrap() = Some(cx.waker().clone());
                if own.aborted.load(Ordering::SeqCst) {
                    return Poll::Ready(Next::Ends(None));
                }
                if let Poll::Ready(output) = future.as_mut().poll(cx) {
                    return Poll::Ready(Next::Ends(Some(output)));
                }
                here(|here| match here.pause.take() {
                    Some(time) => Poll::Ready(Next::Pauses(time)),
                    None if here.connected != connected => Poll::Ready(Next::Turns),
                    None => Poll::Pending,
                })
            });
            let next = match (driver, &lockstep) {
                (Some(driver), _) => driver.block_on(next),
                (None, Some(lockstep)) => lockstep.block_on(next),
                (None, None) => block_on(next),
            };
            match (next, &lockstep) {
                (Next::Ends(output), _) => break output,
                (Next::Pauses(time), Some(lockstep)) => Its(Arc::clone(lockstep)).sleep(time),
                (Next::Pauses(time), None) => thread::sleep(time),
                (Next::Turns, _) => {}
            }
        }
    };
    HERE.set(None);
    output
}

fn block_on<F: Future>(future: F) -> F::Output {
    let mut future = pin!(future);
    let waker = Waker::from(Arc::new(Unparks(thread::current())));
    loop {
        if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
            return output;
        }
        thread::park();
    }
}

/// Connects a robot on this test's driver. A test on the real clock uses [`connect`] instead.
pub async fn connect_with(connect: impl Connect, settings: RobotSettings) -> Result<Robot, RequestError> {
    match on() {
        On::Tokio => Robot::connect_with(connect, settings).await,
        On::Callback => {
            let name = connect.to_string();
            in_a_loop(event_loop::connect(name, dialler(connect), settings).await)
        }
        On::Blocking => {
            let lockstep = here(|here| here.lockstep.clone()).expect("streams in memory need a paused clock");
            let address = lockstep.address_of(dialler(connect));
            of_threads(Driver::connect(Some(Arc::new(Its(lockstep))), &address, settings))
        }
    }
}

/// Connects a robot over a real socket.
pub async fn connect(address: &str, settings: RobotSettings) -> Result<Robot, RequestError> {
    match on() {
        On::Tokio => Robot::connect(address, settings).await,
        On::Callback => {
            let tcp = dialler(Tcp(address.to_owned()));
            in_a_loop(event_loop::connect(address.to_owned(), tcp, settings).await)
        }
        On::Blocking => of_threads(Driver::connect(None, address, settings)),
    }
}

fn in_a_loop(made: Result<(Robot, Arc<CallbackHand>), RequestError>) -> Result<Robot, RequestError> {
    let (robot, hand) = made?;
    here(|here| here.hand = Arc::downgrade(&hand));
    Ok(robot)
}

fn of_threads(made: Result<(Robot, Driver), RequestError>) -> Result<Robot, RequestError> {
    let (robot, driver) = made?;
    here(|here| {
        here.driver = Some(driver);
        here.connected += 1;
    });
    Ok(robot)
}

/// Waits while nothing else of this test's own task is under way. A thread leaves the robot meanwhile, like a
/// program without async that sleeps between its calls.
pub async fn pause(time: Duration) {
    match on() {
        On::Tokio | On::Callback => sleep(time).await,
        On::Blocking => {
            here(|here| here.pause = Some(time));
            yield_once().await;
        }
    }
}

/// Lets all other tasks run.
pub async fn yield_now() {
    match on() {
        On::Tokio | On::Callback => tokio::task::yield_now().await,
        On::Blocking => pause(Duration::ZERO).await,
    }
}

async fn yield_once() {
    let mut yielded = false;
    poll_fn(|_| if std::mem::replace(&mut yielded, true) { Poll::Ready(()) } else { Poll::Pending }).await;
}

/// The number of tasks and threads at present.
pub fn tasks() -> usize {
    let threads = here(|here| here.lockstep.as_ref().map_or(0, |lockstep| lockstep.threads()));
    Handle::current().metrics().num_alive_tasks() + threads
}

/// A task that a test has started, and its result. Dropping this handle does not end the task.
pub struct Task<T> {
    told: oneshot::Receiver<T>,
    abort: Abort,
}

enum Abort {
    Task(AbortHandle),
    Call(Call),
    Thread(Arc<Spawned>),
}

/// The task was aborted, or it panicked.
#[derive(Debug)]
pub struct Gone;

impl<T> Task<T> {
    pub fn abort(&self) {
        match &self.abort {
            Abort::Task(task) => task.abort(),
            Abort::Call(call) => call.cancel(),
            Abort::Thread(thread) => thread.abort(),
        }
    }
}

impl<T> Future for Task<T> {
    type Output = Result<T, Gone>;

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Result<T, Gone>> {
        Pin::new(&mut self.told).poll(cx).map_err(|_| Gone)
    }
}

/// Runs a future beside the test: in a task, in the event loop of the robot that was connected last, or in
/// its own thread.
pub fn spawn<F>(future: F) -> Task<F::Output>
where
    F: Future<Output: Send> + Send + 'static,
{
    let (tell, told) = oneshot::channel();
    let run = async move {
        tell.send(future.await).ok();
    };
    let hand = here(|here| here.hand.upgrade());
    let abort = match (on(), hand) {
        (On::Tokio, _) | (On::Callback, None) => Abort::Task(tokio::spawn(run).abort_handle()),
        (On::Callback, Some(hand)) => Abort::Call(hand.call(run)),
        (On::Blocking, _) => Abort::Thread(spawn_thread(run)),
    };
    Task { told, abort }
}

fn spawn_thread(run: impl Future<Output = ()> + Send + 'static) -> Arc<Spawned> {
    let own = Arc::<Spawned>::default();
    let begin = here(|here| Here { own: Arc::clone(&own), pause: None, ..here.clone() });
    begin.all.lock().unwrap().push(Arc::clone(&own));
    let lockstep = begin.lockstep.clone();
    let thread = move || {
        drive(begin, || run);
    };
    match lockstep {
        Some(lockstep) => lockstep.start("spawned", Box::new(thread)),
        None => {
            let inside = Handle::current();
            thread::spawn(move || {
                let _inside = inside.enter();
                thread();
            });
        }
    }
    own
}
