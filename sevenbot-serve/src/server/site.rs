//! The answer to an HTTP request. Reads no file and opens no port.
//!
//! The files are public: they are part of the program. A request for a WebSocket needs the token, if there is one, and a `Host`
//! and an `Origin` that the site accepts (see [`super::access`] for the reason).

use std::fmt;
use std::net::{IpAddr, SocketAddr};

use hyper::{Method, Request, StatusCode};

use super::access::{AccessPolicy, HttpRefusal, token_of};
use super::answer::{HttpAnswer, PageFiles, Protocol, accept, check_origin, file, own_host, refusal};
use super::class_site::ClassSite;
use super::new_key::NewKey;
use crate::token::is_equal;

/// The path of the WebSocket with frames.
const FRAMES: &str = "/frames";

/// How the server serves the page to a browser of this computer.
#[derive(Clone)]
pub struct PageConfig {
    /// Where to listen. It should be an address of the loopback interface.
    pub address: SocketAddr,
    /// The secret that `/frames?token=TOKEN` needs.
    pub token: String,
    /// Finds the files of the page.
    pub files: PageFiles,
}

/// How the server serves a class: its page, and the teacher's screen.
#[derive(Clone)]
pub struct ClassConfig {
    /// Where to listen. For port 0 the system chooses one, see [`class_address`](super::Server::class_address).
    pub address: SocketAddr,
    /// The files of the page, and of the teacher's screen at `teacher.html`.
    pub files: PageFiles,
    /// The code that pupils have to type. `None`: no code, only for a server that other computers cannot reach.
    pub code: Option<String>,
    /// The secret that the teacher's screen needs, `/teacher?token=SECRET`.
    pub secret: String,
    /// The addresses of this computer that pupils open, for the teacher's screen.
    pub hosts: Vec<IpAddr>,
    /// Makes the secrets of pupils.
    pub new_key: NewKey,
}

impl fmt::Debug for ClassConfig {
    /// Without the secrets.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("ClassConfig").field("address", &self.address).finish_non_exhaustive()
    }
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
    Page(PageSite),
    /// The maker's WebSocket.
    Maker(AccessPolicy),
    /// The page for a class, and the teacher's screen.
    Class(ClassSite),
}

/// The page, and its WebSocket with frames.
#[derive(Clone)]
pub(super) struct PageSite {
    pub(super) files: PageFiles,
    pub(super) token: String,
    pub(super) has_arm: bool,
}

impl Site {
    pub(super) fn answer<B>(&self, request: &Request<B>) -> HttpAnswer {
        if request.method() != Method::GET {
            return HttpAnswer::Whole(refusal(
                StatusCode::BAD_REQUEST,
                "This is no GET request of HTTP/1.1.\n",
            ));
        }
        let answer = match self {
            Self::Page(page) => page.answer(request),
            Self::Class(class) => class.answer(request),
            Self::Maker(access) => {
                access.check(request).and_then(|is_browser| accept(request, Protocol::Maker { is_browser }))
            }
        };
        answer.unwrap_or_else(|(status, text)| HttpAnswer::Whole(refusal(status, text)))
    }

    /// Is the answer public, so that it needs no secret?
    pub(super) fn is_public<B>(&self, request: &Request<B>) -> bool {
        match self {
            Self::Page(_) => request.uri().path() != FRAMES,
            Self::Class(_) => !ClassSite::needs_secret(request),
            Self::Maker(_) => false,
        }
    }
}

impl PageSite {
    fn answer<B>(&self, request: &Request<B>) -> Result<HttpAnswer, HttpRefusal> {
        let host = own_host(request)?;
        let is_frames = request.uri().path() == FRAMES;
        if is_frames { self.frames(request, host) } else { file(self.files, request, host, false) }
    }

    /// The token is needed, and pages of other servers are refused.
    fn frames<B>(&self, request: &Request<B>, host: &str) -> Result<HttpAnswer, HttpRefusal> {
        check_origin(request, host, false)?;
        let given = token_of(request.uri()).unwrap_or_default();
        if !is_equal(given.as_bytes(), self.token.as_bytes()) {
            return Err((StatusCode::UNAUTHORIZED, "Token: connect to /frames?token=TOKEN.\n"));
        }
        if !self.has_arm {
            let text = "No arm was found at the start. Connect the arm, and start `sevenbot view` again.\n";
            return Err((StatusCode::SERVICE_UNAVAILABLE, text));
        }
        accept(request, Protocol::Frames)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;
    use http_body_util::Full;
    use hyper::Response;
    use hyper::body::Bytes;
    use std::borrow::Cow;
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
            HttpAnswer::Whole(response) => Ok(text(response)),
            HttpAnswer::Upgrade(response, _) => Err(text(response)),
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
