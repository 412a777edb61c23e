//! The maker's WebSocket of `sevenbot serve`.

use system_tests::frames::with_checksum;
use system_tests::registers::{
    DEVICE_CODE, EEPROM_LOCK, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED, TARGET_POSITION,
};
use system_tests::wait::wait_until;

use super::served::{LOCAL_PAGE, Served, WebClient};

#[test]
fn the_next_message_to_a_program_is_the_answer_to_its_read() {
    let served = Served::start(1, &[]);
    let mut client = WebClient::connect(&served, &[]).expect("accepted");
    for value in 1..=50 {
        client.send(&format!(r#"{{"cmd":"speed","speed":{value}}}"#));
        client.send(r#"{"cmd":"ping"}"#);
        client.send("no JSON");
        assert_eq!(client.read(SPEED, 7), [value; 7]);
    }
}

#[test]
fn a_page_gets_every_answer_in_order() {
    let served = Served::start(1, &[]);
    let mut page = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    let requests = [
        r#"{"cmd":"ping"}"#,
        r#"{"cmd":"angles","angles":[90,90,65,90,90,90,70.6]}"#,
        r#"{"cmd":"read","id":46,"num":7}"#,
        r#"{"cmd":"jump"}"#,
        r#"{"cmd":"write","id":32,"num":2,"value":[7,8]}"#,
        r#"{"cmd":"read","id":32,"num":2}"#,
        "{",
    ];
    requests.iter().for_each(|request| page.send(request));
    let mut next = || page.receive().expect("an answer");
    assert_eq!(next()["status"], "pong");
    assert_eq!(next()["message"], "Angles set");
    assert_eq!(next()["data"].to_string(), "[90,90,65,90,90,90,71]");
    assert_eq!(next()["message"], "Unknown command");
    assert_eq!(next()["status"], "ok");
    assert_eq!(next()["data"].to_string(), "[7,8]");
    assert_eq!(next()["message"], "Invalid JSON format");
}

/// M5: the maker's two forms of offsets. Function 06 would refuse some of their bytes, or take them for other offsets.
#[test]
fn a_write_has_the_forms_of_the_makers_map() {
    let served = Served::start(1, &[]);
    let mut client = WebClient::connect(&served, &[]).expect("accepted");
    client.send(r#"{"cmd":"write","id":28,"num":1,"value":[0]}"#);
    for offsets in ["[1,-2,0,1,-1,0,16]", "[129,126,128,129,127,128,144]"] {
        client.send(r#"{"cmd":"write","id":13,"num":7,"value":[0,0,0,0,0,0,0]}"#);
        assert_eq!(client.read(OFFSET, 7), [128; 7]);
        client.send(&format!(r#"{{"cmd":"write","id":13,"num":7,"value":{offsets}}}"#));
        assert_eq!(client.read(OFFSET, 7), [129, 126, 128, 129, 127, 128, 144], "{offsets}");
    }
}

/// M5 and M6: each program reads offsets in the form of its own last write, and before its first write in the form that
/// register 20 selects.
#[test]
fn programs_of_both_maps_read_the_same_offsets_in_their_own_forms() {
    let served = Served::start(2, &[]);
    let (signed, biased) = ([0x82, 3], [126, 131]);
    let (mut old, mut idle) = (served.open("a"), served.open("b"));
    let (mut web, mut idle_web) = (connect(&served), connect(&served));
    old.write(EEPROM_LOCK, &[0]);
    assert_eq!(old.write_and_read((OFFSET, &signed), (OFFSET, 2)), signed);
    for _ in 0..10 {
        web.send(r#"{"cmd":"write","id":32,"num":1,"value":[60]}"#);
        assert_eq!(web.read(OFFSET, 2), biased);
        assert_eq!(old.read(OFFSET, 2), signed);
        assert_eq!((idle.read(OFFSET, 2), idle_web.read(OFFSET, 2)), (signed.to_vec(), signed.to_vec()));
        old.write(SPEED, &[60]);
        assert_eq!((old.read(OFFSET, 2), web.read(OFFSET, 2)), (signed.to_vec(), biased.to_vec()));
    }
    web.send(r#"{"cmd":"write","id":20,"num":1,"value":[1]}"#);
    assert_eq!(web.read(OFFSET, 2), biased);
    assert_eq!((idle.read(OFFSET, 2), idle_web.read(OFFSET, 2)), (biased.to_vec(), biased.to_vec()));
    assert_eq!(connect(&served).read(OFFSET, 2), biased, "a new program");
    assert_eq!(old.read(OFFSET, 2), signed);
    // A program can write back the bytes that it read.
    let read = old.read(OFFSET, 7);
    assert_eq!(old.write_and_read((OFFSET, &read), (OFFSET, 2)), signed);
    idle.send(&with_checksum(&[0xAA, 0x77, 4, 0, 0]));
    assert_eq!((idle.read(OFFSET, 2), web.read(OFFSET, 2)), (biased.to_vec(), biased.to_vec()));
}

fn connect(served: &Served) -> WebClient {
    WebClient::connect(served, &[]).expect("accepted")
}

/// The expected angles were computed with the maker's own code, in double precision.
#[test]
fn a_page_moves_to_positions_and_learns_which_are_out_of_reach() {
    let served = Served::start(1, &[]);
    let mut page = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    let solved = [
        (r#""IK5","pos":[100,200,150]"#, vec![63, 90, 85]),
        (r#""IK6","pos":[-50.4,184.6,50],"vec56":[0,0,-0.01]"#, vec![105, 88, 110, 90, 135]),
        (r#""IK7","pos":[0,250,100],"vec56":[0,0,-1],"vec67":[-1,1,0]"#, vec![90, 74, 92, 90, 153, 45]),
    ];
    for (command, angles) in solved {
        page.send(&format!(r#"{{"cmd":{command}}}"#));
        assert_eq!(page.receive().expect("an answer")["message"], "IK calculation completed", "{command}");
        assert_eq!(page.read(TARGET_POSITION, 7)[..angles.len()], angles, "{command}");
    }
    let before = page.read(TARGET_POSITION, 7);
    for (command, message) in [
        (r#""IK5","pos":[400,0,100]"#, "IK calculation failed"),
        (r#""IK6","pos":[500,185,50],"vec56":[0,0,-1]"#, "IK calculation failed"),
        (r#""IK6","pos":[0,250,100],"vec56":[0,0,0]"#, "IK calculation failed"),
        (r#""IK7","pos":[0,250,-100000],"vec56":[0,0,-1],"vec67":[0,1,0]"#, "IK calculation failed"),
        (r#""IK6","pos":[0,250,100]"#, "Missing vec56 parameter"),
    ] {
        page.send(&format!(r#"{{"cmd":{command}}}"#));
        let answer = page.receive().expect("an answer");
        assert_eq!((&answer["status"], &answer["message"]), (&"error".into(), &message.into()), "{command}");
    }
    assert_eq!(page.read(TARGET_POSITION, 7), before);
    let mut program = WebClient::connect(&served, &[]).expect("accepted");
    program.send(r#"{"cmd":"IK5","pos":[-120,180,60]}"#);
    assert_eq!(
        program.read(TARGET_POSITION, 3),
        [124, 73, 112],
        "the next message is the answer to the read"
    );
}

/// As with the maker's server, a position within reach engages the servos. A position out of reach does not change the motor
/// state.
#[test]
fn a_position_within_reach_switches_to_the_servo_state() {
    let served = Served::start(1, &[]);
    let mut page = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    for (state, command, after) in [
        (0, r#"{"cmd":"IK5","pos":[100,200,150]}"#, 1),
        (2, r#"{"cmd":"IK6","pos":[0,250,100],"vec56":[0,0,-1]}"#, 1),
        (0, r#"{"cmd":"IK5","pos":[400,0,100]}"#, 0),
        (2, r#"{"cmd":"IK6","pos":[0,250,100],"vec56":[0,0,0]}"#, 2),
        (0, r#"{"cmd":"angles","angles":[90,90,65,90,90,90,80]}"#, 0),
    ] {
        page.send(&format!(r#"{{"cmd":"status","status":{state}}}"#));
        page.send(command);
        (0..2).for_each(|_| drop(page.receive().expect("an answer")));
        assert_eq!(page.read(MOTOR_STATE, 1), [after], "{command}");
    }
    page.send(r#"{"cmd":"IK5","pos":[100,200,150]}"#);
    assert_eq!(page.receive().expect("an answer")["message"], "IK calculation completed");
    assert_eq!(page.read(TARGET_POSITION, 3), [63, 90, 85], "the targets stay");
}

#[test]
fn stop_holds_every_joint() {
    let served = Served::start(1, &[]);
    let mut page = WebClient::connect(&served, &[LOCAL_PAGE]).expect("accepted");
    page.send(r#"{"cmd":"speed","speed":5}"#);
    page.send(r#"{"cmd":"angle","id":0,"angle":170}"#);
    (0..2).for_each(|_| assert_eq!(page.receive().expect("an answer")["status"], "ok"));
    wait_until("the joint is on its way", || page.read(PRESENT_POSITION, 1)[0] > 95);
    page.send(r#"{"cmd":"stop"}"#);
    assert_eq!(page.receive().expect("an answer")["message"], "Stopped");
    let target = page.read(TARGET_POSITION, 1)[0];
    assert!((95..160).contains(&target), "{target}");
}

#[test]
fn pages_of_other_sites_and_other_names_are_refused() {
    let served = Served::start(1, &[]);
    for (headers, status) in [
        ([("origin", "https://evil.example")], 403),
        ([("origin", "null")], 403),
        ([("host", "evil.example")], 403),
    ] {
        assert_eq!(WebClient::connect(&served, &headers).err(), Some(status), "{headers:?}");
    }
    let served = Served::start(1, &["--maker-pages", "--token", "correct-horse"]);
    let page = ("origin", "null");
    assert_eq!(WebClient::connect(&served, &[page]).err(), Some(401));
    let token = ("authorization", "Bearer correct-horse");
    assert!(WebClient::connect(&served, &[page, token]).is_ok());
}

#[test]
fn a_message_that_is_too_long_ends_its_own_connection_only() {
    let served = Served::start(1, &[]);
    let mut good = WebClient::connect(&served, &[]).expect("accepted");
    let mut bad = WebClient::connect(&served, &[]).expect("accepted");
    bad.send(&"x".repeat(2_049));
    assert_eq!(bad.receive(), None);
    assert_eq!(good.read(DEVICE_CODE, 1), [7]);
}
