//! The cookie of a session.

use axum::http::header::COOKIE;
use axum::http::{HeaderMap, HeaderValue};

/// Its name without TLS. Cookies do not know ports: a second gateway on the same host takes the place of the
/// first.
pub const NAME: &str = "r6_session";

/// Its name with TLS. Browsers take a cookie with such a name only from this host itself and with TLS, so no
/// page without TLS can add one.
pub const SECURE_NAME: &str = "__Host-r6_session";

/// How many cookies of this name are looked at. A browser has one; pages of other ports and paths of this
/// host can add some.
const MAX_CANDIDATES: usize = 4;

/// The secrets of sessions that a request names, in its order. Foreign cookies may have any bytes.
pub fn candidates(headers: &HeaderMap, is_secure: bool) -> Vec<&str> {
    let cookies = headers.get_all(COOKIE).iter().map(HeaderValue::as_bytes);
    let pairs = cookies.flat_map(|header| header.split(|byte| *byte == b';'));
    let named = pairs.filter_map(|pair| {
        let (name, value) = std::str::from_utf8(pair).ok()?.split_once('=')?;
        (name.trim() == self::name(is_secure)).then(|| value.trim())
    });
    named.take(MAX_CANDIDATES).collect()
}

fn name(is_secure: bool) -> &'static str {
    if is_secure { SECURE_NAME } else { NAME }
}

/// The header that gives a browser its session. Scripts cannot read it, and no other site can send it. It
/// goes when the browser is closed. With TLS, browsers never send it without.
pub fn set(secret: &str, is_secure: bool) -> String {
    let (name, secure) = (name(is_secure), if is_secure { "; Secure" } else { "" });
    format!("{name}={secret}; HttpOnly; SameSite=Strict; Path=/{secure}")
}

/// The header that takes it away.
pub fn unset(is_secure: bool) -> String {
    set("", is_secure) + "; Max-Age=0"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_names_sessions_among_foreign_cookies() {
        let read = |headers: &[&[u8]], is_secure: bool| {
            let mut map = HeaderMap::new();
            for header in headers {
                map.append(COOKIE, HeaderValue::from_bytes(header).unwrap());
            }
            candidates(&map, is_secure).join(" ")
        };
        for one in [
            [b"r6_session=ab".as_slice()].as_slice(),
            &[b"a=b; r6_session=ab; c=d"],
            &[b"a=b", b"r6_session=ab"],
            &[b" r6_session = ab "],
            // Other programs of the host write what they want.
            &["a=é; r6_session=ab".as_bytes()],
            &[b"a=\xff\xfe; r6_session=ab"],
            &[b"r6_session=\xff; r6_session=ab"],
        ] {
            assert_eq!(read(one, false), "ab", "{one:?}");
        }
        for none in [
            [].as_slice(),
            &[b"a=r6_session".as_slice()],
            &[b"xr6_session=ab"],
            &[b"r6_session"],
            &[b"=;;=\xff"],
        ] {
            assert_eq!(read(none, false), "", "{none:?}");
        }
        assert_eq!(read(&[b"r6_session=ab; r6_session=cd", b"r6_session=ef"], false), "ab cd ef");
        let many = "r6_session=x; ".repeat(1_000);
        assert_eq!(read(&[many.as_bytes()], false), "x x x x");
        // With TLS, only the name that pages without TLS cannot set.
        assert_eq!(read(&[b"r6_session=ab; __Host-r6_session=cd"], true), "cd");
        assert_eq!(read(&[b"r6_session=ab; __Host-r6_session=cd"], false), "ab");
    }

    #[test]
    fn with_tls_it_is_secure() {
        assert_eq!(set("ab", false), "r6_session=ab; HttpOnly; SameSite=Strict; Path=/");
        assert_eq!(set("ab", true), "__Host-r6_session=ab; HttpOnly; SameSite=Strict; Path=/; Secure");
        assert_eq!(unset(true), "__Host-r6_session=; HttpOnly; SameSite=Strict; Path=/; Secure; Max-Age=0");
    }
}
