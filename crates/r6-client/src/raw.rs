//! Values as the controller wrote them, for programs that hand them on: a [`Reading`](crate::Reading) does
//! not keep the digits. `query/raw.rs` reads them.

use std::collections::BTreeMap;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::message::QueryReply;
use r6_proto::time::Instant;

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
    /// Keeps the values of all replies, from now on.
    pub fn begin(&mut self) {
        self.kept = true;
    }

    /// What is left of it on another connection: whether to keep values.
    pub fn on_next_connection(&self) -> Self {
        Self { kept: self.kept, values: BTreeMap::new() }
    }

    /// Forgets all values, because they may belong to other addresses.
    pub fn forget(&mut self) {
        self.values.clear();
    }

    /// Keeps the values of a reply, if that was asked for.
    pub fn keep(&mut self, asked: &[Address], reply: &QueryReply<'_>, asked_at: Instant) {
        if !self.kept {
            return;
        }
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

    /// The last value of an address.
    pub fn value(&self, address: Address, now: Instant) -> Option<RawValue> {
        let kept = self.values.get(&address)?;
        Some(RawValue { text: kept.text.clone(), age: now.since(kept.asked_at) })
    }
}
