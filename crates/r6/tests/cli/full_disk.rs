//! A gateway that is killed on a full disk starts again, and stops pass through it.

use std::path::Path;

use crate::gateway_calls::{call, get, until};
use crate::support::{Robot, Running};

/// Runs a gateway on a disk of its own, kills it, fills the disk, and runs it again. Each step waits for a
/// line from the test. Its arguments: the folder of the disk, and the robot.
const SCRIPT: &str = r#"
disk=$1 robot=$2
trap 'kill -9 $first 2>/dev/null' EXIT
mount -t tmpfs -o size=300m none "$disk" || exit 77
start() { exec "$R6" gateway --listen 127.0.0.1:0 --data "$disk/data" --robot "$robot"; }
"$R6" gateway token --data "$disk/data" --role engineer
start &
first=$!
read -r killed
kill -9 $first
wait $first
trap - EXIT
cat /dev/zero >"$disk/fill"
start
"#;

/// Whether a process may have a disk of its own here: it needs to be root, or a system that lets users have
/// mounts of their own.
fn can_mount() -> bool {
    let mount = "mount -t tmpfs none /tmp";
    let tried = std::process::Command::new("unshare").args(["-r", "-m", "sh", "-c", mount]).output();
    tried.is_ok_and(|tried| tried.status.success())
}

#[test]
#[cfg(target_os = "linux")]
fn a_gateway_that_is_killed_on_a_full_disk_starts_again_and_stops_robots() {
    if !can_mount() {
        eprintln!("not tried: no process may mount a disk of its own here");
        return;
    }
    let robot = Robot::start(&[]);
    let folder = tempfile::tempdir().unwrap();
    let disk = folder.path().display().to_string();
    let arguments = [disk.as_str(), &format!("press={}", robot.address())];
    let mut gateway = Running::start_script("unshare -r -m sh -c", SCRIPT, &arguments);
    let token = gateway.line();
    // Beside its URL, a gateway without an admin prints a link that makes one.
    let url = |gateway: &mut Running| {
        let line = (0..2).map(|_| gateway.line()).find(|line| line.starts_with("gateway on ")).unwrap();
        line.split([' ', ',']).find(|word| word.starts_with("http://")).unwrap().to_owned()
    };
    let first = url(&mut gateway);
    let is_up = |url: &str| (get(url, &token, "/v1/robots/press").1["link"] == "up").then_some(());
    until(|| is_up(&first));
    let seen = Path::new("/proc").join(gateway.pid().to_string()).join("root").join(&disk[1..]);
    let reserve = seen.join("data/reserve");
    until(|| reserve.metadata().is_ok_and(|file| file.len() >= 16 << 20).then_some(()));

    gateway.say("");
    let second = url(&mut gateway);
    assert!(!reserve.exists(), "it started in this room");
    // The disk is full but for what the gateway held.
    let more = seen.join("more");
    assert!(std::fs::write(&more, vec![0; 17_000_000]).is_err());
    std::fs::remove_file(&more).unwrap();
    until(|| is_up(&second));
    let (status, stopped) = call(&second, &token, "POST", "/v1/robots/press/stop", "");
    assert_eq!((status, &stopped["confirmed"]), (200, &true.into()), "{stopped}");
    assert_eq!(get(&second, &token, "/v1/robots/press").1["stopped"], true);
    // The log has it: there was room for that, too.
    let audit = get(&second, &token, "/v1/audit").1;
    let entries = audit["entries"].as_array().unwrap_or_else(|| panic!("{audit}"));
    let stop = entries.iter().find(|entry| entry["what"] == "stop");
    assert_eq!(stop.map(|stop| &stop["confirmed"]), Some(&true.into()), "{audit}");
}
