//! `r6 gateway backup` and `r6 gateway restore`.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use r6_gateway::{Backup, BackupError};

use super::DEFAULT_DATA;
use crate::exit::{Exit, Failure};
use crate::output;

/// After this time people want to know what it does.
const SILENT_FOR: Duration = Duration::from_secs(1);

/// Copy the folder of a gateway, while it runs or not
#[derive(Debug, Args)]
#[command(after_help = "\
The backup is a folder with all of DIR: users and tokens, leases, robots, the audit log, the history, and a \
certificate that the gateway made. Files outside of DIR are not in it: copy the --config file and those of \
--tls-cert and --tls-key yourself. Only its owner can read the backup, and it has the private key: keep it safe. \
What the gateway writes while it is made may be missing in it.

Run this as the user of the gateway. `r6 gateway verify --data BACKUP` checks the audit log of a backup.

Examples:
  r6 gateway backup --to /mnt/backup/hall-2026-11-25
  r6 gateway backup --data /var/lib/r6-gateway --to /mnt/backup/hall --without-history")]
pub struct BackupArgs {
    /// Folder of the gateway
    #[arg(long, value_name = "DIR", default_value = DEFAULT_DATA)]
    data: PathBuf,
    /// The folder to make
    #[arg(long, value_name = "BACKUP")]
    to: PathBuf,
    /// Leave out the history of values, which is the largest part
    #[arg(long)]
    without_history: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Always refused: a database has backups of its own, such as `pg_dump`
    #[arg(long, value_name = "URL", hide = true)]
    store: Option<String>,
}

/// Make the folder of a gateway of a backup
#[derive(Debug, Args)]
#[command(after_help = "\
Nothing is overwritten: DIR is a new folder, or an empty one. Each file of the backup is checked before that.

Afterwards a stop holds for every robot, because the backup does not know what happened since. Look at the \
robots, then clear their stops. Tokens that were revoked after the backup was made are valid again: `r6 gateway \
token --list` prints all. All leases have ended.

Examples:
  r6 gateway restore --data r6-gateway-2 --from /mnt/backup/hall-2026-11-25")]
pub struct RestoreArgs {
    /// The folder to make
    #[arg(long, value_name = "DIR", default_value = DEFAULT_DATA)]
    data: PathBuf,
    /// The folder of the backup
    #[arg(long, value_name = "BACKUP")]
    from: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Always refused: a database has backups of its own, such as `pg_dump`
    #[arg(long, value_name = "URL", hide = true)]
    store: Option<String>,
}

/// Makes a backup. Exit code 1 if something is not in it or is wrong in it.
pub fn backup(args: &BackupArgs) -> Result<Exit, Failure> {
    refuse_store(args.store.as_deref())?;
    if r6_gateway::is_of_database(&args.data) {
        let what = format!("--data {}: this folder is of a gateway with --store", args.data.display());
        return Err(Failure::usage(what).advise("its store is in the database: copy that with `pg_dump`"));
    }
    let made = r6_gateway::backup(&args.data, &args.to, !args.without_history, progress("copying"));
    let made = made.map_err(failed)?;
    let text = format!(
        "{}: {}, {} MB, an audit log of {}",
        args.to.display(),
        output::counted(made.files, "file"),
        made.bytes.div_ceil(1_000_000),
        output::entries(made.entries),
    );
    tell(&made, text, args.json)
}

/// Makes a folder of a backup. Exit code 1 if something is wrong in it.
pub fn restore(args: &RestoreArgs) -> Result<Exit, Failure> {
    refuse_store(args.store.as_deref())?;
    let made = r6_gateway::restore(&args.data, &args.from, progress("checking")).map_err(failed)?;
    let text = format!("{} is as it was at {}", args.data.display(), made.made);
    let exit = tell(&made, text, args.json)?;
    output::note("r6: a stop holds for every robot; tokens that were revoked since are valid again");
    Ok(exit)
}

/// A database has backups of its own.
fn refuse_store(store: Option<&str>) -> Result<(), Failure> {
    match store {
        None => Ok(()),
        Some(_) => Err(Failure::usage("this is for the folder of a gateway, not for a database").advise(
            "copy the database with `pg_dump`; docs/GATEWAY.md says what to do before its copy is used",
        )),
    }
}

fn tell(made: &Backup, text: String, as_json: bool) -> Result<Exit, Failure> {
    if as_json {
        output::json(&serde_json::json!({
            "made": made.made, "files": made.files, "bytes": made.bytes, "entries": made.entries,
            "problems": made.problems,
        }));
    } else {
        output::line(text);
    }
    made.problems.iter().for_each(|problem| output::note(format_args!("r6: {problem}")));
    Ok(if made.problems.is_empty() { Exit::Done } else { Exit::Refused })
}

/// Names each file, once it takes longer.
fn progress(doing: &'static str) -> impl FnMut(&str) {
    let begun = Instant::now();
    move |name| {
        if begun.elapsed() > SILENT_FOR {
            output::note(format_args!("{doing} {name}"));
        }
    }
}

fn failed(error: BackupError) -> Failure {
    match error {
        BackupError::Changed(_) => Failure::refused(error),
        _ => Failure::usage(error),
    }
}
