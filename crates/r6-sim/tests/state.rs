//! The state that survives a power cut, on a disk.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;

use r6_controller::{Key, PanelAction, SavedState};
use r6_sim::{SimError, SimSettings, Simulation, StateError, VirtualController};
use tempfile::TempDir;

/// Long enough for a loaded machine and a slow disk.
const PATIENCE: Duration = Duration::from_secs(20);

fn robot(folder: &Path) -> VirtualController {
    VirtualController::builder().state(folder).start_blocking().unwrap()
}

/// Sends a frame on a new connection, and returns the one reply.
fn ask(robot: &VirtualController, frame: &str) -> String {
    let mut stream = TcpStream::connect(robot.address()).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.write_all(frame.as_bytes()).unwrap();
    stream.shutdown(std::net::Shutdown::Write).unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).unwrap();
    reply
}

fn command(robot: &VirtualController, words: &str) {
    let reply = ask(robot, &format!(r#"{{"reqType":"command","cmdData":[{words}]}}"#));
    assert!(reply.contains(r#","ok"]"#), "{words}: {reply}");
}

fn value(robot: &VirtualController, address: &str) -> serde_json::Value {
    let reply = ask(robot, &format!(r#"{{"reqType":"query","queryAddr":["{address}"]}}"#));
    serde_json::from_str::<serde_json::Value>(&reply).unwrap()["queryData"][0].clone()
}

fn file(folder: &TempDir) -> std::path::PathBuf {
    folder.path().join("controller-1.json")
}

#[test]
fn what_was_acknowledged_is_on_the_disk() {
    let folder = TempDir::new().unwrap();
    let robot = robot(folder.path());
    for value in 1..20 {
        command(&robot, &format!(r#""rewriteData","800","{value}","1""#));
        // The test waited only for the reply.
        let state = SavedState::from_json(&fs::read_to_string(file(&folder)).unwrap()).unwrap();
        assert!(state.to_json().contains(&format!("\"800\": {value}")), "{}", state.to_json());
    }
}

#[test]
fn it_comes_back_and_does_not_run() {
    let folder = TempDir::new().unwrap();
    {
        let robot = robot(folder.path());
        assert_eq!(value(&robot, "curMode"), "7");
        command(&robot, r#""modifyCounter","0","12","100""#);
    }
    let robot = robot(folder.path());
    assert_eq!(value(&robot, "counter-0"), serde_json::json!([0, 100, 12]));
    assert_eq!(value(&robot, "curMode"), "2");
}

#[test]
fn what_nobody_waited_for_is_kept_when_it_ends_in_good_order() {
    let folder = TempDir::new().unwrap();
    let first = robot(folder.path());
    first.handle().operate(&PanelAction::TurnKey(Key::Manual)).unwrap();
    drop(first);
    assert_eq!(value(&robot(folder.path()), "curMode"), "1");
}

#[test]
fn each_controller_has_a_file_of_its_own() {
    let folder = TempDir::new().unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let settings =
            SimSettings { count: 3, state: Some(folder.path().to_owned()), ..SimSettings::default() };
        let simulation = Simulation::start(settings).await.unwrap();
        simulation.controllers()[1].operate(&PanelAction::TurnKey(Key::Stop)).unwrap();
        simulation.shutdown().await.unwrap();
    });
    let mode = |number: u8| {
        let text = fs::read_to_string(folder.path().join(format!("controller-{number}.json"))).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["mode"].clone()
    };
    assert_eq!([1, 2, 3].map(mode), ["auto", "stop", "auto"]);
}

#[test]
fn two_do_not_share_a_folder() {
    let folder = TempDir::new().unwrap();
    let first = robot(folder.path());
    let second = VirtualController::builder().state(folder.path()).start_blocking();
    let error = second.unwrap_err();
    assert!(matches!(&error, SimError::State(StateError::Taken { .. })), "{error}");
    assert!(error.to_string().contains(folder.path().to_str().unwrap()), "{error}");
    drop(first);
    drop(robot(folder.path()));
}

#[test]
fn a_damaged_file_is_kept_aside_and_named() {
    let folder = TempDir::new().unwrap();
    let robots = |number: u32| {
        let text = format!("{{\"version\": 1, \"mode\": \"{number}\"");
        fs::write(file(&folder), &text).unwrap();
        let robot = robot(folder.path());
        // The controller shows it as a real one does: its storage cannot be read.
        assert_eq!(value(&robot, "curAlarm"), "14");
        let aside = folder.path().join(format!("controller-1.damaged-{number}.json"));
        assert_eq!(fs::read_to_string(aside).unwrap(), text);
        command(&robot, r#""clearAlarm""#);
    };
    robots(1);
    robots(2);
}

#[test]
fn a_newer_file_is_refused_and_left_as_it_is() {
    let folder = TempDir::new().unwrap();
    let newer = r#"{"version": 3, "whatever": "comes"}"#;
    fs::write(file(&folder), newer).unwrap();
    let error = VirtualController::builder().state(folder.path()).start_blocking().unwrap_err().to_string();
    assert!(error.contains("controller-1.json") && error.contains("`version` is 3"), "{error}");
    assert_eq!(fs::read_to_string(file(&folder)).unwrap(), newer);
}

#[test]
fn while_the_disk_refuses_nothing_is_acknowledged_and_others_are_answered() {
    let folder = TempDir::new().unwrap();
    let robot = robot(folder.path());
    command(&robot, r#""rewriteData","800","1","1""#);
    // A folder is where the new file would go, so it cannot be written.
    let beside = folder.path().join("controller-1.json.new");
    fs::create_dir(&beside).unwrap();
    let mut writer = TcpStream::connect(robot.address()).unwrap();
    writer.set_read_timeout(Some(PATIENCE)).unwrap();
    writer.write_all(br#"{"reqType":"command","cmdData":["rewriteData","800","2","1"]}"#).unwrap();
    // Others see it, and do not wait.
    let seen = std::iter::repeat_with(|| value(&robot, "Addr-800")).take(1000).any(|value| value == "2");
    assert!(seen);
    for _ in 0..20 {
        assert_eq!(value(&robot, "Addr-800"), "2");
    }
    writer.set_nonblocking(true).unwrap();
    assert_eq!(writer.read(&mut [0; 1]).unwrap_err().kind(), std::io::ErrorKind::WouldBlock);
    writer.set_nonblocking(false).unwrap();
    fs::remove_dir(&beside).unwrap();
    let mut reply = [0; 16];
    writer.read_exact(&mut reply).unwrap();
    assert!(fs::read_to_string(file(&folder)).unwrap().contains("\"800\": 2"));
}
