//! What is answered to a stop that the database of several gateways does not confirm.

use r6_api::gateway::Role;
use r6_gateway::{At, Database};
use r6_sim::VirtualController;
use r6_testkit::postgres::Server;

use crate::owner::{Here, beside};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stop_that_the_database_does_not_confirm_says_that_the_arm_stands() {
    let made = beside(|| {
        let server = Server::own("a stop that is not confirmed")?;
        let url = server.database();
        let at = At::Database(Database::parse(&url).unwrap());
        let token = r6_gateway::make_token(at, Role::Admin, None, String::new()).unwrap().1;
        Some((server, url, token))
    });
    let Some((mut server, url, token)) = made.await else { return };
    let robot = VirtualController::start().await.unwrap();
    let here = Here::start(&url, &token, &[("press", robot.address())]).await;
    here.until_up("press").await;
    let server = beside(move || {
        server.kill();
        server
    });
    let _server = server.await;
    let (status, problem) = here.call("POST", "/v1/robots/press/stop", None).await;
    assert_eq!((status, problem["code"].as_str()), (503, Some("store_unavailable")), "{problem}");
    let told = problem["message"].as_str().unwrap();
    for part in ["the robot was stopped and the arm stands", "at another gateway it may not hold"] {
        assert!(told.contains(part), "{told}");
    }
    assert!(!robot.handle().snapshot().moving);
}
