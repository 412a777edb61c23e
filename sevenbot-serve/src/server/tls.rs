//! TLS for clients of other computers.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};

use super::start_error::StartError;

/// The certificate of the server, and its key, as files in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The certificate, followed by those that sign it.
    pub certificate: PathBuf,
    /// The private key that belongs to the certificate.
    pub key: PathBuf,
}

/// Reads the files, and returns the acceptor of encrypted connections.
pub(super) fn acceptor(files: &TlsFiles) -> Result<TlsAcceptor, StartError> {
    let failed =
        |option, path: &Path, cause| StartError::Certificate { option, path: path.to_owned(), cause };
    let failed_certificate = |cause| failed("--tls-cert", &files.certificate, cause);
    let chain = CertificateDer::pem_file_iter(&files.certificate)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(|error| failed_certificate(io::Error::other(error.to_string())))?;
    let key = PrivateKeyDer::from_pem_file(&files.key)
        .map_err(|error| failed("--tls-key", &files.key, io::Error::other(error.to_string())))?;
    let config = ServerConfig::builder()
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .map_err(|error| failed_certificate(io::Error::other(error)))?;
    Ok(TlsAcceptor::from(Arc::new(config)))
}
