//! Accounts of people: names, passwords, and which change of an account is allowed.
//!
//! [`decide`] alone says whether an account may be made, changed or removed. The store calls it in the
//! transaction that writes the change, so that the gateway and the command line cannot both remove one of the
//! last two admins.

use std::fmt;

use r6_api::gateway::Role;

use crate::core::role::{Grant, GrantRobots, Right};

/// The most accounts. They are all held in memory, and listed at once.
pub const MAX_ACCOUNTS: usize = 1_000;

/// The shortest and the longest password, in characters. Short ones can be guessed from a stolen hash. The
/// upper limit bounds the work for a stranger's text; 128 characters are more than a sentence.
pub const PASSWORD_LENGTH: (usize, usize) = (12, 128);

/// A name of a user: 1 to 64 characters out of `a` to `z`, digits, `-`, `_` and `.`, the first one a letter.
///
/// The audit log names users beside tokens, raw clients and the gateway itself. So a name cannot be a number,
/// and not one of their words.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct UserName(String);

impl UserName {
    /// What a name is, for people.
    pub const WANTED: &str = "a name of 1 to 64 characters: a to z, digits, -, _ and ., a letter first, and not gateway, \
                              shell, raw or link";

    /// Actors of the audit log that are not users.
    const TAKEN: [&str; 4] = ["gateway", "shell", "raw", "link"];

    /// The name; `None` if the text is no name.
    #[must_use]
    pub fn new(text: &str) -> Option<Self> {
        let fits = |byte: u8| {
            byte.is_ascii_lowercase() || byte.is_ascii_digit() || matches!(byte, b'-' | b'_' | b'.')
        };
        let begins = text.bytes().next().is_some_and(|byte| byte.is_ascii_lowercase());
        let is_name = begins && text.len() <= 64 && text.bytes().all(fits) && !Self::TAKEN.contains(&text);
        is_name.then(|| Self(text.to_owned()))
    }

    /// Its text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for UserName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Whether a text can be a password: any characters, within [`PASSWORD_LENGTH`].
#[must_use]
pub fn is_password(text: &str) -> bool {
    let (least, most) = PASSWORD_LENGTH;
    // One more than the limit is enough to know.
    (least..=most).contains(&text.chars().take(most + 1).count())
}

/// The hash of a password, as a PHC string. `Debug` does not show it.
#[derive(Clone, PartialEq, Eq)]
pub struct PasswordHash(pub String);

impl fmt::Debug for PasswordHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("PasswordHash(..)")
    }
}

/// An account of a person.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Account {
    /// The name.
    pub name: UserName,
    /// What it allows.
    pub grant: Grant,
    /// Whether it was disabled: it stays, and cannot be used.
    pub disabled: bool,
    /// The hash of the password; `None` until one was set.
    pub password: Option<PasswordHash>,
}

impl Account {
    /// Whether it can be used to change accounts.
    fn manages(&self) -> bool {
        self.grant.allows_for_all(Right::ManageUsers) && !self.disabled && self.password.is_some()
    }
}

/// Whether an account can be used to change accounts: an admin of all robots, with a password, not disabled.
pub fn has_admin<'a>(accounts: impl IntoIterator<Item = &'a Account>) -> bool {
    accounts.into_iter().any(Account::manages)
}

/// What shall become of an account.
#[derive(Clone, Debug)]
pub enum Wish {
    /// Make an account that is not there yet.
    Add(Grant),
    /// Make the first admin, with this password. Refused if there is an admin.
    FirstAdmin(PasswordHash),
    /// Make an account, or change the account of this name. What is `None` stays as it is; a new account is
    /// for all robots, and is not disabled.
    Put {
        /// Its role.
        role: Role,
        /// The robots and their roles, none above `role`; or `None` for all.
        robots: Option<Option<GrantRobots>>,
        /// Whether it is disabled.
        disabled: Option<bool>,
        /// The new password.
        password: Option<PasswordHash>,
    },
    /// Disable an account.
    Disable,
    /// Give an account another password.
    Password(PasswordHash),
    /// Remove an account.
    Remove,
}

impl Wish {
    /// Whether it sets a password.
    #[must_use]
    pub fn sets_password(&self) -> bool {
        matches!(self, Self::FirstAdmin(_) | Self::Password(_) | Self::Put { password: Some(_), .. })
    }
}

/// Why an account stays as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Denied {
    /// No user could change accounts any more.
    LastAdmin,
    /// There is no account with this name.
    NoSuchUser,
    /// There is an account with this name.
    NameTaken,
    /// There is an admin already.
    HasAdmin,
    /// There are [`MAX_ACCOUNTS`].
    TooMany,
}

impl fmt::Display for Denied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LastAdmin => {
                f.write_str("this is the last admin of all robots who can sign in: make another one first")
            }
            Self::NoSuchUser => f.write_str("there is no user with this name"),
            Self::NameTaken => f.write_str("there is a user with this name already"),
            Self::HasAdmin => f.write_str("there is an admin already, who makes the other users"),
            Self::TooMany => write!(f, "there are {MAX_ACCOUNTS} users: remove some first"),
        }
    }
}

/// What becomes of an account.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Decided {
    /// It is made.
    Made(Account),
    /// It is changed to this.
    Changed(Account),
    /// It is as it shall be.
    Same,
    /// It is removed.
    Removed,
}

/// Decides about a wish. `accounts` are all that there are.
///
/// # Errors
/// [`Denied`]: nothing changes.
pub fn decide(accounts: &[Account], name: &UserName, wish: &Wish) -> Result<Decided, Denied> {
    let present = accounts.iter().find(|account| account.name == *name);
    let present_or = || present.cloned().ok_or(Denied::NoSuchUser);
    let wanted = match wish {
        Wish::Add(_) | Wish::FirstAdmin(_) if present.is_some() => return Err(Denied::NameTaken),
        Wish::FirstAdmin(_) if has_admin(accounts) => return Err(Denied::HasAdmin),
        Wish::Add(grant) => {
            Some(Account { name: name.clone(), grant: grant.clone(), disabled: false, password: None })
        }
        Wish::FirstAdmin(password) => Some(Account {
            name: name.clone(),
            grant: Grant { role: Role::Admin, robots: None },
            disabled: false,
            password: Some(password.clone()),
        }),
        Wish::Put { role, robots, disabled, password } => {
            // If the role becomes a lower one, so do those of its robots.
            let kept = || present.map(|account| account.grant.robots.clone().map(|kept| kept.up_to(*role)));
            let robots = robots.clone().or_else(kept);
            Some(Account {
                name: name.clone(),
                grant: Grant { role: *role, robots: robots.flatten() },
                disabled: disabled.or_else(|| present.map(|account| account.disabled)).unwrap_or(false),
                password: password.clone().or_else(|| present.and_then(|account| account.password.clone())),
            })
        }
        Wish::Disable => Some(Account { disabled: true, ..present_or()? }),
        Wish::Password(password) => Some(Account { password: Some(password.clone()), ..present_or()? }),
        Wish::Remove => {
            present_or()?;
            None
        }
    };
    if present.is_none() && accounts.len() >= MAX_ACCOUNTS {
        return Err(Denied::TooMany);
    }
    let others = accounts.iter().filter(|account| account.name != *name);
    if has_admin(accounts) && !has_admin(others.chain(&wanted)) {
        return Err(Denied::LastAdmin);
    }
    Ok(match (present, wanted) {
        (_, None) => Decided::Removed,
        (None, Some(account)) => Decided::Made(account),
        (Some(present), Some(account)) if *present == account => Decided::Same,
        (Some(_), Some(account)) => Decided::Changed(account),
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_name_cannot_be_taken_for_another_actor() {
        for good in ["a", "anna", "anna.b-2_c", &"x".repeat(64)] {
            assert_eq!(UserName::new(good).unwrap().as_str(), good);
        }
        for bad in [
            "",
            "Anna",
            "3",
            "3 (anna)",
            "-a",
            "gateway",
            "shell",
            "raw",
            "link",
            "ä",
            "a b",
            &"x".repeat(65),
        ] {
            assert_eq!(UserName::new(bad), None, "{bad}");
        }
    }

    #[test]
    fn a_password_has_any_characters_within_its_length() {
        for good in ["twelve chars", "пароль-пароль", &"字".repeat(12), &"x".repeat(128), &"🔑".repeat(128)]
        {
            assert!(is_password(good), "{good}");
        }
        for bad in ["", "eleven char", &"字".repeat(11), &"x".repeat(129), &"x".repeat(16_000)] {
            assert!(!is_password(bad), "{bad}");
        }
        assert_eq!(format!("{:?}", PasswordHash("secret".to_owned())), "PasswordHash(..)");
    }

    fn names() -> impl Strategy<Value = UserName> {
        prop::sample::select(vec!["anna", "ben", "cem"]).prop_map(|name| UserName::new(name).unwrap())
    }

    fn grants() -> impl Strategy<Value = Grant> {
        let robots = prop::sample::select(vec!["press,saw", "press=viewer,*", "*"]);
        let robots = prop::option::weighted(0.2, robots.prop_map(|text| GrantRobots::read(text).unwrap()));
        (prop::sample::select(vec![Role::Viewer, Role::Admin, Role::Admin]), robots)
            .prop_map(|(role, robots)| Grant { role, robots })
    }

    fn wishes() -> impl Strategy<Value = Wish> {
        let hash = || any::<u8>().prop_map(|byte| PasswordHash(byte.to_string()));
        prop_oneof![
            grants().prop_map(Wish::Add),
            hash().prop_map(Wish::FirstAdmin),
            (grants(), any::<[bool; 3]>(), prop::option::of(hash())).prop_map(
                |(Grant { role, robots }, [told_robots, told_disabled, disabled], password)| {
                    let (robots, disabled) =
                        (told_robots.then_some(robots), told_disabled.then_some(disabled));
                    Wish::Put { role, robots, disabled, password }
                }
            ),
            Just(Wish::Disable),
            hash().prop_map(Wish::Password),
            Just(Wish::Remove),
        ]
    }

    proptest! {
        /// Whatever is wished for: once there is an admin who can sign in, there is always one. No name is
        /// there twice. A first admin is made only where there is no admin.
        #[test]
        fn an_admin_stays(steps in prop::collection::vec((names(), wishes()), 1..60)) {
            let mut accounts: Vec<Account> = Vec::new();
            for (name, wish) in steps {
                let had_admin = has_admin(&accounts);
                let was_there = accounts.iter().any(|account| account.name == name);
                match decide(&accounts, &name, &wish) {
                    Ok(Decided::Made(account)) => {
                        prop_assert!(!was_there && account.name == name);
                        prop_assert!(!matches!(wish, Wish::FirstAdmin(_)) || !had_admin);
                        accounts.push(account);
                    }
                    Ok(Decided::Changed(account)) => {
                        prop_assert!(was_there && account.name == name);
                        accounts.retain(|other| other.name != name);
                        accounts.push(account);
                    }
                    Ok(Decided::Same) => prop_assert!(was_there),
                    Ok(Decided::Removed) => accounts.retain(|other| other.name != name),
                    Err(Denied::LastAdmin) => prop_assert!(had_admin),
                    Err(Denied::NoSuchUser) => prop_assert!(!was_there),
                    Err(Denied::NameTaken) => prop_assert!(was_there),
                    Err(Denied::HasAdmin) => prop_assert!(had_admin),
                    Err(Denied::TooMany) => prop_assert!(false),
                }
                prop_assert!(!had_admin || has_admin(&accounts));
            }
        }
    }

    fn account(grant: Grant) -> Account {
        let name = UserName::new("anna").unwrap();
        Account { name, grant, disabled: false, password: Some(PasswordHash("hash".to_owned())) }
    }

    #[test]
    fn an_admin_with_a_list_of_robots_cannot_change_accounts() {
        let with = |robots| Grant { role: Role::Admin, robots };
        assert!(has_admin(&[account(with(None))]));
        for list in ["*", "press,*", "press"] {
            assert!(!has_admin(&[account(with(GrantRobots::read(list).ok()))]), "{list}");
        }
    }

    #[test]
    fn a_role_that_falls_takes_those_of_the_robots_with_it() {
        let robots = GrantRobots::read("press,saw=operator,*=viewer").ok();
        let before = account(Grant { role: Role::Engineer, robots });
        let put = |role| Wish::Put { role, robots: None, disabled: None, password: None };
        let lowered = decide(std::slice::from_ref(&before), &before.name, &put(Role::Viewer));
        let Ok(Decided::Changed(lowered)) = lowered else { panic!("{lowered:?}") };
        let raised = decide(std::slice::from_ref(&lowered), &before.name, &put(Role::Admin));
        let Ok(Decided::Changed(raised)) = raised else { panic!("{raised:?}") };
        let shown = |account: &Account| account.grant.robots.as_ref().map(ToString::to_string);
        assert_eq!(shown(&lowered).as_deref(), Some("press,saw=viewer,*=viewer"));
        assert_eq!(shown(&raised).as_deref(), Some("press,saw=viewer,*=viewer"));
        assert_eq!((lowered.grant.role, raised.grant.role), (Role::Viewer, Role::Admin));
    }

    #[test]
    fn there_is_no_room_for_accounts_without_end() {
        let grant = Grant { role: Role::Viewer, robots: None };
        let account = |number: usize| Account {
            name: UserName::new(&format!("u{number}")).unwrap(),
            grant: grant.clone(),
            disabled: false,
            password: None,
        };
        let accounts: Vec<_> = (0..MAX_ACCOUNTS).map(account).collect();
        let add = Wish::Add(grant.clone());
        assert_eq!(decide(&accounts, &UserName::new("one-more").unwrap(), &add), Err(Denied::TooMany));
        assert_eq!(decide(&accounts, &accounts[0].name, &Wish::Remove), Ok(Decided::Removed));
    }
}
