//! The words of the protocol and of the files, for the fuzzer's dictionary (`fuzz/words.dict`).

use std::collections::BTreeSet;
use std::fmt::Write as _;

use r6_proto::message::command::COMMANDS;
use r6_proto::{ADDRESSES, RequestType};

/// Words that are in no table of the code: keys, values, and the syntax of JSON, TOML and HTTP.
const MORE: &str = "dsID cmdType reqType packID queryAddr queryData cmdData cmdReply camID ret emptyList instructions dsData \
    data oneshot action m0 m1 m2 m3 m4 m5 m6 m7 m0_p m5_p ckStatus 0x3F 0x07 speed delay smooth tool coord isUse ioNumber \
    io_status type point limit isUnlimit cnt_id xpos ypos zpos upos vpos wpos ModelID X Y Z U V Angel Angle Rel Similarity \
    Color queryEcho cmdEcho AddrCC ok err www.hc-system.com.RemoteMonitor www.hc-system.com.cam HCRemoteCommand axis-0 \
    world-5 counter-2 Addr-800 M-1 null true false \\u0000 \\ud83d 1e308 -0.0 0.000001 \
    [[step]] [[instruction]] [[timeline]] [[reaction]] [[fault]] do to through seconds source until on off rising falling kind \
    set clear watch mm_per_s number board repeat append blend mask work_frame axis-move linear-move curve-move wait output \
    base name version port key_order reply_type counter_form max_connections action_stop_ms add_rcc_unarmed hc1 legacy \
    r6-host at every after spread chance from lasts remote register-follow tools benches stacks counters registers programs \
    mold mode auto stop manual spacing count target current \
    GET POST PUT DELETE HEAD OPTIONS %ff %00 %2F .. /v1/controllers /v1/controllers/1 /v1/controllers/2/actions /v1/controllers/1/programs/a /v1/openapi.json \
    Host: Origin: Sec-Fetch-Site: Content-Type: application/json localhost 127.0.0.1:9770 press turn_key jog home \
    emergency_stop release_emergency_stop clear_alarm raise_alarm set_input switch_program button start pause single_cycle \
    single_step key axis J1 by speed_percent X010 EUX010";

/// All words, each once, in order.
#[must_use]
pub fn all() -> Vec<Vec<u8>> {
    let mut words: BTreeSet<String> = MORE.split_whitespace().map(str::to_owned).collect();
    words.extend(RequestType::ALL.iter().map(|request| request.word().to_owned()));
    words.extend(COMMANDS.iter().map(|row| row.word.to_owned()));
    words.extend(ADDRESSES.iter().map(|row| row.name.to_owned()));
    words.into_iter().map(String::into_bytes).collect()
}

/// The dictionary in libFuzzer's format.
#[must_use]
pub fn dictionary() -> String {
    let mut text = "# Written by `cargo run -p r6-fuzz -- words`; a test says when it is old.\n".to_owned();
    for word in all() {
        let escaped: String = word
            .iter()
            .map(|byte| match byte {
                b'"' | b'\\' => format!("\\x{byte:02X}"),
                0x20..0x7F => char::from(*byte).to_string(),
                _ => format!("\\x{byte:02X}"),
            })
            .collect();
        let _ = writeln!(text, "\"{escaped}\"");
    }
    text
}
