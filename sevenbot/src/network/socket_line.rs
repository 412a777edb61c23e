//! A line to an arm behind a server: a TCP connection, or a Unix socket.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
#[cfg(unix)]
use std::os::unix::net::UnixStream;
use std::time::Duration;

use super::address::Address;
use super::known_names::{KnownName, known_names, remember};
use super::local_server::servers;
use crate::error::{OpenError, PortError};
use crate::host_line::HostLine;

/// The shortest timeout that the system takes.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);
/// After this time a server that takes no bytes has failed.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// How long a server may take to accept the connection, and to answer each step of the TLS handshake.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A stream of bytes whose reads have a timeout.
trait TimedStream: Read + Write + Send + Sync {
    fn set_timeout(&self, timeout: Duration) -> io::Result<()>;
}

impl TimedStream for TcpStream {
    fn set_timeout(&self, timeout: Duration) -> io::Result<()> {
        self.set_read_timeout(Some(timeout))
    }
}

#[cfg(unix)]
impl TimedStream for UnixStream {
    fn set_timeout(&self, timeout: Duration) -> io::Result<()> {
        self.set_read_timeout(Some(timeout))
    }
}

#[cfg(feature = "tls")]
impl TimedStream for super::tls::TlsStream {
    fn set_timeout(&self, timeout: Duration) -> io::Result<()> {
        self.sock.set_read_timeout(Some(timeout))
    }
}

/// A line to an arm behind a server.
pub struct SocketLine(Box<dyn TimedStream>);

impl fmt::Debug for SocketLine {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("SocketLine")
    }
}

impl SocketLine {
    /// Connects to a server. A server over TCP gets `token`; `None`: the token in the environment variable
    /// [`TOKEN_VARIABLE`](super::TOKEN_VARIABLE). With TLS, the certificate of the server must be one in the file of
    /// [`CERTIFICATE_VARIABLE`](super::CERTIFICATE_VARIABLE), or be signed by one there.
    ///
    /// # Errors
    /// There is no such server, it cannot be reached, or its certificate is not trusted.
    pub fn connect(address: &Address, token: Option<&str>) -> Result<Self, OpenError> {
        let token = token.map(str::to_owned).or_else(Address::token);
        let token = token.as_deref();
        match address {
            Address::Tcp(address) => connect_tcp(address, None, token),
            Address::Tls(address) => connect_tcp(address, Some(host(address)), token),
            Address::Unix(path) => connect_unix(path),
            Address::Name(name) => {
                let named = servers().into_iter().find(|server| server.name.as_ref() == Some(name));
                named.map_or_else(|| connect_named(name, token), |server| connect_unix(&server.socket))
            }
        }
        .map(Self)
    }
}

/// Connects to a server of the local network: at the address that it announces now, or else at its last known address.
/// Remembers an announced address.
fn connect_named(name: &str, token: Option<&str>) -> Result<Box<dyn TimedStream>, OpenError> {
    if let Some(known) = announced(name) {
        let stream = connect_known(&known, token)?;
        // Ignore a failure: a name that is announced works without a remembered address.
        let _ = remember(&known);
        return Ok(stream);
    }
    let known = known_names().into_iter().find(|known| known.name == name).ok_or(OpenError::NotFound)?;
    connect_known(&known, token)
}

/// Connects to a known server. Its certificate has to match its name, because its address may change.
fn connect_known(known: &KnownName, token: Option<&str>) -> Result<Box<dyn TimedStream>, OpenError> {
    match &known.address {
        Address::Tls(address) => connect_tcp(address, Some(&known.name), token),
        Address::Tcp(address) => connect_tcp(address, None, token),
        Address::Unix(_) | Address::Name(_) => Err(OpenError::NotFound),
    }
}

#[cfg(feature = "mdns")]
fn announced(name: &str) -> Option<KnownName> {
    super::mdns::find(name).map(KnownName::from)
}

#[cfg(not(feature = "mdns"))]
const fn announced(_: &str) -> Option<KnownName> {
    None
}

/// `host`: the connection is encrypted, and the certificate must be for this host; `None`: no encryption.
fn connect_tcp(
    address: &str,
    host: Option<&str>,
    token: Option<&str>,
) -> Result<Box<dyn TimedStream>, OpenError> {
    let addresses =
        std::net::ToSocketAddrs::to_socket_addrs(address).map_err(|error| match error.kind() {
            ErrorKind::InvalidInput => OpenError::Unusable(
                "its port number is missing or wrong: use HOST:PORT, as 10.0.0.5:7777".to_owned(),
            ),
            _ => failed(&error),
        })?;
    let mut last = OpenError::NotFound;
    for address in addresses {
        let stream = TcpStream::connect_timeout(&address, CONNECT_TIMEOUT);
        match stream.and_then(|stream| log_in(stream, host, token)) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = failed(&error),
        }
    }
    Err(last)
}

/// The host of `HOST:PORT`, where the host may be an address of IPv6 in brackets.
fn host(address: &str) -> &str {
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    host.trim_start_matches('[').trim_end_matches(']')
}

fn log_in(stream: TcpStream, host: Option<&str>, token: Option<&str>) -> io::Result<Box<dyn TimedStream>> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    stream.set_read_timeout(Some(CONNECT_TIMEOUT))?;
    let mut stream: Box<dyn TimedStream> = match host {
        None => Box::new(stream),
        Some(host) => encrypt(stream, host)?,
    };
    if let Some(token) = token {
        stream.write_all(format!("{token}\n").as_bytes())?;
    }
    Ok(stream)
}

#[cfg(feature = "tls")]
fn encrypt(stream: TcpStream, host: &str) -> io::Result<Box<dyn TimedStream>> {
    Ok(Box::new(super::tls::connect(stream, host)?))
}

#[cfg(not(feature = "tls"))]
fn encrypt(_: TcpStream, _: &str) -> io::Result<Box<dyn TimedStream>> {
    Err(io::Error::other("this program was built without TLS"))
}

#[cfg(unix)]
fn connect_unix(path: &std::path::Path) -> Result<Box<dyn TimedStream>, OpenError> {
    let connect = || -> io::Result<Box<dyn TimedStream>> {
        let stream = UnixStream::connect(path)?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        Ok(Box::new(stream))
    };
    connect().map_err(|error: io::Error| failed(&error))
}

#[cfg(not(unix))]
fn connect_unix(_: &std::path::Path) -> Result<Box<dyn TimedStream>, OpenError> {
    Err(OpenError::Unusable("this system has no Unix sockets".to_owned()))
}

fn failed(error: &io::Error) -> OpenError {
    match error.kind() {
        ErrorKind::NotFound => OpenError::NotFound,
        ErrorKind::PermissionDenied => OpenError::PermissionDenied { group: None },
        _ => OpenError::Unusable(error.to_string()),
    }
}

fn lost(error: io::Error) -> PortError {
    match error.kind() {
        ErrorKind::TimedOut | ErrorKind::WouldBlock => PortError::Stalled,
        kind => PortError::Lost(kind),
    }
}

impl SocketLine {
    fn read(&mut self, timeout: Duration, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.set_timeout(timeout.max(SHORTEST_WAIT))?;
        self.0.read(bytes)
    }
}

impl HostLine for SocketLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.write_all(bytes).map_err(lost)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        let mut chunk = [0; 4096];
        loop {
            match self.read(timeout, &mut chunk) {
                Ok(0) => return Err(PortError::Lost(ErrorKind::UnexpectedEof)),
                Ok(length) => return Ok(chunk.into_iter().take(length).collect()),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    return Ok(Vec::new());
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(PortError::Lost(error.kind())),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn bytes_pass_and_the_end_of_the_server_is_an_error() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address").to_string();
        let mut line = SocketLine::connect(&Address::Tcp(address), Some("a token")).expect("a connection");
        let (mut server, _) = listener.accept().expect("a client");
        assert_eq!(line.receive(Duration::ZERO), Ok(Vec::new()));
        line.send(b"request").expect("sent");
        let mut request = [0; 15];
        server.read_exact(&mut request).expect("received");
        assert_eq!(&request, b"a token\nrequest");
        server.write_all(b"reply").expect("sent");
        assert_eq!(line.receive(Duration::from_secs(10)), Ok(b"reply".to_vec()));
        drop(server);
        assert_eq!(line.receive(Duration::from_secs(10)), Err(PortError::Lost(ErrorKind::UnexpectedEof)));
    }

    #[test]
    fn the_host_of_an_address_has_no_port_and_no_brackets() {
        for (address, wanted) in [("lab-3:7777", "lab-3"), ("10.0.0.5:1", "10.0.0.5"), ("[::1]:7", "::1")] {
            assert_eq!(host(address), wanted);
        }
    }

    #[test]
    fn an_address_without_a_port_number_is_an_error() {
        for address in ["127.0.0.1", "127.0.0.1:", "lab-3:http"] {
            let error = SocketLine::connect(&Address::Tcp(address.to_owned()), None).expect_err(address);
            assert!(error.to_string().contains("port number is missing or wrong"), "{address}: {error}");
        }
    }

    #[test]
    fn no_server_is_an_error() {
        let name = Address::Name("no server has this name".to_owned());
        assert!(matches!(SocketLine::connect(&name, None), Err(OpenError::NotFound)));
        assert!(matches!(
            SocketLine::connect(&Address::Unix("/none".into()), None),
            Err(OpenError::NotFound)
        ));
    }
}
