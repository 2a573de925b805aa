//! The gateway of `r6 up`: it lives as long as the cell, in a folder of its own.

use std::fs::OpenOptions;
use std::io::{self, Write as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};

use r6_api::gateway::Role;
use r6_gateway::{DEFAULT_PORT, Gateway, GatewayError, GatewaySettings, RobotConfig, RobotName};
use r6_proto::Language;
use tempfile::TempDir;

use super::Place;
use crate::exit::Failure;
use crate::robot;

/// The name of the virtual robot in its gateway.
const ROBOT: &str = "virtual";

/// The file with the header that `curl -H @FILE` sends.
const TOKEN_FILE: &str = "token";

/// A gateway before one virtual robot. Its folder goes with it.
#[derive(Debug)]
pub struct CellGateway {
    gateway: Gateway,
    folder: TempDir,
}

impl CellGateway {
    /// Starts the gateway of the robot at this address. `usual_port`: without `--gateway` it takes its usual
    /// port if that is free, else any free port.
    pub async fn start(
        place: Option<Place>,
        robot: SocketAddr,
        usual_port: bool,
    ) -> Result<Option<Self>, Failure> {
        let [usual, any] = [DEFAULT_PORT, 0].map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
        let places = match place {
            Some(Place::Off) => return Ok(None),
            Some(Place::At(address)) => vec![address],
            None if usual_port => vec![usual, any],
            None => vec![any],
        };
        let folder = folder()?;
        let mut last = None;
        for listen in places {
            match Gateway::start(settings(listen, folder.path(), robot)?).await {
                Ok(gateway) => return Ok(Some(Self { gateway, folder })),
                Err(error @ GatewayError::Listen { .. }) => last = Some(error),
                Err(error) => return Err(Failure::usage(format!("the gateway does not start: {error}"))),
            }
        }
        let why = last.map_or_else(String::new, |error| error.to_string());
        Err(Failure::usage(format!("the gateway does not start: {}", why.replace("--listen", "--gateway"))))
    }

    /// The line that names its address.
    pub fn line(&self, language: Language) -> String {
        let address = self.gateway.address();
        match language {
            Language::English => format!("gateway on http://{address}, robot `{ROBOT}`"),
            Language::Chinese => format!("网关地址 http://{address}，机器人 `{ROBOT}`"),
        }
    }

    /// The command that follows J1 live.
    pub fn hint(&self) -> String {
        let token = self.folder.path().join(TOKEN_FILE);
        // Some shells read `?` as a pattern for file names.
        format!("curl -sN -H @{} '{}/v1/live?signal=axis-0'", token.display(), self.gateway.address())
    }

    /// Ends it and removes its folder.
    pub async fn end(self) -> Result<(), Failure> {
        self.gateway.shutdown().await.map_err(Failure::unknown)?;
        let at = self.folder.path().to_owned();
        self.folder.close().map_err(|error| cannot("remove", &at, &error))
    }
}

/// The folder, for its owner alone, with a token in it that may read, stop and command.
fn folder() -> Result<TempDir, Failure> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    let folder = builder
        .prefix("r6-up-")
        .tempdir()
        .map_err(|error| cannot("make a folder in", &std::env::temp_dir(), &error))?;
    let (_, token) = r6_gateway::make_token(folder.path(), Role::Operator, None, "r6 up".to_owned())
        .map_err(Failure::usage)?;
    let path = folder.path().join(TOKEN_FILE);
    write(&path, &format!("Authorization: Bearer {token}\n"))
        .map_err(|error| cannot("write", &path, &error))?;
    Ok(folder)
}

/// Writes a new file. The folder keeps others out.
fn write(path: &PathBuf, text: &str) -> io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(path)?.write_all(text.as_bytes())
}

fn settings(listen: SocketAddr, data: &Path, robot: SocketAddr) -> Result<GatewaySettings, Failure> {
    let name = RobotName::new(ROBOT).ok_or_else(|| Failure::usage(RobotName::WANTED))?;
    let config =
        RobotConfig { settings: robot::settings(), ..RobotConfig::new(name, reached(robot).to_string()) };
    Ok(GatewaySettings {
        listen,
        data: data.to_owned(),
        robots: vec![config],
        robot_settings: robot::settings(),
    })
}

/// Where a cell that listens here can be reached from this machine.
fn reached(listen: SocketAddr) -> SocketAddr {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, listen.port())
}

fn cannot(what: &str, path: &Path, error: &io::Error) -> Failure {
    Failure::usage(format!("cannot {what} {}: {error}", path.display()))
}
