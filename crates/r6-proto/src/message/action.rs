//! The table of actions: what each instruction does, and which members it has. The rows of these members are
//! in `instruction/table.rs`.

use super::instruction::{BoardOutput, Manner, Output, PathSpeed, StopOnSignal, Wait, Workbench};

/// One row of the table of actions.
#[derive(Clone, Copy, Debug)]
pub struct ActionInfo {
    /// The `action` number.
    pub number: i64,
    /// Its name.
    pub name: &'static str,
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
    /// Its name on the wire; `m0-m7` stands for eight members.
    pub name: &'static str,
    /// The source: the section of the manual, or the evidence for a later member.
    pub source: &'static str,
}

const fn member(name: &'static str, source: &'static str) -> MemberInfo {
    MemberInfo { name, source }
}

/// Defines the table. Each row has: the name in the code, the number, the name for people, and the members.
macro_rules! actions {
    ($( $action:ident $number:literal $name:literal [$($members:expr),+ $(,)?] )+) => {
        /// The known actions of an instruction.
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
            members: &[$( $members ),+],
        }, )+];
    };
}

#[rustfmt::skip]
actions! {
    AxisMove 4 "axis move" [TARGET, Manner::MEMBERS]
    LinearMove 10 "linear move" [TARGET, Manner::MEMBERS]
    CurveMove 17 "curve move" [TARGET, END, Manner::MEMBERS]
    PathSpeed 51 "path speed" [PathSpeed::MEMBERS]
    StopOnSignal 52 "stop on signal" [StopOnSignal::MEMBERS]
    Wait 100 "wait" [Wait::MEMBERS]
    Output 200 "output" [Output::MEMBERS]
    BoardOutput 204 "board output" [BoardOutput::MEMBERS]
    Workbench 800 "workbench" [Workbench::MEMBERS]
}

/// The coordinates of a target, or of the middle of a curve.
const TARGET: &[MemberInfo] = &[member("m0-m7", "6.1.1")];

/// The end of a curve.
const END: &[MemberInfo] = &[member("m0_p-m7_p", "6.1.1")];

/// The members that every instruction has.
pub const COMMON: [MemberInfo; 2] = [member("oneshot", "6"), member("action", "6")];

/// The members of the photo (manual 5.1) and of a camera with its points (manual 5.2). Those of a point are
/// [`Point::MEMBERS`](super::Point::MEMBERS).
pub const VISION: [MemberInfo; 4] = [
    member("camID", "5.1"),
    member("ret", "5.1"),
    member("dsData.camID", "5.2"),
    member("dsData.data", "5.2"),
];

/// The members at the top of a request, besides its content.
pub const HEADER: [MemberInfo; 5] = [
    member("dsID", "2.1, 3"),
    member("reqType", "2.1, 3"),
    member("cmdType", "2.1"),
    member("packID", "later manual; captured, unit C"),
    member("emptyList", "6"),
];

/// The name of the action with this number.
#[must_use]
pub fn name(number: i64) -> Option<&'static str> {
    ACTIONS.iter().find(|action| action.number == number).map(|action| action.name)
}

/// The numbers of all actions, for people: `4, 10, 17`.
#[must_use]
pub fn numbers() -> String {
    ACTIONS.map(|action| action.number.to_string()).join(", ")
}

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
            assert_eq!(list.instructions[0].action.name(), action.name);
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
