//! Callers while the threads of the robots are busy.

use std::sync::mpsc;
use std::time::Instant;

use r6_sim::VirtualController;
use serde_json::Value;
use tokio::runtime::{Builder, Runtime};
use tokio::time::timeout;

use crate::support::{Hall, PATIENCE, call, commands};

/// One thread that does tasks.
fn thread() -> Runtime {
    Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap()
}

#[test]
fn a_stop_leaves_and_values_are_read_while_the_threads_of_the_robots_are_busy() {
    let (robots, gateways, callers) = (thread(), thread(), thread());
    let robot = robots.block_on(VirtualController::start()).unwrap();
    let hall = gateways.block_on(async {
        let hall = Hall::with(vec![robot]).await;
        hall.until_up("press").await;
        hall
    });
    let mut log = hall.robots[0].handle().log_from_start();
    let ((busy, is_busy), (end, ends)) = (mpsc::channel(), mpsc::channel::<()>());
    // The only thread of the robots does not come back to them.
    gateways.spawn(async move {
        busy.send(()).unwrap();
        let _ = ends.recv_timeout(3 * PATIENCE);
    });
    is_busy.recv().unwrap();
    let (address, operator) = (hall.gateway.address(), hall.operator.clone());
    let mut stop = None;
    callers.block_on(async {
        let read = call(address, &operator, "GET", "/v1/robots/press", None);
        let (status, state) = timeout(PATIENCE, read).await.expect("an answer while they are busy");
        assert_eq!((status, &state["name"]), (200, &Value::from("press")));
        let asked = async move { call(address, &operator, "POST", "/v1/robots/press/stop", None).await };
        stop = Some(tokio::spawn(asked));
        let begun = Instant::now();
        while !commands(&mut log).iter().any(|command| command == "actionStop") {
            assert!(begun.elapsed() < PATIENCE, "the stop leaves while they are busy");
            tokio::task::yield_now().await;
        }
    });
    end.send(()).unwrap();
    let (status, stopped) = callers.block_on(stop.unwrap()).unwrap();
    assert_eq!((status, &stopped["confirmed"]), (200, &Value::from(true)), "{stopped}");
    drop(hall);
    [robots, gateways, callers].into_iter().for_each(Runtime::shutdown_background);
}
