//! The arguments of a command, from the words of the command line to the units of the wire.

use std::borrow::Cow;
use std::str::FromStr;

use r6_proto::address::RegisterIndex;
use r6_proto::grid::Grid;
use r6_proto::io_point::IoPoint;
use r6_proto::{Command, CommandName};

use super::said;

/// Reads the arguments of a command, in the units of the table of commands.
pub fn read(name: CommandName, words: &[String]) -> Result<Command<'static>, String> {
    let arguments = Arguments { name, words };
    arguments.check_count()?;
    Ok(match name {
        CommandName::ActionStop => Command::ActionStop,
        CommandName::ActionPause => Command::ActionPause,
        CommandName::ActionSingleCycle => Command::ActionSingleCycle,
        CommandName::StartButton => Command::StartButton,
        CommandName::StopButton => Command::StopButton,
        CommandName::ClearAlarmRunNext => Command::ClearAlarmRunNext,
        CommandName::ClearAlarmContinue => Command::ClearAlarmContinue,
        CommandName::ClearAlarm if words.is_empty() => Command::ClearAlarm,
        CommandName::ClearAlarm => {
            Command::ClearAlarmWith { first_line: arguments.flag(0)?, only_alarm: arguments.flag(1)? }
        }
        CommandName::SwitchMold => Command::SwitchMold { mold: Cow::Owned(arguments.word(0).to_owned()) },
        CommandName::ModifyCounter => Command::ModifyCounter {
            id: arguments.whole(0)?,
            current: arguments.count(1)?,
            target: arguments.count(2)?,
        },
        CommandName::ModifyOutput => match arguments.signal()? {
            Some(named) => Command::ModifyOutput {
                board: said::board_of(named)?,
                point: named.point,
                on: arguments.flag_at(1, 2)?,
            },
            None => Command::ModifyOutput {
                board: arguments.up_to(0, 7)?,
                point: arguments.up_to(1, 31)?,
                on: arguments.flag(2)?,
            },
        },
        CommandName::ModifyStackData => Command::ModifyStackData {
            stack: arguments.whole(0)?,
            spacing: [arguments.thousandths(1)?, arguments.thousandths(2)?, arguments.thousandths(3)?],
            count: [arguments.whole(4)?, arguments.whole(5)?, arguments.whole(6)?],
        },
        CommandName::ModifyGspd => Command::ModifyGspd {
            percent: arguments.between(0, 0.0..=100.0, "percent from 0 to 100", Grid::PERCENT)?,
        },
        CommandName::RewriteData => Command::RewriteData {
            register: arguments.register(0)?,
            value: arguments.whole(1)?,
            savable: arguments.flag(2)?,
        },
        CommandName::RewriteDataList => arguments.register_list()?,
        CommandName::ModifyAccDec => {
            Command::ModifyAccDec { acceleration: arguments.ramp(0)?, deceleration: arguments.ramp(1)? }
        }
        CommandName::SwitchTool => Command::SwitchTool { tool: arguments.whole(0)? },
        CommandName::ModifyTool => Command::ModifyTool {
            tool: arguments.whole(0)?,
            offset: [
                arguments.thousandths(1)?,
                arguments.thousandths(2)?,
                arguments.thousandths(3)?,
                arguments.thousandths(4)?,
                arguments.thousandths(5)?,
                arguments.thousandths(6)?,
            ],
        },
        CommandName::SwitchCoordinate => Command::SwitchCoordinate { workbench: arguments.whole(0)? },
    })
}

struct Arguments<'a> {
    name: CommandName,
    words: &'a [String],
}

impl Arguments<'_> {
    fn check_count(&self) -> Result<(), String> {
        let wanted = self.name.info().arguments.len();
        let optional = self.name.info().arguments.iter().filter(|argument| argument.optional).count();
        let given = self.words.len();
        let open_ended = self.name == CommandName::RewriteDataList;
        let by_name = self.names_signal();
        let enough = match by_name {
            true => given == 2,
            false => given == wanted || given + optional == wanted || (open_ended && given > wanted),
        };
        if enough {
            return Ok(());
        }
        let arguments = match wanted {
            0 => "no argument".to_owned(),
            1 => "1 argument".to_owned(),
            _ => format!("{wanted} arguments"),
        };
        if optional > 0 {
            return Err(format!(
                "it takes {arguments}, or {} without the optional ones; {given} given",
                wanted - optional
            ));
        }
        if by_name {
            return Err(format!("a signal's name takes 1 more argument, on or off; {} given", given - 1));
        }
        Err(format!("it takes {arguments}, {given} given"))
    }

    /// Whether `modifyOutput` is told the name of a signal instead of board and point.
    fn names_signal(&self) -> bool {
        let begins_with_letter = self.word(0).starts_with(|first: char| first.is_ascii_alphabetic());
        self.name == CommandName::ModifyOutput && begins_with_letter
    }

    /// The signal that is named, if one is.
    fn signal(&self) -> Result<Option<IoPoint>, String> {
        if !self.names_signal() {
            return Ok(None);
        }
        self.word(0).parse().map(Some).map_err(|error: r6_proto::io_point::BadPoint| error.to_string())
    }

    fn word(&self, index: usize) -> &str {
        self.words.get(index).map_or("", String::as_str)
    }

    fn wrong(&self, index: usize, wanted: &str) -> String {
        let name = self.name.info().arguments.get(index).map_or("argument", |argument| argument.name);
        format!("{name} is `{}`, but has to be {wanted}", self.word(index))
    }

    fn whole<T: FromStr>(&self, index: usize) -> Result<T, String> {
        self.word(index).parse().map_err(|_| self.wrong(index, "a whole number in range"))
    }

    fn up_to(&self, index: usize, last: u8) -> Result<u8, String> {
        let value = self.word(index).parse().ok().filter(|value| *value <= last);
        value.ok_or_else(|| self.wrong(index, &format!("a whole number from 0 to {last}")))
    }

    /// A count, or -1 to keep what it has.
    fn count(&self, index: usize) -> Result<Option<u32>, String> {
        match self.word(index) {
            "-1" => Ok(None),
            word => word.parse().map(Some).map_err(|_| self.wrong(index, "a count from 0, or -1 to keep it")),
        }
    }

    fn flag(&self, index: usize) -> Result<bool, String> {
        self.flag_at(index, index)
    }

    /// The flag in the place of another argument.
    fn flag_at(&self, index: usize, of: usize) -> Result<bool, String> {
        match self.word(index) {
            "1" | "on" => Ok(true),
            "0" | "off" => Ok(false),
            other => {
                let name = self.name.info().arguments.get(of).map_or("argument", |argument| argument.name);
                Err(format!("{name} is `{other}`, but has to be 1 (on) or 0 (off)"))
            }
        }
    }

    fn thousandths(&self, index: usize) -> Result<f64, String> {
        self.between(index, -1e6..=1e6, "a number of mm or degrees", Grid::THOUSANDTHS)
    }

    fn ramp(&self, index: usize) -> Result<f64, String> {
        self.between(index, 0.001..=60.0, "seconds from 0.001 to 60", Grid::MILLISECONDS)
    }

    /// A number that the wire can carry as it is.
    fn between(
        &self,
        index: usize,
        range: std::ops::RangeInclusive<f64>,
        wanted: &str,
        grid: Grid,
    ) -> Result<f64, String> {
        let value = self.word(index).parse::<f64>().ok().filter(|value| range.contains(value));
        let value = value.ok_or_else(|| self.wrong(index, wanted))?;
        match grid.step(value) {
            Ok(_) => Ok(value),
            Err(Some(nearest)) => Err(self.wrong(index, &format!("{}; nearest: {nearest}", grid.wanted()))),
            Err(None) => Err(self.wrong(index, wanted)),
        }
    }

    fn register(&self, index: usize) -> Result<RegisterIndex, String> {
        let register = self.word(index).parse().ok().and_then(RegisterIndex::new);
        register.ok_or_else(|| self.wrong(index, "a register from 800 to 900"))
    }

    fn register_list(&self) -> Result<Command<'static>, String> {
        let first = self.register(0)?;
        let length: usize = self.whole(1)?;
        let savable = self.flag(2)?;
        let words = self.words.get(3..).unwrap_or_default();
        if words.len() != length {
            return Err(format!("length says {length}, but {} values follow", words.len()));
        }
        let room = usize::from(RegisterIndex::LAST - first.number()) + 1;
        if length == 0 || length > room {
            return Err(format!("{length} values do not fit into registers {} to 900", first.number()));
        }
        let values = words
            .iter()
            .map(|word| word.parse().map_err(|_| format!("value `{word}` has to be a whole number")))
            .collect::<Result<_, _>>()?;
        Ok(Command::RewriteDataList { first, savable, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_words(line: &str) -> Result<Command<'static>, String> {
        let mut words = line.split(' ').map(str::to_owned);
        let name = CommandName::exact(words.next().unwrap().as_bytes()).unwrap();
        read(name, &words.collect::<Vec<_>>())
    }

    #[test]
    fn people_type_percent_and_millimetres() {
        assert_eq!(read_words("modifyGSPD 5"), Ok(Command::ModifyGspd { percent: 5.0 }));
        assert_eq!(
            read_words("modifyTool 1 0 -10.5 100 0 0 90"),
            Ok(Command::ModifyTool { tool: 1, offset: [0.0, -10.5, 100.0, 0.0, 0.0, 90.0] })
        );
        assert_eq!(
            read_words("modifyCounter 3 -1 20"),
            Ok(Command::ModifyCounter { id: 3, current: None, target: Some(20) })
        );
    }

    #[test]
    fn an_output_goes_by_its_name_too() {
        let output = |board, point, on| Ok(Command::ModifyOutput { board, point, on });
        assert_eq!(read_words("modifyOutput 0 10 1"), output(0, 10, true));
        assert_eq!(read_words("modifyOutput Y022 on"), output(0, 10, true));
        assert_eq!(read_words("modifyOutput y1.010 0"), output(1, 0, false));
        assert_eq!(read_words("modifyOutput M010 off"), output(4, 0, false));
        assert_eq!(read_words("modifyOutput EUY047 1"), output(7, 31, true));
        for (wrong, says) in [
            ("modifyOutput Y10 on", "names no point"),
            ("modifyOutput X010 on", "is an input"),
            ("modifyOutput Y010 perhaps", "state is `perhaps`"),
            ("modifyOutput Y010 0 1", "1 more argument"),
        ] {
            let error = read_words(wrong).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn registers_in_a_row_have_to_fit_their_length() {
        let first = RegisterIndex::new(899).unwrap();
        assert_eq!(
            read_words("rewriteDataList 899 2 0 1 -2"),
            Ok(Command::RewriteDataList { first, savable: false, values: vec![1, -2] })
        );
        assert_eq!(
            read_words("rewriteDataList 899 3 0 1 -2"),
            Err("length says 3, but 2 values follow".to_owned())
        );
        assert_eq!(
            read_words("rewriteDataList 899 3 0 1 2 3"),
            Err("3 values do not fit into registers 899 to 900".to_owned())
        );
    }

    #[test]
    fn every_command_reads_from_arguments_in_range() {
        for name in CommandName::ALL {
            let words: Vec<String> = match name {
                CommandName::RewriteData => vec!["800", "1", "0"],
                CommandName::RewriteDataList => vec!["800", "1", "0", "5"],
                CommandName::ModifyStackData | CommandName::ModifyTool => vec!["1"; 7],
                _ => vec!["1"; name.info().arguments.len()],
            }
            .into_iter()
            .map(str::to_owned)
            .collect();
            assert_eq!(read(name, &words).map(|command| command.name()), Ok(name));
            let needs_none = name.info().arguments.iter().all(|argument| argument.optional);
            assert_eq!(read(name, &[]).is_ok(), needs_none, "{name}");
        }
    }

    #[test]
    fn arguments_that_are_optional_are_given_together_or_not_at_all() {
        assert_eq!(read_words("clearAlarm"), Ok(Command::ClearAlarm));
        let both = Command::ClearAlarmWith { first_line: true, only_alarm: false };
        assert_eq!(read_words("clearAlarm 1 0"), Ok(both));
        let wanted = "it takes 2 arguments, or 0 without the optional ones; 1 given";
        assert_eq!(read_words("clearAlarm 1"), Err(wanted.to_owned()));
        assert!(read_words("clearAlarm 1 2").unwrap_err().starts_with("only_alarm is `2`"));
    }

    #[test]
    fn what_is_wrong_names_the_argument() {
        assert_eq!(
            read_words("modifyGSPD 500"),
            Err("percent is `500`, but has to be percent from 0 to 100".to_owned())
        );
        for (between_two_steps, says) in [
            (
                "modifyGSPD 5.55",
                "percent is `5.55`, but has to be in steps of 0.1 percent; nearest: 5.5 or 5.6",
            ),
            (
                "modifyTool 1 0.0004 0 0 0 0 0",
                "x is `0.0004`, but has to be in steps of 0.001; nearest: 0 or 0.001",
            ),
            ("modifyAccDec 0.25 0.2505", "but has to be in steps of 0.001 seconds; nearest: 0.25 or 0.251"),
            (
                "modifyStackData 0 1 1 0.0001 2 2 2",
                "dz is `0.0001`, but has to be in steps of 0.001; nearest",
            ),
        ] {
            let error = read_words(between_two_steps).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
        assert_eq!(
            read_words("modifyOutput 0 32 1"),
            Err("point is `32`, but has to be a whole number from 0 to 31".to_owned())
        );
        assert_eq!(read_words("actionStop now"), Err("it takes no argument, 1 given".to_owned()));
        assert_eq!(
            read_words("rewriteData 799 1 0"),
            Err("register is `799`, but has to be a register from 800 to 900".to_owned())
        );
    }
}
