//! What a class serves: the page, the teacher's screen, and their WebSockets.
//!
//! ```text
//!   /                 ──▶ the page of a pupil, /?class
//!   /teacher.html     ──▶ the teacher's screen. Its address has the teacher's secret, which the page passes on
//!   /class?token=CODE ──▶ messages of a pupil; without `token` if the class has no code
//!   /teacher?token=SECRET ──▶ messages of the teacher
//!   /frames?token=KEY ──▶ frames for the real arm, as long as the pupil with this key has it
//! ```

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use hyper::{Request, StatusCode};

use super::access::{HttpRefusal, token_of};
use super::answer::{HttpAnswer, PageFiles, Protocol, Role, accept, check_origin, file, own_host, redirect};
use super::class::Class;
use crate::token::is_equal;

const PUPIL: &str = "/class";
const TEACHER: &str = "/teacher";
const FRAMES: &str = "/frames";
/// The page of a pupil. Its address tells the page that it is in a class.
const PUPIL_PAGE: &str = "/?class";

/// The page and the WebSockets of a class.
#[derive(Clone)]
pub(super) struct ClassSite {
    pub(super) files: PageFiles,
    /// What pupils have to type; `None`: nothing.
    pub(super) code: Option<String>,
    /// The teacher's secret.
    pub(super) secret: String,
    pub(super) class: Arc<Class>,
    /// The site is behind TLS.
    pub(super) is_encrypted: bool,
}

/// The address of the page on this host.
pub(super) fn page(host: IpAddr, port: u16, is_encrypted: bool) -> String {
    let (scheme, usual_port) = if is_encrypted { ("https", 443) } else { ("http", 80) };
    let authority = match host {
        IpAddr::V4(host) if port == usual_port => host.to_string(),
        host => SocketAddr::new(host, port).to_string(),
    };
    format!("{scheme}://{authority}/")
}

impl ClassSite {
    pub(super) fn needs_secret<B>(request: &Request<B>) -> bool {
        [PUPIL, TEACHER, FRAMES].contains(&request.uri().path())
    }

    pub(super) fn answer<B>(&self, request: &Request<B>) -> Result<HttpAnswer, HttpRefusal> {
        let host = own_host(request)?;
        match request.uri().path() {
            PUPIL => self.messages(request, host, Role::Pupil),
            TEACHER => self.messages(request, host, Role::Teacher),
            FRAMES => self.frames(request, host),
            "/" if request.uri().query().is_none() => Ok(redirect(PUPIL_PAGE)),
            _ => file(self.files, request, host, self.is_encrypted),
        }
    }

    fn messages<B>(&self, request: &Request<B>, host: &str, role: Role) -> Result<HttpAnswer, HttpRefusal> {
        check_origin(request, host, self.is_encrypted)?;
        let (needed, refusal) = match role {
            Role::Pupil => (self.code.as_ref(), "Class code: ask the teacher.\n"),
            Role::Teacher => (Some(&self.secret), "Token: open the address that `sevenbot class` prints.\n"),
        };
        let given = token_of(request.uri()).unwrap_or_default();
        if needed.is_some_and(|needed| !is_equal(given.as_bytes(), needed.as_bytes())) {
            return Err((StatusCode::UNAUTHORIZED, refusal));
        }
        accept(request, Protocol::Class(role))
    }

    /// Only the pupil who has the arm may connect. Pages of other servers are refused.
    fn frames<B>(&self, request: &Request<B>, host: &str) -> Result<HttpAnswer, HttpRefusal> {
        check_origin(request, host, self.is_encrypted)?;
        let given = token_of(request.uri()).unwrap_or_default();
        let lease = self.class.lease_with(|key| is_equal(given.as_bytes(), key.as_bytes()));
        let refusal = "You do not have the real arm now: the teacher gives it.\n";
        let lease = lease.ok_or((StatusCode::FORBIDDEN, refusal))?;
        accept(request, Protocol::LentArm(lease))
    }
}
