//! Words of the protocol as arguments: parsed with the protocol's own tables, and offered to the shell's
//! completion.

use std::ffi::OsStr;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::{Arg, Command, Error};
use r6_proto::message::command::COMMANDS;
use r6_proto::{ADDRESSES, Address};

/// An address with more indices than this is offered with its first index only, because a list of a thousand
/// registers does not help at a terminal.
const MOST_OFFERED: u32 = 8;

/// Reads a query address.
#[derive(Clone, Copy, Debug)]
pub struct AddressWord;

impl TypedValueParser for AddressWord {
    type Value = Address;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<Address, Error> {
        let parse = |text: &str| {
            text.parse::<Address>().map_err(|unknown| match unknown.nearest() {
                Some(_) => unknown.to_string(),
                None => format!("{unknown}; `r6 query --list` prints them all"),
            })
        };
        parse.parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(ADDRESSES.iter().flat_map(|row| {
            let (first, last) = row.indices.unwrap_or((0, 0));
            let last = if last - first < MOST_OFFERED { last } else { first };
            (first..=last).map(|index| {
                let name = match (row.indices, row.name.strip_suffix('n')) {
                    (Some(_), Some(stem)) => format!("{stem}{index}"),
                    (Some(_) | None, _) => row.name.to_owned(),
                };
                PossibleValue::new(name).help(row.meaning)
            })
        })))
    }
}

/// Takes the name of a command unchecked. The caller answers an unknown name with the nearest known one.
#[derive(Clone, Copy, Debug)]
pub struct CommandWord;

impl TypedValueParser for CommandWord {
    type Value = String;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<String, Error> {
        clap::builder::StringValueParser::new().parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(COMMANDS.iter().map(|row| PossibleValue::new(row.word).help(row.meaning))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_offered_is_taken() {
        let offered: Vec<_> = AddressWord.possible_values().unwrap().collect();
        for word in &offered {
            assert!(word.get_name().parse::<Address>().is_ok(), "{}", word.get_name());
        }
        let names: Vec<_> = offered.iter().map(PossibleValue::get_name).collect();
        assert!(
            ["axis-0", "axis-7", "world-5", "curMode", "input-7"].iter().all(|name| names.contains(name))
        );
        assert!(names.len() < 100, "{}", names.len());
    }
}
