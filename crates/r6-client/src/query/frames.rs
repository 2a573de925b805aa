//! How many addresses fit into one query: neither its frame nor its reply may be longer than the controller
//! accepts.

use r6_proto::address::Address;
use r6_proto::request::Request;

use crate::query::parts::Part;
use crate::settings::{LONGEST_PACK_ID, RobotSettings};

/// The space that a value is assumed to need in a reply, quotes and comma included: the longest captured
/// position, `"-2597.112793"`, needs 15.
const BYTES_PER_VALUE: usize = 16;

/// The space for the longest name, `counter-999999999`, with its quotes, its comma and its value, bytes.
const MOST_NEEDED: usize = 17 + "\"\",".len() + BYTES_PER_VALUE;

/// The space in the longest frames of one robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QueryFrames {
    /// The space for all addresses with their values, bytes.
    room: usize,
}

impl QueryFrames {
    /// Calculates the space from these settings.
    pub fn of(settings: &RobotSettings) -> Self {
        let mut frame = Vec::new();
        // A query without addresses always encodes. The reply contains `queryData` in addition.
        Request::Query(&[]).encode(&settings.addressing(LONGEST_PACK_ID), &mut frame).ok();
        let around = frame.len() + "\"queryData\":[],".len();
        Self { room: settings.max_frame_bytes.saturating_sub(around) }
    }

    /// Whether a query for these addresses is one frame, and its reply another.
    pub fn fit(self, addresses: &[Address]) -> bool {
        // Most queries are so short that the length of each name does not matter.
        addresses.len() * MOST_NEEDED <= self.room
            || addresses.iter().copied().map(needs).sum::<usize>() <= self.room
    }

    /// Splits the addresses into parts whose requests and replies stay below the longest frame.
    pub(super) fn split(self, addresses: Part) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        let mut bytes = 0;
        for (at, address) in addresses {
            bytes += needs(address);
            match parts.last_mut() {
                Some(part) if bytes <= self.room => part.push((at, address)),
                Some(_) | None => {
                    parts.push(vec![(at, address)]);
                    bytes = needs(address);
                }
            }
        }
        parts
    }
}

/// The space that an address and its value need in the longest frame, bytes.
fn needs(address: Address) -> usize {
    address.name_len() + "\"\",".len() + BYTES_PER_VALUE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The request contains the address in quotes; the reply needs space for its value.
    #[test]
    fn an_address_needs_its_name_in_quotes_and_its_value() {
        for address in [Address::Version, Address::Counter(17), Address::Counter(u32::MAX)] {
            let of_request = format!("\"{address}\",");
            assert_eq!(needs(address), of_request.len() + BYTES_PER_VALUE, "{address}");
        }
    }
}
