//! The captured exchanges, sent with `nc` as on a command line.

use std::io::Write;
use std::process::{Command, Stdio};

use r6_controller::Profile;
use r6_sim::VirtualController;

/// The output of `nc` for these bytes.
fn nc(port: u16, bytes: &str) -> String {
    let mut nc = Command::new("nc")
        .args(["-N", "-w", "10", "127.0.0.1", &port.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("nc runs: install it with `apt-get install netcat-openbsd`");
    nc.stdin.take().unwrap().write_all(bytes.as_bytes()).unwrap();
    String::from_utf8(nc.wait_with_output().unwrap().stdout).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_captured_replies_come_back_byte_for_byte() {
    // This is unit C's version. Its counters 4 and 8 do not exist: missing counters are left out.
    let profile = Profile::from_toml("version = \"HC-QC-RX-7.8.07-master-F5\"").unwrap();
    let robot = VirtualController::builder().profile(profile).start().await.unwrap();
    let port = robot.address().port();
    let exchanges = [
        (
            r#"{"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "query", "packID": "0", "queryAddr": ["version", "curMold"]}"#,
            r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["version","curMold"],"queryData":["HC-QC-RX-7.8.07-master-F5"],"reqType":"query"}"#,
        ),
        (
            r#"{"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "packID": "45", "cmdData": ["rewriteDataList", "800", "6", "0", "0", "0", "-300000", "0", "0", "0"]}"#,
            r#"{"cmdReply":["rewriteDataList","ok"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"45","reqType":"command"}"#,
        ),
        (
            r#"{"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "query", "packID": "900", "queryAddr": ["Addr-800", "Addr-801", "Addr-802", "Addr-803", "Addr-804", "Addr-805"]}"#,
            r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"900","queryAddr":["Addr-800","Addr-801","Addr-802","Addr-803","Addr-804","Addr-805"],"queryData":["0","0","-300000","0","0","0"],"reqType":"query"}"#,
        ),
        (
            r#"{"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "packID": "20", "cmdData": ["modifyCounter", "3", "0", "-1"]}"#,
            r#"{"cmdReply":["modifyCounter","ok"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"20","reqType":"command"}"#,
        ),
        (
            r#"{"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "packID": "1000", "cmdData": ["rewriteData", "800", "-456,754,826,179,0,-89", "0"]}"#,
            r#"{"cmdReply":["rewriteData","ok"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"1000","reqType":"command"}"#,
        ),
        (
            r#"{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","dsData":[{"camID":"0","data":[{"ModelID":"0","X":"888.001","Y":"1345.001","Z":"1000.001","U":"0.000","V":"0.000","Angel":"123.123","Similarity":"0","Color":"0","Rel":"0"}]}]}"#,
            r#"{"cmdReply":["AddPoints","1"],"dsID":"www.hc-system.com.cam","reqType":"AddPoints"}"#,
        ),
        (
            r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","packID":"7","emptyList":"1","instructions":[]}"#,
            r#"{"cmdReply":["AddRCC","ok"],"dsID":"www.hc-system.com.HCRemoteCommand","packID":"7","reqType":"AddRCC"}"#,
        ),
    ];
    for (request, reply) in exchanges {
        let got = tokio::task::spawn_blocking(move || nc(port, request)).await.unwrap();
        assert_eq!(got, reply);
    }
}
