//! The events that can happen to a controller.

use r6_proto::alarm::AlarmCode;
use std::borrow::Cow;
use std::fmt;

use r6_controller::{Button, Key, PanelAction};
use r6_proto::AxisIndex;

use crate::input::Input;

/// The maximum number of operations of an input, so that each input takes milliseconds.
pub const MOST_OPERATIONS: usize = 40;

/// Bytes that a connection carries.
pub struct Bytes<'b>(pub Cow<'b, [u8]>);

impl fmt::Debug for Bytes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.escape_ascii())
    }
}

/// A one-shot move of the axes.
#[derive(Clone, Copy, Debug)]
pub struct AxisMove {
    /// Target, degrees.
    pub target: [f64; 6],
    /// Speed, percent.
    pub speed: f64,
    /// Wait before the move, s.
    pub delay: f64,
}

/// One event.
#[derive(Debug)]
pub enum Operation<'b> {
    /// An AddRCC arrives, on the first connection or on the other.
    List {
        /// The frame.
        frame: String,
        /// Number of instructions.
        steps: usize,
        /// Whether it replaces the present list.
        replace: bool,
        /// Its instructions, if all are one-shot axis moves.
        moves: Option<Vec<AxisMove>>,
        /// Whether it arrives on the other connection.
        elsewhere: bool,
    },
    /// A command arrives: its word and arguments, as in the frame.
    Command(&'static str),
    /// Another frame arrives, which starts no motion.
    Frame(&'static str),
    /// Arbitrary bytes arrive.
    Bytes(Bytes<'b>),
    /// A person uses the panel.
    Panel(PanelAction),
    /// Time passes, s.
    Pass(f64),
    /// The connection ends and is made again.
    Reconnect,
    /// The connection is lost without notice.
    Lose,
    /// The mains fail and come back.
    PowerCut,
    /// The controller requests a photo from a camera.
    Photo(i64),
    /// Every address is queried.
    AskEverything,
}

/// Commands, as in a frame.
const COMMANDS: [&str; 26] = [
    r#""actionStop""#,
    r#""startButton""#,
    r#""actionPause""#,
    r#""stopButton""#,
    r#""actionSingleCycle""#,
    r#""clearAlarm""#,
    r#""clearAlarmRunNext""#,
    r#""clearAlarmContinue""#,
    r#""modifyGSPD","0""#,
    r#""modifyGSPD","700""#,
    r#""modifyGSPD","1000""#,
    r#""switchMold","register-follow""#,
    r#""switchMold","remote""#,
    r#""switchMold","palletise""#,
    r#""rewriteDataList","800","6","1","1000","-2000","3000","0","0","0""#,
    r#""rewriteDataList","850","6","0","90000","0","0","0","0","0""#,
    r#""modifyCounter","0","2","-1""#,
    r#""modifyOutput","4","0","1""#,
    r#""modifyAccDec","100","100""#,
    r#""switchTool","1""#,
    r#""modifyTool","1","0","0","100000","0","90000","0""#,
    r#""switchCoordinate","3""#,
    r#""modifyStackData","0","100","100","50","2","2","2""#,
    r#""rewriteData","900","-7","1""#,
    r#""rewriteData","849","123456789","0""#,
    r#""modifyGSPD","355""#,
];

/// Frames that start no motion.
const FRAMES: [&str; 6] = [
    r#"{"reqType":"heartbreak"}"#,
    r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0,"ret":1}"#,
    r#"{"reqType":"AddPoints","dsData":[{"camID":"0","data":[{"ModelID":"0","X":"300","Y":"20","Z":"300","U":"180","V":"0","Angel":"4"}]}]}"#,
    r#"{"reqType":"AddRCC","emptyList":"1","instructions":[]}"#,
    r#"{"reqType":"query","packID":"7","queryAddr":["curMode","isMoving","axis-0","nothing"]}"#,
    r#"{"reqType":"command","cmdData":["heartbreak"]}"#,
];

const BUTTONS: [Button; 5] =
    [Button::Start, Button::Stop, Button::Pause, Button::SingleCycle, Button::SingleStep];

/// A program that a person loads; it runs for ever.
const PROGRAM: &str = "[[step]]\ndo = \"set-output\"\n";

impl<'b> Operation<'b> {
    /// Reads the next operation of an input.
    pub fn read(input: &mut Input<'b>) -> Self {
        match input.byte() % 16 {
            0..=2 => list(input, false),
            3..=5 => Self::Command(input.pick(&COMMANDS)),
            6 => Self::Frame(input.pick(&FRAMES)),
            7 => Self::Pass(f64::from(input.byte()) / 1000.0),
            8 => Self::Pass(f64::from(input.byte()) / 50.0),
            9 | 10 => Self::Panel(panel(input)),
            11 => Self::Bytes(Bytes(Cow::Borrowed(input.piece()))),
            12 => match input.below(4) {
                0 => Self::Reconnect,
                1 => Self::Lose,
                2 => Self::PowerCut,
                _ => Self::Photo(i64::from(input.byte())),
            },
            13 => Self::AskEverything,
            14 => {
                let frame = input.pick(&FRAMES).as_bytes();
                Self::Bytes(Bytes(Cow::Owned(crate::mutation::change(frame, input))))
            }
            _ => list(input, true),
        }
    }

    /// Whether it may set the arm or a program in motion: an explicit command, or bytes that may contain one.
    pub fn may_start(&self) -> bool {
        const STARTS: [&str; 4] =
            ["startButton", "actionSingleCycle", "clearAlarmRunNext", "clearAlarmContinue"];
        match self {
            // An empty list only clears.
            Self::List { steps, .. } => *steps > 0,
            Self::Bytes(_) => true,
            Self::Command(words) => STARTS.iter().any(|word| words.contains(word)),
            Self::Panel(action) => matches!(
                action,
                PanelAction::Press(Button::Start | Button::SingleCycle | Button::SingleStep)
                    | PanelAction::Home
                    | PanelAction::Jog { .. }
                    | PanelAction::HoldJog { .. }
            ),
            Self::Frame(_)
            | Self::Pass(_)
            | Self::Reconnect
            | Self::Lose
            | Self::PowerCut
            | Self::Photo(_)
            | Self::AskEverything => false,
        }
    }

    /// Whether it is `actionStop`.
    pub fn is_stop(&self) -> bool {
        matches!(self, Self::Command(r#""actionStop""#))
    }

    /// Whether it may clear an alarm.
    pub fn may_clear_alarm(&self) -> bool {
        match self {
            Self::Command(words) => words.contains("clearAlarm"),
            Self::Panel(action) => matches!(action, PanelAction::ClearAlarm),
            Self::Bytes(_) | Self::PowerCut => true,
            Self::List { .. }
            | Self::Frame(_)
            | Self::Pass(_)
            | Self::Reconnect
            | Self::Lose
            | Self::Photo(_)
            | Self::AskEverything => false,
        }
    }
}

fn panel(input: &mut Input<'_>) -> PanelAction {
    let (board, point, on) = (input.byte() % 9, input.byte() % 34, input.flag());
    match input.below(14) {
        0 | 1 => PanelAction::SetInput { board, point, on },
        2 => PanelAction::SetEuInput { point, on },
        3 | 4 => PanelAction::Press(input.pick(&BUTTONS)),
        5 => PanelAction::TurnKey(input.pick(&[Key::Auto, Key::Manual, Key::Stop])),
        6 => PanelAction::EmergencyStop,
        7 => PanelAction::ReleaseEmergencyStop,
        8 => PanelAction::ClearAlarm,
        9 => PanelAction::RaiseAlarm(AlarmCode(u32::from(input.number()))),
        10 => PanelAction::Home,
        11 => {
            let axis = input.pick(&AxisIndex::ALL);
            let (by, percent) = (input.decimal(400.0), input.decimal(110.0));
            match by {
                380.0.. => PanelAction::KeepJog,
                360.0..380.0 => PanelAction::EndJog,
                300.0..360.0 => PanelAction::HoldJog { axis, up: percent < 20.0, percent },
                by => PanelAction::Jog { axis, by, percent },
            }
        }
        12 => {
            PanelAction::SwitchProgram(input.pick(&["remote", "default", "register-move", "x"]).to_string())
        }
        _ => {
            let name = input.pick(&["remote", "mine", "default", ""]).to_string();
            PanelAction::LoadProgram { name, text: PROGRAM.to_owned() }
        }
    }
}

/// An AddRCC frame with up to five instructions.
fn list<'b>(input: &mut Input<'b>, elsewhere: bool) -> Operation<'b> {
    let replace = input.byte() & 3 != 0;
    let steps: Vec<_> = (0..input.below(6)).map(|_| step(input)).collect();
    let texts: Vec<_> = steps.iter().map(|(text, _)| &**text).collect();
    let frame = format!(
        r#"{{"reqType":"AddRCC","packID":"5","emptyList":"{}","instructions":[{}]}}"#,
        u8::from(replace),
        texts.join(",")
    );
    let moves = steps.iter().map(|(_, axis_move)| *axis_move).collect();
    Operation::List { frame, steps: steps.len(), replace, moves, elsewhere }
}

/// Six coordinates, as numbers and as text for a frame.
fn coordinates(input: &mut Input<'_>, suffix: &str, limits: [f64; 6]) -> ([f64; 6], String) {
    let values = limits.map(|limit| input.decimal(limit));
    let all: Vec<_> =
        values.iter().enumerate().map(|(n, value)| format!(r#""m{n}{suffix}":"{value:.3}""#)).collect();
    (values, all.join(","))
}

/// An instruction, and its [`AxisMove`] if it is a one-shot axis move.
fn step(input: &mut Input<'_>) -> (String, Option<AxisMove>) {
    const AXES: [f64; 6] = [200.0, 140.0, 140.0, 200.0, 130.0, 400.0];
    const POSE: [f64; 6] = [900.0, 900.0, 1200.0, 200.0, 200.0, 200.0];
    let how = input.byte();
    let oneshot = how & 0x80 == 0;
    let smooth = how >> 4 & 7;
    let speed = [100.0, 20.0, 5.0, 0.1, 100.0][input.below(5)];
    let delay = [0.0, 0.0, 0.1, 1.0][input.below(4)];
    let manner = format!(r#""ckStatus":"0x3F","speed":"{speed}","delay":"{delay}","smooth":"{smooth}""#);
    let mut axis_move = None;
    let rest = match how & 15 {
        0..=4 => {
            let (target, text) = coordinates(input, "", AXES);
            axis_move = oneshot.then_some(AxisMove { target, speed, delay });
            format!(r#""action":"4",{text},{manner}"#)
        }
        5 | 6 => format!(r#""action":"10",{},{manner}"#, coordinates(input, "", POSE).1),
        7 => {
            let middle = coordinates(input, "", POSE).1;
            format!(r#""action":"17",{middle},{},{manner}"#, coordinates(input, "_p", POSE).1)
        }
        8 => format!(
            r#""action":"100","type":"{}","point":"{}","io_status":"{}","limit":"{delay}","isUnlimit":"{}""#,
            input.below(9),
            input.below(32),
            input.below(4),
            input.byte() & 1
        ),
        9 => format!(
            r#""action":"200","type":"{}","io_status":"{}","point":"{}","delay":"{delay}""#,
            input.pick(&[0, 5, 7, 100]),
            input.byte() & 1,
            input.below(33)
        ),
        10 => format!(
            r#""action":"52","isUse":"{}","ioNumber":"{}","io_status":"{}""#,
            input.byte() & 1,
            input.below(32),
            input.byte() & 1
        ),
        11 => format!(r#""action":"51","isUse":"{}","speed":"{}""#, input.byte() & 1, input.byte()),
        12 => format!(r#""action":"800","cnt_id":"{}""#, input.below(40)),
        13 => format!(
            r#""action":"204","type":"{}","point":"{}","point2":"{}""#,
            input.pick(&[0, 1, 5, 6, 0, 1, 5, 6, 2]),
            input.number(),
            input.number()
        ),
        _ => format!(r#""action":"{}","anything":[1]"#, input.byte()),
    };
    (format!(r#"{{"oneshot":"{}",{rest}}}"#, u8::from(oneshot)), axis_move)
}
