//! Clients of other computers: TLS and the token.

#![cfg(target_os = "linux")]
#![allow(clippy::expect_used, clippy::unwrap_used)] // A panic is a failed test.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use sevenbot_serve::server::{
    AccessPolicy, Notice, RefusalReason, Server, ServerConfig, ServerStop, TlsFiles,
};
use tokio_rustls::rustls::pki_types::CertificateDer;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

const TOKEN: &str = "correct-horse";

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/certificate").join(name)
}

/// A client that trusts the certificate of the test.
fn connect(address: SocketAddr) -> StreamOwned<ClientConnection, TcpStream> {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(file("certificate.pem")).expect("a certificate")).expect("fit");
    let config = ClientConfig::builder().with_root_certificates(roots).with_no_client_auth();
    let name = "localhost".try_into().expect("a name");
    let connection = ClientConnection::new(Arc::new(config), name).expect("a connection");
    let stream = TcpStream::connect(address).expect("a server");
    stream.set_read_timeout(Some(Duration::from_millis(500))).expect("a timeout");
    StreamOwned::new(connection, stream)
}

fn is_open(mut stream: impl Read) -> bool {
    stream
        .read(&mut [0])
        .is_err_and(|error| matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut))
}

#[test]
fn only_encrypted_clients_with_the_token_are_served() {
    let config = ServerConfig {
        tcp: Some(SocketAddr::from(([127, 0, 0, 1], 0))),
        access: AccessPolicy { token: Some(TOKEN.to_owned()), allows_any_page: false },
        tls: Some(TlsFiles { certificate: file("certificate.pem"), key: file("key.pem") }),
        ..ServerConfig::new(None, 115_200)
    };
    let server = Server::open(config).expect("a server");
    let address = server.tcp_address().expect("an address");
    let stop = ServerStop::default();
    let trigger = stop.clone();
    let (sender, notices) = mpsc::channel();
    let running = thread::spawn(move || server.run(&stop, &mut |notice| drop(sender.send(notice))));

    let mut good = connect(address);
    good.write_all(format!("{TOKEN}\n").as_bytes()).expect("taken");
    assert!(is_open(&mut good));
    let mut wrong = connect(address);
    wrong.write_all(b"battery-staple\n").expect("taken");
    let refused = notices.recv_timeout(Duration::from_secs(60)).expect("a notice");
    assert!(matches!(refused, Notice::Refused { reason: RefusalReason::WrongToken, .. }), "{refused:?}");
    let mut plain = TcpStream::connect(address).expect("a connection");
    plain.set_read_timeout(Some(Duration::from_secs(60))).expect("a timeout");
    plain.write_all(format!("{TOKEN}\n").as_bytes()).expect("taken");
    let mut rest = Vec::new();
    let ended = plain.read_to_end(&mut rest);
    let is_timeout =
        ended.is_err_and(|error| matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut));
    assert!(!is_timeout, "the server ends the connection");
    assert!(is_open(&mut good), "it has not noticed the others");
    trigger.stop();
    running.join().expect("no panic").expect("no error");
}

#[test]
fn a_file_that_is_no_certificate_is_an_error_with_its_name() {
    let tls = TlsFiles { certificate: file("key.pem"), key: file("none.pem") };
    let config = ServerConfig { tls: Some(tls), ..ServerConfig::new(None, 115_200) };
    let error = Server::open(config).expect_err("no key").to_string();
    assert!(error.contains("none.pem") && error.contains("BEGIN CERTIFICATE"), "{error}");
}
