//! The end of a run: the last lines, and the exit code if stdout cannot be written.

use std::io::ErrorKind;
use std::time::Duration;

use super::queue::{FLUSH_WITHIN, LineQueue, Unwritten};
use super::{OUTPUT, has_acted, json, note, problem};
use crate::exit::{Exit, Failure};
use crate::signals::{self, Ending};

/// How often r6 checks whether a slow reader has read the last lines.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Says why a run failed, waits until everything is written, and returns the exit code. `as_json`: programs
/// read stdout.
pub fn conclude(ended: Result<Exit, Failure>, as_json: bool) -> Exit {
    let (exit, failed) = match &ended {
        Ok(exit) => (*exit, false),
        Err(failure) => {
            if as_json && !failure.is_told() {
                json(&problem::object(failure));
            }
            if !failure.is_said() {
                note(failure);
            }
            (failure.exit(), true)
        }
    };
    let Some(output) = OUTPUT.get() else { return exit };
    let all_written = settle(&output.out);
    let exit = match (output.out.failure(), all_written) {
        (Some(unwritten), _) => {
            say_unwritten(&unwritten, (!failed).then(|| output.out.unwritten()));
            where_nobody_was_told(exit, has_acted())
        }
        (None, false) if has_acted() => {
            note("r6: stdout is not read: what r6 says of the machine was lost");
            where_nobody_was_told(exit, true)
        }
        (None, _) => exit,
    };
    settle(&output.err);
    exit
}

/// The exit code of a run that could not write stdout. If it acted on a machine, the caller does not know the
/// outcome.
fn where_nobody_was_told(exit: Exit, acted: bool) -> Exit {
    match (exit, acted) {
        (Exit::Done | Exit::Refused, true) => Exit::Unknown,
        (Exit::Done, false) => Exit::Refused,
        (Exit::Refused | Exit::Usage | Exit::NoReply | Exit::Unknown, _) => exit,
    }
}

/// Says on stderr that stdout cannot be written, and what is missing there. It is silent if the run only
/// reads and the reader has ended (`r6 query --list | head`).
fn say_unwritten(unwritten: &Unwritten, text: Option<String>) {
    if unwritten.kind == ErrorKind::BrokenPipe && !has_acted() {
        return;
    }
    note(format_args!("r6: stdout: {unwritten}"));
    if let Some(text) = text.filter(|text| has_acted() && !text.is_empty()) {
        let lines: Vec<_> = text.lines().map(|line| format!("    {line}")).collect();
        note(format_args!("r6: it would have ended with:\n{}", lines.join("\n")));
    }
}

/// Waits until everything is written, however slow the reader is, or until a signal asks for the end. Returns
/// whether everything is written or never will be.
fn settle(queue: &LineQueue) -> bool {
    if queue.flush_within(FLUSH_WITHIN) {
        return true;
    }
    if signals::asked_to_end() {
        return false;
    }
    let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_all().build() else {
        return false;
    };
    runtime.block_on(async {
        let Ok(mut ending) = Ending::watch() else { return false };
        let written = async {
            while !queue.flush_within(Duration::ZERO) {
                tokio::time::sleep(LOOK_EVERY).await;
            }
        };
        tokio::select! {
            () = written => true,
            () = ending.signalled() => false,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_was_told_is_not_done() {
        for (exit, acted, wanted) in [
            (Exit::Done, true, Exit::Unknown),
            (Exit::Refused, true, Exit::Unknown),
            (Exit::Done, false, Exit::Refused),
            (Exit::Refused, false, Exit::Refused),
            (Exit::Usage, false, Exit::Usage),
            (Exit::NoReply, true, Exit::NoReply),
            (Exit::Unknown, true, Exit::Unknown),
        ] {
            assert_eq!(where_nobody_was_told(exit, acted), wanted, "{exit:?} {acted}");
        }
    }
}
