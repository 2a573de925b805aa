//! The gateway of `r6 up`: it lives as long as the cell, in a folder of its own, or in a folder that is kept.

use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use r6_api::gateway::Role;
use r6_gateway::{
    AuditSettings, DEFAULT_PORT, Gateway, GatewayError, GatewaySettings, Hall, HistorySettings, Panel,
    RawAllow, RawPolicy, RawPort, RawRule, RawSource, RobotConfig, RobotName, TlsSettings,
};
use r6_proto::Language;
use tempfile::TempDir;

use super::Place;
use crate::by_gateway;
use crate::exit::Failure;
use crate::output;
use crate::robot;

/// The name of the virtual robot in its gateway.
const ROBOT: &str = "virtual";

/// The port for socket scripts, if it is free and no other is asked for.
const RAW_PORT: u16 = DEFAULT_PORT + 1;

/// The file with the header that `curl -H @FILE` sends.
const TOKEN_FILE: &str = "token";

/// The virtual robots.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The robots, their twins included.
    pub robots: Vec<RobotConfig>,
    /// The robot of the raw port, if there is one.
    pub raw: Option<RobotName>,
    /// The time zone and the shifts, if the file of the hall has them.
    pub hall: Option<Hall>,
    /// What the token of this start may do.
    pub role: Role,
}

impl Cell {
    /// One robot, with its address, its panel if there is one on this machine, and the model of its arm if it
    /// is one of those with a name.
    pub fn of_one(robot: SocketAddr, panel: Option<Panel>, model: Option<String>) -> Result<Self, Failure> {
        let mut cell = Self { robots: Vec::new(), raw: None, hall: None, role: Role::Operator };
        cell.raw = Some(cell.add(ROBOT, robot, panel, model)?);
        Ok(cell)
    }

    /// Another robot. Returns its name.
    pub fn add(
        &mut self,
        name: &str,
        robot: SocketAddr,
        panel: Option<Panel>,
        model: Option<String>,
    ) -> Result<RobotName, Failure> {
        let name = RobotName::new(name).ok_or_else(|| Failure::usage(RobotName::WANTED))?;
        let usual = RobotConfig::new(name.clone(), robot.to_string());
        self.robots.push(RobotConfig { settings: robot::settings(), model, panel, ..usual });
        Ok(name)
    }

    /// What a line says of the robots. A hall counts its robots without their twins.
    fn text(&self, language: Language) -> String {
        let twins = self.robots.iter().filter(|robot| robot.twin_of.is_some()).count();
        match (self.robots.as_slice(), language) {
            ([only], Language::English) => format!("robot `{}`", only.name),
            ([only], Language::Chinese) => format!("机器人 `{}`", only.name),
            (all, Language::English) if twins == 0 => output::counted(all.len(), "robot"),
            (all, Language::Chinese) if twins == 0 => format!("{} 台机器人", all.len()),
            (all, Language::English) => {
                let robots = output::counted(all.len().saturating_sub(twins), "robot");
                format!("{robots}, {}", output::counted(twins, "twin"))
            }
            (all, Language::Chinese) => {
                format!("{} 台机器人，{twins} 台孪生机器人", all.len().saturating_sub(twins))
            }
        }
    }
}

/// The folder of the gateway.
#[derive(Debug)]
enum Folder {
    /// It goes at the end.
    Own(TempDir),
    /// It stays.
    Kept(PathBuf),
}

impl Folder {
    fn path(&self) -> &Path {
        match self {
            Self::Own(folder) => folder.path(),
            Self::Kept(path) => path,
        }
    }
}

/// A folder with a token of this start in it.
#[derive(Debug)]
struct Prepared {
    folder: Folder,
    /// Whether no gateway was there before.
    is_new: bool,
    /// The number of the token, and the token.
    number: i64,
    token: String,
}

/// A gateway before virtual robots.
#[derive(Debug)]
pub struct CellGateway {
    gateway: Gateway,
    prepared: Prepared,
    /// The secret of the link to the dashboard.
    secret: String,
    cell: Cell,
}

impl CellGateway {
    /// Starts the gateway of these robots. `usual_port`: without `--gateway` it takes its usual port if that
    /// is free, else any free port. `data`: its folder, if it is kept.
    pub async fn start(
        place: Option<Place>,
        cell: Cell,
        usual_port: bool,
        data: Option<&Path>,
    ) -> Result<Option<Self>, Failure> {
        // The gateway, and beside it the raw port.
        let here = |port: u16| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let [usual, any] = [(here(DEFAULT_PORT), here(RAW_PORT)), (here(0), here(0))];
        let places = match place {
            Some(Place::Off) => return Ok(None),
            Some(Place::At(address)) => vec![(address, here(0))],
            None if usual_port => vec![usual, any],
            None => vec![any],
        };
        let prepared = prepare(cell.role, data)?;
        let mut last = None;
        for (listen, raw) in places {
            match Gateway::start(settings(listen, raw, prepared.folder.path(), cell.clone())).await {
                Ok(gateway) => {
                    let secret = gateway.sign_in_secret(prepared.number).map_err(|error| {
                        Failure::usage(format!("the system has no random numbers: {error}"))
                    })?;
                    return Ok(Some(Self { gateway, prepared, secret, cell }));
                }
                Err(error @ GatewayError::Listen { .. }) => last = Some(error),
                Err(error) => return Err(Failure::usage(format!("the gateway does not start: {error}"))),
            }
        }
        let why = last.map_or_else(String::new, |error| error.to_string());
        Err(Failure::usage(format!("the gateway does not start: {}", why.replace("--listen", "--gateway"))))
    }

    /// The lines that name its address and that of the raw port.
    pub fn lines(&self, language: Language) -> Vec<String> {
        let address = self.gateway.address();
        let robots = self.cell.text(language);
        let gateway = match language {
            Language::English => format!("gateway on http://{address}, {robots}"),
            Language::Chinese => format!("网关地址 http://{address}，{robots}"),
        };
        let is_hall = self.cell.robots.len() > 1;
        let raw =
            self.gateway.raw_ports().iter().map(|RawPort { listen, robot }| match (language, is_hall) {
                (Language::English, false) => {
                    format!("raw port of the gateway, for socket scripts, on {listen}")
                }
                (Language::Chinese, false) => format!("网关的原始端口（供 socket 脚本使用）{listen}"),
                (Language::English, true) => format!("raw port of {robot}, for socket scripts, on {listen}"),
                (Language::Chinese, true) => format!("{robot} 的原始端口（供 socket 脚本使用）{listen}"),
            });
        let page = match language {
            Language::English => format!("dashboard, with its sign-in for this start, on {}", self.link()),
            Language::Chinese => format!("仪表板（附本次启动的登录）{}", self.link()),
        };
        [gateway].into_iter().chain(raw).chain([page]).collect()
    }

    /// The address of the dashboard. Behind the `#`, which browsers send to no server, is a secret that opens
    /// sessions until this ends. It is no token. In base64url the whole stands in one line of a terminal of
    /// 80 columns.
    pub fn link(&self) -> String {
        format!("http://{}/#{}", self.gateway.address(), short(&self.secret))
    }

    /// Whether no gateway was in its folder before: its library is empty.
    pub fn is_new(&self) -> bool {
        self.prepared.is_new
    }

    /// Stores a program in its library, over its own API.
    pub async fn store_program(&self, name: &str, text: &str) -> Result<(), Failure> {
        by_gateway::Gateway::here(self.gateway.address(), &self.prepared.token)
            .store_program(name, text)
            .await
    }

    /// What it says of its robots.
    pub fn robots_text(&self, language: Language) -> String {
        self.cell.text(language)
    }

    /// What an old script needs, in one line.
    pub fn raw_hint(&self) -> Option<String> {
        let RawPort { listen, robot } = self.gateway.raw_ports().first()?;
        let of = if self.cell.robots.len() > 1 { format!(" of {robot}") } else { String::new() };
        Some(format!("{listen} is the raw port{of}, for socket scripts"))
    }

    /// The command that lists all robots.
    pub fn robots_hint(&self) -> String {
        let token = self.prepared.folder.path().join(TOKEN_FILE);
        format!("r6 -g http://{} --token-file {} status", self.gateway.address(), token.display())
    }

    /// The command that follows J1 live.
    pub fn hint(&self) -> String {
        let token = self.prepared.folder.path().join(TOKEN_FILE);
        // Some shells read `?` as a pattern for file names.
        format!("curl -sN -H @{} '{}/v1/live?signal=axis-0'", token.display(), self.gateway.address())
    }

    /// Ends it. Removes its folder, or the token of this start from a folder that is kept.
    pub async fn end(self) -> Result<(), Failure> {
        self.gateway.shutdown().await.map_err(Failure::unknown)?;
        let at = self.prepared.folder.path().to_owned();
        match self.prepared.folder {
            Folder::Own(folder) => folder.close().map_err(|error| cannot("remove", &at, &error)),
            Folder::Kept(path) => {
                r6_gateway::revoke_token(path.as_path(), self.prepared.number).map_err(Failure::usage)?;
                let token = path.join(TOKEN_FILE);
                fs::remove_file(&token).map_err(|error| cannot("remove", &token, &error))
            }
        }
    }
}

/// Makes the folder, for its owner alone, and a token of this role in it. `data`: the folder, if it is kept.
fn prepare(role: Role, data: Option<&Path>) -> Result<Prepared, Failure> {
    let folder = match data {
        Some(path) => Folder::Kept(path.to_owned()),
        None => {
            let mut builder = tempfile::Builder::new();
            #[cfg(unix)]
            builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
            let made = builder.prefix("r6-up-").tempdir();
            Folder::Own(made.map_err(|error| cannot("make a folder in", &std::env::temp_dir(), &error))?)
        }
    };
    let is_new = r6_gateway::list_tokens(folder.path()).is_err();
    let (number, token) =
        r6_gateway::make_token(folder.path(), role, None, "r6 up".to_owned()).map_err(Failure::usage)?;
    let path = folder.path().join(TOKEN_FILE);
    // A start that was killed left its file.
    match fs::remove_file(&path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(cannot("remove", &path, &error)),
        Ok(()) | Err(_) => {}
    }
    write(&path, &format!("Authorization: Bearer {token}\n"))
        .map_err(|error| cannot("write", &path, &error))?;
    Ok(Prepared { folder, is_new, number, token })
}

/// The 256 bits of a secret as base64url: 43 characters in place of 64. A text that is no secret stays.
fn short(secret: &str) -> String {
    let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    let digits = secret.bytes().map(digit).collect();
    let Some(digits): Option<Vec<u8>> = digits else { return secret.to_owned() };
    let bytes = digits.chunks(2).map(|pair| pair.iter().fold(0, |byte, digit| byte << 4 | digit));
    URL_SAFE_NO_PAD.encode(bytes.collect::<Vec<u8>>())
}

/// Writes a new file. The folder keeps others out.
fn write(path: &PathBuf, text: &str) -> io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(path)?.write_all(text.as_bytes())
}

fn settings(listen: SocketAddr, raw: SocketAddr, data: &Path, cell: Cell) -> GatewaySettings {
    // The robots are virtual: programs of this machine may move them. Others cannot reach the raw port.
    let sources = ["127.0.0.0/8", "::1"].into_iter().filter_map(RawSource::parse);
    let rules = sources.map(|source| RawRule::new(source, RawAllow::Command)).collect();
    GatewaySettings {
        listen,
        data: data.to_owned(),
        store: None,
        robots: cell.robots,
        robot_settings: robot::settings(),
        raw: cell.raw.map(|robot| RawPort { robot, listen: raw }).into_iter().collect(),
        raw_policy: RawPolicy::new(rules),
        hall: cell.hall,
        audit: AuditSettings::default(),
        history: HistorySettings { max_bytes: 256 * 1024 * 1024, ..HistorySettings::default() },
        names: Vec::new(),
        // The folder is gone soon, and so is its token.
        tls: TlsSettings::Off,
    }
}

fn cannot(what: &str, path: &Path, error: &io::Error) -> Failure {
    Failure::usage(format!("cannot {what} {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The right side is what Python's `base64.urlsafe_b64encode(bytes.fromhex(…))` says, without `=`.
    #[test]
    fn a_secret_is_written_as_base64url() {
        assert_eq!(short("00ff10fbf0"), "AP8Q-_A");
        assert_eq!(short(""), "");
        assert_eq!(short(&"f".repeat(64)), "_".repeat(42) + "8");
        assert_eq!(short("xyz"), "xyz");
    }
}
