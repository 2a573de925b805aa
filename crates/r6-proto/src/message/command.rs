//! Commands: requests that act at once (manual 4.2). The replies are in `reply`.

mod argument;
mod reply;
mod table;
mod typed;

use std::borrow::Cow;
use std::fmt;

use crate::address::Ports;
use crate::error::{EncodeError, FieldError, FieldPath, Wanted};
use crate::message::fields::excerpt;
use crate::printable::printable;
use crate::spelling;
use crate::value::Values;

use argument::{Argument, Source, Writer};
pub use argument::{ArgumentInfo, ArgumentKind};
pub use reply::{CommandReply, Outcome};
pub use table::{COMMANDS, Command, CommandName};
pub use typed::TypedError;

/// The effect of a request on the machine. A lease, a firewall and an audit decide about requests by their
/// effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Effect {
    /// Reads only.
    Reads,
    /// Changes a value or an output.
    Changes,
    /// Can start a motion. An output (a pulse on M011), a register (800 to 805) or another program may start
    /// a motion in a cell, so requests that write these count too.
    Moves,
    /// Can only end a motion.
    Stops,
}

impl Effect {
    /// Its word: `reads`, `changes`, `moves` or `stops`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Reads => "reads",
            Self::Changes => "changes",
            Self::Moves => "moves",
            Self::Stops => "stops",
        }
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// One row of the table of commands.
#[derive(Clone, Copy, Debug)]
pub struct CommandInfo {
    /// The word on the wire (`cmdData[0]`).
    pub word: &'static str,
    /// The arguments, in order.
    pub arguments: &'static [ArgumentInfo],
    /// What it does.
    pub meaning: &'static str,
    /// What to do if the controller refuses it.
    pub if_refused: &'static str,
    /// Its effect on the machine.
    pub effect: Effect,
    /// Whether poses refer to another frame after it: another tool or workbench, or changed values of a tool.
    pub changes_frame: bool,
    /// Whether the machine runs the rest of its instruction list after it.
    pub starts: bool,
    /// Which port offers it.
    pub ports: Ports,
    /// The first manual or firmware that knows it.
    pub since: &'static str,
    /// The source: the number in the manual's table 4.2.1, or the evidence for a later command.
    pub source: &'static str,
}

impl CommandName {
    /// The command with exactly this word.
    #[must_use]
    pub fn exact(word: &[u8]) -> Option<Self> {
        Self::ALL.into_iter().find(|name| name.word().as_bytes() == word)
    }

    /// The word on the wire.
    #[must_use]
    pub fn word(self) -> &'static str {
        self.info().word
    }

    /// The row of the table.
    #[must_use]
    pub fn info(self) -> &'static CommandInfo {
        // A discriminant is an index into the table, because both have the same order.
        #[expect(clippy::indexing_slicing, reason = "a discriminant is below the number of variants")]
        &COMMANDS[self as usize]
    }

    /// Its effect on the machine.
    #[must_use]
    pub fn effect(self) -> Effect {
        self.info().effect
    }

    /// Whether the machine runs the rest of its instruction list after it.
    #[must_use]
    pub fn starts(self) -> bool {
        self.info().starts
    }

    /// The word of the table nearest to an unknown word.
    #[must_use]
    pub fn nearest(word: &str) -> Option<&'static str> {
        spelling::nearest(word, COMMANDS.iter().map(|row| row.word))
    }
}

impl fmt::Display for CommandName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// A command as it was sent: its name and its unread arguments.
#[derive(Clone, Copy, Debug)]
pub struct CommandWords<'a> {
    pub(crate) words: Values<'a>,
}

impl<'a> CommandWords<'a> {
    /// The word that names the command, as sent.
    #[must_use]
    pub fn word(&self) -> Cow<'a, str> {
        self.words.at(0).map(|word| word.text()).unwrap_or_default()
    }

    /// The command it names.
    #[must_use]
    pub fn name(&self) -> Option<CommandName> {
        self.words.at(0).and_then(|word| CommandName::exact(&word.word()))
    }

    /// The arguments, as sent.
    #[must_use]
    pub fn arguments(&self) -> Values<'a> {
        self.words.skip(1)
    }

    /// The command, with its arguments read and checked.
    ///
    /// # Errors
    /// [`CommandError`] for an unknown name (with the nearest one) and for an argument that is missing or
    /// wrong.
    pub fn read(&self) -> Result<Command<'a>, CommandError> {
        let mut sent = self.sent()?;
        Command::take(sent.name, &mut sent).map_err(CommandError::Argument)
    }

    /// The same as a command that outlives the frame.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_owned(&self) -> Result<Command<'static>, CommandError> {
        let sent = self.sent()?;
        Command::take(sent.name, &mut Copied(sent)).map_err(CommandError::Argument)
    }

    fn sent(&self) -> Result<Sent<'a>, CommandError> {
        match self.name() {
            Some(name) => Ok(Sent { name, values: self.arguments(), number: 0 }),
            None => {
                let word = self.word();
                Err(CommandError::UnknownCommand {
                    word: word.chars().take(48).collect(),
                    nearest: CommandName::nearest(&word),
                })
            }
        }
    }
}

/// The arguments of a command as a peer sent them.
struct Sent<'a> {
    name: CommandName,
    values: Values<'a>,
    number: usize,
}

impl<'a> Source<'a> for Sent<'a> {
    type Error = FieldError;

    const FORGIVES: bool = true;

    fn number(&self) -> usize {
        self.number
    }

    fn left(&self) -> usize {
        self.values.len().saturating_sub(self.number)
    }

    fn next(&mut self) -> Result<Argument<'a>, FieldError> {
        let number = self.number;
        self.number += 1;
        let kind = argument::info(self.name.info().arguments, number).map(|info| info.kind);
        let value = self.values.at(number);
        value.and_then(|value| kind?.read(value)).ok_or_else(|| self.wrong(number))
    }

    fn wrong(&self, number: usize) -> FieldError {
        let info = argument::info(self.name.info().arguments, number);
        let (name, wanted) = match info {
            Some(info) => (info.name, info.kind.wanted_on_the_wire()),
            None => ("?", Wanted::UNKNOWN),
        };
        FieldError {
            path: FieldPath::Argument { command: self.name.word(), number: number + 1, name },
            found: self.values.at(number).map(excerpt),
            wanted,
            nearest: None,
        }
    }
}

/// Copies of the arguments of a command as a peer sent them.
struct Copied<'a>(Sent<'a>);

impl Source<'static> for Copied<'_> {
    type Error = FieldError;

    const FORGIVES: bool = true;

    fn number(&self) -> usize {
        self.0.number()
    }

    fn left(&self) -> usize {
        self.0.left()
    }

    fn next(&mut self) -> Result<Argument<'static>, FieldError> {
        self.0.next().map(Argument::into_owned)
    }

    fn wrong(&self, number: usize) -> FieldError {
        self.0.wrong(number)
    }
}

/// Why a command cannot be executed as sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CommandError {
    /// The command is unknown.
    UnknownCommand {
        /// The word, cut at 48 characters.
        word: String,
        /// The nearest command.
        nearest: Option<&'static str>,
    },
    /// An argument is missing or wrong.
    Argument(FieldError),
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownCommand { word, nearest } => {
                write!(f, "unknown command `{}`", printable(word))?;
                match nearest {
                    None => Ok(()),
                    Some(near) => write!(f, "; nearest: `{near}`"),
                }
            }
            Self::Argument(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for CommandError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Argument(error) => Some(error),
            Self::UnknownCommand { .. } => None,
        }
    }
}

impl Command<'_> {
    /// Appends `cmdData`: the name and the arguments as texts.
    pub(crate) fn encode_data(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        out.extend_from_slice(b"[\"");
        out.extend_from_slice(self.name().word().as_bytes());
        out.push(b'"');
        self.encode_arguments(out)?;
        out.push(b']');
        Ok(())
    }

    fn encode_arguments(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        self.give(&mut Writer { arguments: self.name().info().arguments, number: 0, out })
    }
}

impl fmt::Display for Command<'_> {
    /// The word and the arguments as on the wire, such as `modifyOutput "0","5","1"`. If an argument cannot
    /// be sent, all are left out.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name().word())?;
        let mut arguments = Vec::new();
        match self.encode_arguments(&mut arguments) {
            Ok(()) => match String::from_utf8_lossy(&arguments).strip_prefix(',') {
                Some(arguments) => write!(f, " {}", printable(arguments)),
                None => Ok(()),
            },
            Err(_) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_shown_as_the_wire_has_it() {
        for (command, shown) in [
            (Command::ActionStop, "actionStop"),
            (Command::ModifyGspd { percent: 5.0 }, r#"modifyGSPD "50""#),
            (Command::ModifyGspd { percent: 500.0 }, "modifyGSPD"),
            (Command::ModifyOutput { board: 0, point: 5, on: true }, r#"modifyOutput "0","5","1""#),
            (Command::ClearAlarmWith { first_line: true, only_alarm: false }, r#"clearAlarm "1","0""#),
            (Command::SwitchMold { mold: "a\nb\u{9b}".into() }, r#"switchMold "a\nb\u{9b}""#),
        ] {
            assert_eq!(command.to_string(), shown);
        }
    }

    #[test]
    fn a_copy_of_a_command_is_the_command() {
        let mut decoder = crate::Decoder::new();
        for data in [
            r#"["switchMold","a\u0062"]"#,
            r#"["modifyGSPD",55]"#,
            r#"["modifyCounter","4","-1","7"]"#,
            r#"["rewriteDataList","800","2","1","5","-6"]"#,
            r#"["clearAlarm","1","0"]"#,
            r#"["modifyGSPD","x"]"#,
            r#"["fly"]"#,
        ] {
            let frame = format!(r#"{{"reqType":"command","cmdData":{data}}}"#);
            let message = decoder.decode(frame.as_bytes()).unwrap();
            let crate::Body::Command(words) = message.body else { panic!("{data}") };
            assert_eq!(words.read_owned(), words.read(), "{data}");
        }
    }

    #[test]
    fn what_can_start_a_register_driven_cell_counts_as_motion() {
        use CommandName::{ModifyGspd, ModifyOutput, RewriteData, RewriteDataList, SwitchMold};
        for command in [ModifyOutput, RewriteData, RewriteDataList, SwitchMold] {
            assert_eq!(command.effect(), Effect::Moves, "{command}");
        }
        assert_eq!(ModifyGspd.effect(), Effect::Changes);
    }

    #[test]
    fn every_name_has_its_own_row() {
        for (name, row) in CommandName::ALL.into_iter().zip(&COMMANDS) {
            assert_eq!(name.word(), row.word);
            assert_eq!(CommandName::exact(row.word.as_bytes()), Some(name));
            let camel = format!("{name:?}");
            assert_eq!(camel.to_lowercase(), row.word.to_lowercase());
        }
    }
}
