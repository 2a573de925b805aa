//! Events in Simplified Chinese. Words of the wire and of scenario files are not translated, because people
//! search for them. Texts of the operating system, and reasons that are only a text, stay in English.

use std::fmt;

use r6_motion::{LimitSide, PlanError};
use r6_proto::error::{FieldError, FieldPath, JsonError};
use r6_proto::frame::{FrameError, FrameFault};
use r6_proto::message::{ExtraKey, ExtraKind, Place, UnknownTypeWord};
use r6_proto::{Language, OperationMode, printable};

use super::{AlarmCause, AtStep, DidNot, Event, ListRefusal, ModeReason, Reason, ShellEvent};
use crate::fault::{Fault, IgnoredStop};
use crate::mode::Key;
use crate::panel::{Button, PanelAction, Refused};
use crate::scenario::{Bounce, Happening, InputPoint};

/// An event, shown in Chinese.
pub(super) struct In<'e>(pub &'e Event);

impl fmt::Display for In<'_> {
    #[expect(clippy::too_many_lines, reason = "a table: a sentence for each event")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Event::TooManyConnections { limit } => write!(f, "已有 {limit} 个连接：本连接不会得到应答"),
            Event::NotUnderstood { problem } => write!(f, "无法识别，不应答：{}", why(problem)),
            Event::Odd { problem } => write!(f, "报文可疑：{}", why(problem)),
            Event::WithoutOneshot { instruction, stays: true } => {
                write!(f, "第 {instruction} 条指令没有 `oneshot`：按 0 处理，指令保留，列表循环执行")
            }
            Event::WithoutOneshot { instruction, stays: false } => {
                write!(f, "第 {instruction} 条指令没有 `oneshot`：按 1 处理，执行后删除")
            }
            Event::MoreOfTheKind { count } => write!(f, "同类问题还有 {count} 个"),
            Event::ReplyCame => f.write_str("收到应答报文，但控制器没有提问；不应答"),
            Event::WrongDsId { request, sent, right } => {
                write!(f, "{request}：")?;
                match sent {
                    None => f.write_str("没有 `dsID`")?,
                    Some(sent) => write!(f, "`dsID` 是 `{sent}`")?,
                }
                match right {
                    [long, short] if long == short => write!(f, "，应为 `{long}`")?,
                    [long, short] => write!(f, "，应为 `{long}` 或 `{short}`")?,
                }
                f.write_str("：真实控制器可能不应答；本连接不再提示")
            }
            Event::WithoutType { request, done: true } => {
                write!(f, "{request} 没有 `reqType`：已执行，不应答")
            }
            Event::WithoutType { request, done: false } => write!(f, "{request} 没有 `reqType`：不应答"),
            Event::Refused { request, why: reason } => write!(f, "拒绝 {request}：{}", why(reason)),
            Event::CommandAccepted { command, arguments, done } => {
                write!(f, "命令 {command}")?;
                arguments.iter().try_for_each(|argument| write!(f, " {argument}"))?;
                not_done(f, *done)
            }
            Event::CommandRefused { command, why: reason } => {
                write!(f, "拒绝命令 {command}：{}", why(reason))
            }
            Event::CommandWithoutEffect { why: reason } => {
                write!(f, "已应答 ok，但没有执行：{}", why(reason))
            }
            Event::StopIgnored { request, how } => {
                let told = match how {
                    IgnoredStop::Err => "err",
                    IgnoredStop::Ok | IgnoredStop::Every => "ok",
                };
                write!(f, "{request}：已应答 {told}，但没有执行（故障 stop-ignored）")
            }
            Event::ListTaken { instructions, replaced, done } => {
                let how = if *replaced { "替换列表" } else { "追加到列表" };
                write!(f, "AddRCC：{instructions} 条指令，{how}")?;
                not_done(f, *done)
            }
            Event::ListAnsweredErr { instructions } => {
                write!(
                    f,
                    "AddRCC：{instructions} 条指令应答 err，但已执行：路径速度之后有直线运动（action 51、10）"
                )
            }
            Event::ListComesLate { after } => {
                write!(f, "列表将在 {after:?} 后接收，不应答：故障 late-list")
            }
            Event::LateListTaken { instructions } => {
                write!(f, "AddRCC：{instructions} 条指令，延迟接收（故障 late-list）")
            }
            Event::LateListNotTaken { why } => write!(f, "延迟的列表没有接收：{}", refusal(why)),
            Event::ListRefused { why } => write!(f, "拒绝 AddRCC：{}", refusal(why)),
            Event::ListIgnored { why } => write!(f, "AddRCC 未执行，也不应答：{}", refusal(why)),
            Event::ListTooLong { bytes, reset: true } => {
                write!(f, "AddRCC 长 {bytes} 字节：与真实控制器一样，连接被复位")
            }
            Event::ListTooLong { bytes, reset: false } => {
                write!(
                    f,
                    "AddRCC 长 {bytes} 字节：与真实控制器一样，不执行也不应答；请减少一次发送的指令，其余追加"
                )
            }
            Event::PhotoAnswered { camera, ret } => write!(f, "相机 {camera} 应答：ret {ret}"),
            Event::PhotoRequested { camera } => write!(f, "请求相机 {camera} 拍照"),
            Event::PhotoLost { camera, away: true } => {
                write!(f, "请求相机 {camera} 拍照，但相机未连接，请求已丢失")
            }
            Event::PhotoLost { camera, away: false } => {
                write!(f, "请求相机 {camera} 拍照，但没有相机连接，请求已丢失")
            }
            Event::CameraSpeaksAsAnother { dialled, speaks_as } => {
                write!(f, "按相机 {dialled} 连接的相机自称相机 {speaks_as}")
            }
            Event::PointsTaken { camera, points, waiting } => {
                write!(f, "AddPoints：相机 {camera} 发来 {points} 个视觉点位，共有 {waiting} 个等待程序取用")
            }
            Event::PointsCleared { points } => write!(f, "已清除 {points} 个视觉点位"),
            Event::PointsLost { limit } => {
                write!(f, "从现在起，旧的视觉点位会丢失：已有 {limit} 个等待，程序取用得太慢")
            }
            Event::WarningsLeftOut { count, told } => {
                write!(f, "另有 {count} 条警告未显示：每秒最多显示 {told} 条")
            }
            Event::EventsDropped { count } => write!(f, "{count} 行日志没有及时读取，已丢弃"),
            Event::ModeChanged { mode, why } => write!(f, "{}：{}", mode_name(*mode), reason(*why)),
            Event::SingleCycle => f.write_str("单循环"),
            Event::SingleStep => f.write_str("单步"),
            Event::EndsWithCycle => f.write_str("停止按钮：本循环结束后停止"),
            Event::AlarmRaised { alarm, why } => {
                write!(f, "报警 {alarm}：")?;
                cause(f, why)
            }
            Event::AlarmCleared { alarm } => write!(f, "报警 {alarm} 已清除"),
            Event::EmergencyStopReleased => f.write_str("急停已释放"),
            Event::MovedByHand { axis, by, percent } => {
                write!(f, "手动：{axis} 移动 {by}，速度 {percent} %")
            }
            Event::HeldByHand { axis, up, percent } => {
                let sign = if *up { '+' } else { '-' };
                write!(f, "手动：{axis}{sign}，速度 {percent} %，按住期间移动")
            }
            Event::NotHeldAnyMore => f.write_str("手动：未再收到按住信号，该轴停止"),
            Event::Homing => f.write_str("正在回原点"),
            Event::Homed => f.write_str("已回原点"),
            Event::ProgramLoaded { name, steps } => write!(f, "程序 `{name}` 已装入：{steps} 个步骤"),
            Event::ProgramGivenAtStart { name } => {
                write!(f, "程序 `{name}` 使用启动时给出的版本；面板装入的版本予以保留")
            }
            Event::ProgramGone { name, why } => {
                write!(f, "程序 `{name}` 曾由面板装入，现在无法使用：{why}")
            }
            Event::CurveNotExecuted { step } => write!(
                f,
                "{}：与真实控制器一样未执行：列表替换或程序开始以来，它之前没有直线运动（action 10）",
                at(step)
            ),
            Event::Dwells { rest } => write!(f, "机械臂在该点停留 {rest:?}（故障 dwell）"),
            Event::Happens { what } => {
                f.write_str("场景：")?;
                happening(f, what)
            }
            Event::DidNotHappen { what, why } => {
                f.write_str("场景：")?;
                happening(f, what)?;
                match why {
                    DidNot::Refused { why } => write!(f, "：{}", refused(why)),
                    DidNot::TooManyInputs => write!(f, "：{TOO_MANY}"),
                    DidNot::TooManyCounters { limit } => write!(f, "：计数器已有 {limit} 个"),
                }
            }
            Event::InputDoesNotFollow => write!(f, "场景：有输入不再跟随：{TOO_MANY}"),
            Event::HappeningsLeftOut { count } => write!(f, "场景：一次过多，省略 {count} 件事"),
            Event::FaultBegins { fault } => write!(f, "场景：故障 {fault} 开始"),
            Event::FaultEnds { fault } => write!(f, "场景：故障 {fault} 结束"),
            Event::MainsAreBack => f.write_str("场景：电源恢复"),
            Event::ProgramNotChosen { why } => write!(f, "场景：{}", refused(why)),
            Event::Struck { fault: fault @ Fault::Link(_) } => write!(f, "连接受到故障 {fault} 影响"),
            Event::Struck { fault } => write!(f, "应答受到故障 {fault} 影响"),
            Event::NotAnswered { fault } => write!(f, "不应答：故障 {}", Fault::Task(*fault)),
            Event::OldValues { fault } => write!(f, "用旧值应答：故障 {}", Fault::Task(*fault)),
            Event::Shell(event) => shell(f, event),
        }
    }
}

const TOO_MANY: &str = "即将变化的输入过多";

fn not_done(f: &mut fmt::Formatter<'_>, done: bool) -> fmt::Result {
    f.write_str(if done { "" } else { "：已应答 ok，但没有执行（故障 not-executed）" })
}

fn mode_name(mode: OperationMode) -> String {
    let name = match mode {
        OperationMode::None => "无模式",
        OperationMode::Manual => "手动模式",
        OperationMode::Auto => "自动模式",
        OperationMode::Stop => "停止模式",
        OperationMode::Running => "自动运行中",
        OperationMode::SingleStep => "单步",
        OperationMode::SingleCycle => "单循环",
        OperationMode::Unknown(_) => "未知模式",
    };
    format!("{name} ({})", mode.number())
}

fn reason(why: ModeReason) -> &'static str {
    match why {
        ModeReason::Started => "已启动",
        ModeReason::KeyTurned => "模式开关已转动",
        ModeReason::ActionStop => "actionStop",
        ModeReason::ActionPause => "actionPause",
        ModeReason::StopButton => "停止按钮",
        ModeReason::Alarm => "报警",
        ModeReason::SingleStep => "单步结束",
        ModeReason::SingleStepWithoutStep => "单步：没有可执行的步骤",
        ModeReason::ProgramEnded => "程序结束",
        ModeReason::ProgramIsEmpty => "程序结束：没有可执行的步骤",
    }
}

fn cause(f: &mut fmt::Formatter<'_>, cause: &AlarmCause) -> fmt::Result {
    match cause {
        AlarmCause::NoHeartbreak { seconds } => write!(f, "{seconds} s 没有收到 heartbreak"),
        AlarmCause::Panel => f.write_str("由面板触发"),
        AlarmCause::Scenario => f.write_str("由场景触发"),
        AlarmCause::ListReplacedInMotion => f.write_str("运动中 AddRCC 替换了列表"),
        AlarmCause::MovedToLimit => f.write_str("手动移动到软限位"),
        AlarmCause::ActionStop => f.write_str("actionStop"),
        AlarmCause::EmergencyStop { mode } => write!(f, "急停，{}", mode_name(*mode)),
        AlarmCause::WaitedTooLong { limit, .. } => write!(f, "等待超时：限时 {limit} s"),
        AlarmCause::Step { step: Some(step), why: reason } => write!(f, "{}：{}", at(step), why(reason)),
        AlarmCause::Step { step: None, why: reason } => f.write_str(&why(reason)),
        AlarmCause::Other { why } => fmt::Display::fmt(why, f),
    }
}

fn refusal(why: &ListRefusal) -> String {
    match why {
        ListRefusal::UnknownAction(action) => return format!("没有 action {action}"),
        ListRefusal::UnsupportedAction => "此固件没有其中一个 action",
        ListRefusal::NoRoom => "远程指令列表放不下这么多指令",
        ListRefusal::InMotion => "运动中替换了列表：报警 200",
        ListRefusal::NotArmed => "没有程序在等待远程指令：模式不是 7，或有报警，或使用的程序不是 `remote`",
        ListRefusal::NotStarted(why) => return refused(why),
        ListRefusal::ListFull => "远程指令列表已满",
        ListRefusal::InTheMiddle => "列表中间有一条指令没有接收",
    }
    .to_owned()
}

/// Why something was refused, failed or is odd.
fn why(reason: &Reason) -> String {
    match reason {
        Reason::Field(error) => field(error),
        Reason::Address(error) => {
            let near = error.nearest().map(|row| match row.indices {
                None => format!("；最接近的是 `{}`", row.name),
                Some((first, last)) => format!("；最接近的是 `{}`，n 为 {first} 至 {last}", row.name),
            });
            format!("没有 `{}` 这个查询地址{}", printable(&error.name), near.unwrap_or_default())
        }
        Reason::Extra(extra) => extra_key(extra),
        Reason::Type(word) => request_type(word),
        Reason::Frame(error) => frame(error),
        Reason::Json(JsonError { at, .. }) => format!("第 {at} 字节处不是正确的 JSON：{reason}"),
        Reason::NoCommand { word, nearest: near, request } => {
            let hint = request.map(|request| format!("；`{request}` 是请求类型，请写在 `reqType` 里"));
            format!("没有 `{word}` 这个命令{}{}", nearest(*near), hint.unwrap_or_default())
        }
        Reason::NotOfFirmware(name) => format!("此固件没有命令 {name}"),
        Reason::NoProgram { name, nearest: near } => {
            format!("没有程序 `{name}`{}", nearest(near.as_ref()))
        }
        Reason::NoProgramToCall(name) => format!("没有要调用的程序 `{name}`"),
        Reason::Moving => "机械臂正在运动".to_owned(),
        Reason::NoCounter(id) => format!("没有计数器 {id}"),
        Reason::NoBoard(board) => format!("没有输出板 {board}"),
        Reason::CounterTarget => "此网口不能修改计数器的目标值：请填 -1".to_owned(),
        Reason::MPoints => "此网口不能设置 M 值".to_owned(),
        Reason::NumbersBelow(end) => format!("编号只有 0 至 {}", end.saturating_sub(1)),
        Reason::Panel(why) => refused(why),
        Reason::Plan(error) => plan(*error),
        Reason::NoAnswerToPhoto { camera, seconds } => {
            format!("相机 {camera} 在 {seconds} s 内没有应答拍照请求")
        }
        Reason::NoPhoto { camera } => format!("相机 {camera} 拍照失败"),
        Reason::NoPointInTime => "限时内没有收到视觉点位".to_owned(),
        Reason::NoPointTaken => "程序还没有取视觉点位".to_owned(),
        Reason::RegistersNotWritten => "限时内没有写入寄存器".to_owned(),
        Reason::ByProgram => "由程序触发".to_owned(),
        Reason::Text(text) => text.to_string(),
    }
}

fn nearest(word: Option<impl fmt::Display>) -> String {
    word.map(|word| format!("；最接近的是 `{word}`")).unwrap_or_default()
}

fn field(error: &FieldError) -> String {
    let path = match &error.path {
        FieldPath::Member(path) => format!("`{}`", printable(path)),
        FieldPath::Argument { command, number, name } => {
            format!("`{command}` 的第 {number} 个参数 ({name})")
        }
    };
    let found = match &error.found {
        None => " 没有给出".to_owned(),
        Some(found) => format!(" 是 {}", printable(found)),
    };
    let wanted = error.wanted.text(Language::Chinese);
    let blank = if wanted.starts_with(|first: char| first.is_ascii()) { " " } else { "" };
    format!("{path}{found}，应为{blank}{wanted}{}", nearest(error.nearest))
}

fn extra_key(extra: &ExtraKey) -> String {
    let place = match extra.place {
        Place::Top => "报文".to_owned(),
        place => format!("`{place}` "),
    };
    let what = match extra.kind {
        ExtraKind::UnknownKey => "不是已知的字段",
        ExtraKind::DuplicateKey => "重复出现，前一个值无效",
        ExtraKind::OtherSpelling => "可以接受，但说明书的写法不同",
        ExtraKind::OutOfPlace => "是已知的字段，但在这里没有意义",
    };
    format!("{place}中的 `{}` {what}{}", printable(&extra.key), nearest(extra.nearest()))
}

fn request_type(unknown: &UnknownTypeWord) -> String {
    let Some(word) = &unknown.word else {
        return "没有 `reqType`，也没有能看出类型的字段".to_owned();
    };
    let word: String = word.chars().take(48).collect();
    let hint = match unknown.command() {
        Some(_) => "；这是命令：请用 `reqType` \"command\"，命令写在 `cmdData` 里".to_owned(),
        None => nearest(unknown.nearest()),
    };
    format!("`reqType` 是 `{}`，没有这种请求类型{hint}", printable(&word))
}

fn frame(error: &FrameError) -> String {
    let FrameError { stream_offset: offset, fault_offset: at, fault, .. } = error;
    let head = error.shown();
    let what = match fault {
        FrameFault::Garbage => {
            return format!("偏移 {offset} 处的字节不是 JSON 对象：{head}；已跳到下一个 `{{`");
        }
        FrameFault::TooLarge { limit } => format!("超过 {limit} 字节；整个报文已跳过"),
        FrameFault::TooDeep { limit } => format!("嵌套超过 {limit} 层；整个报文已跳过"),
        FrameFault::MismatchedBracket { expected, found } => {
            format!("偏移 {at} 处是 `{found}`，应为 `{expected}`；已跳到下一个报文")
        }
        FrameFault::ControlByteInString { byte } => {
            format!("在字符串中间中断，偏移 {at} 处是字节 0x{byte:02X}；已跳到下一个报文")
        }
        FrameFault::TextBehindString { found } => {
            format!("偏移 {at} 处的 `{found}` 紧跟在字符串后面，少了一个引号；已跳到下一个报文")
        }
        FrameFault::ObjectWhereNoneCanStand => format!("不完整：偏移 {at} 处又开始了一个报文"),
        FrameFault::Incomplete { received } => format!("没有结束：只收到 {received} 字节"),
    };
    format!("偏移 {offset} 处的报文 {head} {what}")
}

fn plan(error: PlanError) -> String {
    match error {
        PlanError::OutsideLimits { axis, side } => {
            let beyond = match side {
                LimitSide::Plus => "高于软限位上限",
                LimitSide::Minus => "低于软限位下限",
            };
            format!("{axis} {beyond}")
        }
        PlanError::Unreachable => "目标位置到达不了".to_owned(),
        PlanError::Singular { axis } => format!("奇异点：{axis} 跟不上"),
        PlanError::CurvePoints => "曲线的三个点不能构成圆弧".to_owned(),
        PlanError::Speed => "速度不大于 0".to_owned(),
        PlanError::NotFinite => "坐标不是有限的数，或远超机械臂的范围".to_owned(),
    }
}

/// The step that an event is about.
fn at(step: &AtStep) -> String {
    match step {
        AtStep::OfProgram { program, step } => format!("程序 `{program}` 第 {step} 步"),
        AtStep::OfList { instruction, action } => format!("第 {instruction} 条指令（action {action}）"),
    }
}

fn happening(f: &mut fmt::Formatter<'_>, what: &Happening) -> fmt::Result {
    match what {
        Happening::Panel(action) => panel(f, action),
        Happening::Output(point, on) => write!(f, "输出 {} {}", point.name(), level(*on)),
        Happening::Bounce(Bounce { input, times, on, .. }) => {
            write!(f, "输入 {input} 抖动 {times} 次，最后{}", level(*on))
        }
        Happening::Counter { id, current, target: None } => write!(f, "计数器 {id} 设为 {current}"),
        Happening::Counter { id, current, target: Some(target) } => {
            write!(f, "计数器 {id} 设为 {current}，目标 {target}")
        }
        Happening::Photo(camera) => write!(f, "请求相机 {camera} 拍照"),
        Happening::Request(_) => f.write_str("另一台上位机发来请求"),
        Happening::PowerCut { off, .. } => write!(f, "断电 {} s", off.as_secs_f64()),
    }
}

fn panel(f: &mut fmt::Formatter<'_>, action: &PanelAction) -> fmt::Result {
    match action {
        PanelAction::SetInput { board, point, on } => {
            write!(f, "输入 {} {}", InputPoint::X(*board, *point), level(*on))
        }
        PanelAction::SetEuInput { point, on } => {
            write!(f, "输入 {} {}", InputPoint::Eu(*point), level(*on))
        }
        PanelAction::Press(button) => f.write_str(match button {
            Button::Start => "按下启动",
            Button::Stop => "按下停止",
            Button::Pause => "按下暂停",
            Button::SingleCycle => "按下单循环",
            Button::SingleStep => "按下单步",
        }),
        PanelAction::TurnKey(key) => f.write_str(match key {
            Key::Manual => "模式开关转到手动",
            Key::Stop => "模式开关转到停止",
            Key::Auto => "模式开关转到自动",
        }),
        PanelAction::EmergencyStop => f.write_str("按下急停"),
        PanelAction::ReleaseEmergencyStop => f.write_str("释放急停"),
        PanelAction::ClearAlarm => f.write_str("清除报警"),
        PanelAction::RaiseAlarm(number) => write!(f, "报警 {number}"),
        PanelAction::Home => f.write_str("回原点"),
        PanelAction::Jog { axis, by, .. } => write!(f, "点动 {axis} {by}"),
        PanelAction::HoldJog { axis, up, .. } => write!(f, "按住点动 {axis}{}", if *up { '+' } else { '-' }),
        PanelAction::KeepJog => f.write_str("继续按住点动"),
        PanelAction::EndJog => f.write_str("松开点动"),
        PanelAction::ClearPoints => f.write_str("清除视觉点位"),
        PanelAction::SwitchProgram(name) => write!(f, "选择程序 `{name}`"),
        PanelAction::LoadProgram { name, .. } => write!(f, "装入程序 `{name}`"),
    }
}

fn level(on: bool) -> &'static str {
    if on { "接通" } else { "断开" }
}

fn refused(why: &Refused) -> String {
    match why {
        Refused::NoSuchInput { board, point } => {
            format!("输入板 {board} 没有点 {point}：板 0 至 7，点 0 至 31")
        }
        Refused::PowerOff => "已断电：请等待电源恢复".to_owned(),
        Refused::EmergencyStop => "急停已按下：确认安全后释放急停，再清除报警".to_owned(),
        Refused::Alarm { alarm } => format!("有报警 {alarm}：请先清除"),
        Refused::NotHomed => "机器未回原点".to_owned(),
        Refused::NotAuto { mode } => format!("当前{}：请将模式开关转到自动", mode_name(*mode)),
        Refused::NotManual { mode } => {
            format!("当前{}，手动移动只能在手动模式：请将模式开关转到手动", mode_name(*mode))
        }
        Refused::Moving => "机械臂正在运动：请停止，或等待其静止".to_owned(),
        Refused::NoSuchAxis { axis, axes } => format!("没有 {axis}：只有 J1 至 J{axes}"),
        Refused::NoDistance => "距离必须是不为 0 的角度或毫米数".to_owned(),
        Refused::BadSpeed => "速度必须大于 0，最大 100 %".to_owned(),
        Refused::NotHeld => "没有按住的点动：移动已结束".to_owned(),
        Refused::NoGlobalSpeed => "全局速度为 0：请先提高（modifyGSPD）".to_owned(),
        Refused::NoSuchAlarm { alarm } => format!("没有报警 {alarm}：只有 1 至 10000"),
        Refused::ProgramRuns { name } => {
            format!("程序 `{name}` 正在运行或可能被调用：请先停止，或换一个名称装入")
        }
        Refused::Program { reason }
        | Refused::BadProgram { reason }
        | Refused::NoRoom { reason }
        | Refused::NoPath { reason } => reason.clone(),
    }
}

fn shell(f: &mut fmt::Formatter<'_>, event: &ShellEvent) -> fmt::Result {
    match event {
        ShellEvent::Refuses => f.write_str("拒绝连接"),
        ShellEvent::GivesNoAnswer => f.write_str("连接请求得不到应答"),
        ShellEvent::DoesNotServe { why } => write!(f, "可以建立连接，但不提供服务：{why}"),
        ShellEvent::TakesAgain => f.write_str("重新接受连接"),
        ShellEvent::CannotAccept { why } => write!(f, "无法接受连接：{why}；将继续尝试"),
        ShellEvent::AcceptsAgain => f.write_str("又可以接受连接"),
        ShellEvent::ShortQueue { why } => write!(f, "只有少量连接可以排队等待接受：{why}"),
        ShellEvent::CannotListen { address, why } => {
            write!(f, "无法重新监听 {address}：{why}；将继续尝试")
        }
        ShellEvent::CameraConnected { camera } => write!(f, "已连接 {camera}"),
        ShellEvent::CameraLost { camera, how } => write!(f, "{camera} 的连接断开：{how}"),
        ShellEvent::CameraUnreachable { camera, why } => {
            write!(f, "无法连接 {camera}：{why}；将继续尝试")
        }
        ShellEvent::StateNotWritten { why } => {
            write!(f, "{why}；在能够写入之前，改变状态的请求都不确认")
        }
        ShellEvent::StateWritten { path } => write!(f, "{path} 可以重新写入"),
        ShellEvent::LastStateLost { why } => write!(f, "最后的状态没有保存：{why}"),
        ShellEvent::Note { text } => fmt::Display::fmt(text, f),
    }
}
