//! Controllers without a network: the same door and the same links, on a clock that only the controllers and
//! their peers drive.

use std::io::ErrorKind;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_controller::Scenario;
use r6_controller::fault::{LinkFault, LinkFaultNow};
use r6_sim::{ControllerHandle, MemoryStream, SimError, SimSettings, Simulation, VirtualController};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::{Instant, sleep, timeout};

const QUERY: &[u8] = br#"{"reqType":"query","packID":"0","queryAddr":["version","curMold"]}"#;

fn set(controller: &ControllerHandle, faults: &[LinkFault]) {
    let always = |fault| LinkFaultNow { fault, chance: 1.0 };
    controller.set_link_faults(faults.iter().copied().map(always).collect());
}

/// Sends a query and returns what comes within a second.
async fn ask(stream: &mut MemoryStream) -> Result<String, ErrorKind> {
    stream.write_all(QUERY).await.map_err(|error| error.kind())?;
    let mut bytes = vec![0; 4096];
    let read = timeout(Duration::from_secs(1), stream.read(&mut bytes)).await;
    let count = read.map_err(|_| ErrorKind::TimedOut)?.map_err(|error| error.kind())?;
    Ok(String::from_utf8_lossy(&bytes[..count]).into_owned())
}

#[tokio::test(start_paused = true)]
async fn each_is_reached_by_itself_and_ends_with_the_simulation() {
    let settings = SimSettings { count: 3, ..SimSettings::default() };
    let simulation = Simulation::start_in_memory(settings).await.unwrap();
    let controllers = simulation.controllers().to_vec();
    let ports: Vec<_> = controllers.iter().map(|controller| controller.address().port()).collect();
    assert_eq!(ports, [1, 2, 3]);
    let mut streams = Vec::new();
    for controller in &controllers {
        let mut stream = controller.dial().await.unwrap();
        assert!(ask(&mut stream).await.unwrap().contains("queryData"));
        assert_eq!(controller.snapshot().connections, 1);
        streams.push(stream);
    }
    simulation.shutdown().await.unwrap();
    assert_eq!(streams[0].read(&mut [0; 4]).await.unwrap(), 0);
    assert_eq!(controllers[0].dial().await.unwrap_err().kind(), ErrorKind::ConnectionRefused);
}

#[tokio::test(start_paused = true)]
async fn the_door_and_the_links_are_those_of_tcp() {
    let virtual_controller = VirtualController::builder().start_in_memory().await.unwrap();
    let controller = virtual_controller.handle();
    let mut before = controller.dial().await.unwrap();
    set(controller, &[LinkFault::Refuse]);
    assert_eq!(controller.dial().await.unwrap_err().kind(), ErrorKind::ConnectionRefused);
    assert!(ask(&mut before).await.is_ok(), "who is connected does not notice");
    set(controller, &[LinkFault::Silence]);
    let mut silent = controller.dial().await.unwrap();
    assert_eq!(ask(&mut silent).await, Err(ErrorKind::TimedOut));
    set(controller, &[LinkFault::CloseBeforeReply]);
    assert_eq!(ask(&mut before).await, Ok(String::new()), "an orderly end");
    set(controller, &[LinkFault::ResetMidFrame { after: Some(3) }]);
    let mut cut = controller.dial().await.unwrap();
    assert_eq!(ask(&mut cut).await.unwrap().len(), 3, "as much of the frame as was told");
    assert_eq!(cut.read(&mut [0; 4]).await.unwrap_err().kind(), ErrorKind::ConnectionReset);
    set(controller, &[]);
    assert_eq!(ask(&mut silent).await, Err(ErrorKind::TimedOut), "not even later");
    assert!(ask(&mut controller.dial().await.unwrap()).await.is_ok());
}

#[tokio::test(start_paused = true)]
async fn an_attempt_without_an_answer_is_made_again_by_the_system() {
    let virtual_controller = VirtualController::builder().start_in_memory().await.unwrap();
    let controller = virtual_controller.handle();
    set(controller, &[LinkFault::BlackHole]);
    let begun = Instant::now();
    assert!(timeout(Duration::from_secs(60), controller.dial()).await.is_err());
    let (dialled, ()) = tokio::join!(controller.dial(), async {
        sleep(Duration::from_millis(1200)).await;
        set(controller, &[]);
    });
    assert!(ask(&mut dialled.unwrap()).await.is_ok());
    assert_eq!(begun.elapsed(), Duration::from_secs(63), "after 1 s, and 2 s more");
}

#[tokio::test(start_paused = true)]
async fn a_peer_that_does_not_read_does_not_fill_the_memory() {
    let virtual_controller = VirtualController::builder().start_in_memory().await.unwrap();
    let controller = virtual_controller.handle();
    let mut stream = controller.dial().await.unwrap();
    let flood = async {
        loop {
            if stream.write_all(QUERY).await.is_err() {
                return;
            }
            tokio::task::yield_now().await;
        }
    };
    timeout(Duration::from_secs(600), flood).await.expect("it is given up");
    assert_eq!(controller.snapshot().connections, 0);
}

#[tokio::test]
async fn what_needs_a_network_says_so() {
    let settings = SimSettings { panel: Some("127.0.0.1:0".parse().unwrap()), ..SimSettings::default() };
    assert!(matches!(Simulation::start_in_memory(settings).await, Err(SimError::NeedsNetwork)));
    let on_tcp = VirtualController::start().await.unwrap();
    assert_eq!(on_tcp.handle().dial().await.unwrap_err().kind(), ErrorKind::Unsupported);
}

/// When each client got which bytes.
type Got = Vec<(Duration, u8, Vec<u8>)>;

/// Everything that two clients got, and the log.
fn day(seed: u64) -> (Got, Vec<String>) {
    const SCENARIO: &str = r#"
        [[fault]]
        fault = "latency"
        to_client = 0.1
        to_controller = 0.05
        spread = 0.2
        chance = 0.5
        [[fault]]
        fault = "pieces"
        bytes = 7
        chance = 0.3
        [[fault]]
        fault = "reset-mid-frame"
        chance = 0.05
        [[fault]]
        fault = "bad-json"
        kind = "truncated"
        chance = 0.1
        [[at]]
        time = 1
        do = "photo"
        every = 0.7
        spread = 0.3
    "#;
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build().unwrap();
    runtime.block_on(async {
        let builder = VirtualController::builder().seed(seed).scenario(Scenario::read(SCENARIO).unwrap());
        let virtual_controller = builder.start_in_memory().await.unwrap();
        let log = Arc::new(Mutex::new(Vec::new()));
        let told = Arc::clone(&log);
        virtual_controller.handle().observe(move |at, controller, lines| {
            let j1 = controller.machine().motion().axes.degrees()[0];
            told.lock().unwrap().extend(lines.iter().map(|line| format!("{at} {j1} {line}")));
        });
        let got = Arc::new(Mutex::new(Vec::new()));
        let begun = Instant::now();
        let clients: Vec<_> = (0_u8..2)
            .map(|client| {
                let (controller, got) = (virtual_controller.handle().clone(), Arc::clone(&got));
                tokio::spawn(async move {
                    let mut bytes = vec![0; 4096];
                    loop {
                        let mut stream = controller.dial().await.unwrap();
                        loop {
                            if stream.write_all(QUERY).await.is_err() {
                                break;
                            }
                            match timeout(Duration::from_millis(40), stream.read(&mut bytes)).await {
                                Ok(Ok(0) | Err(_)) => break,
                                Ok(Ok(count)) => {
                                    got.lock().unwrap().push((
                                        begun.elapsed(),
                                        client,
                                        bytes[..count].to_vec(),
                                    ));
                                }
                                Err(_late) => {}
                            }
                        }
                    }
                })
            })
            .collect();
        sleep(Duration::from_secs(20)).await;
        clients.iter().for_each(tokio::task::JoinHandle::abort);
        (got.lock().unwrap().clone(), log.lock().unwrap().clone())
    })
}

#[test]
fn the_same_seed_gives_the_same_bytes_at_the_same_times_and_the_same_log() {
    for seed in 0..4 {
        let (bytes, log) = day(seed);
        assert!(bytes.len() > 200 && log.len() > 20, "{} pieces, {} lines", bytes.len(), log.len());
        let (again, log_again) = day(seed);
        assert!(bytes == again, "seed {seed}: other bytes");
        assert_eq!(log, log_again, "seed {seed}");
        assert!(day(seed + 100).0 != bytes, "seed {seed} and {} say the same", seed + 100);
    }
}
