//! Bad clients of the WebSocket of `sevenbot serve`: each harms only its own connection.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::thread;

use system_tests::frames::reply;
use system_tests::registers::{CHIP_ID, DEVICE_CODE, SPEED};
use system_tests::{ArmClient, read_request};

use super::served::{LOCAL_PAGE, Served, WebClient, exchange, web_frame};

const TEXT: u8 = 0x81;
const BINARY: u8 = 0x82;
const PING: u8 = 0x89;
/// The first fragment of a text, one between, and the last.
const FRAGMENTS: [u8; 3] = [0x01, 0x00, 0x80];

/// Good clients on a pseudo-terminal, over TCP and over the WebSocket.
struct Others {
    terminal: ArmClient,
    tcp: TcpStream,
    web: WebClient,
}

impl Others {
    fn connect(served: &Served) -> Self {
        let web = WebClient::connect(served, &[]).expect("accepted");
        Self { terminal: served.open("a"), tcp: served.connect(), web }
    }

    /// Checks that each client gets its replies.
    #[track_caller]
    fn check(&mut self) {
        for value in 1..=20 {
            assert_eq!(self.terminal.write_and_read((SPEED, &[value]), (SPEED, 1)), [value]);
            exchange(&mut self.tcp, &read_request(SPEED, 1), &reply(SPEED, &[value]));
            assert_eq!(self.web.read(DEVICE_CODE, 1), [7]);
        }
    }
}

#[test]
fn a_flood_of_messages_keeps_no_other_from_its_replies() {
    let served = Served::start(1, &[]);
    let mut others = Others::connect(&served);
    let floods: [(u8, &[u8]); 6] = [
        (BINARY, &[0x55; 1_000]),
        (PING, b"ping"),
        (TEXT, br#"{"cmd":"read","id":54,"num":7}"#),
        (TEXT, br#"{"cmd":"write","id":39,"num":1,"value":[5]}"#),
        (TEXT, br#"{"cmd":"IK5","pos":[400,0,100]}"#),
        (TEXT, b"{{{{"),
    ];
    for (kind, message) in floods {
        println!("flood of {}", String::from_utf8_lossy(&message[..message.len().min(30)]));
        let flood = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted").stream();
        let mut writer = flood.try_clone().expect("a second handle");
        let bytes = web_frame(kind, message).repeat(10);
        let flooding = thread::spawn(move || while writer.write_all(&bytes).is_ok() {});
        // Read the answers to the flood, so that the flood never waits for room.
        let mut reader = flood.try_clone().expect("a second handle");
        let reading =
            thread::spawn(move || while reader.read(&mut [0; 4_096]).is_ok_and(|count| count > 0) {});
        others.check();
        flood.shutdown(Shutdown::Both).expect("the flood ends");
        for thread in [flooding, reading] {
            thread.join().expect("its end");
        }
    }
}

#[test]
fn a_client_that_never_reads_blocks_only_itself_and_loses_no_answer() {
    let served = Served::start(1, &[]);
    let mut others = Others::connect(&served);
    let mut deaf = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    deaf.stream().set_nonblocking(true).expect("a mode");
    // The answer repeats the number with all its digits, so that the buffers are full soon.
    let request = web_frame(TEXT, br#"{"cmd":"angles","angles":[0,0,0,0,0,0,1e300]}"#);
    let (mut stream, mut bytes, mut blocked_turns) = (deaf.stream(), 0, 0);
    while blocked_turns < 5 {
        blocked_turns += 1;
        while let Ok(count) = stream.write(&request[bytes % request.len()..]) {
            (bytes, blocked_turns) = (bytes + count, 0);
        }
        assert_eq!(others.terminal.register(DEVICE_CODE), 7);
        assert_eq!(others.web.read(DEVICE_CODE, 1), [7]);
    }
    others.check();
    stream.set_nonblocking(false).expect("a mode");
    let whole = bytes / request.len();
    assert!(whole > 100, "{whole} requests");
    for number in 0..whole {
        let answer = deaf.receive().unwrap_or_else(|| panic!("no answer {number} of {whole}"));
        let message = answer["message"].as_str().unwrap_or_default();
        // A server that was late refuses commands behind 200 others.
        let is_refused = number >= 200 && message == "Too many commands wait";
        let is_answer = message.starts_with("angles[6] = 1000") || is_refused;
        assert!(is_answer, "{number} of {whole}: {answer}");
    }
}

#[test]
fn many_messages_at_once_are_all_answered_in_order() {
    let served = Served::start(1, &[]);
    let mut page = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    let commands = [r#"{"cmd":"ping"}"#, r#"{"cmd":"jump"}"#, r#"{"cmd":"time","time":101}"#];
    let messages = commands.map(|command| web_frame(TEXT, command.as_bytes())).concat();
    page.send_bytes(&messages.repeat(50));
    for number in 0..50 {
        let mut next = || page.receive().unwrap_or_else(|| panic!("no answer in turn {number}"));
        assert_eq!(next()["status"], "pong");
        assert_eq!(next()["message"], "Unknown command");
        assert_eq!(next()["message"], "Invalid time value (0-100, unit: 100ms)");
    }
}

#[test]
fn pieces_of_a_message_wait_for_the_rest() {
    let served = Served::start(1, &[]);
    let mut others = Others::connect(&served);
    let mut client = WebClient::connect(&served, &[]).expect("accepted");
    let [first, between, last] = FRAGMENTS;
    let whole = [
        web_frame(first, br#"{"cmd":"re"#),
        web_frame(PING, b"between the fragments"),
        web_frame(between, br#"ad","id":2,"#),
        web_frame(last, br#""num":6}"#),
    ]
    .concat();
    for piece in whole.chunks(7) {
        client.send_bytes(piece);
        others.check();
    }
    let mut answer = client.receive();
    if answer.is_none() {
        answer = client.receive(); // The first one was the answer to the ping.
    }
    let id = others.terminal.read(CHIP_ID, 6);
    assert_eq!(answer.expect("an answer")["data"], serde_json::json!(id));
    client.send_bytes(&web_frame(TEXT, br#"{"cmd":"write","id":32,"num":1,"value":[9]}"#)[..30]);
    others.check();
    drop(client);
    others.check();
}

#[test]
fn what_is_no_message_ends_its_own_connection_only() {
    let served = Served::start(1, &[]);
    let mut others = Others::connect(&served);
    let [first, between, last] = FRAGMENTS;
    let too_long = [first, between, last].map(|start| web_frame(start, &[b' '; 700])).concat();
    let bad = [
        too_long,
        web_frame(TEXT, &[0xFF, 0xFE]),
        web_frame(0x83, b"an unknown kind"),
        web_frame(last, b"the end of nothing"),
        vec![TEXT, 4, b'p', b'i', b'n', b'g'],
        [&[TEXT, 0x80 | 127], u64::MAX.to_be_bytes().as_slice(), &[0; 4]].concat(),
    ];
    for bytes in bad {
        let mut client = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
        client.send_bytes(&bytes);
        assert_eq!(client.receive(), None, "{bytes:02x?}");
        let end = client.stream().read(&mut [0]);
        let is_reset = end.as_ref().is_err_and(|error| error.kind() == ErrorKind::ConnectionReset);
        assert!(is_reset || matches!(end, Ok(0)), "{bytes:02x?}: {end:?}");
    }
    others.check();
}

#[test]
fn wrong_json_is_an_error_and_no_more() {
    let served = Served::start(1, &[]);
    let mut page = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    let deep = "[".repeat(2_000);
    for text in ["", "{", "null\n{", "{\"cmd\":\"ping\"", "\u{0}", deep.as_str()] {
        page.send(text);
        assert_eq!(page.receive().expect("an answer")["message"], "Invalid JSON format", "{text}");
    }
    page.send(r#"{"cmd":"ping"}"#);
    assert_eq!(page.receive().expect("an answer")["status"], "pong");
}

/// More connections than the server has places for, and no place is lost.
#[test]
fn refused_and_unfinished_handshakes_hold_no_place() {
    let served = Served::start(1, &[]);
    for _ in 0..40 {
        for header in [("origin", "https://evil.example"), ("host", "evil.example")] {
            assert_eq!(WebClient::connect(&served, &[header]).err(), Some(403));
        }
        let mut half = served.connect_web();
        half.write_all(b"GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgr").expect("half a request");
    }
    let mut noise = served.connect_web();
    noise.write_all(&[b'x'; 100]).expect("bytes");
    Others::connect(&served).check();
}
