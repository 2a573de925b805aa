//! Clients that mean harm, or are broken: they hurt no other client.

use std::net::Ipv4Addr;
use std::time::{Duration, Instant};

use r6_gateway::RawAllow;
use r6_sim::VirtualController;
use serde_json::json;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpSocket;

use super::{Raw, Script, query};
use crate::support::PATIENCE;

const READ: &[(&str, RawAllow)] = &[("127.0.0.0/8", RawAllow::Read)];

/// Waits until the metrics have this line.
async fn until_counted(raw: &Raw, line: &str) {
    let begun = Instant::now();
    loop {
        let metrics = raw.hall.get(&raw.hall.viewer, "/metrics").await;
        let metrics = metrics.as_str().unwrap().to_owned();
        if metrics.lines().any(|counted| counted == line) {
            return;
        }
        assert!(begun.elapsed() < PATIENCE, "{metrics}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

fn closed(cause: &str, count: u32) -> String {
    format!("r6_gateway_raw_closed_total{{robot=\"press\",cause=\"{cause}\"}} {count}")
}

/// What a browser sends if a web page posts a frame to the raw port.
#[tokio::test]
async fn a_web_page_moves_and_stops_nothing() {
    let raw =
        Raw::start(VirtualController::start().await.unwrap(), &[("127.0.0.0/8", RawAllow::Command)]).await;
    let body = r#"x{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"1","cmdData":["actionStop"]}"#;
    for head in [
        "POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nsec-ch-ua: \"Chromium\";v=\"130\"\r\nContent-Length: 103\r\n\r\n",
        "GET /{ HTTP/1.1\r\n\r\n",
    ] {
        let mut page = Script::from(2, raw.address()).await;
        let _ = page.stream.write_all([head, body].concat().as_bytes()).await;
        assert_eq!(page.reply().await, None);
    }
    until_counted(&raw, &closed("garbage", 2)).await;
    assert!(raw.tap.frames("command").is_empty(), "{:?}", raw.tap.frames("command"));
    assert_eq!(raw.hall.get(&raw.hall.viewer, "/v1/robots/press").await["stopped"], false);
}

#[tokio::test]
async fn broken_clients_hurt_no_other() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let mut honest = raw.script().await;
    // Half a frame, and then nothing.
    let mut half = Script::from(2, raw.address()).await;
    half.send(r#"{"reqType":"query","queryAddr":["curM"#).await;
    // A frame of 1 MB. The gateway closes before the end of it.
    let mut long = Script::from(3, raw.address()).await;
    let frame = [br#"{"reqType":"query","queryAddr":[""#.as_slice(), &vec![b'a'; 1 << 20]].concat();
    let _ = long.stream.write_all(&frame).await;
    // Garbage without end.
    let mut garbage = Script::from(4, raw.address()).await;
    let _ = garbage.stream.write_all("]x{]".repeat(4096).as_bytes()).await;
    // More requests than may wait.
    let mut many = Script::from(5, raw.address()).await;
    let _ = many.stream.write_all(query(&["curMode"]).repeat(64).as_bytes()).await;
    for _ in 0..20 {
        assert_eq!(honest.query("curMode Addr-810").await, ["7", "0"]);
    }
    for script in [&mut long, &mut garbage] {
        assert_eq!(script.reply().await, None);
    }
    while many.reply().await.is_some() {}
    until_counted(&raw, &closed("long_frame", 1)).await;
    until_counted(&raw, &closed("garbage", 1)).await;
    until_counted(&raw, &closed("too_many_requests", 1)).await;
    // The honest one and the half frame are left.
    until_counted(&raw, "r6_gateway_raw_clients{robot=\"press\"} 2").await;
    // It may still come to its end.
    half.send(r#"ode"]}"#).await;
    assert!(half.reply().await.unwrap().contains(r#""queryData":["7"]"#));
    assert_eq!(raw.tap.connections(), 1);
}

#[tokio::test]
async fn a_slow_reader_is_closed_and_the_others_go_on() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let mut honest = raw.script().await;
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let mut slow = Script::of(socket.connect(raw.address()).await.unwrap());
    let addresses: Vec<_> = (0..60).map(|number| format!("Addr-{}", 800 + number)).collect();
    let addresses: Vec<_> = addresses.iter().map(String::as_str).collect();
    let request = query(&addresses);
    let begun = Instant::now();
    // It sends one request after the other, and never reads.
    loop {
        if slow.stream.write_all(request.as_bytes()).await.is_err() {
            break;
        }
        // The query of the slow one went before, so its requests do not pile up.
        assert_eq!(honest.query("Addr-830").await, ["0"]);
        assert!(begun.elapsed() < PATIENCE);
    }
    until_counted(&raw, &closed("slow_reader", 1)).await;
    assert_eq!(honest.query("curMode").await, ["7"]);
}

#[tokio::test]
async fn the_seventeenth_client_is_not_let_in_and_one_that_leaves_makes_room() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let mut scripts = Vec::new();
    for number in 1..=16 {
        let mut script = Script::from(number, raw.address()).await;
        assert_eq!(script.query("curMode").await, ["7"]);
        scripts.push(script);
    }
    assert_eq!(raw.script().await.reply().await, None);
    until_counted(&raw, &closed("too_many_clients", 1)).await;
    for script in &mut scripts {
        assert_eq!(script.query("curMode").await, ["7"]);
    }
    drop(scripts.pop());
    until_counted(&raw, "r6_gateway_raw_clients{robot=\"press\"} 15").await;
    assert_eq!(raw.script().await.query("curMode").await, ["7"]);
}

#[tokio::test]
async fn one_address_takes_half_of_the_places_at_most() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let mut scripts = Vec::new();
    for _ in 1..=8 {
        let mut script = Script::from(2, raw.address()).await;
        assert_eq!(script.query("curMode").await, ["7"]);
        scripts.push(script);
    }
    assert_eq!(Script::from(2, raw.address()).await.reply().await, None);
    until_counted(&raw, &closed("too_many_clients", 1)).await;
    assert_eq!(Script::from(3, raw.address()).await.query("curMode").await, ["7"]);
    drop(scripts.pop());
    until_counted(&raw, "r6_gateway_raw_clients{robot=\"press\"} 7").await;
    assert_eq!(Script::from(2, raw.address()).await.query("curMode").await, ["7"]);
}

#[tokio::test]
async fn strangers_are_closed_counted_and_not_written_down() {
    let rules = [("127.0.0.3", RawAllow::Deny), ("127.0.0.2/31", RawAllow::Read)];
    let raw = Raw::start(VirtualController::start().await.unwrap(), &rules).await;
    let entries = raw.hall.audit().await.len();
    for stranger in [1, 3, 4] {
        let mut script = Script::from(stranger, raw.address()).await;
        let _ = script.stream.write_all(query(&["curMode"]).as_bytes()).await;
        assert_eq!(script.reply().await, None);
    }
    assert_eq!(Script::from(2, raw.address()).await.query("curMode").await, ["7"]);
    until_counted(&raw, &closed("denied", 3)).await;
    assert_eq!(raw.hall.audit().await.len(), entries);
}

#[tokio::test]
async fn new_rules_hold_at_once() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let mut script = raw.script().await;
    assert_eq!(script.query("curMode").await, ["7"]);
    raw.hall.gateway.set_raw_policy(super::policy(&[("127.0.0.1", RawAllow::Deny)]));
    // A client that asks for nothing is closed, too.
    assert_eq!(script.reply().await, None);
    until_counted(&raw, &closed("denied", 1)).await;
    // The audit log tells of the rules at the start, and of each change.
    let rules = raw.hall.until_audited(|entry| entry["rules"][0]["allow"] == "deny").await;
    let expected = json!([{ "source": "127.0.0.1", "only": null, "allow": "deny" }]);
    assert_eq!((&rules["what"], &rules["rules"]), (&json!("raw_rules"), &expected), "{rules}");
    raw.hall.gateway.set_raw_policy(super::policy(&[("127.0.0.1", RawAllow::Deny)]));
    raw.hall.gateway.set_raw_policy(super::policy(&[("127.0.0.9", RawAllow::Command)]));
    raw.hall.until_audited(|entry| entry["rules"][0]["source"] == "127.0.0.9").await;
    let audit = raw.hall.audit().await;
    let told = audit.iter().filter(|entry| entry["what"] == "raw_rules").count();
    assert_eq!(told, 3, "the same rules again are no change: {audit:#?}");
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn strangers_keep_no_refusal_of_a_known_source_from_the_audit_log() {
    let rules = [("127.0.0.2", RawAllow::Read)];
    let raw = Raw::start(VirtualController::start().await.unwrap(), &rules).await;
    // As many as refusals are remembered of all sources together.
    for number in 0..1_024_u16 {
        let [high, low] = number.to_be_bytes();
        let socket = TcpSocket::new_v4().unwrap();
        socket.bind((Ipv4Addr::new(127, 9, high, low), 0).into()).unwrap();
        drop(socket.connect(raw.address()).await.unwrap());
    }
    until_counted(&raw, &closed("denied", 1_024)).await;
    let mut script = Script::from(2, raw.address()).await;
    assert_eq!(script.command("startButton").await, "err this address may only read and stop");
    raw.hall.until_audited(|entry| entry["what"] == "refused" && entry["request"] == "startButton").await;
}
