//! The host of a controller: its door, its disk, and the people at the machine.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use r6_controller::profile::Unarmed;
use r6_controller::{Button, Key, Library, PanelAction, Profile};
use r6_sim::{Camera, ControllerHandle, SimSettings, Simulation};
use tokio::task::JoinHandle;
use tokio::time::sleep;
use turmoil::net::{TcpListener, TcpStream};

use crate::fault::{Class, Promise};
use crate::fault_effects::class_of_deed;
use crate::floor::Door;
use crate::plan::{DWELLS, DWELLS_TEXT, rest_of};
use crate::saved_registers::STATE;
use crate::shared::{Shared, State, now};
use crate::wire::{CAMERA_PORT, PORT, Served};

/// The maximum number of tasks of a host: one for each connection, camera and deed, and the tasks for its
/// time and its state.
const MOST_TASKS: usize = 80;

/// The program of the host. It runs until the host's process ends.
pub async fn run(shared: Shared, robot: usize) -> turmoil::Result {
    let simulation = start(&shared, robot).await?;
    let handle = simulation.controllers().first().ok_or("no controller")?.clone();
    let seen = handle.snapshot();
    shared
        .tell(format_args!("robot-{robot}: {}, alarm {}, program `{}`", seen.mode, seen.alarm, seen.program));
    let own = shared.clone();
    handle.observe(move |_, controller, lines| {
        let mut state = own.state();
        let State { record, floors, lines: clients, .. } = &mut *state;
        floors[robot].look(controller, lines, clients, record);
    });
    tokio::spawn(look(shared.clone(), robot, handle.clone()));
    tokio::spawn(people(shared.clone(), robot, handle.clone()));
    tokio::spawn(photos(shared.clone(), robot, handle.clone()));
    let mut connections = Vec::new();
    for (number, camera) in shared.plan.cameras.iter().enumerate() {
        if camera.robot == robot && camera.is_dialled {
            connections.push(tokio::spawn(dial(shared.clone(), handle.clone(), number)));
        }
    }
    serve(shared, robot, handle, connections).await
}

async fn start(shared: &Shared, robot: usize) -> Result<Simulation, Box<dyn std::error::Error>> {
    let at = now();
    let plan = &shared.plan.robots[robot];
    let disk = shared.state().disks[robot].clone();
    let again = plan.keeps && disk.has(Path::new(STATE));
    let scenario = rest_of(&plan.scenario, at);
    let from = if again { "its disk" } else { "nothing" };
    shared.tell(format_args!("robot-{robot}: is switched on with what is on {from}"));
    shared.state().floors[robot].boots(at, again, plan.keeps);
    let mut profile = Profile::named(plan.profile).ok_or("no such profile")?;
    if shared.plan.classes.contains(&Class::E6) {
        // A client that reaches another robot at this address can see the difference.
        profile.version = format!("{}-{robot}", profile.version);
    }
    if plan.arms_itself {
        profile.add_rcc_unarmed = Unarmed::Arm;
    }
    let mut library = Library::default();
    library.load(DWELLS, DWELLS_TEXT).map_err(|error| error.to_string())?;
    let settings = SimSettings {
        profile,
        library,
        mold: plan.program.to_owned(),
        scenario: Some(Arc::new(scenario)),
        seed: plan.seed.wrapping_add(u64::try_from(at.as_nanos()).unwrap_or(0)),
        state: plan.keeps.then(|| "state".into()),
        disk: Some(Arc::new(disk)),
        ..SimSettings::default()
    };
    Ok(Simulation::start_in_memory(settings).await?)
}

/// Reads the controller's snapshot from time to time, and checks its number of tasks.
async fn look(shared: Shared, robot: usize, handle: ControllerHandle) {
    let every = shared.plan.robots[robot].looked_at;
    loop {
        sleep(every).await;
        drop(handle.snapshot());
        let tasks = tokio::runtime::Handle::current().metrics().num_alive_tasks();
        shared.check(Promise::I6, tasks <= MOST_TASKS, || format!("robot-{robot} has {tasks} tasks"));
    }
}

async fn people(shared: Shared, robot: usize, handle: ControllerHandle) {
    let mut deeds = shared.plan.robots[robot].people.clone();
    deeds.sort_by_key(|(at, _)| *at);
    for (at, action) in deeds {
        let Some(wait) = at.checked_sub(now()) else { continue };
        sleep(wait).await;
        operate(&shared, robot, &handle, &action);
    }
    // After the faults are over, a person restores the machine, once.
    while !shared.is_quiet() {
        sleep(Duration::from_millis(50)).await;
    }
    while !is_ready(&handle) || somebody_is_slow(&shared, robot) {
        if is_ready(&handle) {
            sleep(Duration::from_millis(50)).await;
            continue;
        }
        for action in [
            PanelAction::ReleaseEmergencyStop,
            PanelAction::TurnKey(Key::Auto),
            PanelAction::Press(Button::Stop),
            PanelAction::Press(Button::Stop),
        ] {
            operate(&shared, robot, &handle, &action);
        }
        sleep(Duration::from_millis(900)).await;
        for action in [
            PanelAction::ClearAlarm,
            PanelAction::SwitchProgram("remote".to_owned()),
            PanelAction::Press(Button::Start),
        ] {
            operate(&shared, robot, &handle, &action);
        }
    }
    shared.state().floors[robot].is_seen_to = true;
}

/// Whether a program of this robot with slow calls may still cause an alarm.
fn somebody_is_slow(shared: &Shared, robot: usize) -> bool {
    let state = shared.state();
    let mut lines = shared.plan.clients.iter().zip(&state.lines);
    shared.plan.drivers.are_slow() && lines.any(|(plan, line)| plan.robot == robot && !line.is_done)
}

/// Whether the controller waits for remote commands.
fn is_ready(handle: &ControllerHandle) -> bool {
    let seen = handle.snapshot();
    seen.alarm == 0 && !seen.emergency_stop && seen.program == "remote" && seen.mode.may_run()
}

/// A person operates the panel. Actions that may start a motion are recorded before they happen.
fn operate(shared: &Shared, robot: usize, handle: &ControllerHandle, action: &PanelAction) {
    let starts = match action {
        PanelAction::Press(button) => !matches!(button, Button::Stop | Button::Pause),
        PanelAction::Home | PanelAction::Jog { .. } | PanelAction::HoldJog { .. } => true,
        _ => false,
    };
    shared.tell(format_args!("robot-{robot}: somebody does {action:?}"));
    let before = starts.then(|| {
        let mut state = shared.state();
        state.floors[robot].is_moved_by_hand(now());
        state.floors[robot].starts(now())
    });
    match handle.operate(action) {
        Ok(()) => class_of_deed(action).into_iter().for_each(|class| shared.state().record.strikes(class)),
        Err(refused) => {
            if let Some(before) = before {
                shared.state().floors[robot].was_refused(before);
            }
            shared.tell(format_args!("robot-{robot}: {refused}"));
        }
    }
}

async fn photos(shared: Shared, robot: usize, handle: ControllerHandle) {
    for at in &shared.plan.robots[robot].photos {
        let Some(wait) = at.checked_sub(now()) else { continue };
        sleep(wait).await;
        handle.request_photo(0);
    }
}

/// Keeps a connection to a camera that listens.
async fn dial(shared: Shared, handle: ControllerHandle, number: usize) {
    loop {
        if let Ok(stream) = TcpStream::connect((format!("camera-{number}").as_str(), CAMERA_PORT)).await
            && let Ok(address) = stream.peer_addr()
        {
            let wire = Served { stream, shared: shared.clone() };
            handle.serve_camera(wire, Camera { cam_id: None, address }).await;
        }
        sleep(Duration::from_millis(300)).await;
    }
}

/// Accepts connections according to the door.
async fn serve(
    shared: Shared,
    robot: usize,
    handle: ControllerHandle,
    mut connections: Vec<JoinHandle<()>>,
) -> turmoil::Result {
    let mut door = shared.state().floors[robot].door.subscribe();
    let mut listener = None;
    loop {
        let now_is = *door.borrow_and_update();
        match now_is {
            Door::Refuses => {
                listener = None;
                door.changed().await?;
            }
            // Attempts to connect stay in the queue of the port, and nothing accepts them.
            Door::Silent => door.changed().await?,
            // Abort the connections in a fixed order, because a runtime drops its tasks in a different order
            // each time.
            Door::Dies => {
                connections.iter().for_each(JoinHandle::abort);
                return std::future::pending().await;
            }
            Door::Open => {
                let open = match listener.take() {
                    Some(open) => open,
                    None => TcpListener::bind(("0.0.0.0", PORT)).await?,
                };
                tokio::select! {
                    biased;
                    changed = door.changed() => changed?,
                    accepted = open.accept() => {
                        let (stream, _) = accepted?;
                        let (wire, handle) = (Served { stream, shared: shared.clone() }, handle.clone());
                        connections.retain(|connection| !connection.is_finished());
                        connections.push(tokio::spawn(async move { handle.serve(wire).await }));
                    }
                }
                listener = Some(open);
            }
        }
    }
}
