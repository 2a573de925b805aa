//! The coverage table of `docs/PROTOCOL.md` is complete, and every test that it names exists.

use std::collections::BTreeSet;

use r6_proto::message::command::COMMANDS;
use r6_proto::{ADDRESSES, RequestType};
use r6_testkit::{coverage, vector};

/// The fields of the instructions of manual 6 and later, as `action.field`.
const INSTRUCTION_FIELDS: &[&str] = &[
    "oneshot",
    "action",
    "4.m0-m7",
    "4.ckStatus",
    "4.speed",
    "4.delay",
    "4.smooth",
    "4.tool",
    "4.coord",
    "10.m0-m7",
    "17.m0-m7",
    "17.m0_p-m7_p",
    "51.isUse",
    "51.speed",
    "52.isUse",
    "52.ioNumber",
    "52.io_status",
    "100.type",
    "100.point",
    "100.io_status",
    "100.limit",
    "100.isUnlimit",
    "200.type",
    "200.io_status",
    "200.point",
    "200.delay",
    "204.type",
    "204.point",
    "204.point2",
    "800.cnt_id",
];

/// The fields of points and photos (manual 5).
const VISION_FIELDS: &[&str] = &[
    "camID",
    "ret",
    "dsData.camID",
    "dsData.data",
    "ModelID",
    "X",
    "Y",
    "Z",
    "U",
    "V",
    "Angel",
    "Similarity",
    "Color",
    "Rel",
];

/// The fields of every frame (manual 3; packID from later manuals).
const HEADER_FIELDS: &[&str] = &["dsID", "reqType", "cmdType", "packID", "emptyList"];

fn items(group: &str) -> BTreeSet<String> {
    let rows = coverage::protocol_rows();
    coverage::items(&rows, group).into_iter().map(|item| item.to_string()).collect()
}

fn set<'a>(items: impl IntoIterator<Item = &'a str>) -> BTreeSet<String> {
    items.into_iter().map(str::to_owned).collect()
}

#[test]
fn every_address_has_a_row() {
    assert_eq!(items("address"), set(ADDRESSES.iter().map(|row| row.name)));
}

#[test]
fn every_command_has_a_row() {
    assert_eq!(items("command"), set(COMMANDS.iter().map(|row| row.word)));
}

#[test]
fn every_request_type_has_a_row() {
    assert_eq!(items("request type"), set(RequestType::ALL.map(RequestType::word)));
}

#[test]
fn every_field_has_a_row() {
    assert_eq!(items("instruction field"), set(INSTRUCTION_FIELDS.iter().copied()));
    assert_eq!(items("vision field"), set(VISION_FIELDS.iter().copied()));
    assert_eq!(items("header field"), set(HEADER_FIELDS.iter().copied()));
}

#[test]
fn both_reply_dialects_have_a_row() {
    assert_eq!(items("reply dialect"), set(["before 2.0.2.1 / 1.6.4", "since 2.0.2.1 / 1.6.4"]));
}

#[test]
fn every_printed_and_every_captured_frame_has_a_row() {
    let stems: BTreeSet<String> = vector::all()
        .into_iter()
        .map(|vector| vector.stem)
        .filter(|stem| stem.starts_with("manual_") || stem.starts_with("captured_"))
        .collect();
    assert_eq!(items("example"), stems);
}

#[test]
fn every_named_test_exists() {
    let missing = coverage::missing_tests(&coverage::protocol_rows());
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}
