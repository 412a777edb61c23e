//! A line to an arm behind a server: a TCP connection, or a Unix socket.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
#[cfg(unix)]
use std::os::unix::net::UnixStream;
use std::time::Duration;

use super::address::Address;
use super::local_server::servers;
use crate::error::{OpenError, PortError};
use crate::host_line::HostLine;

/// The shortest timeout that the system takes.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);
/// After this time a server that takes no bytes has failed.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// How long a computer may take to answer.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

#[derive(Debug)]
enum Stream {
    Tcp(TcpStream),
    #[cfg(unix)]
    Unix(UnixStream),
}

/// A line to an arm behind a server.
#[derive(Debug)]
pub struct SocketLine(Stream);

impl SocketLine {
    /// Connects to a server. Over TCP the token is that of the environment variable [`TOKEN_VARIABLE`](super::TOKEN_VARIABLE).
    ///
    /// # Errors
    /// There is no such server, or it cannot be reached.
    pub fn connect(address: &Address) -> Result<Self, OpenError> {
        match address {
            Address::Tcp(address) => connect_tcp(address),
            Address::Unix(path) => connect_unix(path),
            Address::Name(name) => {
                let named = servers().into_iter().find(|server| server.name.as_ref() == Some(name));
                named.map_or_else(|| connect_named(name), |server| connect_unix(&server.socket))
            }
        }
        .map(Self)
    }
}

/// Connects to a server of the local network.
#[cfg(feature = "mdns")]
fn connect_named(name: &str) -> Result<Stream, OpenError> {
    let address = super::mdns::find(name).ok_or(OpenError::NotFound)?;
    connect_tcp(&address.to_string())
}

#[cfg(not(feature = "mdns"))]
fn connect_named(_: &str) -> Result<Stream, OpenError> {
    Err(OpenError::NotFound)
}

fn connect_tcp(address: &str) -> Result<Stream, OpenError> {
    let addresses = std::net::ToSocketAddrs::to_socket_addrs(address).map_err(|error| failed(&error))?;
    let mut last = OpenError::NotFound;
    for address in addresses {
        match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT).and_then(log_in) {
            Ok(stream) => return Ok(Stream::Tcp(stream)),
            Err(error) => last = failed(&error),
        }
    }
    Err(last)
}

fn log_in(mut stream: TcpStream) -> io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    if let Some(token) = Address::token() {
        stream.write_all(format!("{token}\n").as_bytes())?;
    }
    Ok(stream)
}

#[cfg(unix)]
fn connect_unix(path: &std::path::Path) -> Result<Stream, OpenError> {
    let connect = || {
        let stream = UnixStream::connect(path)?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        Ok(Stream::Unix(stream))
    };
    connect().map_err(|error: io::Error| failed(&error))
}

#[cfg(not(unix))]
fn connect_unix(_: &std::path::Path) -> Result<Stream, OpenError> {
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
        let timeout = Some(timeout.max(SHORTEST_WAIT));
        match &mut self.0 {
            Stream::Tcp(stream) => stream.set_read_timeout(timeout).and_then(|()| stream.read(bytes)),
            #[cfg(unix)]
            Stream::Unix(stream) => stream.set_read_timeout(timeout).and_then(|()| stream.read(bytes)),
        }
    }
}

impl HostLine for SocketLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        match &mut self.0 {
            Stream::Tcp(stream) => stream.write_all(bytes),
            #[cfg(unix)]
            Stream::Unix(stream) => stream.write_all(bytes),
        }
        .map_err(lost)
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
        let mut line = SocketLine::connect(&Address::Tcp(address)).expect("a connection");
        let (mut server, _) = listener.accept().expect("a client");
        assert_eq!(line.receive(Duration::ZERO), Ok(Vec::new()));
        line.send(b"request").expect("sent");
        let mut request = [0; 7];
        server.read_exact(&mut request).expect("received");
        server.write_all(b"reply").expect("sent");
        assert_eq!(line.receive(Duration::from_secs(10)), Ok(b"reply".to_vec()));
        drop(server);
        assert_eq!(line.receive(Duration::from_secs(10)), Err(PortError::Lost(ErrorKind::UnexpectedEof)));
    }

    #[test]
    fn no_server_is_an_error() {
        let name = Address::Name("no server has this name".to_owned());
        assert!(matches!(SocketLine::connect(&name), Err(OpenError::NotFound)));
        assert!(matches!(SocketLine::connect(&Address::Unix("/none".into())), Err(OpenError::NotFound)));
    }
}
