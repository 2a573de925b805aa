//! Every query address (manual 4.1.1 and later): it reports what something has caused.

mod common;

use common::{Cell, assert_near, axis_move};
use r6_controller::{ControllerSettings, Profile, RobotModel};
use serde_json::json;

#[test]
fn address_version() {
    assert_eq!(Cell::new().text("version"), "HC-QC-RX-7.8.07-master-F5.2.1");
    assert_eq!(Cell::with_profile("r6-host").text("version"), "v1.1");
}

#[test]
fn address_cur_mold() {
    // The mainboard's port has no curMold: the values leave it out, but the echo has it (captured, unit C).
    let mut cell = Cell::new();
    assert_eq!(cell.query(&["version", "curMold"]).len(), 1);
    let mut pendant = Cell::with_profile("r6-pendant");
    assert_eq!(pendant.text("curMold"), "remote");
    pendant.ok(&["switchMold", "default"]);
    assert_eq!(pendant.text("curMold"), "default");
}

#[test]
fn address_counter_list() {
    assert_eq!(Cell::new().value("counterList"), json!(["0", "2", "5"]));
}

#[test]
fn address_counter_n() {
    let mut cell = Cell::new();
    cell.ok(&["modifyCounter", "2", "7", "20"]);
    // Numbers, as captured; a missing counter is left out.
    assert_eq!(cell.query(&["counter-2", "counter-3"]), [json!([2, 20, 7])]);
    let mut pendant = Cell::with_profile("r6-pendant");
    pendant.ok(&["modifyCounter", "2", "7", "20"]);
    assert_eq!(pendant.value("counter-2"), json!(["2", "20", "7"]));
    let mut legacy = Cell::with_profile("legacy");
    legacy.send(r#"{"reqType":"command","cmdData":["modifyCounter","2","7","20"]}"#);
    assert!(legacy.frame().unwrap().contains(r#""cmdReply":["modifyCounter","ok"]"#));
    assert_eq!(legacy.text("counter-2"), "counter2[2][T:20][C:7]");
}

#[test]
fn address_cur_mode() {
    let mut cell = Cell::new();
    assert_eq!(cell.text("curMode"), "7");
    cell.ok(&["actionStop"]);
    assert_eq!(cell.text("curMode"), "2");
    cell.ok(&["actionSingleCycle"]);
    assert_eq!(cell.text("curMode"), "9", "a single cycle waits for a list");
}

#[test]
fn address_board_io_num() {
    let mut cell = Cell::new();
    assert_eq!(cell.text("boardIOnum"), "2");
    assert_eq!(cell.text("boardIONum"), "2", "the later manual's spelling");
}

#[test]
fn address_input_n() {
    let mut cell = Cell::new();
    assert_eq!(cell.query(&["input-0", "input-1"]), [json!("0"), json!("0")]);
    cell.controller.set_input(cell.now, 0, 31, true);
    cell.controller.set_input(cell.now, 1, 0, true);
    assert_eq!(cell.query(&["input-0", "input-1"]), [json!("2147483648"), json!("1")]);
}

#[test]
fn address_output_n() {
    let mut cell = Cell::new();
    cell.ok(&["modifyOutput", "0", "3", "1"]);
    cell.ok(&["modifyOutput", "1", "0", "1"]);
    assert_eq!(cell.query(&["output-0", "output-1"]), [json!("8"), json!("1")]);
    cell.ok(&["modifyOutput", "0", "3", "0"]);
    assert_eq!(cell.text("output-0"), "0");
}

#[test]
fn address_axis_num() {
    assert_eq!(Cell::new().text("axisNum"), "6");
}

#[test]
fn address_axis_n() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([10.0, -20.0, 30.0, 5.0, 40.0, -90.0], 100.0)]));
    cell.pass(30.0);
    assert_eq!(cell.text("axis-1"), "-20.000000", "six decimals, as captured");
    assert_near(cell.axes(), [10.0, -20.0, 30.0, 5.0, 40.0, -90.0], 1e-6);
    assert_eq!(cell.query(&["axis-6", "axis-7"]), [json!("0.000000"), json!("0.000000")]);
}

#[test]
fn address_world_n() {
    let mut cell = Cell::new();
    // At all axes 0 the upper arm leans by 0.0603 degrees, the forearm by -0.0413 and the tool by 0.597 (the
    // offsets of the model), so that by hand: 50 + 350 sin + (363 cos + 41 sin) + 118.3 cos, and 296.5 + 350
    // cos + (41 cos - 363 sin) - 118.3 sin.
    let (upper, fore, tool) = (0.0603_f64.to_radians(), -0.0413_f64.to_radians(), 0.597_f64.to_radians());
    let reach = 50.0 + 350.0 * upper.sin() + 363.0 * fore.cos() + 41.0 * fore.sin() + 118.3 * tool.cos();
    let height = 296.5 + 350.0 * upper.cos() + 41.0 * fore.cos() - 363.0 * fore.sin() - 118.3 * tool.sin();
    let home = cell.world();
    assert_near([home[0], home[1], home[2], 0.0, 0.0, 0.0], [reach, 0.0, height, 0.0, 0.0, 0.0], 1e-5);
    assert!((reach - 531.3).abs() < 0.4 && (height - 687.5).abs() < 1.1, "{reach} {height}");
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]));
    cell.pass(10.0);
    let turned = cell.world();
    assert_near([turned[0], turned[1], turned[2], 0.0, 0.0, 0.0], [0.0, reach, height, 0.0, 0.0, 0.0], 1e-5);
    assert_eq!(cell.query(&["world-6", "world-7"]).len(), 2);
}

#[test]
fn address_cur_alarm() {
    let mut cell = Cell::new();
    assert_eq!(cell.text("curAlarm"), "0");
    // J6 beyond its soft limit of 340 degrees: 130 + 5 (confirmed live).
    cell.run_ok(&json!([axis_move([0.0, 0.0, 0.0, 0.0, 0.0, 350.0], 50.0)]));
    assert_eq!(cell.text("curAlarm"), "135");
    cell.ok(&["clearAlarm"]);
    assert_eq!(cell.text("curAlarm"), "0");
}

#[test]
fn address_cur_cycle() {
    let mut cell = Cell::new();
    assert_eq!(cell.number("curCycle"), 0.0);
    cell.run_ok(&json!([{"oneshot": "1", "action": "100", "type": "100", "limit": "5"}]));
    cell.pass(2.0);
    assert!((cell.number("curCycle") - 2.018).abs() < 1e-6);
    cell.pass(10.0);
    assert_eq!(cell.number("curCycle"), 0.0);
}

#[test]
fn address_last_cycle() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "1", "action": "100", "type": "100", "limit": "5"}]));
    cell.pass(10.0);
    assert!((cell.number("lastCycle") - 5.0).abs() < 1e-6);
}

#[test]
fn address_machine_name() {
    assert_eq!(Cell::new().text("machineName"), "r6 virtual BRTIRUS0707A");
}

#[test]
fn address_cur_torque_n() {
    let mut cell = Cell::new();
    assert_eq!(cell.text("curTorque-0"), "0", "0 at rest (reported, unit A), and gravity does not turn J1");
    // Gravity on the level forearm, as computed by hand in r6-motion's own test: 56.74 of 95 Nm, 2580 is the
    // rated torque.
    assert_eq!(cell.text("curTorque-2"), "1541");
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    cell.pass(0.15);
    let gaining = cell.number("curTorque-0");
    cell.pass(0.5);
    let even = cell.number("curTorque-0");
    assert!((even - 258.0).abs() < 2.0, "friction at half of full speed is a tenth: {even}");
    assert!(gaining > 2.0 * even, "{gaining}: gaining speed takes more");
    cell.pass(5.0);
    cell.ok(&["actionStop"]);
    cell.pass(1.0);
    assert_eq!(cell.text("curTorque-2"), "0", "the brakes hold it");
    assert_eq!(
        Cell::with_profile("r6-pendant").query(&["curTorque-0"]).len(),
        0,
        "only on the mainboard's port"
    );
}

#[test]
fn address_cur_speed_n() {
    let mut cell = Cell::new();
    assert_eq!(cell.text("curSpeed-0"), "0");
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    cell.pass(0.4);
    // J1 at 50 % of 220.8 deg/s, gear ratio 100: 110.4 × 100 / 6 RPM.
    assert_eq!(cell.text("curSpeed-0"), "1840");
    assert_eq!(
        Cell::with_profile("r6-pendant").query(&["curSpeed-0"]).len(),
        0,
        "only on the mainboard's port"
    );
}

#[test]
fn address_cur_account() {
    assert_eq!(Cell::new().query(&["curAccount"]).len(), 0, "not on the mainboard's port");
    assert_eq!(Cell::with_profile("r6-pendant").text("curAccount"), "operator");
    let settings = ControllerSettings::new(Profile::named("r6-pendant").unwrap(), RobotModel::default());
    assert_eq!(
        Cell::of(ControllerSettings { account: "anna".to_owned(), ..settings }).text("curAccount"),
        "anna"
    );
}

#[test]
fn address_origin() {
    assert_eq!(Cell::new().text("origin"), "1");
    let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
    let settings = ControllerSettings { homed: false, ..ControllerSettings::new(Profile::hc1(), model) };
    let mut cell = Cell::of(settings);
    assert_eq!(cell.query(&["origin", "curMode"]), [json!("0"), json!("2")]);
    assert_eq!(cell.command(&["startButton"]), ["startButton", "err", "the machine is not homed"]);
    assert_eq!(cell.run(&json!([axis_move([1.0; 6], 50.0)])), ["AddRCC", "err"]);
}

#[test]
fn address_mold_list() {
    assert_eq!(
        Cell::new().value("moldList"),
        json!(["default", "palletise", "pick-and-place", "register-follow", "register-move", "remote"])
    );
}

#[test]
fn address_is_moving() {
    let mut cell = Cell::new();
    assert_eq!(cell.text("isMoving"), "0");
    cell.add_rcc("1", &json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    // Clients poll isMoving right after the reply: it is 1 before the reply is sent.
    assert_eq!(cell.text("isMoving"), "1");
    cell.pass(5.0);
    assert!(cell.frame().unwrap().contains("AddRCC"));
    assert_eq!(cell.text("isMoving"), "0");
}

#[test]
fn address_m_n() {
    let mut cell = Cell::new();
    cell.ok(&["modifyOutput", "4", "1", "1"]);
    cell.ok(&["modifyOutput", "5", "0", "1"]);
    assert_eq!(cell.query(&["M-0", "M-1"]), [json!("2"), json!("1")]);
}

#[test]
fn address_addr_n() {
    let mut cell = Cell::new();
    cell.ok(&["rewriteDataList", "800", "6", "0", "0", "0", "-300000", "0", "0", "0"]);
    let request = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"900","queryAddr":["Addr-800","Addr-801","Addr-802","Addr-803","Addr-804","Addr-805"]}"#;
    // Captured, unit C, byte for byte.
    assert_eq!(
        cell.ask(request),
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"900","queryAddr":["Addr-800","Addr-801","Addr-802","Addr-803","Addr-804","Addr-805"],"queryData":["0","0","-300000","0","0","0"],"reqType":"query"}"#
    );
    assert_eq!(cell.query(&["Addr-799", "Addr-901"]).len(), 0);
}

#[test]
fn address_remote_cmd_len() {
    let mut cell = Cell::new();
    let step = axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0);
    let back = axis_move([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0);
    cell.run_ok(&json!([step, back]));
    assert_eq!(cell.text("RemoteCmdLen"), "2");
    cell.pass(30.0);
    assert_eq!(cell.text("RemoteCmdLen"), "0");
}

#[test]
fn address_tool_coord() {
    let mut cell = Cell::new();
    cell.ok(&["switchTool", "3"]);
    cell.ok(&["switchCoordinate", "2"]);
    assert_eq!(cell.value("toolCoord"), json!(["3", "2", "0"]));
}

#[test]
fn address_faxis_n() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    cell.pass(0.1);
    assert_eq!(cell.text("faxis-0"), cell.text("axis-0"));
    assert!(cell.number("faxis-0") > 0.0);
}
