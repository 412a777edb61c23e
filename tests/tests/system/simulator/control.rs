//! `sevenbot sim`: faults, a hand, a weight, power and virtual time of a running simulator; its control socket, and clients
//! that behave badly.

use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::time::Duration;

use serde_json::{Value, json};
use system_tests::control::Control;
use system_tests::process::{self, Signal};
use system_tests::programs::tool;
use system_tests::registers::{
    EFFECTOR_TYPE, MISSING_SERVOS, MOTOR_STATE, PRESENT_POSITION, TARGET_POSITION,
};
use system_tests::simulator::Simulator;
use system_tests::wait;

#[test]
fn a_fault_begins_and_ends_while_the_arm_runs_and_tells_its_effects() {
    let simulator = Simulator::start(&[]);
    let mut arm = simulator.client();
    wait::wait_until("all servos answer", || arm.register(MISSING_SERVOS) == 0);
    assert_eq!(simulator.says(&["fault", "list"]), "no faults\n");
    simulator.says(&["fault", "3=missing"]);
    wait::wait_until("joint 3 is missing", || arm.register(MISSING_SERVOS) == 0b100);
    let list = simulator.says(&["fault", "list"]);
    assert!(list.starts_with("active    3=missing: ") && list.contains(" frames"), "{list}");
    assert!(simulator.says(&["fault", "clear", "3"]).starts_with("cleared   3=missing: "));
    wait::wait_until("joint 3 answers", || arm.register(MISSING_SERVOS) == 0);
    simulator.says(&["fault", "4=late=20", "--for", "50ms"]);
    wait::wait_until("the fault is over", || {
        simulator.says(&["fault", "list"]).starts_with("ended     4=late=20")
    });
    simulator.says(&["fault", "5=garbled=1000000"]);
    let cleared = simulator.says(&["fault", "clear"]);
    assert!(
        cleared.contains("5=garbled=1000000: 0 of ") && cleared.contains("never took effect"),
        "{cleared}"
    );
}

#[test]
fn a_hand_a_weight_and_the_power_switch_act_on_the_arm() {
    let simulator = Simulator::start(&[]);
    let mut arm = simulator.client();
    wait::wait_until("the arm holds", || simulator.joint(3, "torque") == "on");
    let refusal = simulator.refuses(&["hand", "2", "hold"], 1);
    assert!(refusal.contains("has torque") && refusal.contains("JOINT=stuck"), "{refusal}");
    simulator.says(&["weight", "150g"]);
    wait::wait_until("the forearm carries it", || {
        // The load of joint 3 is 14 % of the stall torque without the weight. The weight adds 17 %.
        simulator.joint(3, "load_percent").as_f64().expect("a load").abs() > 27.0
    });
    assert_eq!(simulator.state()["weight_grams"], 150);
    arm.write(MOTOR_STATE, &[2]);
    wait::wait_until("the arm is free", || simulator.joint(2, "torque") == "free");
    assert_eq!(simulator.says(&["hand", "2", "120"]), "joint 2 is at 120.1 degrees\n");
    assert_eq!(simulator.joint(2, "is_held"), true);
    simulator.says(&["hand", "2", "let-go"]);
    arm.write(EFFECTOR_TYPE, &[1]);
    wait::wait_until("the write is done", || arm.register(EFFECTOR_TYPE) == 1);
    simulator.says(&["power", "off"]);
    assert_eq!(
        (&simulator.state()["controller"], &simulator.state()["supply_volts"]),
        (&json!("off"), &json!(0.0))
    );
    assert!(simulator.refuses(&["halt"], 1).contains("no power"));
    simulator.says(&["power", "on"]);
    assert!(simulator.refuses(&["power", "on"], 1).contains("the power is on"));
    wait::wait_until("the RAM is lost", || arm.register(EFFECTOR_TYPE) == 0);
    simulator.says(&["halt"]);
    assert_eq!(simulator.state()["controller"], "halted");
    simulator.says(&["restart"]);
    wait::wait_until("it answers again", || arm.register(EFFECTOR_TYPE) == 0);
}

#[test]
fn errors_say_what_to_do() {
    let simulator = Simulator::start(&[]);
    assert!(simulator.refuses(&["fault", "9=missing"], 1).contains("1 to 7"));
    assert!(simulator.refuses(&["fault", "line=loss=x"], 1).contains("line=loss=0.5%"));
    assert!(simulator.refuses(&["fault", "clear", "3"], 1).contains("no such fault"));
    assert!(simulator.refuses(&["fault", "list", "3"], 2).contains("'clear'"));
    assert!(simulator.refuses(&["weight", "2000g"], 1).contains("1000 grams"));
    assert!(simulator.refuses(&["hand", "8", "90"], 1).contains("1 to 7"));
    assert!(simulator.refuses(&["hand", "2", "200"], 2).contains("180"));
    assert!(simulator.refuses(&["hand", "2", "NaN"], 2).contains("degrees from 0 to 180"));
    assert!(simulator.refuses(&["speed", "NaN"], 2).contains("0.001 to 1000"));
    assert!(simulator.refuses(&["--control", "/nowhere", "state"], 3).contains("/nowhere"));
    assert!(simulator.refuses(&["--port", "/dev/null", "state"], 3).contains("/dev/null"));
    let alone = tool()
        .env("XDG_RUNTIME_DIR", simulator.folder.path().join("other"))
        .env_remove("SEVENBOT_PORT")
        .args(["sim", "state"])
        .output()
        .expect("sevenbot runs");
    let said = String::from_utf8_lossy(&alone.stderr);
    assert!(alone.status.code() == Some(3) && said.contains("cargo sim"), "{said}");
}

#[test]
fn a_running_simulator_is_found_without_its_port() {
    let simulator = Simulator::start(&[]);
    let mut command = tool();
    command.env("XDG_RUNTIME_DIR", simulator.folder.path()).env_remove("SEVENBOT_PORT").arg("info");
    let output = command.output().expect("sevenbot runs");
    let said =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    let port = simulator.ports[0].to_str().expect("text");
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains(&format!("using {port}, the port of the only simulator")), "{said}");
}

#[test]
fn each_arm_has_its_own_socket_and_the_port_chooses_it() {
    let simulator = Simulator::start(&["--arms", "2"]);
    let sockets = simulator.sockets();
    assert_eq!(sockets.len(), 2);
    for socket in &sockets {
        assert_eq!(fs::metadata(socket).expect("a socket").permissions().mode() & 0o777, 0o600);
    }
    let error = simulator.refuses(&["state"], 3);
    assert!(error.contains("several") && error.contains(sockets[1].to_str().expect("text")), "{error}");
    let second = simulator.ports[1].to_str().expect("text");
    simulator.says(&["--port", second, "weight", "10g"]);
    let state = simulator.says(&["--port", second, "state"]);
    assert!(state.contains("weight      10 g") && state.contains(second), "{state}");
    let first = simulator.says(&["--control", sockets[0].to_str().expect("text"), "state"]);
    assert!(first.contains("weight      0 g"), "{first}");
}

/// The virtual time of a state, in microseconds.
fn time(simulator: &Simulator) -> u64 {
    simulator.state()["time_us"].as_u64().expect("a time")
}

#[test]
fn virtual_time_stands_advances_exactly_and_goes_at_full_speed() {
    let simulator = Simulator::start(&[]);
    let mut arm = simulator.client();
    assert_eq!(simulator.state()["speed"], 1.0);
    simulator.says(&["pause"]);
    let paused_at = time(&simulator);
    arm.write(TARGET_POSITION, &[120]);
    assert!(arm.try_read(EFFECTOR_TYPE, 1, Duration::from_millis(200)).is_none(), "no time, no answer");
    assert_eq!((time(&simulator), &simulator.state()["speed"]), (paused_at, &json!("paused")));
    let said = simulator.says(&["advance", "10s"]);
    assert_eq!(said, format!("time        {:.3} s\n", (paused_at + 10_000_000) as f64 / 1e6));
    assert_eq!(time(&simulator), paused_at + 10_000_000);
    let angle = simulator.joint(1, "angle_degrees").as_f64().expect("an angle");
    assert!((angle - 120.0).abs() < 1.0, "{angle}");
    simulator.says(&["speed", "max"]);
    wait::wait_until("ten minutes have passed", || time(&simulator) > 600_000_000);
    assert_eq!(arm.register(EFFECTOR_TYPE), 0, "the port is served");
    let said = simulator.says(&["speed", "50"]);
    assert!(said.ends_with(", speed 50.0\n"), "{said}");
    assert_eq!(arm.register(EFFECTOR_TYPE), 0);
    assert!(simulator.refuses(&["speed", "0"], 2).contains("0.001"));
    assert!(simulator.refuses(&["advance", "10"], 2).contains("250ms"));
    simulator.says(&["pause"]);
    simulator.says(&["resume"]);
    let resumed_at = time(&simulator);
    wait::wait_until("time passes", || time(&simulator) > resumed_at);
}

#[test]
fn requests_after_an_advance_wait_for_its_end() {
    let simulator = Simulator::start(&[]);
    let mut control = Control::connect(&simulator.sockets()[0]);
    control.ask(&json!({ "do": "pause" }));
    control.send(
        b"{\"do\":\"advance\",\"ms\":5000}\n{\"do\":\"fault\",\"fault\":\"3=missing\",\"for_ms\":1000}\n",
    );
    control.send(b"{\"do\":\"advance\",\"ms\":999}\n{\"do\":\"faults\"}\n{\"do\":\"advance\",\"ms\":1}\n{\"do\":\"faults\"}\n");
    let first = control.answer()["ok"]["time_us"].as_u64().expect("a time");
    assert_eq!(control.answer()["ok"]["fault"], "3=missing");
    assert_eq!(control.answer()["ok"]["time_us"], first + 999_000);
    assert_eq!(control.answer()["ok"]["faults"][0]["remaining_ms"], 1);
    control.answer();
    let faults = control.answer();
    assert_eq!(faults["ok"]["faults"], json!([]));
    assert_eq!(faults["ok"]["ended_faults"][0]["had_no_effect"], false, "{faults}");
}

/// Runs a client that waits for each answer and pauses in real time. Returns all answers, and the state at the end.
fn lockstep_run(pause: Duration) -> (Vec<Vec<u8>>, Value) {
    let simulator = Simulator::start(&["--lockstep", "60000", "--fault", "3=garbled=7", "--seed", "3"]);
    let mut arm = simulator.client();
    let mut answers = Vec::new();
    for degrees in [120, 60, 100] {
        arm.write(TARGET_POSITION, &[degrees, 80]);
        for _ in 0..40 {
            std::thread::sleep(pause);
            answers.push(arm.read(PRESENT_POSITION, 7));
        }
    }
    let mut state = simulator.state();
    state["port"].take();
    (answers, state)
}

#[test]
fn in_lockstep_a_client_gets_the_same_answers_however_long_it_thinks() {
    let simulator = Simulator::start(&["--lockstep", "60000"]);
    let start = time(&simulator);
    assert_eq!((start, simulator.joint(3, "torque")), (1_000_000, json!("on")), "the servos have started");
    assert!(simulator.refuses(&["speed", "5"], 1).contains("--lockstep"));
    simulator.says(&["advance", "2s"]);
    assert_eq!(time(&simulator), start + 2_000_000);
    drop(simulator);
    let (answers, state) = lockstep_run(Duration::ZERO);
    assert_ne!(answers.first(), answers.last(), "the arm moves");
    assert_eq!(lockstep_run(Duration::from_millis(7)), (answers, state));
}

#[test]
fn in_lockstep_time_goes_on_after_a_timeout() {
    let simulator = Simulator::start(&["--lockstep", "1"]);
    let _arm = simulator.client();
    let before = time(&simulator);
    wait::wait_until("time goes on", || time(&simulator) > before + 10_000);
    assert_eq!(time(&simulator) % 1_000, 0);
}

#[test]
fn the_socket_is_removed_at_the_end_and_a_left_one_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("control");
    let text = path.to_str().expect("text");
    let mut simulator = Simulator::start(&["--control", text]);
    simulator.process.kill();
    assert!(path.exists(), "a kill leaves it");
    let mut simulator = Simulator::start(&["--control", text]);
    assert!(simulator.says(&["--control", text, "state"]).contains("controller"));
    process::send_signal(&simulator.process, Signal::TERM);
    assert!(process::wait_for_exit(&mut simulator.process).success());
    assert!(!path.exists());
}

#[test]
fn clients_that_behave_badly_disturb_neither_the_arm_nor_each_other() {
    let simulator = Simulator::start(&[]);
    let path = &simulator.sockets()[0];
    let mut arm = simulator.client();
    let mut silent = Control::connect(path);
    let mut half = Control::connect(path);
    half.send(br#"{"do":"sta"#);
    let mut garbage = Control::connect(path);
    garbage.send(b"\x00\xFF\xFEgarbage\n[]\n{\"do\":\"nothing\"}\n{\"do\":\"state\"}\n");
    let flood = UnixStream::connect(path).expect("a control socket");
    flood.set_nonblocking(true).expect("a mode");
    let mut sent = 0;
    for _ in 0..1_000 {
        // The flood never reads an answer.
        sent += (&flood).write(&b"{\"do\":\"state\"}\n".repeat(100)).unwrap_or(0);
        arm.register(EFFECTOR_TYPE);
    }
    assert!(sent < 1_000_000, "{sent} bytes");
    Control::connect(path).send(b"{\"do\":");
    for _ in 0..3 {
        let answer = garbage.answer();
        assert!(answer["error"].is_string() && answer["hint"].is_string(), "{answer}");
    }
    assert!(garbage.answer()["ok"]["joints"].is_array());
    half.send(b"te\"}\n");
    assert!(half.answer()["ok"]["joints"].is_array());
    assert_eq!(silent.ask(&json!({ "do": "weight", "grams": 5 })), json!({ "ok": { "grams": 5 } }));
    let many: Vec<Control> = (0..20).map(|_| Control::connect(path)).collect();
    arm.register(EFFECTOR_TYPE);
    drop((many, flood));
    assert_eq!(silent.ask(&json!({ "do": "faults" }))["ok"]["faults"], json!([]));
    arm.write(EFFECTOR_TYPE, &[1]);
    wait::wait_until("the arm obeys", || arm.register(EFFECTOR_TYPE) == 1);
}
