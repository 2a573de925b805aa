//! How the calls of clients drive the connections that other calls depend on.

use std::fmt;

use r6_traffic::random::Random;

use super::Plan;
use crate::fault::Class;

/// How the calls of a client drive its connection. A call that waits for a reply drives the connection for
/// all calls; this says how badly it does so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drivers {
    /// Each call is polled whenever it is woken, until its end.
    #[default]
    AsTheyCome,
    /// Some calls are dropped at any await: after some polls, when they are woken again, or after some time
    /// (K3).
    Dropped,
    /// Some calls are slow: after a poll they keep their place, are woken, but are not polled for up to some
    /// seconds (K4).
    Slow,
    /// Both dropped and slow calls.
    All,
}

impl Drivers {
    /// The drivers that break something, by name.
    pub const NAMED: [(&'static str, Self); 3] =
        [("dropped", Self::Dropped), ("slow", Self::Slow), ("all", Self::All)];

    /// Whether calls are dropped while they drive.
    #[must_use]
    pub fn drop_calls(self) -> bool {
        matches!(self, Self::Dropped | Self::All)
    }

    /// Whether calls are slow while they drive.
    #[must_use]
    pub fn are_slow(self) -> bool {
        matches!(self, Self::Slow | Self::All)
    }

    /// Whether these drivers can never show this class of faults.
    #[must_use]
    pub fn never_bring(self, class: Class) -> bool {
        let only_gateways = [Class::G1, Class::G5, Class::G6, Class::G10, Class::G13, Class::S4, Class::S5];
        (class == Class::K3 && !self.drop_calls())
            || (class == Class::K4 && !self.are_slow())
            || (self != Self::AsTheyCome && only_gateways.contains(&class))
    }
}

impl fmt::Display for Drivers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = Self::NAMED.iter().find(|(_, drivers)| drivers == self);
        f.write_str(named.map_or("as-they-come", |(name, _)| name))
    }
}

impl Plan {
    /// The same world with other drivers. Everything else stays, except that half of the clients have no
    /// subscription. With a subscription the keeper drives all the time and hides what calls fail to do.
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
