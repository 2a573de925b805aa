//! How the calls of clients drive the connections that others depend on, too.

use std::fmt;

use r6_traffic::random::Random;

use super::Plan;
use crate::fault::Class;

/// How the calls of a client drive its connection. Who waits for an answer drives for all; this says how
/// badly he does it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drivers {
    /// Each call is polled whenever it is woken, until its end.
    #[default]
    AsTheyCome,
    /// Some calls are dropped, at any await: after so many polls, when they are woken again, or after some
    /// time (K3).
    Dropped,
    /// Some calls are slow: once polled they keep their place, are woken, and are not polled for up to some
    /// seconds (K4).
    Slow,
    /// Both.
    All,
}

impl Drivers {
    /// Those that break something, by the names that they are chosen by.
    pub const NAMED: [(&'static str, Self); 3] =
        [("dropped", Self::Dropped), ("slow", Self::Slow), ("all", Self::All)];

    /// Whether calls are dropped where they drive.
    #[must_use]
    pub fn drop_calls(self) -> bool {
        matches!(self, Self::Dropped | Self::All)
    }

    /// Whether calls are slow where they drive.
    #[must_use]
    pub fn are_slow(self) -> bool {
        matches!(self, Self::Slow | Self::All)
    }

    /// Whether a run of these drivers cannot show this class of faults.
    #[must_use]
    pub fn never_bring(self, class: Class) -> bool {
        (class == Class::K3 && !self.drop_calls()) || (class == Class::K4 && !self.are_slow())
    }
}

impl fmt::Display for Drivers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = Self::NAMED.iter().find(|(_, drivers)| drivers == self);
        f.write_str(named.map_or("as-they-come", |(name, _)| name))
    }
}

impl Plan {
    /// The same world with other drivers. The rest of it stays as it is, but half of the clients watch
    /// nothing: with a subscription the keeper drives all the time, and hides what calls fail to do.
    #[must_use]
    pub fn driven_by(mut self, drivers: Drivers) -> Self {
        if drivers == Drivers::AsTheyCome {
            return self;
        }
        self.drivers = drivers;
        let mut random = Random::new(self.seed ^ 0x6472_6976_6572_7321);
        for client in &mut self.clients {
            client.watches &= random.strikes(0.5);
        }
        let brought = [Class::K3, Class::K4].into_iter().filter(|class| !drivers.never_bring(*class));
        self.classes.extend(brought);
        self
    }
}
