//! `r6 sim --state` is killed at random moments while clients write. Nothing that was acknowledged is lost,
//! and no file is ever half written.
//!
//! For more power cuts: `R6_POWER_CUTS=10000 cargo nextest run -p r6 power_cut`. `R6_SEED=7` changes the
//! moments.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

use r6_controller::SavedState;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Running, r6};

/// How many times an ordinary run of the tests cuts the power.
const POWER_CUTS: u64 = 1000;

/// The timeout: long enough for a loaded machine and a slow disk.
const PATIENCE: Duration = Duration::from_secs(30);

/// The most that one client writes between two power cuts.
const MOST_WRITES: u64 = 150;

/// Reads a number from the environment.
fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

/// Seeded random numbers (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

/// A value that survives a power cut, by its place in the file: `/registers/800`.
type Place = String;

/// The values that a place may hold: the last acknowledged value, or a value that was sent after it.
#[derive(Debug, Default)]
struct Written {
    acknowledged: Option<Value>,
    sent: Vec<Value>,
}

/// A client that writes only to its own places.
struct Writer {
    number: u64,
    stream: TcpStream,
    /// Writes that were sent and are not acknowledged yet, in order.
    pending: Vec<(Place, Value)>,
    received: Vec<u8>,
    acknowledged: usize,
}

impl Writer {
    fn connect(number: u64, address: &str) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        Self { number, stream, pending: Vec::new(), received: Vec::new(), acknowledged: 0 }
    }

    /// Sends one write of a value that survives a power cut.
    fn write(&mut self, random: &mut Random) {
        let value = random.below(1_000_000);
        let number = self.number;
        let (place, value, words) = match random.below(4) {
            0 => {
                let register = 800 + number * 10 + random.below(5);
                let words = format!(r#""rewriteData","{register}","{value}","1""#);
                (format!("/registers/{register}"), Value::from(value), words)
            }
            1 => {
                // The counters that a controller has.
                let counter = [0, 2][usize::from(number > 0)];
                let words = format!(r#""modifyCounter","{counter}","{value}","-1""#);
                (format!("/counters/{counter}/current"), Value::from(value), words)
            }
            2 => {
                let words =
                    format!(r#""modifyTool","{}","{}","0","0","0","0","0""#, number + 1, value * 1000);
                (
                    format!("/tools/{}/0", number + 1),
                    Value::from(f64::from(u32::try_from(value).unwrap())),
                    words,
                )
            }
            _ => {
                let words = format!(r#""modifyStackData","{number}","1","2","3","{value}","1","1""#);
                (format!("/stacks/{number}/count/0"), Value::from(value), words)
            }
        };
        let frame = format!(r#"{{"reqType":"command","cmdData":[{words}]}}"#);
        if self.stream.write_all(frame.as_bytes()).is_ok() {
            self.pending.push((place, value));
        }
    }

    /// Reads once. Returns false at the end of the connection.
    fn read(&mut self) -> bool {
        let mut bytes = [0; 4096];
        let Ok(count @ 1..) = self.stream.read(&mut bytes) else { return false };
        self.received.extend_from_slice(&bytes[..count]);
        // Each write has a reply of one JSON object, without inner braces.
        self.acknowledged = self.received.iter().filter(|byte| **byte == b'}').count();
        true
    }

    /// Records what is known now about the places of this client.
    fn settle(self, places: &mut BTreeMap<Place, Written>) {
        let replies = String::from_utf8(self.received).unwrap();
        assert!(!replies.contains("err"), "{replies}");
        for (index, (place, value)) in self.pending.into_iter().enumerate() {
            let written = places.entry(place).or_default();
            if index < self.acknowledged {
                written.acknowledged = Some(value);
                written.sent.clear();
            } else {
                written.sent.push(value);
            }
        }
    }
}

/// Waits a few microseconds without yielding the processor, so that the moment of the power cut is exact.
fn spin(time: Duration) {
    let start = Instant::now();
    while start.elapsed() < time {
        std::hint::spin_loop();
    }
}

/// Compares the state on disk with what was written, and takes the state on disk as the new base.
fn check(folder: &Path, places: &mut BTreeMap<Place, Written>, context: &str) {
    let names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !["lock", "controller-1.json", "controller-1.json.new"].contains(&name.as_str()))
        .collect();
    assert!(names.is_empty(), "{context}: {names:?}");
    let file = folder.join("controller-1.json");
    let state = if file.exists() {
        let text = std::fs::read_to_string(file).unwrap();
        SavedState::from_json(&text).unwrap_or_else(|error| panic!("{context}: {error} in {text}"));
        serde_json::from_str(&text).unwrap()
    } else {
        Value::Null
    };
    for (place, written) in places {
        let found = state.pointer(place).cloned();
        let fits = found == written.acknowledged
            || found.as_ref().is_some_and(|found| written.sent.contains(found))
            // A counter that was never written exists with the value 0.
            || (written.acknowledged.is_none() && found == Some(Value::from(0)));
        assert!(fits, "{context}: {place}: {found:?} is there, of {written:?}");
        *written = Written { acknowledged: found, sent: Vec::new() };
    }
}

/// Asks the restarted controller for the values on disk.
fn ask(address: &str, places: &BTreeMap<Place, Written>, context: &str) {
    let mut known: Vec<(String, Value)> = Vec::new();
    for (place, written) in places {
        let Some(value) = &written.acknowledged else { continue };
        if let Some(register) = place.strip_prefix("/registers/") {
            known.push((format!("Addr-{register}"), value.clone()));
        }
    }
    let mut arguments = vec!["-r", address, "query", "--json", "curMode", "Addr-890"];
    arguments.extend(known.iter().map(|(address, _)| address.as_str()));
    let values = r6(&arguments).json()["values"].clone();
    assert_eq!(values["Addr-890"], 0, "{context}: it is not savable");
    for (address, value) in known {
        assert_eq!(values[&address], value, "{context}: {address}");
    }
}

#[test]
fn a_power_cut_at_any_moment_loses_nothing_that_was_acknowledged() {
    let folder = TempDir::new().unwrap();
    let (cuts, seed) = (setting("R6_POWER_CUTS", POWER_CUTS), setting("R6_SEED", 1));
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut places = BTreeMap::new();
    let mut acknowledged = 0;
    for cut in 0..cuts {
        let mut context = String::new();
        write!(context, "seed {seed}, power cut {cut}").unwrap();
        let mut sim =
            Running::start(&["sim", "--listen", "127.0.0.1:0", "--state", folder.path().to_str().unwrap()]);
        let address = sim.line().strip_prefix("listening on ").expect(&context).to_owned();
        ask(&address, &places, &context);
        let mut writers = [0, 1].map(|number| Writer::connect(number, &address));
        let frame = br#"{"reqType":"command","cmdData":["rewriteData","890","5","0"]}"#;
        TcpStream::connect(&address).unwrap().write_all(frame).unwrap();
        for _ in 0..random.below(MOST_WRITES) {
            writers.iter_mut().for_each(|writer| writer.write(&mut random));
        }
        let wanted = usize::try_from(random.below(MOST_WRITES)).unwrap().min(writers[0].pending.len());
        while writers[0].acknowledged < wanted {
            assert!(writers[0].read(), "{context}");
        }
        spin(Duration::from_micros(random.below(3000)));
        sim.kill();
        for mut writer in writers {
            while writer.read() {}
            acknowledged += writer.acknowledged;
            writer.settle(&mut places);
        }
        check(folder.path(), &mut places, &context);
    }
    assert!(acknowledged > 0, "seed {seed}: nothing was ever acknowledged");
    println!("{cuts} power cuts, {acknowledged} acknowledged writes, none lost");
}
