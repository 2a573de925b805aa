//! Callers that hold leases, send commands, stop, and change robots.

use std::io;
use std::time::Duration;

use serde_json::{Value, json};

use super::{Answer, Work, ms};
use crate::fault::{Class, Promise};
use crate::hall::name_of;
use crate::shared::{State, now};

/// A stop of a robot that is sound is answered within this time, whatever else goes on.
const STOPS_WITHIN: Duration = Duration::from_secs(4);

/// A lease as its holder knows it.
#[derive(Clone, Debug)]
pub(super) struct Lease {
    pub robot: usize,
    pub number: u64,
    key: Value,
    /// How long it was asked for.
    lasts: Duration,
    stopped: bool,
}

impl Work {
    /// Asks for the lease of a robot. `because`: takes it from its holder.
    pub(super) async fn acquire(&mut self, robot: usize, because: Option<&str>) -> Option<Lease> {
        let lasts = ms(2000) + self.random.up_to(ms(4000));
        let mut wanted = json!({ "duration_ms": u64::try_from(lasts.as_millis()).unwrap_or(2000) });
        if let Some(because) = because {
            wanted["take_because"] = because.into();
            self.hall(|hall, _, at| hall.asks_stop(at, robot));
        }
        let answer = self.ask("POST", &Self::path(robot, "/lease"), Some(&wanted)).await.ok()?;
        if answer.status != 200 {
            return None;
        }
        let told = answer.json();
        let number = told["lease"]["number"].as_u64()?;
        let key = told["lease"].clone();
        self.hall(|hall, record, at| {
            hall.gives_lease(at, robot, (number, lasts), record);
            hall.last_keys.insert(robot, key.to_string());
        });
        Some(Lease { robot, number, key, lasts, stopped: told["stopped"] == true })
    }

    async fn renew(&mut self, lease: &Lease) -> bool {
        let Lease { robot, number, key, lasts, .. } = lease.clone();
        let wanted = json!({ "duration_ms": u64::try_from(lasts.as_millis()).unwrap_or(2000), "renew": key });
        self.hall(|hall, _, _| hall.renews(robot, number));
        let answer = self.ask_within(ms(6000), "POST", &Self::path(robot, "/lease"), Some(&wanted)).await;
        let is_renewed = answer.as_ref().is_ok_and(|answer| answer.status == 200);
        // Without an answer it may have been renewed until now.
        let may_be = is_renewed || answer.is_err();
        self.hall(|hall, _, at| hall.renewed(robot, number, may_be.then_some(at + lasts)));
        is_renewed
    }

    pub(super) async fn release(&mut self, lease: &Lease) -> bool {
        let Lease { robot, number, key, .. } = lease.clone();
        let answer = self.ask("DELETE", &Self::path(robot, "/lease"), Some(&json!({ "lease": key }))).await;
        let is_released = answer.is_ok_and(|answer| answer.status == 204);
        if is_released {
            self.hall(|hall, _, at| hall.released(at, robot, number));
        }
        is_released
    }

    pub(super) async fn clear(&mut self, lease: &Lease) -> bool {
        let (robot, body) = (lease.robot, json!({ "lease": lease.key }));
        self.hall(|hall, _, _| hall.asks_clear(robot));
        let path = Self::path(robot, "/clear-stopped");
        let answer = self.ask_within(ms(10_000), "POST", &path, Some(&body)).await;
        self.hall(|hall, _, at| hall.cleared(at, robot));
        answer.is_ok_and(|answer| answer.status == 204)
    }

    /// Sends a command with a lease. The status of the answer, if one came.
    async fn command(&mut self, lease: &Lease, word: &str, arguments: &[String]) -> Option<u16> {
        let body = json!({ "command": word, "arguments": arguments, "lease": lease.key });
        let answer = self.ask("POST", &Self::path(lease.robot, "/commands"), Some(&body)).await.ok()?;
        let requests = match answer.status {
            200 => 0,
            504 => 2,
            _ => 1,
        };
        self.shared.state().record.tally.requests[requests] += 1;
        if answer.status == 200 {
            let told = answer.json();
            let (id, sent) = (told["command_id"].as_u64()?, told["sent"].as_str()?.to_owned());
            self.hall(|hall, record, at| hall.accepted(at, lease.robot, (id, &sent), record));
        }
        Some(answer.status)
    }

    /// Writes a register with a value that was never written.
    pub(super) async fn write(&mut self, lease: &Lease) -> Option<u16> {
        let value = self.hall(|hall, _, _| hall.next_value()).unwrap_or_default();
        let arguments = ["800".to_owned(), value.to_string(), "0".to_owned()];
        self.command(lease, "rewriteData", &arguments).await
    }

    /// Stops a robot. Whether that was confirmed.
    pub(super) async fn stop(&mut self, robot: usize) -> bool {
        let asked = now();
        self.hall(|hall, _, at| hall.asks_stop(at, robot));
        let was_sound = self.hall(|hall, _, at| hall.is_sound(robot, at)) == Some(true);
        let answer = self.ask("POST", &Self::path(robot, "/stop"), None).await;
        let heard = now();
        let is_confirmed = answer.as_ref().is_ok_and(|answer| answer.status == 200);
        let mut state = self.shared.state();
        let State { hall, record, floors, .. } = &mut *state;
        record.tally.stops[usize::from(!is_confirmed)] += 1;
        let Some(hall) = hall else { return false };
        if was_sound && hall.is_sound(robot, heard) && hall.is_sound(robot, asked + STOPS_WITHIN) {
            let (took, status) = (heard - asked, answer.as_ref().map(|answer| answer.status).ok());
            // If a person starts the arm meanwhile, the stop cannot be proved.
            let is_told = is_confirmed || (status == Some(504) && floors[robot].was_moved_since(asked));
            record.check(Promise::I8, heard, is_told && took <= STOPS_WITHIN, || {
                format!("{}: a stop took {took:?}: {status:?}", name_of(robot))
            });
        }
        if is_confirmed && hall.stopped(heard, robot, asked) {
            floors[robot].stands(heard);
        }
        is_confirmed
    }

    /// Takes, renews, forgets and gives back the lease of its robot, and commands it.
    pub(super) async fn operate(&mut self) {
        let robot = self.plan.robot;
        while !self.is_over() {
            let Some(lease) = self.acquire(robot, None).await else {
                self.rest(800).await;
                continue;
            };
            if lease.stopped && self.random.strikes(0.8) {
                self.clear(&lease).await;
            }
            for _ in 0..3 + self.random.below(12) {
                if self.is_over() {
                    break;
                }
                match self.random.below(20) {
                    0..9 => drop(self.write(&lease).await),
                    9..12 => {
                        let percent = format!("{}.{}", 20 + self.random.below(80), self.random.below(10));
                        self.command(&lease, "modifyGSPD", &[percent]).await;
                    }
                    12..14 => drop(self.command(&lease, "startButton", &[]).await),
                    14..17 => drop(self.renew(&lease).await),
                    17 => drop(self.clear(&lease).await),
                    18 => drop(self.stop(robot).await),
                    // It forgets to renew, and goes on as if it had not.
                    _ => self.rest(5000).await,
                }
                self.rest(400).await;
            }
            if self.random.strikes(0.6) {
                self.release(&lease).await;
            }
            if self.random.strikes(0.3) {
                // It does not know that its lease is over.
                self.write(&lease).await;
            }
            self.rest(600).await;
        }
    }

    /// Stops its robot or any other, again and again.
    pub(super) async fn stop_often(&mut self) {
        while !self.is_over() {
            self.rest(5000).await;
            let any = self.random.below(self.robots());
            let robot = if self.random.strikes(0.5) { self.plan.robot } else { any };
            self.stop(robot).await;
        }
    }

    /// Takes the lease of its robot from its holder.
    pub(super) async fn take_leases(&mut self) {
        while !self.is_over() {
            self.rest(6000).await;
            let robot = self.plan.robot;
            let Some(lease) = self.acquire(robot, Some("a simulated reason")).await else { continue };
            self.rest(300).await;
            if self.random.strikes(0.5) {
                self.clear(&lease).await;
            }
            self.write(&lease).await;
            if self.random.strikes(0.7) {
                self.release(&lease).await;
            }
        }
    }

    /// Tries what a token that may only read may not do, also with the key of another caller.
    pub(super) async fn view(&mut self) {
        while !self.is_over() {
            self.rest(1500).await;
            let robot = self.random.below(self.robots());
            let key = self.hall(|hall, _, _| hall.last_keys.get(&robot).cloned()).flatten();
            let key: Value = key.and_then(|key| serde_json::from_str(&key).ok()).unwrap_or_default();
            let value = self.hall(|hall, _, _| hall.next_value()).unwrap_or_default();
            let answer = match self.random.below(4) {
                0 => {
                    let body = json!({
                        "command": "rewriteData", "arguments": ["801", value.to_string(), "0"], "lease": key
                    });
                    self.ask("POST", &Self::path(robot, "/commands"), Some(&body)).await
                }
                1 => self.ask("POST", &Self::path(robot, "/lease"), Some(&json!({}))).await,
                2 => self.ask("POST", &Self::path(robot, "/stop"), None).await,
                _ => self.ask("DELETE", &Self::path(robot, ""), None).await,
            };
            self.is_refused(&answer, robot);
        }
    }

    /// A request about a robot that the role does not allow was refused for that reason. A gateway that has
    /// too much to do refuses before it looks, and a robot that is added and removed may not be there.
    fn is_refused(&self, answer: &io::Result<Answer>, robot: usize) {
        let Ok(answer) = answer else { return };
        let status = answer.status;
        let comes_and_goes = self.shared.plan.hall.as_ref().is_some_and(|hall| hall.added == Some(robot));
        let holds = matches!(status, 403 | 429 | 503) || (status == 404 && comes_and_goes);
        self.shared.check(Promise::I12, holds, || format!("a viewer got {status} for what it may not do"));
    }

    /// Adds, changes and removes its robot.
    pub(super) async fn configure(&mut self) {
        let robot = self.plan.robot;
        while !self.is_over() {
            let answer = if self.random.strikes(0.7) {
                self.put_robot(robot).await
            } else {
                self.ask("DELETE", &Self::path(robot, ""), None).await
            };
            if answer.is_ok_and(|answer| (200..300).contains(&answer.status)) {
                self.shared.state().record.strikes(Class::G6);
            }
            self.rest(2500).await;
        }
    }

    /// Adds its robot, or changes how often it is read.
    pub(super) async fn put_robot(&mut self, robot: usize) -> io::Result<Answer> {
        let period = [50, 100, 200, 500][self.random.below(4)];
        let wanted =
            json!({ "address": format!("{}:{}", name_of(robot), crate::wire::PORT), "period_ms": period });
        self.ask("PUT", &Self::path(robot, ""), Some(&wanted)).await
    }
}
