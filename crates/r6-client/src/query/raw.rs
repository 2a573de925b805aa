//! Queries whose values are handed on as the controller wrote them.

use std::time::Duration;

use r6_proto::address::Address;

use crate::error::{Invalid, NotSent, OutcomeUnknown, RequestError, Sent};
use crate::job::{Answer, Work};
use crate::link::Lane;
use crate::query::NO_ADDRESS;
use crate::raw::{RawReply, RawValue};
use crate::robot::Robot;

impl Robot {
    /// Keeps the values of all replies as the controller wrote them, from now on: [`Self::raw_values`].
    pub fn keep_raw_values(&self) {
        self.hub().known().raw.begin();
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
