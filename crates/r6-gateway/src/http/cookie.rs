//! The cookie of a session.

use axum::http::header::COOKIE;
use axum::http::{HeaderMap, HeaderValue};

/// How many cookies of this name are looked at. A browser has one; pages of other ports and paths of this
/// host can add some.
const MAX_CANDIDATES: usize = 4;

/// The cookie of one gateway. Browsers know no ports of cookies, so its name has the port: gateways on one
/// host do not take each other's place. With TLS its name begins with `__Host-`: browsers take such a cookie
/// only from this host itself and with TLS, so no page without TLS can add one.
#[derive(Clone, Debug)]
pub struct Cookie {
    name: String,
    is_secure: bool,
}

impl Cookie {
    /// The cookie of the gateway that listens at this port.
    #[must_use]
    pub fn new(port: u16, is_secure: bool) -> Self {
        let prefix = if is_secure { "__Host-" } else { "" };
        Self { name: format!("{prefix}r6_session_{port}"), is_secure }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The secrets of sessions that a request names, in its order. Foreign cookies may have any bytes.
    pub fn candidates<'h>(&self, headers: &'h HeaderMap) -> Vec<&'h str> {
        let cookies = headers.get_all(COOKIE).iter().map(HeaderValue::as_bytes);
        let pairs = cookies.flat_map(|header| header.split(|byte| *byte == b';'));
        let named = pairs.filter_map(|pair| {
            let (name, value) = std::str::from_utf8(pair).ok()?.split_once('=')?;
            (name.trim() == self.name).then(|| value.trim())
        });
        named.take(MAX_CANDIDATES).collect()
    }

    /// The header that gives a browser its session. Scripts cannot read it, and no other site can send it. It
    /// goes when the browser is closed. With TLS, browsers never send it without.
    pub fn set(&self, secret: &str) -> String {
        let secure = if self.is_secure { "; Secure" } else { "" };
        format!("{}={secret}; HttpOnly; SameSite=Strict; Path=/{secure}", self.name)
    }

    /// The header that takes it away.
    pub fn unset(&self) -> String {
        self.set("") + "; Max-Age=0"
    }
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
            Cookie::new(80, is_secure).candidates(&map).join(" ")
        };
        for one in [
            [b"r6_session_80=ab".as_slice()].as_slice(),
            &[b"a=b; r6_session_80=ab; c=d"],
            &[b"a=b", b"r6_session_80=ab"],
            &[b" r6_session_80 = ab "],
            // Other programs of the host write what they want.
            &["a=é; r6_session_80=ab".as_bytes()],
            &[b"a=\xff\xfe; r6_session_80=ab"],
            &[b"r6_session_80=\xff; r6_session_80=ab"],
        ] {
            assert_eq!(read(one, false), "ab", "{one:?}");
        }
        for none in [
            [].as_slice(),
            &[b"a=r6_session_80".as_slice()],
            &[b"xr6_session_80=ab"],
            &[b"r6_session_80"],
            &[b"=;;=\xff"],
            // That of another gateway on this host, and of an older r6.
            &[b"r6_session_81=ab; r6_session=ab"],
        ] {
            assert_eq!(read(none, false), "", "{none:?}");
        }
        assert_eq!(read(&[b"r6_session_80=ab; r6_session_80=cd", b"r6_session_80=ef"], false), "ab cd ef");
        let many = "r6_session_80=x; ".repeat(1_000);
        assert_eq!(read(&[many.as_bytes()], false), "x x x x");
        // With TLS, only the name that pages without TLS cannot set.
        assert_eq!(read(&[b"r6_session_80=ab; __Host-r6_session_80=cd"], true), "cd");
        assert_eq!(read(&[b"r6_session_80=ab; __Host-r6_session_80=cd"], false), "ab");
    }

    #[test]
    fn with_tls_it_is_secure() {
        assert_eq!(Cookie::new(80, false).set("ab"), "r6_session_80=ab; HttpOnly; SameSite=Strict; Path=/");
        assert_eq!(
            Cookie::new(80, true).set("ab"),
            "__Host-r6_session_80=ab; HttpOnly; SameSite=Strict; Path=/; Secure"
        );
        assert_eq!(
            Cookie::new(80, true).unset(),
            "__Host-r6_session_80=; HttpOnly; SameSite=Strict; Path=/; Secure; Max-Age=0"
        );
    }
}
