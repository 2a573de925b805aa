//! Robots that are reached by a gateway (`--gateway-url URL`): its requests, and what its answers mean for an
//! exit code.

mod lists;
mod robot;

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{AUTHORIZATION, CONTENT_TYPE, HOST};
use hyper::{Method, Request, StatusCode, Uri};
use r6_api::gateway::{ProgramWanted, RobotState, RobotSummary, Robots};
use r6_api::{Code, Problem};
use r6_gateway::DEFAULT_PORT;
use serde::Serialize;
use serde::de::DeserializeOwned;

pub use self::robot::GatewayRobot;
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::http_client::{HttpClient, Lost, in_path};
use crate::text_file;

/// How long an answer may take. A stop is answered within 20 s, and a query within 10 s.
const PATIENCE: Duration = Duration::from_secs(30);

/// How long to wait before a command is asked for again that got no answer: at first, doubled each time, and
/// at most. A gateway starts again within seconds.
const WAITS: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(2));

/// The longest answer: a thousand robots without their values have 800 bytes each.
const MAX_REPLY_BYTES: usize = 4 * 1024 * 1024;

/// A gateway takes 200 requests of a token at once, and then one each 10 ms. Other programs use the token
/// too.
const AT_ONCE: usize = 100;
const APART: Duration = Duration::from_millis(20);

/// The longest file with a token: a header of `curl -H @FILE` around 64 digits.
const MAX_TOKEN_FILE: usize = 1024;

/// The longest file with certificates: those of a company have some hundred kilobytes.
const MAX_CERTIFICATES: usize = 4 * 1024 * 1024;

/// The variable of the environment that may have the token.
const TOKEN: &str = "R6_TOKEN";

/// Whether a gateway is asked in place of a controller, and how.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Global options")]
pub struct ByGateway {
    /// Ask a gateway (`r6 gateway`) in place of the controller; --robot is then a name there
    #[arg(short = 'g', long = "gateway-url", id = "gateway_url", global = true, value_name = "URL")]
    url: Option<String>,
    /// The file with a token for --gateway-url; without it the token is in R6_TOKEN
    #[arg(long, global = true, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// The certificate (PEM) of the gateway or of its issuer, for https
    #[arg(long, global = true, value_name = "FILE")]
    ca_file: Option<PathBuf>,
    /// Send the token without TLS to another machine: everyone on the network can read it
    #[arg(long, global = true)]
    insecure_http: bool,
    /// The name of the robot that was typed.
    #[arg(skip)]
    robot: Option<String>,
}

impl ByGateway {
    /// The URL of the gateway; `None` if a controller is asked.
    pub fn url(&self) -> Option<&str> {
        self.url.as_deref()
    }

    /// For the robot that was typed; `None` where no name was.
    pub fn for_robot(self, name: Option<String>) -> Self {
        Self { robot: name, ..self }
    }

    /// Whether the name of a robot was typed.
    pub fn has_robot(&self) -> bool {
        self.robot.is_some()
    }

    /// The name of a robot that was typed.
    pub fn robot_name(&self) -> Option<&str> {
        self.robot.as_deref()
    }

    /// The options as they have to be typed again.
    pub fn options(&self) -> String {
        let Some(url) = &self.url else { return String::new() };
        let file = |option: &str, path: &Option<PathBuf>| {
            path.as_ref().map_or_else(String::new, |path| format!(" {option} {}", path.display()))
        };
        let insecure = if self.insecure_http { " --insecure-http" } else { "" };
        let (token, ca) = (file("--token-file", &self.token_file), file("--ca-file", &self.ca_file));
        format!(" --gateway-url {url}{token}{ca}{insecure}")
    }

    /// The gateway. Nothing is sent yet.
    pub fn gateway(&self) -> Result<Gateway, Failure> {
        let url = self.url.as_deref().unwrap_or_default();
        let wrong = || {
            Failure::usage(format!("--gateway-url: `{url}` is not the URL of a gateway"))
                .advise("write it as http://127.0.0.1:9780 or https://hall-pc.local:9780")
        };
        let uri: Uri = url.parse().map_err(|_| wrong())?;
        let host = uri.host().filter(|host| !host.is_empty()).ok_or_else(wrong)?;
        let is_plain = match uri.scheme_str() {
            Some("http") => true,
            Some("https") => false,
            Some(_) | None => return Err(wrong()),
        };
        let has_more = uri.path() != "/" || uri.query().is_some();
        if has_more || uri.authority().is_none_or(|authority| authority.as_str().contains('@')) {
            return Err(wrong());
        }
        if is_plain && !self.insecure_http && !is_this_machine(host) {
            return Err(Failure::usage(format!(
                "--gateway-url: everyone on the way to {host} could read the token"
            ))
            .advise("use https, or --insecure-http on a network that you trust"));
        }
        let port = match uri.port() {
            Some(port) => port.as_str().parse().map_err(|_| wrong())?,
            None => DEFAULT_PORT,
        };
        let http = HttpClient::new(format!("{host}:{port}"), PATIENCE, MAX_REPLY_BYTES);
        let http = if is_plain {
            http
        } else {
            let path = self.ca_file.as_ref().ok_or_else(|| {
                Failure::usage("--gateway-url: https needs --ca-file FILE").advise(
                    "the file is DATA/tls/certificate.pem of the gateway, or the certificate of the issuer of its own",
                )
            })?;
            let wrong = |why: String| Failure::usage(format!("--ca-file {}: {why}", path.display()));
            let trusted = text_file::read(path, "a certificate", MAX_CERTIFICATES).map_err(wrong)?;
            http.with_tls(host.trim_matches(['[', ']']), trusted.as_bytes()).map_err(wrong)?
        };
        let (source, token) = self.token()?;
        Ok(Gateway { http, token, source })
    }

    /// The robot that was typed, or the only robot of the gateway.
    pub async fn robot(&self) -> Result<GatewayRobot, Failure> {
        let gateway = self.gateway()?;
        let name = match &self.robot {
            Some(name) => name.clone(),
            None => {
                let mut robots = gateway.robots().await?.robots;
                match (robots.pop(), robots.is_empty()) {
                    (Some(only), true) => only.name,
                    (None, _) => {
                        return Err(Failure::usage("the gateway has no robot that this token may see"));
                    }
                    (Some(last), false) => {
                        robots.push(last);
                        let names: Vec<_> = robots.iter().map(|robot| robot.name.as_str()).collect();
                        return Err(Failure::usage("the gateway has several robots: name one with --robot")
                            .advise(shortened(&names)));
                    }
                }
            }
        };
        Ok(GatewayRobot { gateway, name })
    }

    /// Where the token comes from, and the token.
    fn token(&self) -> Result<(String, String), Failure> {
        let (source, text) = match &self.token_file {
            Some(path) => {
                let source = format!("--token-file {}", path.display());
                let text = text_file::read(path, "a token", MAX_TOKEN_FILE);
                (source.clone(), text.map_err(|why| Failure::usage(format!("{source}: {why}")))?)
            }
            None => {
                let text = std::env::var(TOKEN).map_err(|_| {
                    Failure::usage("--gateway-url needs a token").advise(format!(
                        "`r6 gateway token --data DIR --role operator` makes one: keep it in a file for --token-file, or in {TOKEN}"
                    ))
                })?;
                (TOKEN.to_owned(), text)
            }
        };
        // Also as `curl -H @FILE` reads it.
        let text = text.trim();
        let token = text.strip_prefix("Authorization: Bearer ").unwrap_or(text);
        if token.is_empty() || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(Failure::usage(format!("{source} has no token in it")));
        }
        Ok((source, token.to_owned()))
    }
}

/// The first names, and how many more there are.
pub fn shortened(names: &[&str]) -> String {
    const SHOWN: usize = 8;
    let shown = names.get(..SHOWN).unwrap_or(names).join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

fn is_this_machine(host: &str) -> bool {
    let address = host.trim_matches(['[', ']']).parse::<IpAddr>();
    host == "localhost" || address.is_ok_and(|address| address.is_loopback())
}

/// A robot in a list of all robots.
pub struct ListedRobot {
    /// What is known of it.
    pub state: RobotState,
    /// Why its owner did not tell: several gateways share a store, and none owns it, or its owner is away.
    pub no_owner: Option<Failure>,
}

/// A gateway, and the token for it.
pub struct Gateway {
    http: HttpClient,
    token: String,
    /// The option or variable that the token comes from.
    source: String,
}

impl Gateway {
    /// A gateway of this process, without TLS.
    pub fn here(address: SocketAddr, token: &str) -> Self {
        let http = HttpClient::new(address.to_string(), PATIENCE, MAX_REPLY_BYTES);
        Self { http, token: token.to_owned(), source: "this start".to_owned() }
    }

    /// Stores a program under a name that is new. It is sent once.
    pub async fn store_program(&self, name: &str, text: &str) -> Result<(), Failure> {
        let wanted = ProgramWanted { program: text.to_owned() };
        let path = format!("/v1/programs/{}", in_path(name));
        self.ask(Method::PUT, &path, None, &wanted, Exit::Unknown).await.map(drop)
    }

    /// Host and port.
    pub fn authority(&self) -> &str {
        self.http.authority()
    }

    /// All robots that the token may see.
    pub async fn robots(&self) -> Result<Robots, Failure> {
        self.read("/v1/robots").await
    }

    /// The states of these robots. A robot that was removed meanwhile is left out. Of a robot that no gateway
    /// owns at the moment, or whose owner does not answer, there is the list's word and no value.
    ///
    /// They are read one after another: the gateway has no request for the values of all robots.
    pub async fn states(
        &self,
        robots: impl Iterator<Item = &RobotSummary>,
    ) -> Result<Vec<ListedRobot>, Failure> {
        let mut states = Vec::new();
        for (number, robot) in robots.enumerate() {
            if number >= AT_ONCE {
                tokio::time::sleep(APART).await;
            }
            let path = format!("/v1/robots/{}", in_path(&robot.name));
            match self.read(&path).await {
                Ok(state) => states.push(ListedRobot { state, no_owner: None }),
                Err(failure) if failure.code() == Code::NoSuchRobot => {}
                Err(failure) if failure.code() == Code::NoOwner => {
                    let summary = robot.clone();
                    let (groups, signals) = (Vec::new(), Vec::new());
                    let state = RobotState { summary, period_ms: 0, groups, epoch: 0, number: 0, signals };
                    states.push(ListedRobot { state, no_owner: Some(failure) });
                }
                Err(failure) => return Err(failure),
            }
        }
        Ok(states)
    }

    async fn read<T: DeserializeOwned>(&self, path: &str) -> Result<T, Failure> {
        let body = self.ask(Method::GET, path, None, &(), Exit::NoReply).await?;
        serde_json::from_slice(&body).map_err(|error| self.unclear(path, &error.to_string(), Exit::NoReply))
    }

    /// Sends one request, and returns the body of a good answer. `key`: its `Idempotency-Key`. `lost`: how
    /// the run ends without an answer.
    async fn ask(
        &self,
        method: Method,
        path: &str,
        key: Option<&str>,
        body: &impl Serialize,
        lost: Exit,
    ) -> Result<Bytes, Failure> {
        let answer = self.send(method, path, key, body).await?;
        self.read_answer(path, answer, lost)
    }

    /// Posts a request that the gateway carries out once. While no answer comes, it is asked again with the
    /// same key, within [`PATIENCE`] after the first one.
    ///
    /// After a lost answer, a refusal is no proof that nothing was sent: the first request may still be on
    /// its way. The outcome is unknown then.
    async fn ask_once(&self, path: &str, body: &impl Serialize) -> Result<Bytes, Failure> {
        let (key, end) = (new_key()?, tokio::time::Instant::now() + PATIENCE);
        let (mut lost, mut wait) = (None, WAITS.0);
        loop {
            let send = tokio::time::timeout_at(end, self.send(Method::POST, path, Some(&key), body));
            let answer = match send.await {
                Ok(answer) => answer?,
                Err(_) => Err(Lost::NoReply("there was no answer in time".to_owned())),
            };
            let code = match &answer {
                Ok((_, body)) => serde_json::from_slice::<Problem>(body).ok().map(|problem| problem.code),
                Err(_) => None,
            };
            let is_good = matches!(&answer, Ok((status, _)) if status.is_success());
            // Then the gateway knows the key.
            let settles = is_good || matches!(code, Some(Code::Refused | Code::OutcomeUnknown));
            let can_pass =
                answer.is_err() || matches!(code, Some(Code::InProgress | Code::Overloaded | Code::NoOwner));
            let failure = match (lost.take(), answer) {
                (None, Err(Lost::NoReply(why))) => self.unclear(path, &why, Exit::Unknown),
                (Some(failure), _) if !settles => failure,
                (_, answer) => return self.read_answer(path, answer, Exit::Unknown),
            };
            if !can_pass || tokio::time::Instant::now() + wait >= end {
                return Err(failure);
            }
            lost = Some(failure);
            tokio::time::sleep(wait).await;
            wait = WAITS.1.min(2 * wait);
        }
    }

    /// Sends one request: its status and its body.
    async fn send(
        &self,
        method: Method,
        path: &str,
        key: Option<&str>,
        body: &impl Serialize,
    ) -> Result<Result<(StatusCode, Bytes), Lost>, Failure> {
        let is_read = method == Method::GET;
        let body = if is_read { Vec::new() } else { serde_json::to_vec(body).unwrap_or_default() };
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header(HOST, self.authority())
            .header(AUTHORIZATION, format!("Bearer {}", self.token))
            .header(CONTENT_TYPE, "application/json");
        let request = match key {
            Some(key) => request.header("Idempotency-Key", key),
            None => request,
        };
        let request = request
            .body(Full::new(Bytes::from(body)))
            .map_err(|error| Failure::usage(format!("no such request: {error}")))?;
        Ok(self.http.ask(request).await)
    }

    /// The body of a good answer. `lost`: how the run ends without an answer.
    fn read_answer(
        &self,
        path: &str,
        answer: Result<(StatusCode, Bytes), Lost>,
        lost: Exit,
    ) -> Result<Bytes, Failure> {
        match answer {
            Ok((status, body)) if status.is_success() => Ok(body),
            Ok((status, body)) => Err(match serde_json::from_slice::<Problem>(&body) {
                Ok(_) if status == StatusCode::UNAUTHORIZED => self.unknown_token(),
                Ok(problem) => failure(status, problem, lost),
                Err(_) => self.unclear(path, &format!("status {status}, and no problem of a gateway"), lost),
            }),
            Err(Lost::NotConnected(why)) => {
                Err(Failure::no_reply(format!("no gateway at {}: {why}", self.authority()))
                    .with_code(Code::Unreachable)
                    .advise("`r6 gateway` says where it listens when it starts"))
            }
            Err(Lost::NoReply(why)) => Err(self.unclear(path, &why, lost)),
        }
    }

    /// The failure for a token that the gateway does not know.
    fn unknown_token(&self) -> Failure {
        let (authority, source) = (self.authority(), &self.source);
        let what = format!("the gateway at {authority} does not know the token of {source}");
        Failure::usage(what).with_code(Code::NoToken).advise(
            "it was revoked, it has ended, or it is of another gateway or store: `r6 gateway token --data DIR --list` shows those of a \
             folder (with --store URL those of a database), and `r6 gateway token --data DIR --role operator` makes one",
        )
    }

    /// The failure for an answer that is missing or cannot be read.
    fn unclear(&self, path: &str, why: &str, lost: Exit) -> Failure {
        let what = format!("{} gave no answer to {path} that can be read: {why}", self.authority());
        match lost {
            Exit::Unknown => {
                Failure::unknown(what).advise("it may have acted: look at the machine before going on")
            }
            lost => Failure::no_reply(what).with_exit(lost),
        }
    }
}

/// An `Idempotency-Key` that nothing else has.
fn new_key() -> Result<String, Failure> {
    let mut key = [0; 16];
    getrandom::fill(&mut key)
        .map_err(|error| Failure::usage(format!("the system gives no random numbers: {error}")))?;
    Ok(key.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// What a problem of the gateway means for the run. `lost`: how the run ends if the gateway failed itself.
fn failure(status: StatusCode, problem: Problem, lost: Exit) -> Failure {
    let Problem { code, message, .. } = problem;
    let failure = match (code, status.as_u16()) {
        (Code::OutcomeUnknown | Code::NotStopped, _) => Failure::unknown(message),
        (Code::NoReply | Code::NoConnection | Code::Unreachable, _) => Failure::no_reply(message),
        (Code::NoOwner, _) => Failure::no_reply(message)
            .advise("ask again: another gateway takes the robot within seconds, if one can"),
        (Code::Stopped, _) => {
            Failure::refused(message).advise(format!("`{}` clears the stop", hint::r6("stop --clear")))
        }
        (Code::NotAllowed, _) => {
            Failure::refused(message).advise(format!("`{}` says what this token may do", hint::r6("whoami")))
        }
        // A guard refused it, as in a run without a gateway: the file is not wrong.
        (Code::BeyondLimits, _) => Failure::refused(message),
        // What the caller may not do, and what cannot be done now: nothing was sent.
        (_, 403 | 409 | 412 | 423 | 429 | 503) => Failure::refused(message),
        (_, 500..) => Failure::unknown(message).with_exit(lost),
        _ => Failure::usage(message),
    };
    failure.with_code(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn by(url: &str) -> ByGateway {
        ByGateway { url: Some(url.to_owned()), token_file: Some("/no/token".into()), ..ByGateway::default() }
    }

    fn refused(by: &ByGateway) -> String {
        by.gateway().err().map(|failure| failure.to_string()).unwrap_or_default()
    }

    #[test]
    fn a_url_that_is_wrong_or_would_show_the_token_is_refused_before_anything_is_sent() {
        for wrong in [
            "",
            "hall-pc",
            "ftp://hall-pc",
            "http://",
            "http://a/v1",
            "http://me@127.0.0.1",
            "127.0.0.1:9780",
        ] {
            assert!(
                refused(&by(wrong)).contains("is not the URL of a gateway"),
                "{wrong}: {}",
                refused(&by(wrong))
            );
        }
        assert!(refused(&by("http://hall-pc.local:9780")).contains("could read the token"));
        assert!(refused(&by("https://hall-pc.local")).contains("needs --ca-file"));
        for here in ["http://127.0.0.1:9780", "http://localhost", "http://[::1]:9780"] {
            assert!(refused(&by(here)).contains("--token-file /no/token: the file cannot be read"), "{here}");
        }
        let insecure = ByGateway { insecure_http: true, ..by("http://hall-pc.local:9780") };
        assert!(refused(&insecure).contains("/no/token"));
    }

    #[test]
    fn a_problem_tells_whether_something_may_have_acted() {
        let exit = |status: u16, code: Code| {
            let status = StatusCode::from_u16(status).unwrap();
            failure(status, Problem::new(code, "no"), Exit::Unknown).exit()
        };
        assert_eq!(exit(504, Code::OutcomeUnknown), Exit::Unknown);
        assert_eq!(exit(422, Code::BeyondLimits), Exit::Refused);
        assert_eq!(exit(422, Code::BadProgram), Exit::Usage);
        assert_eq!(exit(504, Code::NotStopped), Exit::Unknown);
        assert_eq!(exit(504, Code::NoReply), Exit::NoReply);
        assert_eq!(exit(503, Code::Unreachable), Exit::NoReply);
        assert_eq!(exit(503, Code::NoOwner), Exit::NoReply);
        assert_eq!(exit(503, Code::StoreUnavailable), Exit::Refused);
        assert_eq!(exit(409, Code::Leased), Exit::Refused);
        assert_eq!(exit(403, Code::NotAllowed), Exit::Refused);
        assert_eq!(exit(401, Code::NoToken), Exit::Usage);
        assert_eq!(exit(404, Code::NoSuchRobot), Exit::Usage);
        assert_eq!(exit(422, Code::BadCommand), Exit::Usage);
        assert_eq!(exit(500, Code::Unknown), Exit::Unknown);
    }
}
