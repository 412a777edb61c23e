//! Attacks on `sevenbot serve`: floods, requests of web pages, late targets and wrong tokens. Most attacks are bounded in
//! count or time. Other tests here check that the tool finds the server, and that refused programs learn why.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::process::Output;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use system_tests::frames::reply;
use system_tests::process::{self, Signal};
use system_tests::programs::tool;
use system_tests::registers::{DEVICE_CODE, PRESENT_POSITION, SPEED, TARGET_POSITION};
use system_tests::{ArmClient, read_request, write_request};

use super::served::{
    LOCAL_PAGE, Served, WebClient, exchange, read_until, simulator, web_frame, web_handshake,
};

/// Registers of the server.
const DRIVEN_BY: u8 = 234;
const STATE: u8 = 236;

fn target(arm: &mut ArmClient) -> u8 {
    arm.register(TARGET_POSITION)
}

/// Runs the tool on a port of the folder.
fn run(served: &Served, port: &str, arguments: &[&str]) -> Output {
    let mut tool = tool();
    tool.current_dir(served.folder.path()).env("XDG_RUNTIME_DIR", served.folder.path());
    tool.args(["--port", port]).args(arguments).output().expect("the tool runs")
}

/// Checks for half a second that the target of joint 1 does not change.
#[track_caller]
fn check_rests(arm: &mut ArmClient, context: &str) {
    let before = target(arm);
    for _ in 0..10 {
        thread::sleep(Duration::from_millis(50));
        assert_eq!(target(arm), before, "{context}");
    }
}

/// Sends targets as fast as the server takes them, for half a second at most.
fn flood_with_targets(mut stream: impl Write) {
    let frames: Vec<u8> = (40..140).flat_map(|value| write_request(TARGET_POSITION, &[value])).collect();
    let end = Instant::now() + Duration::from_millis(500);
    while Instant::now() < end && stream.write_all(&frames).is_ok() {}
}

#[test]
fn a_flood_of_targets_ends_with_its_connection() {
    let served = Served::start(1, &[]);
    let mut arm = served.open("a");
    let stream = served.connect();
    stream.set_write_timeout(Some(Duration::from_millis(100))).expect("a timeout");
    flood_with_targets(&stream);
    drop(stream);
    thread::sleep(Duration::from_secs(1));
    check_rests(&mut arm, "TCP");
    let web = WebClient::connect(&served, &[]).expect("accepted").stream();
    web.set_write_timeout(Some(Duration::from_millis(100))).expect("a timeout");
    let messages: Vec<u8> = (40..140)
        .flat_map(|value| web_frame(0x81, format!(r#"{{"cmd":"angle","id":0,"angle":{value}}}"#).as_bytes()))
        .collect();
    for _ in 0..1_000 {
        if (&web).write_all(&messages).is_err() {
            break;
        }
    }
    drop(web);
    thread::sleep(Duration::from_secs(1));
    check_rests(&mut arm, "WebSocket");
    drop(arm);
    let stopped = run(&served, "./a", &["stop"]);
    assert!(stopped.status.success(), "{stopped:?}");
}

#[test]
fn fragments_without_end_keep_nobody_waiting() {
    let served = Served::start(1, &[]);
    let mut arm = served.open("a");
    let mut flood = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    flood.send_bytes(&web_frame(0x01, b"{"));
    let stream = flood.stream();
    let flooding = thread::spawn(move || {
        let fragments = web_frame(0x00, b"").repeat(1_000);
        let mut count = 0;
        while count < 20_000 && (&stream).write_all(&fragments).is_ok() {
            count += 1;
        }
        count
    });
    for value in 1..=50 {
        assert_eq!(arm.write_and_read((SPEED, &[value]), (SPEED, 1)), [value]);
    }
    let count = flooding.join().expect("the flood has ended");
    assert!(count < 20_000, "the server ended the connection");
}

/// The server ends a connection after 32 KiB without a whole message. It reads each connection at 46 080 bytes/s at most, four
/// times the rate of the arm's line, so 32 KiB take 711 ms. A connection may be 20 ms ahead at its beginning.
#[test]
fn fragments_without_end_do_not_begin_again_at_once() {
    let served = Served::start(1, &[]);
    let start = Instant::now();
    for _ in 0..3 {
        let mut flood = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
        flood.send_bytes(&web_frame(0x01, b"{"));
        let fragments = web_frame(0x00, b"").repeat(1_000);
        while flood.stream().write_all(&fragments).is_ok() {}
    }
    assert!(start.elapsed() >= Duration::from_millis(3 * 690), "{:?}", start.elapsed());
}

#[test]
fn what_was_sent_to_an_unplugged_arm_never_moves_it() {
    let mut served = Served::start(1, &[]);
    let mut arm = served.open("a");
    served.simulator.kill();
    let mut streams = [served.connect(), served.connect()];
    for stream in &mut streams {
        stream.set_write_timeout(Some(Duration::from_secs(5))).expect("a timeout");
        for turn in 0..3_000_u32 {
            let value = u8::try_from(turn % 100).expect("small") + 40;
            if stream.write_all(&write_request(TARGET_POSITION, &[value])).is_err() {
                break;
            }
        }
    }
    let [closed, _open] = streams;
    drop(closed);
    served.simulator = simulator(served.folder.path());
    served.wait_for_arm(&mut arm);
    assert_eq!(target(&mut arm), 90);
    check_rests(&mut arm, "plugged in again");
    assert_eq!(target(&mut arm), 90);
}

/// HTTP requests with a frame as the body, such as the simple POST that any local page may send.
#[test]
fn a_web_page_does_not_reach_the_arm_through_a_port_for_frames() {
    let served = Served::start(1, &[]);
    let mut arm = served.open("a");
    let frame = write_request(TARGET_POSITION, &[10]);
    for method in ["POST / HTTP/1.1", "GET / HTTP/1.1", "OPTIONS * HTTP/1.1", "\r\nPOST / HTTP/1.1", "x"] {
        let mut stream = served.connect();
        let head = format!("{method}\r\nHost: 127.0.0.1\r\nOrigin: null\r\n\r\n");
        let _ = stream.write_all(&[head.as_bytes(), &frame].concat());
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert!(answer.is_empty(), "{method}");
    }
    assert_eq!(target(&mut arm), 90);
}

#[test]
fn the_last_write_before_a_close_is_carried_out() {
    let served = Served::start(1, &[]);
    let socket = served.local_socket();
    let mut watcher = served.connect();
    for turn in 0..8_u8 {
        let value = 60 + turn;
        let frames: Vec<u8> = (value - 3..=value).flat_map(|value| write_request(SPEED, &[value])).collect();
        match turn % 4 {
            0 => served.open("a").send(&frames),
            1 => served.connect().write_all(&frames).expect("the server takes bytes"),
            2 => UnixStream::connect(&socket).expect("a connection").write_all(&frames).expect("taken"),
            _ => {
                let mut web = WebClient::connect(&served, &[]).expect("accepted");
                let message = format!(r#"{{"cmd":"write","id":{SPEED},"num":1,"value":[{value}]}}"#);
                (0..4).for_each(|_| web.send(&message));
            }
        }
        let mut read = || {
            watcher.write_all(&read_request(SPEED, 1)).expect("taken");
            let mut received = [0; 8];
            watcher.read_exact(&mut received).expect("a reply");
            received[5]
        };
        let mut last = 0;
        for _ in 0..20 {
            last = read();
            if last == value {
                break;
            }
            thread::sleep(Duration::from_millis(50));
        }
        assert_eq!(last, value, "turn {turn}");
    }
}

/// The other program goes on streaming, and the arm does not follow it.
#[test]
fn a_stop_ends_what_another_program_streams() {
    let served = Served::start(2, &[]);
    for port in ["./b", "./arm"] {
        let streaming = &AtomicBool::new(true);
        thread::scope(|scope| {
            let mut streamer = served.connect();
            // Slow, so that the arm does not reach the target before the stop.
            streamer.write_all(&write_request(SPEED, &[5])).expect("the server takes bytes");
            scope.spawn(move || {
                while streaming.load(Ordering::SeqCst) {
                    let sent = streamer.write_all(&write_request(TARGET_POSITION, &[150]));
                    sent.expect("the server takes bytes");
                    thread::sleep(Duration::from_millis(20));
                }
            });
            thread::sleep(Duration::from_millis(400));
            let stopped = run(&served, port, &["stop"]);
            let mut arm = served.open("a");
            let (target, driven_by) = (target(&mut arm), arm.register(DRIVEN_BY));
            let moved = (0..10).any(|_| {
                thread::sleep(Duration::from_millis(50));
                arm.register(TARGET_POSITION) != target
            });
            streaming.store(false, Ordering::SeqCst);
            assert!(stopped.status.success(), "{port}: {stopped:?}");
            assert!(!moved && target != 150, "{port}: the target is {target}");
            assert_eq!(driven_by, 0, "nobody drives");
        });
        let mut arm = served.open("a");
        arm.write(SPEED, &[100]);
        arm.write(TARGET_POSITION, &[90]);
        thread::sleep(Duration::from_millis(1_500));
    }
}

#[test]
fn stop_all_finds_the_server() {
    let served = Served::start(1, &[]);
    let mut command = tool();
    command.current_dir(served.folder.path()).env("XDG_RUNTIME_DIR", served.folder.path());
    let stopped = command.args(["stop", "--all"]).output().expect("the tool runs");
    let text = String::from_utf8_lossy(&stopped.stdout).into_owned();
    assert!(stopped.status.success() && text.contains("unix:") && text.contains("  90 90 6"), "{stopped:?}");
}

#[test]
fn commands_without_a_port_find_the_server() {
    let served = Served::start(1, &[]);
    for arguments in [&["pose", "100", "90", "65", "90", "90", "90", "80", "--wait"][..], &["stop"]] {
        let mut command = tool();
        command.current_dir(served.folder.path()).env("XDG_RUNTIME_DIR", served.folder.path());
        let done = command.env_remove("SEVENBOT_PORT").args(arguments).output().expect("the tool runs");
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.success() && said.contains("using unix:"), "{arguments:?}: {done:?}");
    }
    let target = target(&mut served.open("a"));
    assert!(target.abs_diff(100) <= 1, "{target}");
}

#[test]
fn silent_connections_keep_nobody_out_who_knows_the_token() {
    let served = Served::start(1, &["--token", "correct-horse"]);
    let silent: Vec<TcpStream> = (0..100).map(|_| served.connect()).collect();
    let request = [b"correct-horse\n".as_slice(), &read_request(DEVICE_CODE, 1)].concat();
    for _ in 0..5 {
        exchange(&mut served.connect(), &request, &reply(DEVICE_CODE, &[7]));
    }
    drop(silent);
}

/// Six wrong tokens: the waits between them are 100, 200, 400, 800 and 1600 ms.
#[test]
fn each_wrong_token_makes_the_next_one_wait_longer() {
    let served = Served::start(1, &["--token", "correct-horse"]);
    let start = Instant::now();
    for _ in 0..6 {
        let mut stream = served.connect();
        stream.write_all(b"battery-staple\n").expect("bytes");
        let _ = stream.read(&mut [0]);
    }
    assert!(start.elapsed() >= Duration::from_millis(3_100), "{:?}", start.elapsed());
}

/// Five wrong tokens: the server checks the next token from this address after 1.6 s.
fn guess_tokens(served: &Served) {
    for _ in 0..5 {
        let mut stream = served.connect();
        stream.write_all(b"battery-staple\n").expect("bytes");
        let _ = stream.read(&mut [0]);
    }
}

#[test]
fn a_target_that_waited_for_the_check_of_its_token_is_not_carried_out() {
    let served = Served::start(1, &["--token", "correct-horse"]);
    let mut arm = served.open("a");
    guess_tokens(&served);
    let mut stream = served.connect();
    let read = read_request(DEVICE_CODE, 1);
    let sent = [b"correct-horse\n".as_slice(), &write_request(TARGET_POSITION, &[10]), &read].concat();
    stream.write_all(&sent).expect("bytes");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
    stream.read_exact(&mut [0; 7]).expect("the reply to the read behind the target");
    assert_eq!(target(&mut arm), 90);
    // The program is connected, and what it sends now is carried out.
    system_tests::wait::wait_until("a new target is carried out", || {
        stream.write_all(&write_request(TARGET_POSITION, &[100])).expect("bytes");
        target(&mut arm) == 100
    });
}

#[test]
fn a_command_that_waited_for_the_check_of_its_token_is_not_carried_out() {
    let served = Served::start(1, &["--token", "correct-horse"]);
    let mut arm = served.open("a");
    guess_tokens(&served);
    let mut stream = served.connect_web();
    let command = |degrees| format!(r#"{{"cmd":"angle","id":0,"angle":{degrees}}}"#);
    let text = |text: &str| web_frame(0x81, text.as_bytes());
    let read = text(r#"{"cmd":"read","id":0,"num":1}"#);
    let handshake = web_handshake("correct-horse");
    stream.write_all(&[handshake.as_bytes(), &text(&command(10)), &read].concat()).expect("bytes");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
    // The answer to the read behind the command.
    read_until(&mut stream, b"}");
    assert_eq!(target(&mut arm), 90);
    system_tests::wait::wait_until("a new command is carried out", || {
        stream.write_all(&text(&command(100))).expect("bytes");
        target(&mut arm) == 100
    });
}

#[test]
fn the_local_socket_is_for_this_user_and_needs_no_token() {
    let served = Served::start(1, &["--token", "correct-horse", "--name", "lab-3"]);
    let socket = served.local_socket();
    let mode = std::fs::metadata(&socket).expect("a socket").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    for port in [format!("unix:{}", socket.display()), "sevenbot://lab-3".to_owned()] {
        let read = run(&served, &port, &["get", "device-code"]);
        assert!(read.status.success(), "{port}: {read:?}");
    }
    let address = served.connect().peer_addr().expect("an address");
    let mut command = tool();
    command.env("SEVENBOT_TOKEN", "correct-horse").args(["--port", &format!("tcp://{address}"), "info"]);
    assert!(command.status().expect("the tool runs").success());
    let listed = run(&served, "./a", &["ports"]);
    let text = String::from_utf8_lossy(&listed.stdout).into_owned();
    assert!(text.contains("sevenbot://lab-3") && text.contains("7Bot V2"), "{text}");
}

#[test]
fn a_token_may_be_in_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("token");
    std::fs::write(&path, "correct-horse\n").expect("a file");
    let served = Served::start(0, &["--token-file", path.to_str().expect("text")]);
    let request = [b"correct-horse\n".as_slice(), &read_request(DEVICE_CODE, 1)].concat();
    system_tests::wait::wait_until("the arm answers", || {
        let mut stream = served.connect();
        stream.set_read_timeout(Some(Duration::from_millis(500))).expect("a timeout");
        stream.write_all(&request).is_ok() && stream.read(&mut [0]).is_ok_and(|count| count == 1)
    });
}

#[test]
fn with_one_driver_others_are_told_that_they_only_watch() {
    let served = Served::start(2, &["--one-driver"]);
    let (mut first, mut second) = (served.open("a"), served.open("b"));
    first.write(TARGET_POSITION, &[100]);
    assert_eq!(target(&mut first), 100);
    second.write(TARGET_POSITION, &[110]);
    assert_eq!((second.register(STATE), second.register(DRIVEN_BY)), (4, 2));
    assert_eq!(target(&mut second), 100);
    assert_eq!(second.read(PRESENT_POSITION, 7).len(), 7, "it reads");
}

#[test]
fn a_command_that_the_server_does_not_pass_on_tells_why() {
    let cases =
        [("--read-only", false, "started with --read-only"), ("--one-driver", true, "another one does now")];
    for (option, has_driver, why) in cases {
        let served = Served::start(2, &[option]);
        let mut driver = served.open("a");
        let (stop, stopped) = channel::<()>();
        driver.write(TARGET_POSITION, &[100]);
        assert_eq!(target(&mut driver) == 100, has_driver);
        let driving = thread::spawn(move || {
            while stopped.recv_timeout(Duration::from_millis(100)) == Err(RecvTimeoutError::Timeout) {
                driver.write(TARGET_POSITION, &[100]);
            }
        });
        let done = run(&served, "./b", &["set", "target-position.1", "120"]);
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(!done.status.success() && said.contains(why), "{option}: {done:?}");
        drop(stop);
        driving.join().expect("it drives");
    }
}

/// The age of a target includes the time for which it waited for a suspended server. A target that is too old is dropped.
#[test]
fn what_was_sent_to_a_suspended_server_moves_nothing() {
    let served = Served::start(1, &[]);
    let mut arm = served.open("a");
    let mut streams = [served.connect(), served.connect()];
    let mut local = UnixStream::connect(served.local_socket()).expect("a connection");
    let mut web = WebClient::connect(&served, &[]).expect("accepted");
    // The server has to see that nothing waits in any connection.
    thread::sleep(Duration::from_millis(500));
    process::send_signal(&served.server, Signal::STOP);
    arm.write(TARGET_POSITION, &[120]);
    for stream in &mut streams {
        stream.write_all(&write_request(TARGET_POSITION, &[130])).expect("taken");
    }
    local.write_all(&write_request(TARGET_POSITION, &[140])).expect("taken");
    web.send(r#"{"cmd":"angle","id":0,"angle":150}"#);
    thread::sleep(Duration::from_millis(800));
    process::send_signal(&served.server, Signal::CONT);
    check_rests(&mut arm, "suspended");
    assert_eq!(target(&mut arm), 90);
    streams[0].write_all(&write_request(TARGET_POSITION, &[100])).expect("taken");
    system_tests::wait::wait_until("the server goes on", || target(&mut arm) == 100);
}
