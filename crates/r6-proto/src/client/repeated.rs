//! A poll is the same query again and again: its frame is kept, and only the `packID` in it is written anew.

use crate::address::Address;

/// The last query and its frame. It takes no more than the longest frame and as many addresses as that names.
#[derive(Debug, Default)]
pub(super) struct LastQuery {
    addresses: Vec<Address>,
    /// The frame without the digits of its `packID`.
    frame: Vec<u8>,
    /// Where in it they belong.
    at: usize,
    /// The number of its addresses, which an echo has to have.
    number: u64,
}

/// What stands between the digits of `packID` and the list of addresses.
const BETWEEN: &[u8] = b"\",\"queryAddr\":[";

impl LastQuery {
    /// Whether this is the query that is kept.
    pub fn asks(&self, addresses: &[Address]) -> bool {
        !self.frame.is_empty() && self.addresses == addresses
    }

    /// Appends its frame with these digits as `packID`; the number of its addresses.
    pub fn append(&self, digits: &[u8], out: &mut Vec<u8>) -> u64 {
        if let Some((before, behind)) = self.frame.split_at_checked(self.at) {
            out.extend_from_slice(before);
            out.extend_from_slice(digits);
            out.extend_from_slice(behind);
        }
        self.number
    }

    /// Keeps a query: its frame with a `packID` of so many digits, and the number of its addresses.
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
        // The number gains a digit on the way.
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
            // Each is answered, and known by its echo.
            let reply = sent.replace("]}", "],\"queryData\":[]}");
            assert_eq!(session.handle_input(Instant::ORIGIN, reply.as_bytes()), reply.len());
            let event = session.poll_event(Instant::ORIGIN).unwrap();
            assert!(matches!(event, crate::client::Event::Reply { .. }), "{event:?}");
        }
    }
}
