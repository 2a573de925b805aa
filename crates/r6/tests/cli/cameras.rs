//! Cameras of `r6 gateway`: grants of the command line, and points over HTTP.

use serde_json::json;

use crate::gateway_calls::{call, gateway, get, until};
use crate::support::{Running, r6};

#[test]
fn a_token_that_is_made_with_a_camera_feeds_it_while_the_gateway_runs() {
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0"]);
    let robot = sim.line().strip_prefix("listening on ").unwrap().to_owned();
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let (_running, url) = gateway(&data, &["--robot", &format!("press={robot}")]);
    let make = ["gateway", "token", "--data", &data, "--role", "viewer", "--camera", "press:0"];
    // The store knows the robot once the gateway has reached it.
    let made = until(|| {
        let made = r6(&[&make[..], &["--camera", "press:7"]].concat());
        assert_eq!(made.code, 0, "{made:?}");
        (!made.err.contains("no robot press is known here yet")).then_some(made)
    });
    let number = made.err.split([' ', ':']).nth(1).unwrap();
    let told = format!(
        "token {number}: viewer of all robots. It is shown this once\ntoken {number} feeds camera 0 of press\n\
         token {number} feeds camera 7 of press\n"
    );
    assert_eq!(made.err, told);
    let misspelt = r6(&["gateway", "token", "--data", &data, "--role", "viewer", "--camera", "pres:0"]);
    assert_eq!(misspelt.code, 0, "{misspelt:?}");
    assert!(misspelt.err.contains("no robot pres is known here yet: check the name"), "{}", misspelt.err);
    let token = made.out.trim();
    until(|| (get(&url, token, "/v1/robots/press").1["link"] == "up").then_some(()));
    let points = json!({ "points": [{ "x": 120.5, "y": -40, "angle": 12 }] }).to_string();
    let send = |camera: &str| {
        let path = format!("/v1/robots/press/cameras/{camera}/points");
        call(&url, token, "POST", &path, &points)
    };
    for camera in ["0", "7"] {
        let (status, done) = send(camera);
        assert_eq!((status, &done["taken"]), (200, &json!(1)), "{done}");
    }
    assert_eq!(send("1").0, 403);

    let list = r6(&["gateway", "token", "--data", &data, "--list"]).out;
    assert!(list.contains("viewer of all robots, camera 0 of press, camera 7 of press"), "{list}");
    assert_eq!(r6(&["gateway", "token", "--data", &data, "--revoke", number]).code, 0);
    let (status, _) = send("0");
    assert!(status == 401 || status == 403, "{status}");
}

#[test]
fn mistakes_in_a_camera_are_told_and_no_token_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    for (camera, part) in [
        ("press", "ROBOT:ID"),
        ("Press:0", "the robot has to be"),
        ("press:1000", "a number from 0 to 999"),
        ("press:", "a number from 0 to 999"),
        ("saw:0", "the token is for press only (--robot), so it cannot feed a camera of saw"),
    ] {
        let make = ["gateway", "token", "--data", &data, "--role", "viewer", "--robot", "press"];
        let wrong = r6(&[&make[..], &["--camera", camera]].concat());
        assert!(wrong.code == 2 && wrong.err.contains(part) && wrong.out.is_empty(), "{camera}: {wrong:?}");
    }
    assert!(!folder.path().join("data").exists());
}
