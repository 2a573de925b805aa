//! A camera. It answers photo requests and sends points. If the plan says so, it is late, silent, or sends
//! rubbish.

use std::time::Duration;

use r6_client::{Point, Reconnect, Robot, RobotSettings, Shot};
use r6_traffic::random::Random;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::sleep;
use turmoil::net::TcpListener;

use crate::fault::Class;
use crate::plan::Temper;
use crate::shared::Shared;
use crate::wire::{CAMERA_PORT, Dialler, End};

/// What a broken camera sends.
const RUBBISH: [&str; 5] = [
    "{\"reqType\":\"AddPoints\",\"dsData\":[{\"camID\":\"0\",\"data\":[{\"X\":\"NaN\"",
    "{\"reqType\":\"photo\",\"camID\":\"x\",\"ret\":\"9\"}",
    "]]]]}}}}\\\"\\\"",
    "{\"a\":{\"a\":{\"a\":{\"a\":[[[[[[[[[[]]]]]]]]]]}}}}",
    "{\"reqType\":\"AddPoints\",\"dsData\":7}",
];

/// The program of the host.
pub async fn run(shared: Shared, number: usize) -> turmoil::Result {
    let plan = shared.plan.cameras[number];
    let mut random = Random::new(plan.seed);
    let listener =
        if plan.is_dialled { Some(TcpListener::bind(("0.0.0.0", CAMERA_PORT)).await?) } else { None };
    let robot = format!("robot-{}", plan.robot);
    let mut dialler = Dialler { shared: shared.clone(), end: End::Camera(number), robot, listener };
    if plan.temper == Temper::Bad {
        return talk_rubbish(&mut dialler, &mut random).await;
    }
    let settings = RobotSettings {
        // A camera that is dialled waits for the controller as long as needed.
        connect_timeout: if plan.is_dialled { Duration::from_secs(600) } else { Duration::from_secs(2) },
        reconnect: Reconnect { jitter_seed: Some(plan.seed), ..Reconnect::default() },
        ..RobotSettings::default()
    };
    let mut next: i32 = 0;
    loop {
        let listener = dialler.listener.take();
        let own = Dialler {
            shared: shared.clone(),
            end: End::Camera(number),
            robot: dialler.robot.clone(),
            listener,
        };
        let Ok(robot) = Robot::connect_with(own, settings.clone()).await else {
            sleep(Duration::from_millis(400)).await;
            if plan.is_dialled {
                dialler.listener = Some(TcpListener::bind(("0.0.0.0", CAMERA_PORT)).await?);
            }
            continue;
        };
        loop {
            let look = |_| {
                let wait = if plan.temper == Temper::Slow {
                    random.up_to(Duration::from_secs(3))
                } else {
                    random.up_to(Duration::from_millis(60))
                };
                let count = i32::try_from(random.below(4)).unwrap_or(0);
                if plan.temper == Temper::Slow {
                    shared.state().record.strikes(Class::V6);
                }
                let first = next;
                next += count;
                async move {
                    sleep(wait).await;
                    Shot::Points((first..first + count).map(|n| point(number, n)).collect())
                }
            };
            let ended = robot.serve_photos(look).await;
            shared.tell(format_args!("camera-{number}: {ended}"));
            // Reading the status reconnects.
            drop(robot.status().await);
            sleep(Duration::from_millis(100)).await;
        }
    }
}

/// Every point has a different place.
fn point(camera: usize, number: i32) -> Point {
    let camera = i32::try_from(camera).unwrap_or(0);
    Point {
        model_id: 1,
        x: 300.0 + f64::from(camera) * 10.0 + f64::from(number) / 1000.0,
        y: 10.0,
        z: Some(400.0),
        u: Some(180.0),
        v: Some(0.0),
        angle: Some(0.0),
        similarity: None,
        color: None,
        relative: false,
    }
}

/// Accepts a connection, sends rubbish over it, ends it, and starts again.
async fn talk_rubbish(dialler: &mut Dialler, random: &mut Random) -> turmoil::Result {
    use r6_client::Connect;
    loop {
        if let Ok(mut stream) = dialler.connect().await {
            for _ in 0..1 + random.below(6) {
                let mut heard = [0; 256];
                let silence =
                    tokio::time::timeout(random.up_to(Duration::from_secs(2)), stream.read(&mut heard));
                if matches!(silence.await, Ok(Ok(0) | Err(_))) {
                    break;
                }
                let rubbish = RUBBISH[random.below(RUBBISH.len())];
                if stream.write_all(rubbish.as_bytes()).await.is_err() {
                    break;
                }
                dialler.shared.state().record.strikes(Class::V1);
            }
        }
        sleep(Duration::from_millis(700) + random.up_to(Duration::from_secs(1))).await;
    }
}
