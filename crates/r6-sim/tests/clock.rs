//! Time as fast as possible, over TCP: the same bytes as without a socket.

use r6_controller::Event;
use r6_proto::alarm::AlarmCode;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use r6_controller::{Controller, ControllerSettings, FastClock, Profile, RobotModel};
use r6_proto::time::Instant;
use r6_sim::{Clock, VirtualController};

const SEED: u64 = 11;

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// A conversation with motion, registers, a photo, an alarm and mistakes; the number is that of the frames
/// that come back.
fn conversation() -> Vec<(String, usize)> {
    let query = |addresses: &str| {
        format!(
            r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"1","queryAddr":[{addresses}]}}"#
        )
    };
    let command = |words: &str| {
        format!(
            r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"2","cmdData":[{words}]}}"#
        )
    };
    let step = |oneshot: u8, j1: i32| {
        format!(
            r#"{{"oneshot":"{oneshot}","action":"4","m0":"{j1}","m1":"0","m2":"0","m3":"0","m4":"0","m5":"0","ckStatus":"0x3F","speed":"20","delay":"0","smooth":"3"}}"#
        )
    };
    let add = |steps: &[String]| {
        format!(
            r#"{{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","packID":"3","emptyList":"1","instructions":[{}]}}"#,
            steps.join(",")
        )
    };
    let state = r#""axis-0","isMoving","curCycle","lastCycle","RemoteCmdLen","curAlarm","curMode""#;
    let mut frames = Vec::new();
    for round in 0..20 {
        frames.push((add(&[step(1, round * 4), step(1, -round * 3)]), 1));
        // It begins to move, one step is left, and it is over. A list that is replaced before that raises an
        // alarm.
        frames.extend((0..3).map(|_| (query(state), 1)));
    }
    frames.push((add(&[step(0, 10), step(0, -10)]), 1));
    frames.extend((0..5).map(|_| (query(state), 1)));
    frames.push((command(r#""actionStop""#), 1));
    frames.push((command(r#""startButton""#), 1));
    frames.push((add(&[step(1, 300)]), 1));
    // It begins to move, and ends with an alarm.
    frames.extend((0..2).map(|_| (query(state), 1)));
    frames.push((command(r#""clearAlarm""#), 1));
    frames.push((command(r#""switchMold","register-move""#), 1));
    frames.push((command(r#""startButton""#), 1));
    frames.push((command(r#""rewriteDataList","800","6","0","9000","1000","0","0","0","0""#), 1));
    // The reply, and the photo request once the arm has arrived.
    frames.push((command(r#""modifyOutput","4","1","1""#), 2));
    frames.push((query(r#""axis-0","axis-1","counter-0""#), 1));
    frames
}

/// The answers to it without a socket or clock.
fn pure() -> String {
    let settings =
        ControllerSettings { seed: SEED, ..ControllerSettings::new(Profile::hc1(), RobotModel::default()) };
    let mut controller = Controller::new(settings, Instant::ORIGIN);
    let mut clock = FastClock::new(Instant::ORIGIN);
    let id = controller.connect(clock.now());
    let mut answers = String::new();
    for (frame, _) in conversation() {
        clock.handle_input(&mut controller, id, frame.as_bytes());
        while let Some(answer) = controller.poll_transmit(clock.now(), id) {
            answers.push_str(std::str::from_utf8(answer).unwrap());
        }
    }
    answers
}

/// Reads this many bytes.
fn read(stream: &mut TcpStream, length: usize) -> String {
    let mut bytes = vec![0; length];
    stream.read_exact(&mut bytes).unwrap();
    String::from_utf8(bytes).unwrap()
}

/// The length of the first objects of a text.
fn length_of(text: &str, objects: usize) -> usize {
    let mut values = serde_json::Deserializer::from_str(text).into_iter::<serde::de::IgnoredAny>();
    for _ in 0..objects {
        values.next().unwrap().unwrap();
    }
    values.byte_offset()
}

fn robot() -> (VirtualController, TcpStream) {
    let builder = VirtualController::builder().clock(Clock::AsFastAsPossible).seed(SEED);
    let robot = builder.start_blocking().unwrap();
    let stream = TcpStream::connect(robot.address()).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    (robot, stream)
}

#[test]
fn the_same_frames_give_the_same_bytes_with_and_without_sockets() {
    let expected = pure();
    assert_eq!(expected, pure());
    assert!(expected.contains("photo") && expected.contains("130"), "{expected}");
    // One by one, each answered before the next.
    for _ in 0..2 {
        let (_robot, mut stream) = robot();
        let mut rest = expected.as_str();
        for (frame, answers) in conversation() {
            stream.write_all(frame.as_bytes()).unwrap();
            let (wanted, after) = rest.split_at(length_of(rest, answers));
            assert_eq!(read(&mut stream, wanted.len()), wanted, "{frame}");
            rest = after;
        }
        assert_eq!(rest, "");
    }
    // All at the same time.
    let (_robot, mut stream) = robot();
    let all: String = conversation().into_iter().map(|(frame, _)| frame).collect();
    stream.write_all(all.as_bytes()).unwrap();
    assert_eq!(read(&mut stream, expected.len()), expected);
}

#[tokio::test]
async fn a_list_that_nobody_asks_about_goes_on_by_itself() {
    let builder = VirtualController::builder().clock(Clock::AsFastAsPossible);
    let robot = builder.start().await.unwrap();
    let mut log = robot.handle().log();
    let stream = tokio::net::TcpStream::connect(robot.address()).await.unwrap();
    // A wait for a signal that never comes: its limit is real time, a tenth of a second.
    let frame = br#"{"reqType":"AddRCC","emptyList":"1","instructions":[{"oneshot":"1","action":"100","type":"0","point":"3","io_status":"1","limit":"0.1","isUnlimit":"0"}]}"#;
    stream.writable().await.unwrap();
    assert_eq!(stream.try_write(frame).unwrap(), frame.len());
    let raised = async {
        loop {
            let line = log.recv().await.unwrap();
            if matches!(line.event, Event::AlarmRaised { alarm: AlarmCode(2051), .. }) {
                return line;
            }
        }
    };
    let line = tokio::time::timeout(PATIENCE, raised).await.unwrap();
    assert!(line.at.as_secs_f64() >= 0.1, "{}", line.at);
}

#[tokio::test(start_paused = true)]
async fn ten_times_as_fast_is_a_tenth_of_the_time() {
    let robot = VirtualController::builder().clock(Clock::Times(10.0)).start().await.unwrap();
    tokio::time::advance(Duration::from_secs(6)).await;
    let mut log = robot.handle().log();
    robot.handle().request_photo(1);
    let line = log.recv().await.unwrap();
    assert!((line.at.as_secs_f64() - 60.0).abs() < 1.0, "{}", line.at);
}
