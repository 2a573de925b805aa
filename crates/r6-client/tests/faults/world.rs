//! One client at work on one controller, on a simulated clock: it watches, queries, sends commands, moves and
//! stops while the faults of the scenario happen. Also checks what must hold in all cases.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, Once};
use std::time::Duration;

use r6_client::{LinkQuality, Reconnect, Robot, RobotSettings};
use r6_controller::{Button, Key, PanelAction, Profile, Scenario};
use r6_proto::client::LearnedDialect;
use r6_proto::time::Instant as ControllerTime;
use r6_proto::{Command, RegisterIndex};
use r6_sim::{ControllerHandle, VirtualController};
use tokio::time::{Instant, timeout};

use crate::floor::Floor;
use crate::hands::{self, On, Task, Time, pause, spawn, tasks};
use crate::tap::{Dialler, Line, Rewrite, Tap};
use crate::work::{Notes, Work};

/// The first register with its own value, how many such registers there are, and the register that commands
/// write.
pub const FIRST: u16 = 800;
pub const REGISTERS: u16 = 40;
pub const WRITTEN: u16 = 890;

/// No single call takes longer than this, with any fault: a few attempts to connect, identity queries and
/// timeouts.
pub const LONGEST_CALL: Duration = Duration::from_secs(60);

/// How long a client continues after the end of the scenario, to show that everything works.
const AFTERWARDS: Duration = Duration::from_secs(5);

static PANICS: AtomicUsize = AtomicUsize::new(0);

/// The value of a register, which identifies the register.
pub fn value_of(register: u16) -> i64 {
    i64::from(register) * 7 + 1
}

pub fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// How a client is set up.
#[derive(Clone, Debug)]
pub struct Setup {
    pub profile: &'static str,
    pub settings: RobotSettings,
    /// The period of its subscription.
    pub every: Duration,
    pub seed: u64,
    /// Whether values belong to their addresses: the client cannot notice a list that is shifted.
    pub trusts_values: bool,
    /// Whether no other client moves the arm.
    pub alone: bool,
    /// Whether the controller carries out what it says it has accepted.
    pub executes: bool,
    /// Whether another client sends queries and commands too.
    pub another: bool,
    pub rewrite: Option<Rewrite>,
    /// When the last fault happens, and how much later the delayed traffic has passed.
    pub over: Duration,
}

impl Setup {
    /// The default settings, except for the seed.
    pub fn usual(seed: u64) -> Self {
        let reconnect = Reconnect { jitter_seed: Some(seed), ..Reconnect::default() };
        Self {
            profile: "hc1",
            settings: RobotSettings { reconnect, ..RobotSettings::default() },
            every: ms(100),
            seed,
            trusts_values: true,
            alone: true,
            executes: true,
            another: false,
            rewrite: None,
            over: Duration::ZERO,
        }
    }

    /// Short timeouts: several times what a healthy controller needs. Reads once a second.
    pub fn prompt(seed: u64) -> Self {
        let usual = Self::usual(seed);
        let settings = RobotSettings { reply_timeout: ms(100), connect_timeout: ms(100), ..usual.settings };
        Self { settings, every: ms(1000), ..usual }
    }
}

/// The results of a run.
#[derive(Debug)]
pub struct Outcome {
    pub line: Line,
    pub quality: LinkQuality,
    pub notes: Notes,
    pub log: Vec<String>,
    pub events: Vec<r6_controller::Event>,
    /// How long after the end of the fault the subscription got its first answer.
    pub recovered: Duration,
    pub profile: &'static str,
    pub learned: LearnedDialect,
    /// The name that the machine reports.
    pub machine_name: Option<String>,
}

/// Runs a scenario to its end and beyond.
pub fn run(on: On, scenario: &Scenario, setup: &Setup) -> Outcome {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let told = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            PANICS.fetch_add(1, Ordering::SeqCst);
            told(panic);
        }));
    });
    let before = PANICS.load(Ordering::SeqCst);
    let (scenario, setup) = (scenario.clone(), setup.clone());
    let outcome = hands::run(on, Time::Paused, move || work(scenario, setup));
    assert_eq!(PANICS.load(Ordering::SeqCst), before, "a task has panicked");
    outcome
}

/// A controller in memory, and the observer beside it.
pub async fn controller(profile: &str, seed: u64, scenario: &Scenario) -> (VirtualController, Floor) {
    let builder = VirtualController::builder().profile(Profile::named(profile).unwrap()).seed(seed);
    let controller = builder.scenario(scenario.clone()).start_in_memory().await.unwrap();
    let floor = Floor::at(controller.handle());
    (controller, floor)
}

pub async fn connect(
    controller: &ControllerHandle,
    settings: &RobotSettings,
    rewrite: Option<Rewrite>,
) -> (Robot, Tap) {
    let tap = Tap::default();
    let begun = Instant::now();
    let dialler = Dialler { controller: controller.clone(), tap: Arc::clone(&tap), rewrite, begun };
    (hands::connect_with(dialler, settings.clone()).await.unwrap(), tap)
}

/// Another client with its own connection. It sometimes sends queries, commands and a move, and also counts
/// from 1.
async fn another(controller: &ControllerHandle, work: &Work) -> [Task<()>; 2] {
    let (robot, _) = connect(controller, &work.setup.settings, None).await;
    let notes = Arc::new(Mutex::new(Notes::default()));
    let work = Work { robot, notes, ..work.clone() };
    [spawn(work.clone().ask()), spawn(work.interfere())]
}

async fn work(scenario: Scenario, setup: Setup) -> Outcome {
    let begun = Instant::now();
    let (controller, floor) = controller(setup.profile, setup.seed, &scenario).await;
    let handle = controller.handle().clone();
    hands::yield_now().await;
    let idle = tasks();
    let (robot, tap) = connect(&handle, &setup.settings, setup.rewrite).await;
    let first = RegisterIndex::new(FIRST).unwrap();
    let values = (FIRST..FIRST + REGISTERS).map(value_of).collect();
    robot.command(Command::RewriteDataList { first, savable: false, values }).await.unwrap();

    let notes = Arc::new(Mutex::new(Notes::default()));
    let over = Arc::new(AtomicBool::new(false));
    let common = Work {
        robot: robot.clone(),
        floor: floor.clone(),
        notes: Arc::clone(&notes),
        over: Arc::clone(&over),
        begun,
        setup: setup.clone(),
    };
    let watching = spawn(common.clone().watch());
    let asking = spawn(common.clone().ask());
    let commanding = spawn(common.clone().command());
    let moving = spawn(common.clone().move_and_stop());
    let other = if setup.another { Some(another(&handle, &common).await) } else { None };
    // The tasks of the handle, of the motion, and of each connection. Their number must not grow with the
    // faults.
    let most = idle + 40;
    let end = begun + setup.over;
    while Instant::now() < end {
        pause(ms(250).min(end - Instant::now())).await;
        assert!(tasks() < most, "{} tasks, {idle} at rest", tasks());
    }
    let recovered = timeout(LONGEST_CALL, common.first_answer_since(end)).await;
    let recovered = recovered.expect("the subscription does not come back");
    make_ready(&handle);
    floor.release();
    pause(AFTERWARDS).await;
    over.store(true, Ordering::SeqCst);
    let finished = timeout(LONGEST_CALL * 2, async {
        watching.await.unwrap();
        asking.await.unwrap();
        commanding.await.unwrap();
        moving.await.unwrap();
        for task in other.into_iter().flatten() {
            task.await.unwrap();
        }
    });
    finished.await.expect("a task hangs");
    common.assert_all_is_well().await;
    let quality = robot.link_quality();
    let learned = robot.learned();
    let machine_name = robot.identity().and_then(|identity| identity.machine_name);
    drop(common);
    timeout(LONGEST_CALL, robot.close()).await.expect("closing hangs");
    // A connection that no longer transmits does not notice the end. All others are gone.
    pause(Duration::from_secs(3)).await;
    let deaf = handle.snapshot().connections;
    assert!(tasks() <= idle + deaf, "{} tasks are left, {idle} at rest", tasks());

    let line = tap.lock().unwrap().clone();
    let notes = std::mem::take(&mut *notes.lock().unwrap());
    let seen = std::mem::take(&mut *floor.seen());
    assert_eq!(seen.broken_promises, Vec::<String>::new());
    seen.assert_nothing_twice(|target| notes.targets.contains(&target));
    notes.assert_consistent(&line, &seen.done, setup.executes);
    Outcome {
        line,
        quality,
        notes,
        log: seen.log,
        events: seen.events,
        recovered,
        profile: setup.profile,
        learned,
        machine_name,
    }
}

/// Acts as an operator: makes the machine ready where that is needed.
fn make_ready(controller: &ControllerHandle) {
    let seen = controller.snapshot();
    if seen.alarm == 0 && !seen.emergency_stop && seen.program == "remote" {
        return;
    }
    let actions = [
        PanelAction::ReleaseEmergencyStop,
        PanelAction::TurnKey(Key::Auto),
        PanelAction::ClearAlarm,
        PanelAction::SwitchProgram("remote".to_owned()),
        PanelAction::Press(Button::Start),
    ];
    // The controller refuses actions that are not needed.
    actions.iter().for_each(|action| drop(controller.operate(action)));
}

/// Converts to the controller's time, which begins with the test.
pub fn controller_time(begun: Instant, at: Instant) -> ControllerTime {
    ControllerTime::ORIGIN + at.saturating_duration_since(begun)
}

/// Waits for a call of the client, but not longer than a call may take.
pub async fn bounded<T>(what: &str, call: impl Future<Output = T>) -> T {
    let begun = Instant::now();
    match timeout(LONGEST_CALL, call).await {
        Ok(done) => done,
        Err(_) => panic!("{what} hangs since {begun:?}"),
    }
}
