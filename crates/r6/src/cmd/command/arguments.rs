//! Reads the arguments of a command from the words of the command line.

use r6_proto::io_point::{BadPoint, IoPoint};
use r6_proto::{Command, CommandName};

use super::wording;

/// Reads the arguments of a command, in the units of the table of commands. `modifyOutput` also takes a
/// signal's name in place of board and point.
pub fn read(name: CommandName, words: &[String]) -> Result<Command<'static>, String> {
    let by_name = |word: &&String| word.starts_with(|first: char| first.is_ascii_alphabetic());
    let typed = match words.first().filter(by_name) {
        Some(signal) if name == CommandName::ModifyOutput => {
            let [_, state] = words else {
                let given = words.len() - 1;
                return Err(format!("a signal's name takes 1 more argument, on or off; {given} given"));
            };
            let signal: IoPoint = signal.parse().map_err(|error: BadPoint| error.to_string())?;
            let (board, point) = wording::for_command(signal)?;
            Command::typed(name, &[&board.to_string(), &point.to_string(), state])
        }
        Some(_) | None => Command::typed(name, words),
    };
    typed.map_err(|error| error.to_string())
}

/// The words of a command as a gateway reads them: a signal's name is board and point there.
pub fn in_words(command: &Command<'_>, words: &[String]) -> Vec<String> {
    match command {
        Command::ModifyOutput { board, point, on } => {
            [board.to_string(), point.to_string(), u8::from(*on).to_string()].into()
        }
        _ => words.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::RegisterIndex;

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
        for line in ["rewriteDataList 899 3 0 1 -2", "rewriteDataList 899 3 0 1 2 3"] {
            let error = read_words(line).unwrap_err();
            assert!(error.starts_with("length is `3`, but has to be how many values follow"), "{error}");
        }
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
            Err("point is `32`, but has to be a point from 0 to 31".to_owned())
        );
        assert_eq!(read_words("actionStop now"), Err("it takes no argument, 1 given".to_owned()));
        assert_eq!(
            read_words("rewriteData 799 1 0"),
            Err("register is `799`, but has to be a register from 800 to 900".to_owned())
        );
    }
}
