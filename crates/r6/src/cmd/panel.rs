//! `r6 panel`: simulates the operator of a virtual machine.

mod file;
mod http;

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use r6_api::gateway::{Lease, PanelRequest};
use r6_api::panel::{Action, Button, Key, Snapshot};
use r6_proto::io_point::{IoPoint, PointKind};
use r6_proto::{AxisIndex, printable};
use serde::Serialize;
use serde_json::Value;

use crate::by_gateway::ByGateway;
use crate::exit::{Exit, Failure};
use crate::hint::DEFAULT_PANEL;
use crate::output::problem::{self, Code};
use crate::output::{self, alarm, panel};
use crate::units;
use http::Panel;

/// Act as the operator of a virtual machine: inputs, buttons, emergency stop, moves by hand
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
It talks to the panel of `r6 up`, or of `r6 sim --panel ADDR:PORT`. A real machine has no such panel. \
Which panel is said by --panel or R6_PANEL, and not by --robot or R6_ROBOT. With --gateway-url, it is the panel \
of the virtual robot --robot at the gateway: it needs the role and, but for a stop, the lease.

Examples:
  r6 panel status
  r6 panel input X010 on                        as the pendant calls it; X1.010 is on board 1
  r6 panel button start
  r6 panel key manual
  r6 panel jog J1 +10 --speed 20                in manual
  r6 panel home                                 in manual
  r6 panel estop                                then: release, clear, button start
  r6 panel release
  r6 panel alarm 850
  r6 panel clear
  r6 panel program register-move
  r6 panel clear-points                         what cameras sent and no program took
  r6 panel fault silence --seconds 30           then: end-faults
  r6 panel load cell.toml                       then: program cell, button start
  r6 panel --panel 127.0.0.1:9771 --controller 2 status --json
  r6 -g http://127.0.0.1:9780 -r press-4-twin panel button start"
)]
pub struct PanelArgs {
    #[command(subcommand)]
    what: What,
    /// Where the panel is [default: 127.0.0.1:9770]
    #[arg(long, global = true, value_name = "URL", env = "R6_PANEL", hide_env_values = true)]
    panel: Option<String>,
    /// Which of its controllers, from 1
    #[arg(long, global = true, value_name = "N", default_value = "1")]
    controller: usize,
    /// Print the state as one JSON object, units in the names
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Show what an operator sees at the machine
    Status,
    /// Set an input
    #[command(after_help = "\
Examples:
  r6 panel input X010 on                        the first one
  r6 panel input X1.047 off                     the last one of board 1
  r6 panel input EUX010 on                      the first one of the EU board")]
    Input {
        /// Its name on the pendant: X010 to X047 (octal), X1.010 on board 1, EUX010
        #[arg(value_parser = input_name)]
        point: String,
        /// Its level from now on
        level: Level,
    },
    /// Press a button
    Button {
        /// Which
        button: ButtonWord,
    },
    /// Turn the mode key
    Key {
        /// To where
        position: KeyWord,
    },
    /// Press the emergency stop, which stays pressed
    Estop,
    /// Release the emergency stop; its alarm stays until it is cleared
    Release,
    /// Raise an alarm
    Alarm {
        /// Its number, 1 to 10000
        #[arg(value_parser = clap::value_parser!(u32).range(1..=10_000))]
        number: u32,
    },
    /// Clear the alarm; this starts nothing
    Clear,
    /// Move one axis by hand, in manual
    #[command(after_help = "\
It returns once the move has begun: `r6 panel status` shows it, `r6 panel button stop` ends it. At a soft \
limit it ends with the alarm of that limit.

Examples:
  r6 panel jog J1 +10
  r6 panel jog J6 -90 --speed 50")]
    Jog {
        /// J1 to J8
        #[arg(value_parser = axis_name)]
        axis: String,
        /// How far: degrees, or mm for a linear axis
        #[arg(allow_hyphen_values = true, value_parser = units::coordinate)]
        by: f64,
        /// Percent of the axis's full speed, times the global speed
        #[arg(long, value_name = "PERCENT", default_value = "10", value_parser = units::speed_percent)]
        speed: f64,
    },
    /// Move all axes to 0, where the machine is homed; in manual
    Home,
    /// Remove the points of cameras that no program has used yet
    ClearPoints,
    /// Give the controller a fault, as a scenario has it (docs/SCENARIOS.md)
    #[command(after_help = "\
`r6 panel status` shows the faults that are in force, each with its number.

Examples:
  r6 panel fault silence --seconds 30           connections that are made are never answered
  r6 panel fault bad-json --kind nul --chance 0.2
  r6 panel fault latency --set to_client=0.25")]
    Fault {
        /// Its word in a scenario, such as silence
        fault: String,
        /// Its kind, for a fault that has kinds
        #[arg(long)]
        kind: Option<String>,
        /// How likely it strikes each time it can, 0 to 1
        #[arg(long, default_value = "1", value_parser = chance)]
        chance: f64,
        /// After how many seconds it ends; without it, until it is ended
        #[arg(long)]
        seconds: Option<f64>,
        /// One of its numbers, several times
        #[arg(long, value_name = "NAME=NUMBER", value_parser = setting)]
        set: Vec<(String, f64)>,
    },
    /// End a fault that is in force
    EndFault {
        /// Its number
        number: usize,
    },
    /// End all faults that are in force
    EndFaults,
    /// Cut the power, which is back after a time
    PowerCut {
        /// For how many seconds, 0 to 3600
        #[arg(default_value = "10")]
        seconds: f64,
    },
    /// Choose another program
    Program {
        /// Its name
        name: String,
    },
    /// Load a program from a file; it replaces a program with the same name
    #[command(after_help = "\
The program is then there (`moldList`), and with `--state` it survives a restart; `r6 panel program` chooses it. A program that runs, or \
that the running program may call, is not replaced: stop it first.

Examples:
  r6 panel load cell.toml                       it is called `cell`
  r6 panel load cell.json --name cell-2")]
    Load {
        /// A .toml or .json file (docs/PROGRAMS.md)
        file: PathBuf,
        /// Its name, 1 to 64 bytes [default: the file's name without its extension]
        #[arg(long)]
        name: Option<String>,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Level {
    On,
    Off,
}

impl Level {
    fn word(self) -> &'static str {
        if self == Self::On { "on" } else { "off" }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ButtonWord {
    /// The program runs
    Start,
    /// The program ends with its cycle, at a second press at once; a move by hand ends
    Stop,
    /// The motion pauses; start continues it
    Pause,
    /// The program runs to the end of its pass
    SingleCycle,
    /// The program runs one step
    SingleStep,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum KeyWord {
    /// Moves by hand
    Manual,
    /// Programs, once start is pressed
    Auto,
    /// Neither
    Stop,
}

/// Sends the action to the panel, and prints what an operator then sees.
pub async fn run(args: PanelArgs) -> Result<Exit, Failure> {
    let panel = Panel::at(args.panel.as_deref().unwrap_or(DEFAULT_PANEL))?;
    let told = Told::of(&args);
    if args.panel.is_none() && !told.looks {
        is_of_the_named_robot(&panel, args.controller).await?;
    }
    let state = match args.what.wish()? {
        Wish::Look => panel.state(args.controller).await?,
        Wish::Act(action) => panel.act(args.controller, &action).await.inspect(|_| output::acts())?,
        Wish::Load { file, name, text } => panel
            .load(args.controller, &name, text)
            .await
            .inspect(|_| output::acts())
            .map_err(|failure| failure.while_doing(file.display()))?,
    };
    told.show(&state)
}

/// The same at the panel of a virtual robot behind a gateway. An action that does not stop takes the lease,
/// and gives it back.
pub async fn run_by_gateway(args: PanelArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    let told = Told::of(&args);
    let wish = args.what.wish()?;
    let robot = gateway.robot().await?;
    let action = match wish {
        Wish::Look => return told.show(&robot.panel().await?),
        Wish::Act(action) => action,
        Wish::Load { .. } => {
            return Err(Failure::usage("a program is not loaded over a gateway")
                .advise("`run` has the gateway run a program of motions"));
        }
    };
    let needs_no_lease = action.needs_no_lease();
    let request = PanelRequest { action, lease: None, run_leftover: false };
    let done = if needs_no_lease {
        robot.panel_action(&request).await
    } else {
        let with = async |lease: &Lease| {
            robot.panel_action(&PanelRequest { lease: Some(lease.lease.clone()), ..request }).await
        };
        robot.with_lease(with).await
    };
    let done = done.inspect(|_| output::acts())?;
    told.show(&done.panel)
}

/// How the answer is told.
struct Told {
    looks: bool,
    starts: bool,
    json: bool,
    input: Option<String>,
}

impl Told {
    fn of(args: &PanelArgs) -> Self {
        let input = match &args.what {
            What::Input { point, level } => Some(format!("{point} is {}; ", level.word())),
            _ => None,
        };
        let looks = matches!(args.what, What::Status);
        Self { looks, starts: args.what.starts(), json: args.json, input }
    }

    /// Prints what an operator then sees.
    fn show(self, state: &Snapshot) -> Result<Exit, Failure> {
        // The panel refuses a start while there is an alarm, so this alarm is new.
        let alarmed = (self.starts && state.alarm != 0).then(|| {
            let code = i64::from(state.alarm);
            Failure::refused(format!("the program ended at once with alarm {}", alarm::short(code)))
                .with_code(Code::Alarm)
                .advise(alarm::advice(code))
                .told()
        });
        if self.json {
            output::json_pretty(&Seen { state, problem: alarmed.as_ref().map(problem::object) });
        } else if self.looks {
            output::line(panel::text(state));
        } else {
            output::line(format!("{}{}", self.input.unwrap_or_default(), panel::summary(state)));
        }
        alarmed.map_or(Ok(Exit::Done), Err)
    }
}

/// Refuses to act at the default panel if `R6_ROBOT` names a robot on another port: the panel that answers
/// there may belong to another person's cell.
async fn is_of_the_named_robot(panel: &Panel, controller: usize) -> Result<(), Failure> {
    let Ok(robot) = std::env::var("R6_ROBOT") else { return Ok(()) };
    let found = panel.state(controller).await?.address;
    if port(&robot) == port(&found) { Ok(()) } else { Err(another(&robot, &found)) }
}

fn another(robot: &str, found: &str) -> Failure {
    Failure::usage(format!(
        "the panel at {DEFAULT_PANEL} is that of the controller at {}, and R6_ROBOT names {}; nothing was done",
        printable(found),
        printable(robot)
    ))
    .advise("name the panel that `r6 up` or `r6 sim` shows, with --panel ADDR:PORT or R6_PANEL")
}

/// The port of an address; the usual one if it has none.
fn port(address: &str) -> u16 {
    address.rsplit_once(':').and_then(|(_, port)| port.parse().ok()).unwrap_or(r6_client::DEFAULT_PORT)
}

/// The state of a machine, and the problem if there is one.
#[derive(Serialize)]
struct Seen<'s> {
    #[serde(flatten)]
    state: &'s Snapshot,
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<Value>,
}

/// Refuses `--robot`: it names a port of the protocol, not a panel. The default panel may belong to another
/// machine.
pub fn no_robot(robot: &str) -> Failure {
    Failure::usage(format!("--robot {robot} does not say which panel is meant; nothing was done")).advise(format!(
        "--panel ADDR:PORT says where the panel is (else R6_PANEL, or {DEFAULT_PANEL}), --controller N which of its machines"
    ))
}

/// What to ask of the panel.
enum Wish {
    Look,
    Act(Action),
    Load { file: PathBuf, name: String, text: String },
}

impl What {
    /// Whether a program runs after this.
    fn starts(&self) -> bool {
        match self {
            Self::Button { button } => match button {
                ButtonWord::Start | ButtonWord::SingleCycle | ButtonWord::SingleStep => true,
                ButtonWord::Stop | ButtonWord::Pause => false,
            },
            _ => false,
        }
    }

    fn wish(self) -> Result<Wish, Failure> {
        Ok(Wish::Act(match self {
            Self::Status => return Ok(Wish::Look),
            Self::Load { file, name } => return file::load(file, name),
            Self::Input { point, level } => Action::SetInput { point, on: level == Level::On },
            Self::Button { button } => Action::Press {
                button: match button {
                    ButtonWord::Start => Button::Start,
                    ButtonWord::Stop => Button::Stop,
                    ButtonWord::Pause => Button::Pause,
                    ButtonWord::SingleCycle => Button::SingleCycle,
                    ButtonWord::SingleStep => Button::SingleStep,
                },
            },
            Self::Key { position } => Action::TurnKey {
                key: match position {
                    KeyWord::Manual => Key::Manual,
                    KeyWord::Auto => Key::Auto,
                    KeyWord::Stop => Key::Stop,
                },
            },
            Self::Estop => Action::EmergencyStop {},
            Self::Release => Action::ReleaseEmergencyStop {},
            Self::Alarm { number } => Action::RaiseAlarm { alarm: number },
            Self::Clear => Action::ClearAlarm {},
            Self::Jog { axis, by, speed } => Action::Jog { axis, by, speed_percent: speed },
            Self::Home => Action::Home {},
            Self::ClearPoints => Action::ClearPoints {},
            Self::Fault { fault, kind, chance, seconds, set } => {
                Action::BeginFault { fault, kind, chance, seconds, numbers: set.into_iter().collect() }
            }
            Self::EndFault { number } => Action::EndFault { number },
            Self::EndFaults => Action::EndFaults {},
            Self::PowerCut { seconds } => Action::CutPower { seconds },
            Self::Program { name } => Action::SwitchProgram { program: name },
        }))
    }
}

/// Reads the name of an input, and returns it as it is sent.
fn input_name(text: &str) -> Result<String, String> {
    let point = text.parse::<IoPoint>().map_err(|error| error.to_string())?;
    match point.kind {
        PointKind::X | PointKind::Eux => Ok(point.to_string()),
        PointKind::Y | PointKind::M | PointKind::Euy => {
            Err("this is no input: inputs are X and EUX; `r6 command modifyOutput` sets Y and M".to_owned())
        }
    }
}

/// Reads a chance.
fn chance(text: &str) -> Result<f64, String> {
    let chance = text.parse::<f64>().ok().filter(|chance| (0.0..=1.0).contains(chance));
    chance.ok_or_else(|| "a chance is a number from 0 to 1".to_owned())
}

/// Reads a number of a fault with its name.
fn setting(text: &str) -> Result<(String, f64), String> {
    let wrong = || "write it as NAME=NUMBER, such as delay=0.5".to_owned();
    let (name, number) = text.split_once('=').ok_or_else(wrong)?;
    let number = number.parse::<f64>().ok().filter(|number| number.is_finite()).ok_or_else(wrong)?;
    Ok((name.to_owned(), number))
}

/// Reads the name of an axis, and returns it as it is sent.
fn axis_name(text: &str) -> Result<String, String> {
    let mut names = AxisIndex::ALL.iter().map(ToString::to_string);
    names.find(|name| name.eq_ignore_ascii_case(text)).ok_or_else(|| "there are J1 to J8".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_panel_of_another_robot_is_known_by_its_port() {
        assert_eq!((port("127.0.0.1:19760"), port("robot-4"), port("[::1]:9771")), (19_760, 9760, 9771));
        let refused = another("127.0.0.1:19760", "127.0.0.1:9760").to_string();
        assert!(refused.contains("R6_ROBOT names 127.0.0.1:19760; nothing was done"), "{refused}");
    }

    #[test]
    fn names_are_sent_as_the_pendant_writes_them() {
        assert_eq!(input_name("x010"), Ok("X010".to_owned()));
        assert_eq!(input_name("eux047"), Ok("EUX047".to_owned()));
        assert!(input_name("Y010").unwrap_err().contains("modifyOutput"));
        assert!(input_name("X10").unwrap_err().contains("X010"));
        assert_eq!(axis_name("j6"), Ok("J6".to_owned()));
        assert!(axis_name("J9").is_err());
        assert_eq!(setting("to_client=0.25"), Ok(("to_client".to_owned(), 0.25)));
        assert!(["delay", "delay=", "delay=x", "delay=inf"].iter().all(|text| setting(text).is_err()));
        assert_eq!((chance("0.5"), chance("1.5").is_err(), chance("NaN").is_err()), (Ok(0.5), true, true));
    }
}
