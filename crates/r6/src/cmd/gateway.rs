//! `r6 gateway`: every robot of a hall behind one door. Its subcommands work on its folder.

mod backup;
pub mod config;
mod place;
mod reread;
mod token;
pub mod twins;
mod user;
mod verify;

use std::collections::BTreeSet;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use r6_gateway::{
    At, Certificate, Database, Gateway, GatewaySettings, RawPort, RobotAddress, RobotConfig, RobotName,
    TlsSettings,
};

use crate::cmd::gateway::config::Config;
use crate::cmd::gateway::place::StoreUrl;
use crate::cmd::gateway::reread::{AtStart, Typed, reread};
use crate::cmd::gateway::twins::Twins;
use crate::exit::{Exit, Failure};
use crate::output;
use crate::robot;
use crate::signals::{Ending, Rereading};
use crate::units;

/// The default address of the gateway.
const DEFAULT_LISTEN: &str = "127.0.0.1:9780";

/// The default folder of the gateway.
const DEFAULT_DATA: &str = "r6-gateway";

/// The file in the folder with the URL of the gateway that runs, or ran last.
const URL_FILE: &str = "url";

/// Offer robots over HTTP: values, leases, commands, stops, an audit log
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "\
Everything needs a token or a user who signed in. `r6 gateway token` makes a token. The gateway prints a link \
that makes the first user, an admin; it works once and for an hour. Commands that change or move need the lease of \
the robot too. A stop needs no lease. docs/GATEWAY.md has the API.

Examples:
  r6 gateway --robot press-4=192.168.1.10
  r6 gateway --config hall.toml --data /var/lib/r6-gateway
  r6 gateway --robot virtual=127.0.0.1:9760 --listen 127.0.0.1:0
  r6 gateway --robot press-4=192.168.1.10 --raw press-4=127.0.0.1:9761
  r6 gateway --robot press-4=192.168.1.10 --listen 0.0.0.0:9780 --tls --host-name hall-pc.local
  r6 gateway --config hall.toml --twins         then press-4-twin is a virtual press-4

In hall.toml, for each robot:
  [[robot]]
  name = \"press-4\"
  address = \"192.168.1.10\"
  period_ms = 100                      how often its values are read
  read = [\"Addr-800\", \"counter-1\"]     values to read besides the usual ones
  parts = \"counter-1\"                  the counter of parts; the first counter that is read if it is missing
  model = \"BRTIRUS0707A\"               the model of its arm, for plans and its twin; `r6 plot --help` has all
  profile = \"hc1\"                      the profile of its firmware, for its twin; `r6 sim --help` has all
  [[robot.group]]                      values with a period of their own, as often as there are such
  period_ms = 10000
  read = [\"Addr-801\"]
  keep = false                         not in the history; or deadband = 0.5
  [robot.guard]                        limits of its lists, as in a file of `r6 run --guard`
  max_speed = 50                       percent, before the global speed

A robot that is set to client mode at its pendant connects to the gateway, at this port of this machine:
  address = \"listen:192.168.1.2:9770,from:192.168.1.31\"

What is kept of values, and for how long; it holds from the next start:
  [history]
  keep_days = 30                       today included
  keep_minutes_days = 90               averages of minutes, when the values are gone
  keep_hours_days = 1830               averages of hours
  max_mb = 10240                       all files together; the oldest values go first

How much of the audit log is kept; it holds from the next start:
  [audit]
  max_entries = 2000000                an entry takes about 0.4 KiB; the oldest go first

The time zone of the hall, and its shifts; over HTTP, an admin can change them only without these:
  [hall]
  time_zone = \"Europe/Berlin\"
  [[shift]]
  name = \"night\"
  days = [\"mon\", \"tue\", \"wed\"]        the days on which it begins
  begin = \"22:00\"
  end = \"06:00\"                        of the next day

How clients reach the gateway, as with --tls, --tls-cert and --host-name; it holds from the next start:
  [http]
  host_names = [\"hall-pc.local\"]
  tls = true                           or certificate = \"FILE\" and key = \"FILE\"

A raw port speaks the robots' own protocol, for old scripts. Without a rule, programs of this machine may \
read and stop over raw ports, and others nothing. In hall.toml, for each source; the first that fits decides:
  [[raw_rule]]
  source = \"192.168.1.20\"              an address, or a network such as 192.168.1.0/24
  allow = \"command\"                    read, command or deny; stops are part of read
  commands = [\"AddRCC\"]                of the commands that need the lease, only these
  programs = [\"press\"]                 of the taught programs, only these
  max_global_speed = 30                percent; a rule that has it lets nothing faster through
  max_speed = 50                       percent, of each move of a list
  max_path_speed = 250                 mm/s, of each move of a list
  cameras = [0]                        cameras whose photos it answers and whose points it sends

Then, in a second shell:
  r6 gateway token --role operator"
)]
pub struct GatewayArgs {
    #[command(subcommand)]
    subcommand: Option<Folder>,
    #[command(flatten)]
    serve: ServeArgs,
}

#[derive(Debug, Subcommand)]
enum Folder {
    Token(token::TokenArgs),
    User(user::UserArgs),
    Verify(verify::VerifyArgs),
    Backup(backup::BackupArgs),
    Restore(backup::RestoreArgs),
}

#[derive(Debug, Args)]
struct ServeArgs {
    /// Where to listen; port 0 takes any free port. Without --tls, other machines can see the tokens
    #[arg(long, value_name = "ADDR:PORT", default_value = DEFAULT_LISTEN, value_parser = units::listen_address)]
    listen: SocketAddr,
    /// Folder for tokens, users, leases, the audit log and the history
    #[arg(long, value_name = "DIR", default_value = DEFAULT_DATA)]
    data: PathBuf,
    /// Keep everything but the key of the audit log and certificates in this PostgreSQL database. Gateways
    /// with the same one share users, leases and the audit log; each robot is owned by one of them, and
    /// another takes over within 5 s
    #[arg(long, value_name = "URL", value_parser = StoreUrl::read, conflicts_with_all = ["raw", "twins"])]
    store: Option<StoreUrl>,
    /// A file with robots, TOML; SIGHUP makes the gateway read it again
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// A robot and its name, a to z, digits and -; may be given several times
    // The id is that of the global option, so that this one stands in its place.
    #[arg(id = "robot", short = 'r', long = "robot", value_name = "NAME=HOST[:PORT]")]
    robots: Vec<String>,
    /// Speak TLS, with a certificate that the gateway makes at its first start in DIR/tls
    #[arg(long)]
    tls: bool,
    /// Speak TLS with this certificate, PEM, and its issuers behind it; if the file changes, it is used
    #[arg(long, value_name = "FILE", requires = "tls_key", conflicts_with = "tls")]
    tls_cert: Option<PathBuf>,
    /// The private key of --tls-cert, PEM
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// A name by which clients reach this machine, besides localhost and its addresses; may be given several
    /// times
    #[arg(id = "host_name", long = "host-name", value_name = "NAME", value_parser = host_name)]
    host_names: Vec<String>,
    /// Let old scripts speak the robots' own protocol to this robot here; may be given several times. It has
    /// no login: see [[raw_rule]] below
    #[arg(long, value_name = "NAME=ADDR:PORT")]
    raw: Vec<String>,
    /// Start a virtual controller of its model and profile for each robot of the file and of the command
    /// line, to try programs on: robot NAME-twin, in this process
    #[arg(long)]
    twins: bool,
}

/// Runs the gateway until it is ended, or works on its folder.
///
/// `robot_typed`: whether --robot is on the command line. If not, its value is the default of the global
/// option.
pub fn run(args: GatewayArgs, robot_typed: bool) -> Result<Exit, Failure> {
    match args.subcommand {
        Some(Folder::Token(args)) => token::run(args, robot_typed),
        Some(Folder::User(args)) => user::run(args, robot_typed),
        Some(Folder::Verify(args)) => verify::run(&args),
        Some(Folder::Backup(args)) => backup::backup(&args),
        Some(Folder::Restore(args)) => backup::restore(&args),
        None => crate::cmd::block_on(serve(args.serve, robot_typed)),
    }
}

async fn serve(args: ServeArgs, robot_typed: bool) -> Result<Exit, Failure> {
    let typed = if robot_typed { args.robots.as_slice() } else { &[] };
    let Config { robots, profiles, mut raw, policy, hall, audit, history, http } =
        all(args.config.as_deref(), typed)?;
    let tls = match (args.tls_cert, args.tls_key) {
        (Some(certificate), Some(key)) => TlsSettings::Files { certificate, key },
        _ if args.tls => TlsSettings::Made,
        _ => http.tls.clone(),
    };
    let names = if args.host_names.is_empty() { http.host_names.clone() } else { args.host_names };
    let typed = Typed {
        robots: typed.to_vec(),
        raw: args.raw.iter().map(|text| raw_port(text)).collect::<Result<_, _>>()?,
    };
    raw.extend(typed.raw.iter().cloned());
    let at_start = AtStart { raw: raw.clone(), audit, history: history.clone(), http };
    let rules = policy.is_some();
    crate::limits::open_as_many_files_as_allowed();
    let mut ending = Ending::watch()?;
    let mut rereading = match &args.config {
        Some(path) => Some((path, Rereading::watch(&mut ending)?)),
        None => None,
    };
    let (listen, data) = (args.listen, args.data.clone());
    let at = place::at(args.store.as_ref(), &data)?;
    let store = match &at {
        At::Database(database) => Some(database.clone()),
        At::Folder(_) => None,
    };
    let raw_policy = policy.unwrap_or_default();
    let robot_settings = robot::settings();
    let mut beside = args.twins.then(|| Beside::new(listen, &raw));
    let (robots, prepared) = match &beside {
        Some(beside) => beside.twins.prepare(robots, &profiles, &beside.avoided).await?,
        None => (robots, twins::Prepared::default()),
    };
    let settings = GatewaySettings {
        listen,
        data,
        store: store.clone(),
        robots,
        robot_settings,
        raw,
        raw_policy,
        hall,
        audit,
        history,
        names,
        tls,
    };
    let gateway = Gateway::start(settings).await.map_err(Failure::usage)?;
    let lines = match &mut beside {
        Some(beside) => beside.twins.commit(prepared).await,
        None => Vec::new(),
    };
    keep_url(&gateway, &args.data);
    tell_start(&gateway, &args.data, beside.as_ref());
    if let Some(store) = &store {
        tell_store(&gateway, store);
    }
    tell_tokens(&args.data, at).await;
    tell_raw(&gateway, rules);
    lines.into_iter().for_each(output::line);
    tell_unknown_robots(&gateway);
    tell_link(&gateway).await;
    loop {
        let asked = async {
            match &mut rereading {
                Some((path, rereading)) => {
                    rereading.asked().await;
                    *path
                }
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            () = ending.signalled() => break,
            path = asked => reread(&gateway, path, &typed, &at_start, beside.as_mut()).await,
        }
    }
    let ended = gateway.shutdown().await.map_err(Failure::unknown);
    if let Some(beside) = beside {
        beside.twins.end().await;
    }
    ended.map(|()| Exit::Done)
}

/// The twins of the robots.
struct Beside {
    twins: Twins,
    /// Ports that the gateway itself listens on.
    avoided: BTreeSet<u16>,
}

impl Beside {
    fn new(listen: SocketAddr, raw: &[RawPort]) -> Self {
        let avoided = raw.iter().map(|port| port.listen.port()).chain([listen.port()]).collect();
        Self { twins: Twins::default(), avoided }
    }
}

/// The URL of a gateway on this machine. A gateway that listens on all addresses is also reached on this one.
fn url(gateway: &Gateway) -> String {
    let host = match gateway.address() {
        all if all.ip().is_unspecified() => SocketAddr::from((Ipv4Addr::LOCALHOST, all.port())),
        one => one,
    };
    let scheme = if gateway.certificate().is_some() { "https" } else { "http" };
    format!("{scheme}://{host}")
}

/// Keeps the URL in the folder, for the links that `r6 gateway user` prints.
fn keep_url(gateway: &Gateway, data: &Path) {
    if let Err(error) = std::fs::write(data.join(URL_FILE), format!("{}\n", url(gateway))) {
        output::note(format_args!(
            "r6: {}: {error}: links of `r6 gateway user` need --url",
            data.join(URL_FILE).display()
        ));
    }
}

/// Says that a folder of a gateway is not there yet, before a subcommand makes it: its name may be mistyped.
fn tell_new_folder(data: &Path) {
    if !data.exists() {
        output::note(format_args!(
            "r6: there was no folder {}: it is made now, for a gateway with this --data",
            data.display()
        ));
    }
}

/// How many robots there are, and twins of them.
fn counted(gateway: &Gateway, beside: Option<&Beside>) -> String {
    let twins = beside.map_or(0, |beside| beside.twins.count());
    let robots = output::counted(gateway.robots().saturating_sub(twins), "robot");
    match beside {
        Some(_) => format!("{robots}, {}", output::counted(twins, "twin")),
        None => robots,
    }
}

fn tell_start(gateway: &Gateway, data: &Path, beside: Option<&Beside>) {
    let (url, robots) = (gateway.address(), counted(gateway, beside));
    let scheme = if gateway.certificate().is_some() { "https" } else { "http" };
    output::line(format_args!("gateway on {scheme}://{url}, {robots}, data in {}", data.display()));
    match gateway.certificate() {
        Some(certificate) => tell_certificate(certificate),
        None if !gateway.address().ip().is_loopback() => {
            output::note(
                "r6: there is no TLS: everyone on the network can read the tokens; --tls speaks TLS",
            );
        }
        None => {}
    }
    if gateway.robots() == 0 {
        output::note(
            "r6: it has no robot yet: --robot press-4=192.168.1.10, --config FILE, or an admin adds one over HTTP",
        );
    }
}

/// Says how to make the first token.
async fn tell_tokens(data: &Path, at: At) {
    let store = match &at {
        At::Folder(_) => format!("--data {}", data.display()),
        At::Database(_) => "--store URL".to_owned(),
    };
    let listed = tokio::task::spawn_blocking(move || r6_gateway::list_tokens(at)).await;
    if listed.is_ok_and(|listed| listed.is_ok_and(|tokens| tokens.is_empty())) {
        output::note(format_args!(
            "r6: no program can use it yet: `r6 gateway token {store} --role operator` makes a token"
        ));
    }
}

/// Says where the store is, and how many of the robots this gateway owns.
fn tell_store(gateway: &Gateway, store: &Database) {
    let owned = gateway.owned().unwrap_or_default();
    let robots = output::counted(gateway.robots(), "robot");
    output::line(format_args!("store in {store}; this gateway owns {owned} of {robots} now"));
    if store.is_remote() {
        output::note(
            "r6: the gateway speaks no TLS with the database: everyone on the way to it can read along",
        );
    }
}

fn tell_certificate(certificate: &Certificate) {
    output::line(format_args!(
        "certificate in {}, SHA-256 {}",
        certificate.path().display(),
        certificate.fingerprint()
    ));
    let missing = certificate.missing_names();
    if !missing.is_empty() {
        output::note(format_args!(
            "r6: the certificate is not for {}: clients refuse it under this name. If the gateway made it, remove \
             the folder of the certificate and start anew; then clients have to trust the new one",
            missing.join(", ")
        ));
    }
}

fn tell_raw(gateway: &Gateway, rules: bool) {
    for RawPort { robot, listen } in gateway.raw_ports() {
        output::line(format_args!("raw port of {robot} on {listen}"));
    }
    if let Some(closed) = gateway.raw_ports_closed().filter(|_| !gateway.raw_ports().is_empty()) {
        output::note(format_args!(
            "r6: the raw ports are closed since {}, by {}: an admin opens them with PUT /v1/raw-ports",
            closed.at, closed.by
        ));
    }
    if !gateway.raw_ports().is_empty() && !rules {
        output::note(
            "r6: there is no [[raw_rule]]: over raw ports, programs of this machine may read and stop, and others nothing",
        );
    }
}

/// Says that a rule is for a robot that there is not: its name may be mistyped.
fn tell_unknown_robots(gateway: &Gateway) {
    let policy = gateway.raw_policy();
    let named = policy.rules().iter().filter_map(|rule| Some((rule, rule.robot.as_ref()?)));
    for (rule, robot) in named.filter(|(_, robot)| !gateway.has(robot)) {
        output::note(format_args!(
            "r6: the [[raw_rule]] of {} is for `{robot}`, and there is no such robot",
            rule.source
        ));
    }
}

async fn tell_link(gateway: &Gateway) {
    match gateway.setup_link().await {
        Ok(Some(link)) => {
            output::line(format_args!("to make the first admin, once and within an hour: {link}"))
        }
        Ok(None) => {}
        Err(error) => output::note(format_args!("r6: no link for a first admin: {error}")),
    }
}

/// What the file says, with the robots of the command line.
fn all(config: Option<&Path>, typed: &[String]) -> Result<Config, Failure> {
    let mut config = match config {
        Some(path) => config::read(path)?,
        None => Config::default(),
    };
    let robots = &mut config.robots;
    for text in typed {
        let robot = named(text)?;
        if robots.iter().any(|known| known.name == robot.name) {
            return Err(Failure::usage(format!("two robots are called `{}`", robot.name)));
        }
        robots.push(robot);
    }
    Ok(config)
}

/// A host name of the command line.
fn host_name(text: &str) -> Result<String, String> {
    config::host_name(text).ok_or_else(|| format!("it has to be {}", config::HOST_NAME))
}

/// A raw port of the command line.
fn raw_port(text: &str) -> Result<RawPort, Failure> {
    let wrong = |why: String| {
        Failure::usage(format!("--raw {text}: {why}")).advise("such as --raw press-4=127.0.0.1:9761")
    };
    let (name, listen) =
        text.split_once('=').ok_or_else(|| wrong("it has to be NAME=ADDR:PORT".to_owned()))?;
    let robot =
        RobotName::new(name).ok_or_else(|| wrong(format!("`{name}` is not {}", RobotName::WANTED)))?;
    let listen = units::listen_address(listen).map_err(wrong)?;
    Ok(RawPort { robot, listen })
}

/// A robot of the command line.
fn named(text: &str) -> Result<RobotConfig, Failure> {
    let wrong = |why: String| {
        Failure::usage(format!("--robot {text}: {why}")).advise("such as --robot press-4=192.168.1.10:9760")
    };
    let (name, address) =
        text.split_once('=').ok_or_else(|| wrong("it has to be NAME=HOST[:PORT]".to_owned()))?;
    let name = RobotName::new(name).ok_or_else(|| wrong(format!("`{name}` is not {}", RobotName::WANTED)))?;
    RobotAddress::read(address).map_err(wrong)?;
    Ok(RobotConfig { settings: robot::settings(), ..RobotConfig::new(name, address) })
}
