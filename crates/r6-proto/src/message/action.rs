//! The table of actions: what an instruction can do, and which members it then has.

use super::Effect;

/// One row of the table of actions.
#[derive(Clone, Copy, Debug)]
pub struct ActionInfo {
    /// The `action` number.
    pub number: i64,
    /// What it is called.
    pub name: &'static str,
    /// What it can do to the machine.
    pub effect: Effect,
    /// Its members, besides [`COMMON`]; several lists, because all moves share one.
    members: &'static [&'static [MemberInfo]],
}

impl ActionInfo {
    /// Its members, besides [`COMMON`].
    pub fn members(&self) -> impl Iterator<Item = &'static MemberInfo> + use<> {
        self.members.iter().copied().flatten()
    }
}

/// One member of an instruction, a point or a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemberInfo {
    /// Its name on the wire; `m0-m7` stands for the eight of them.
    pub name: &'static str,
    /// Its unit, empty where there is none.
    pub unit: &'static str,
    /// What it says.
    pub meaning: &'static str,
    /// Where it is written: the section of the manual, or the evidence for a later one.
    pub source: &'static str,
}

const fn member(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    source: &'static str,
) -> MemberInfo {
    MemberInfo { name, unit, meaning, source }
}

/// The table, one row each: what it is called in the code, its number, its name, what it can do to the machine, its members.
macro_rules! actions {
    ($( $action:ident $number:literal $name:literal $effect:ident [$($members:expr),+ $(,)?] )+) => {
        /// What an instruction does, as far as it is known.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Known { $( $action, )+ }

        impl Known {
            /// The action with this number.
            pub fn of(number: i64) -> Option<Self> {
                match number {
                    $( $number => Some(Self::$action), )+
                    _ => None,
                }
            }

            /// The `action` number.
            pub fn number(self) -> i64 {
                match self {
                    $( Self::$action => $number, )+
                }
            }
        }

        /// Every action.
        pub const ACTIONS: [ActionInfo; [$( $number ),+].len()] = [$( ActionInfo {
            number: $number,
            name: $name,
            effect: Effect::$effect,
            members: &[$( &$members ),+],
        }, )+];
    };
}

#[rustfmt::skip]
actions! {
    AxisMove 4 "axis move" Moves [[member("m0-m7", "deg", "target: axes J1 to J8 (mm on a sliding axis)", "6.1.1")], MANNER]
    LinearMove 10 "linear move" Moves [[member("m0-m7", "mm, deg", "target: X, Y, Z, U, V, W, M7, M8", "6.1.1")], MANNER]
    CurveMove 17 "curve move" Moves [[
        member("m0-m7", "mm, deg", "middle of the curve", "6.1.1"),
        member("m0_p-m7_p", "mm, deg", "end of the curve", "6.1.1"),
    ], MANNER]
    PathSpeed 51 "path speed" Changes [[
        member("isUse", "", "1 on, 0 off", "later manual"),
        member("speed", "mm/s", "of later linear moves without a speed; a whole number", "later manual"),
    ]]
    StopOnSignal 52 "stop on signal" Changes [[
        member("isUse", "", "1 begins, 0 ends to watch", "6.1.4"),
        member("ioNumber", "", "ordinary input, 0 to 31", "6.1.4"),
        member("io_status", "", "the state that stops: 1 on, 0 off", "6.1.4"),
    ]]
    Wait 100 "wait" Moves [[
        member("type", "", "0-4 input board (X), 5-7 M, 8 EU, 100 time", "6.1.3"),
        member("point", "", "0 to 31", "6.1.3"),
        member("io_status", "", "0 off, 1 on, 2 rising, 3 falling", "6.1.3"),
        member("limit", "s", "how long it waits, or the time itself", "6.1.3"),
        member("isUnlimit", "", "1: for ever", "6.1.3"),
    ]]
    Output 200 "output" Moves [[
        member("type", "", "0 Y, 5 M, 7 EUY, 100 timed Y", "later manual"),
        member("io_status", "", "1 on, 0 off", "later manual"),
        member("point", "", "0 to 32", "later manual"),
        member("delay", "s", "before the output, or the length of the pulse", "later manual"),
    ]]
    BoardOutput 204 "board output" Moves [[
        member("type", "", "0, 1 board of Y; 5, 6 board of M", "later manual"),
        member("point", "", "two bits for each of the points 0 to 15", "later manual"),
        member("point2", "", "two bits for each of the points 16 to 31", "later manual"),
    ]]
    Workbench 800 "workbench" Changes [[member("cnt_id", "", "number of the workbench", "6.1.2")]]
}

/// What every instruction has.
pub const COMMON: [MemberInfo; 2] = [
    member("oneshot", "", "1: the step is removed once it has run; 0: it stays", "6"),
    member("action", "", "what the step does", "6"),
];

/// What every move has.
const MANNER: [MemberInfo; 6] = [
    member("ckStatus", "", "mask of the axes that move", "6.1.1"),
    member("speed", "%", "0.1 to 100", "6.1.1"),
    member("delay", "s", "before the move", "6.1.1"),
    member("smooth", "", "blend level, 0 to 9", "6.1.1"),
    member("tool", "", "number of the tool frame", "later manual"),
    member("coord", "", "number of the work frame (workbench)", "later manual"),
];

/// What a point of a camera has (manual 5.2), and the photo (manual 5.1).
pub const VISION: [MemberInfo; 14] = [
    member("camID", "", "number of the camera", "5.1"),
    member("ret", "", "whether the photo was taken", "5.1"),
    member("dsData.camID", "", "number of the camera whose points follow", "5.2"),
    member("dsData.data", "", "its points", "5.2"),
    member("ModelID", "", "template that recognised the part", "5.2"),
    member("X", "mm", "in the calibrated world of the robot", "5.2"),
    member("Y", "mm", "in the calibrated world of the robot", "5.2"),
    member("Z", "mm", "in the calibrated world of the robot", "5.2"),
    member("U", "deg", "orientation", "5.2"),
    member("V", "deg", "orientation", "5.2"),
    member("Angel", "deg", "the wire's spelling: W, or U on a four-axis robot", "5.2"),
    member("Similarity", "", "how alike; its range is left open", "5.2"),
    member("Color", "", "its range is left open", "5.2"),
    member("Rel", "", "1: the coordinates are relative", "5.2"),
];

/// What stands at the top of requests, besides what they are about.
pub const HEADER: [MemberInfo; 5] = [
    member("dsID", "", "whom the frame is for", "2.1, 3"),
    member("reqType", "", "type of the request", "2.1, 3"),
    member("cmdType", "", "the same in older firmware and in its replies", "2.1"),
    member("packID", "", "correlation id", "later manual; captured, unit C"),
    member("emptyList", "", "1 replaces the instruction list, 0 appends", "6"),
];

#[cfg(test)]
mod tests {
    use crate::Decoder;
    use crate::message::action::{ACTIONS, COMMON, Known, MemberInfo};
    use crate::message::fields::Fields;
    use crate::message::{Body, ExtraKind};

    fn names(member: &MemberInfo) -> Vec<String> {
        match member.name {
            "m0-m7" => (0..8).map(|axis| format!("m{axis}")).collect(),
            "m0_p-m7_p" => (0..8).map(|axis| format!("m{axis}_p")).collect(),
            name => vec![name.to_owned()],
        }
    }

    #[test]
    fn an_instruction_is_read_with_the_members_of_its_row_and_no_others() {
        for action in &ACTIONS {
            let its_own: Vec<String> = COMMON.iter().chain(action.members()).flat_map(names).collect();
            let others: Vec<_> =
                Fields::names().filter(|name| !its_own.iter().any(|own| own == name)).collect();
            let members: Vec<_> = its_own
                .iter()
                .map(String::as_str)
                .chain(others.iter().copied())
                .map(|name| match name {
                    "action" => format!("\"action\":\"{}\"", action.number),
                    _ => format!("\"{name}\":\"0\""),
                })
                .collect();
            let frame = format!("{{\"reqType\":\"AddRCC\",\"instructions\":[{{{}}}]}}", members.join(","));
            let mut decoder = Decoder::new();
            let message = decoder.decode(frame.as_bytes()).unwrap();
            let Body::AddRcc(list) = message.body else { panic!("{message:?}") };
            assert_eq!(list.instructions[0].action.number(), action.number);
            let mut passed_over: Vec<String> = message
                .extras()
                .filter(|extra| extra.kind == ExtraKind::OutOfPlace)
                .map(|extra| extra.key.text().into_owned())
                .collect();
            let mut others = others;
            passed_over.sort();
            others.sort();
            assert_eq!(passed_over, others, "action {}", action.number);
        }
    }

    #[test]
    fn every_number_has_its_own_action() {
        for action in &ACTIONS {
            assert_eq!(Known::of(action.number).map(Known::number), Some(action.number));
        }
        assert_eq!(Known::of(5), None);
    }
}
