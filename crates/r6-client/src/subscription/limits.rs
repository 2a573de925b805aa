//! The limits of subscriptions, and the errors for exceeding them.

use std::fmt;
use std::time::Duration;

/// The maximum number of subscriptions of one robot, including its clones: screens, recorders and checks of
/// one program. Each costs some hundred bytes and a wake-up per poll.
pub(crate) const MAX_SUBSCRIPTIONS: usize = 256;

/// The maximum number of addresses of one subscription: more than all addresses that are not registers.
pub(crate) const MAX_ADDRESSES: usize = 256;

/// The maximum number of addresses of all subscriptions of one robot. Some fifty fit into a query, and a
/// reply takes 18 ms, so a controller needs a third of a second for all of these.
pub(crate) const MAX_POLLED: usize = 1024;

/// The shortest period of an address. A viewer of the manufacturer asks for 26 addresses every 20 ms, and a
/// reply takes that long.
pub(super) const SHORTEST_PERIOD: Duration = Duration::from_millis(20);

/// The longest period of an address. A program that needs it once a day can query it directly.
pub(super) const LONGEST_PERIOD: Duration = Duration::from_secs(3600);

/// Why a subscription was not created.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSubscribed {
    /// No address, or more than 256.
    Addresses {
        /// How many were asked for, each counted once.
        asked: usize,
    },
    /// The period is shorter than 20 ms or longer than an hour.
    Period {
        /// The period that was requested.
        asked: Duration,
    },
    /// 256 subscriptions of this robot exist.
    Subscriptions,
    /// All subscriptions of a robot together ask for 1 024 addresses at most.
    Polled {
        /// How many addresses are polled already.
        polled: usize,
        /// How many addresses would be added.
        new: usize,
    },
    /// The handle was closed.
    Closed,
}

impl fmt::Display for NotSubscribed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not subscribed: ")?;
        match self {
            Self::Addresses { asked: 0 } => f.write_str("no address was given; name one at least"),
            Self::Addresses { asked } => {
                write!(f, "{asked} addresses are too many for one; give each at most {MAX_ADDRESSES}")
            }
            Self::Period { asked } => write!(
                f,
                "every {asked:?} is no period that a controller is asked at; choose one from {SHORTEST_PERIOD:?} to \
                 {LONGEST_PERIOD:?}, 50ms or longer for hours on end"
            ),
            Self::Subscriptions => {
                write!(f, "{MAX_SUBSCRIPTIONS} exist already; drop some, or share one between tasks")
            }
            Self::Polled { polled, new } => write!(
                f,
                "{polled} addresses are asked for already and {new} more would exceed {MAX_POLLED}; drop some"
            ),
            Self::Closed => f.write_str("the handle is closed; connect again"),
        }
    }
}

impl std::error::Error for NotSubscribed {}
