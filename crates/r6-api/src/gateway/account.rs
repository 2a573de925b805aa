//! Users, their sessions, and tokens.

use std::fmt;

use serde::de::{Error as _, IgnoredAny};
use serde::{Deserialize, Deserializer, Serialize};

use super::Role;

/// A password or another secret. `Debug` does not show it, and no error repeats it.
#[derive(Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Secret(pub String);

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(..)")
    }
}

impl<'de> Deserialize<'de> for Secret {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// The message of serde about another type would repeat the value.
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Any {
            Text(String),
            Other(IgnoredAny),
        }
        match Any::deserialize(deserializer)? {
            Any::Text(text) => Ok(Self(text)),
            Any::Other(_) => Err(D::Error::custom("a password or a secret has to be a text")),
        }
    }
}

/// Who signs in.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SignIn {
    /// The name of the user.
    #[cfg_attr(feature = "openapi", schema(example = "anna"))]
    pub name: String,
    /// The password.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub password: Secret,
}

/// A browser that signs in with a token.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct TokenSignIn {
    /// The token.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub token: Secret,
}

/// A browser that signs in with a link.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LinkSignIn {
    /// The secret of the link: 64 hexadecimal digits. Behind the `#` it stands as base64url.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub secret: Secret,
    /// Whether only to say for whom the session would be.
    #[serde(default)]
    pub look: bool,
}

/// Who calls: a user with a session, or a token.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Session {
    /// The name of the user; `null` for a token.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub user: Option<String>,
    /// The number of the token; `null` for a user.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub token: Option<i64>,
    /// What people call the token; `null` for a user, and for a token without a name.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub token_name: Option<String>,
    /// What the caller may do at most.
    pub role: Role,
    /// The robots, with commas between them; `null` for all. `press-4` has the role above, `saw=viewer` a
    /// lower one, and `*` stands for all others.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub robot: Option<String>,
    /// Send it as `X-CSRF-Token` with every request that is no `GET`; `null` for a token without a session,
    /// which needs none.
    #[cfg_attr(feature = "openapi", schema(required = true, value_type = Option<String>))]
    pub csrf: Option<Secret>,
    /// When the session ends if no other request comes; `null` for a token without one.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub idle_ends_in_ms: Option<u64>,
    /// When the session or the token ends in any case; `null` without a session if the token
    /// has no end.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub ends_in_ms: Option<u64>,
}

/// Another password for the caller.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PasswordChange {
    /// The password until now.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub old: Secret,
    /// The new one: 12 to 128 characters.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub new: Secret,
}

/// What a one-time link is used for.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// The secret of the link.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub secret: Secret,
    /// The name of the first admin, or of the user whose link it is.
    #[cfg_attr(feature = "openapi", schema(example = "anna"))]
    pub name: String,
    /// The new password: 12 to 128 characters.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub password: Secret,
}

/// All users.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Users {
    /// In the order of their names.
    pub users: Vec<User>,
}

/// A user.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct User {
    /// The name.
    pub name: String,
    /// What the user may do at most.
    pub role: Role,
    /// The robots, with commas between them; `null` for all. `press-4` has the role above, `saw=viewer` a
    /// lower one, and `*` stands for all others.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub robot: Option<String>,
    /// Whether the user cannot sign in.
    pub disabled: bool,
    /// Whether a password was set. Without one, the user cannot sign in.
    pub has_password: bool,
    /// When the user was made.
    pub created: String,
}

/// What a user shall be.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct UserWanted {
    /// What the user may do at most.
    pub role: Role,
    /// The robots, 1 to 100 names with commas between them; `null` for all. `press-4` has `role`,
    /// `saw=viewer` a lower one, and `*` stands for all others. If it is missing, it stays, and a role in it
    /// that would be higher than `role` becomes that one; a new user is for all robots.
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<String>))]
    pub robot: Option<Option<String>>,
    /// Whether the user cannot sign in. If it is missing, it stays; a new user can.
    #[serde(default)]
    pub disabled: Option<bool>,
    /// A new password, 12 to 128 characters. If it is missing, the password stays.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<String>, format = Password))]
    pub password: Option<Secret>,
}

/// A field that is there, also with `null`.
fn present<'de, D: serde::Deserializer<'de>>(field: D) -> Result<Option<Option<String>>, D::Error> {
    Deserialize::deserialize(field).map(Some)
}

/// The tokens that are not revoked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Tokens {
    /// In the order of their numbers.
    pub tokens: Vec<Token>,
}

/// A token without its secret.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Token {
    /// Its number.
    pub number: i64,
    /// What it allows at most.
    pub role: Role,
    /// The robots, with commas between them; `null` for all. `press-4` has the role above, `saw=viewer` a
    /// lower one, and `*` stands for all others.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub robot: Option<String>,
    /// What people call it.
    pub name: String,
    /// When it ends or has ended; `null` if it holds until it is revoked.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub expires_at: Option<String>,
}

/// A token to make.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct TokenWanted {
    /// What it allows at most.
    pub role: Role,
    /// The robots, 1 to 100 names with commas between them; all robots if it is missing. `press-4` has the
    /// role above, `saw=viewer` a lower one, and `*` stands for all others.
    #[serde(default)]
    pub robot: Option<String>,
    /// What people call it: at most 64 characters.
    #[serde(default)]
    pub name: String,
    /// When it ends: RFC 3339 in UTC, in the future; it holds until it is revoked if this is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(example = "2027-01-31T00:00:00Z"))]
    pub expires_at: Option<String>,
}

/// A new token.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TokenMade {
    /// Its number.
    pub number: i64,
    /// The token itself. It is shown this once.
    #[cfg_attr(feature = "openapi", schema(value_type = String, format = Password))]
    pub token: Secret,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neither_debug_nor_an_error_shows_a_secret() {
        let body = r#"{"name":"anna","password":"correct horse"}"#;
        let sign_in: SignIn = serde_json::from_str(body).unwrap();
        assert_eq!(sign_in.password.0, "correct horse");
        assert_eq!(format!("{sign_in:?}"), r#"SignIn { name: "anna", password: Secret(..) }"#);
        for wrong in ["123456789012", "true", "[\"correct horse\"]", "{\"correct horse\":1}"] {
            let body = format!(r#"{{"name":"anna","password":{wrong}}}"#);
            let error = serde_json::from_str::<SignIn>(&body).unwrap_err().to_string();
            assert!(!error.contains("1234") && !error.contains("horse"), "{error}");
        }
    }
}
