//! One robot of a gateway.

use std::time::Instant;

use hyper::Method;
use r6_api::Code;
use r6_api::gateway::{
    AcknowledgeRequest, CommandDone, CommandRequest, History, Lease, LeaseKey, LeaseRequest, PanelDone,
    PanelRequest, Queried, RobotAlarm, RobotAlarms, RobotState, Run, RunRequest, Stopped, WithLease,
};
use r6_api::panel::Snapshot;
use r6_proto::{Address, printable};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::lists::MOST_ALARMS;
use super::{Gateway, new_key};
use crate::exit::{Exit, Failure};
use crate::http_client::in_path;
use crate::output::readings::Readings;

/// A robot behind a gateway.
pub struct GatewayRobot {
    pub(super) gateway: Gateway,
    pub(super) name: String,
}

impl GatewayRobot {
    /// Its name at the gateway.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its gateway.
    pub fn gateway(&self) -> &Gateway {
        &self.gateway
    }

    fn path(&self, what: &str) -> String {
        format!("/v1/robots/{}{what}", in_path(&self.name))
    }

    /// What the gateway knows of it, with the values that it reads.
    pub async fn state(&self) -> Result<RobotState, Failure> {
        self.gateway.read(&self.path("")).await
    }

    /// Has the gateway read these values now.
    pub async fn query(&self, addresses: &[Address]) -> Result<Readings, Failure> {
        let words: Vec<_> = addresses.iter().map(ToString::to_string).collect();
        let path = self.path(&format!("/query?address={}", in_path(&words.join(","))));
        let begun = Instant::now();
        let told: Result<Queried, _> = self.gateway.read(&path).await;
        // As without a gateway: a robot that cannot be reached is no reply.
        let told = told.map_err(|failure| match failure.code() {
            Code::NotReady => failure.with_exit(Exit::NoReply),
            _ => failure,
        })?;
        let value = |address: &Address| {
            let word = address.to_string();
            let signal = told.signals.iter().find(|signal| signal.address == word);
            let problem = || told.problems.iter().find(|problem| problem.address == word);
            signal.and_then(|signal| signal.value.clone()).ok_or_else(|| match problem() {
                Some(problem) => printable(&problem.reason).to_string(),
                None => "the gateway says nothing of it".to_owned(),
            })
        };
        let rows = addresses.iter().map(|address| (*address, value(address))).collect();
        Ok(Readings::of_gateway(rows, begun.elapsed()))
    }

    /// Sends a command that needs no lease, or with the lease of the caller. It reaches the robot once, also
    /// if no answer comes and the gateway is asked again.
    pub async fn command(&self, request: &CommandRequest) -> Result<CommandDone, Failure> {
        let path = self.path("/commands");
        let answer = self.gateway.ask_once(&path, request).await?;
        serde_json::from_slice(&answer)
            .map_err(|error| self.gateway.unclear(&path, &error.to_string(), Exit::Unknown))
    }

    /// What a person sees at the panel of a virtual robot.
    pub async fn panel(&self) -> Result<Snapshot, Failure> {
        self.gateway.read(&self.path("/panel")).await
    }

    /// Does something at the panel of a virtual robot. It is sent once.
    pub async fn panel_action(&self, request: &PanelRequest) -> Result<PanelDone, Failure> {
        self.post("/panel", request).await
    }

    /// Stops the robot; the answer comes when the arm is proved to stand.
    pub async fn stop(&self) -> Result<Stopped, Failure> {
        self.post("/stop", &serde_json::Map::new()).await
    }

    /// Takes the lease that is free, does the work with it, and gives it back.
    pub async fn with_lease<T>(
        &self,
        work: impl AsyncFnOnce(&Lease) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let lease = self.acquire().await?;
        let done = work(&lease).await;
        // It ends by itself within 10 s if this fails.
        let _ = self.release(&lease.lease).await;
        done
    }

    /// Takes the lease that is free. If that fails, nothing has left for the robot, whatever became of the
    /// lease.
    pub async fn acquire(&self) -> Result<Lease, Failure> {
        let taken = self.ask("/lease", None, &LeaseRequest::default(), Exit::NoReply).await;
        taken.map_err(|failure| {
            let failure = match failure.exit() {
                Exit::Unknown => failure.with_exit(Exit::NoReply).with_code(Code::NoReply),
                Exit::Done | Exit::Refused | Exit::Usage | Exit::NoReply => failure,
            };
            match failure.code() {
                Code::NoReply => failure
                    .lead("nothing was sent to the robot")
                    .advise("the lease may have been taken: then it ends within 10 s. Try again"),
                _ => failure,
            }
        })
    }

    /// Gives the lease back.
    pub async fn release(&self, lease: &LeaseKey) -> Result<(), Failure> {
        let with = WithLease { lease: lease.clone() };
        let path = self.path("/lease");
        self.gateway.ask(Method::DELETE, &path, None, &with, Exit::Unknown).await.map(drop)
    }

    /// Renews the lease.
    pub async fn renew(&self, lease: &LeaseKey) -> Result<Lease, Failure> {
        self.post("/lease", &LeaseRequest { renew: Some(lease.clone()), ..LeaseRequest::default() }).await
    }

    /// Runs a program. The answer comes once the controller accepted the first list. The request is sent
    /// once.
    pub async fn run(&self, request: &RunRequest) -> Result<Run, Failure> {
        self.ask("/programs/run", Some(&new_key()?), request, Exit::Unknown).await
    }

    /// A run as it stands.
    pub async fn run_of(&self, id: u64) -> Result<Run, Failure> {
        self.gateway.read(&self.path(&format!("/runs/{id}"))).await
    }

    /// Its alarms. `active`: without those that have ended.
    pub async fn alarms(&self, active: bool) -> Result<RobotAlarms, Failure> {
        self.gateway.read(&self.path(&format!("/alarms?active={active}&limit={MOST_ALARMS}"))).await
    }

    /// Says that somebody saw an alarm. The first to say so stays, so it does no harm twice.
    pub async fn acknowledge(&self, id: u64, comment: Option<String>) -> Result<RobotAlarm, Failure> {
        let request = AcknowledgeRequest { comment };
        self.ask(&format!("/alarms/{id}/acknowledge"), None, &request, Exit::NoReply).await
    }

    /// A page of the history of a value. `asked`: the parameters of the query.
    pub async fn history(&self, asked: &[(&str, &str)]) -> Result<History, Failure> {
        let asked: Vec<_> = asked.iter().map(|(name, value)| format!("{name}={}", in_path(value))).collect();
        self.gateway.read(&self.path(&format!("/history?{}", asked.join("&")))).await
    }

    /// The failure for a page that leads back to itself.
    pub fn leads_back(&self) -> Failure {
        self.gateway.unclear(&self.path("/history"), "a page that leads back to itself", Exit::NoReply)
    }

    /// Lets the robot move again after a stop.
    pub async fn clear_stopped(&self, lease: &LeaseKey) -> Result<(), Failure> {
        let with = WithLease { lease: lease.clone() };
        self.gateway
            .ask(Method::POST, &self.path("/clear-stopped"), None, &with, Exit::Unknown)
            .await
            .map(drop)
    }

    async fn post<T: DeserializeOwned>(&self, what: &str, body: &impl Serialize) -> Result<T, Failure> {
        self.ask(what, None, body, Exit::Unknown).await
    }

    /// Posts a request. `lost`: how the run ends if no clear answer comes.
    async fn ask<T: DeserializeOwned>(
        &self,
        what: &str,
        key: Option<&str>,
        body: &impl Serialize,
        lost: Exit,
    ) -> Result<T, Failure> {
        let path = self.path(what);
        let answer = self.gateway.ask(Method::POST, &path, key, body, lost).await?;
        serde_json::from_slice(&answer).map_err(|error| self.gateway.unclear(&path, &error.to_string(), lost))
    }
}
