//! Servers of the network: TLS, and names.

use std::process::Output;

use system_tests::multicast;
use system_tests::programs::tool;
use system_tests::wait::wait_until;

use super::served::Served;

/// TLS with the certificate that the user has, in the tool; the library and Python connect in the same way.
#[test]
fn the_tool_connects_with_tls_and_the_certificate_of_the_server() {
    let file =
        |name: &str| format!("{}/../sevenbot-serve/tests/certificate/{name}", env!("CARGO_MANIFEST_DIR"));
    let (certificate, key) = (file("certificate.pem"), file("key.pem"));
    let served =
        Served::start(1, &["--token", "correct-horse", "--tls-cert", &certificate, "--tls-key", &key]);
    let port = served.connect().peer_addr().expect("an address").port();
    let read = |host: &str, certificate: Option<&str>| {
        let mut command = tool();
        command.env("SEVENBOT_TOKEN", "correct-horse").env_remove("SEVENBOT_CERTIFICATE");
        command.envs(certificate.map(|path| ("SEVENBOT_CERTIFICATE", path)));
        let output = command.args(["--port", &format!("tls://{host}:{port}"), "get", "device-code"]).output();
        output.expect("the tool runs")
    };
    for host in ["localhost", "127.0.0.1"] {
        let output = read(host, Some(&certificate));
        assert!(output.status.success(), "{host}: {output:?}");
    }
    let said = |output: Output| String::from_utf8_lossy(&output.stderr).into_owned();
    let missing = read("localhost", None);
    assert!(!missing.status.success());
    assert!(said(missing).contains("SEVENBOT_CERTIFICATE"));
    let wrong = read("localhost", Some(&key));
    assert!(!wrong.status.success(), "{wrong:?}");
    // It has this address, too, but the certificate is not for it.
    let other = read("127.0.0.2", Some(&certificate));
    assert!(!other.status.success(), "{other:?}");
}

/// Another user of this computer finds it by multicast, as other computers do. Where multicast is blocked, a name is an error that
/// names it, and the address works.
#[test]
fn a_name_is_found_on_the_network() {
    let name = format!("test-{}", std::process::id());
    let options = ["--token", "correct-horse", "--listen", "0.0.0.0", "--unencrypted", "--name", &name];
    let served = Served::start(1, &options);
    let elsewhere = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| {
        let mut command = tool();
        command.env("XDG_RUNTIME_DIR", elsewhere.path()).env("SEVENBOT_TOKEN", "correct-horse");
        command.env_remove("SEVENBOT_PORT").args(arguments).output().expect("the tool runs")
    };
    let has_multicast = multicast::works();
    let port = format!("sevenbot://{name}");
    let unknown = run(&["--port", "sevenbot://nobody-has-this-name", "get", "device-code"]);
    assert!(!unknown.status.success(), "{unknown:?}");
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("nobody-has-this-name"), "{unknown:?}");
    if !has_multicast {
        eprintln!(
            "this system has no multicast: what is tested is that the name is not found, and that the address works"
        );
        let not_found = run(&["--port", &port, "get", "device-code"]);
        assert!(!not_found.status.success() && String::from_utf8_lossy(&not_found.stderr).contains(&name));
        let address = format!("tcp://127.0.0.1:{}", served.connect().peer_addr().expect("an address").port());
        let read = run(&["--port", &address, "get", "device-code"]);
        assert!(read.status.success(), "{read:?}");
        return;
    }
    wait_until("the name is listed", || {
        let listed = run(&["ports", "--network"]);
        String::from_utf8_lossy(&listed.stdout).contains(&port)
    });
    let read = run(&["--port", &port, "get", "device-code"]);
    assert!(read.status.success(), "{read:?}");
    drop(served);
}
