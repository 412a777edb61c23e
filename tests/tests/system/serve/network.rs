//! Servers on the network: TLS, and names.

use std::path::Path;
use std::process::Output;

use system_tests::multicast;
use system_tests::programs::tool;
use system_tests::wait::wait_until;

use super::served::Served;

/// The tool connects with TLS and trusts only the certificate in `SEVENBOT_CERTIFICATE`. The library and Python connect in the
/// same way.
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
    // The server is reachable at this address, too, but its certificate does not contain the address.
    let other = read("127.0.0.2", Some(&certificate));
    assert!(!other.status.success(), "{other:?}");
}

/// Runs the tool as another user of this computer would: without the files of the server.
fn run_elsewhere(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = tool();
    command
        .env("XDG_RUNTIME_DIR", folder)
        .env("XDG_STATE_HOME", folder)
        .env("SEVENBOT_TOKEN", "correct-horse");
    command.env_remove("SEVENBOT_PORT").args(arguments).output().expect("the tool runs")
}

fn all_of(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat()
}

/// A server with a name that it announces.
fn announced(name: &str) -> Served {
    Served::start(1, &["--token", "correct-horse", "--listen", "0.0.0.0", "--unencrypted", "--name", name])
}

/// Another user of this computer finds the server by multicast, as other computers do. From then on the tool knows its
/// address.
#[test]
fn a_name_is_found_on_the_network() {
    let name = format!("test-{}", std::process::id());
    let served = announced(&name);
    let elsewhere = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| run_elsewhere(elsewhere.path(), arguments);
    let unknown = run(&["--port", "sevenbot://nobody-has-this-name", "get", "device-code"]);
    assert!(!unknown.status.success() && all_of(&unknown).contains("nobody-has-this-name"), "{unknown:?}");
    if !multicast::works() {
        eprintln!("this system has no multicast: no name is announced");
        return;
    }
    let port = format!("sevenbot://{name}");
    wait_until("the name is listed", || all_of(&run(&["ports", "--network"])).contains(&port));
    let read = run(&["--port", &port, "get", "device-code"]);
    assert!(read.status.success(), "{read:?}");
    drop(served);
    wait_until("the name is not announced any more", || {
        let listed = all_of(&run(&["ports", "--network"]));
        listed.contains("known, and not announced now") && listed.contains(&port)
    });
    assert!(run(&["ports", "--forget", &name]).status.success());
    let again = run(&["ports", "--forget", &name]);
    assert!(all_of(&again).contains("is not a known name"), "{}", all_of(&again));
    assert!(!all_of(&run(&["ports", "--network"])).contains(&port));
}

/// The server does not announce this name, as if the network blocked multicast.
#[test]
fn a_name_that_the_user_entered_needs_no_multicast() {
    let served = Served::start(1, &["--token", "correct-horse"]);
    let elsewhere = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| run_elsewhere(elsewhere.path(), arguments);
    let address = format!("tcp://127.0.0.1:{}", served.connect().peer_addr().expect("an address").port());
    for wrong in ["lab-3", "lab-3=/dev/ttyUSB0", "a b=tcp://127.0.0.1:1"] {
        let refused = run(&["ports", "--remember", wrong]);
        assert_eq!(refused.status.code(), Some(2), "{wrong}: {refused:?}");
    }
    assert!(run(&["ports", "--remember", &format!("entered-by-hand={address}")]).status.success());
    let read = run(&["--port", "sevenbot://entered-by-hand", "get", "device-code"]);
    assert!(read.status.success(), "{read:?}");
    let listed = all_of(&run(&["ports", "--network"]));
    assert!(listed.contains("sevenbot://entered-by-hand") && listed.contains(&address), "{listed}");
    let read = run(&["--port", &address, "get", "device-code"]);
    assert!(read.status.success(), "{read:?}");
}
