//! `sevenbot serve`: one simulated arm, many programs at once.

use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use system_tests::frames::{reply, with_checksum};
use system_tests::process::{RunningProgram, Signal, send_signal, wait_for_exit};
use system_tests::programs::tool;
use system_tests::registers::{CHIP_ID, DEVICE_CODE, FEEDBACK_FREQUENCY, PRESENT_POSITION, SPEED};
use system_tests::relay::Passing;
use system_tests::wait::{TIMEOUT, wait_until};
use system_tests::{read_request, write_request};

use super::served::{Served, exchange, names, simulator};

/// First of four registers: set-point period (two bytes), time and action of the watchdog.
const SET_POINT_PERIOD: u8 = 184;

#[test]
fn programs_on_terminals_and_tcp_get_their_own_replies() {
    let served = Served::start(3, &[]);
    thread::scope(|scope| {
        for (name, own) in names(3).zip(SPEED..) {
            let mut arm = served.open(&name);
            scope.spawn(move || {
                (1..=100)
                    .for_each(|value| assert_eq!(arm.write_and_read((own, &[value]), (own, 1)), [value]));
            });
        }
        for own in SPEED + 3..SPEED + 7 {
            let mut stream = served.connect();
            scope.spawn(move || {
                for value in 1..=100 {
                    let request = [write_request(own, &[value]), read_request(own, 1)].concat();
                    exchange(&mut stream, &request, &reply(own, &[value]));
                }
            });
        }
    });
}

#[test]
fn each_program_has_its_own_reports_and_the_next_one_on_its_terminal_has_none() {
    let served = Served::start(2, &[]);
    let (mut with, mut without) = (served.open("a"), served.open("b"));
    with.write(FEEDBACK_FREQUENCY, &[50]);
    for _ in 0..50 {
        let report = with.reply();
        assert_eq!((report.address, report.values.len()), (PRESENT_POSITION, 7));
    }
    assert_eq!(without.register(FEEDBACK_FREQUENCY), 0);
    without.expect_nothing_more();
    assert_eq!(with.register(FEEDBACK_FREQUENCY), 50);
    drop(with);
    let mut next = served.open("a");
    next.drain();
    assert_eq!(next.register(FEEDBACK_FREQUENCY), 0);
    thread::sleep(Duration::from_millis(200));
    next.expect_nothing_more();
}

/// M4: the two golden frames of map 2.1 ask for 30 angle reports and 5 load reports per second.
#[test]
fn programs_of_both_maps_have_their_own_reports() {
    let served = Served::start(2, &[]);
    let (mut old, mut new) = (served.open("a"), served.open("b"));
    old.write(FEEDBACK_FREQUENCY, &[50]);
    new.send(b"\xAA\x77\x04\x52\x01\x1E\xCD\x63");
    new.send(b"\xAA\x77\x04\x5A\x01\x05\x0C\xAA");
    let mut next = || new.frame_within(Duration::from_secs(5)).expect("a report");
    let reports: Vec<_> = (0..35).map(|_| next()[2..5].to_vec()).collect();
    let loads = reports.iter().filter(|start| **start == [5, 91, 7]).count();
    assert!((4..=6).contains(&loads), "{reports:?}");
    assert!(reports.iter().all(|start| [[5, 83, 7], [5, 91, 7]].contains(&[start[0], start[1], start[2]])));
    assert!((0..50).all(|_| old.reply().address == PRESENT_POSITION));
    new.write(FEEDBACK_FREQUENCY, &[0]);
    new.drain();
    assert_eq!((new.register(82), new.register(90)), (0, 0), "stopped by a write of map 2.2");
    assert_eq!(old.reply().address, PRESENT_POSITION, "its reports go on");
    old.send(&with_checksum(&[0xAA, 0x77, 4, 0, 0]));
    old.drain();
    assert_eq!(old.register(FEEDBACK_FREQUENCY), 0, "stopped by a write of map 2.1");
}

/// A pseudo-terminal does not show which program sent a byte, and the server notices a close with a delay.
#[test]
fn the_next_program_on_a_terminal_does_not_wait_for_what_the_one_before_asked() {
    let asked = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&asked);
    let watch = move |passing: Passing<'_>| {
        if matches!(passing, Passing::Request([_, _, 3, 0, 255, ..])) {
            counter.fetch_add(1, Ordering::SeqCst);
        }
    };
    let served = Served::start_watched(1, &[], Box::new(watch));
    let mut gone = served.open("a");
    gone.send(&read_request(0, 255).repeat(200));
    (0..3).for_each(|_| drop(gone.reply()));
    drop(gone);
    let mut next = served.open("a");
    next.drain();
    assert_eq!(next.read(CHIP_ID, 6).len(), 6);
    // The server sends some reads before it notices the close, and more of them on a busy machine.
    let asked = asked.load(Ordering::SeqCst);
    assert!(asked < 100, "{asked} of 200 long reads of the program that is gone");
}

/// The first program sends more than the server reads at once, so its bytes wait in the kernel after it has closed the
/// terminal. The server can assign these bytes to the first program only while the terminal is closed. A busy machine may not
/// run the server in that time, so the test has several tries.
#[test]
fn the_next_program_on_a_terminal_gets_no_reply_that_waited_in_the_kernel() {
    let served = Served::start(1, &[]);
    let is_next_alone = |_| {
        let mut gone = served.open("a");
        gone.send(&[read_request(0, 255).repeat(1_000), write_request(FEEDBACK_FREQUENCY, &[50])].concat());
        drop(gone);
        thread::sleep(Duration::from_millis(500));
        let path = served.folder.path().join("a");
        let next = serialport::new(path.to_str().expect("text"), 115_200).timeout(TIMEOUT).open();
        let mut next = next.expect("a port");
        let request = [read_request(CHIP_ID, 6), read_request(FEEDBACK_FREQUENCY, 1)].concat();
        next.write_all(&request).expect("the server takes bytes");
        let mut received = [0; 13 + 8];
        next.read_exact(&mut received).expect("replies");
        received.starts_with(&[0xAA, 0x77, 3, CHIP_ID, 6])
            && received.ends_with(&reply(FEEDBACK_FREQUENCY, &[0]))
    };
    assert!((0..5).any(is_next_alone));
}

#[test]
fn an_arm_that_was_unplugged_is_found_again() {
    let mut served = Served::start(1, &[]);
    let mut arm = served.open("a");
    let mut stream = served.connect();
    arm.write(SPEED, &[7]);
    assert_eq!(arm.register(SPEED), 7);
    served.simulator.kill();
    arm.send(&read_request(SPEED, 1));
    assert_eq!(arm.reply_within(Duration::from_millis(1_000)), None, "silence, as on a cable");
    served.simulator = simulator(served.folder.path());
    served.wait_for_arm(&mut arm);
    assert_eq!(arm.register(SPEED), 60, "another arm");
    exchange(&mut stream, &read_request(DEVICE_CODE, 1), &reply(DEVICE_CODE, &[7]));
}

#[test]
fn bad_clients_disturb_no_other() {
    let served = Served::start(1, &[]);
    let mut arm = served.open("a");
    let mut half = served.connect();
    half.write_all(&write_request(SPEED, &[1, 2, 3])[..6]).expect("half a frame");
    let mut deaf = served.connect();
    deaf.write_all(&write_request(FEEDBACK_FREQUENCY, &[50])).expect("a request");
    deaf.set_nonblocking(true).expect("a mode");
    let flood = served.connect();
    let ended = flood.try_clone().expect("a second handle");
    let flooding =
        thread::spawn(move || while (&flood).write_all(&write_request(SPEED + 1, &[9])).is_ok() {});
    let request = read_request(PRESENT_POSITION, 7).repeat(100);
    let mut slowest = Duration::ZERO;
    for _ in 0..200 {
        while deaf.write(&request).is_ok_and(|count| count > 0) {}
        let start = Instant::now();
        assert_eq!(arm.read(CHIP_ID, 6).len(), 6);
        slowest = slowest.max(start.elapsed());
    }
    ended.shutdown(std::net::Shutdown::Both).expect("the flood ends");
    flooding.join().expect("the flood has ended");
    println!("slowest reply: {slowest:?}");
    assert!(slowest < Duration::from_secs(2), "{slowest:?}");
    assert_eq!(arm.register(SPEED), 60, "half a frame writes nothing");
}

#[test]
fn a_token_keeps_others_out() {
    let served = Served::start(1, &["--token", "correct-horse"]);
    for wrong in ["battery-staple\n", "correct-hors\n", "\n"] {
        let mut stream = served.connect();
        stream.write_all(&[wrong.as_bytes(), &read_request(DEVICE_CODE, 1)].concat()).expect("bytes");
        let end = stream.read(&mut [0; 16]);
        assert!(matches!(&end, Ok(0)) || end.as_ref().is_err_and(|e| e.kind() == ErrorKind::ConnectionReset));
    }
    let request = [b"correct-horse\r\n".as_slice(), &read_request(DEVICE_CODE, 1)].concat();
    exchange(&mut served.connect(), &request, &reply(DEVICE_CODE, &[7]));
}

#[test]
fn with_read_only_programs_look_and_move_nothing() {
    let served = Served::start(1, &["--read-only"]);
    let mut arm = served.open("a");
    assert_eq!(arm.write_and_read((SPEED, &[7]), (SPEED, 1)), [60]);
}

#[test]
fn a_stream_that_another_program_stops_says_so_and_leaves_no_period() {
    let served = Served::start(2, &[]);
    let program = |name: &str, command: &str| {
        let mut tool = tool();
        tool.arg("--port").arg(served.folder.path().join(name)).arg(command);
        tool
    };
    let mut streams = program("a", "stream");
    streams.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut stream = RunningProgram::spawn(&mut streams);
    let lines = "0,90,90,65,90,90,90,80\n20,150,90,65,90,90,90,80\n";
    // The pipe stays open until the arm is stopped.
    stream.stdin.as_mut().expect("a pipe").write_all(lines.as_bytes()).expect("the tool reads");
    let mut arm = served.open("b");
    wait_until("joint 1 moves", || arm.register(PRESENT_POSITION) > 92);
    drop(arm);
    let stopped = program("b", "stop").output().expect("the tool runs");
    assert!(stopped.status.success(), "{}", all_of(&stopped));
    let ended = stream.output();
    let said = all_of(&ended);
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("another program stopped the arm"), "{said}");
    assert_eq!(served.open("b").read(SET_POINT_PERIOD, 4), [0; 4]);
}

#[test]
fn the_program_itself_works_through_the_server_and_ctrl_c_removes_the_links() {
    let mut served = Served::start(2, &[]);
    let path = served.folder.path().join("b");
    let output = tool().arg("--port").arg(&path).args(["info", "--json"]).output().expect("the tool runs");
    assert!(output.status.success(), "{output:?}");
    send_signal(&served.server, Signal::INT);
    assert!(wait_for_exit(&mut served.server).success());
    assert!(!path.exists() && !path.is_symlink());
}

#[test]
fn a_second_server_leaves_the_link_and_the_arm_to_the_first() {
    let served = Served::start(1, &[]);
    let (link, other) = (served.folder.path().join("a"), served.folder.path().join("other"));
    let target = std::fs::read_link(&link).expect("a link");
    let serve = |arm: &Path, link: &Path| {
        let mut tool = tool();
        tool.arg("--port").arg(arm).args(["serve", "--pty"]).arg(link);
        let output = tool.output().expect("the tool runs");
        (output.status.code(), all_of(&output))
    };
    let (status, said) = serve(Path::new("./none"), &link);
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("leads to /dev/pts/") && !said.contains("ready"), "{said}");
    let (status, said) = serve(&served.folder.path().join("arm"), &other);
    assert_eq!(status, Some(3), "{said}");
    assert!(said.contains("another program has this port open") && said.contains("sevenbot serve"), "{said}");
    assert!(!said.contains("ready") && !other.is_symlink(), "{said}");
    assert_eq!(std::fs::read_link(&link).expect("a link"), target);
    assert_eq!(served.open("a").register(DEVICE_CODE), 7);
}

fn all_of(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat()
}

#[test]
fn what_cannot_be_served_is_an_error_that_says_what_to_do() {
    let served = Served::start(1, &[]);
    let taken = served.ports[1].to_str().expect("text").rsplit(':').next().expect("a port").to_owned();
    let cases: [(&[&str], &str); 5] = [
        (&["--name", "with a space"], "letters, digits and hyphens"),
        (&["--tcp", &taken], "another program listens there"),
        (&["--tcp", "0", "--listen", "0.0.0.0"], "--token"),
        (&["--tcp", "0", "--listen", "0.0.0.0", "--token", "correct-horse"], "unencrypted"),
        (&["--pty", "/nowhere/a"], "/nowhere/a"),
    ];
    for (arguments, expected) in cases {
        let output =
            tool().args(["--port", "./none", "serve"]).args(arguments).output().expect("the tool runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(expected), "{arguments:?}: {said}");
    }
}
