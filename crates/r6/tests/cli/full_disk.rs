//! A gateway on a full disk: it starts, stops pass through it, and none is forgotten.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::gateway_calls::{call, get, until};
use crate::support::{Robot, Running};

/// Runs a gateway on a disk of its own, kills it when the test says so, and runs it again. Its arguments: the
/// folder of the disk, and the robot.
const SCRIPT: &str = r#"
disk=$1 robot=$2
mount -t tmpfs -o size=300m none "$disk" || exit 77
start() { exec "$R6" gateway --listen 127.0.0.1:0 --data "$disk/data" --robot "$robot"; }
"$R6" gateway token --data "$disk/data" --role engineer
start &
first=$!
read -r killed
kill -9 $first
wait $first
start
"#;

/// A gateway on a disk of its own.
struct Cell {
    _folder: tempfile::TempDir,
    _robot: Robot,
    gateway: Running,
    token: String,
    url: String,
    /// The disk, as the test sees it.
    disk: PathBuf,
}

impl Cell {
    /// `None`: no process may have a disk of its own here. It needs a system that lets users have mounts.
    fn start() -> Option<Self> {
        let mount = "mount -t tmpfs none /tmp";
        let tried = std::process::Command::new("unshare")
            .args(["-r", "-m", "-p", "--kill-child", "sh", "-c", mount])
            .output();
        if !tried.is_ok_and(|tried| tried.status.success()) {
            eprintln!("not tried: no process may mount a disk of its own here");
            return None;
        }
        let robot = Robot::start(&[]);
        let folder = tempfile::tempdir().unwrap();
        let disk = folder.path().display().to_string();
        let arguments = [disk.as_str(), &format!("press={}", robot.address())];
        let mut gateway = Running::start_script("unshare -r -m -p --kill-child sh -c", SCRIPT, &arguments);
        let token = gateway.line();
        let url = url(&mut gateway);
        let disk = Path::new("/proc").join(gateway.pid().to_string()).join("root").join(&disk[1..]);
        let cell = Self { _folder: folder, _robot: robot, gateway, token, url, disk };
        cell.until_up();
        until(|| (cell.held() == 16 << 20).then_some(()));
        Some(cell)
    }

    /// How much room the gateway holds, in bytes.
    fn held(&self) -> u64 {
        self.disk.join("data/reserve").metadata().map_or(0, |file| file.len())
    }

    fn get(&self, path: &str) -> Value {
        get(&self.url, &self.token, path).1
    }

    fn until_up(&self) {
        until(|| (self.get("/v1/robots/press")["link"] == "up").then_some(()));
    }

    /// Writes until nothing more fits on the disk.
    fn fill(&self) {
        let file = std::fs::File::options().create(true).append(true).open(self.disk.join("fill")).unwrap();
        let mut zeros = std::io::repeat(0);
        assert!(std::io::copy(&mut zeros, &mut &file).is_err());
    }

    /// Kills the gateway, and starts it again.
    fn kill(&mut self) {
        self.gateway.say("");
        self.url = url(&mut self.gateway);
        self.until_up();
    }

    fn stop(&self) {
        let (status, stopped) = call(&self.url, &self.token, "POST", "/v1/robots/press/stop", "");
        assert_eq!((status, &stopped["confirmed"]), (200, &true.into()), "{stopped}");
    }

    /// The stops of the audit log: what was asked for, and whether it was confirmed.
    fn stops(&self) -> Vec<(Value, Value)> {
        let audit = self.get("/v1/audit");
        let entries = audit["entries"].as_array().unwrap_or_else(|| panic!("{audit}"));
        let stops = entries.iter().filter(|entry| entry["what"] == "stop");
        stops.map(|stop| (stop["request"].clone(), stop["confirmed"].clone())).collect()
    }
}

/// The URL of a gateway that starts. Beside it, a gateway without an admin prints a link that makes one.
fn url(gateway: &mut Running) -> String {
    let line = (0..2).map(|_| gateway.line()).find(|line| line.starts_with("gateway on ")).unwrap();
    line.split([' ', ',']).find(|word| word.starts_with("http://")).unwrap().to_owned()
}

#[test]
fn a_gateway_that_is_killed_on_a_full_disk_starts_again_with_its_robots_stopped() {
    let Some(mut cell) = Cell::start() else { return };
    cell.fill();
    cell.kill();
    assert_eq!(cell.held(), 0, "it started in this room");
    // A stop of before may be lost, so nothing moves before somebody has looked.
    let state = cell.get("/v1/robots/press");
    assert_eq!((&state["stopped"], &state["stopped_by"]["by"]), (&true.into(), &"gateway".into()), "{state}");
    cell.stop();
    let stops = cell.stops();
    assert_eq!(stops, [("start after a full disk".into(), false.into()), ("stop".into(), true.into())]);
}

#[test]
fn a_stop_on_a_full_disk_is_on_the_disk_and_outlives_a_kill() {
    let Some(mut cell) = Cell::start() else { return };
    cell.fill();
    cell.stop();
    assert_eq!(cell.held(), 0, "it is written in this room");
    until(|| (cell.stops().len() == 1).then_some(()));
    std::fs::remove_file(cell.disk.join("fill")).unwrap();
    cell.kill();
    let state = cell.get("/v1/robots/press");
    assert_eq!(state["stopped"], true, "{state}");
    assert_ne!(state["stopped_by"]["by"], "gateway");
    assert_eq!(cell.stops(), [("stop".into(), true.into())]);
}
