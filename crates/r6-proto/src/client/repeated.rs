//! Reuses the frame of a repeated query. A poll sends the same query again and again, so only the `packID` in
//! the frame is written again.

use crate::address::Address;

/// The last query and its frame. It needs at most the memory of the longest frame and of the addresses in
/// that frame.
#[derive(Debug, Default)]
pub(super) struct LastQuery {
    addresses: Vec<Address>,
    /// The frame without the digits of its `packID`.
    frame: Vec<u8>,
    /// Position in `frame` where the digits belong.
    at: usize,
    /// Hash of its addresses. An echo must have the same hash.
    number: u64,
}

/// The bytes between the digits of `packID` and the list of addresses.
const BETWEEN: &[u8] = b"\",\"queryAddr\":[";

impl LastQuery {
    /// Whether `addresses` is the stored query.
    pub fn asks(&self, addresses: &[Address]) -> bool {
        !self.frame.is_empty() && self.addresses == addresses
    }

    /// Appends the stored frame with these digits as `packID`. Returns the hash of its addresses.
    pub fn append(&self, digits: &[u8], out: &mut Vec<u8>) -> u64 {
        if let Some((before, behind)) = self.frame.split_at_checked(self.at) {
            out.extend_from_slice(before);
            out.extend_from_slice(digits);
            out.extend_from_slice(behind);
        }
        self.number
    }

    /// Stores a query: its frame, whose `packID` has `digits` digits, and the hash of its addresses.
    pub fn keep(&mut self, addresses: &[Address], frame: &[u8], digits: usize, number: u64) {
        self.frame.clear();
        let Some(list) = frame.windows(BETWEEN.len()).position(|bytes| bytes == BETWEEN) else { return };
        let Some(before) = frame.get(..list.saturating_sub(digits)) else { return };
        self.at = before.len();
        self.frame.extend_from_slice(before);
        self.frame.extend_from_slice(frame.get(list..).unwrap_or_default());
        self.addresses.clear();
        self.addresses.extend_from_slice(addresses);
        self.number = number;
    }
}

#[cfg(test)]
mod tests {
    use crate::address::Address;
    use crate::client::{ClientSession, ClientSettings};
    use crate::dialect::Addressing;
    use crate::request::Request;
    use crate::time::Instant;

    #[test]
    fn a_query_that_is_repeated_differs_only_in_its_number() {
        let one = [Address::CurMode, Address::Counter(12), Address::IsMoving];
        let other = [Address::CurAlarm];
        // The number grows by one digit within this sequence.
        let mut session =
            ClientSession::new(ClientSettings { first_pack_id: 8, ..ClientSettings::default() });
        let asked: [&[Address]; 7] = [&one, &one, &one, &other, &one, &[], &other];
        for (number, addresses) in (8..).zip(asked) {
            let request = Request::Query(addresses);
            session.send(Instant::ORIGIN, &request).unwrap();
            let sent = String::from_utf8(session.poll_transmit().unwrap().to_vec()).unwrap();
            session.transmitted(sent.len());
            let pack_id = format!("{number}");
            let mut expected = Vec::new();
            request
                .encode(&Addressing { pack_id: Some(&pack_id), ..Addressing::default() }, &mut expected)
                .unwrap();
            assert_eq!(sent, String::from_utf8(expected).unwrap());
            // Each query gets an answer, which is matched by its echo.
            let reply = sent.replace("]}", "],\"queryData\":[]}");
            assert_eq!(session.handle_input(Instant::ORIGIN, reply.as_bytes()), reply.len());
            let event = session.poll_event(Instant::ORIGIN).unwrap();
            assert!(matches!(event, crate::client::Event::Reply { .. }), "{event:?}");
        }
    }
}
