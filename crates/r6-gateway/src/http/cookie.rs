//! The cookie of a session.

use axum::http::HeaderMap;
use axum::http::header::COOKIE;

/// Its name. Cookies do not know ports: a second gateway on the same host takes the place of the first.
pub const NAME: &str = "r6_session";

/// The secret of the session that a request names; `None` without one. A page of another port of this host
/// could add a second cookie, so a request with two names none: an empty text, which is no session.
pub fn session(headers: &HeaderMap) -> Option<String> {
    let cookies = headers.get_all(COOKIE).iter().filter_map(|header| header.to_str().ok());
    let pairs = cookies.flat_map(|header| header.split(';')).filter_map(|pair| pair.split_once('='));
    let mut named = pairs.filter(|(name, _)| name.trim() == NAME).map(|(_, value)| value.trim());
    let first = named.next()?;
    Some(if named.next().is_none() { first.to_owned() } else { String::new() })
}

/// The header that gives a browser its session. Scripts cannot read it, and no other site can send it. It
/// goes when the browser is closed. With TLS, browsers never send it without.
pub fn set(secret: &str, is_secure: bool) -> String {
    let secure = if is_secure { "; Secure" } else { "" };
    format!("{NAME}={secret}; HttpOnly; SameSite=Strict; Path=/{secure}")
}

/// The header that takes it away.
pub fn unset(is_secure: bool) -> String {
    set("", is_secure) + "; Max-Age=0"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_names_one_session_or_none() {
        let read = |headers: &[&'static str]| {
            let mut map = HeaderMap::new();
            for header in headers {
                map.append(COOKIE, header.parse().unwrap());
            }
            session(&map)
        };
        for one in [
            ["r6_session=ab"].as_slice(),
            &["a=b; r6_session=ab; c=d"],
            &["a=b", "r6_session=ab"],
            &[" r6_session = ab "],
        ] {
            assert_eq!(read(one).as_deref(), Some("ab"), "{one:?}");
        }
        for none in [[].as_slice(), &["a=r6_session"], &["xr6_session=ab"], &["r6_session"]] {
            assert_eq!(read(none), None, "{none:?}");
        }
        for two in [["r6_session=ab; r6_session=cd"].as_slice(), &["r6_session=ab", "r6_session=ab"]] {
            assert_eq!(read(two).as_deref(), Some(""), "{two:?}");
        }
    }

    #[test]
    fn with_tls_it_is_secure() {
        assert_eq!(set("ab", false), "r6_session=ab; HttpOnly; SameSite=Strict; Path=/");
        assert_eq!(set("ab", true), "r6_session=ab; HttpOnly; SameSite=Strict; Path=/; Secure");
        assert_eq!(unset(true), "r6_session=; HttpOnly; SameSite=Strict; Path=/; Secure; Max-Age=0");
    }
}
