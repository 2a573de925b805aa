//! The cases: the frames, and the functions of each contender that read and write them.

use r6_proto::dialect::{Addressing, Dialect};
use r6_proto::message::{Body, Message};
use r6_proto::reply::ReplyWriter;
use r6_proto::request::CameraPoints;
use r6_proto::{Address, Decoder, Request, RequestType};
use serde::Serialize;

use super::others::{
    AddPointsFrame, AddRccFrame, Camera, QueryFrame, Quoted, ReplyFrame, Summed, by_serde_json, by_sonic_rs,
    part, step,
};
use super::samples::{FRAMES, Samples, decoded};

const MONITOR: &str = "www.hc-system.com.RemoteMonitor";
const REMOTE_COMMAND: &str = "www.hc-system.com.HCRemoteCommand";
const CAMERA: &str = "www.hc-system.com.cam";

/// Reads the frame with this number and returns the sum of its values.
pub type Read = Box<dyn FnMut(usize) -> f64>;

/// Appends the frame with this number.
pub type Write = Box<dyn FnMut(usize, &mut Vec<u8>)>;

/// One kind of frame, in [`FRAMES`] examples. The contenders are `r6`, serde_json and sonic-rs, in this
/// order.
pub struct Case {
    /// Its name.
    pub name: String,
    /// One function for each contender.
    pub decode: [Read; 3],
    /// One function for each contender.
    pub encode: [Write; 3],
}

/// All cases. Before they are returned, all contenders must agree on every frame, both in reading and in
/// writing.
pub fn all() -> Vec<Case> {
    let mut cases = vec![query(), reply(), add_rcc(1), add_rcc(50), add_points()];
    for case in &mut cases {
        for at in 0..FRAMES {
            let [ours, theirs @ ..] = case.decode.each_mut().map(|read| read(at));
            for theirs in theirs {
                // serde_json can differ by one unit in the last place of long decimals.
                assert!(
                    (ours - theirs).abs() <= 1e-9 * ours.abs().max(1.0),
                    "{}: {ours} {theirs}",
                    case.name
                );
            }
            let [ours, theirs @ ..] = case.encode.each_mut().map(|write| {
                let mut out = Vec::new();
                write(at, &mut out);
                String::from_utf8(out).expect("UTF-8")
            });
            for theirs in theirs {
                assert_eq!(ours, theirs, "{}", case.name);
            }
        }
    }
    cases
}

/// The case of these frames. They live as long as the process, because there are only five such cases.
fn case<T: Serialize + 'static>(
    name: &str,
    ours: impl Fn(usize, &mut Vec<u8>) + 'static,
    theirs: Vec<T>,
    [serde_json, sonic_rs]: [fn(&'static [u8]) -> f64; 2],
) -> Case {
    let frames: Vec<Vec<u8>> = (0..FRAMES)
        .map(|at| {
            let mut out = Vec::new();
            ours(at, &mut out);
            out
        })
        .collect();
    let (frames, theirs): (&'static [Vec<u8>], &'static [T]) = (frames.leak(), theirs.leak());
    let mut decoder = Decoder::new();
    Case {
        name: name.to_owned(),
        decode: [
            Box::new(move |at| decoded(&mut decoder, &frames[at])),
            Box::new(move |at| serde_json(&frames[at])),
            Box::new(move |at| sonic_rs(&frames[at])),
        ],
        encode: [
            Box::new(ours),
            Box::new(move |at, out| serde_json::to_writer(out, &theirs[at]).expect("it can be written")),
            Box::new(move |at, out| sonic_rs::to_writer(out, &theirs[at]).expect("it can be written")),
        ],
    }
}

fn others<T: Summed<'static>>() -> [fn(&'static [u8]) -> f64; 2] {
    [by_serde_json::<T>, by_sonic_rs::<T>]
}

fn samples(instructions: usize) -> &'static Samples {
    Box::leak(Box::new(Samples::new(instructions)))
}

fn encode(request: &Request<'_>, pack_id: &str, out: &mut Vec<u8>) {
    let addressing = Addressing { pack_id: Some(pack_id), ..Addressing::default() };
    request.encode(&addressing, out).expect("it can be written");
}

fn query() -> Case {
    let samples = samples(0);
    // The other contenders get the names of the addresses prepared.
    let names: Vec<Vec<String>> =
        samples.queries.iter().map(|query| query.iter().map(Address::to_string).collect()).collect();
    let frame = |(names, pack_id): (&'static Vec<String>, &'static String)| QueryFrame {
        ds_id: MONITOR,
        req_type: "query",
        pack_id,
        query_addr: names.iter().map(String::as_str).collect(),
    };
    let theirs = names.leak().iter().zip(&samples.pack_ids).map(frame).collect();
    let ours = |at: usize, out: &mut Vec<u8>| {
        encode(&Request::Query(&samples.queries[at]), &samples.pack_ids[at], out);
    };
    case("query of 12", ours, theirs, others::<QueryFrame<'_>>())
}

fn reply() -> Case {
    let samples = samples(0);
    let request = |at: usize| -> Message<'static> {
        let mut out = Vec::new();
        encode(&Request::Query(&samples.queries[at]), &samples.pack_ids[at], &mut out);
        Box::leak(Box::new(Decoder::new())).decode(out.leak()).expect("a frame of ours")
    };
    let requests: Vec<Message<'static>> = (0..FRAMES).map(request).collect();
    let frame = |(values, pack_id): (&'static Vec<f64>, &'static String)| ReplyFrame {
        ds_id: MONITOR,
        pack_id,
        query_data: values.iter().copied().map(Quoted).collect(),
        req_type: "query",
    };
    let theirs = samples.replies.iter().zip(&samples.pack_ids).map(frame).collect();
    let dialect = Dialect { echo_query_addr: false, ..Dialect::HC1 };
    let ours = move |at: usize, out: &mut Vec<u8>| {
        let Body::Query(query) = requests[at].body else { panic!("no query") };
        let writer = ReplyWriter::new(dialect, requests[at].header, RequestType::Query);
        writer.query(query.addresses, out, |data| {
            samples.replies[at].iter().for_each(|value| data.decimal(*value));
        });
    };
    case("reply of 12", ours, theirs, others::<ReplyFrame<'_>>())
}

fn add_rcc(count: usize) -> Case {
    let samples = samples(count);
    let theirs: Vec<AddRccFrame<'static>> = samples
        .lists
        .iter()
        .zip(&samples.pack_ids)
        .map(|(list, pack_id)| AddRccFrame {
            ds_id: REMOTE_COMMAND,
            req_type: "AddRCC",
            pack_id,
            empty_list: Quoted(1.0),
            instructions: list.iter().map(step).collect(),
        })
        .collect();
    let ours = |at: usize, out: &mut Vec<u8>| {
        let request = Request::AddRcc { empty_list: true, instructions: &samples.lists[at] };
        encode(&request, &samples.pack_ids[at], out);
    };
    case(&format!("AddRCC of {count}"), ours, theirs, others::<AddRccFrame<'_>>())
}

fn add_points() -> Case {
    let samples = samples(0);
    let theirs: Vec<AddPointsFrame<'static>> = samples
        .points
        .iter()
        .zip(&samples.pack_ids)
        .map(|(points, pack_id)| AddPointsFrame {
            ds_id: CAMERA,
            req_type: "AddPoints",
            pack_id,
            ds_data: vec![Camera { cam_id: 3, data: points.iter().map(part).collect() }],
        })
        .collect();
    let ours = |at: usize, out: &mut Vec<u8>| {
        let cameras = [CameraPoints { cam_id: 3, points: &samples.points[at] }];
        encode(&Request::AddPoints(&cameras), &samples.pack_ids[at], out);
    };
    case("AddPoints of 8", ours, theirs, others::<AddPointsFrame<'_>>())
}
