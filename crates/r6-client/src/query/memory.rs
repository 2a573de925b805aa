//! What queries tell of the controller besides their values: who it is, what it lacks, whether its lists can be believed.

use r6_proto::address::Address;

use crate::error::{OutcomeUnknown, RequestError, Sent};
use crate::hub::Hub;
use crate::identity::Identity;
use crate::link::{Lane, STATE};
use crate::query::parts::{is_everywhere, may_be_missing};
use crate::query::result::QueryResult;

/// Unsupported addresses that are remembered for a connection: more than the table of addresses has, registers apart.
const MAX_REMEMBERED: usize = 256;

/// Addresses that had a value, registers included: as many as there are.
const MAX_SUPPORTED: usize = 2048;

/// Replies in a row without the value of an address that the controller should have, until it counts as missing: more than odd replies
/// explain. From then on lists without it are believed again, and an odd firmware is not asked for each address alone for ever.
const MOST_EMPTY: u8 = 8;

impl Hub {
    /// What was answered once is there: no odd reply hides it later.
    pub(super) fn remember_supported(&self, connection: u64, addresses: impl Iterator<Item = Address>) {
        let mut told = addresses.filter(|address| may_be_missing(*address)).peekable();
        if told.peek().is_none() {
            return;
        }
        let mut known = self.known();
        if known.connection != connection {
            return;
        }
        for address in told {
            if known.supported.len() < MAX_SUPPORTED {
                known.supported.insert(address);
            }
        }
    }

    /// Whether a reply without a value is to be believed to say that the controller lacks the address. What every controller has,
    /// or had a value here, is believed to be missing only after many such replies in a row.
    pub(super) fn may_lack(&self, connection: u64, address: Address) -> bool {
        let mut known = self.known();
        let has = known.supported.contains(&address) || is_everywhere(address);
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

    /// Whether values in lists may stand at the wrong addresses: a reply showed it after `doubts` were counted, or before that and no
    /// whole query passed well since.
    pub(super) fn doubted_since(&self, doubts: u64) -> bool {
        let known = self.known();
        known.doubts_lists || known.doubts != doubts
    }

    /// Ends the doubt, unless it was raised anew after `doubts` were counted.
    pub(super) fn believe_lists(&self, connection: u64, doubts: u64) {
        let mut known = self.known();
        if known.connection == connection && known.doubts == doubts {
            known.doubts_lists = false;
        }
    }

    /// An address that every controller has is never remembered, nor one that had a value: one odd reply must not hide alarm and
    /// mode for good.
    pub(super) fn remember_unsupported(&self, connection: u64, address: Address) {
        if !may_be_missing(address) {
            return;
        }
        let mut known = self.known();
        let had_a_value = known.supported.contains(&address);
        if known.connection == connection && !had_a_value && known.unsupported.len() < MAX_REMEMBERED {
            known.unsupported.insert(address);
        }
    }

    /// Keeps what a query tells of the controller besides its values, and refuses the values of another robot.
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

    /// After a caller has read mode and alarm, the robot that answers now counts as the one that is meant. Reads of subscriptions and
    /// stops do not count.
    fn remember_look(&self, lane: Lane, result: &QueryResult) {
        let mut known = self.known();
        let looked = || STATE.into_iter().all(|address| result.reading(address).is_some());
        if known.read_of_nobody && known.connection == result.connection && lane == Lane::Ordinary && looked()
        {
            known.read_of_nobody = false;
        }
    }

    /// On a first connection a query may tell who is there; on others that is known before any query is sent. Who was taken for
    /// another because of an odd reply is himself again once he says so.
    ///
    /// Returns the connection and the identity where nobody knew before who is meant.
    pub(super) fn remember_identity(&self, connection: u64, result: &QueryResult) -> Option<(u64, Identity)> {
        let identity = Identity::of(result)?;
        let mut known = self.known();
        // Then who is there may be known in part only.
        let first = known.expected.is_none();
        let meant = known.expected.as_ref() == Some(&identity);
        if known.connection == connection && (meant || first || known.present.is_none()) {
            known.expected.get_or_insert_with(|| identity.clone());
            known.present = Some(identity.clone());
        } else if known.connection != connection {
            // The connection ended right behind this answer: it tells who was there first, and so is meant.
            known.expected.get_or_insert_with(|| identity.clone());
        }
        first.then_some((connection, identity))
    }

    /// The list that told this identity is not believed any more: the robot is unknown, as it was before.
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
