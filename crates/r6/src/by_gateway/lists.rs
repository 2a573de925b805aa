//! What a gateway lists: programs that it keeps.

use r6_api::gateway::{ProgramVersions, Programs};

use super::Gateway;
use crate::exit::Failure;
use crate::http_client::in_path;

impl Gateway {
    /// The programs that it keeps, each in its latest version.
    pub async fn programs(&self) -> Result<Programs, Failure> {
        self.read("/v1/programs").await
    }

    /// The versions of a program that it keeps, the latest first.
    pub async fn program_versions(&self, name: &str) -> Result<ProgramVersions, Failure> {
        self.read(&format!("/v1/programs/{}/versions", in_path(name))).await
    }
}
