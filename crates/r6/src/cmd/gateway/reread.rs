//! Reads the file of a gateway again while it runs (`SIGHUP`).

use std::path::Path;

use r6_gateway::{AuditSettings, Changes, Gateway, HistorySettings, RawPort};

use super::config::{Config, HttpSettings};
use super::{Beside, all, counted, tell_unknown_robots, twins};
use crate::output;

/// What the command line says.
pub struct Typed {
    /// Its robots.
    pub robots: Vec<String>,
    /// Its raw ports.
    pub raw: Vec<RawPort>,
}

/// What the gateway was started with, and keeps until the next start.
#[derive(PartialEq)]
pub struct AtStart {
    /// The raw ports, those of the command line too.
    pub raw: Vec<RawPort>,
    /// `[audit]`.
    pub audit: AuditSettings,
    /// `[history]`.
    pub history: HistorySettings,
    /// `[http]`.
    pub http: HttpSettings,
}

impl AtStart {
    /// The names of what differs.
    fn changed(&self, now: &Self) -> Vec<&'static str> {
        let all = [
            ("[[raw]]", self.raw != now.raw),
            ("[audit]", self.audit != now.audit),
            ("[history]", self.history != now.history),
            ("[http]", self.http != now.http),
        ];
        all.into_iter().filter_map(|(name, differs)| differs.then_some(name)).collect()
    }
}

/// Reads the file again. A mistake in it changes nothing, and nor does a file with which the gateway would
/// not start. What is [`AtStart`] stays as it is until the next start; the rules of raw ports change at once.
pub async fn reread(
    gateway: &Gateway,
    path: &Path,
    typed: &Typed,
    at_start: &AtStart,
    mut beside: Option<&mut Beside>,
) {
    let Config { robots, profiles, mut raw, policy, hall, audit, history, http } =
        match all(Some(path), &typed.robots) {
            Ok(config) => config,
            Err(failure) => return output::note(format_args!("r6: nothing was changed: {failure}")),
        };
    let prepared = match &beside {
        Some(beside) => beside.twins.prepare(robots, &profiles, &beside.avoided).await,
        None => Ok((robots, twins::Prepared::default())),
    };
    let (robots, prepared) = match prepared {
        Ok(prepared) => prepared,
        Err(failure) => return output::note(format_args!("r6: nothing was changed: {failure}")),
    };
    raw.extend(typed.raw.iter().cloned());
    if let Err(error) = gateway.check_raw(&raw, &robots) {
        return output::note(format_args!(
            "r6: {}: nothing was changed, because the gateway would not start with it: {error}",
            path.display()
        ));
    }
    // Before the robots, which may take their time: a source that is denied now commands nothing more.
    let (before, policy) = (gateway.raw_policy(), policy.unwrap_or_default());
    let rules = (policy != before).then(|| policy.rules().len());
    gateway.set_raw_policy(policy);
    match gateway.reload(robots).await {
        Ok(Changes { added, changed, removed }) => {
            gateway.set_hall(hall);
            let lines = match &mut beside {
                Some(beside) => beside.twins.commit(prepared).await,
                None => Vec::new(),
            };
            output::line(format_args!(
                "read {} again: {added} added, {changed} changed, {removed} removed, {} now",
                path.display(),
                counted(gateway, beside.as_deref())
            ));
            lines.into_iter().for_each(output::line);
            if let Some(rules) = rules {
                output::line(format_args!("{} for raw ports from now on", output::counted(rules, "rule")));
            }
            tell_unknown_robots(gateway);
            let changed = at_start.changed(&AtStart { raw, audit, history, http });
            if !changed.is_empty() {
                output::note(format_args!("r6: from the next start on: {}", changed.join(", ")));
            }
        }
        Err(problem) => {
            gateway.set_raw_policy(before);
            output::note(format_args!("r6: {}: nothing was changed: {}", path.display(), problem.message));
        }
    }
}
