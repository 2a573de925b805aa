//! Asks a robot for values, and says where its arm stands.

use std::time::Duration;

use r6_api::gateway::{Queried, QueryProblem, Signal, SignalQuality};
use r6_api::{AddressValue, Code, Unit};
use r6_client::{Address, AxisIndex};

use super::station::{FRESH_FOR, Station, millis};
use crate::clock;
use crate::problem::Problem;

/// The most addresses of one query: as over the raw port.
pub const MAX_ADDRESSES: usize = 128;

/// How long a query may take. A robot that lacks all of the addresses is asked for each alone, which takes
/// 20 ms each.
const QUERY_TIME: Duration = Duration::from_secs(10);

impl Station {
    /// Reads the values of these addresses over the connection of the robot, also of those that are polled.
    /// Each address is read once.
    ///
    /// # Errors
    /// `not_ready`, `identity_changed`, `overloaded`: the robot was not asked. `no_reply`.
    pub async fn query(&self, addresses: &[Address]) -> Result<Queried, Problem> {
        let mut once: Vec<Address> = Vec::new();
        addresses.iter().for_each(|address| {
            if !once.contains(address) {
                once.push(*address);
            }
        });
        self.check_answers()?;
        let robot = self.robot().ok_or_else(not_up)?;
        let _place = self.queries.try_acquire().map_err(|_| {
            Problem::new(Code::Overloaded, "other queries of this robot are under way: ask again")
        })?;
        let (asked_at, connection) = (clock::now(), robot.connection());
        let read = tokio::time::timeout(QUERY_TIME, robot.query(&once)).await.map_err(|_| {
            Problem::new(Code::NoReply, format!("the robot did not answer within {QUERY_TIME:?}"))
        })?;
        let read = read.map_err(|error| Problem::of_query(&error))?;
        // Another robot may answer on a later connection.
        if robot.connection() != connection {
            return Err(not_up());
        }
        let age_ms = millis(clock::now().since(asked_at));
        let (mut signals, mut problems) = (Vec::new(), Vec::new());
        for (address, reading) in read.rows() {
            let value = reading.clone().ok().map(AddressValue::from);
            if let Err(why) = reading {
                problems.push(QueryProblem { address: address.to_string(), reason: why.to_string() });
            }
            signals.push(Signal {
                address: address.to_string(),
                unit: Unit::word_of(*address).map(str::to_owned),
                quality: if value.is_some() { SignalQuality::Fresh } else { SignalQuality::None },
                age_ms: value.is_some().then_some(age_ms),
                value,
            });
        }
        Ok(Queried { signals, problems })
    }

    /// Where the first axes of the arm stand, J1 first: from readings that are 1.5 s old at most, or by
    /// asking the robot.
    ///
    /// # Errors
    /// Those of [`Self::query`].
    pub async fn position(&self, axes: usize) -> Result<Vec<f64>, Problem> {
        self.check_answers()?;
        if let Some(read) = self.read_position(axes) {
            return Ok(read);
        }
        let addresses: Vec<_> = AxisIndex::ALL.into_iter().take(axes).map(Address::Axis).collect();
        let Queried { signals, .. } = self.query(&addresses).await?;
        signals.into_iter().map(|signal| decimal(signal.value?)).collect::<Option<_>>().ok_or_else(|| {
            Problem::new(Code::NotReady, "the controller does not tell as many axes as its model has")
        })
    }

    fn read_position(&self, axes: usize) -> Option<Vec<f64>> {
        let (board, now) = (self.board(), clock::now());
        let axes = AxisIndex::ALL.into_iter().take(axes).map(|axis| {
            let (signal, asked_at) = board.signal(now, Address::Axis(axis))?;
            let is_recent = asked_at.is_some_and(|asked_at| now.since(asked_at) <= FRESH_FOR);
            if is_recent && signal.quality == SignalQuality::Fresh { decimal(signal.value?) } else { None }
        });
        axes.collect()
    }

    /// Where the arm stands: its axes, J1 first, and its pose, if the controller has one. It is asked now,
    /// for all of them at once, and says with them that it does not move.
    ///
    /// # Errors
    /// Those of [`Self::query`]; `not_ready` if it moves.
    pub async fn stands(&self) -> Result<(Vec<f64>, Option<Vec<f64>>), Problem> {
        let six = || AxisIndex::ALL.into_iter().take(6);
        let addresses: Vec<_> = [Address::IsMoving]
            .into_iter()
            .chain(six().map(Address::Axis))
            .chain(six().map(Address::World))
            .collect();
        let Queried { signals, .. } = self.query(&addresses).await?;
        let read = |address: Address| {
            let address = address.to_string();
            signals.iter().find(|signal| signal.address == address).and_then(|signal| signal.value.clone())
        };
        let not_ready = |message: &str| Problem::new(Code::NotReady, message);
        if read(Address::IsMoving) != Some(AddressValue::Flag(false)) {
            return Err(not_ready("the arm moves, or does not say that it stands: wait until it stands"));
        }
        let number = |address| decimal(read(address)?);
        // Up to the first axis that the arm does not have.
        let axes: Vec<_> = six().map_while(|axis| number(Address::Axis(axis))).collect();
        if axes.is_empty() {
            return Err(not_ready("the controller does not tell where its axes stand"));
        }
        Ok((axes, six().map(|axis| number(Address::World(axis))).collect()))
    }

    /// Refuses if no robot answers, or another one than before.
    fn check_answers(&self) -> Result<(), Problem> {
        let (is_up, changed) = self.seat(|seat, _| (seat.is_up(), seat.identity_change().is_some()));
        if changed {
            let message = "another robot than before answers: an engineer has to accept it";
            return Err(Problem::new(Code::IdentityChanged, message));
        }
        if is_up { Ok(()) } else { Err(not_up()) }
    }
}

fn decimal(value: AddressValue) -> Option<f64> {
    if let AddressValue::Decimal(number) = value { Some(number) } else { None }
}

fn not_up() -> Problem {
    Problem::new(Code::NotReady, "the robot does not answer now")
}
