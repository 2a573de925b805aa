//! Why the gateway did not do what it was asked for.

use std::time::Duration;

use r6_api::Code;
use r6_client::{Invalid, NotSent, OutcomeUnknown, Refused, RequestError};

use crate::core::account;
use crate::core::library::Unfit;
use crate::core::seat::Denied;
use crate::store::{LibraryError, StoreError};

/// A problem: a code for programs, and a sentence for people.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The code.
    pub code: Code,
    /// The sentence.
    pub message: String,
    /// What the controller itself gave as the reason, if it refused and gave one.
    pub reason: Option<String>,
    /// How long to wait before the next try, if that is known.
    pub retry_after: Option<Duration>,
    /// The number of the command in the audit log, if its intent was written.
    pub command_id: Option<u64>,
}

impl Problem {
    /// A problem.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), reason: None, retry_after: None, command_id: None }
    }

    /// `too_many_requests`: it can be tried again after this time.
    pub fn too_many(after: Duration) -> Self {
        Self { retry_after: Some(after), ..Self::new(Code::TooManyRequests, "too many tries: wait") }
    }

    /// A query without values.
    pub fn of_query(error: &RequestError) -> Self {
        let problem = Self::of_request(error);
        let code = match error {
            RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. }) => Code::IdentityChanged,
            // A query changes nothing: there is no outcome to look for.
            RequestError::OutcomeUnknown(_) | RequestError::Refused(_) => Code::NoReply,
            RequestError::Invalid(_) => Code::BadValue,
            RequestError::NotSent(_) => problem.code,
        };
        Self { code, ..problem }
    }

    /// A command that the client did not send, or that was not accepted.
    pub fn of_request(error: &RequestError) -> Self {
        let code = match error {
            RequestError::Invalid(Invalid::OutsideEnvelope(_)) => Code::BeyondLimits,
            RequestError::Invalid(_) => Code::BadCommand,
            RequestError::NotSent(NotSent::Overtaken) => Code::Stopped,
            RequestError::NotSent(NotSent::Busy { .. } | NotSent::NoRoom(_)) => Code::Overloaded,
            RequestError::NotSent(NotSent::AnotherRobot { .. }) => Code::IdentityChanged,
            RequestError::NotSent(_) => Code::NotReady,
            RequestError::Refused(_) => Code::Refused,
            RequestError::OutcomeUnknown(_) => Code::OutcomeUnknown,
        };
        let reason = match error {
            RequestError::Refused(
                Refused::Command { reason, .. }
                | Refused::InstructionList { reason }
                | Refused::Points { reason },
            ) => reason.clone(),
            RequestError::Invalid(_) | RequestError::NotSent(_) | RequestError::OutcomeUnknown(_) => None,
        };
        Self { reason, ..Self::new(code, error.to_string()) }
    }
}

impl From<Denied> for Problem {
    fn from(denied: Denied) -> Self {
        let code = match &denied {
            Denied::NoLease => Code::NoLease,
            Denied::NoGrant => Code::NotAllowed,
            Denied::Leased { .. } | Denied::BeingTaken | Denied::RunEnding => Code::Leased,
            Denied::RunUnderWay | Denied::RunOver => Code::RunUnderWay,
            Denied::Stopped | Denied::StopUnderWay | Denied::StoppedSince => Code::Stopped,
            Denied::IdentityChanged | Denied::AnotherIdentity => Code::IdentityChanged,
            Denied::NotUp
            | Denied::Manual
            | Denied::Closed
            | Denied::Reconfiguring
            | Denied::ListLeft
            | Denied::NothingOwed
            | Denied::InReach
            | Denied::NoStopHolds
            | Denied::Overtaken => Code::NotReady,
            Denied::NeedsNone => Code::BadCommand,
        };
        Self::new(code, denied.to_string())
    }
}

impl From<LibraryError> for Problem {
    fn from(error: LibraryError) -> Self {
        let code = match &error {
            LibraryError::NoSuchProgram => Code::NoSuchProgram,
            LibraryError::NoSuchPoint => Code::NoSuchPoint,
            LibraryError::Unfit(Unfit::NeedsIfMatch) => Code::NeedsIfMatch,
            LibraryError::Unfit(Unfit::NotThisVersion) => Code::NotThisVersion,
            LibraryError::TooManyPrograms | LibraryError::TooManyPoints | LibraryError::TooManyBytes => {
                Code::NoRoom
            }
            LibraryError::Store(_) => Code::StoreUnavailable,
        };
        Self::new(code, error.to_string())
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        let code = match &error {
            StoreError::Denied(account::Denied::LastAdmin) => Code::LastAdmin,
            StoreError::Denied(account::Denied::NoSuchUser) => Code::NoSuchUser,
            StoreError::Denied(account::Denied::NameTaken) => Code::NameTaken,
            StoreError::Denied(account::Denied::HasAdmin) | StoreError::LinkVoid => Code::LinkVoid,
            StoreError::Denied(account::Denied::TooMany) | StoreError::TooManyTokens => Code::NoRoom,
            StoreError::TooManyGrants => Code::NoRoom,
            StoreError::NoSuchToken(_) => Code::NoSuchToken,
            StoreError::TokenOfAnother(_) => Code::BadValue,
            StoreError::UserChanged => Code::NoSession,
            StoreError::AddressTaken(_) => Code::AddressTaken,
            StoreError::Unavailable(_)
            | StoreError::Broken(_)
            | StoreError::Unreadable(_)
            | StoreError::Closed => Code::StoreUnavailable,
            StoreError::NotOwner => Code::NoOwner,
        };
        Self::new(code, error.to_string())
    }
}
