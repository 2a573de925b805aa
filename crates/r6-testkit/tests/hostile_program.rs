//! Tests the program `r6-hostile`, as tests in other languages use it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

/// A hostile controller in a separate process. It ends when its input ends.
struct Program {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Program {
    fn start(character: &Value) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_r6-hostile"))
            .arg(character.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
        Self { child, input, output }
    }

    fn line(&mut self) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap()
    }

    fn tell(&mut self, line: &str) -> Value {
        writeln!(self.input, "{line}").unwrap();
        self.line()
    }
}

/// Sends one request, and reads the reply up to its last brace.
fn ask(stream: &mut TcpStream, request: &Value) -> Value {
    stream.write_all(request.to_string().as_bytes()).unwrap();
    let mut reply = Vec::new();
    loop {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        reply.push(byte[0]);
        if let Ok(value) = serde_json::from_slice(&reply) {
            return value;
        }
    }
}

#[test]
fn it_serves_a_port_and_obeys_lines() {
    let mut program = Program::start(
        &json!({ "cabinet": { "name": "press" }, "stops": { "action_stop": { "effect": "refused" } } }),
    );
    let port = u16::try_from(program.line()["port"].as_u64().unwrap()).unwrap();
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let name = ask(&mut stream, &json!({ "reqType": "query", "queryAddr": ["machineName"] }));
    assert_eq!(name["queryData"], json!(["press"]));
    let refused = ask(&mut stream, &json!({ "reqType": "command", "cmdData": ["actionStop"] }));
    assert_eq!(refused["cmdReply"], json!(["actionStop", "err"]));
    assert_eq!(program.tell("position")[0], 0.0);
    let far = json!([{ "action": "4", "m0": "3000", "ckStatus": "0x01" }]);
    assert_eq!(program.tell(&format!("foreign-list {far}")), json!({ "ok": true }));
    assert_eq!(program.tell("carried")[0]["ended"], Value::Null);
    assert_eq!(program.tell("foreign-clear"), json!({ "ok": true }));
    let log = program.tell("log");
    let did: Vec<_> = log.as_array().unwrap().iter().map(|entry| entry["did"].as_str().unwrap()).collect();
    assert_eq!(did, ["opened", "told", "refused", "took", "cleared"]);
    assert!(program.tell("path 0")[0].as_f64().unwrap() >= 0.0);
    assert!(program.tell("now")["now"].as_f64().unwrap() > 0.0);
    assert_eq!(program.tell("swap"), json!({ "ok": true }));
    assert_eq!(stream.read(&mut [0]).unwrap(), 0, "the connection has ended");
    assert!(program.tell("fly")["problem"].is_string());
    assert_eq!(program.tell("quit"), json!({ "ok": true }));
    assert!(program.child.wait().unwrap().success());
}

#[test]
fn a_character_that_cannot_be_read_ends_it() {
    let mut program = Program::start(&json!({ "dwel": 1 }));
    assert!(!program.child.wait().unwrap().success());
}
