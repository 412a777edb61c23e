//! The answer to an HTTP request, in bytes. Reads no file and opens no port.

use std::path::Path;

use tungstenite::handshake::server::{Request, create_response, write_response};
use tungstenite::http::StatusCode;

use super::PageFiles;
use crate::server::handshake::{is_address, token_of};
use crate::token::is_equal;

/// The path of the WebSocket with frames.
const FRAMES: &str = "/frames";

/// What the requests are checked against.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site<'a> {
    pub(crate) files: PageFiles,
    pub(crate) token: &'a str,
    pub(crate) has_arm: bool,
}

/// The answer to a request.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// A whole answer. The connection is closed after it.
    Whole(Vec<u8>),
    /// The connection is a WebSocket with frames after these bytes.
    Frames(Vec<u8>),
}

/// Why a request is refused: the status and a text.
type Refusal = (StatusCode, &'static str);

impl Site<'_> {
    /// Answers a request.
    pub(crate) fn answer(&self, request: &Request) -> Answer {
        let is_frames = request.uri().path() == FRAMES;
        let answer = self
            .host(request)
            .and_then(|host| if is_frames { self.frames(request, host) } else { self.file(request, host) });
        answer.unwrap_or_else(|(status, text)| Answer::Whole(refusal(status, text)))
    }

    /// The `Host` of a request. Another name than an address may belong to a site that points it to this computer.
    fn host<'a>(&self, request: &'a Request) -> Result<&'a str, Refusal> {
        header(request, "host")
            .filter(|host| is_address(host))
            .ok_or((StatusCode::FORBIDDEN, "Host: use the IP address of the server, or localhost.\n"))
    }

    fn file(&self, request: &Request, host: &str) -> Result<Answer, Refusal> {
        let path = request.uri().path().strip_prefix('/').unwrap_or_default();
        let path = if path.is_empty() { "index.html" } else { path };
        let body = (self.files)(path).ok_or((StatusCode::NOT_FOUND, "The page has no such file.\n"))?;
        let mut bytes = head(StatusCode::OK, content_type(path), &content_security_policy(host), body.len());
        bytes.extend_from_slice(&body);
        Ok(Answer::Whole(bytes))
    }

    /// Only this page may connect, and only with the token.
    fn frames(&self, request: &Request, host: &str) -> Result<Answer, Refusal> {
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
        let mut bytes = Vec::new();
        create_response(request)
            .and_then(|response| write_response(&mut bytes, &response))
            .map_err(|_| (StatusCode::BAD_REQUEST, "The WebSocket with frames is here.\n"))?;
        Ok(Answer::Frames(bytes))
    }
}

fn header<'a>(request: &'a Request, name: &str) -> Option<&'a str> {
    request.headers().get(name)?.to_str().ok()
}

/// The answer to what is no request.
pub(crate) fn bad_request() -> Vec<u8> {
    refusal(StatusCode::BAD_REQUEST, "This is no GET request of HTTP/1.1.\n")
}

fn refusal(status: StatusCode, text: &str) -> Vec<u8> {
    let mut bytes = head(status, "text/plain; charset=utf-8", "default-src 'none'", text.len());
    bytes.extend_from_slice(text.as_bytes());
    bytes
}

/// The page loads nothing from elsewhere, runs no script from a string, and no other page can frame it.
fn content_security_policy(host: &str) -> String {
    format!(
        "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; connect-src 'self' ws://{host}; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'"
    )
}

fn head(status: StatusCode, content_type: &str, policy: &str, length: usize) -> Vec<u8> {
    format!(
        "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {length}\r\nConnection: close\r\n\
         Content-Security-Policy: {policy}\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nCache-Control: no-store\r\n\r\n"
    )
    .into_bytes()
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
    use std::borrow::Cow;

    const HOST: (&str, &str) = ("host", "127.0.0.1:7780");

    fn files(path: &str) -> Option<Cow<'static, [u8]>> {
        (path == "index.html" || path == "a.wasm").then_some(Cow::Borrowed(b"content"))
    }

    fn answer(uri: &str, headers: &[(&str, &str)], has_arm: bool) -> Result<String, String> {
        let request = headers
            .iter()
            .fold(Request::builder().uri(uri), |request, (name, value)| request.header(*name, *value));
        let site = Site { files, token: "secret12", has_arm };
        match site.answer(&request.body(()).unwrap()) {
            Answer::Whole(bytes) => Ok(String::from_utf8(bytes).unwrap()),
            Answer::Frames(bytes) => Err(String::from_utf8(bytes).unwrap()),
        }
    }

    /// The status of a whole answer.
    fn status(uri: &str, headers: &[(&str, &str)]) -> String {
        answer(uri, headers, true).unwrap().split(' ').nth(1).unwrap().to_owned()
    }

    #[test]
    fn a_file_has_its_type_and_a_strict_policy() {
        for (uri, kind) in [("/", "text/html"), ("/?token=x", "text/html"), ("/a.wasm", "application/wasm")] {
            let text = answer(uri, &[HOST], false).unwrap();
            assert!(text.starts_with("HTTP/1.1 200 OK\r\n") && text.ends_with("\r\n\r\ncontent"), "{text}");
            assert!(text.contains(&format!("Content-Type: {kind}")), "{text}");
            assert!(text.contains("Content-Length: 7\r\n") && text.contains("nosniff"), "{text}");
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
            assert!(accepted.starts_with("HTTP/1.1 101 "), "{accepted}");
            assert!(accepted.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{accepted}");
        }
        assert!(answer(uri, &with(&[]), false).unwrap().starts_with("HTTP/1.1 503 "));
        assert_eq!(status(uri, &[HOST]), "400", "no upgrade");
    }
}
