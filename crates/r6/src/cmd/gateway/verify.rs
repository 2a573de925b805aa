//! `r6 gateway verify`: checks the audit log of a gateway.

use std::path::PathBuf;

use clap::Args;
use r6_gateway::{At, PublicKey, Signed, StoreError, Verified, VerifyError};
use serde_json::{Value, json};

use super::DEFAULT_DATA;
use super::place::{self, StoreUrl};
use crate::exit::{Exit, Failure};
use crate::output;
use crate::text_file;

/// The longest file of a head. A head has some hundred bytes.
const MAX_HEAD_BYTES: usize = 64 * 1024;

/// Check that no entry of the audit log was changed, removed or moved
#[derive(Debug, Args)]
#[command(after_help = "\
Each entry has a hash over itself and the hash of the entry before. The gateway signs the last entry from time \
to time, and these heads are checked too. A person who can write to the folder can sign heads as well. So keep a \
head on another machine: `GET /v1/audit/head` returns one. With --head, a log that was cut off or rewritten \
since then is found.

Exit code 1: the log was changed, it does not have the entry of --head, or another key signed a head.

Examples:
  r6 gateway verify
  r6 gateway verify --data /var/lib/r6-gateway
  r6 gateway verify --head kept/2026-11-25.json --key r6-gateway/audit/0a1b2c3d4e5f6071+8c9dab01+AQID...")]
pub struct VerifyArgs {
    /// Folder of the gateway
    #[arg(long, value_name = "DIR", default_value = DEFAULT_DATA)]
    data: PathBuf,
    /// The database of gateways that share their store, in place of the folder
    #[arg(long, value_name = "URL", value_parser = StoreUrl::read, conflicts_with = "data")]
    store: Option<StoreUrl>,
    /// A head that was kept elsewhere: the answer of GET /v1/audit/head, or its note
    #[arg(long, value_name = "FILE")]
    head: Option<PathBuf>,
    /// The public key of the heads, as GET /v1/audit/head returns it; may be given several times, if the
    /// gateway made another one. Without it, that of the folder is used
    #[arg(id = "key", long = "key", value_name = "KEY", value_parser = key)]
    keys: Vec<PublicKey>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl VerifyArgs {
    /// Where the store is.
    fn at(&self) -> Result<At, Failure> {
        place::at(self.store.as_ref(), &self.data)
    }
}

fn key(text: &str) -> Result<PublicKey, String> {
    PublicKey::parse(text).ok_or_else(|| "the key of an audit log begins with r6-gateway/audit/".to_owned())
}

/// Checks the log. Exit code 1 if it was changed.
pub fn run(args: &VerifyArgs) -> Result<Exit, Failure> {
    let kept = args.head.as_ref().map(|path| {
        let text = text_file::read(path, "a head of an audit log", MAX_HEAD_BYTES);
        text.map_err(|error| Failure::usage(format!("{}: {error}", path.display())))
    });
    let kept = kept.transpose()?;
    match r6_gateway::verify(args.at()?, &args.keys, kept.as_deref()) {
        Ok(verified) if args.json => {
            output::json(&object(&verified));
            Ok(Exit::Done)
        }
        Ok(verified) => {
            tell(&verified);
            if verified.stored.is_none() && args.store.is_none() {
                let told = "it has no signed head: no gateway has run with this folder, or not with this version";
                output::line(format_args!("{}: {told}", args.data.display()));
            }
            Ok(Exit::Done)
        }
        Err(VerifyError::Store(StoreError::Broken(broken))) => {
            Err(Failure::refused(format!("the audit log is NOT whole: {broken}"))
                .advise("another program changed the file, or the disk did: keep it, and look at a backup"))
        }
        Err(VerifyError::Changed(why)) => Err(Failure::refused(format!("the audit log is NOT whole: {why}"))
            .advise("keep the folder as it is, and compare it with a backup")),
        Err(error @ VerifyError::OtherKey { .. }) => Err(Failure::refused(error).advise(
            "after a restore, and if audit.key was lost, the gateway makes another key and says so in the log; if \
             this was the reason, give both keys with --key",
        )),
        Err(error @ VerifyError::Removed { .. }) => Err(Failure::refused(error)),
        Err(error @ VerifyError::NoKey) => Err(Failure::usage(error).advise("name the key with --key")),
        Err(error @ VerifyError::NoHead) => {
            let path = args.head.as_deref().unwrap_or(&args.data);
            Err(Failure::usage(format!("{}: {error}", path.display())))
        }
        Err(error) => Err(Failure::usage(error)),
    }
}

fn object(verified: &Verified) -> Value {
    let signed = |signed: &Signed| json!({ "number": signed.number, "time": signed.time });
    json!({
        "whole": true,
        "entries": verified.entries,
        "removed": verified.removed,
        "head": verified.head,
        "key": verified.key,
        "stored_head": verified.stored.as_ref().map(signed),
        "kept_head": verified.kept.as_ref().map(signed),
    })
}

fn tell(verified: &Verified) {
    let Verified { entries, removed, head, key, stored, kept } = verified;
    let entries = output::entries(*entries);
    output::line(format_args!("the audit log is whole: {entries}, the last hash is {head}"));
    if *removed > 0 {
        output::line(format_args!("entries up to {removed} were removed"));
    }
    for (what, signed) in [("stored", stored), ("kept", kept)] {
        if let Some(Signed { number, time }) = signed {
            output::line(format_args!("it has entry {number} of the {what} head of {time}"));
        }
    }
    if let Some(key) = key {
        output::line(format_args!("the key of the heads is {key}"));
    }
}
