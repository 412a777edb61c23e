//! The answer to an HTTP request. Reads no file and opens no port.
//!
//! The files are public: they are part of the program. The arm is behind the token, and `Host` and `Origin` have to be this
//! server's own (see [`super::access`] for the reason).

use std::borrow::Cow;
use std::fmt;
use std::net::SocketAddr;
use std::path::Path;

use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{CONTENT_TYPE, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use tungstenite::handshake::server::create_response_with_body;

use super::access::{AccessPolicy, Refusal, is_address, token_of};
use crate::token::is_equal;

/// The path of the WebSocket with frames.
const FRAMES: &str = "/frames";

/// Finds a file of the page by its path below the root, such as `index.html`.
pub type PageFiles = fn(&str) -> Option<Cow<'static, [u8]>>;

/// A page to serve.
#[derive(Clone)]
pub struct PageConfig {
    /// Where to listen. It should be an address of the loopback interface.
    pub address: SocketAddr,
    /// The secret that `/frames?token=TOKEN` needs.
    pub token: String,
    /// The files.
    pub files: PageFiles,
}

impl fmt::Debug for PageConfig {
    /// Without the secret.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("PageConfig").field("address", &self.address).finish_non_exhaustive()
    }
}

/// What a port serves.
#[derive(Clone)]
pub(super) enum Site {
    /// The page.
    Page(PageSite),
    /// The maker's WebSocket.
    Maker(AccessPolicy),
}

/// The page, and its WebSocket with frames.
#[derive(Clone)]
pub(super) struct PageSite {
    pub(super) files: PageFiles,
    pub(super) token: String,
    pub(super) has_arm: bool,
}

/// What a WebSocket carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Protocol {
    Frames,
    /// `is_browser`: the request came from a page.
    Maker {
        is_browser: bool,
    },
}

/// The answer to a request.
#[derive(Debug)]
pub(super) enum Answer {
    /// A whole answer. The connection is closed after it.
    Whole(Response<Full<Bytes>>),
    /// The connection is a WebSocket after this.
    Upgrade(Response<Full<Bytes>>, Protocol),
}

impl Site {
    /// Answers a request.
    pub(super) fn answer<B>(&self, request: &Request<B>) -> Answer {
        if request.method() != Method::GET {
            return Answer::Whole(refusal(StatusCode::BAD_REQUEST, "This is no GET request of HTTP/1.1.\n"));
        }
        let answer = match self {
            Self::Page(page) => page.answer(request),
            Self::Maker(access) => {
                access.check(request).and_then(|is_browser| accept(request, Protocol::Maker { is_browser }))
            }
        };
        answer.unwrap_or_else(|(status, text)| Answer::Whole(refusal(status, text)))
    }
}

fn accept<B>(request: &Request<B>, protocol: Protocol) -> Result<Answer, Refusal> {
    create_response_with_body(request, Full::default)
        .map(|response| Answer::Upgrade(response, protocol))
        .map_err(|_| (StatusCode::BAD_REQUEST, "Here is a WebSocket.\n"))
}

impl PageSite {
    fn answer<B>(&self, request: &Request<B>) -> Result<Answer, Refusal> {
        let host = header(request, "host")
            .filter(|host| is_address(host))
            .ok_or((StatusCode::FORBIDDEN, "Host: use the IP address of the server, or localhost.\n"))?;
        if request.uri().path() == FRAMES { self.frames(request, host) } else { self.file(request, host) }
    }

    fn file<B>(&self, request: &Request<B>, host: &str) -> Result<Answer, Refusal> {
        let path = request.uri().path().strip_prefix('/').unwrap_or_default();
        let path = if path.is_empty() { "index.html" } else { path };
        let body = (self.files)(path).ok_or((StatusCode::NOT_FOUND, "The page has no such file.\n"))?;
        let mut response = response(StatusCode::OK, content_type(path), Bytes::from_owner(body));
        if let Ok(policy) = HeaderValue::from_str(&content_security_policy(host)) {
            response.headers_mut().insert("content-security-policy", policy);
        }
        Ok(Answer::Whole(response))
    }

    /// Only this page may connect, and only with the token.
    fn frames<B>(&self, request: &Request<B>, host: &str) -> Result<Answer, Refusal> {
        let is_own = |origin: &str| origin.strip_prefix("http://") == Some(host);
        if request.headers().contains_key("origin") && !header(request, "origin").is_some_and(is_own) {
            return Err((StatusCode::FORBIDDEN, "Origin: only this server's own page can connect.\n"));
        }
        let given = token_of(request.uri()).unwrap_or_default();
        if !is_equal(given.as_bytes(), self.token.as_bytes()) {
            return Err((StatusCode::UNAUTHORIZED, "Token: connect to /frames?token=TOKEN.\n"));
        }
        if !self.has_arm {
            return Err((StatusCode::SERVICE_UNAVAILABLE, "No arm was found at the start.\n"));
        }
        accept(request, Protocol::Frames)
    }
}

fn header<'a, B>(request: &'a Request<B>, name: &str) -> Option<&'a str> {
    request.headers().get(name)?.to_str().ok()
}

/// An answer that refuses.
pub(super) fn refusal(status: StatusCode, text: &'static str) -> Response<Full<Bytes>> {
    response(status, "text/plain; charset=utf-8", Bytes::from_static(text.as_bytes()))
}

fn response(status: StatusCode, content_type: &'static str, body: Bytes) -> Response<Full<Bytes>> {
    let mut response = Response::new(Full::new(body));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(content_type));
    for (name, value) in [
        ("content-security-policy", "default-src 'none'"),
        ("x-content-type-options", "nosniff"),
        ("referrer-policy", "no-referrer"),
        ("cross-origin-resource-policy", "same-origin"),
        ("cache-control", "no-store"),
        ("connection", "close"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// The page loads nothing from elsewhere, runs no script from a string, and no other page can frame it. The editor of programs
/// has pictures as `data:` addresses.
fn content_security_policy(host: &str) -> String {
    format!(
        "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' data:; connect-src 'self' ws://{host}; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'"
    )
}

fn content_type(path: &str) -> &'static str {
    match Path::new(path).extension().and_then(|extension| extension.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("wasm") => "application/wasm",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("json") => "application/json",
        Some("webmanifest") => "application/manifest+json",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;
    const HOST: (&str, &str) = ("host", "127.0.0.1:7780");

    fn files(path: &str) -> Option<Cow<'static, [u8]>> {
        (path == "index.html" || path == "a.wasm").then_some(Cow::Borrowed(b"content"))
    }

    fn answer(uri: &str, headers: &[(&str, &str)], has_arm: bool) -> Result<String, String> {
        let request = headers
            .iter()
            .fold(Request::builder().uri(uri), |request, (name, value)| request.header(*name, *value));
        let site = Site::Page(PageSite { files, token: "secret12".to_owned(), has_arm });
        let text = |response: Response<Full<Bytes>>| {
            format!("{} {:?}", response.status().as_u16(), response.headers())
        };
        match site.answer(&request.body(()).unwrap()) {
            Answer::Whole(response) => Ok(text(response)),
            Answer::Upgrade(response, _) => Err(text(response)),
        }
    }

    /// The status of a whole answer.
    fn status(uri: &str, headers: &[(&str, &str)]) -> String {
        answer(uri, headers, true).unwrap().split(' ').next().unwrap().to_owned()
    }

    #[test]
    fn a_file_has_its_type_and_a_strict_policy() {
        for (uri, kind) in [("/", "text/html"), ("/?token=x", "text/html"), ("/a.wasm", "application/wasm")] {
            let text = answer(uri, &[HOST], false).unwrap();
            assert!(text.starts_with("200 ") && text.contains("nosniff"), "{text}");
            assert!(text.contains(&format!("\"content-type\": \"{kind}")), "{text}");
            assert!(text.contains("default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; "), "{text}");
            assert!(text.contains("connect-src 'self' ws://127.0.0.1:7780;"), "{text}");
        }
    }

    #[test]
    fn other_paths_and_names_are_refused() {
        for path in ["/../Cargo.toml", "/%2e%2e/Cargo.toml", "//etc/passwd", "/index.html/", "/index.htm"] {
            assert_eq!(status(path, &[HOST]), "404", "{path}");
        }
        for host in ["evil.example", "127.0.0.1.evil.example", "", "a;b", "127.0.0.1; script-src *"] {
            assert_eq!(status("/", &[("host", host)]), "403", "{host}");
            assert_eq!(status("/frames?token=secret12", &[("host", host)]), "403", "{host}");
        }
        assert_eq!(status("/", &[]), "403");
    }

    const UPGRADE: [(&str, &str); 4] = [
        ("connection", "Upgrade"),
        ("upgrade", "websocket"),
        ("sec-websocket-version", "13"),
        ("sec-websocket-key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ];

    #[test]
    fn frames_need_the_token_and_this_page() {
        let with = |more: &[(&'static str, &'static str)]| [&[HOST], more, &UPGRADE].concat();
        for uri in ["/frames", "/frames?token=", "/frames?token=secret1", "/frames?token=secret123"] {
            assert_eq!(status(uri, &with(&[])), "401", "{uri}");
        }
        let uri = "/frames?token=secret12";
        for origin in
            ["http://127.0.0.1:7781", "https://127.0.0.1:7780", "http://evil.example", "null", "\u{e9}"]
        {
            assert_eq!(status(uri, &with(&[("origin", origin)])), "403", "{origin}");
        }
        for own in [&[][..], &[("origin", "http://127.0.0.1:7780")]] {
            let accepted = answer(uri, &with(own), true).unwrap_err();
            assert!(accepted.starts_with("101 "), "{accepted}");
            assert!(accepted.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{accepted}");
        }
        assert!(answer(uri, &with(&[]), false).unwrap().starts_with("503 "));
        assert_eq!(status(uri, &[HOST]), "400", "no upgrade");
    }
}
