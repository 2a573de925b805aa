//! What the system lets this process have.

/// Raises the limit of open files as far as the system allows without asking: each controller listens on a socket, each
/// connection takes one, and the usual soft limit is 1024. Where it cannot be raised, the limit that is there counts.
#[cfg(unix)]
pub fn open_as_many_files_as_allowed() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    if current != maximum {
        // Refused: whoever runs out of files is told so then.
        let _ = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum });
    }
}

/// This system has no such limit.
#[cfg(not(unix))]
pub fn open_as_many_files_as_allowed() {}
