//! Roles, and what each may do.

use std::collections::BTreeSet;
use std::fmt;

use r6_api::gateway::Role;
use r6_proto::Effect;

use crate::core::name::RobotName;

/// Something that needs a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Right {
    /// Read values, states and events.
    Read,
    /// Stop a robot. It needs no lease.
    Stop,
    /// Hold the lease, and with it send commands that change or move.
    Command,
    /// Acknowledge an alarm. It needs no lease.
    AcknowledgeAlarm,
    /// Shelve the alarms of a code for a time.
    ShelveAlarm,
    /// Turn the key of a virtual robot's panel, set inputs, raise alarms, and remove points there.
    SetUpPanel,
    /// Accept another robot at an address.
    AcceptIdentity,
    /// Read the audit log.
    ReadAudit,
    /// Store and remove programs.
    StorePrograms,
    /// Take the lease from its holder.
    TakeLease,
    /// Give and revoke the standing grants of cameras.
    GrantCamera,
    /// Add, change and remove a robot.
    Configure,
    /// Change users and tokens. It is for no robot, so a grant for one robot never has it.
    ManageUsers,
    /// Close all raw ports. It is for no robot, so a grant for one robot never has it.
    CloseRawPorts,
    /// Open them again. It is for no robot, so a grant for one robot never has it.
    OpenRawPorts,
    /// Change the settings of the hall. It is for no robot, so a grant for one robot never has it.
    ManageSettings,
}

impl Right {
    /// The right that a request with this effect needs.
    #[must_use]
    pub fn for_effect(effect: Effect) -> Self {
        match effect {
            Effect::Reads => Self::Read,
            Effect::Stops => Self::Stop,
            Effect::Changes | Effect::Moves => Self::Command,
        }
    }

    /// The lowest role that has it.
    #[must_use]
    pub fn lowest_role(self) -> Role {
        match self {
            Self::Read => Role::Viewer,
            Self::Stop | Self::Command | Self::AcknowledgeAlarm => Role::Operator,
            Self::AcceptIdentity
            | Self::ReadAudit
            | Self::StorePrograms
            | Self::ShelveAlarm
            | Self::SetUpPanel
            | Self::CloseRawPorts => Role::Engineer,
            Self::TakeLease
            | Self::GrantCamera
            | Self::Configure
            | Self::ManageUsers
            | Self::OpenRawPorts
            | Self::ManageSettings => Role::Admin,
        }
    }
}

/// The robots of a grant that is not for all of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Only(BTreeSet<RobotName>);

impl Only {
    /// The most robots: of more than these, a grant for all is clearer.
    pub const MOST: usize = 100;

    /// What they are, for people.
    pub const WANTED: &str = "names of robots with commas between them, such as press-4,saw: 1 to 100 names, each of 1 to 32 \
                              characters: a to z, digits and -";

    /// The robots with these names, with commas between them; `None` if one is no name, or if there are too
    /// many.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let names = text.split(',').map(RobotName::new).collect::<Option<BTreeSet<_>>>()?;
        (names.len() <= Self::MOST).then_some(Self(names))
    }

    /// Whether this robot is one of them.
    #[must_use]
    pub fn covers(&self, robot: &str) -> bool {
        self.0.iter().any(|name| name.as_str() == robot)
    }

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &RobotName> {
        self.0.iter()
    }
}

impl From<RobotName> for Only {
    fn from(robot: RobotName) -> Self {
        Self([robot].into())
    }
}

impl fmt::Display for Only {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, name) in self.0.iter().enumerate() {
            let comma = if at == 0 { "" } else { "," };
            write!(f, "{comma}{name}")?;
        }
        Ok(())
    }
}

/// What a token or a user may do: a role, for some robots or for all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grant {
    /// The role.
    pub role: Role,
    /// The only robots; `None` for all.
    pub only: Option<Only>,
}

impl Grant {
    /// Whether it allows this for this robot.
    #[must_use]
    pub fn allows(&self, right: Right, robot: &str) -> bool {
        self.covers(robot) && self.role >= right.lowest_role()
    }

    /// Whether it is for this robot.
    #[must_use]
    pub fn covers(&self, robot: &str) -> bool {
        self.only.as_ref().is_none_or(|only| only.covers(robot))
    }

    /// Whether it allows this for one robot at least.
    #[must_use]
    pub fn allows_somewhere(&self, right: Right) -> bool {
        self.role >= right.lowest_role()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_role_may_do_what_the_table_of_the_page_says() {
        let rights = [
            Right::Read,
            Right::Stop,
            Right::Command,
            Right::AcknowledgeAlarm,
            Right::ShelveAlarm,
            Right::SetUpPanel,
            Right::AcceptIdentity,
            Right::ReadAudit,
            Right::StorePrograms,
            Right::TakeLease,
            Right::GrantCamera,
            Right::Configure,
            Right::ManageUsers,
            Right::ManageSettings,
            Right::CloseRawPorts,
            Right::OpenRawPorts,
        ];
        for (role, allowed) in [
            (
                Role::Viewer,
                [
                    true, false, false, false, false, false, false, false, false, false, false, false, false,
                    false, false, false,
                ],
            ),
            (
                Role::Operator,
                [
                    true, true, true, true, false, false, false, false, false, false, false, false, false,
                    false, false, false,
                ],
            ),
            (
                Role::Engineer,
                [
                    true, true, true, true, true, true, true, true, true, false, false, false, false, false,
                    true, false,
                ],
            ),
            (Role::Admin, [true; 16]),
        ] {
            let all = Grant { role, only: None };
            let one = Grant { role, only: Only::read("press") };
            for (right, allowed) in rights.into_iter().zip(allowed) {
                assert_eq!(all.allows(right, "press"), allowed, "{role:?} {right:?}");
                assert_eq!(one.allows(right, "press"), allowed, "{role:?} {right:?}");
                assert!(!one.allows(right, "saw"), "{role:?} {right:?}");
            }
        }
    }

    #[test]
    fn a_grant_for_some_robots_is_for_these_alone() {
        let some = Grant { role: Role::Operator, only: Only::read("saw,press-4,saw") };
        assert_eq!(some.only.as_ref().map(ToString::to_string).as_deref(), Some("press-4,saw"));
        let covered =
            ["press-4", "saw", "press", "press-4,saw", ""].map(|robot| some.allows(Right::Stop, robot));
        assert_eq!(covered, [true, true, false, false, false]);
        let many: Vec<_> = (0..=Only::MOST).map(|number| format!("r{number}")).collect();
        for bad in ["", ",", "saw,", "saw, press", "Saw", "saw;press", &many.join(",")] {
            assert_eq!(Only::read(bad), None, "{bad}");
        }
        assert!(Only::read(&many[1..].join(",")).is_some());
    }

    #[test]
    fn what_changes_or_moves_needs_more_than_a_viewer() {
        for effect in [Effect::Changes, Effect::Moves, Effect::Stops] {
            assert!(Right::for_effect(effect).lowest_role() > Role::Viewer);
        }
        assert_eq!(Right::for_effect(Effect::Reads).lowest_role(), Role::Viewer);
    }
}
