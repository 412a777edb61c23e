//! `sevenbot class`: access and names, messages and stops for all, and the real arm for one pupil at a time.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};
use system_tests::registers::{MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION, SPEED, TARGET_POSITION};
use system_tests::wait::wait_for;
use system_tests::{read_request, write_request};
use tungstenite::{Message, WebSocket};

use super::class_tabs::{Class, Pupil, Tab};

/// Waits until the class on the teacher's screen meets a condition, and returns the class.
#[track_caller]
fn shown(teacher: &mut Tab, holds: impl Fn(&Value) -> bool) -> Value {
    teacher.hear_where("class", holds)
}

/// The tile of the pupil with this name; null if there is none.
fn tile<'a>(class: &'a Value, name: &str) -> &'a Value {
    let tiles = class["pupils"].as_array().expect("tiles");
    tiles.iter().find(|tile| tile["name"] == name).unwrap_or(&Value::Null)
}

fn give(teacher: &mut Tab, name: &str, seconds: u32) {
    let class =
        shown(teacher, |class| class["arm"]["answers"] == true && tile(class, name)["presence"] == "here");
    teacher.say(&json!({ "give": { "pupil": tile(&class, name)["pupil"], "seconds": seconds } }));
}

/// Waits until the class tells a pupil that the pupil has the arm, or (`is_yours` false) does not have it.
#[track_caller]
fn wait_for_arm(pupil: &mut Pupil, is_yours: bool) -> Value {
    pupil.tab.hear_where("ask", |ask| (ask["arm"]["is_yours"] == true) == is_yours)
}

/// The values of registers, over a session with the arm.
#[track_caller]
fn read(frames: &mut WebSocket<TcpStream>, address: u8, count: u8) -> Vec<u8> {
    let length = usize::from(count) + 7;
    wait_for("a reply", || {
        frames.send(Message::binary(read_request(address, count))).map_err(|error| error.to_string())?;
        let mut reply = Vec::new();
        while reply.len() < length {
            match frames.read().map_err(|error| error.to_string())? {
                Message::Binary(bytes) => reply.extend_from_slice(&bytes),
                other => return Err(format!("{other:?}")),
            }
        }
        Ok(reply[5..length - 2].to_vec())
    })
}

/// Sends joint 1 to an angle, and waits until it moves.
#[track_caller]
fn drive(frames: &mut WebSocket<TcpStream>, degrees: u8) {
    let frame = [write_request(SPEED, &[5]), write_request(TARGET_POSITION, &[degrees])].concat();
    frames.send(Message::binary(frame)).expect("the server takes frames");
    wait_for("joint 1 moves", || {
        let moving = read(frames, MOVING_JOINTS, 1);
        if moving == [1] { Ok(()) } else { Err(format!("{moving:?}")) }
    });
}

#[track_caller]
fn wait_until_at_rest(frames: &mut WebSocket<TcpStream>) {
    wait_for("the arm rests", || {
        let moving = read(frames, MOVING_JOINTS, 1);
        if moving == [0] { Ok(()) } else { Err(format!("{moving:?}")) }
    });
}

/// Checks that the session ends, and that the arm holds joint 1 away from this angle.
#[track_caller]
fn check_held(class: &Class, teacher: &mut Tab, frames: WebSocket<TcpStream>, degrees: u8) {
    let mut frames = frames;
    wait_for("the session ends", || match frames.read() {
        Err(_) => Ok(()),
        Ok(message) => Err(format!("{message:?}")),
    });
    shown(teacher, |class| class["arm"]["stop"] == "holds" && class["arm"]["holder"].is_null());
    let mut checker = class.join("checker");
    give(teacher, &checker.name, 60);
    wait_for_arm(&mut checker, true);
    let mut frames = class.frames(&checker.key).expect("accepted");
    wait_until_at_rest(&mut frames);
    let [target, position] = [TARGET_POSITION, PRESENT_POSITION].map(|row| read(&mut frames, row, 1)[0]);
    assert!(target.abs_diff(position) <= 2 && position.abs_diff(degrees) > 5, "{target} {position}");
    drop(checker);
    shown(teacher, |class| class["arm"]["holder"].is_null());
}

#[test]
fn the_pages_are_for_all_and_messages_for_those_who_know_the_code() {
    let class = Class::start(false, "robots7");
    let address = class.address.clone();
    let get = |path: &str| class.get(path, &address);
    assert!(get("/").contains("303 See Other") && get("/").contains("location: /?class"), "{}", get("/"));
    for path in ["/?class", "/teacher.html", "/teacher.js"] {
        let answer = get(path);
        assert!(answer.starts_with("HTTP/1.1 200 ") && answer.contains("default-src 'self'"), "{path}");
        assert!(!answer.contains(&class.secret) && !answer.contains("robots7"), "{path} has no secret");
    }
    assert!(class.get("/?class", "evil.example").starts_with("HTTP/1.1 403 "));
    let status = |path: &str, headers: &[(&'static str, &str)]| class.socket(path, headers).err();
    for path in ["/class", "/class?token=", "/class?token=robots8", "/teacher", "/teacher?token=robots7"] {
        assert_eq!(status(path, &[]), Some(401), "{path}");
    }
    let code = "/class?token=robots7";
    for origin in ["https://evil.example", "http://localhost:3000", "null"] {
        assert_eq!(status(code, &[("origin", origin)]), Some(403), "{origin}");
    }
    assert_eq!(status(code, &[("host", "evil.example")]), Some(403));
    assert_eq!(status(code, &[("origin", &format!("http://{address}"))]), None);
    assert_eq!(status("/frames?token=", &[]), Some(403), "nobody has the arm");
}

/// Thirty browsers with four connections each. The answers fill all buffers, so no connection ends before it is read.
#[test]
fn a_whole_class_can_load_the_page_at_once() {
    let class = Class::start(false, "robots7");
    let request = format!("GET /sevenbot_web_bg.wasm HTTP/1.1\r\nHost: {}\r\n\r\n", class.address);
    let mut streams: Vec<_> = (0..120).map(|_| class.stream()).collect();
    for stream in &mut streams {
        stream.write_all(request.as_bytes()).expect("a request");
    }
    let lengths: Vec<_> = streams
        .iter_mut()
        .map(|stream| {
            let mut answer = Vec::new();
            stream.read_to_end(&mut answer).map_or(0, |_| answer.len())
        })
        .collect();
    assert!(lengths[0] > 500_000 && lengths.iter().all(|length| *length == lengths[0]), "{lengths:?}");
}

/// The strangers send no name, and do not close their connections when the server asks them to.
#[test]
fn strangers_keep_neither_the_teacher_nor_the_class_out() {
    let class = Class::start(false, "robots7");
    let strangers: Vec<_> = (0..100).filter_map(|_| class.socket("/class?token=robots7", &[]).ok()).collect();
    assert!(strangers.len() >= 64, "{} strangers", strangers.len());
    let mut teacher = class.teacher();
    shown(&mut teacher, |class| class["pupils"] == json!([]));
    // The server ends a stranger's connection after ten seconds, and then gives the stranger one second to close its end.
    let mut mia = wait_for("a place", || class.try_join("Mia").ok_or_else(|| "the class is full".to_owned()));
    mia.tab.hear("ask");
    shown(&mut teacher, |class| tile(class, "Mia")["presence"] == "here");
    drop(strangers);
}

#[test]
fn pupils_have_names_of_their_own_and_come_back_with_their_keys() {
    let class = Class::start(false, "");
    let mut teacher = class.teacher();
    let welcome = teacher.hear("welcome");
    assert_eq!(welcome["addresses"], json!([format!("http://{}/", class.address)]));
    assert_eq!((welcome["code"].is_null(), welcome["has_arm"].as_bool()), (true, Some(false)));
    let (mia, mut other) = (class.join(" Mia"), class.join("mia"));
    assert_eq!((mia.name.as_str(), other.name.as_str()), ("Mia", "mia 2"));
    let markup = "<img src=x>";
    assert_eq!(class.join(markup).name, markup, "the page shows it as text");
    let now = shown(&mut teacher, |class| tile(class, "Mia")["report"]["doing"] == "moving");
    assert_eq!(tile(&now, "Mia")["report"]["goals"], json!({ "reached": 1, "all": 5 }));
    drop(mia.tab);
    shown(&mut teacher, |class| tile(class, "Mia")["presence"] == "lost");
    let again = class.join_with("Mia", Some(&mia.key));
    assert_eq!((again.name.as_str(), &again.key), ("Mia", &mia.key));
    other.tab.say_text("no JSON");
    assert_eq!(other.tab.hear("refused"), "bad_message");
    other.tab.wait_for_end();
    let mut nameless = class.tab();
    nameless.say(&json!({ "join": { "name": "--", "key": null } }));
    assert_eq!(nameless.hear("refused"), "no_name");
    nameless.wait_for_end();
}

#[test]
fn a_stop_for_all_is_repeated_until_the_last_tab_has_confirmed_it() {
    let class = Class::start(true, "robots7");
    let mut teacher = class.teacher();
    let mut pupils: Vec<_> = (1..=6).map(|number| class.join(&format!("Pupil {number}"))).collect();
    shown(&mut teacher, |class| class["arm"]["answers"] == true);
    teacher.say(&json!("stop_all"));
    for pupil in &mut pupils {
        let number = pupil.tab.hear("stop")["number"].clone();
        assert_eq!(number, 1);
        if pupil.name != "Pupil 4" {
            pupil.tab.say(&json!({ "stopped": { "number": number, "outcome": "holds" } }));
        }
    }
    // Seven have to confirm: six tabs and the real arm.
    let late = shown(&mut teacher, |class| class["stop"]["confirmed"] == 6);
    assert_eq!((&late["stop"]["asked"], &tile(&late, "Pupil 4")["stop"]), (&json!(7), &json!("asked")));
    assert_eq!((&late["arm"]["stop"], &tile(&late, "Pupil 1")["stop"]), (&json!("holds"), &json!("holds")));
    for _ in 0..3 {
        assert_eq!(pupils[3].tab.hear("stop")["number"], 1, "again");
    }
    pupils[3].tab.say(&json!({ "stopped": { "number": 1, "outcome": "limp" } }));
    let all = shown(&mut teacher, |class| class["stop"]["confirmed"] == 7);
    assert_eq!(tile(&all, "Pupil 4")["stop"], "limp");
    assert!(all["stop"]["millis"].as_u64() >= Some(300), "{}", all["stop"]);
    // A stop that was sent before the confirmation came may still be on its way.
    pupils[3].tab.hear("ask");
    pupils[3].tab.heard_so_far();
    pupils[3].tab.hear("ask");
    pupils[3].tab.hear("ask");
    assert!(pupils[3].tab.heard_so_far().iter().all(|message| message.get("stop").is_none()));
}

#[test]
fn a_message_of_the_teacher_reaches_all() {
    let class = Class::start(false, "");
    let (mut teacher, mut mia) = (class.teacher(), class.join("Mia"));
    teacher.say(&json!({ "say": { "text": "<b>Look</b> here" } }));
    assert_eq!(mia.tab.hear("message")["text"], "<b>Look</b> here");
    let mut later = class.join("Leo");
    assert_eq!(later.tab.hear("message")["text"], "<b>Look</b> here");
    assert_eq!(shown(&mut teacher, |class| class["text"] != "")["text"], "<b>Look</b> here");
    teacher.say(&json!({ "give": { "pupil": 1, "seconds": 60 } }));
    assert_eq!(teacher.hear("not_given"), "no_arm");
}

#[test]
fn only_the_pupil_who_has_the_arm_drives_it_and_the_time_ends() {
    let class = Class::start(true, "robots7");
    let mut teacher = class.teacher();
    let (mut mia, mut leo) = (class.join("Mia"), class.join("Leo"));
    assert_eq!(class.frames(&mia.key).err(), Some(403), "nobody has it");
    give(&mut teacher, "Mia", 6);
    let told = wait_for_arm(&mut mia, true);
    assert!(told["arm"]["seconds"].as_u64() <= Some(6), "{told}");
    let for_leo = leo.tab.hear_where("ask", |ask| ask["arm"]["holder"] == "Mia");
    assert_eq!(for_leo["arm"]["is_yours"], false);
    assert_eq!(class.frames(&leo.key).err(), Some(403), "Mia has it");
    assert_eq!(class.frames("robots7").err(), Some(403), "the code is no key");
    let mut frames = class.frames(&mia.key).expect("accepted");
    drive(&mut frames, 170);
    let over = mia.tab.hear_where("ask", |ask| !ask["over"].is_null());
    assert_eq!((&over["over"], &over["arm"]), (&json!("time"), &Value::Null));
    assert_eq!(class.frames(&mia.key).err(), Some(403), "it is over");
    check_held(&class, &mut teacher, frames, 170);
}

#[test]
fn the_arm_is_held_when_it_is_taken_back_or_its_pupil_is_gone() {
    let class = Class::start(true, "");
    let mut teacher = class.teacher();
    let mut mia = class.join("Mia");
    give(&mut teacher, "Mia", 600);
    wait_for_arm(&mut mia, true);
    let mut frames = class.frames(&mia.key).expect("accepted");
    drive(&mut frames, 170);
    teacher.say(&json!("take_back"));
    assert_eq!(mia.tab.hear_where("ask", |ask| !ask["over"].is_null())["over"], "taken_back");
    check_held(&class, &mut teacher, frames, 170);

    give(&mut teacher, "Mia", 600);
    wait_for_arm(&mut mia, true);
    let mut frames = class.frames(&mia.key).expect("accepted");
    drive(&mut frames, 10);
    drop(mia);
    check_held(&class, &mut teacher, frames, 10);
}

#[test]
fn an_arm_whose_motors_were_switched_off_is_not_told_as_held() {
    let class = Class::start(true, "");
    let (mut teacher, mut mia) = (class.teacher(), class.join("Mia"));
    give(&mut teacher, "Mia", 600);
    wait_for_arm(&mut mia, true);
    let mut frames = class.frames(&mia.key).expect("accepted");
    frames.send(Message::binary(write_request(MOTOR_STATE, &[2]))).expect("the server takes frames");
    assert_eq!(read(&mut frames, MOTOR_STATE, 1), [2]);
    teacher.say(&json!("take_back"));
    shown(&mut teacher, |class| class["arm"]["stop"] == "limp" && class["arm"]["holder"].is_null());
}

#[test]
fn everybody_can_stop_the_arm_and_who_has_it_can_go_on() {
    let class = Class::start(true, "");
    let mut teacher = class.teacher();
    let (mut mia, leo) = (class.join("Mia"), class.join("Leo"));
    give(&mut teacher, "Mia", 600);
    wait_for_arm(&mut mia, true);
    let mut frames = class.frames(&mia.key).expect("accepted");
    for stop in ["a pupil", "the teacher"] {
        drive(&mut frames, if stop == "a pupil" { 170 } else { 10 });
        match stop {
            "a pupil" => leo.tab.say(&json!("stop_arm")),
            _ => teacher.say(&json!("stop_all")),
        }
        shown(&mut teacher, |class| class["arm"]["stop"] == "holds");
        wait_until_at_rest(&mut frames);
        // After a second without a target, a program that was stopped starts anew.
        std::thread::sleep(Duration::from_millis(1_100));
    }
    drive(&mut frames, 170);
    // A newer session of the same pupil takes the arm over.
    let mut newer = class.frames(&mia.key).expect("accepted");
    wait_for("the older one crashes", || match frames.read() {
        Err(_) => Ok(()),
        Ok(message) => Err(format!("{message:?}")),
    });
    assert_eq!(read(&mut newer, PRESENT_POSITION, 1).len(), 1);
}
