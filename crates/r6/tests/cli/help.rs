//! The help of every subcommand, as snapshots. The tests also check the examples in the help.

use crate::support::r6;

/// Every subcommand, in the order of the help.
pub(crate) const SUBCOMMANDS: [&str; 29] = [
    "up",
    "sim",
    "discover",
    "status",
    "query",
    "watch",
    "command",
    "move",
    "move axes",
    "move line",
    "move curve",
    "run",
    "plot",
    "stop",
    "panel",
    "panel input",
    "panel jog",
    "gateway",
    "gateway token",
    "gateway user",
    "gateway verify",
    "alarms",
    "history",
    "audit",
    "whoami",
    "alarm",
    "inspect",
    "completions",
    "man",
];

#[test]
fn the_help_of_r6() {
    let help = r6(&["--help"]);
    assert_eq!(help.code, 0);
    insta::assert_snapshot!("help", help.out);
}

#[test]
fn the_help_of_every_subcommand() {
    for subcommand in SUBCOMMANDS {
        let args: Vec<_> = subcommand.split(' ').chain(["--help"]).collect();
        let help = r6(&args);
        assert_eq!(help.code, 0, "{subcommand}");
        assert!(help.out.contains("Examples:"), "{subcommand} has no examples");
        insta::assert_snapshot!(format!("help_{}", subcommand.replace(' ', "_")), help.out);
    }
}

#[test]
fn every_subcommand_is_in_the_list() {
    let help = r6(&["--help"]).out;
    let listed: Vec<_> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(listed.last(), Some(&"help"), "the help stands last");
    let listed = &listed[..listed.len() - 1];
    let top: Vec<_> = SUBCOMMANDS.into_iter().filter(|name| !name.contains(' ')).collect();
    assert_eq!(listed, top);
}

#[test]
fn help_is_a_command_too() {
    for subcommand in SUBCOMMANDS {
        let words: Vec<_> = subcommand.split(' ').collect();
        let asked = r6(&[&["help"], &words[..]].concat());
        let option = r6(&[&words[..], &["--help"]].concat());
        assert_eq!((asked.code, &asked.out), (0, &option.out), "{subcommand}");
    }
    assert_eq!(r6(&["help"]).out, r6(&["--help"]).out);
    assert_eq!(r6(&["help", "mvoe"]).code, 2);
}

#[test]
fn every_example_can_be_parsed() {
    for subcommand in SUBCOMMANDS {
        let args: Vec<_> = subcommand.split(' ').chain(["--help"]).collect();
        for line in r6(&args).out.lines().filter_map(|line| line.strip_prefix("  r6 ")) {
            // Text after two blanks is an explanation. A bar or an arrow begins text for the shell.
            let example =
                line.split("  ").next().unwrap_or_default().split(['|', '>', '<']).next().unwrap_or_default();
            let mut args: Vec<_> = example.split_whitespace().collect();
            if example.contains(".toml") && example.starts_with("sim") {
                continue;
            }
            // The parser accepts everything before the one unknown word.
            args.push("--no-such-option");
            let outcome = r6(&args);
            assert_eq!(outcome.code, 2, "{example}");
            assert!(
                outcome.err.contains("unexpected argument '--no-such-option'"),
                "{example}: {}",
                outcome.err
            );
        }
    }
}
