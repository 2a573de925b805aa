//! Values as the controller wrote them, for programs that hand them on: a [`Reading`](crate::Reading) does
//! not keep the digits.

use std::collections::BTreeMap;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::message::QueryReply;
use r6_proto::time::Instant;

use crate::error::{Invalid, NotSent, OutcomeUnknown, RequestError, Sent};
use crate::hub::Known;
use crate::job::{Answer, Answered, Work};
use crate::link::Lane;
use crate::query::NO_ADDRESS;
use crate::robot::Robot;

/// How many values are kept. All subscriptions of a robot have fewer addresses; counters have more numbers
/// than anyone reads.
const MOST_KEPT: usize = 2_048;

/// A value as the controller wrote it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawValue {
    /// The JSON value, with its quotes if it has any.
    pub text: Vec<u8>,
    /// The time since it was asked for; the value is no older.
    pub age: Duration,
}

/// The reply to one query, as the controller wrote it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawReply {
    /// The JSON values of `queryData`, in their order. There are fewer than addresses if the controller lacks
    /// some.
    pub values: Vec<Vec<u8>>,
    /// How long the reply took; of several parts, the slowest.
    pub took: Duration,
}

/// The last text of each value, over the present connection.
#[derive(Debug, Default)]
pub(crate) struct RawValues {
    kept: bool,
    values: BTreeMap<Address, Kept>,
}

#[derive(Debug)]
struct Kept {
    text: Vec<u8>,
    asked_at: Instant,
}

impl RawValues {
    /// What is left of it on another connection: whether to keep values.
    pub fn on_next_connection(&self) -> Self {
        Self { kept: self.kept, values: BTreeMap::new() }
    }

    /// Forgets all values, because they may belong to other addresses.
    pub fn forget(&mut self) {
        self.values.clear();
    }

    fn keep(&mut self, asked: &[Address], reply: &QueryReply<'_>, asked_at: Instant) {
        let Ok(values) = reply.aligned(asked.len()) else { return };
        for (address, value) in asked.iter().zip(values.iter()) {
            if self.values.len() >= MOST_KEPT && !self.values.contains_key(address) {
                self.values.clear();
            }
            let place = self.values.entry(*address).or_insert_with(|| Kept { text: Vec::new(), asked_at });
            // Replies may come in another order than requests.
            if place.asked_at <= asked_at {
                place.text.clear();
                place.text.extend_from_slice(value.wire());
                place.asked_at = asked_at;
            }
        }
    }

    fn value(&self, address: Address, now: Instant) -> Option<RawValue> {
        let kept = self.values.get(&address)?;
        Some(RawValue { text: kept.text.clone(), age: now.since(kept.asked_at) })
    }
}

impl Known {
    /// Keeps the values of a reply, if that was asked for and each value is known to belong to its address.
    pub(crate) fn keep_raw(&mut self, asked: &[Address], reply: &QueryReply<'_>, on: Answered) {
        let is_sure = asked.len() == 1 || !self.doubts_lists;
        if self.raw.kept && self.connection == on.connection && is_sure {
            self.raw.keep(asked, reply, on.asked_at);
        }
    }
}

impl Robot {
    /// Keeps the values of all replies as the controller wrote them, from now on: [`Self::raw_values`].
    pub fn keep_raw_values(&self) {
        self.hub().known().raw.kept = true;
    }

    /// The last values of these addresses as the controller wrote them, in the order of the addresses, read
    /// over the present connection by any query of this handle and its clones. It sends nothing.
    ///
    /// `None` for an address without one, and for all if another robot than the expected one answers. It
    /// needs [`Self::keep_raw_values`].
    #[must_use]
    pub fn raw_values(&self, addresses: &[Address]) -> Vec<Option<RawValue>> {
        let now = self.now();
        if self.hub().stranger().is_some() {
            return addresses.iter().map(|_| None).collect();
        }
        let known = self.hub().known();
        addresses.iter().map(|address| known.raw.value(*address, now)).collect()
    }

    /// Reads these addresses, and returns the values as the controller wrote them. A long list is split into
    /// as many frames as the controller needs, and the values are put together again.
    ///
    /// Unlike [`Self::query`], it does not find out which addresses the controller lacks, and it is not
    /// repeated. Like the reads of a subscription, it does not unlock commands.
    ///
    /// # Errors
    /// [`RequestError`]; [`Invalid::Value`] if there is no address in the list;
    /// [`OutcomeUnknown::AnotherRobot`] if another robot than before answers;
    /// [`NotSent::Disconnected`] if the connection changed between two parts.
    pub async fn query_raw(&self, addresses: &[Address]) -> Result<RawReply, RequestError> {
        if addresses.is_empty() {
            return Err(Invalid::Value(NO_ADDRESS).into());
        }
        self.drive(self.query_raw_in_parts(addresses)).await
    }

    async fn query_raw_in_parts(&self, addresses: &[Address]) -> Result<RawReply, RequestError> {
        let (mut all, mut slowest, mut connection) = (Vec::new(), Duration::ZERO, None);
        let parts = self.query_frames().split(addresses.iter().copied().enumerate().collect());
        for part in parts {
            let asked = part.iter().map(|(_, address)| *address).collect();
            match self.ask(Work::RawQuery(asked), Lane::Background).await? {
                Answer::Raw { values, on } if *connection.get_or_insert(on.connection) == on.connection => {
                    all.extend(values);
                    slowest = slowest.max(on.after);
                    if let Some((expected, found)) = self.hub().stranger_on(on.connection) {
                        let (expected, found) = (Box::new(expected), Box::new(found));
                        let request = Sent::QUERY;
                        return Err(OutcomeUnknown::AnotherRobot { request, expected, found }.into());
                    }
                }
                Answer::Raw { .. } => return Err(NotSent::Disconnected.into()),
                Answer::Values { .. } | Answer::Mismatch { .. } | Answer::Accepted { .. } | Answer::Left => {
                    let answer = "a reply to a command".to_owned();
                    return Err(OutcomeUnknown::Unclear { request: Sent::QUERY, answer }.into());
                }
            }
        }
        Ok(RawReply { values: all, took: slowest })
    }
}
