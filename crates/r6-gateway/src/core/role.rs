//! Roles, and what each may do.

use std::collections::BTreeMap;
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
    /// Store and remove programs and points. They are for no robot, so a grant with a list of robots never
    /// has it.
    StorePrograms,
    /// Take the lease from its holder.
    TakeLease,
    /// Give and revoke the standing grants of cameras.
    GrantCamera,
    /// Add, change and remove a robot.
    Configure,
    /// Change users and tokens. It is for no robot, so a grant with a list of robots never has it.
    ManageUsers,
    /// Close all raw ports. It is for no robot, so a grant with a list of robots never has it.
    CloseRawPorts,
    /// Open them again. It is for no robot, so a grant with a list of robots never has it.
    OpenRawPorts,
    /// Change the settings of the hall. It is for no robot, so a grant with a list of robots never has it.
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

/// The robots of a grant that is not the same for all of them: each with the role of the grant, or with a
/// lower one of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrantRobots {
    /// Those with a name. `None` is the role of the grant.
    named: BTreeMap<RobotName, Option<Role>>,
    /// All others; `None` if the grant is not for them.
    others: Option<Option<Role>>,
}

/// Stands for all robots that are not named.
const OTHERS: &str = "*";

impl GrantRobots {
    /// The most names: of more than these, a grant for all is clearer.
    pub const MOST: usize = 100;

    /// The robots in this text: `press-4,saw=viewer,*=viewer`.
    ///
    /// # Errors
    /// [`BadRobots`]: what is wrong with it.
    pub fn read(text: &str) -> Result<Self, BadRobots> {
        let mut robots = Self { named: BTreeMap::new(), others: None };
        for part in text.split(',') {
            let (name, role) = match part.split_once('=') {
                None => (part, None),
                Some((name, word)) => (name, Some(Role::of_word(word).ok_or_else(|| BadRobots::role(word))?)),
            };
            if name == OTHERS {
                if robots.others.replace(role).is_some_and(|before| before != role) {
                    return Err(BadRobots::Twice(OTHERS.to_owned()));
                }
                continue;
            }
            let name = RobotName::new(name).ok_or_else(|| BadRobots::Name(short(name)))?;
            if robots.named.get(&name).is_some_and(|before| *before != role) {
                return Err(BadRobots::Twice(name.to_string()));
            }
            robots.named.insert(name, role);
            if robots.named.len() > Self::MOST {
                return Err(BadRobots::TooMany);
            }
        }
        Ok(robots)
    }

    /// The same for a grant of this role.
    ///
    /// # Errors
    /// [`BadRobots::TooHigh`]: a robot has a higher role.
    pub fn within(self, most: Role) -> Result<Self, BadRobots> {
        let too_high = self.each().find_map(|(robot, own)| {
            let robot = robot.map_or(OTHERS, RobotName::as_str).to_owned();
            own.filter(|own| *own > most).map(|role| BadRobots::TooHigh { robot, role, most })
        });
        too_high.map_or(Ok(self), Err)
    }

    /// The same in a grant of this role: a role of a robot that would be higher becomes this one.
    #[must_use]
    pub fn up_to(self, most: Role) -> Self {
        let own = |role: Option<Role>| role.map(|role| role.min(most));
        let named = self.named.into_iter().map(|(name, role)| (name, own(role))).collect();
        Self { named, others: self.others.map(own) }
    }

    /// The names in it.
    pub fn names(&self) -> impl Iterator<Item = &RobotName> {
        self.named.keys()
    }

    /// Each of them with its own role, if it has one; without a name all others.
    pub fn each(&self) -> impl Iterator<Item = (Option<&RobotName>, Option<Role>)> {
        let named = self.named.iter().map(|(name, role)| (Some(name), *role));
        named.chain(self.others.map(|role| (None, role)))
    }
}

impl From<RobotName> for GrantRobots {
    fn from(robot: RobotName) -> Self {
        Self { named: [(robot, None)].into(), others: None }
    }
}

impl fmt::Display for GrantRobots {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, (name, role)) in self.each().enumerate() {
            let comma = if at == 0 { "" } else { "," };
            write!(f, "{comma}{}", name.map_or(OTHERS, RobotName::as_str))?;
            if let Some(role) = role {
                write!(f, "={}", role.word())?;
            }
        }
        Ok(())
    }
}

/// Why a text does not name the robots of a grant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BadRobots {
    /// This is no name.
    Name(String),
    /// This is no role.
    Role {
        /// What stands there.
        word: String,
        /// The role that may be meant.
        nearest: Option<Role>,
    },
    /// A robot has two roles.
    Twice(String),
    /// A robot has a higher role than the grant.
    TooHigh {
        /// The robot, or `*`.
        robot: String,
        /// Its role.
        role: Role,
        /// That of the grant.
        most: Role,
    },
    /// There are more than [`GrantRobots::MOST`].
    TooMany,
}

impl BadRobots {
    fn role(word: &str) -> Self {
        let nearest = r6_proto::nearest(word, Role::ALL.map(Role::word)).and_then(Role::of_word);
        Self::Role { word: short(word), nearest }
    }
}

/// The begin of a text, to show what is wrong in it.
fn short(text: &str) -> String {
    r6_proto::printable(&text.chars().take(40).collect::<String>()).to_string()
}

impl fmt::Display for BadRobots {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => write!(
                f,
                "`{name}` is no robot: it has to be names with commas between them, such as press-4,saw, each of 1 to 32 \
                 characters (a to z, digits and -); `*` for all others; after `=` a lower role, such as saw=viewer"
            ),
            Self::Role { word, nearest } => {
                let words = Role::ALL.map(Role::word).join(", ");
                write!(f, "`{word}` is no role: it has to be one of {words}")?;
                nearest.map_or(Ok(()), |near| write!(f, "; nearest: `{}`", near.word()))
            }
            Self::Twice(robot) => write!(f, "`{robot}` stands there with two roles"),
            Self::TooHigh { robot, role, most } => {
                let (role, most) = (role.word(), most.word());
                write!(f, "`{robot}={role}` is above the role {most}: raise the role, or lower this one")
            }
            Self::TooMany => write!(
                f,
                "more than {} robots: split them over several tokens or users, or let `*` stand for all others, those of later \
                 included",
                GrantRobots::MOST
            ),
        }
    }
}

/// What a token or a user may do: a role, for some robots or for all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grant {
    /// The role. No robot has a higher one.
    pub role: Role,
    /// The robots and their roles; `None` for all, with this role. Only then the grant has the rights that
    /// are for no robot.
    pub robots: Option<GrantRobots>,
}

impl Grant {
    /// The grant of this role for these robots.
    ///
    /// # Errors
    /// [`BadRobots::TooHigh`]: one of them has a higher role.
    pub fn new(role: Role, robots: Option<GrantRobots>) -> Result<Self, BadRobots> {
        Ok(Self { role, robots: robots.map(|robots| robots.within(role)).transpose()? })
    }

    /// The role for this robot; `None` if the grant is not for it.
    #[must_use]
    pub fn role_for(&self, robot: &str) -> Option<Role> {
        let Some(robots) = &self.robots else { return Some(self.role) };
        let others = || robots.others.filter(|_| RobotName::is_name(robot));
        let own = robots.named.get(robot).copied().or_else(others)?;
        Some(own.map_or(self.role, |own| own.min(self.role)))
    }

    /// Whether it allows this for this robot.
    #[must_use]
    pub fn allows(&self, right: Right, robot: &str) -> bool {
        self.role_for(robot).is_some_and(|role| role >= right.lowest_role())
    }

    /// Whether it is for this robot.
    #[must_use]
    pub fn covers(&self, robot: &str) -> bool {
        self.role_for(robot).is_some()
    }

    /// Whether it is for all robots alike. A grant that names robots is not, whichever it names.
    #[must_use]
    pub fn is_for_all(&self) -> bool {
        self.robots.is_none()
    }

    /// Whether it allows this for all robots alike.
    #[must_use]
    pub fn allows_for_all(&self, right: Right) -> bool {
        self.is_for_all() && self.role >= right.lowest_role()
    }

    /// Whether it allows this for one robot at least.
    #[must_use]
    pub fn allows_somewhere(&self, right: Right) -> bool {
        self.highest() >= right.lowest_role()
    }

    /// The highest role that it has for a robot.
    #[must_use]
    pub fn highest(&self) -> Role {
        let own = |(_, own): (_, Option<Role>)| own.map_or(self.role, |own| own.min(self.role));
        self.robots.iter().flat_map(GrantRobots::each).map(own).max().unwrap_or(self.role)
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
            let all = Grant { role, robots: None };
            let one = Grant { role, robots: Some(GrantRobots::read("press").unwrap()) };
            for (right, allowed) in rights.into_iter().zip(allowed) {
                assert_eq!(all.allows(right, "press"), allowed, "{role:?} {right:?}");
                assert_eq!(all.allows_for_all(right), allowed, "{role:?} {right:?}");
                assert_eq!(one.allows(right, "press"), allowed, "{role:?} {right:?}");
                assert!(!one.allows(right, "saw"), "{role:?} {right:?}");
                assert!(!one.allows_for_all(right), "{role:?} {right:?}");
            }
        }
    }

    #[test]
    fn a_grant_for_some_robots_is_for_these_alone() {
        let some = Grant { role: Role::Operator, robots: GrantRobots::read("saw,press-4,saw").ok() };
        assert_eq!(some.robots.as_ref().map(ToString::to_string).as_deref(), Some("press-4,saw"));
        let covered =
            ["press-4", "saw", "press", "press-4,saw", "", "*"].map(|robot| some.allows(Right::Stop, robot));
        assert_eq!(covered, [true, true, false, false, false, false]);
        let many: Vec<_> = (0..=GrantRobots::MOST).map(|number| format!("r{number}")).collect();
        assert_eq!(GrantRobots::read(&many.join(",")), Err(BadRobots::TooMany));
        assert!(GrantRobots::read(&many[1..].join(",")).is_ok());
        assert!(GrantRobots::read(&format!("{},*=viewer", many[1..].join(","))).is_ok());
    }

    #[test]
    fn each_robot_can_have_a_lower_role_of_its_own() {
        let text = "saw=viewer,press-4,*=operator";
        let robots = GrantRobots::read(text).unwrap();
        assert_eq!(robots.to_string(), "press-4,saw=viewer,*=operator");
        let grant = Grant::new(Role::Engineer, Some(robots)).unwrap();
        let roles = ["press-4", "saw", "mill", "", "*", "Mill", "a,b"].map(|robot| grant.role_for(robot));
        let (engineer, viewer, operator) = (Some(Role::Engineer), Some(Role::Viewer), Some(Role::Operator));
        assert_eq!(roles, [engineer, viewer, operator, None, None, None, None]);
        assert!(grant.allows_somewhere(Right::StorePrograms) && !grant.allows_for_all(Right::Read));
    }

    /// The role of a token tells what it has somewhere at most, so nothing is hidden behind a name.
    #[test]
    fn no_robot_has_a_higher_role_than_the_grant() {
        let robots = GrantRobots::read("press-4=admin,saw").unwrap();
        let refused = BadRobots::TooHigh { robot: "press-4".into(), role: Role::Admin, most: Role::Viewer };
        assert_eq!(Grant::new(Role::Viewer, Some(robots.clone())), Err(refused));
        // From a store that somebody else wrote.
        let grant = Grant { role: Role::Viewer, robots: Some(robots.clone()) };
        assert_eq!(grant.role_for("press-4"), Some(Role::Viewer));
        assert_eq!(grant.highest(), Role::Viewer);
        assert_eq!(robots.up_to(Role::Viewer).to_string(), "press-4=viewer,saw");
    }

    #[test]
    fn a_grant_with_lower_roles_alone_has_nothing_higher_anywhere() {
        let grant = Grant::new(Role::Admin, GrantRobots::read("saw=viewer").ok()).unwrap();
        assert_eq!(grant.highest(), Role::Viewer);
        assert!(!grant.allows_somewhere(Right::ReadAudit) && grant.allows_somewhere(Right::Read));
    }

    #[test]
    fn a_wrong_text_is_told_with_what_is_wrong() {
        for bad in ["", ",", "saw,", "saw, press", "Saw", "saw;press", "=viewer", "**"] {
            assert!(matches!(GrantRobots::read(bad), Err(BadRobots::Name(_))), "{bad}");
        }
        let told = |text| GrantRobots::read(text).unwrap_err().to_string();
        assert!(told("saw=operater").ends_with("; nearest: `operator`"), "{}", told("saw=operater"));
        assert!(told("saw=").starts_with("`` is no role"), "{}", told("saw="));
        assert!(told("saw=viewer=viewer").starts_with("`viewer=viewer` is no role"));
        for twice in ["saw,saw=viewer", "saw=viewer,saw=operator", "*,*=viewer"] {
            assert!(matches!(GrantRobots::read(twice), Err(BadRobots::Twice(_))), "{twice}");
        }
        assert!(told(&"\u{1b}".repeat(1_000)).len() < 600);
    }

    #[test]
    fn what_changes_or_moves_needs_more_than_a_viewer() {
        for effect in [Effect::Changes, Effect::Moves, Effect::Stops] {
            assert!(Right::for_effect(effect).lowest_role() > Role::Viewer);
        }
        assert_eq!(Right::for_effect(Effect::Reads).lowest_role(), Role::Viewer);
    }
}
