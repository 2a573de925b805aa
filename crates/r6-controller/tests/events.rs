//! Events of the log: as data, in English and in Chinese.

mod common;

use common::Cell;
use r6_controller::event::{
    AlarmCause, AtStep, Detail, DidNot, Event, ListRefusal, ModeReason, Reason, ShellEvent,
};
use r6_controller::fault::{BadList, Fault, LinkFault, ReplyFault, TaskFault};
use r6_controller::scenario::Happening;
use r6_controller::{Level, LogEntry, PanelAction, Refused};
use r6_motion::{AxisNumber, LimitSide, PlanError};
use r6_proto::Language;
use r6_proto::alarm::AlarmCode;
use r6_proto::time::Instant;
use r6_proto::{OperationMode, RequestType};
use serde_json::{Value, json};
use std::time::Duration;

fn some() -> Vec<(Event, Level, &'static str, &'static str, Value)> {
    let (info, warning) = (Level::Info, Level::Warning);
    vec![
        (
            Event::CommandAccepted {
                command: Detail::of("modifyGSPD"),
                arguments: vec![Detail::of("50")],
                done: true,
            },
            info,
            "modifyGSPD 50",
            "命令 modifyGSPD 50",
            json!({ "event": "command_accepted", "command": "modifyGSPD", "arguments": ["50"], "done": true }),
        ),
        (
            Event::ListTaken { instructions: 1, replaced: true, done: false },
            info,
            "AddRCC: 1 instruction, list replaced: answered ok and not carried out (fault not-executed)",
            "AddRCC：1 条指令，替换列表：已应答 ok，但没有执行（故障 not-executed）",
            json!({ "event": "list_taken", "instructions": 1, "replaced": true, "done": false }),
        ),
        (
            Event::PointsTaken { camera: 2, points: 1, waiting: 5 },
            info,
            "AddPoints: camera 2 sent 1 point, 5 wait for a program",
            "AddPoints：相机 2 发来 1 个视觉点位，共有 5 个等待程序取用",
            json!({ "event": "points_taken", "camera": 2, "points": 1, "waiting": 5 }),
        ),
        (
            Event::PointsCleared { points: 3 },
            info,
            "3 points of cameras were removed",
            "已清除 3 个视觉点位",
            json!({ "event": "points_cleared", "points": 3 }),
        ),
        (
            Event::ListRefused { why: ListRefusal::ListFull },
            warning,
            "AddRCC refused: the instruction list is full",
            "拒绝 AddRCC：远程指令列表已满",
            json!({ "event": "list_refused", "why": "the instruction list is full" }),
        ),
        (
            Event::AlarmRaised {
                alarm: AlarmCode(135),
                why: AlarmCause::Step {
                    step: Some(AtStep::OfList { instruction: 1, action: 4 }),
                    why: Reason::Plan(PlanError::OutsideLimits {
                        axis: AxisNumber::ARM[5],
                        side: LimitSide::Plus,
                    }),
                },
            },
            info,
            "alarm 135: instruction 1 (action 4): J6 above its upper soft limit",
            "报警 135：第 1 条指令（action 4）：J6 高于软限位上限",
            json!({
                "event": "alarm_raised", "alarm": 135,
                "why": { "cause": "step", "step": "instruction 1 (action 4)", "why": "J6 above its upper soft limit" },
            }),
        ),
        (
            Event::AlarmRaised {
                alarm: AlarmCode(7),
                why: AlarmCause::EmergencyStop { mode: OperationMode::Auto },
            },
            info,
            "alarm 7: emergency stop, auto (2)",
            "报警 7：急停，自动模式 (2)",
            json!({ "event": "alarm_raised", "alarm": 7, "why": { "cause": "emergency_stop", "mode": "auto (2)" } }),
        ),
        (
            Event::ModeChanged { mode: OperationMode::Running, why: ModeReason::Started },
            info,
            "running (7): started",
            "自动运行中 (7)：已启动",
            json!({ "event": "mode_changed", "mode": "running (7)", "why": "started" }),
        ),
        (
            Event::WrongDsId { request: RequestType::Query, sent: None, right: ["long", "short"] },
            warning,
            "query: no `dsID`, and should be `long` or `short`: a real controller may not answer; not told again on this connection",
            "query：没有 `dsID`，应为 `long` 或 `short`：真实控制器可能不应答；本连接不再提示",
            json!({ "event": "wrong_ds_id", "request": "query", "sent": null, "right": ["long", "short"] }),
        ),
        (
            Event::Struck { fault: Fault::Link(LinkFault::HalfOpen) },
            info,
            "the connection was struck by fault half-open",
            "连接受到故障 half-open 影响",
            json!({ "event": "struck", "fault": "half-open" }),
        ),
        (
            Event::Struck { fault: Fault::Reply(ReplyFault::BadList(BadList::Short)) },
            info,
            "a reply was struck by fault bad-list (short)",
            "应答受到故障 bad-list (short) 影响",
            json!({ "event": "struck", "fault": "bad-list (short)" }),
        ),
        (
            Event::NotAnswered { fault: TaskFault::TaskDead },
            info,
            "not answered: fault task-dead",
            "不应答：故障 task-dead",
            json!({ "event": "not_answered", "fault": "task-dead" }),
        ),
        (
            Event::Happens { what: Happening::PowerCut { off: Duration::from_secs(2), program: None } },
            info,
            "scenario: the mains fail for 2 s",
            "场景：断电 2 s",
            json!({ "event": "happens", "what": "the mains fail for 2 s" }),
        ),
        (
            Event::DidNotHappen {
                what: Happening::Panel(PanelAction::Home),
                why: DidNot::Refused { why: Refused::EmergencyStop },
            },
            warning,
            "scenario: home: the emergency stop is pressed: make the cell safe, release it, then clear the alarm",
            "场景：回原点：急停已按下：确认安全后释放急停，再清除报警",
            json!({
                "event": "did_not_happen", "what": "home",
                "why": {
                    "because": "refused",
                    "why": "the emergency stop is pressed: make the cell safe, release it, then clear the alarm",
                },
            }),
        ),
        (
            Event::Dwells { rest: Duration::from_millis(1500) },
            info,
            "the arm stands for 1.5s at its point (fault dwell)",
            "机械臂在该点停留 1.5s（故障 dwell）",
            json!({ "event": "dwells", "rest": 1.5 }),
        ),
        (
            Event::Shell(ShellEvent::StateNotWritten { why: Detail::of("cell: no room") }),
            warning,
            "cell: no room; nothing that changes the state is acknowledged until it can be written",
            "cell: no room；在能够写入之前，改变状态的请求都不确认",
            json!({ "event": "shell", "what": "state_not_written", "why": "cell: no room" }),
        ),
    ]
}

#[test]
fn an_event_is_the_same_as_data_and_in_both_languages() {
    for (event, level, english, chinese, data) in some() {
        assert_eq!(event.level(), level, "{english}");
        assert_eq!(event.text(Language::English), english);
        assert_eq!(event.to_string(), english);
        assert_eq!(event.text(Language::Chinese), chinese);
        assert_eq!(serde_json::to_value(&event).unwrap(), data, "{english}");
    }
}

#[test]
fn an_entry_tells_when_and_on_which_connection() {
    let at = Instant::ORIGIN + Duration::from_millis(1250);
    let entry = LogEntry { at, connection: None, event: Event::Homed };
    assert_eq!(
        serde_json::to_value(&entry).unwrap(),
        json!({ "at_s": 1.25, "connection": null, "event": "homed" })
    );
    assert_eq!((entry.to_string().as_str(), entry.text(Language::Chinese).as_str()), ("homed", "已回原点"));
}

#[test]
fn a_hostile_text_is_one_line_and_not_without_end() {
    let event = Event::CommandRefused {
        command: Detail::of("no\r\nalarm 7: forged"),
        why: Reason::NoProgram { name: Detail::of("x".repeat(10_000)), nearest: None },
    };
    for language in [Language::English, Language::Chinese] {
        let text = event.text(language);
        assert!(!text.chars().any(char::is_control), "{text}");
        assert_eq!(text.chars().count(), 401, "{text}");
    }
    let data = serde_json::to_string(&event).unwrap();
    assert!(data.len() < 600 && data.contains(r"no\\r\\nalarm"), "{data}");
}

/// The log in Chinese of what a client sends in these frames.
fn log_in_chinese(cell: &mut Cell, frames: &[&str]) -> Vec<String> {
    while cell.controller.poll_log().is_some() {}
    for frame in frames {
        cell.send(frame);
    }
    std::iter::from_fn(|| cell.controller.poll_log()).map(|line| line.event.text(Language::Chinese)).collect()
}

#[test]
fn reasons_are_chinese_too() {
    let command = |data: &str| {
        format!(r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","cmdData":{data}}}"#)
    };
    let list = |member: &str| {
        format!(
            r#"{{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","instructions":[{{"oneshot":"1","action":"4","m0":"1",{member}}}]}}"#
        )
    };
    for (profile, frame, wanted) in [
        (
            "hc1",
            command(r#"["rewriteData","800","12.5","0"]"#),
            "已应答 ok，但没有执行：`rewriteData` 的第 2 个参数 (value) 是 \"12.5\"，应为 32 位整数",
        ),
        (
            "hc1",
            r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["foo"]}"#.to_owned(),
            "报文可疑：没有 `foo` 这个查询地址",
        ),
        (
            "hc1",
            r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["axis-9"]}"#
                .to_owned(),
            "报文可疑：没有 `axis-9` 这个查询地址；最接近的是 `axis-n`，n 为 0 至 7",
        ),
        (
            "hc1",
            list(r#""smooth":"12""#),
            "拒绝 AddRCC：`instructions[0].smooth` 是 \"12\"，应为 0 至 9 的平滑等级",
        ),
        (
            "hc1",
            list(r#""sped":"12""#),
            "报文可疑：`instructions[0]` 中的 `sped` 不是已知的字段；最接近的是 `speed`",
        ),
        ("hc1", "} ".to_owned(), "无法识别，不应答：偏移 0 处的字节不是 JSON 对象：`}`；已跳到下一个 `{`"),
        ("r6-pendant", command(r#"["switchMold","xx"]"#), "拒绝命令 switchMold：没有程序 `xx`"),
        (
            "r6-pendant",
            command(r#"["actionStp"]"#),
            "拒绝命令 actionStp：没有 `actionStp` 这个命令；最接近的是 `actionStop`",
        ),
        (
            "r6-pendant",
            command(r#"["heartbreak"]"#),
            "拒绝命令 heartbreak：没有 `heartbreak` 这个命令；`heartbreak` 是请求类型，请写在 `reqType` 里",
        ),
        (
            "r6-pendant",
            command(r#"["modifyCounter","77","1","-1"]"#),
            "拒绝命令 modifyCounter：没有计数器 77",
        ),
    ] {
        let mut cell = Cell::with_profile(profile);
        let log = log_in_chinese(&mut cell, &[&frame, "{}"]);
        assert!(log.iter().any(|line| line == wanted), "{frame}: {log:#?}");
    }
}
