//! The tables of the file, as each version added them.

/// What makes the tables of each version out of those before, from version 1 on. `PRAGMA user_version` has
/// the version of a file.
pub const TABLES: [&str; 14] = [
    CONTROL, PROGRAMS, USERS, ALARMS, RUNS, HEADS, STOPPED_BY, COMMANDS, CAMERAS, POINTS, GROUPS, MORE,
    LISTS, ROLES,
];

/// `what`, `robot` and `intent` are read from the text, so they cannot tell anything else than it. The seat
/// with the name '', which is the name of no robot, is how robots begin that have no seat yet.
const CONTROL: &str = "
CREATE TABLE audit (
    number INTEGER PRIMARY KEY,
    body   TEXT NOT NULL,
    hash   BLOB NOT NULL,
    what   TEXT GENERATED ALWAYS AS (body ->> '$.what') VIRTUAL,
    robot  TEXT GENERATED ALWAYS AS (body ->> '$.robot') VIRTUAL,
    intent INTEGER GENERATED ALWAYS AS (body ->> '$.intent') VIRTUAL
) STRICT;
CREATE INDEX audit_intent ON audit (intent) WHERE intent IS NOT NULL;
CREATE INDEX audit_intents ON audit (number) WHERE what = 'command_intent';
CREATE TABLE token (
    number  INTEGER PRIMARY KEY AUTOINCREMENT,
    hash    BLOB NOT NULL UNIQUE,
    role    TEXT NOT NULL,
    only    TEXT,
    name    TEXT NOT NULL,
    made    TEXT NOT NULL,
    revoked TEXT
) STRICT;
CREATE TABLE seat (
    robot        TEXT PRIMARY KEY,
    lease_number INTEGER NOT NULL,
    stopped      INTEGER NOT NULL,
    identity     TEXT
) STRICT;
CREATE TABLE robot (
    name      TEXT PRIMARY KEY,
    address   TEXT NOT NULL,
    period_ms INTEGER NOT NULL,
    read      TEXT NOT NULL
) STRICT;
";

/// Programs, and the model of a robot. The text is the last column, so that lists of programs do not read
/// it.
const PROGRAMS: &str = "
ALTER TABLE robot ADD COLUMN model TEXT;
CREATE TABLE program (
    name      TEXT NOT NULL,
    version   INTEGER NOT NULL,
    hash      BLOB NOT NULL,
    bytes     INTEGER NOT NULL,
    stored_at TEXT NOT NULL,
    stored_by TEXT NOT NULL,
    kind      TEXT NOT NULL,
    ok        INTEGER NOT NULL,
    steps     INTEGER NOT NULL,
    text      TEXT NOT NULL,
    PRIMARY KEY (name, version)
) STRICT;
CREATE INDEX program_bytes ON program (bytes);
";

/// The link for the first admin has the name '', which is the name of no user.
const USERS: &str = "
CREATE TABLE user (
    name     TEXT PRIMARY KEY,
    role     TEXT NOT NULL,
    only     TEXT,
    disabled INTEGER NOT NULL,
    password TEXT,
    created  TEXT NOT NULL,
    stamp    INTEGER NOT NULL
) STRICT;
CREATE TABLE link (
    user TEXT PRIMARY KEY,
    hash BLOB NOT NULL,
    made INTEGER NOT NULL
) STRICT;
";

/// The alarms of each robot. The settings of the hall: one row at most.
const ALARMS: &str = "
CREATE TABLE alarm (
    robot TEXT PRIMARY KEY,
    state TEXT NOT NULL
) STRICT;
CREATE TABLE hall (
    one      INTEGER PRIMARY KEY CHECK (one = 1),
    version  INTEGER NOT NULL,
    settings TEXT NOT NULL
) STRICT;
";

/// Runs of programs. `owed`: its list may be at the robot. The indexes of the open and the owed runs are
/// almost empty.
const RUNS: &str = "
CREATE TABLE run (
    id     INTEGER PRIMARY KEY AUTOINCREMENT,
    robot  TEXT NOT NULL,
    caller TEXT NOT NULL,
    key    TEXT NOT NULL,
    hash   BLOB NOT NULL,
    made   INTEGER NOT NULL,
    run    TEXT NOT NULL,
    answer TEXT,
    ended  INTEGER NOT NULL,
    owed   INTEGER NOT NULL,
    UNIQUE (caller, key)
) STRICT;
CREATE INDEX run_made ON run (made);
CREATE INDEX run_open ON run (id) WHERE ended = 0;
CREATE INDEX run_owed ON run (robot) WHERE owed = 1;
";

/// Signed heads of the audit log: `end`, the newest one, and `cut`, that of the last entry that was removed.
/// `key` is the public key that checks them.
const HEADS: &str = "
CREATE TABLE audit_head (
    what TEXT PRIMARY KEY CHECK (what IN ('key', 'end', 'cut')),
    text TEXT NOT NULL
) STRICT;
";

/// Who made the stop that holds, and when, as JSON.
const STOPPED_BY: &str = "
ALTER TABLE seat ADD COLUMN stopped_by TEXT;
";

/// Commands with an `Idempotency-Key`. `intent`: the number of the entry of the audit log.
const COMMANDS: &str = "
CREATE TABLE command (
    id     INTEGER PRIMARY KEY AUTOINCREMENT,
    intent INTEGER NOT NULL UNIQUE,
    caller TEXT NOT NULL,
    key    TEXT NOT NULL,
    hash   BLOB NOT NULL,
    made   INTEGER NOT NULL,
    answer TEXT,
    UNIQUE (caller, key)
) STRICT;
CREATE INDEX command_made ON command (made);
";

/// Grants of cameras. Those of a token go with it. The table may be there: an older gateway that still runs
/// sets the version of the file back.
const CAMERAS: &str = "
CREATE TABLE IF NOT EXISTS camera (
    robot    TEXT NOT NULL,
    camera   INTEGER NOT NULL,
    token    INTEGER NOT NULL,
    given_by TEXT NOT NULL,
    given_at TEXT NOT NULL,
    PRIMARY KEY (robot, camera, token)
) STRICT;
";

/// Points by name. The table may be there, as that of [`CAMERAS`].
const POINTS: &str = "
CREATE TABLE IF NOT EXISTS point (
    name      TEXT NOT NULL,
    version   INTEGER NOT NULL,
    hash      BLOB NOT NULL,
    stored_at TEXT NOT NULL,
    stored_by TEXT NOT NULL,
    text      TEXT NOT NULL,
    PRIMARY KEY (name, version)
) STRICT;
";

/// The first version with [`GROUPS`].
pub const SINCE_GROUPS: usize = 11;

/// What is read of a robot with other periods. The table may be there, as that of [`CAMERAS`].
const GROUPS: &str = "
CREATE TABLE IF NOT EXISTS poll_groups (
    robot  TEXT PRIMARY KEY,
    groups TEXT NOT NULL
) STRICT;
";

/// The first version with [`MORE`].
pub const SINCE_MORE: usize = 12;

/// What came later to what is kept of a robot, as one text, and when tokens end, in seconds since 1970. The
/// tables may be there, as that of [`CAMERAS`].
const MORE: &str = "
CREATE TABLE IF NOT EXISTS robot_more (
    robot TEXT PRIMARY KEY,
    more  TEXT NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS token_end (
    token   INTEGER PRIMARY KEY,
    expires INTEGER NOT NULL
) STRICT;
";

/// For lists of the runs of a robot. The index may be there, as the table of [`CAMERAS`].
const LISTS: &str = "
CREATE INDEX IF NOT EXISTS run_robot ON run (robot);
";

/// A token or a user may have a role for each robot in its text: an older r6 must not begin with such a file.
const ROLES: &str = "";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{Sqlite, Store as _};

    #[test]
    fn a_file_whose_version_an_older_gateway_set_back_is_opened() {
        let folder = tempfile::tempdir().unwrap();
        drop(Sqlite::open(folder.path()).unwrap());
        let file = rusqlite::Connection::open(folder.path().join("control.db")).unwrap();
        file.execute("INSERT INTO camera VALUES ('press', 0, 1, 'anna', 'now')", []).unwrap();
        file.pragma_update(None, "user_version", TABLES.len() - 1).unwrap();
        // To read it changes nothing.
        assert_eq!(Sqlite::open_to_read(folder.path(), false).unwrap().robots(), Ok(Vec::new()));
        drop(Sqlite::open(folder.path()).unwrap());
        let grants: usize = file.query_row("SELECT count(*) FROM camera", [], |row| row.get(0)).unwrap();
        assert_eq!(grants, 1);
    }
}
