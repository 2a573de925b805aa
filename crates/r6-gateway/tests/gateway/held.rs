//! Values that come before the robot has said who it is.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use r6_controller::PanelAction;
use r6_gateway::RobotConfig;
use r6_sim::VirtualController;
use serde_json::json;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

use crate::support::{Hall, name, signal};

/// What only the question of a gateway for the state has, and its answer.
fn is_of_state(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    text.contains("\"version\"") && text.contains("\"axis-0\"")
}

/// A way to a robot whose first connection can be cut, and on whose second one the first answer to the
/// question for the state is lost. It counts the lost ones.
async fn lossy(to: SocketAddr) -> (SocketAddr, watch::Sender<bool>, Arc<AtomicUsize>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (cut, is_cut) = watch::channel(false);
    let lost = Arc::<AtomicUsize>::default();
    let counted = Arc::clone(&lost);
    tokio::spawn(async move {
        let mut near = listener.accept().await.unwrap().0;
        let mut far = TcpStream::connect(to).await.unwrap();
        let mut until = is_cut.clone();
        tokio::select! {
            _ = tokio::io::copy_bidirectional(&mut near, &mut far) => {}
            _ = until.wait_for(|is_cut| *is_cut) => {}
        }
        drop((near, far));
        let (mut near, mut far) = (listener.accept().await.unwrap().0, TcpStream::connect(to).await.unwrap());
        let (mut asked, mut answered) = (vec![0; 1 << 16], vec![0; 1 << 16]);
        loop {
            tokio::select! {
                read = near.read(&mut asked) => match read {
                    Ok(read) if read > 0 => far.write_all(&asked[..read]).await.unwrap(),
                    _ => return,
                },
                read = far.read(&mut answered) => match read {
                    Ok(read) if read > 0 => {
                        let answer = &answered[..read];
                        if is_of_state(answer) && counted.load(Ordering::SeqCst) == 0 {
                            counted.fetch_add(1, Ordering::SeqCst);
                        } else {
                            near.write_all(answer).await.unwrap();
                        }
                    }
                    _ => return,
                },
            }
        }
    });
    (address, cut, lost)
}

#[tokio::test]
async fn an_alarm_is_kept_that_came_and_went_before_the_robot_said_who_it_is() {
    let robot = VirtualController::builder().start().await.unwrap();
    let (address, cut, lost) = lossy(robot.address()).await;
    let config = RobotConfig {
        period: Duration::from_millis(20),
        ..RobotConfig::new(name("press"), address.to_string())
    };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], vec![robot]).await;
    hall.until_up("press").await;
    let is_kept = |history: &serde_json::Value| !history["samples"].as_array().unwrap().is_empty();
    hall.until_history("signal=curAlarm", is_kept).await;

    cut.send(true).unwrap();
    hall.until("press", |state| state["link"] == "down").await;
    let begun = std::time::Instant::now();
    while lost.load(Ordering::SeqCst) == 0 {
        assert!(begun.elapsed() < crate::support::PATIENCE);
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    tokio::time::sleep(Duration::from_millis(100)).await;
    hall.robots[0].handle().operate(&PanelAction::EmergencyStop).unwrap();
    tokio::time::sleep(Duration::from_millis(500)).await;
    hall.robots[0].handle().operate(&PanelAction::ReleaseEmergencyStop).unwrap();
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["link"], "down", "it is still not known");
    let state = hall.until_up("press").await;
    let told = signal(&state, "curMode")["quality"].clone();
    assert_eq!((told, lost.load(Ordering::SeqCst)), (json!("fresh"), 1));
    let has_alarm = |history: &serde_json::Value| {
        history["samples"].as_array().unwrap().iter().any(|sample| sample["value"] == 7)
    };
    let history = hall.until_history("signal=curAlarm", has_alarm).await;
    let gaps = history["samples"].as_array().unwrap().iter().filter(|sample| !sample["gap"].is_null());
    assert_eq!(gaps.count(), 0, "every poll was read: {history:#}");
}
