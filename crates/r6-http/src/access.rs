//! Access to a server by its host and origin: programs may use it, web pages from elsewhere may not.
//!
//! This stands before a login, if the server has one, and is all there is if it has none. A web page can make
//! a browser send requests here. Such a request has a foreign `Origin`, or names a host of the attacker that
//! resolves to this machine. Both are refused.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::header::{HOST, ORIGIN};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, Method, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use r6_api::Code;

use crate::refusal::Refusal;

/// How a server is reached.
#[derive(Clone, Debug)]
pub struct Site {
    listens: IpAddr,
    names: Arc<[String]>,
    is_secure: bool,
    page: Option<&'static str>,
}

impl Site {
    /// A server that listens at this address. It is reached by the addresses of this machine, or by
    /// `localhost`, without TLS.
    #[must_use]
    pub fn new(address: SocketAddr) -> Self {
        Self { listens: address.ip(), names: Arc::default(), is_secure: false, page: None }
    }

    /// It is reached by these host names, too. A web page from elsewhere cannot make them lead here, unless
    /// somebody gave the server a name that belongs to the page.
    #[must_use]
    pub fn with_names(self, names: impl IntoIterator<Item = String>) -> Self {
        Self { names: names.into_iter().collect(), ..self }
    }

    /// It is reached with TLS, or without.
    #[must_use]
    pub fn with_tls(self, is_secure: bool) -> Self {
        Self { is_secure, ..self }
    }

    /// Links elsewhere, in a mail for example, may open the page at this path in a tab of its own. It must
    /// not change or tell anything by being opened.
    #[must_use]
    pub fn with_page(self, path: &'static str) -> Self {
        Self { page: Some(path), ..self }
    }

    /// Whether it is reached with TLS.
    #[must_use]
    pub fn is_secure(&self) -> bool {
        self.is_secure
    }

    /// Whether a host is this server. A page can choose any name for itself, but no address and no name that
    /// belongs to another machine.
    fn is_own(&self, told: &Authority) -> bool {
        let host = told.host();
        let plain = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
        let ip = plain.parse::<IpAddr>().ok().map(|ip| ip.to_canonical());
        !told.as_str().contains('@')
            && (host.eq_ignore_ascii_case("localhost")
                || self.names.iter().any(|name| host.eq_ignore_ascii_case(name))
                || ip.is_some_and(|ip| {
                    ip.is_loopback() || ip == self.listens.to_canonical() || self.listens.is_unspecified()
                }))
    }
}

/// Lets a request through, or refuses it with 403: a layer for `axum::middleware::from_fn_with_state`.
pub async fn guard(State(site): State<Site>, request: Request, next: Next) -> Response {
    match check(&site, request.method(), request.uri(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    }
}

fn check(site: &Site, method: &Method, uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
    let mut hosts = headers.get_all(HOST).iter();
    let host = match (hosts.next().and_then(|host| host.to_str().ok()), hosts.next()) {
        (Some(host), None) => host,
        (None, _) | (Some(_), Some(_)) => {
            return Err(Refusal::foreign(Code::ForeignHost, "a request names its host, once"));
        }
    };
    let told = host.parse::<Authority>().ok();
    if !told.is_some_and(|told| site.is_own(&told)) || uri.authority().is_some_and(|told| !site.is_own(told))
    {
        let named: String = site.names.iter().map(|name| format!("{name}, ")).collect();
        return Err(Refusal::foreign(
            Code::ForeignHost,
            format!(
                "`{host}` is not this server: use {named}localhost, 127.0.0.1, or the address that it listens on"
            ),
        ));
    }
    // Programs send neither header; a browser cannot leave them out.
    let scheme = if site.is_secure { "https" } else { "http" };
    let own = format!("{scheme}://{host}");
    let same_origin = |origin: &[u8]| origin.eq_ignore_ascii_case(own.as_bytes());
    let same_site = |site: &[u8]| matches!(site, b"same-origin" | b"none");
    // A person followed a link. Scripts and frames of other pages cannot read what is opened so.
    let is_only = |name: &str, wanted: &str| {
        let mut values = headers.get_all(name).iter();
        values.next().is_some_and(|value| value == wanted) && values.next().is_none()
    };
    let is_opened = site.page == Some(uri.path())
        && method == Method::GET
        && is_only("sec-fetch-mode", "navigate")
        && is_only("sec-fetch-dest", "document");
    if headers.get_all(ORIGIN).iter().any(|origin| !same_origin(origin.as_bytes()))
        || !is_opened && headers.get_all("sec-fetch-site").iter().any(|site| !same_site(site.as_bytes()))
    {
        return Err(Refusal::foreign(Code::ForeignOrigin, "pages of a browser cannot use this server"));
    }
    Ok(())
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
        check(&Site::new(SocketAddr::new(listens, 9770)), &Method::GET, &uri.parse().unwrap(), &map).is_ok()
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

    #[test]
    fn a_link_in_a_mail_opens_the_page_and_nothing_else() {
        let site = Site::new(SocketAddr::new(LOOPBACK, 9780)).with_page("/setup");
        let passes = |method: &Method, path: &str, headers: &[(&'static str, &str)]| {
            let usual = [("host", "localhost:9780"), ("sec-fetch-site", "cross-site")];
            let headers = usual.iter().chain(headers);
            let headers = headers.map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()));
            check(&site, method, &path.parse().unwrap(), &headers.collect()).is_ok()
        };
        let opened = [("sec-fetch-mode", "navigate"), ("sec-fetch-dest", "document")];
        assert!(passes(&Method::GET, "/setup", &opened));
        for path in ["/setup.js", "/setup/", "/v1/setup", "/", "/v1/robots"] {
            assert!(!passes(&Method::GET, path, &opened), "{path}");
        }
        assert!(!passes(&Method::POST, "/setup", &opened));
        assert!(!passes(&Method::GET, "/setup", &[]), "a script");
        let [mode, dest] = opened;
        for wrong in [
            [mode, ("sec-fetch-dest", "iframe")],
            [("sec-fetch-mode", "no-cors"), dest],
            [("sec-fetch-mode", "cors"), ("sec-fetch-dest", "empty")],
        ] {
            assert!(!passes(&Method::GET, "/setup", &wrong), "{wrong:?}");
        }
        assert!(!passes(&Method::GET, "/setup", &[mode, dest, ("origin", "http://evil.example")]));
        assert!(!passes(&Method::GET, "/setup", &[mode, dest, ("host", "evil.example")]));
        let plain = Site { page: None, ..site.clone() };
        let headers = [("host", "localhost"), ("sec-fetch-site", "cross-site"), mode, dest];
        let headers = headers.map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()));
        let headers = headers.into_iter().collect();
        assert!(check(&plain, &Method::GET, &"/setup".parse().unwrap(), &headers).is_err());
    }

    #[test]
    fn a_server_goes_by_the_names_that_it_was_given_and_by_its_scheme() {
        let site = Site::new(SocketAddr::new(CELL, 9780)).with_names(["hall.example".to_owned()]);
        let passes = |site: &Site, headers: &[(&'static str, &str)]| {
            let headers = headers.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()));
            check(site, &Method::GET, &"/".parse().unwrap(), &headers.collect()).is_ok()
        };
        assert!(passes(&site, &[("host", "Hall.example:9780")]));
        assert!(passes(&site, &[("host", "hall.example"), ("origin", "http://hall.example")]));
        assert!(!passes(&site, &[("host", "hall.example"), ("origin", "https://hall.example")]));
        let secure = site.with_tls(true);
        assert!(passes(&secure, &[("host", "hall.example"), ("origin", "https://hall.example")]));
        assert!(!passes(&secure, &[("host", "hall.example"), ("origin", "http://hall.example")]));
        assert!(!passes(&secure, &[("host", "other.example")]));
        assert!(!passes(&secure, &[("host", "x.hall.example")]));
    }
}
