//! Access to a server without a login: programs on this machine may use it, web pages from elsewhere may not.
//!
//! There is no login. A web page can make a browser on this machine send requests here. Such a request has a
//! foreign `Origin`, or names a host of the attacker that resolves to 127.0.0.1. Both are refused.

use std::net::{IpAddr, SocketAddr};

use axum::extract::{Request, State};
use axum::http::header::{HOST, ORIGIN};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use r6_api::Code;

use crate::refusal::Refusal;

/// Lets a request through, or refuses it with 403: a layer for `axum::middleware::from_fn_with_state`. Its
/// state is the address that the server listens on.
pub async fn guard(State(address): State<SocketAddr>, request: Request, next: Next) -> Response {
    match check(address.ip(), request.uri(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    }
}

fn check(listens: IpAddr, uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
    let mut hosts = headers.get_all(HOST).iter();
    let host = match (hosts.next().and_then(|host| host.to_str().ok()), hosts.next()) {
        (Some(host), None) => host,
        (None, _) | (Some(_), Some(_)) => {
            return Err(Refusal::foreign(Code::ForeignHost, "a request names its host, once"));
        }
    };
    let told = host.parse::<Authority>().ok();
    if !told.is_some_and(|told| is_own(listens, &told))
        || uri.authority().is_some_and(|told| !is_own(listens, told))
    {
        return Err(Refusal::foreign(
            Code::ForeignHost,
            format!(
                "`{host}` is not this server: use localhost, 127.0.0.1, or the address that it listens on"
            ),
        ));
    }
    // Programs send neither header; a browser cannot leave them out.
    let own = format!("http://{host}");
    let same_origin = |origin: &[u8]| origin.eq_ignore_ascii_case(own.as_bytes());
    let same_site = |site: &[u8]| matches!(site, b"same-origin" | b"none");
    if headers.get_all(ORIGIN).iter().any(|origin| !same_origin(origin.as_bytes()))
        || headers.get_all("sec-fetch-site").iter().any(|site| !same_site(site.as_bytes()))
    {
        return Err(Refusal::foreign(Code::ForeignOrigin, "pages of a browser cannot use this server"));
    }
    Ok(())
}

/// Whether a host is this machine. A page can choose any name for itself, but no address.
fn is_own(listens: IpAddr, told: &Authority) -> bool {
    let host = told.host();
    let plain = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    let ip = plain.parse::<IpAddr>().ok().map(|ip| ip.to_canonical());
    !told.as_str().contains('@')
        && (host.eq_ignore_ascii_case("localhost")
            || ip.is_some_and(|ip| {
                ip.is_loopback() || ip == listens.to_canonical() || listens.is_unspecified()
            }))
}

#[cfg(test)]
mod tests {
    use std::net::{Ipv4Addr, Ipv6Addr};

    use super::*;

    const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
    const CELL: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 168, 1, 10));

    fn passes(listens: IpAddr, uri: &str, headers: &[(&'static str, &str)]) -> bool {
        let headers = headers.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()));
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append::<axum::http::HeaderName>(name, value);
        }
        check(listens, &uri.parse().unwrap(), &map).is_ok()
    }

    #[test]
    fn this_machine_goes_by_its_own_names_and_addresses() {
        for host in
            ["localhost", "LocalHost:9770", "127.0.0.1:9770", "127.1.2.3", "[::1]:1", "[::ffff:127.0.0.1]"]
        {
            assert!(passes(LOOPBACK, "/v1/controllers", &[("host", host)]), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "localhost.evil.example",
            "evil.example:9770",
            "127.0.0.1.evil.example",
            "192.168.1.10",
            "evil@127.0.0.1",
            "127.0.0.1@evil.example",
            "2130706433",
            "a b",
        ] {
            assert!(!passes(LOOPBACK, "/v1/controllers", &[("host", host)]), "{host}");
        }
        assert!(!passes(LOOPBACK, "/", &[]));
        assert!(!passes(LOOPBACK, "/", &[("host", "localhost"), ("host", "evil.example")]));
        assert!(!passes(LOOPBACK, "http://evil.example/", &[("host", "localhost")]));
        assert!(passes(LOOPBACK, "http://localhost:1/", &[("host", "localhost:1")]));
    }

    #[test]
    fn an_opened_panel_goes_by_its_address_but_by_no_name() {
        assert!(passes(CELL, "/", &[("host", "192.168.1.10:9770")]));
        assert!(!passes(CELL, "/", &[("host", "192.168.1.11:9770")]));
        for any in [IpAddr::V4(Ipv4Addr::UNSPECIFIED), IpAddr::V6(Ipv6Addr::UNSPECIFIED)] {
            assert!(passes(any, "/", &[("host", "192.168.1.11:9770")]));
            assert!(!passes(any, "/", &[("host", "cell.evil.example:9770")]));
        }
    }

    #[test]
    fn pages_from_elsewhere_are_refused() {
        let host = ("host", "localhost:9770");
        assert!(passes(LOOPBACK, "/", &[host, ("origin", "http://localhost:9770")]));
        assert!(passes(LOOPBACK, "/", &[host, ("sec-fetch-site", "same-origin")]));
        for origin in [
            "null",
            "http://evil.example",
            "https://localhost:9770",
            "http://localhost:3000",
            "http://127.0.0.1:9770",
            "",
        ] {
            assert!(!passes(LOOPBACK, "/", &[host, ("origin", origin)]), "{origin}");
        }
        for site in ["cross-site", "same-site", ""] {
            assert!(!passes(LOOPBACK, "/", &[host, ("sec-fetch-site", site)]), "{site}");
        }
        let two = [host, ("origin", "http://localhost:9770"), ("origin", "http://evil.example")];
        assert!(!passes(LOOPBACK, "/", &two));
    }
}
