//! A virtual controller in tests, as a user of this crate writes them.

use r6_controller::scenario::Happening;
use r6_controller::{Event, PanelAction};
use r6_proto::alarm::AlarmCode;
use std::net::TcpStream;

use r6_controller::{Profile, StartState};
use r6_sim::VirtualController;

#[tokio::test]
async fn it_listens_once_it_is_there_and_is_gone_after_its_end() {
    let robot = VirtualController::start().await.unwrap();
    let address = robot.address();
    tokio::net::TcpStream::connect(address).await.unwrap();
    robot.shutdown().await.unwrap();
    assert!(tokio::net::TcpStream::connect(address).await.is_err());
}

#[test]
fn a_test_without_a_runtime_has_one_too() {
    let robot = VirtualController::start_blocking().unwrap();
    let address = robot.address();
    TcpStream::connect(address).unwrap();
    drop(robot);
    assert!(TcpStream::connect(address).is_err(), "it is gone when it is dropped");
}

#[test]
fn it_is_what_the_test_wants() {
    let legacy = Profile::named("legacy").unwrap();
    let robot = VirtualController::builder().profile(legacy).stands(StartState::Manual).start_blocking();
    let snapshot = robot.unwrap().handle().snapshot();
    assert_eq!((snapshot.profile.as_str(), snapshot.mode.number()), ("legacy", 1));
}

#[test]
fn what_cannot_be_started_is_an_error() {
    let folder = tempfile::NamedTempFile::new().unwrap();
    let robot = VirtualController::builder().state(folder.path()).start_blocking();
    let error = robot.unwrap_err().to_string();
    assert!(error.contains(folder.path().to_str().unwrap()) && error.contains("opened"), "{error}");
}

/// The first reader of the log misses nothing, however late it comes.
#[tokio::test]
async fn the_first_reader_of_the_log_misses_nothing() {
    let text = "[[at]]\ntime = 0\ndo = \"alarm\"\nnumber = 5001";
    let scenario = r6_controller::Scenario::read(text).unwrap();
    let robot = VirtualController::builder().scenario(scenario).start().await.unwrap();
    let _ = robot.handle().snapshot();
    let mut log = robot.handle().log_from_start();
    let line = tokio::time::timeout(std::time::Duration::from_secs(20), log.recv()).await.unwrap().unwrap();
    let what = Happening::Panel(PanelAction::RaiseAlarm(AlarmCode(5001)));
    assert_eq!(line.event, Event::Happens { what });
    // The second reader gets only new lines.
    let mut second = robot.handle().log_from_start();
    assert!(second.try_recv().is_err());
}
