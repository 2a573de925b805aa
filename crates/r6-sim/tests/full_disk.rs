//! A controller whose state cannot be written, on a disk without room.

use r6_controller::event::ShellEvent;
use r6_controller::{Event, LogEntry};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use r6_sim::{Disk, DiskStep, StateError, VirtualController};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::broadcast::Receiver;
use tokio::time::timeout;

const COUNT: &[u8] =
    br#"{"dsID":"HCRemoteMonitor","reqType":"command","cmdData":["modifyCounter","0","7","20"]}"#;

/// A disk that has room or not, and answers or not.
#[derive(Debug, Default)]
struct Room {
    full: AtomicBool,
    stuck: AtomicBool,
}

impl Disk for Room {
    fn read(&self, _: &Path, _: u64) -> io::Result<Option<Vec<u8>>> {
        Ok(None)
    }

    fn carry_out(&self, _: &DiskStep) -> io::Result<()> {
        if self.full.load(Ordering::SeqCst) { Err(io::ErrorKind::StorageFull.into()) } else { Ok(()) }
    }

    fn takes(&self, _: &DiskStep) -> Duration {
        if self.stuck.load(Ordering::SeqCst) { Duration::from_secs(40) } else { Duration::ZERO }
    }
}

async fn robot(disk: &Arc<Room>) -> VirtualController {
    let disk: Arc<Room> = Arc::clone(disk);
    VirtualController::builder().state("cell").disk(disk).start_in_memory().await.unwrap()
}

fn not_written(event: &ShellEvent) -> bool {
    matches!(event, ShellEvent::StateNotWritten { .. })
}

fn written(event: &ShellEvent) -> bool {
    matches!(event, ShellEvent::StateWritten { .. })
}

/// The next event of this kind, in words.
async fn line(log: &mut Receiver<Arc<LogEntry>>, is_it: impl Fn(&ShellEvent) -> bool) -> String {
    let wait = async {
        loop {
            let entry = log.recv().await.unwrap();
            if matches!(&entry.event, Event::Shell(event) if is_it(event)) {
                return entry.to_string();
            }
        }
    };
    timeout(Duration::from_secs(300), wait).await.unwrap_or_else(|_| panic!("it is not told"))
}

#[tokio::test(start_paused = true)]
async fn a_full_disk_is_told_in_the_log_and_so_is_its_end() {
    let disk = Arc::new(Room::default());
    let robot = robot(&disk).await;
    let mut log = robot.handle().log_from_start();
    let mut stream = robot.handle().dial().await.unwrap();
    disk.full.store(true, Ordering::SeqCst);
    stream.write_all(COUNT).await.unwrap();
    let told = line(&mut log, not_written).await;
    assert!(told.contains("cell") && told.contains("acknowledged"), "{told}");
    let mut reply = [0; 512];
    assert!(timeout(Duration::from_secs(5), stream.read(&mut reply)).await.is_err(), "it is not on the disk");
    // The log repeats it, but not each second.
    let begun = tokio::time::Instant::now();
    line(&mut log, not_written).await;
    assert!((30..=120).contains(&begun.elapsed().as_secs()), "{:?}", begun.elapsed());
    disk.full.store(false, Ordering::SeqCst);
    line(&mut log, written).await;
    assert!(timeout(Duration::from_secs(5), stream.read(&mut reply)).await.unwrap().unwrap() > 0);
    robot.shutdown().await.unwrap();
}

#[tokio::test(start_paused = true)]
async fn a_disk_that_does_not_answer_is_told_in_the_log() {
    let disk = Arc::new(Room::default());
    let robot = robot(&disk).await;
    let mut log = robot.handle().log_from_start();
    let mut stream = robot.handle().dial().await.unwrap();
    // The state after switching on is on the disk before the disk hangs.
    tokio::time::sleep(Duration::from_secs(1)).await;
    disk.stuck.store(true, Ordering::SeqCst);
    let begun = tokio::time::Instant::now();
    stream.write_all(COUNT).await.unwrap();
    line(&mut log, not_written).await;
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
    line(&mut log, written).await;
    let mut reply = [0; 512];
    assert!(timeout(Duration::from_secs(5), stream.read(&mut reply)).await.unwrap().unwrap() > 0);
}

#[tokio::test(start_paused = true)]
async fn an_end_with_an_unwritten_state_is_no_good_end() {
    let disk = Arc::new(Room::default());
    let first = robot(&disk).await;
    first.shutdown().await.unwrap();

    let second = robot(&disk).await;
    let mut log = second.handle().log_from_start();
    disk.full.store(true, Ordering::SeqCst);
    second.handle().operate(&r6_controller::PanelAction::TurnKey(r6_controller::Key::Manual)).unwrap();
    let error = second.shutdown().await.unwrap_err();
    assert!(matches!(&error, StateError::Io { tried: "written", .. }), "{error}");
    line(&mut log, |event| matches!(event, ShellEvent::LastStateLost { .. })).await;
}
