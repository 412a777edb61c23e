//! Parts of the answer to an HTTP request, whatever the port serves. Reads no file and opens no port.

use std::borrow::Cow;
use std::path::Path;

use classroom::LeaseId;
use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{CONTENT_TYPE, HeaderValue, LOCATION};
use hyper::{Request, Response, StatusCode};
use tungstenite::handshake::server::create_response_with_body;

use super::access::{HttpRefusal, is_address};

/// Finds a file of the page by its path below the root, such as `index.html`.
pub type PageFiles = fn(&str) -> Option<Cow<'static, [u8]>>;

/// Who uses a tab of a class.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Pupil,
    Teacher,
}

/// What a WebSocket carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Protocol {
    Frames,
    /// `is_browser`: the request came from a page.
    Maker {
        is_browser: bool,
    },
    Class(Role),
    /// Frames for the class's real arm, during this lease.
    LentArm(LeaseId),
}

impl Protocol {
    /// Does the connection have a reserved place? The teacher, and the pupil with the arm, are let in however many tabs of pupils
    /// there are.
    pub(super) const fn has_reserved_place(self) -> bool {
        matches!(self, Self::Class(Role::Teacher) | Self::LentArm(_))
    }
}

#[derive(Debug)]
pub(super) enum HttpAnswer {
    /// A whole answer. The connection is closed after it.
    Whole(Response<Full<Bytes>>),
    /// The connection is a WebSocket after this.
    Upgrade(Response<Full<Bytes>>, Protocol),
}

pub(super) fn accept<B>(request: &Request<B>, protocol: Protocol) -> Result<HttpAnswer, HttpRefusal> {
    create_response_with_body(request, Full::default)
        .map(|response| HttpAnswer::Upgrade(response, protocol))
        .map_err(|_| (StatusCode::BAD_REQUEST, "This address takes WebSocket connections only.\n"))
}

/// The name by which the browser knows this server. It has to be an IP address or `localhost`.
pub(super) fn own_host<B>(request: &Request<B>) -> Result<&str, HttpRefusal> {
    header(request, "host")
        .filter(|host| is_address(host))
        .ok_or((StatusCode::FORBIDDEN, "Host: use the IP address of the server, or localhost.\n"))
}

/// Refuses the pages of other servers.
pub(super) fn check_origin<B>(
    request: &Request<B>,
    host: &str,
    is_encrypted: bool,
) -> Result<(), HttpRefusal> {
    let scheme = if is_encrypted { "https://" } else { "http://" };
    let is_own = |origin: &str| origin.strip_prefix(scheme) == Some(host);
    if request.headers().contains_key("origin") && !header(request, "origin").is_some_and(is_own) {
        return Err((StatusCode::FORBIDDEN, "Origin: only this server's own page can connect.\n"));
    }
    Ok(())
}

pub(super) fn file<B>(
    files: PageFiles,
    request: &Request<B>,
    host: &str,
    is_encrypted: bool,
) -> Result<HttpAnswer, HttpRefusal> {
    let path = request.uri().path().strip_prefix('/').unwrap_or_default();
    let path = if path.is_empty() { "index.html" } else { path };
    let body = files(path).ok_or((StatusCode::NOT_FOUND, "The page has no such file.\n"))?;
    let mut response = response(StatusCode::OK, content_type(path), Bytes::from_owner(body));
    if let Ok(policy) = HeaderValue::from_str(&content_security_policy(host, is_encrypted)) {
        response.headers_mut().insert("content-security-policy", policy);
    }
    Ok(HttpAnswer::Whole(response))
}

fn header<'a, B>(request: &'a Request<B>, name: &str) -> Option<&'a str> {
    request.headers().get(name)?.to_str().ok()
}

pub(super) fn refusal(status: StatusCode, text: &'static str) -> Response<Full<Bytes>> {
    response(status, "text/plain; charset=utf-8", Bytes::from_static(text.as_bytes()))
}

/// Sends the browser to another address of this server.
pub(super) fn redirect(location: &'static str) -> HttpAnswer {
    let mut response = refusal(StatusCode::SEE_OTHER, "");
    response.headers_mut().insert(LOCATION, HeaderValue::from_static(location));
    HttpAnswer::Whole(response)
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
fn content_security_policy(host: &str, is_encrypted: bool) -> String {
    let scheme = if is_encrypted { "wss" } else { "ws" };
    format!(
        "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' data:; connect-src 'self' {scheme}://{host}; base-uri 'none'; \
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
