//! A mixed stream of frames, and two ways to find them.

use r6_proto::frame::FrameBuffer;

/// The number of different frames in the stream: enough that a branch predictor cannot learn them.
pub const FRAMES: u32 = 1200;

/// Queries, replies, instruction lists and points in turn, each with different numbers.
pub fn stream() -> Vec<u8> {
    // A multiplicative generator: the same frames in every run.
    let mut state = 1_u64;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let mut decimal = move || {
        let sign = if random(2) == 0 { "" } else { "-" };
        format!("{sign}{}.{:06}", random(3000), random(1_000_000))
    };
    let mut stream = String::new();
    for number in 0..FRAMES {
        match number % 4 {
            0 => {
                let addresses: Vec<String> =
                    (0..6).map(|axis| format!("\"axis-{axis}\",\"world-{axis}\"")).collect();
                stream += &format!(
                    r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"{number}","queryAddr":[{}]}}"#,
                    addresses.join(",")
                );
            }
            1 => {
                let values: Vec<String> = (0..12).map(|_| format!("\"{}\"", decimal())).collect();
                stream += &format!(
                    r#"{{"dsID":"www.hc-system.com.RemoteMonitor","packID":"{number}","queryData":[{}],"reqType":"query"}}"#,
                    values.join(",")
                );
            }
            2 => {
                let axes: Vec<String> = (0..8).map(|axis| format!("\"m{axis}\":\"{}\"", decimal())).collect();
                stream += &format!(
                    r#"{{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","packID":"{number}","emptyList":"0","instructions":[{{"oneshot":"1","action":"4",{},"ckStatus":"0x3F","speed":"80.0","delay":"0.0","smooth":"3"}}]}}"#,
                    axes.join(",")
                );
            }
            _ => {
                let points: Vec<String> = (0..number % 7)
                    .map(|model| {
                        format!(
                            r#"{{"ModelID":{model},"X":{},"Y":{},"Angel":{}}}"#,
                            decimal(),
                            decimal(),
                            decimal()
                        )
                    })
                    .collect();
                stream += &format!(
                    r#"{{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","dsData":[{{"camID":{number},"data":[{}]}}]}}"#,
                    points.join(",")
                );
            }
        }
    }
    stream.into_bytes()
}

/// The result that both ways must find: the number of frames and their total length.
pub type Found = (u32, usize);

/// The floor: a loop over the bytes that tracks depth, strings and escapes. It has the whole stream and
/// checks nothing.
pub fn byte_loop(stream: &[u8]) -> Found {
    let (mut depth, mut in_string, mut escaped, mut begin) = (0_u32, false, false, 0);
    let mut found = (0, 0);
    for (at, &byte) in stream.iter().enumerate() {
        if in_string {
            if escaped {
                escaped = false;
            } else if byte == b'\\' {
                escaped = true;
            } else if byte == b'"' {
                in_string = false;
            }
            continue;
        }
        match byte {
            b'"' => in_string = true,
            b'{' | b'[' => {
                if depth == 0 {
                    begin = at;
                }
                depth += 1;
            }
            b'}' | b']' => {
                depth -= 1;
                if depth == 0 {
                    found = (found.0 + 1, found.1 + at + 1 - begin);
                }
            }
            _ => {}
        }
    }
    found
}

pub fn in_pieces(buffer: &mut FrameBuffer, stream: &[u8], piece: usize) -> Found {
    let mut found = (0, 0);
    for mut bytes in stream.chunks(piece) {
        while !bytes.is_empty() {
            let taken = buffer.push(bytes);
            bytes = &bytes[taken..];
            while let Some(next) = buffer.next() {
                let length = next.expect("the stream has no fault").bytes.len();
                found = (found.0 + 1, found.1 + length);
            }
        }
    }
    found
}
