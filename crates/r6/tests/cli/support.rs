//! Runs the built binary, and virtual controllers for it.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::sync::Arc;

use r6_testkit::hostile::Character;
use r6_testkit::hostile::serve::HostileController;

/// The result of a run of r6.
#[derive(Debug)]
pub struct Outcome {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Outcome {
    /// stdout as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    /// The last line of stdout.
    pub fn last_line(&self) -> &str {
        self.out.lines().next_back().unwrap_or_default()
    }
}

/// The binary, without the tester's terminal and environment. `R6_BINARY` names another one, such as that of
/// a release.
fn command(args: &[&str]) -> Command {
    let binary = std::env::var_os("R6_BINARY").unwrap_or_else(|| env!("CARGO_BIN_EXE_r6").into());
    let mut command = Command::new(binary);
    command
        .args(args)
        .env_remove("R6_ROBOT")
        .env_remove("R6_PANEL")
        .env_remove("R6_TOKEN")
        .env_remove("RUST_LOG")
        .env_remove("R6_LOG_FORMAT")
        .env("COLUMNS", "110")
        // Few threads, as on a small machine, so that a blocked thread is noticed.
        .env("TOKIO_WORKER_THREADS", "2")
        .current_dir(root());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The root of the repository.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Runs r6 to its end.
pub fn r6(args: &[&str]) -> Outcome {
    outcome(command(args).output().unwrap())
}

/// An output that cannot be written: the device is always full.
pub fn full() -> Stdio {
    std::fs::File::options().write(true).open("/dev/full").unwrap().into()
}

/// A pipe whose reader has ended.
pub fn broken() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

/// Runs r6 to its end with this stdout and stderr. `None` is a pipe that the test reads.
pub fn r6_onto(args: &[&str], out: Option<Stdio>, err: Option<Stdio>) -> Outcome {
    let mut command = command(args);
    command.stdout(out.unwrap_or_else(Stdio::piped)).stderr(err.unwrap_or_else(Stdio::piped));
    outcome(command.output().unwrap())
}

/// Runs a shell line to its end. The line calls r6 as `"$R6"`.
pub fn shell(line: &str, args: &[&str]) -> Outcome {
    let mut shell = Command::new("sh");
    shell.args(["-c", line, "sh"]).args(args).env("R6", env!("CARGO_BIN_EXE_r6")).current_dir(root());
    outcome(shell.stdin(Stdio::null()).output().unwrap())
}

/// Runs r6 to its end with this input on stdin.
pub fn r6_with_input(args: &[&str], input: &[u8]) -> Outcome {
    let mut child = command(args).stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    outcome(child.wait_with_output().unwrap())
}

fn outcome(output: std::process::Output) -> Outcome {
    Outcome {
        code: output.status.code().unwrap_or(-1),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// A run of r6 that lasts until the test ends it.
pub struct Running {
    child: Child,
    /// `None` if stdout is not a pipe, or if the test closed its end.
    out: Option<BufReader<ChildStdout>>,
}

impl Running {
    /// Starts r6.
    pub fn start(args: &[&str]) -> Self {
        Self::of(command(args).stderr(Stdio::null()))
    }

    /// Starts r6 with another stdout.
    pub fn start_with_stdout(args: &[&str], out: impl Into<Stdio>) -> Self {
        Self::of(command(args).stderr(Stdio::null()).stdout(out))
    }

    /// Starts r6 with a limit of open files.
    pub fn start_with_few_files(files: u32, args: &[&str]) -> Self {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit -n {files}; exec \"$R6\" \"$@\""), "sh"]).args(args);
        shell
            .env("R6", env!("CARGO_BIN_EXE_r6"))
            .env("TOKIO_WORKER_THREADS", "2")
            .env_remove("RUST_LOG")
            .env_remove("R6_LOG_FORMAT");
        Self::of(shell.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).current_dir(root()))
    }

    /// Starts a script in this shell. It finds r6 as `$R6`, and the arguments as its own.
    pub fn start_script(shell: &str, script: &str, args: &[&str]) -> Self {
        let mut words = shell.split(' ');
        let mut shell = Command::new(words.next().unwrap());
        shell.args(words).args([script, "sh"]).args(args);
        shell.env("R6", env!("CARGO_BIN_EXE_r6")).env("TOKIO_WORKER_THREADS", "2").env_remove("RUST_LOG");
        Self::of(shell.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()))
    }

    fn of(command: &mut Command) -> Self {
        let mut child = command.spawn().unwrap();
        let out = child.stdout.take().map(BufReader::new);
        Self { child, out }
    }

    /// Starts r6 with a stdin that the test can write to, and a stderr that the test need not read.
    pub fn start_with_pipes(args: &[&str]) -> Self {
        Self::of(command(args).stdin(Stdio::piped()))
    }

    /// The same with this variable in its environment.
    pub fn start_with_variable(name: &str, value: &str, args: &[&str]) -> Self {
        Self::of(command(args).stdin(Stdio::piped()).env(name, value))
    }

    /// Closes the reading end of its stdout. From now on it cannot write there.
    pub fn close_stdout(&mut self) {
        drop(self.out.take());
    }

    /// Writes a line to its stdin.
    pub fn say(&mut self, line: &str) {
        writeln!(self.child.stdin.as_mut().unwrap(), "{line}").unwrap();
    }

    /// Closes its stdin and returns its stderr.
    pub fn close_stdin(&mut self) -> BufReader<ChildStderr> {
        drop(self.child.stdin.take());
        BufReader::new(self.child.stderr.take().unwrap())
    }

    /// The next line of stdout; empty at the end.
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.out.as_mut().unwrap().read_line(&mut line).unwrap();
        line.trim_end().to_owned()
    }

    /// The rest of its stdout, to the end.
    pub fn rest(&mut self) -> String {
        let mut rest = String::new();
        self.out.as_mut().unwrap().read_to_string(&mut rest).unwrap();
        rest
    }

    /// The number of its process.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Kills it, as a power cut would.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits for its end and returns the exit code.
    pub fn code(mut self) -> Option<i32> {
        self.child.wait().unwrap().code()
    }

    /// Sends a signal (`INT`, `TERM`).
    pub fn signal(&self, signal: &str) {
        let sent = Command::new("kill").args([&format!("-{signal}"), &self.child.id().to_string()]).status();
        assert!(sent.unwrap().success());
    }

    /// Sends a signal and returns the exit code.
    pub fn end(self, signal: &str) -> Option<i32> {
        self.signal(signal);
        self.code()
    }

    /// The JSON object on the next line of stdout; `None` at the end.
    pub fn event(&mut self) -> Option<serde_json::Value> {
        let line = self.line();
        if line.is_empty() {
            return None;
        }
        Some(serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}")))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A virtual controller on a free port.
pub struct Robot {
    _running: Running,
    address: String,
}

impl Robot {
    /// Starts a virtual controller with further arguments for `r6 sim`.
    pub fn start(args: &[&str]) -> Self {
        let mut running = Running::start(&[&["sim", "--listen", "127.0.0.1:0"], args].concat());
        let line = running.line();
        let address = line.strip_prefix("listening on ").unwrap_or_else(|| panic!("{line}")).to_owned();
        Self { _running: running, address }
    }

    /// Where it listens.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Runs r6 for this robot.
    pub fn r6(&self, args: &[&str]) -> Outcome {
        r6(&[&["-r", self.address()], args].concat())
    }

    /// The value of one query address.
    pub fn value(&self, address: &str) -> serde_json::Value {
        self.r6(&["query", address, "--json"]).json()["values"][address].clone()
    }
}

/// Starts a misbehaving controller on a free port, until the test ends. Returns its address.
pub fn hostile(character: Character) -> (String, Arc<HostileController>) {
    let (tell, told) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let controller = HostileController::new(character);
            let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
            tell.send((listener.local_addr().unwrap().to_string(), Arc::clone(&controller))).unwrap();
            controller.listen(listener).await
        })
    });
    told.recv().unwrap()
}

/// A file for one test, removed at its end.
pub struct TempFile(PathBuf);

impl TempFile {
    /// Writes a file of this name, which has to be unique among the tests.
    pub fn new(name: &str, text: &str) -> Self {
        let path = std::env::temp_dir().join(format!("r6-test-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        Self(path)
    }

    /// Its path.
    pub fn path(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for TempFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
