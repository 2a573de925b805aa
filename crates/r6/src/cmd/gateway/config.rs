//! The file with the robots of a gateway.

use std::path::Path;
use std::time::Duration;

use r6_client::Address;
use r6_gateway::{MAX_READ, PERIODS, RobotConfig, RobotName};
use r6_program::Mistakes;
use r6_program::form::{self, Fields, Node, Wrong};

use crate::exit::Failure;
use crate::robot;
use crate::text_file;

/// The longest file. A robot takes a hundred bytes.
const MAX_FILE_BYTES: usize = 1024 * 1024;

/// Reads the robots from a file.
pub fn read(path: &Path) -> Result<Vec<RobotConfig>, Failure> {
    let name = path.display().to_string();
    let text = text_file::read(path, "a file of robots", MAX_FILE_BYTES)
        .map_err(|error| Failure::usage(format!("{name}: {error}")))?;
    parse(&text).map_err(|mistakes| Failure::in_file(&name, &mistakes))
}

fn parse(text: &str) -> Result<Vec<RobotConfig>, Mistakes> {
    let (document, mut found) = form::parse(text);
    let fields = Fields::of(&document, &[], "");
    let mut robots: Vec<RobotConfig> = Vec::new();
    for (number, table) in (1..).zip(fields.tables("robot")) {
        let inner = Fields::of(table, &[], format!("[[robot]] {number}: "));
        let read = one(&inner).and_then(|robot| {
            if robots.iter().any(|known| known.name == robot.name) {
                return Err(inner.wrong("name", format!("two robots are called `{}`", robot.name)));
            }
            Ok(robot)
        });
        robots.extend(inner.finish(read, &mut found));
    }
    let robots = fields.finish(Ok(robots), &mut found);
    found.finish(robots)
}

fn one(fields: &Fields<'_>) -> Result<RobotConfig, Wrong> {
    let name = fields.due("name", RobotName::WANTED, |value| RobotName::new(value.text()?));
    let address = fields.due("address", "HOST[:PORT], such as 192.168.1.10", |value| {
        value.text().filter(|text| r6_client::check_address(text).is_ok())
    });
    let [shortest, longest] =
        [PERIODS.0, PERIODS.1].map(|period| u32::try_from(period.as_millis()).unwrap_or(u32::MAX));
    let period = fields.whole_in("period_ms", &format!("from {shortest} to {longest}"), shortest..=longest);
    let wanted = format!("at most {MAX_READ} query addresses in brackets, such as [\"Addr-800\"]");
    let addresses = fields.optional("read", &wanted, |value| {
        let addresses = value.list()?.iter().map(address_of).collect::<Option<Vec<_>>>()?;
        Some(addresses).filter(|addresses| addresses.len() <= MAX_READ)
    });
    let usual = RobotConfig::new(name?, address?);
    Ok(RobotConfig {
        period: period.map_or(usual.period, |period| Duration::from_millis(period.into())),
        addresses: addresses.unwrap_or_default(),
        settings: robot::settings(),
        ..usual
    })
}

fn address_of(node: &Node) -> Option<Address> {
    Address::parse(node.text()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_names_robots_and_what_to_read() {
        let text = "[[robot]]\nname = \"press-4\"\naddress = \"192.168.1.10\"\nperiod_ms = 50\n\
                    read = [\"Addr-800\", \"counter-1\"]\n\
                    [[robot]]\nname = \"saw\"\naddress = \"saw.hall:9761\"\n";
        let robots = parse(text).unwrap();
        let [press, saw] = &robots[..] else { panic!("{robots:?}") };
        assert_eq!((press.name.as_str(), press.period), ("press-4", Duration::from_millis(50)));
        assert_eq!(press.addresses.len(), 2);
        assert_eq!((saw.address.as_str(), saw.period), ("saw.hall:9761", r6_gateway::USUAL_PERIOD));
    }

    #[test]
    fn every_mistake_is_told_with_its_line() {
        let text = "[[robot]]\nname = \"Press 4\"\naddress = \"a:b:c\"\n[[robot]]\nname = \"saw\"\naddress = \"a\"\n\
                    period_ms = 1\nread = [\"axis-99\"]\nx = 1\n";
        let mistakes = parse(text).unwrap_err();
        let lines: Vec<_> = mistakes.lines("hall.toml").collect();
        for (line, part) in [
            ("hall.toml:2:", "`name` is the text \"Press 4\""),
            ("hall.toml:3:", "`address`"),
            ("hall.toml:7:", "`period_ms` is 1"),
            ("hall.toml:8:", "`read`"),
            ("hall.toml:9:", "`x`"),
        ] {
            let is_told = lines.iter().any(|told| told.starts_with(line) && told.contains(part));
            assert!(is_told, "{part}: {lines:#?}");
        }
        let twice =
            "[[robot]]\nname = \"saw\"\naddress = \"a\"\n[[robot]]\nname = \"saw\"\naddress = \"b\"\n";
        assert!(parse(twice).unwrap_err().first().what.contains("two robots"));
    }
}
