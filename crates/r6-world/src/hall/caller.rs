//! The callers of a gateway: their programs until the faults are over.

mod commanding;
mod hostile;
mod inspecting;
mod reading;

use std::io;
use std::time::Duration;

use r6_traffic::random::Random;
use serde_json::Value;
use tokio::time::sleep;

use super::http::{Answer, Session, request};
use super::{name_of, token_of};
use crate::fault::Promise;
use crate::plan::{CallerPlan, Part};
use crate::shared::{Shared, State, now};

/// How long a caller waits for an answer: a stop may take 20 s.
const PATIENCE: Duration = Duration::from_secs(25);

/// How much of a body is told, in bytes.
const TOLD: usize = 300;

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// The data of a caller's program.
struct Work {
    shared: Shared,
    index: usize,
    plan: CallerPlan,
    random: Random,
    session: Session,
}

/// The program of the host.
pub async fn run(shared: Shared, index: usize) -> turmoil::Result {
    let Some(plan) = shared.plan.hall.as_ref().map(|hall| hall.callers[index]) else {
        return Err("there is no hall".into());
    };
    let random = Random::new(plan.seed);
    let mut work = Work { shared: shared.clone(), index, plan, random, session: Session::default() };
    // The gateway needs a moment to reach its robots.
    sleep(ms(300) + work.random.up_to(ms(1200))).await;
    match plan.part {
        Part::Inspector => work.inspect().await,
        Part::Viewer => work.view().await,
        Part::Operator => work.operate().await,
        Part::Stopper => work.stop_often().await,
        Part::Admin => work.take_leases().await,
        Part::Engineer => work.configure().await,
        Part::Reader => work.follow().await,
        Part::Hostile => work.attack().await,
    }
    shared.tell(format_args!("caller-{index}: its work is done"));
    if let Some(hall) = &mut shared.state().hall {
        hall.is_done[index] = true;
    }
    if plan.part == Part::Inspector {
        work.show_that_all_works().await;
    }
    std::future::pending().await
}

impl Work {
    fn is_over(&self) -> bool {
        self.shared.is_quiet()
    }

    fn robots(&self) -> usize {
        self.shared.plan.robots.len()
    }

    /// Waits for up to this time.
    async fn rest(&mut self, longest: u64) {
        let time = ms(20) + self.random.up_to(ms(longest));
        sleep(time).await;
    }

    /// Sends a request about a robot and waits for its answer. An error means that the outcome is unknown.
    async fn ask(&mut self, method: &str, path: &str, body: Option<&Value>) -> io::Result<Answer> {
        self.ask_within(PATIENCE, method, path, body).await
    }

    async fn ask_within(
        &mut self,
        within: Duration,
        method: &str,
        path: &str,
        body: Option<&Value>,
    ) -> io::Result<Answer> {
        let index = self.index;
        let sent = request(method, path, &token_of(index), body);
        let what = body.map(Value::to_string).unwrap_or_default();
        self.shared.tell(format_args!("caller-{index} > {method} {path} {what}"));
        let answer = self.session.ask(&sent, within).await;
        match &answer {
            Ok(Answer { status, body }) => {
                let told = String::from_utf8_lossy(body.get(..TOLD).unwrap_or(body)).into_owned();
                self.shared.tell(format_args!("caller-{index} < {status} {told}"));
                let (status, holds) = (*status, *status != 500);
                self.shared.check(Promise::NoPanic, holds, || format!("{method} {path}: {status} {told}"));
            }
            Err(error) => self.shared.tell(format_args!("caller-{index}: {error}")),
        }
        answer
    }

    /// The path of something of a robot.
    fn path(robot: usize, what: &str) -> String {
        format!("/v1/robots/{}{what}", name_of(robot))
    }

    /// Uses the state of the hall.
    fn hall<T>(
        &self,
        act: impl FnOnce(&mut super::Hall, &mut crate::record::Record, Duration) -> T,
    ) -> Option<T> {
        let at = now();
        let mut state = self.shared.state();
        let State { hall, record, .. } = &mut *state;
        hall.as_mut().map(|hall| act(hall, record, at))
    }
}
