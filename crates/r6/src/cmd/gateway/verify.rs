//! `r6 gateway verify`: checks the audit log of a gateway.

use std::path::PathBuf;

use clap::Args;
use r6_gateway::StoreError;

use super::DEFAULT_DATA;
use crate::exit::{Exit, Failure};
use crate::output;

/// Check that no entry of the audit log was changed, removed or moved
#[derive(Debug, Args)]
#[command(after_help = "\
Each entry has a hash over itself and the hash of the entry before. A log whose last entries were cut off is \
whole in itself: note the count and the hash that this prints, and compare them later.

Examples:
  r6 gateway verify
  r6 gateway verify --data /var/lib/r6-gateway")]
pub struct VerifyArgs {
    /// Folder of the gateway
    #[arg(long, value_name = "DIR", default_value = DEFAULT_DATA)]
    data: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Checks the log. Exit code 1 if it is broken.
pub fn run(args: &VerifyArgs) -> Result<Exit, Failure> {
    match r6_gateway::verify(&args.data) {
        Ok(verified) if args.json => {
            output::json(&serde_json::json!({
                "whole": true, "entries": verified.entries, "head": verified.head,
            }));
            Ok(Exit::Done)
        }
        Ok(verified) => {
            let entries = output::entries(verified.entries);
            output::line(format_args!(
                "the audit log is whole: {entries}, the last hash is {}",
                verified.head
            ));
            Ok(Exit::Done)
        }
        Err(StoreError::Broken(broken)) => {
            Err(Failure::refused(format!("the audit log is NOT whole: {broken}"))
                .advise("another program changed the file, or the disk did: keep it, and look at a backup"))
        }
        Err(error) => Err(Failure::usage(error)),
    }
}
