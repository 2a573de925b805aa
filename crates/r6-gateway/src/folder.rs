//! Where the store of the gateway of a folder is: in the folder, or in a database (`--store`).
//!
//! Users, leases and stops of the one place count nothing in the other. A gateway whose store is in a
//! database leaves a marker in its folder, so that nothing takes the folder for the store by mistake.

use std::io;
use std::path::Path;

use crate::files;
use crate::store::FILE;

/// The marker. The URL of the database is not in it, because that can have a password.
const MARKER: &str = "store-in-database";

/// What stands in the marker, for people who look into the folder.
const TEXT: &[u8] =
    b"The gateway of this folder runs with --store: its users, tokens, robots, leases, stops, audit\n\
    log and history are in a database. This folder has its key of the audit log and its certificate.\n";

/// Whether the gateway of this folder has its store in a database.
#[must_use]
pub fn is_of_database(folder: &Path) -> bool {
    folder.join(MARKER).exists()
}

/// Whether the folder has the store of a gateway in it.
#[must_use]
pub fn has_store(folder: &Path) -> bool {
    folder.join(FILE).exists()
}

/// Marks the folder as that of a gateway with its store in a database.
///
/// # Errors
/// What the system says.
pub fn mark(folder: &Path) -> io::Result<()> {
    if is_of_database(folder) {
        return Ok(());
    }
    files::write(&folder.join(MARKER), TEXT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_owner_of_a_folder_can_read_its_marker() {
        let folder = tempfile::tempdir().unwrap();
        assert!(!is_of_database(folder.path()) && !has_store(folder.path()));
        mark(folder.path()).unwrap();
        mark(folder.path()).unwrap();
        assert!(is_of_database(folder.path()) && !has_store(folder.path()));
        #[cfg(unix)]
        {
            let meta = std::fs::metadata(folder.path().join(MARKER)).unwrap();
            assert_eq!(std::os::unix::fs::PermissionsExt::mode(&meta.permissions()) & 0o777, 0o600);
        }
    }
}
