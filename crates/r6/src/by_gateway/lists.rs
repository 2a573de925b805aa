//! What a gateway lists: programs that it keeps, alarms of all robots, the audit log. And who asks.

use r6_api::gateway::{AuditHead, ProgramVersions, Programs, RobotAlarms, Session};
use serde::Deserialize;
use serde_json::Value;

use super::Gateway;
use crate::exit::{Exit, Failure};
use crate::http_client::in_path;

/// The most alarms of one answer, as the gateway has it.
pub(super) const MOST_ALARMS: usize = 1_000;

/// The entries of a page of the audit log. An entry has 4 KiB at most.
const OF_A_PAGE: u64 = 500;

/// A page of the audit log. Its entries are read one by one: a newer gateway may tell of more.
#[derive(Debug, Deserialize)]
pub struct AuditPage {
    /// The entries, oldest first.
    pub entries: Vec<Value>,
    /// The next page has those behind this number; `None` at the end.
    pub next_after: Option<u64>,
}

impl Gateway {
    /// The programs that it keeps, each in its latest version.
    pub async fn programs(&self) -> Result<Programs, Failure> {
        self.read("/v1/programs").await
    }

    /// The versions of a program that it keeps, the latest first.
    pub async fn program_versions(&self, name: &str) -> Result<ProgramVersions, Failure> {
        self.read(&format!("/v1/programs/{}/versions", in_path(name))).await
    }

    /// The alarms of all robots that the token may see. `active`: without those that have ended.
    pub async fn alarms(&self, active: bool) -> Result<RobotAlarms, Failure> {
        self.read(&format!("/v1/alarms?active={active}&limit={MOST_ALARMS}")).await
    }

    /// Whose token this is, and what it allows.
    pub async fn session(&self) -> Result<Session, Failure> {
        self.read("/v1/session").await
    }

    /// The number of the last entry of the audit log.
    pub async fn audit_end(&self) -> Result<u64, Failure> {
        let head: AuditHead = self.read("/v1/audit/head").await?;
        Ok(head.number)
    }

    /// A page of the audit log: entries behind this number.
    pub async fn audit(&self, after: u64) -> Result<AuditPage, Failure> {
        let path = format!("/v1/audit?after={after}&limit={OF_A_PAGE}");
        let page: AuditPage = self.read(&path).await?;
        match page.next_after {
            Some(next) if next <= after => {
                Err(self.unclear(&path, "a page that leads back to itself", Exit::NoReply))
            }
            _ => Ok(page),
        }
    }
}
