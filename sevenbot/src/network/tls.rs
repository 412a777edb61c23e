//! An encrypted connection to a server whose certificate the user has.

use std::net::TcpStream;
use std::sync::Arc;
use std::{env, io};

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

use super::address::CERTIFICATE_VARIABLE;

pub(super) type TlsStream = StreamOwned<ClientConnection, TcpStream>;

/// Encrypts a connection. The certificate of the server has to be for this host, and to be in the file of
/// [`CERTIFICATE_VARIABLE`], or to be signed by one there.
pub(super) fn connect(mut stream: TcpStream, host: &str) -> io::Result<TlsStream> {
    let config = ClientConfig::builder().with_root_certificates(certificates()?).with_no_client_auth();
    let name = ServerName::try_from(host.to_owned()).map_err(io::Error::other)?;
    let mut connection = ClientConnection::new(Arc::new(config), name).map_err(io::Error::other)?;
    while connection.is_handshaking() {
        connection.complete_io(&mut stream)?;
    }
    Ok(StreamOwned::new(connection, stream))
}

/// The certificates that the user trusts.
fn certificates() -> io::Result<RootCertStore> {
    let path = env::var_os(CERTIFICATE_VARIABLE).filter(|path| !path.is_empty());
    let path = path.ok_or_else(|| {
        io::Error::other(format!(
            "TLS needs the server's certificate: a file in PEM, in {CERTIFICATE_VARIABLE}"
        ))
    })?;
    let failed = |error: &dyn std::fmt::Display| {
        io::Error::other(format!("{CERTIFICATE_VARIABLE}, {}: {error}", path.display()))
    };
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(&path).map_err(|error| failed(&error))? {
        let certificate = certificate.map_err(|error| failed(&error))?;
        roots.add(certificate).map_err(|error| failed(&error))?;
    }
    Ok(roots)
}
