//! Renders a decoded message in the JSON of `vectors/README.md`, written only from the table there.

use r6_proto::axis::AxisIndex;
use r6_proto::message::instruction::{
    Action, Coordinates, Instruction, Manner, OutputBoard, OutputKind, WaitCondition, WaitSource,
};
use r6_proto::message::{AddPoints, AddRcc, Body, ExtraKind, Message, Point, TypeKey};
use r6_proto::value::{Value as WireValue, Values};
use serde_json::{Map, Value, json};

/// The whole message: kind, header, payload, and the unknown and repeated keys.
///
/// The table has no rejected messages. They are rendered as kind `rejected` with the error's text.
pub fn message(message: &Message<'_>) -> Value {
    let mut out = Map::new();
    let header = &message.header;
    let optional = |value: Option<WireValue<'_>>| value.map_or(Value::Null, wire);
    out.insert("dsID".into(), optional(header.ds_id));
    let type_key = match header.type_key {
        TypeKey::ReqType => json!("reqType"),
        TypeKey::CmdType => json!("cmdType"),
        TypeKey::Absent => Value::Null,
    };
    out.insert("typeKey".into(), type_key);
    out.insert("type".into(), optional(header.type_word));
    if let Some(pack_id) = header.pack_id {
        out.insert("packID".into(), wire(pack_id));
    }
    let (kind, payload) = body(&message.body);
    out.insert("kind".into(), kind.into());
    let Value::Object(payload) = payload else { panic!("a payload is an object, not {payload}") };
    out.extend(payload);
    for (name, kind) in [("unknownKeys", ExtraKind::UnknownKey), ("duplicateKeys", ExtraKind::DuplicateKey)] {
        let keys: Vec<Value> = message
            .extras()
            .filter(|extra| extra.kind == kind)
            .map(|extra| extra.key.text().into())
            .collect();
        if !keys.is_empty() {
            out.insert(name.into(), keys.into());
        }
    }
    Value::Object(out)
}

fn body(body: &Body<'_>) -> (&'static str, Value) {
    match body {
        Body::Query(query) => ("query", json!({ "addresses": values(query.addresses) })),
        Body::QueryReply(reply) => {
            let mut out = json!({ "values": values(reply.values) });
            if let Some(addresses) = reply.addresses {
                out["addresses"] = values(addresses);
            }
            ("query-reply", out)
        }
        Body::Command(command) => {
            ("command", json!({ "command": command.word(), "args": values(command.arguments()) }))
        }
        Body::CommandReply(reply) => ("command-reply", json!({ "words": values(reply.words()) })),
        Body::Heartbreak => ("heartbreak", json!({})),
        Body::Photo(photo) => ("photo", json!({ "camID": photo.cam_id })),
        Body::PhotoAnswer(answer) => ("photo-answer", json!({ "camID": answer.cam_id, "ret": answer.ret })),
        Body::AddPoints(points) => ("add-points", json!({ "sets": sets(points) })),
        Body::AddRcc(list) => ("add-rcc", add_rcc(list)),
        Body::Unknown(_) => ("unknown", json!({})),
        Body::Rejected(rejection) => ("rejected", json!({ "error": rejection.error.to_string() })),
    }
}

/// A value exactly as on the wire, except for its encoding: texts are unescaped, and GBK becomes Unicode.
pub fn wire(value: WireValue<'_>) -> Value {
    if value.is_text() {
        value.text().into()
    } else if value.is_list() {
        value.items().map(wire).collect::<Vec<_>>().into()
    } else {
        // Only an object with GBK inside is invalid JSON for other readers. Then its bytes are used.
        serde_json::from_slice(value.wire())
            .unwrap_or_else(|_| String::from_utf8_lossy(value.wire()).into_owned().into())
    }
}

pub fn values(values: Values<'_>) -> Value {
    values.iter().map(wire).collect::<Vec<_>>().into()
}

fn sets(points: &AddPoints<'_>) -> Value {
    let set = |(cam_id, points): (i64, &[Point])| json!({ "camID": cam_id, "points": points.iter().map(point).collect::<Vec<_>>() });
    points.sets().map(set).collect::<Vec<_>>().into()
}

fn point(point: &Point) -> Value {
    let mut out = json!({
        "ModelID": point.model_id,
        "X": point.x,
        "Y": point.y,
        "Rel": point.relative,
    });
    for (name, value) in [
        ("Z", point.z),
        ("U", point.u),
        ("V", point.v),
        ("Angel", point.angle),
        ("Similarity", point.similarity),
    ] {
        if let Some(value) = value {
            out[name] = value.into();
        }
    }
    if let Some(color) = point.color {
        out["Color"] = color.into();
    }
    out
}

fn add_rcc(list: &AddRcc<'_>) -> Value {
    let mut out = json!({
        "instructions": list.instructions.iter().map(|one| instruction(list, one)).collect::<Vec<_>>(),
    });
    if let Some(empty_list) = list.empty_list {
        out["emptyList"] = empty_list.into();
    }
    if list.shape_2020 {
        out["shape"] = "2020".into();
    }
    out
}

fn instruction(list: &AddRcc<'_>, instruction: &Instruction) -> Value {
    let (number, members) = match &instruction.action {
        Action::AxisMove(motion) => (4, moving(&motion.target, None, &motion.manner)),
        Action::LinearMove(motion) => (10, moving(&motion.target, None, &motion.manner)),
        Action::CurveMove(curve) => (17, moving(&curve.middle, Some(&curve.end), &curve.manner)),
        Action::PathSpeed(speed) => (51, json!({ "isUse": speed.in_use, "speed": speed.speed })),
        Action::StopOnSignal(stop) => {
            (52, json!({ "isUse": stop.in_use, "ioNumber": stop.input, "io_status": i64::from(stop.on) }))
        }
        Action::Wait(wait) => {
            let (kind, point) = match wait.source {
                WaitSource::Input { board, point } => (board, point),
                WaitSource::M { board, point } => (board + 5, point),
                WaitSource::Eu { point } => (8, point),
                WaitSource::Time => (100, 0),
            };
            let condition = match wait.condition {
                WaitCondition::Off => 0,
                WaitCondition::On => 1,
                WaitCondition::RisingEdge => 2,
                WaitCondition::FallingEdge => 3,
            };
            let members = json!({
                "type": kind, "point": point, "io_status": condition, "limit": wait.limit, "isUnlimit": wait.unlimited,
            });
            (100, members)
        }
        Action::Output(output) => {
            let kind = match output.kind {
                OutputKind::Y => 0,
                OutputKind::M => 5,
                OutputKind::Euy => 7,
                OutputKind::TimedY => 100,
            };
            let on = i64::from(output.on);
            (200, json!({ "type": kind, "io_status": on, "point": output.point, "delay": output.delay }))
        }
        Action::BoardOutput(output) => {
            let board = match output.board {
                OutputBoard::Y(board) => board,
                OutputBoard::M(board) => board + 5,
            };
            (204, json!({ "type": board, "point": output.low.bits(), "point2": output.high.bits() }))
        }
        Action::Workbench(bench) => (800, json!({ "cnt_id": bench.id })),
        Action::Unknown(unknown) => {
            let fields: Map<String, Value> = list
                .unknown_fields(unknown)
                .map(|(name, value)| (name.text().into_owned(), wire(value)))
                .collect();
            (unknown.number(), json!({ "fields": fields }))
        }
    };
    let mut out = members;
    out["oneshot"] = instruction.oneshot.into();
    out["action"] = number.into();
    out
}

fn moving(target: &Coordinates, end: Option<&Coordinates>, manner: &Manner) -> Value {
    let eight = |coordinates: &Coordinates| AxisIndex::ALL.map(|axis| coordinates.at(axis));
    let mut out = json!({
        "m": eight(target),
        "ckStatus": manner.mask.map(|mask| mask.bits()),
        "speed": manner.speed,
        "delay": manner.delay,
        "smooth": manner.smooth.map(|smooth| smooth.level()),
    });
    if let Some(end) = end {
        out["m_p"] = json!(eight(end));
    }
    for (name, value) in [("tool", manner.tool), ("coord", manner.coord)] {
        if let Some(value) = value {
            out[name] = value.into();
        }
    }
    out
}
