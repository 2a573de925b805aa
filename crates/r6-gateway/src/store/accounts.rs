//! What every store checks before it changes a user or keeps a link, and the records about that.

use r6_api::gateway::{AuditRecord, Deed};

use super::{Author, Link, StoreError, StoredUser, UserChange};
use crate::core::account::{self, Account, Decided, Denied};

/// What has to be checked before a change, for every store: the link, the stamp, and the rules of accounts.
/// `link` is the link of the change, as the store has it.
pub(super) fn decide(
    users: &[StoredUser],
    change: &UserChange,
    link: Option<&Link>,
) -> Result<Decided, StoreError> {
    if let Some((_, now)) = change.link
        && !link.is_some_and(|link| link.is_valid(now) && link.allows(change))
    {
        return Err(StoreError::LinkVoid);
    }
    let present = users.iter().find(|user| user.account.name == change.name);
    if change.if_stamp.is_some_and(|wanted| present.map(|user| user.stamp) != Some(wanted)) {
        return Err(StoreError::UserChanged);
    }
    let accounts: Vec<_> = users.iter().map(|user| user.account.clone()).collect();
    account::decide(&accounts, &change.name, &change.wish).map_err(StoreError::Denied)
}

/// Whether a link may be kept.
pub(super) fn check_link(users: &[StoredUser], link: &Link) -> Result<(), StoreError> {
    let denied = match &link.user {
        None if account::has_admin(users.iter().map(|user| &user.account)) => Denied::HasAdmin,
        Some(user) if users.iter().all(|known| known.account.name != *user) => Denied::NoSuchUser,
        None | Some(_) => return Ok(()),
    };
    Err(StoreError::Denied(denied))
}

/// The record about a link.
pub(super) fn link_made(link: &Link, author: &Author) -> AuditRecord {
    author.record(Deed::LinkMade { user: link.user.as_ref().map(ToString::to_string) })
}

/// The record about a change of a user; `None` if nothing changes.
pub(super) fn user_changed(change: &UserChange, decided: &Decided, author: &Author) -> Option<AuditRecord> {
    let user = change.name.to_string();
    let deed = match decided {
        Decided::Same => return None,
        Decided::Removed => Deed::UserRemoved { user },
        Decided::Made(Account { grant, disabled, .. }) => {
            let only = grant.robots.as_ref().map(ToString::to_string);
            Deed::UserMade { user, role: grant.role, only, disabled: *disabled }
        }
        Decided::Changed(Account { grant, disabled, .. }) => {
            let only = grant.robots.as_ref().map(ToString::to_string);
            let new_password = change.wish.sets_password();
            Deed::UserChanged { user, role: grant.role, only, disabled: *disabled, new_password }
        }
    };
    Some(author.record(deed))
}
