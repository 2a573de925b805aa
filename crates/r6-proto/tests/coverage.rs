//! Tests that the coverage table of `docs/PROTOCOL.md` is complete, and that every test named in it exists.

use std::collections::BTreeSet;

use r6_proto::alarm::AlarmCode;
use r6_proto::dialect::CommandReplyForm;
use r6_proto::message::Point;
use r6_proto::message::action::{ACTIONS, COMMON, HEADER, MemberInfo, VISION};
use r6_proto::message::command::COMMANDS;
use r6_proto::{ADDRESSES, RequestType};
use r6_testkit::{coverage, vector};

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

/// The members of instructions, each with its source. A member of one action is written `action.member`.
fn instruction_members() -> Vec<(String, &'static str)> {
    let own = ACTIONS.iter().flat_map(|action| {
        action.members().map(|member| (format!("{}.{}", action.number, member.name), member.source))
    });
    COMMON.iter().map(|member| (member.name.to_owned(), member.source)).chain(own).collect()
}

/// The members of photos, cameras and points.
fn vision() -> Vec<MemberInfo> {
    [&VISION, Point::MEMBERS].concat()
}

#[test]
fn every_field_has_a_row() {
    assert_eq!(items("instruction field"), instruction_members().into_iter().map(|(name, _)| name).collect());
    assert_eq!(items("vision field"), set(vision().iter().map(|member| member.name)));
    assert_eq!(items("header field"), set(HEADER.iter().map(|member| member.name)));
}

#[test]
fn both_reply_dialects_have_a_row() {
    assert_eq!(items("reply dialect"), set(CommandReplyForm::ALL.map(CommandReplyForm::firmware)));
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

/// The cells of the first table row of `docs/PROTOCOL.md` that names this item.
fn documented(item: &str) -> Vec<String> {
    let page = include_str!("../../../docs/PROTOCOL.md");
    let quoted = format!("`{item}`");
    let description = page.split("## Coverage").next().unwrap();
    let row = description
        .lines()
        .find(|line| {
            line.starts_with("| ") && line.split('|').skip(1).take(2).any(|cell| cell.trim() == quoted)
        })
        .unwrap_or_else(|| panic!("no row for {item}"));
    row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()
}

fn port_word(ports: r6_proto::address::Ports) -> &'static str {
    match ports {
        r6_proto::address::Ports::Both => "both",
        r6_proto::address::Ports::Mainboard => "mainboard",
        r6_proto::address::Ports::Pendant => "pendant",
    }
}

#[test]
fn the_pages_address_rows_agree_with_the_table_in_the_code() {
    for row in &ADDRESSES {
        let cells = documented(row.name);
        let number = row.source.strip_prefix("4.1.1 #");
        assert_eq!(
            number,
            number.is_some().then_some(cells[0].as_str()),
            "{}: its number in the manual",
            row.name
        );
        assert!(cells.iter().any(|cell| cell == row.since), "{}: first in {}", row.name, row.since);
        let port = port_word(row.ports);
        assert!(cells.iter().any(|cell| cell.split(' ').next() == Some(port)), "{}: on {port}", row.name);
        for unit in row.unit.split(", ").filter(|unit| ["mm", "deg", "s", "RPM"].contains(unit)) {
            let told = |cell: &String| cell.split([' ', ';', ',']).any(|word| word == unit);
            assert!(cells.iter().any(told), "{}: in {unit}", row.name);
        }
    }
}

#[test]
fn the_pages_command_rows_agree_with_the_table_in_the_code() {
    for row in &COMMANDS {
        let cells = documented(row.word);
        assert!(cells.iter().any(|cell| cell == row.effect.word()), "{}: its effect", row.word);
        if let Some(number) = row.source.strip_prefix("4.2.1 #") {
            assert_eq!(cells[0], number, "{}: its number in the manual", row.word);
            assert_eq!(cells[5], port_word(row.ports), "{}: its port", row.word);
            let told = if cells[2].is_empty() { 0 } else { cells[2].split(", ").count() };
            // The page summarises "x, y, z" and "0 or 1" in its own words, so only the absence of arguments
            // is compared.
            assert_eq!(told == 0, row.arguments.is_empty(), "{}: its arguments", row.word);
        }
    }
}

#[test]
fn the_coverage_table_cites_the_manual_as_the_code_does() {
    let rows = coverage::protocol_rows();
    let cited = |group: &str, item: &str| {
        let row = rows.iter().find(|row| row.group == group && row.item == item);
        row.map(|row| row.manual.clone()).unwrap_or_default()
    };
    for row in &ADDRESSES {
        assert_eq!(cited("address", row.name), row.source);
    }
    for row in &COMMANDS {
        assert_eq!(cited("command", row.word), row.source);
    }
    for (name, source) in instruction_members() {
        assert_eq!(cited("instruction field", &name), source, "{name}");
    }
    for (group, members) in [("vision field", vision()), ("header field", HEADER.to_vec())] {
        for member in members {
            assert_eq!(cited(group, member.name), member.source, "{}", member.name);
        }
    }
}

/// The alarm codes in a first cell of the page's table: `7`, `5, 6`, `16 – 19`, `90+n` for the eight axes,
/// and `700+n … 850+n` for every tenth of these.
fn codes(cell: &str) -> Vec<u32> {
    let number = |text: &str| -> u32 { text.parse().unwrap_or_else(|_| panic!("no code: {text} in {cell}")) };
    let axes = |first: u32| first..first + 8;
    cell.split(", ")
        .flat_map(|part| {
            let of_axes = |text: &str| text.strip_suffix("+n").map(number);
            if let Some((first, last)) = part.split_once(" … ") {
                let (first, last) = (of_axes(first).unwrap(), of_axes(last).unwrap());
                (first..=last).step_by(10).flat_map(axes).collect()
            } else if let Some((first, last)) = part.split_once(" – ") {
                (number(first)..=number(last)).collect::<Vec<_>>()
            } else if let Some(first) = of_axes(part) {
                axes(first).collect()
            } else {
                vec![number(part)]
            }
        })
        .collect()
}

#[test]
fn the_page_has_the_alarms_of_the_table_in_the_code() {
    let page = include_str!("../../../docs/PROTOCOL.md");
    let section = page.split("## 9. Alarms").nth(1).unwrap().split("\n## ").next().unwrap();
    let rows = section.lines().filter_map(|line| line.strip_prefix("| "));
    let told: Vec<u32> = rows
        .filter(|row| row.starts_with(|first: char| first.is_ascii_digit()))
        .flat_map(|row| codes(row.split(" |").next().unwrap()))
        .collect();
    let known: Vec<u32> = (1..=20_000).filter(|&code| AlarmCode(code).decode().known).collect();
    assert!(told.is_sorted_by(|before, after| before < after), "in order, none twice");
    let wrong = told.iter().chain(&known).find(|code| told.contains(code) != known.contains(code));
    assert_eq!(wrong, None, "an alarm of the page or of the table alone");

    // If a meaning has a code for each axis, it was seen for one of them.
    let meaning = |code: u32| AlarmCode(code).decode().text.rsplit(": ").next().unwrap().to_owned();
    let live = section.split("Seen live: ").nth(1).unwrap().split('.').next().unwrap();
    let live = live.split([',', '\n', ' ']).filter(|word| !word.is_empty());
    let live: BTreeSet<String> = live.map(|code| meaning(code.parse().unwrap())).collect();
    let seen = known.into_iter().filter(|&code| AlarmCode(code).decode().seen_live).map(meaning);
    assert_eq!(live, seen.collect());
}
