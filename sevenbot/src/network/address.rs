//! The address of an arm behind a server, which a user gives instead of a port's name.

use std::path::PathBuf;
use std::{env, fmt};

/// The environment variable with the token for servers that require one.
pub const TOKEN_VARIABLE: &str = "SEVENBOT_TOKEN";

/// The environment variable with the path of a PEM file of certificates. The certificate of a server with TLS must be one of
/// them, or be signed by one.
pub const CERTIFICATE_VARIABLE: &str = "SEVENBOT_CERTIFICATE";

/// The address of an arm behind a server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// `tcp://HOST:PORT`, or `socket://HOST:PORT` as pyserial writes it.
    Tcp(String),
    /// `tls://HOST:PORT`: the connection is encrypted, and the server shows a certificate for this host.
    Tls(String),
    /// `unix:PATH` or `unix://PATH`: the Unix socket of a server.
    Unix(PathBuf),
    /// `sevenbot://NAME`: the server that was started with this name.
    Name(String),
}

impl Address {
    /// The address in a port's name; `None` if the port is a serial port or a simulated arm.
    ///
    /// ```
    /// use sevenbot::network::Address;
    ///
    /// assert_eq!(Address::parse("tcp://10.0.0.5:7777"), Some(Address::Tcp("10.0.0.5:7777".to_owned())));
    /// assert_eq!(Address::parse("sevenbot://lab-3"), Some(Address::Name("lab-3".to_owned())));
    /// assert_eq!(Address::parse("/dev/ttyUSB0"), None);
    /// ```
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        let tcp = || name.strip_prefix("tcp://").or_else(|| name.strip_prefix("socket://"));
        let path = || name.strip_prefix("unix://").or_else(|| name.strip_prefix("unix:"));
        if let Some(name) = name.strip_prefix("sevenbot://") {
            return Some(Self::Name(name.trim_end_matches('/').to_owned()));
        }
        if let Some(address) = name.strip_prefix("tls://") {
            return Some(Self::Tls(address.trim_end_matches('/').to_owned()));
        }
        match tcp() {
            Some(address) => Some(Self::Tcp(address.trim_end_matches('/').to_owned())),
            None => path().map(|path| Self::Unix(path.into())),
        }
    }

    /// Is this the host and port of a server, over TCP or TLS?
    #[must_use]
    pub const fn is_of_network(&self) -> bool {
        matches!(self, Self::Tcp(_) | Self::Tls(_))
    }

    /// Can a server at this address get a token? A server at a Unix socket gets none.
    ///
    /// ```
    /// use sevenbot::network::Address;
    ///
    /// let takes_token = |name| Address::parse(name).is_some_and(|address| address.takes_token());
    /// assert!(takes_token("tcp://10.0.0.5:7777") && !takes_token("unix:/run/arm.sock"));
    /// ```
    #[must_use]
    pub const fn takes_token(&self) -> bool {
        !matches!(self, Self::Unix(_))
    }

    /// The token in the environment variable [`TOKEN_VARIABLE`], for servers over TCP and TLS; `None` if it is empty or not set.
    pub(super) fn token() -> Option<String> {
        env::var(TOKEN_VARIABLE).ok().filter(|token| !token.is_empty())
    }
}

impl fmt::Display for Address {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => write!(out, "tcp://{address}"),
            Self::Tls(address) => write!(out, "tls://{address}"),
            Self::Unix(path) => write!(out, "unix:{}", path.display()),
            Self::Name(name) => write!(out, "sevenbot://{name}"),
        }
    }
}

/// Can this text be the token of a server? A token has 8 to 128 letters, digits and punctuation marks of ASCII, and no
/// spaces: so it is hard to guess, and fits on a line.
#[must_use]
pub fn is_token(token: &str) -> bool {
    (8..=128).contains(&token.len()) && token.bytes().all(|byte| byte.is_ascii_graphic())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_long_and_has_no_spaces() {
        assert!(is_token("0123456789abcdef"));
        for bad in ["", "short", "with a space in it", "line\nfeed in it", &"x".repeat(129)] {
            assert!(!is_token(bad), "{bad:?}");
        }
    }

    #[test]
    fn names_of_serial_ports_are_no_addresses() {
        for port in ["/dev/ttyUSB0", "COM3", "./7bot", "tcp", "unix", "sevenbot", ""] {
            assert_eq!(Address::parse(port), None, "{port}");
        }
        assert_eq!(Address::parse("tls://h:1/"), Some(Address::Tls("h:1".to_owned())));
        assert_eq!(Address::parse("socket://h:1/"), Some(Address::Tcp("h:1".to_owned())));
        for path in ["unix:/run/a.sock", "unix:///run/a.sock"] {
            assert_eq!(Address::parse(path), Some(Address::Unix("/run/a.sock".into())));
        }
    }
}
