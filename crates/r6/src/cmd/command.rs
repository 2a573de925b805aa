//! `r6 command`: sends one command of the table.

mod arguments;
mod wording;

use clap::Args;
use r6_api::gateway::{CommandRequest, Lease};
use r6_client::Robot;
use r6_proto::message::command::{ArgumentInfo, COMMANDS, CommandInfo};
use r6_proto::{Address, Command, CommandName, Effect};

use crate::by_gateway::ByGateway;
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output::problem::Code;
use crate::output::{self, table::Table};
use crate::robot::RobotArgs;
use crate::waiting;
use crate::words::CommandWord;

/// Send one command, with its arguments in everyday units
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
The arguments are in the units of people and are converted: modifyGSPD 5 sends \"50\", which is 5 %. \
The answer tells both. An accepted command says nothing about what the machine does: look with `r6 status`.

startButton, actionSingleCycle, clearAlarmContinue and clearAlarmRunNext also start what is left in \
the instruction list. Where the firmware tells its length and something is left, they are not sent \
(exit code 1): `r6 stop` clears the list, --run-leftover sends them all the same.

Examples:
  r6 command --list                          every command with its arguments
  r6 command modifyGSPD 5                    global speed 5 %
  r6 command modifyOutput Y013 on            an output by its name on the pendant (octal), …
  r6 command modifyOutput 0 3 1              … or by board and point, counted from 0: the same
  r6 command rewriteData 800 -300000 0       register 800, not kept over a power cut
  r6 command modifyCounter 0 -1 20           target of counter 0; -1 keeps its count
  r6 command clearAlarm
  r6 command clearAlarm 1 1                  as the newest manual has it: to the first line, only the alarm"
)]
pub struct CommandArgs {
    /// Name of the command
    #[arg(required_unless_present = "list", value_parser = CommandWord, hide_possible_values = true)]
    name: Option<String>,
    /// Its arguments
    #[arg(value_name = "ARGUMENT", allow_negative_numbers = true)]
    arguments: Vec<String>,
    /// Send a command that starts the machine even if instructions are left in the list
    #[arg(long)]
    run_leftover: bool,
    /// Print the table of commands; no robot is asked
    #[arg(long, conflicts_with_all = ["name", "arguments"])]
    list: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Sends the command and prints the answer.
pub async fn run(args: CommandArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    let Some(command) = read(&args)? else {
        list(args.json);
        return Ok(Exit::Done);
    };
    let name = command.name();
    robot
        .ask(async |robot| {
            if name.starts() && !args.run_leftover {
                check_list(robot, name).await?;
            }
            let accepted = robot.command(command.clone()).await?;
            let milliseconds = output::readings::milliseconds(accepted.after);
            show_accepted(robot.address(), &command, milliseconds, args.json);
            Ok(Exit::Done)
        })
        .await
}

/// Sends the command through a gateway, with a lease of its own, and prints the answer.
pub async fn run_by_gateway(args: CommandArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    let Some(command) = read(&args)? else {
        list(args.json);
        return Ok(Exit::Done);
    };
    let robot = gateway.robot().await?;
    let request = CommandRequest {
        command: command.name().word().to_owned(),
        arguments: arguments::in_words(&command, &args.arguments),
        lease: None,
        run_leftover: args.run_leftover,
    };
    let waiting = format!("waiting for an answer of {}", robot.name());
    let done = waiting::told(&waiting, async {
        match command.name().effect() {
            Effect::Stops => robot.command(&request).await.map_err(|failure| match failure.code() {
                // Of a command that stops, the gateway says this only after the controller accepted it.
                Code::StoreUnavailable => accepted_and_not_confirmed(command.name(), robot.name()),
                _ => failure,
            }),
            Effect::Reads | Effect::Changes | Effect::Moves => {
                let with = async |lease: &Lease| {
                    let request = CommandRequest { lease: Some(lease.lease.clone()), ..request };
                    robot.command(&request).await
                };
                robot.with_lease(with).await
            }
        }
    });
    let done = done.await?;
    show_accepted(robot.name(), &command, done.after_ms, args.json);
    Ok(Exit::Done)
}

/// The failure of a command that stops, if the database of several gateways did not confirm that it holds.
fn accepted_and_not_confirmed(name: CommandName, robot: &str) -> Failure {
    Failure::unknown(format!(
        "{name} was accepted by {robot}, but the database has not confirmed that the stop holds: another gateway may \
         let the arm move again"
    ))
    .with_code(Code::StoreUnavailable)
    .advise(format!("use the emergency stop if the arm moves; `{}` stops again", hint::r6("stop")))
}

/// The command of the command line; `None` if none was given.
fn read(args: &CommandArgs) -> Result<Option<Command<'static>>, Failure> {
    let Some(word) = &args.name else { return Ok(None) };
    let name = named(word)?;
    let read = arguments::read(name, &args.arguments);
    read.map(Some).map_err(|problem| Failure::usage(format!("{name}: {problem}")).advise(usage(name.info())))
}

/// Prints that a robot accepted a command.
fn show_accepted(robot: &str, command: &Command<'_>, milliseconds: f64, json: bool) {
    output::acts();
    let name = command.name();
    let (means, wire) = (wording::words(command), wording::on_the_wire(command));
    if json {
        output::json(&r6_api::CommandAccepted {
            robot: robot.to_owned(),
            command: name.word().to_owned(),
            accepted: true,
            after_ms: milliseconds,
            means,
            on_the_wire: wire,
        });
        return;
    }
    let means = means.map(|means| format!(": {means}")).unwrap_or_default();
    let told = wording::is_scaled(command) || means.is_empty();
    let wire =
        if told && !wire.is_empty() { format!("; on the wire {}", quoted(&wire)) } else { String::new() };
    output::line(format_args!("{name} accepted after {milliseconds:.1} ms{means}{wire}"));
}

fn quoted(words: &[String]) -> String {
    let words: Vec<_> = words.iter().map(|word| format!("\"{word}\"")).collect();
    words.join(" ")
}

/// Refuses if instructions are left in the list. Passes if the firmware does not have `RemoteCmdLen`.
async fn check_list(robot: &Robot, name: CommandName) -> Result<(), Failure> {
    let read = robot.query(&[Address::RemoteCmdLen]).await?;
    let left = match read.left_in_list() {
        Ok(None | Some(0)) => return Ok(()),
        Ok(Some(1)) => "1 instruction is left in the list".to_owned(),
        Ok(Some(count)) => format!("{count} instructions are left in the list"),
        Err(error) => format!("what is left in the list cannot be read ({error})"),
    };
    Err(Failure::refused(format!("{name} was not sent: {left}, and the arm would run the list"))
        .with_code(Code::LeftoverList)
        .advise(format!("`{}` clears the list; --run-leftover runs it", hint::r6("stop"))))
}

fn named(word: &str) -> Result<CommandName, Failure> {
    CommandName::exact(word.as_bytes()).ok_or_else(|| {
        let advice = match CommandName::nearest(word) {
            Some(near) => format!("nearest: `{near}`; all of them: r6 command --list"),
            None => "all commands: r6 command --list".to_owned(),
        };
        Failure::usage(format!("there is no command `{word}`")).advise(advice)
    })
}

/// How to type a command, with the meaning of each argument.
fn usage(info: &CommandInfo) -> String {
    let meanings: Vec<_> =
        info.arguments.iter().map(|argument| format!("{}: {}", argument.name, argument.meaning)).collect();
    match meanings.is_empty() {
        true => format!("usage: r6 command {}", info.word),
        false => format!("usage: r6 command {} ({})", pattern(info), meanings.join("; ")),
    }
}

fn pattern(info: &CommandInfo) -> String {
    let mut pattern = info.word.to_owned();
    let (needed, optional): (Vec<&ArgumentInfo>, Vec<_>) =
        info.arguments.iter().partition(|argument| !argument.optional);
    for argument in needed {
        pattern.push(' ');
        pattern.push_str(&argument.name.to_uppercase());
    }
    if !optional.is_empty() {
        let names: Vec<_> = optional.iter().map(|argument| argument.name.to_uppercase()).collect();
        pattern.push_str(&format!(" [{}]", names.join(" ")));
    }
    if info.word == CommandName::RewriteDataList.word() {
        pattern.push('…');
    }
    if info.word == CommandName::ModifyOutput.word() {
        pattern.push_str(", or Y010 STATE");
    }
    pattern
}

fn list(json: bool) {
    if json {
        let rows: Vec<_> = COMMANDS
            .iter()
            .map(|row| {
                let arguments: Vec<_> = row
                    .arguments
                    .iter()
                    .map(|argument| {
                        let range = argument.kind.range();
                        serde_json::json!({
                            "name": argument.name, "meaning": argument.meaning, "optional": argument.optional,
                            "unit": argument.kind.unit(),
                            "lowest": range.map(|(lowest, _)| lowest), "highest": range.map(|(_, highest)| highest),
                        })
                    })
                    .collect();
                serde_json::json!({
                    "word": row.word, "arguments": arguments, "meaning": row.meaning, "effect": row.effect.word(),
                    "since": row.since,
                })
            })
            .collect();
        output::json_pretty(&rows);
        return;
    }
    let mut table = Table::new();
    for row in &COMMANDS {
        table.row([&pattern(row), &row.meaning]);
        for argument in row.arguments {
            table.row([&"", &format!("  {}: {}", argument.name, argument.meaning)]);
        }
    }
    output::line(table);
}
