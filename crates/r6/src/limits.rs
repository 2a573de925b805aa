//! Limits that the system sets for this process.

/// Raises the limit of open files as far as the system allows without privileges. If that fails, the present
/// limit stays. Each controller has a listening socket and each connection has one more, and the usual soft
/// limit is 1024.
#[cfg(unix)]
pub fn open_as_many_files_as_allowed() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    if current != maximum {
        // A failure is ignored here: opening one file too many fails later with its own error.
        let _ = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum });
    }
}

/// This system has no such limit.
#[cfg(not(unix))]
pub fn open_as_many_files_as_allowed() {}
