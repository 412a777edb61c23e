//! A class in browsers: the teacher's screen, and pupils' tabs.
//!
//! This command runs the test with thirty tabs, here for 120 s. Without `CLASS_SECONDS` it takes ten minutes:
//!
//! ```sh
//! CLASS_SECONDS=120 cargo test -p browser-tests --test browser -- thirty --ignored --nocapture
//! ```

use std::time::{Duration, Instant};

use browser_tests::page::Screen;
use browser_tests::{ClassRun, Page};
use serde_json::Value;
use system_tests::wait::wait_for;

use crate::programs::{SLOW, open_file, open_programs};

/// The number of pupils' tabs in [`thirty_tabs_stop_together`].
const TABS: usize = 30;
/// No WebGL, and five pictures a second. In a class each of thirty laptops draws its own arm, but this computer would draw all of
/// them in software.
const FEW_PICTURES: &str = "
    const request = window.requestAnimationFrame;
    window.requestAnimationFrame = act => setTimeout(() => request(act), 200);
    const context = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
      return kind === 'webgl2' ? null : context.call(this, kind, ...more);
    };";

/// The text of a part of a pupil's tile.
fn tile(teacher: &mut Page, name: &str, part: &str) -> String {
    let text = teacher.evaluate(&format!(
        "[...document.querySelectorAll('#tiles li')].find(tile => tile.querySelector('h3').textContent == `{name}`)
         ?.querySelector('{part}').textContent ?? 'no tile'"
    ));
    text.as_str().expect("a text").to_owned()
}

#[track_caller]
fn wait_for_tile(teacher: &mut Page, name: &str, part: &str, wanted: &str) {
    wait_for(&format!("the tile of {name} says {wanted}"), || {
        let text = tile(teacher, name, part);
        if text.contains(wanted) { Ok(()) } else { Err(format!("{text}; {:?}", teacher.errors())) }
    });
}

fn click_tile(teacher: &mut Page, name: &str) {
    teacher.evaluate(&format!(
        "[...document.querySelectorAll('#tiles li')].find(tile => tile.querySelector('h3').textContent == `{name}`)
         .querySelector('button').click()"
    ));
}

/// Runs [`SLOW`], and waits until it has begun.
fn run_slow_program(class: &ClassRun, page: &mut Page) {
    open_programs(page);
    let file = class.path("slow.json");
    std::fs::write(&file, SLOW).expect("a file");
    open_file(page, &file, "180");
    page.click("[data-action=run]");
    page.wait_for_text("#program-state", "A program runs.");
}

#[test]
fn a_stop_for_all_ends_the_programs_of_the_pupils_and_says_who_stopped() {
    let class = ClassRun::start(false);
    let mut teacher = class.open_teacher();
    teacher.wait_for_text("#join", &format!("Pupils open {} · class code robots7", class.pupils));
    assert_eq!(teacher.evaluate("location.search"), "", "the secret is not on the beamer");
    let mut mia = class.join(&teacher, "Mia");
    let mut second = class.join(&teacher, "Mia");
    second.wait_for_text("#class-state", "You are in the class as Mia 2");
    second.wait_for_text("#notice", "Each name is there once. You are Mia 2");
    for page in [&mut mia, &mut second] {
        run_slow_program(&class, page);
    }
    wait_for_tile(&mut teacher, "Mia", ".doing", "a program runs");
    wait_for_tile(&mut teacher, "Mia 2", ".doing", "a program runs");
    // The space bar stops all arms, also with the focus on a button.
    teacher.focus("[data-action=language]");
    teacher.key(" ");
    teacher.wait_for_text("#state", "Last stop: confirmed by all arms (2)");
    for (page, name) in [(&mut mia, "Mia"), (&mut second, "Mia 2")] {
        page.wait_for_text("#notice", "The program ended early: Stopped by the teacher.");
        page.wait_for_text("#program-state", "The program was ended.");
        page.wait_for_text("#state", "Stopped: the arm holds.");
        let rests = page.measured()[0];
        page.pass(2.0);
        assert!((page.measured()[0] - rests).abs() < 0.5, "{name} goes on");
        assert_eq!(tile(&mut teacher, name, ".stopped"), "stopped: holds");
    }
    // A reload keeps the name, and a message is shown as text.
    mia.reload();
    mia.wait_for_text("#class-state", "You are in the class as Mia");
    teacher.type_into("#say", "<b>Look</b> here");
    mia.wait_for_text("#class-text", "<b>Look</b> here");
    mia.click("[data-action=close-class-text]");
    assert_eq!(mia.evaluate("document.querySelector('#class-text-row').hidden"), true);
    teacher.click("[data-action=language]");
    teacher.wait_for_text("#stop", "全部停止");
    let named = |(role, name): &(String, String)| role != "button" || !name.is_empty();
    assert!(teacher.accessible().iter().all(named), "{:?}", teacher.accessible());
    for page in [&mut teacher, &mut mia, &mut second] {
        assert_eq!(page.errors(), [""; 0]);
    }
}

#[test]
fn a_wrong_code_and_a_lost_class_are_told() {
    let class = ClassRun::start(false);
    let mut page = Page::open(&class.pupils);
    page.key("Escape");
    page.evaluate("document.querySelector('#class-code').value = 'robots8'");
    page.type_into("#class-name", "Mia Lee");
    page.wait_for_text("#notice", "The class cannot be reached, or the class code is not right.");
    assert_eq!(page.evaluate("document.querySelector('#class-name').value"), "Mia Lee");
    page.type_into("#class-code", "robots7");
    page.wait_for_text("#class-state", "You are in the class as Mia Lee");
    let mut teacher = page.open_beside(&class.teacher, BLOCK_STORAGE);
    teacher.wait_for_text("#join", "class code robots7");
    teacher.click("[data-action=language]");
    teacher.click("[data-action=language]");
    assert_eq!(teacher.errors(), [""; 0]);
    drop(class);
    page.wait_for_text("#class-state", "The connection to the class was lost. Trying again");
    page.wait_until_ready();
    teacher.wait_for_text("#state", "If it was started again, open the new address that it printed.");
}

#[test]
fn the_real_arm_is_given_driven_and_taken_back() {
    let class = ClassRun::start(true);
    let mut teacher = class.open_teacher();
    let mut mia = class.join(&teacher, "Mia");
    let mut leo = class.join(&teacher, "Leo");
    // Mia's simulated arm keeps this pose while she has the real arm.
    mia.type_into("#target-1", "110");
    mia.wait_until_joint_rests(1, 110.0);
    teacher.wait_for_text("#arm-state", "nobody has it");
    click_tile(&mut teacher, "Mia");
    mia.wait_for_text("#class-arm", "You have the class's real arm for");
    mia.wait_for_text("#notice", "The teacher gave you the class's real arm.");
    leo.wait_for_text("#class-arm", "Mia has the class's real arm for");
    teacher.wait_for_text("#arm-state", "Mia has it");
    mia.wait_until_ready();
    assert_eq!(mia.evaluate("document.querySelector('#source').value"), "server");
    assert!((mia.measured()[0] - 90.0).abs() < 1.5, "another arm");
    // Leo cannot have it.
    leo.choose("#source", "server");
    leo.wait_for_text("#notice", "You do not have the class's real arm now.");
    // Mia moves it, and Leo stops it.
    mia.choose("#joint-speed", "10");
    wait_for("the real arm moves", || {
        // On a busy machine a key may be lost.
        mia.focus("#joint-1");
        mia.key("End");
        let state = mia.state();
        let moves = state["measured"][0].as_f64() > Some(95.0);
        if moves { Ok(()) } else { Err(format!("{state}; {}", mia.text("#notice"))) }
    });
    leo.click("#stop-class-arm");
    teacher.wait_for_text("#arm-state", "Mia has it");
    let rests = |state: &Value| {
        state["registers"][243] == 0 && state["targets"][0].as_f64().is_some_and(|target| target < 179.0)
    };
    mia.wait_for_state("the real arm holds", rests);
    teacher.click("[data-action=take-back]");
    mia.wait_for_text("#notice", "The teacher took the class's real arm back, and it holds.");
    teacher.wait_for_text("#arm-state", "nobody has it · holds");
    assert_eq!(mia.evaluate("document.querySelector('#source').value"), "simulator");
    mia.wait_until_joint_rests(1, 110.0);
    // Leo gets the arm for 3 s.
    teacher.evaluate("document.querySelector('#minutes').value = 0.05");
    click_tile(&mut teacher, "Leo");
    leo.wait_for_text("#class-arm", "You have the class's real arm for");
    leo.wait_for_text("#notice", "Your time with the class's real arm is over");
    for page in [&mut teacher, &mut mia, &mut leo] {
        assert_eq!(page.errors(), [""; 0]);
    }
}

/// Imitates a browser that blocks storage: each access throws an exception.
const BLOCK_STORAGE: &str = "
    for (const name of ['localStorage', 'sessionStorage']) {
      Object.defineProperty(window, name, { get() { throw new Error('blocked'); } });
    }";

/// Keeps the WebSockets of the page in `window.sockets`.
const KEEP_SOCKETS: &str = "
    window.sockets = [];
    window.WebSocket = class extends WebSocket {
      constructor(...given) { super(...given); window.sockets.push(this); }
    };";

/// The last WebSocket of the page to this path.
fn socket(path: &str) -> String {
    format!("window.sockets.filter(socket => socket.url.includes('{path}')).at(-1)")
}

#[test]
fn a_line_to_the_real_arm_that_breaks_is_opened_again_and_a_class_that_falls_silent_is_noticed() {
    let class = ClassRun::start(true);
    let mut teacher = class.open_teacher();
    let mut mia = class.join_after(&teacher, "Mia", KEEP_SOCKETS);
    wait_for_tile(&mut teacher, "Mia", ".doing", "ready");
    click_tile(&mut teacher, "Mia");
    mia.wait_for_text("#class-arm", "You have the class's real arm for");
    mia.wait_until_ready();
    let frames = socket("/frames");
    mia.evaluate(&format!("{frames}.close()"));
    mia.wait_until_said("#state", "The connection to the arm has ended.");
    mia.wait_until_ready();
    assert_eq!(mia.evaluate(&format!("{frames}.readyState")), 1, "the line is open");
    mia.wait_for_text("#class-arm", "You have the class's real arm for");
    // As with a network that is gone: nothing arrives, and nothing is closed.
    let of_class = socket("/class");
    mia.evaluate(&format!("(window.silent = {of_class}).onmessage = null"));
    mia.wait_until_said("#notice", "The connection was lost, so you have the class's real arm no longer.");
    mia.wait_for_text("#class-state", "You are in the class as Mia");
    assert!(mia.evaluate("window.silent.readyState").as_u64() >= Some(2), "it is closed");
    assert_eq!(mia.evaluate("document.querySelector('#source').value"), "simulator");
    assert_eq!(mia.errors(), [""; 0]);
}

/// While `window.isInBackground`, the page gets no pictures, as in a tab in the background.
const BACKGROUND: &str = "
    const request = window.requestAnimationFrame;
    window.requestAnimationFrame = act => request(time => window.isInBackground || act(time));";

#[test]
fn a_tab_in_the_background_notices_a_class_that_is_silent_and_one_that_is_gone() {
    let class = ClassRun::start(false);
    let teacher = class.open_teacher();
    let mut mia = class.join_after(&teacher, "Mia", &format!("{KEEP_SOCKETS}{BACKGROUND}"));
    mia.evaluate("window.isInBackground = true");
    let of_class = socket("/class");
    mia.evaluate(&format!("(window.silent = {of_class}).onmessage = null"));
    wait_for("it connects again", || {
        let sockets = mia.evaluate(&format!("[window.silent.readyState, {of_class}.readyState]"));
        if sockets == serde_json::json!([3, 1]) { Ok(()) } else { Err(sockets.to_string()) }
    });
    mia.wait_for_text("#class-state", "You are in the class as Mia");
    assert_eq!(mia.errors(), [""; 0]);
    drop(class);
    mia.wait_for_text("#class-state", "The connection to the class was lost. Trying again");
}

#[test]
fn a_stop_without_a_connection_is_told_not_to_be_sent() {
    let class = ClassRun::start(true);
    let mut teacher = class.open_teacher();
    let _mia = class.join(&teacher, "Mia");
    let mut leo = class.join_after(&teacher, "Leo", KEEP_SOCKETS);
    wait_for_tile(&mut teacher, "Mia", ".doing", "ready");
    click_tile(&mut teacher, "Mia");
    leo.wait_for_text("#class-arm", "Mia has the class's real arm for");
    // The page shows the button until it notices that the connection has ended.
    let of_class = socket("/class");
    leo.evaluate(&format!("[{of_class}.close(), document.querySelector('#stop-class-arm').click()]"));
    leo.wait_until_said("#notice", "NOT SENT: there is no connection to the class.");
    leo.wait_for_text("#class-arm", "Mia has the class's real arm for");
    assert_eq!([teacher.errors(), leo.errors()], [[""; 0]; 2]);
    drop(class);
    teacher.wait_for_text("#state", "The connection to `sevenbot class` was lost.");
    teacher.click("#stop");
    teacher.wait_for_text("#notice", "NOT SENT: there is no connection to `sevenbot class`.");
}

/// Measures a stop for all while thirty arms move.
#[test]
#[ignore = "ten minutes"]
fn thirty_tabs_stop_together() {
    let seconds = std::env::var("CLASS_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(600);
    let small = Screen { width: 480, height: 320, is_dark: false, is_phone: false };
    let class = ClassRun::start(false);
    let mut teacher = class.open_teacher();
    let begin = Instant::now();
    let mut pupils: Vec<Page> = (1..=TABS)
        .map(|number| {
            let mut page = class.join_after(&teacher, &format!("Pupil {number}"), FEW_PICTURES);
            page.show_on(small);
            page
        })
        .collect();
    println!("{TABS} tabs have joined after {:.0} s", begin.elapsed().as_secs_f64());
    let mut millis: Vec<u64> = Vec::new();
    let end = Instant::now() + Duration::from_secs(seconds);
    while Instant::now() < end {
        let to = if millis.len().is_multiple_of(2) { "End" } else { "Home" };
        for page in &mut pupils {
            page.focus("#joint-1");
            page.key(to);
        }
        let number = millis.len() + 1;
        teacher.click("#stop");
        let stop = wait_for("all arms hold", || {
            let text = teacher.text("#state");
            let confirmed = text.contains(&format!("confirmed by all arms ({TABS})"));
            let is_last = teacher.evaluate("window.sevenbot.stop_number()") == number;
            if confirmed && is_last { Ok(text) } else { Err(text) }
        });
        let (_, after) = stop.rsplit_once("after ").expect("a time");
        millis.push(after.trim_end_matches(" ms.").parse().expect("a number"));
        assert!(stop.starts_with(&format!("{TABS} ")), "all are here: {stop}");
    }
    millis.sort_unstable();
    let load = std::fs::read_to_string("/proc/loadavg").expect("the load");
    println!(
        "{} stops in {seconds} s: median {} ms, longest {} ms; load {}",
        millis.len(),
        millis[millis.len() / 2],
        millis.last().expect("a stop"),
        load.trim()
    );
    println!("{millis:?}");
    for page in pupils.iter_mut().chain([&mut teacher]) {
        assert_eq!(page.errors(), [""; 0]);
    }
}
