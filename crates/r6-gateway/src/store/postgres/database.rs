//! Where the database is.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use tokio_postgres::Config;
use tokio_postgres::config::{Host, SslMode};

use super::password_file::{self, Wanted};

/// The port of a server, if the URL names none.
const PORT: u16 = 5432;

/// How long a connection may take.
const CONNECT: Duration = Duration::from_secs(2);

/// How long the server may leave bytes without an answer before the connection counts as lost.
const UNANSWERED: Duration = Duration::from_secs(3);

/// A PostgreSQL database that has the store of one gateway or more.
#[derive(Clone)]
pub struct Database {
    config: Box<Config>,
}

impl Database {
    /// The database of a URL, such as `postgres://r6@10.0.0.7/hall` or
    /// `postgres:///hall?host=/run/postgresql`.
    ///
    /// # Errors
    /// Why it names no database: for people. The password is not in it.
    pub fn parse(url: &str) -> Result<Self, String> {
        if !url.starts_with("postgres://") && !url.starts_with("postgresql://") {
            return Err("it has to begin with postgres://".to_owned());
        }
        // The parser's own words may repeat the password.
        let mut config = Config::from_str(url).map_err(|_| {
            "it has to be such as postgres://USER:PASSWORD@HOST/DATABASE or postgres:///DATABASE?host=/run/postgresql"
                .to_owned()
        })?;
        if config.get_ssl_mode() == SslMode::Require {
            return Err(
                "the gateway does not speak TLS with the database yet: leave out sslmode=require, and \
                        reach it over a network of its own"
                    .to_owned(),
            );
        }
        if config.get_dbname().is_none() {
            return Err("it has to name the database".to_owned());
        }
        if config.get_hosts().is_empty() && config.get_hostaddrs().is_empty() {
            config.host("localhost");
        }
        if config.get_user().is_none() {
            config.user("r6");
        }
        config.ssl_mode(SslMode::Disable);
        config.connect_timeout(CONNECT).tcp_user_timeout(UNANSWERED);
        config.application_name("r6-gateway");
        Ok(Self { config: Box::new(config) })
    }

    /// Whether the URL has a password.
    #[must_use]
    pub fn has_password(&self) -> bool {
        self.config.get_password().is_some()
    }

    /// The same with the password of a file that PostgreSQL's own programs read too (`PGPASSFILE`): that of
    /// the first server of the URL for which it has one. `None` without one.
    #[must_use]
    pub fn with_password_of(&self, file: &str) -> Option<Self> {
        let (user, database) = (self.config.get_user()?, self.config.get_dbname()?);
        let (names, addresses) = (self.config.get_hosts(), self.config.get_hostaddrs());
        let ports = self.config.get_ports();
        let hosts = names.iter().map(|host| match host {
            Host::Tcp(name) => (name.clone(), false),
            #[cfg(unix)]
            Host::Unix(path) => (path.display().to_string(), true),
        });
        let hosts: Vec<_> = match names {
            [] => addresses.iter().map(|address| (address.to_string(), false)).collect(),
            _ => hosts.collect(),
        };
        let password = hosts.iter().enumerate().find_map(|(at, (host, is_socket))| {
            // One port may be for all servers.
            let port = ports.get(at).or(ports.first()).copied().unwrap_or(PORT);
            password_file::find(file, Wanted { host, is_socket: *is_socket, port, database, user })
        })?;
        let mut with = self.clone();
        with.config.password(password);
        Some(with)
    }

    /// How the driver reaches it.
    pub(super) fn config(&self) -> &Config {
        &self.config
    }

    /// Whether the way to it leaves this machine: then others can read along, because there is no TLS.
    #[must_use]
    pub fn is_remote(&self) -> bool {
        let is_near = |host: &Host| match host {
            Host::Tcp(name) => {
                name == "localhost" || name.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback())
            }
            #[cfg(unix)]
            Host::Unix(_) => true,
        };
        !self.config.get_hosts().iter().all(is_near)
            || !self.config.get_hostaddrs().iter().all(std::net::IpAddr::is_loopback)
    }
}

/// Without the password.
impl fmt::Display for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hosts = self
            .config
            .get_hosts()
            .iter()
            .zip(self.config.get_ports().iter().map(Some).chain(std::iter::repeat(None)));
        let hosts: Vec<_> = hosts
            .map(|(host, port)| {
                let port = port.map(|port| format!(":{port}")).unwrap_or_default();
                match host {
                    Host::Tcp(name) => format!("{name}{port}"),
                    #[cfg(unix)]
                    Host::Unix(path) => format!("{}{port}", path.display()),
                }
            })
            .collect();
        let hosts = if hosts.is_empty() {
            self.config.get_hostaddrs().iter().map(ToString::to_string).collect()
        } else {
            hosts
        };
        write!(f, "postgres://{}/{}", hosts.join(","), self.config.get_dbname().unwrap_or_default())
    }
}

impl fmt::Debug for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_password_is_told_nowhere() {
        let database = Database::parse("postgres://r6:hush@10.0.0.7:5433/hall").unwrap();
        assert_eq!(database.to_string(), "postgres://10.0.0.7:5433/hall");
        assert!(database.is_remote() && !format!("{database:?}").contains("hush"));
        let near = Database::parse("postgres:///hall?host=/run/postgresql").unwrap();
        assert!(!near.is_remote(), "{near}");
        for wrong in [
            "hall",
            "postgres://r6:hush@10.0.0.7",
            "postgres://r6:hush@h:port/hall",
            "postgres://r6:hush@h/hall?sslmode=require",
        ] {
            let told = Database::parse(wrong).unwrap_err();
            assert!(!told.contains("hush"), "{told}");
        }
    }
}
