//! What happens to a robot is kept, told live, and read again later.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_controller::{PanelAction, Program, StartState};
use r6_gateway::RobotConfig;
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::{Hall, PATIENCE, Stream, name, ready_to_start};

const EVENTS: &str = "/v1/robots/press/history/events";

impl Hall {
    /// Waits until the events of `press` are as `is` says.
    pub async fn until_events(&self, query: &str, is: impl Fn(&[Value]) -> bool) -> Vec<Value> {
        let begun = Instant::now();
        loop {
            let page = self.get(&self.viewer, &format!("{EVENTS}?{query}")).await;
            let events = page["events"].as_array().unwrap();
            if is(events) {
                return events.clone();
            }
            assert!(begun.elapsed() < PATIENCE, "{page:#}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

pub fn kinds(events: &[Value]) -> Vec<&str> {
    events.iter().map(|event| event["event"].as_str().unwrap()).collect()
}

/// A gateway with `press` alone, whose counter 0 is read.
pub async fn with_counter(robot: VirtualController) -> Hall {
    let config = RobotConfig {
        period: Duration::from_millis(20),
        addresses: vec![r6_client::Address::Counter(0)],
        ..RobotConfig::new(name("press"), robot.address().to_string())
    };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], vec![robot]).await;
    hall.until_up("press").await;
    hall.until("press", |state| state["signals"].to_string().contains("\"current\"")).await;
    hall
}

#[tokio::test]
async fn an_alarm_is_told_live_and_kept_with_its_meaning() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let mut live = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/events", "").await;
    let robot = hall.robots[0].handle();
    hall.until("press", |state| crate::support::signal(state, "curAlarm")["value"] == 0).await;
    robot.operate(&PanelAction::EmergencyStop).unwrap();
    let told = loop {
        let event = live.next().await.unwrap().data;
        if event["event"] == "alarm_began" {
            break event;
        }
    };
    assert_eq!(
        (&told["code"], &told["text"], &told["robot"]),
        (&json!(7), &json!("emergency stop"), &json!("press"))
    );
    let kept = hall.until_events("kind=alarm_began", |events| !events.is_empty()).await;
    assert_eq!((&kept[0]["code"], &kept[0]["text"]), (&told["code"], &told["text"]));
    assert_eq!(kept[0]["time"], told["time"], "the same moment");
    assert!(kept[0]["remedy"].as_str().unwrap().contains("release the emergency stop"), "{kept:#?}");

    robot.operate(&PanelAction::ReleaseEmergencyStop).unwrap();
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "clearAlarm").await.0, 200);
    let ended = hall.until_events("kind=alarm_ended,alarm_began", |events| events.len() == 2).await;
    assert_eq!(kinds(&ended), ["alarm_began", "alarm_ended"]);
    assert!(ended[1]["lasted_ms"].is_u64() && ended[1]["code"] == 7, "{ended:#?}");
    assert_ne!(ended[0]["id"], ended[1]["id"]);
}

#[tokio::test]
async fn parts_and_modes_are_read_in_pages_and_as_a_table() {
    let hall = with_counter(VirtualController::start().await.unwrap()).await;
    let lease = hall.lease(&hall.operator, "press").await;
    for count in [3, 5, 6, 2] {
        let (status, told) =
            hall.command(&hall.operator, "press", &lease, &format!("modifyCounter 0 {count} -1")).await;
        assert_eq!(status, 200, "{told}");
        let is_read = |state: &Value| crate::support::signal(state, "counter-0")["value"]["current"] == count;
        hall.until("press", is_read).await;
    }
    let whole = hall.until_events("kind=parts,parts_reset", |events| events.len() == 4).await;
    let told: Vec<_> = whole.iter().map(|event| (event["added"].clone(), event["total"].clone())).collect();
    assert_eq!(told[..3], [(json!(3), json!(3)), (json!(2), json!(5)), (json!(1), json!(6))]);
    assert!(whole.iter().all(|event| event["counter"] == "counter-0"), "{whole:#?}");
    assert_eq!(
        (&whole[3]["event"], &whole[3]["from"], &whole[3]["to"]),
        (&json!("parts_reset"), &json!(6), &json!(2))
    );

    let first = hall.get(&hall.viewer, &format!("{EVENTS}?kind=parts,parts_reset&limit=3")).await;
    assert_eq!(first["events"].as_array().unwrap()[..], whole[..3]);
    let cursor = first["next_cursor"].as_str().unwrap();
    let rest =
        hall.get(&hall.viewer, &format!("{EVENTS}?kind=parts,parts_reset&limit=3&cursor={cursor}")).await;
    assert_eq!(
        (rest["events"].as_array().unwrap(), &rest["next_cursor"]),
        (&whole[3..].to_vec(), &json!(null))
    );

    let address = hall.gateway.address();
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!(
        "GET {EVENTS}?kind=parts HTTP/1.1\r\nHost: {address}\r\nAccept: text/csv\r\n\
         Authorization: Bearer {}\r\nConnection: close\r\n\r\n",
        hall.viewer
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).await.unwrap();
    assert!(reply.contains("content-type: text/csv"), "{reply}");
    let table = reply.split_once("\r\n\r\n").unwrap().1;
    let lines: Vec<_> = table.lines().collect();
    assert!(lines[0].starts_with("id,time,event,") && lines.len() == 4, "{table}");
    assert!(lines[1].contains(",parts,") && lines[1].ends_with(",counter-0,3,3,"), "{table}");
}

#[tokio::test]
async fn a_robot_that_was_lost_and_a_restart_are_told_as_unseen() {
    let mut hall = Hall::start().await;
    let address = hall.robots[0].address();
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    let lost = hall.until_events("", |events| kinds(events).contains(&"link_lost")).await;
    assert!(!kinds(&lost).contains(&"mode_changed"), "{lost:#?}");
    // The gateway starts again, with another robot in the place of the lost one.
    let robot = VirtualController::start().await.unwrap();
    assert_ne!(robot.address(), address);
    let config = RobotConfig::new(name("press"), robot.address().to_string());
    let hall = hall.again(vec![config], vec![robot]).await;
    let unseen = hall.until_events("kind=unseen", |events| !events.is_empty()).await;
    let unseen = unseen.last().unwrap();
    assert_eq!(unseen["because"], "start");
    let (from, to) = (unseen["from"].as_str().unwrap(), unseen["to"].as_str().unwrap());
    assert!(from < to && unseen["time"] == to, "{unseen:#}");
    assert!(lost[0]["time"].as_str().unwrap() <= to, "{lost:#?}");
    // What was kept before the restart is there, with the same ids.
    let all = hall.until_events("", |events| events.len() > lost.len()).await;
    assert_eq!(all[..lost.len()], lost[..]);
}

#[tokio::test]
async fn each_cycle_of_a_program_is_told_once() {
    let text = "[[step]]\ndo = \"axis-move\"\nto = [8, 0, 0, 0, 0, 0]\nspeed = 100\n\
                [[step]]\ndo = \"axis-move\"\nto = [-8, 0, 0, 0, 0, 0]\nspeed = 100\n\
                [[step]]\ndo = \"counter\"\nnumber = 0\nby = 1\n";
    let program = Program::read("short", text).unwrap();
    let builder = VirtualController::builder().program(program).unwrap().stands(StartState::Auto);
    let hall = Hall::with(vec![builder.start().await.unwrap()]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "startButton").await.0, 200);
    hall.until_events("kind=cycle_done", |events| events.len() >= 3).await;
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    // What was read before the stop is on the disk once something later is.
    hall.until_events("kind=mode_changed", |events| events.iter().any(|event| event["from"] == 7)).await;
    let told = hall.until_events("kind=cycle_done", |_| true).await;
    let real = hall.robots[0].handle().snapshot();
    assert!(told.iter().all(|event| event["count"] == 1 && event["ms"].is_u64()), "{told:#?}");
    let last = told.last().unwrap()["ms"].as_f64().unwrap();
    assert!((last - real.last_cycle_seconds * 1000.0).abs() < 1.0, "{last} {}", real.last_cycle_seconds);
    // The program counts its cycles. The last one may have ended too shortly before the stop to be proved.
    let counted = hall.get(&hall.viewer, "/v1/robots/press/query?address=counter-0").await;
    let counted = counted["signals"][0]["value"]["current"].as_u64().unwrap();
    assert!((counted - 1..=counted).contains(&(told.len() as u64)), "{counted}: {told:#?}");
    let ids: BTreeSet<_> = told.iter().map(|event| event["id"].as_str().unwrap()).collect();
    assert_eq!(ids.len(), told.len(), "{told:#?}");
}

#[tokio::test]
async fn every_mistake_of_a_query_is_told_and_other_robots_are_not() {
    let hall = Hall::start().await;
    for (query, part) in [
        ("kind=alarm_begin", "nearest: `alarm_began`"),
        ("kind=parts,,unseen", "the kinds are alarm_began, "),
        ("kind=%00%ff", "is no kind"),
        ("from=yesterday", "from: `yesterday`"),
        ("to=2026-13-01T00:00:00Z", "to: "),
        ("from=9999-01-01T00:00:00Z", "from is a time before to"),
        ("from=1970-01-01T00:00:00Z", "ten years"),
        ("limit=0", "limit is from 1 to 1000"),
        ("limit=1001", "limit is from 1 to 1000"),
        ("cursor=e5-1-1", "no cursor of this range"),
        ("cursor=e1-2", "no cursor of this range"),
        ("cursor=e01-2-3", "no cursor of this range"),
        ("cursor=e-1--1--1", "no cursor of this range"),
        ("cursor=t5", "no cursor of this range"),
        ("from=2020-01-01T00:00:00Z&cursor=e99999999999999999999-1-1", "no cursor of this range"),
        ("page=2", "page"),
    ] {
        let (status, problem) = hall.call(&hall.viewer, "GET", &format!("{EVENTS}?{query}"), None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{query}: {problem}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{query}: {problem}");
    }
    let only =
        r6_gateway::make_token(hall.data.path(), Role::Viewer, Some(name("press").into()), String::new());
    let only = only.unwrap().1;
    assert_eq!(hall.call(&only, "GET", EVENTS, None).await.0, 200);
    for path in ["/v1/robots/saw/history/events", "/v1/robots/saw/production"] {
        assert_eq!(hall.call(&only, "GET", path, None).await.0, 403, "{path}");
        assert_eq!(hall.call(&hall.viewer, "GET", path, None).await.0, 404, "{path}");
    }
}
