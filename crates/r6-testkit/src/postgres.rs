//! PostgreSQL servers of tests, each in a temporary folder, behind a socket there.
//!
//! [`shared`] is one server for all tests of a run, also if each test is a process of its own, as with
//! cargo-nextest. It ends with the run. [`Server::own`] is one for a single test, which may kill it. A server
//! refuses to run as root; then it runs as another user.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{DirBuilderExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// If this is set, tests that need a server are left out, and say so.
pub const LEFT_OUT: &str = "R6_WITHOUT_POSTGRES";

/// How long a server may take to start: it takes a second, and more on a machine that is busy.
const START: Duration = Duration::from_secs(60);

/// The user of the database.
const USER: &str = "r6";

/// The settings of all servers. `unix_socket_directories` is where the tests find them.
const SETTINGS: &[&str] = &[
    "listen_addresses=",
    "max_connections=200",
    "shared_buffers=16MB",
    "wal_level=minimal",
    "max_wal_senders=0",
    "jit=off",
];

/// A server.
#[derive(Debug)]
pub struct Server {
    folder: PathBuf,
    bin: PathBuf,
    is_durable: bool,
    /// What ends the server when this process ends; `None` for the shared one.
    guard: Option<Child>,
}

/// Runs with the server and ends it: at the end of its input, or of the process with the number `$2`. Then it
/// removes the folder, `$1`, unless the server is to be started again there.
const GUARD: &str = r#"folder=$1; run=$2; shift 2
"$@" >>"$folder/log" 2>&1 </dev/null & server=$!
if [ "$run" = input ]; then read -r _; else while kill -0 "$run" 2>/dev/null; do sleep 0.3; done; fi
kill -QUIT "$server" 2>/dev/null
wait "$server"
[ -e "$folder/keep" ] || rm -rf "$folder""#;

/// The server of this run of tests, which is started if it is not there. `None` without PostgreSQL if
/// [`LEFT_OUT`] is set.
///
/// A power cut would break it: it synchronises nothing.
///
/// # Panics
/// There is no PostgreSQL, or it does not start.
pub fn shared(test: &str) -> Option<Server> {
    let bin = found(test)?;
    // With nextest each test is a process, and all have the same parent.
    let run = match std::env::var_os("NEXTEST") {
        Some(_) => std::os::unix::process::parent_id(),
        None => std::process::id(),
    };
    let folder = std::env::temp_dir().join(format!("r6-postgres-{run}"));
    make_folder(&folder);
    let lock = File::create(folder.join("lock")).expect("the folder of the server is ours");
    lock.lock().expect("the folder can be locked");
    let mut server = Server { folder, bin, is_durable: false, guard: None };
    if !server.folder.join("data").exists() {
        server.initialise();
        let guard = server.guarded(&run.to_string()).process_group(0).stdin(Stdio::null()).spawn();
        drop(guard.expect("a shell starts"));
    }
    server.wait();
    Some(server)
}

/// Where the programs of PostgreSQL are. Without them the test fails, or is left out if that is wanted.
fn found(test: &str) -> Option<PathBuf> {
    if let Some(bin) = programs() {
        return Some(bin);
    }
    assert!(
        std::env::var_os(LEFT_OUT).is_some(),
        "{test} needs a PostgreSQL server (Debian: apt-get install postgresql); {LEFT_OUT}=1 leaves out what \
         needs one"
    );
    eprintln!("NOT CHECKED: {test} needs a PostgreSQL server, and {LEFT_OUT} is set");
    None
}

/// The folder with `initdb` and `postgres`: that of Debian with the highest version, or one of `PATH`.
fn programs() -> Option<PathBuf> {
    let versions = fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    let mut versions: Vec<_> = versions.map(|version| version.path().join("bin")).collect();
    versions.sort();
    versions.reverse();
    let path = std::env::var_os("PATH").unwrap_or_default();
    versions.into_iter().chain(std::env::split_paths(&path)).find(|bin| {
        ["initdb", "postgres", "createdb", "psql"].iter().all(|program| bin.join(program).is_file())
    })
}

fn make_folder(folder: &Path) {
    match fs::DirBuilder::new().mode(0o711).create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            panic!("{}: {error}", folder.display())
        }
        Ok(()) | Err(_) => {}
    }
}

/// The user and group that a server runs as, if this process is root.
fn server_user() -> Option<(u32, u32)> {
    // The owner of what a process makes is its user.
    let own = std::os::unix::fs::MetadataExt::uid(&fs::metadata("/proc/self").ok()?);
    let users = fs::read_to_string("/etc/passwd").ok().filter(|_| own == 0)?;
    let of = |name: &str| {
        let line = users.lines().find(|line| line.split(':').next() == Some(name))?;
        let mut numbers = line.split(':').skip(2).map(str::parse);
        Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
    };
    of("postgres").or_else(|| of("nobody"))
}

impl Server {
    /// A server for one test, with all that it needs to survive that it is killed. `None` as with [`shared`].
    ///
    /// # Panics
    /// As [`shared`].
    pub fn own(test: &str) -> Option<Self> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let bin = found(test)?;
        let number = NUMBER.fetch_add(1, Ordering::SeqCst);
        let name = format!("r6-postgres-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        make_folder(&folder);
        let mut server = Self { folder, bin, is_durable: true, guard: None };
        server.initialise();
        server.start();
        Some(server)
    }

    /// Makes a database. Returns its URL.
    ///
    /// # Panics
    /// The server does not answer.
    pub fn database(&self) -> String {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let name = format!("t{}_{}", std::process::id(), NUMBER.fetch_add(1, Ordering::SeqCst));
        let made = self.client("createdb").arg(&name).output().expect("createdb starts");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        format!("postgres:///{name}?host={}&user={USER}", self.folder.display())
    }

    /// Does something in a database that [`Self::database`] made, and returns what it prints.
    ///
    /// # Panics
    /// It fails.
    pub fn sql(&self, url: &str, text: &str) -> String {
        let name = url.trim_start_matches("postgres:///").split('?').next().unwrap_or_default();
        let done = self.client("psql").args(["-qAtX", "-v", "ON_ERROR_STOP=1", "-c", text, name]).output();
        let done = done.expect("psql starts");
        assert!(done.status.success(), "{text}: {}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8_lossy(&done.stdout).trim().to_owned()
    }

    /// Kills the server with SIGKILL, as a crash.
    ///
    /// # Panics
    /// It does not run.
    pub fn kill(&mut self) {
        let file = fs::read_to_string(self.folder.join("data/postmaster.pid")).expect("the server runs");
        let pid = file.lines().next().expect("the file has the number of the process");
        File::create(self.folder.join("keep")).expect("the folder is ours");
        signal("KILL", pid);
        self.end();
    }

    /// Starts the server, after [`Self::kill`] too.
    ///
    /// # Panics
    /// It does not start.
    pub fn start(&mut self) {
        let (begun, keep) = (Instant::now(), self.folder.join("keep"));
        File::create(&keep).expect("the folder is ours");
        loop {
            self.end();
            // After a crash, the last processes of the server may take a moment to end.
            let guard = self.guarded("input").stdin(Stdio::piped()).spawn().expect("a shell starts");
            self.guard = Some(guard);
            if self.answers_within(Duration::from_secs(5)) {
                fs::remove_file(&keep).expect("nothing else removes it");
                return;
            }
            assert!(begun.elapsed() < START, "the server does not start: {}", self.log());
        }
    }

    /// Waits for the end of the shell that ends the server.
    fn end(&mut self) {
        if let Some(mut guard) = self.guard.take() {
            // The end of its input.
            drop(guard.stdin.take());
            let _ = guard.wait();
        }
    }

    fn initialise(&mut self) {
        if let Some((user, group)) = server_user() {
            chown(&self.folder, Some(user), Some(group)).expect("root gives the folder away");
        }
        let mut initdb = self.as_server(&self.bin.join("initdb"));
        initdb.args(["--no-sync", "--no-instructions", "--auth=trust", "--encoding=UTF8", "--locale=C"]);
        initdb.args(["--username", USER, "--pgdata"]).arg(self.folder.join("data"));
        let done = initdb.output().expect("initdb starts");
        assert!(done.status.success(), "initdb: {}", String::from_utf8_lossy(&done.stderr));
    }

    /// The command of the server within the shell that ends it.
    fn guarded(&self, run: &str) -> Command {
        let log = self.folder.join("log");
        if !log.exists() {
            File::create(&log).expect("the log can be made");
            fs::set_permissions(&log, fs::Permissions::from_mode(0o666)).expect("the log is ours");
        }
        let mut server = self.as_server(&self.bin.join("postgres"));
        server.arg("-D").arg(self.folder.join("data"));
        server.arg("-c").arg(format!("unix_socket_directories={}", self.folder.display()));
        server.args(SETTINGS.iter().flat_map(|setting| ["-c", setting]));
        if !self.is_durable {
            server.args(["-c", "fsync=off", "-c", "full_page_writes=off"]);
        }
        let mut shell = Command::new("sh");
        shell.args(["-c", GUARD, "guard"]).arg(&self.folder).arg(run);
        shell.arg(server.get_program()).args(server.get_args());
        shell.stdout(Stdio::null()).stderr(Stdio::null());
        shell
    }

    /// A program that runs as the user of the server.
    fn as_server(&self, program: &Path) -> Command {
        let mut command = match server_user() {
            Some((user, group)) => {
                let mut command = Command::new("setpriv");
                command.args(["--clear-groups", "--reuid", &user.to_string(), "--regid", &group.to_string()]);
                command.arg(program);
                command
            }
            None => Command::new(program),
        };
        command.current_dir(&self.folder).env("LC_ALL", "C");
        command
    }

    /// A program that connects to the server.
    fn client(&self, program: &str) -> Command {
        let mut command = Command::new(self.bin.join(program));
        command.arg("-h").arg(&self.folder).args(["-U", USER]).current_dir("/");
        command
    }

    fn answers_within(&self, time: Duration) -> bool {
        let begun = Instant::now();
        while begun.elapsed() < time {
            let asked = self.client("psql").args(["-qAtX", "-c", "SELECT 1", "postgres"]).output();
            if asked.is_ok_and(|asked| asked.status.success()) {
                return true;
            }
            sleep(Duration::from_millis(50));
        }
        false
    }

    fn wait(&self) {
        assert!(self.answers_within(START), "the server does not start: {}", self.log());
    }

    fn log(&self) -> String {
        fs::read_to_string(self.folder.join("log")).unwrap_or_default()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end();
    }
}

/// Sends a signal, such as `KILL`, `STOP` or `CONT`, to a process.
///
/// # Panics
/// There is no such process.
pub fn signal(name: &str, pid: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), pid]).status().expect("kill starts");
    assert!(sent.success(), "there is no process {pid}");
}
