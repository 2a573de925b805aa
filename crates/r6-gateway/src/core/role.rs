//! Roles, and what each may do.

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
            | Self::SetUpPanel => Role::Engineer,
            Self::TakeLease
            | Self::GrantCamera
            | Self::Configure
            | Self::ManageUsers
            | Self::ManageSettings => Role::Admin,
        }
    }
}

/// What a token or a user may do: a role, for one robot or for all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grant {
    /// The role.
    pub role: Role,
    /// The only robot; `None` for all.
    pub only: Option<RobotName>,
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
        self.only.as_ref().is_none_or(|only| only.as_str() == robot)
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
        ];
        for (role, allowed) in [
            (
                Role::Viewer,
                [
                    true, false, false, false, false, false, false, false, false, false, false, false, false,
                    false,
                ],
            ),
            (
                Role::Operator,
                [
                    true, true, true, true, false, false, false, false, false, false, false, false, false,
                    false,
                ],
            ),
            (
                Role::Engineer,
                [true, true, true, true, true, true, true, true, true, false, false, false, false, false],
            ),
            (Role::Admin, [true; 14]),
        ] {
            let all = Grant { role, only: None };
            let one = Grant { role, only: RobotName::new("press") };
            for (right, allowed) in rights.into_iter().zip(allowed) {
                assert_eq!(all.allows(right, "press"), allowed, "{role:?} {right:?}");
                assert_eq!(one.allows(right, "press"), allowed, "{role:?} {right:?}");
                assert!(!one.allows(right, "saw"), "{role:?} {right:?}");
            }
        }
    }

    #[test]
    fn what_changes_or_moves_needs_more_than_a_viewer() {
        for effect in [Effect::Changes, Effect::Moves, Effect::Stops] {
            assert!(Right::for_effect(effect).lowest_role() > Role::Viewer);
        }
        assert_eq!(Right::for_effect(Effect::Reads).lowest_role(), Role::Viewer);
    }
}
