//! The tables of the database, as each version added them.

/// The schema that has all of them.
pub const SCHEMA: &str = "r6_gateway";

/// Makes the schema and the table that says which versions are there. The lock, which ends with its
/// transaction, lets one gateway after the other do this.
pub const FOUNDATION: &str = "
SELECT pg_advisory_xact_lock(7236770113);
CREATE SCHEMA IF NOT EXISTS r6_gateway;
CREATE TABLE IF NOT EXISTS r6_gateway.version (
    one    integer PRIMARY KEY CHECK (one = 1),
    tables integer NOT NULL
);
";

/// What makes the tables of each version out of those before, from version 1 on.
pub const TABLES: [&str; 10] = [FIRST, COMMANDS, OWNERS, CAMERAS, FILES, POINTS, GROUPS, MORE, LISTS, ROLES];

/// - `audit`: `what`, `robot` and `intent` are read from the text when it is written.
/// - `seat`: the name '', which is the name of no robot, is how robots begin that have no seat yet.
/// - `link`: the link for the first admin has the name '', which is the name of no user.
/// - `program`: the text is bytes, because text of PostgreSQL cannot have each character.
/// - `owner`: which gateway had all robots, before [`OWNERS`].
/// - `event`: `hash` is of the text, which may be too long for an index.
/// - `chunk`, `tail`, `event`: a partition for each part of a day of the history, which is removed as a
///   whole.
const FIRST: &str = "
CREATE TABLE audit (
    number bigint PRIMARY KEY,
    body   text NOT NULL,
    hash   bytea NOT NULL,
    what   text,
    robot  text,
    intent bigint
);
CREATE INDEX audit_intent ON audit (intent) WHERE intent IS NOT NULL;
CREATE INDEX audit_intents ON audit (number) WHERE what = 'command_intent';
CREATE TABLE audit_head (
    what text PRIMARY KEY CHECK (what IN ('key', 'end', 'cut')),
    text text NOT NULL
);
CREATE TABLE token (
    number  bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    hash    bytea NOT NULL UNIQUE,
    role    text NOT NULL,
    robot   text,
    name    text NOT NULL,
    made    text NOT NULL,
    revoked text
);
CREATE TABLE \"user\" (
    name     text COLLATE \"C\" PRIMARY KEY,
    role     text NOT NULL,
    robot    text,
    disabled boolean NOT NULL,
    password text,
    created  text NOT NULL,
    stamp    bigint NOT NULL
);
CREATE TABLE link (
    \"user\" text PRIMARY KEY,
    hash     bytea NOT NULL,
    made     bigint NOT NULL
);
CREATE TABLE seat (
    robot        text PRIMARY KEY,
    lease_number bigint NOT NULL,
    stopped      boolean NOT NULL,
    identity     text,
    stopped_by   text
);
CREATE TABLE alarm (
    robot text PRIMARY KEY,
    state text NOT NULL
);
CREATE TABLE hall (
    one      integer PRIMARY KEY CHECK (one = 1),
    version  bigint NOT NULL,
    settings text NOT NULL
);
CREATE TABLE robot (
    name      text COLLATE \"C\" PRIMARY KEY,
    address   text NOT NULL,
    period_ms bigint NOT NULL,
    read      text NOT NULL,
    model     text
);
CREATE TABLE program (
    name      text COLLATE \"C\" NOT NULL,
    version   bigint NOT NULL,
    hash      bytea NOT NULL,
    bytes     bigint NOT NULL,
    stored_at text NOT NULL,
    stored_by text NOT NULL,
    kind      text NOT NULL,
    ok        boolean NOT NULL,
    steps     bigint NOT NULL,
    text      bytea NOT NULL,
    PRIMARY KEY (name, version)
);
ALTER TABLE program ALTER COLUMN text SET STORAGE EXTERNAL;
CREATE TABLE run (
    id     bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    robot  text COLLATE \"C\" NOT NULL,
    caller text NOT NULL,
    key    text NOT NULL,
    hash   bytea NOT NULL,
    made   bigint NOT NULL,
    run    text NOT NULL,
    answer text,
    ended  boolean NOT NULL,
    owed   boolean NOT NULL,
    UNIQUE (caller, key)
);
CREATE INDEX run_made ON run (made);
CREATE INDEX run_open ON run (id) WHERE NOT ended;
CREATE INDEX run_owed ON run (robot) WHERE owed;
CREATE TABLE owner (
    one     integer PRIMARY KEY CHECK (one = 1),
    fence   bigint NOT NULL,
    beat    bigint NOT NULL,
    gateway text NOT NULL,
    beat_at timestamptz
);
INSERT INTO owner (one, fence, beat, gateway) VALUES (1, 0, 0, '');
CREATE TABLE signal (
    id      bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    robot   text COLLATE \"C\" NOT NULL,
    address text COLLATE \"C\" NOT NULL,
    UNIQUE (robot, address)
);
CREATE SEQUENCE history_row;
CREATE TABLE chunk (
    day         bigint NOT NULL,
    part        bigint NOT NULL,
    id          bigint NOT NULL DEFAULT nextval('history_row'),
    signal      bigint NOT NULL,
    first       bigint NOT NULL,
    last        bigint NOT NULL,
    count       bigint NOT NULL,
    interval_ms bigint NOT NULL,
    min         double precision,
    max         double precision,
    last_number double precision,
    sum         double precision NOT NULL,
    good        bigint NOT NULL,
    bytes       bytea NOT NULL,
    crc         bytea NOT NULL,
    PRIMARY KEY (day, part, id),
    UNIQUE (day, part, signal, first, last, count, crc)
) PARTITION BY RANGE (day, part);
ALTER TABLE chunk ALTER COLUMN bytes SET STORAGE EXTERNAL;
CREATE TABLE tail (
    day   bigint NOT NULL,
    part  bigint NOT NULL,
    id    bigint NOT NULL DEFAULT nextval('history_row'),
    robot text COLLATE \"C\" NOT NULL,
    bytes bytea NOT NULL
) PARTITION BY RANGE (day, part);
ALTER TABLE tail ALTER COLUMN bytes SET STORAGE EXTERNAL;
CREATE INDEX ON tail (robot, id);
CREATE TABLE event (
    day   bigint NOT NULL,
    part  bigint NOT NULL,
    id    bigint NOT NULL DEFAULT nextval('history_row'),
    robot text COLLATE \"C\" NOT NULL,
    time  bigint NOT NULL,
    text  text NOT NULL,
    crc   bigint NOT NULL,
    hash  bytea NOT NULL,
    UNIQUE (day, part, robot, time, hash)
) PARTITION BY RANGE (day, part);
CREATE INDEX ON event (robot, time, id);
";

/// Commands with an `Idempotency-Key`. `intent`: the number of the entry of the audit log.
const COMMANDS: &str = "
CREATE TABLE command (
    id     bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    intent bigint NOT NULL UNIQUE,
    caller text NOT NULL,
    key    text NOT NULL,
    hash   bytea NOT NULL,
    made   bigint NOT NULL,
    answer text,
    UNIQUE (caller, key)
);
CREATE INDEX command_made ON command (made);
";

/// An owner for each robot. The gateways of an older r6 find the table no more and let go of the robots,
/// within 2 s after their last beat. No gateway takes one before, because this waits that long.
///
/// - `gateway`: a row for each start. `name` is where callers find it, `key` is what its passes are signed
///   with, `certificate` the SHA-256 of its certificate. Without `beat_at` it has ended.
/// - `owner`: the robot '', which no robot is called, stands for the hall. `address`: where the last owner
///   reached the robot.
const OWNERS: &str = "
LOCK TABLE owner IN ACCESS EXCLUSIVE MODE;
SELECT pg_sleep(CASE WHEN beat_at IS NULL THEN 0 ELSE 3.5 END) FROM owner;
DROP TABLE owner;
CREATE TABLE gateway (
    id          bigint PRIMARY KEY,
    name        text NOT NULL,
    key         text NOT NULL,
    certificate text,
    beat        bigint NOT NULL,
    beat_at     timestamptz
);
CREATE TABLE owner (
    robot   text COLLATE \"C\" PRIMARY KEY,
    fence   bigint NOT NULL,
    gateway bigint,
    address text COLLATE \"C\"
);
CREATE INDEX owner_gateway ON owner (gateway);
CREATE INDEX owner_address ON owner (address);
";

/// Grants of cameras. Those of a token go with it.
const CAMERAS: &str = "
CREATE TABLE camera (
    robot    text COLLATE \"C\" NOT NULL,
    camera   bigint NOT NULL,
    token    bigint NOT NULL,
    given_by text NOT NULL,
    given_at text NOT NULL,
    PRIMARY KEY (robot, camera, token)
);
";

/// What the file of each gateway says of the robots, as a hash: gateways with different files are told of it.
const FILES: &str = "
ALTER TABLE gateway ADD COLUMN file text;
";

/// Points by name. The text is bytes, as that of programs.
const POINTS: &str = "
CREATE TABLE point (
    name      text COLLATE \"C\" NOT NULL,
    version   bigint NOT NULL,
    hash      bytea NOT NULL,
    stored_at text NOT NULL,
    stored_by text NOT NULL,
    text      bytea NOT NULL,
    PRIMARY KEY (name, version)
);
";

/// What is read of a robot with other periods.
const GROUPS: &str = "
ALTER TABLE robot ADD COLUMN poll_groups text NOT NULL DEFAULT '[]';
";

/// What came later to what is kept of a robot, as one text, and when tokens end, in seconds since 1970.
const MORE: &str = "
ALTER TABLE robot ADD COLUMN more text NOT NULL DEFAULT '{}';
ALTER TABLE token ADD COLUMN expires bigint;
";

/// For lists of the runs of a robot.
const LISTS: &str = "
CREATE INDEX run_robot ON run (robot, id);
";

/// A token or a user may have a role for each robot in its text: an older r6 must not begin with such a
/// database.
const ROLES: &str = "";
