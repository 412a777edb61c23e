//! Decides from the HTTP request who may open the maker's WebSocket. The other sites use parts of these checks.
//!
//! A browser lets any page connect to any address, and tells the server which page it was (`Origin`) and which name it
//! looked up (`Host`). So both are checked: otherwise each web site that is open on this computer could move the arm.

use std::net::{Ipv4Addr, Ipv6Addr};

use hyper::{Request, StatusCode, Uri};

use crate::token::is_equal;

/// The path of the maker's WebSocket.
const PATH: &str = "/ws";

/// The conditions under which a request is accepted.
#[derive(Clone, PartialEq, Eq)]
pub struct AccessPolicy {
    /// The secret, if one is needed.
    pub token: Option<String>,
    /// Pages of other sites, and from files, are accepted.
    pub allows_any_page: bool,
}

impl std::fmt::Debug for AccessPolicy {
    /// Leaves out the secret.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { token, allows_any_page } = self;
        let mut form = formatter.debug_struct("AccessPolicy");
        form.field("has_token", &token.is_some()).field("allows_any_page", allows_any_page).finish()
    }
}

/// Why a request is refused: the status and a text.
pub(super) type HttpRefusal = (StatusCode, &'static str);

impl AccessPolicy {
    /// Checks a request. Returns whether it came from a browser.
    pub(super) fn check<B>(&self, request: &Request<B>) -> Result<bool, HttpRefusal> {
        let header = |name: &str| request.headers().get(name).map(|value| value.to_str().unwrap_or_default());
        if request.uri().path() != PATH {
            return Err((StatusCode::NOT_FOUND, "The WebSocket is at /ws.\n"));
        }
        if !header("host").is_some_and(is_address) {
            return Err((StatusCode::FORBIDDEN, "Host: use the IP address of the server, or localhost.\n"));
        }
        let origin = header("origin");
        if !self.allows_any_page && origin.is_some_and(|origin| !is_local_page(origin)) {
            return Err((StatusCode::FORBIDDEN, "Origin: this page needs `sevenbot serve --maker-pages`.\n"));
        }
        let given =
            header("authorization").and_then(|value| value.strip_prefix("Bearer ")).map(str::to_owned);
        let given = given.or_else(|| token_of(request.uri())).unwrap_or_default();
        if self.token.as_ref().is_some_and(|token| !is_equal(given.as_bytes(), token.as_bytes())) {
            return Err((StatusCode::UNAUTHORIZED, "Token: connect to /ws?token=TOKEN.\n"));
        }
        Ok(origin.is_some())
    }
}

/// The token in an address such as `/ws?token=TOKEN`. A byte may be written as `%` and two hexadecimal digits.
pub(super) fn token_of(uri: &Uri) -> Option<String> {
    let given = uri.query()?.split('&').find_map(|pair| pair.strip_prefix("token="))?;
    let mut bytes = Vec::new();
    let mut rest = given.as_bytes();
    while let Some((&byte, tail)) = rest.split_first() {
        let escaped =
            tail.get(..2).filter(|_| byte == b'%').and_then(|digits| std::str::from_utf8(digits).ok());
        let escaped = escaped.and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(escaped.unwrap_or(byte));
        rest = if escaped.is_some() { tail.get(2..).unwrap_or_default() } else { tail };
    }
    String::from_utf8(bytes).ok()
}

/// Is it an IP address or `localhost`? Another name may belong to a site that points it to this computer.
pub(super) fn is_address(authority: &str) -> bool {
    let name = without_port(authority);
    let inner = name.strip_prefix('[').and_then(|name| name.strip_suffix(']'));
    name == "localhost"
        || name.parse::<Ipv4Addr>().is_ok()
        || inner.is_some_and(|ip| ip.parse::<Ipv6Addr>().is_ok())
}

/// Does a program of this computer serve the page?
fn is_local_page(origin: &str) -> bool {
    let authority = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
    let Some(name) = authority.map(without_port) else { return false };
    name == "localhost" || name == "[::1]" || name.parse::<Ipv4Addr>().is_ok_and(|ip| ip.is_loopback())
}

fn without_port(authority: &str) -> &str {
    match authority.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => authority,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    fn check(access: &AccessPolicy, uri: &str, headers: &[(&str, &str)]) -> Result<bool, StatusCode> {
        let request = headers
            .iter()
            .fold(Request::builder().uri(uri), |request, (name, value)| request.header(*name, *value));
        access.check(&request.body(()).unwrap()).map_err(|(status, _)| status)
    }

    const CLOSED: AccessPolicy = AccessPolicy { token: None, allows_any_page: false };

    #[test]
    fn programs_and_local_pages_are_accepted() {
        for host in ["127.0.0.1:8080", "localhost:8080", "localhost", "[::1]:8080", "192.168.4.1:8080"] {
            assert_eq!(check(&CLOSED, "/ws", &[("host", host)]), Ok(false), "{host}");
        }
        for origin in ["http://localhost:3000", "http://127.0.0.1", "https://[::1]:8443"] {
            assert_eq!(
                check(&CLOSED, "/ws", &[("host", "localhost"), ("origin", origin)]),
                Ok(true),
                "{origin}"
            );
        }
    }

    #[test]
    fn other_pages_names_and_paths_are_refused() {
        assert_eq!(check(&CLOSED, "/", &[("host", "localhost")]), Err(StatusCode::NOT_FOUND));
        for host in ["evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example", ""] {
            assert_eq!(check(&CLOSED, "/ws", &[("host", host)]), Err(StatusCode::FORBIDDEN), "{host}");
        }
        let open = AccessPolicy { allows_any_page: true, ..CLOSED };
        for origin in
            ["null", "https://evil.example", "http://localhost.evil.example", "http://10.0.0.1", "file://"]
        {
            let headers = [("host", "localhost"), ("origin", origin)];
            assert_eq!(check(&CLOSED, "/ws", &headers), Err(StatusCode::FORBIDDEN), "{origin}");
            assert_eq!(check(&open, "/ws", &headers), Ok(true), "{origin}");
        }
        assert_eq!(check(&open, "/ws", &[("host", "evil.example")]), Err(StatusCode::FORBIDDEN));
    }

    #[test]
    fn a_token_is_in_the_address_or_in_a_header() {
        let access = AccessPolicy { token: Some("secret12".to_owned()), ..CLOSED };
        let host = ("host", "localhost");
        assert_eq!(check(&access, "/ws", &[host]), Err(StatusCode::UNAUTHORIZED));
        assert_eq!(check(&access, "/ws?token=secret1", &[host]), Err(StatusCode::UNAUTHORIZED));
        assert_eq!(check(&access, "/ws?a=b&token=secret12", &[host]), Ok(false));
        assert_eq!(check(&access, "/ws", &[host, ("authorization", "Bearer secret12")]), Ok(false));
        let access = AccessPolicy { token: Some("a&b#c%d+".to_owned()), ..CLOSED };
        assert_eq!(check(&access, "/ws?token=a%26b%23c%25d+", &[host]), Ok(false), "escaped");
        assert_eq!(check(&access, "/ws?token=a&b#c%d+", &[host]), Err(StatusCode::UNAUTHORIZED));
        assert!(!format!("{access:?}").contains("a&b"), "it is not in a log");
    }
}
