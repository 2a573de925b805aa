//! K2: kills the process of a client when the controller has carried out instruction n, for each n. The arm
//! then finishes what is in its list and nothing else, or, with a managed heartbeat, the watchdog stops it. A
//! new client connects at once and reads the true state.
//!
//! The client is this test itself, run once more with a variable set. Nothing sleeps: the test waits for the
//! progress of the controller.

use r6_controller::Event;
use std::env;
use std::process::{Child, Command as Process, Stdio};
use std::time::Duration;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{Heartbeat, Motion, OperationMode, RobotSettings, RunOptions};
use r6_controller::{Controller, Profile};
use r6_proto::Command;
use r6_sim::{Clock, VirtualController};
use tokio::sync::watch;
use tokio::time::timeout;

use crate::floor::{Floor, thousandths};
use crate::hands::{self, On, Time, for_every_hand};

/// The variable that makes this test the client: the address of the controller, how to move, and the driver
/// to use.
const CHILD: &str = "R6_TEST_KILLED_CLIENT";

/// The test that runs as the client.
const TEST: &str = "killed::k2_a_client_that_is_killed_at_any_instruction_leaves_a_list_that_ends::tokio";

/// The number of steps of the motion that is killed, and the length of each step, degrees.
const STEPS: usize = 10;
const STEP: f64 = 0.5;

/// The speed, %, of a motion that the watchdog stops. A step lasts some three seconds, and more than one step
/// is left when the client is killed.
const SLOW: f64 = 0.1;

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// The progress of the controller, sent after each event.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Done {
    instructions: u64,
    left: usize,
    moving: bool,
    alarm: bool,
}

fn motion(from: usize, percent: f64) -> Motion {
    (1..=STEPS).fold(Motion::new(), |motion, step| {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let to = (from + step) as f64 * STEP;
        let place = AxisPosition::degrees([to, 0.0, 0.0, 0.0, 0.0, 0.0]);
        motion.axis_move(place, Percent::new(percent).unwrap())
    })
}

/// The client that is killed. It never ends by itself.
fn client(told: &str) {
    let mut told = told.split(' ');
    let (address, percent) = (told.next().unwrap(), told.next().unwrap().parse().unwrap());
    let heartbeat = match told.next().unwrap() {
        "heartbeat" => Heartbeat::Managed { every: Duration::from_millis(100) },
        _ => Heartbeat::Off,
    };
    let on = match told.next().unwrap() {
        "Callback" => On::Callback,
        "Blocking" => On::Blocking,
        _ => On::Tokio,
    };
    let address = address.to_owned();
    hands::run(on, Time::Real, move || async move {
        let settings = RobotSettings { heartbeat, ..RobotSettings::default() };
        let robot = hands::connect(&address, settings).await.unwrap();
        let options = RunOptions {
            frame_instructions: 2,
            room: 4,
            interval: Duration::from_millis(5),
            ..RunOptions::default()
        };
        let handle = robot.run(&motion(0, percent), options).await.unwrap();
        drop(handle.finished().await);
        // The test kills it in any case.
        std::future::pending::<()>().await;
    });
}

/// A child process that does not outlive the test.
struct Client(Child);

impl Client {
    fn start(on: On, address: &str, percent: f64, heartbeat: &str) -> Self {
        let mut process = Process::new(env::current_exe().unwrap());
        process.args(["--exact", TEST, "--nocapture"]);
        process.env(CHILD, format!("{address} {percent} {heartbeat} {on:?}"));
        Self(process.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }

    fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        // Killing a child that is already gone returns an error, which does not matter.
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

struct Cell {
    controller: VirtualController,
    floor: Floor,
    done: watch::Receiver<Done>,
}

impl Cell {
    async fn start(clock: Clock, profile: Profile) -> Self {
        let builder = VirtualController::builder().clock(clock).profile(profile);
        let controller = builder.start().await.unwrap();
        let floor = Floor::at(controller.handle());
        let (tell, done) = watch::channel(Done::default());
        controller.handle().observe(move |_, controller, lines| {
            let alarm = lines
                .iter()
                .any(|line| matches!(line.event, Event::AlarmRaised { .. } | Event::AlarmCleared { .. }));
            tell.send_if_modified(|done| {
                let now = look(controller, done.alarm || alarm);
                std::mem::replace(done, now) != now
            });
        });
        Self { controller, floor, done }
    }

    fn address(&self) -> String {
        self.controller.address().to_string()
    }

    async fn wait_for(&mut self, what: &str, wanted: impl FnMut(&Done) -> bool) {
        if timeout(PATIENCE, self.done.wait_for(wanted)).await.is_err() {
            let snapshot = self.controller.handle().snapshot();
            let done = *self.done.borrow();
            panic!("never: {what}, {done:?}, {snapshot:?}");
        }
    }

    /// Checks what a later client finds and can do.
    async fn assert_another_takes_over(&self, killed_after: usize) {
        let address = self.address();
        let robot = timeout(PATIENCE, hands::connect(&address, RobotSettings::default()));
        let robot = robot.await.expect("at once").expect("it is let in");
        let status = robot.status().await.unwrap();
        let snapshot = self.controller.handle().snapshot();
        assert!((status.axes[0].unwrap() - snapshot.axes[0]).abs() < 1e-4, "{status:?}");
        assert_eq!((status.moving, status.alarm), (Some(false), Some(i64::from(snapshot.alarm))));
        assert_eq!(status.list_length, i64::try_from(snapshot.list_length).ok());
        let before = self.floor.seen().done.clone();
        if snapshot.alarm != 0 {
            // The alarm of the watchdog is cleared before anything is started.
            robot.command(Command::ClearAlarm).await.unwrap();
            let report = robot.stop().await.unwrap();
            assert!(report.confirmed, "{report}");
            if robot.status().await.unwrap().mode != Some(OperationMode::Running) {
                robot.clear_list().await.unwrap();
                robot.command(Command::StartButton).await.unwrap();
            }
        }
        assert_eq!(self.floor.seen().done, before, "something of the old list ran again");
        let further = motion(STEPS, 50.0);
        let options = RunOptions { clear_leftover: true, ..RunOptions::default() };
        robot.run(&further, options).await.unwrap().finished().await.unwrap();
        let seen = self.floor.seen();
        seen.assert_nothing_twice(|_| true);
        let own: Vec<i64> = further.instructions().unwrap().iter().filter_map(target).collect();
        assert!(seen.done.ends_with(&own), "{:?}", seen.done);
        assert!(seen.done.len() - own.len() >= killed_after, "{:?}", seen.done);
    }
}

fn look(controller: &Controller, alarm: bool) -> Done {
    let machine = controller.machine();
    Done {
        instructions: machine.list().completed(),
        left: machine.list().len(),
        moving: machine.is_moving(),
        alarm,
    }
}

fn target(step: &r6_client::Instruction) -> Option<i64> {
    match &step.action {
        r6_proto::message::Action::AxisMove(step) => {
            step.target.at(r6_client::AxisIndex::ALL[0]).map(thousandths)
        }
        _ => None,
    }
}

for_every_hand! {
    k2_a_client_that_is_killed_at_any_instruction_leaves_a_list_that_ends,
    k2_with_a_heartbeat_the_watchdog_stops_what_a_killed_client_left,
}

fn k2_a_client_that_is_killed_at_any_instruction_leaves_a_list_that_ends(on: On) {
    if let Ok(told) = env::var(CHILD) {
        return client(&told);
    }
    hands::run(on, Time::Real, move || async move {
        // The code that all drivers share meets every instruction on one of them; the other drivers meet
        // some.
        let every = if on == On::Tokio { 1 } else { 4 };
        for killed_after in (0..=STEPS).step_by(every) {
            let mut cell = Cell::start(Clock::Times(4.0), Profile::hc1()).await;
            let client = Client::start(on, &cell.address(), 60.0, "none");
            let begun = |done: &Done| done.instructions > 0 || done.left > 0;
            cell.wait_for("it begins", begun).await;
            let wanted = u64::try_from(killed_after).unwrap();
            cell.wait_for("its turn", |done| done.instructions >= wanted).await;
            client.kill();
            cell.wait_for("the list ends", |done| done.left == 0 && !done.moving).await;
            {
                let seen = cell.floor.seen();
                assert_eq!(seen.done.len(), seen.taken, "what was taken was carried out: {:?}", seen.done);
                assert!(seen.taken <= STEPS, "{} instructions were taken", seen.taken);
                seen.assert_nothing_twice(|_| true);
            }
            cell.assert_another_takes_over(killed_after).await;
        }
    });
}

fn k2_with_a_heartbeat_the_watchdog_stops_what_a_killed_client_left(on: On) {
    hands::run(on, Time::Real, move || async move {
        let most = if on == On::Tokio { 3 } else { 1 };
        for killed_after in 0..most {
            // The list must last longer than the watchdog waits. The watchdog waits less than ten seconds
            // here, but long enough for a client on a loaded machine to send twenty heartbeats.
            let profile = Profile { heartbeat_timeout: Duration::from_secs(2), ..Profile::hc1() };
            let mut cell = Cell::start(Clock::Real, profile).await;
            let client = Client::start(on, &cell.address(), SLOW, "heartbeat");
            cell.wait_for("it begins", |done| done.moving).await;
            let wanted = u64::try_from(killed_after).unwrap();
            cell.wait_for("its turn", |done| done.instructions >= wanted).await;
            client.kill();
            cell.wait_for("the watchdog bites", |done| done.alarm).await;
            cell.wait_for("it stands", |done| !done.moving).await;
            let left = cell.done.borrow().left;
            assert!(left > 0, "the list had not ended by itself");
            cell.assert_another_takes_over(killed_after).await;
        }
    });
}
