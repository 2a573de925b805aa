//! How many addresses one query can have: neither its frame nor the reply may be longer than the controller takes.

use r6_proto::address::Address;
use r6_proto::request::Request;

use crate::query::parts::Part;
use crate::settings::{LONGEST_PACK_ID, RobotSettings};

/// What a value is taken to need in a reply, quotes and comma included: the longest captured position,
/// `"-2597.112793"`, needs 15.
const BYTES_PER_VALUE: usize = 16;

/// The longest name, `counter-999999999`, with what stands around it and its value, bytes.
const MOST_NEEDED: usize = 17 + "\"\",".len() + BYTES_PER_VALUE;

/// The room in the longest frames of one robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QueryFrames {
    /// What all addresses with their values may need, bytes.
    room: usize,
}

impl QueryFrames {
    /// By these settings.
    pub fn of(settings: &RobotSettings) -> Self {
        let mut frame = Vec::new();
        // A query without addresses has nothing that could fail to be encoded. The reply has `queryData` besides.
        Request::Query(&[]).encode(&settings.addressing(LONGEST_PACK_ID), &mut frame).ok();
        let around = frame.len() + "\"queryData\":[],".len();
        Self { room: settings.max_frame_bytes.saturating_sub(around) }
    }

    /// Whether a query of these is one frame, and its reply another.
    pub fn fit(self, addresses: &[Address]) -> bool {
        // Most are so few that it does not matter how long each is.
        addresses.len() * MOST_NEEDED <= self.room
            || addresses.iter().copied().map(needs).sum::<usize>() <= self.room
    }

    /// Parts whose requests and replies stay below the longest frame.
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

/// What an address and its value take of the longest frame, bytes.
fn needs(address: Address) -> usize {
    address.name_len() + "\"\",".len() + BYTES_PER_VALUE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a request has of an address, and room for its value in the reply.
    #[test]
    fn an_address_needs_its_name_in_quotes_and_its_value() {
        for address in [Address::Version, Address::Counter(17), Address::Counter(u32::MAX)] {
            let of_request = format!("\"{address}\",");
            assert_eq!(needs(address), of_request.len() + BYTES_PER_VALUE, "{address}");
        }
    }
}
