//! What queries tell about the controller besides their values: its identity, the addresses it lacks, whether
//! its lists can be believed.

use r6_proto::address::{Address, Walk};

use crate::error::{OutcomeUnknown, RequestError, Sent};
use crate::hub::Hub;
use crate::identity::Identity;
use crate::link::{Lane, STATE};
use crate::query::parts::{is_everywhere, may_be_missing};
use crate::query::result::QueryResult;

/// The most unsupported addresses remembered per connection: more than the table of addresses has, without
/// registers.
const MAX_REMEMBERED: usize = 256;

/// The most addresses remembered that had a value, with registers: as many as there are.
const MAX_SUPPORTED: usize = 2048;

/// After this many replies in a row without a value, an address that the controller should have counts as
/// missing. Odd replies do not explain more than this. From then on, lists without the address are believed
/// again, so that the client does not ask an odd firmware for each address alone for ever.
const MOST_EMPTY: u8 = 8;

impl Hub {
    /// Remembers addresses that had a value once, so that no odd reply hides them later.
    pub(super) fn remember_supported(&self, connection: u64, addresses: impl Iterator<Item = Address>) {
        let mut told = addresses.filter(|address| may_be_missing(*address)).peekable();
        if told.peek().is_none() {
            return;
        }
        let mut known = self.known();
        if known.connection != connection {
            return;
        }
        let mut walk = Walk::default();
        for address in told {
            if known.supported.len() < MAX_SUPPORTED {
                known.supported.walk_to_or_insert(&mut walk, address, || ());
            }
        }
    }

    /// Whether a reply without a value proves that the controller lacks the address. If every controller has
    /// the address, or it had a value here, this takes many such replies in a row.
    pub(super) fn may_lack(&self, connection: u64, address: Address) -> bool {
        let mut known = self.known();
        let has = known.supported.contains(address) || is_everywhere(address);
        if !has || known.connection != connection {
            return true;
        }
        if known.empty.len() >= MAX_SUPPORTED {
            return false;
        }
        let empty = known.empty.entry(address).or_default();
        *empty = empty.saturating_add(1);
        *empty > MOST_EMPTY
    }

    /// Whether values in lists may belong to the wrong addresses. A reply showed this after `doubts` were
    /// counted, or it showed this earlier and no whole query has passed well since.
    pub(super) fn doubted_since(&self, doubts: u64) -> bool {
        let known = self.known();
        known.doubts_lists || known.doubts != doubts
    }

    /// Ends the doubt, unless it was raised again after `doubts` were counted.
    pub(super) fn believe_lists(&self, connection: u64, doubts: u64) {
        let mut known = self.known();
        if known.connection == connection && known.doubts == doubts {
            known.doubts_lists = false;
        }
    }

    /// Remembers that an address is unsupported. Never does so for an address that every controller has or
    /// that had a value, because one odd reply must not hide alarm and mode for good.
    pub(super) fn remember_unsupported(&self, connection: u64, address: Address) {
        if !may_be_missing(address) {
            return;
        }
        let mut known = self.known();
        let had_a_value = known.supported.contains(address);
        if known.connection == connection && !had_a_value && known.unsupported.len() < MAX_REMEMBERED {
            known.unsupported.insert(address);
        }
    }

    /// Keeps what a query tells about the controller besides its values. Rejects the values of another robot.
    pub(super) fn remember(&self, lane: Lane, result: &QueryResult) -> Result<(), RequestError> {
        let connection = result.connection;
        self.remember_firmware(connection, result);
        self.remember_identity(connection, result);
        match self.stranger_on(connection) {
            Some((expected, found)) => {
                let (expected, found) = (Box::new(expected), Box::new(found));
                Err(OutcomeUnknown::AnotherRobot { request: Sent::QUERY, expected, found }.into())
            }
            None => {
                self.remember_look(lane, result);
                Ok(())
            }
        }
    }

    /// Once a caller has read mode and alarm, the robot that answers now counts as the intended one. Reads of
    /// subscriptions and stops do not count.
    fn remember_look(&self, lane: Lane, result: &QueryResult) {
        let mut known = self.known();
        let looked = || STATE.into_iter().all(|address| result.reading(address).is_some());
        if known.read_of_nobody && known.connection == result.connection && lane == Lane::Ordinary && looked()
        {
            known.read_of_nobody = false;
        }
    }

    /// Remembers the identity that a query contains. On a first connection a query may tell it; on others it
    /// is known before any query is sent. A robot that an odd reply made look like another one is recognized
    /// again once it tells its identity.
    ///
    /// Returns the connection and the identity if the intended robot was not known before.
    pub(super) fn remember_identity(&self, connection: u64, result: &QueryResult) -> Option<(u64, Identity)> {
        let identity = Identity::of(result)?;
        let mut known = self.known();
        // In this case the identity may be known only in part.
        let first = known.expected.is_none();
        let meant = known.expected.as_ref() == Some(&identity);
        if known.connection == connection && (meant || first || known.present.is_none()) {
            known.expected.get_or_insert_with(|| identity.clone());
            known.present = Some(identity.clone());
        } else if known.connection != connection {
            // The connection ended right after this answer. The answer tells which robot was there first, so
            // that robot is the intended one.
            known.expected.get_or_insert_with(|| identity.clone());
        }
        first.then_some((connection, identity))
    }

    /// Forgets an identity that came from a list that is not believed any more. The robot is unknown again.
    pub(super) fn forget_identity(&self, connection: u64, identity: &Identity) {
        let mut known = self.known();
        if known.connection == connection {
            known.present.take_if(|present| present == identity);
        }
        known.expected.take_if(|expected| expected == identity);
    }

    fn remember_firmware(&self, connection: u64, result: &QueryResult) {
        if !result.rows.iter().any(|(address, _)| *address == Address::Version) {
            return;
        }
        let mut known = self.known();
        if known.connection == connection {
            known.firmware = Some(result.text(Address::Version).map(str::to_owned));
        }
    }
}
