//! The simplest possible server. It answers every query of twelve addresses with the same values, and reads
//! only the `packID`.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::thread;

use r6_proto::Address;

/// The addresses of the query: position of axes and tool, as for a viewer.
pub fn addresses() -> Vec<Address> {
    let axes = (0..6).map(|axis| format!("axis-{axis}"));
    let world = (0..6).map(|part| format!("world-{part}"));
    axes.chain(world).map(|name| name.parse().expect("an address")).collect()
}

/// The query of these addresses as the SDK sends it, except for its `packID`.
pub fn query_bytes() -> String {
    let names: Vec<String> = addresses().iter().map(|address| format!("\"{address}\"")).collect();
    format!(
        r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"10000","queryAddr":[{}]}}"#,
        names.join(",")
    )
}

/// The length of the reply to [`query_bytes`].
pub fn reply_length() -> usize {
    let mut reply = Vec::new();
    answer(query_bytes().as_bytes(), &mut reply);
    reply.len()
}

const HEAD: &[u8] = br#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":""#;
const TAIL: &[u8] = br#"","queryAddr":["axis-0","axis-1","axis-2","axis-3","axis-4","axis-5","world-0","world-1","world-2","world-3","world-4","world-5"],"queryData":["10.250000","-20.125000","30.500000","0.015400","-82.820000","0.018500","1500.035000","-125.633000","1461.035000","179.984000","0.805000","-179.992000"],"reqType":"query"}"#;

/// Starts the server of this row on a free port.
pub fn start() -> SocketAddr {
    listen(serve)
}

/// Listens on a free port until the process ends, with one thread for each connection.
pub fn listen(serve: fn(TcpStream)) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    thread::spawn(move || {
        for stream in listener.incoming() {
            let stream = stream.expect("a connection");
            thread::spawn(move || serve(stream));
        }
    });
    address
}

pub fn serve(mut stream: TcpStream) {
    stream.set_nodelay(true).expect("small frames leave at once");
    let mut input = vec![0; 1 << 16];
    let (mut filled, mut output) = (0, Vec::with_capacity(1 << 16));
    while let Ok(count @ 1..) = stream.read(&mut input[filled..]) {
        filled += count;
        output.clear();
        let taken = answer(&input[..filled], &mut output);
        input.copy_within(taken..filled, 0);
        filled -= taken;
        if stream.write_all(&output).is_err() {
            return;
        }
    }
}

/// Answers every complete query. Returns how many bytes the queries had.
pub fn answer(input: &[u8], output: &mut Vec<u8>) -> usize {
    let mut taken = 0;
    // A query is one object, and its texts contain no brace.
    while let Some(length) = input[taken..].iter().position(|byte| *byte == b'}') {
        output.extend_from_slice(HEAD);
        output.extend_from_slice(pack_id(&input[taken..taken + length]));
        output.extend_from_slice(TAIL);
        taken += length + 1;
    }
    taken
}

/// The digits after `"packID":"`.
fn pack_id(frame: &[u8]) -> &[u8] {
    const KEY: &[u8] = b"\"packID\":\"";
    let begin = frame.windows(KEY.len()).position(|part| part == KEY).map_or(0, |at| at + KEY.len());
    let digits = frame[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    &frame[begin..begin + digits]
}
