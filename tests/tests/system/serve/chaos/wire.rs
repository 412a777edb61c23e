//! The ways to connect to the server, and a connection of each kind.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use rustix::net::sockopt::set_socket_linger;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use serialport::SerialPort;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use crate::serve::served::LOCAL_PAGE;

/// How long a wire waits for bytes.
const RECEIVE_TIME: Duration = Duration::from_millis(100);
/// A server that takes no bytes for this time has failed.
const SEND_TIME: Duration = Duration::from_secs(30);

#[derive(Clone, Debug)]
pub(crate) enum WayIn {
    Terminal(PathBuf),
    Unix(PathBuf),
    Tcp(String),
    Web { address: String, is_page: bool },
}

/// The token and the encryption of TCP and WebSocket connections.
#[derive(Clone)]
pub(crate) struct Security {
    pub(crate) token: &'static str,
    /// `None`: the connections are not encrypted.
    tls: Option<Arc<ClientConfig>>,
}

impl Security {
    /// With a certificate, TCP and WebSocket connections are encrypted, and the server has to present this certificate.
    pub(crate) fn new(token: &'static str, certificate: Option<PathBuf>) -> Self {
        let tls = certificate.map(|path| {
            let mut roots = RootCertStore::empty();
            roots.add(CertificateDer::from_pem_file(path).expect("a certificate")).expect("fit");
            Arc::new(ClientConfig::builder().with_root_certificates(roots).with_no_client_auth())
        });
        Self { token, tls }
    }

    fn secure(&self, stream: TcpStream) -> Secured {
        match &self.tls {
            None => Secured::Plain(stream),
            Some(tls) => {
                let name = "localhost".try_into().expect("a name");
                let connection = ClientConnection::new(Arc::clone(tls), name).expect("a connection");
                Secured::Tls(Box::new(StreamOwned::new(connection, stream)))
            }
        }
    }
}

/// A TCP connection, encrypted or not.
pub(crate) enum Secured {
    Plain(TcpStream),
    Tls(Box<StreamOwned<ClientConnection, TcpStream>>),
}

impl Secured {
    const fn tcp(&self) -> &TcpStream {
        match self {
            Self::Plain(stream) => stream,
            Self::Tls(stream) => &stream.sock,
        }
    }
}

impl Read for Secured {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(stream) => stream.read(bytes),
            Self::Tls(stream) => stream.read(bytes),
        }
    }
}

impl Write for Secured {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(stream) => stream.write(bytes),
            Self::Tls(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(stream) => stream.flush(),
            Self::Tls(stream) => stream.flush(),
        }
    }
}

/// A wire that carries frames.
pub(crate) enum ByteWire {
    Terminal(Box<dyn SerialPort>),
    Unix(UnixStream),
    Tcp(Secured),
}

impl ByteWire {
    /// Opens a connection. Fails for [`WayIn::Web`], which needs a [`WebWire`].
    pub(crate) fn open(way_in: &WayIn, security: &Security) -> io::Result<Self> {
        match way_in {
            WayIn::Terminal(path) => {
                let name = path.to_str().expect("text");
                Ok(Self::Terminal(serialport::new(name, 115_200).timeout(RECEIVE_TIME).open()?))
            }
            WayIn::Unix(path) => {
                let stream = UnixStream::connect(path)?;
                stream.set_read_timeout(Some(RECEIVE_TIME))?;
                stream.set_write_timeout(Some(SEND_TIME))?;
                Ok(Self::Unix(stream))
            }
            WayIn::Tcp(address) => {
                let mut stream = security.secure(connect(address)?);
                stream.write_all(format!("{}\n", security.token).as_bytes())?;
                Ok(Self::Tcp(stream))
            }
            WayIn::Web { .. } => Err(ErrorKind::Unsupported.into()),
        }
    }

    pub(crate) const fn kind(&self) -> &'static str {
        match self {
            Self::Terminal(_) => "a terminal",
            Self::Unix(_) => "the Unix socket",
            Self::Tcp(_) => "TCP",
        }
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Terminal(port) => port.write_all(bytes),
            Self::Unix(stream) => stream.write_all(bytes),
            Self::Tcp(stream) => stream.write_all(bytes),
        }
    }

    /// Adds the bytes that arrive within [`RECEIVE_TIME`].
    pub(crate) fn receive(&mut self, received: &mut Vec<u8>) -> io::Result<()> {
        let mut bytes = [0; 4_096];
        let outcome = match self {
            Self::Terminal(port) => port.read(&mut bytes),
            Self::Unix(stream) => stream.read(&mut bytes),
            Self::Tcp(stream) => stream.read(&mut bytes),
        };
        match outcome {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => {
                received.extend(&bytes[..count]);
                Ok(())
            }
            Err(error) => ignore_timeout(error),
        }
    }

    /// Resets a TCP connection: bytes that were not delivered are lost. A terminal or a Unix socket can only be closed.
    pub(crate) fn reset(self) {
        match &self {
            Self::Terminal(_) => {}
            Self::Unix(stream) => linger_not(stream),
            Self::Tcp(stream) => linger_not(stream.tcp()),
        }
    }
}

/// The maker's WebSocket.
pub(crate) struct WebWire(WebSocket<Secured>);

impl WebWire {
    pub(crate) fn open(address: &str, is_page: bool, security: &Security) -> Result<Self, String> {
        let stream = connect(address).map_err(|error| error.to_string())?;
        let url = format!("ws://{address}/ws?token={}", security.token);
        let mut request = url.into_client_request().expect("a request");
        if is_page {
            let (name, value) = LOCAL_PAGE;
            request.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        // A short timeout could interrupt the handshake, and this function does not continue it.
        stream.set_read_timeout(Some(SEND_TIME)).map_err(|error| error.to_string())?;
        let (socket, _) =
            tungstenite::client(request, security.secure(stream)).map_err(|error| error.to_string())?;
        let tcp = socket.get_ref().tcp();
        tcp.set_read_timeout(Some(RECEIVE_TIME)).map_err(|error| error.to_string())?;
        Ok(Self(socket))
    }

    pub(crate) fn send(&mut self, text: &str) -> io::Result<()> {
        self.0.send(Message::text(text)).map_err(io::Error::other)
    }

    /// Sends bytes as they are, which need not be whole messages.
    pub(crate) fn send_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.get_mut().write_all(bytes)
    }

    /// The next message; `None` if none arrives within [`RECEIVE_TIME`], or it is not text.
    pub(crate) fn receive(&mut self) -> io::Result<Option<String>> {
        match self.0.read() {
            Ok(Message::Text(text)) => Ok(Some(text.as_str().to_owned())),
            Ok(_) => Ok(None),
            Err(tungstenite::Error::Io(error)) => ignore_timeout(error).map(|()| None),
            Err(error) => Err(io::Error::other(error)),
        }
    }

    /// Closes the connection with a WebSocket close frame.
    pub(crate) fn close(mut self) {
        let _ = self.0.close(None);
        let _ = self.0.flush();
    }

    /// Resets the TCP connection without a close frame.
    pub(crate) fn reset(self) {
        linger_not(self.0.get_ref().tcp());
    }
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let stream = TcpStream::connect(address)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(RECEIVE_TIME))?;
    stream.set_write_timeout(Some(SEND_TIME))?;
    Ok(stream)
}

fn linger_not(stream: &impl AsFd) {
    set_socket_linger(stream, Some(Duration::ZERO)).expect("an option");
}

fn ignore_timeout(error: io::Error) -> io::Result<()> {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => Ok(()),
        _ => Err(error),
    }
}
