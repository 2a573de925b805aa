//! One file per subcommand.

pub mod alarm;
pub mod alarms;
pub mod audit;
pub mod command;
pub mod completions;
pub mod discover;
pub mod gateway;
pub mod history;
pub mod inspect;
pub mod job;
pub mod man;
pub mod r#move;
pub mod panel;
pub mod plot;
pub mod query;
pub mod run;
pub mod sim;
pub mod status;
pub mod stop;
pub mod up;
pub mod watch;
pub mod whoami;

use crate::exit::{Exit, Failure};

/// The failure of a command that only a gateway can answer.
pub fn needs_gateway(name: &str) -> Failure {
    Failure::usage(format!("`r6 {name}` asks a gateway, and none is named"))
        .advise(format!("`r6 --gateway-url URL --token-file FILE {name}`; `r6 gateway` starts a gateway"))
}

/// Runs an asynchronous command to its end.
pub fn block_on(work: impl Future<Output = Result<Exit, Failure>>) -> Result<Exit, Failure> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| Failure::usage(format!("the system gives no threads or timers: {error}")))?;
    let ended = runtime.block_on(work);
    // Does not wait for blocking threads: a thread that waits for a disk without an answer would keep the
    // process alive.
    runtime.shutdown_background();
    ended
}
