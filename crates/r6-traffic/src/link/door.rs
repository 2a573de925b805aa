//! What happens to attempts to connect.

use crate::fault::{LinkFault, LinkFaultNow};

/// What happens to attempts to connect. Existing connections do not notice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Door {
    /// They are accepted.
    #[default]
    Open,
    /// They are refused.
    Refuses,
    /// They get no answer.
    BlackHole,
}

impl Door {
    /// The effect of these faults. A black hole takes precedence over a refusal. A chance of 0 turns a fault
    /// off; any other chance means always, because a port is either closed or open.
    #[must_use]
    pub fn of(faults: &[LinkFaultNow]) -> Self {
        let has = |which| faults.iter().any(|one| one.fault == which && one.chance > 0.0);
        if has(LinkFault::BlackHole) {
            Self::BlackHole
        } else if has(LinkFault::Refuse) {
            Self::Refuses
        } else {
            Self::Open
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_black_hole_does_not_refuse() {
        let now = |fault, chance| LinkFaultNow { fault, chance };
        assert_eq!(Door::of(&[]), Door::Open);
        assert_eq!(Door::of(&[now(LinkFault::Noise, 1.0)]), Door::Open);
        let refuse = now(LinkFault::Refuse, 0.1);
        assert_eq!(Door::of(&[refuse]), Door::Refuses);
        assert_eq!(Door::of(&[refuse, now(LinkFault::BlackHole, 1.0)]), Door::BlackHole);
        assert_eq!(Door::of(&[refuse, now(LinkFault::BlackHole, 0.0)]), Door::Refuses);
    }
}
