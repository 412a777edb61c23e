use proptest::collection::vec;
use proptest::prelude::*;
use sevenbot::Joint;

use super::*;
use crate::stop::StopProgress;
use crate::tab::Tab;
use crate::texts::Language;
use crate::words::program_failure;

/// A workspace with this stack of blocks below the start block.
fn workspace(first: &str) -> String {
    format!(
        r#"{{"blocks": {{"blocks": [{{"type": "arm_start", "id": "start", "next": {{"block": {first}}}}}]}}}}"#
    )
}

/// A program that moves joint 1 slowly to 170 degrees, for about four seconds.
fn long_move() -> String {
    let number =
        |number: u8| format!(r#"{{"block": {{"type": "math_number", "fields": {{"NUM": {number}}}}}}}"#);
    workspace(&format!(
        r#"{{"type": "arm_move_joint", "id": "move", "fields": {{"JOINT": "1"}}, "inputs": {{"ANGLE": {}, "SPEED": {}}}}}"#,
        number(170),
        number(20)
    ))
}

/// The programs in `block-programs/examples`: the text and the path of each workspace.
fn examples() -> Vec<(String, std::path::PathBuf)> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("block-programs/examples");
    let files = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let workspaces = files.filter(|path| path.extension().is_some_and(|extension| extension == "json"));
    workspaces.map(|path| (std::fs::read_to_string(&path).expect("a file"), path)).collect()
}

/// Compares a text with a committed file. If the environment variable `ACCEPT` is set, writes the file first.
fn check_file(path: &std::path::Path, text: &str, is_same: impl Fn(&str) -> bool) {
    if std::env::var_os("ACCEPT").is_some() {
        std::fs::write(path, text).expect("a file");
    }
    let committed = std::fs::read_to_string(path).unwrap_or_default();
    assert!(is_same(&committed), "{}: ACCEPT=1 writes it anew:\n{text}", path.display());
}

/// `python/tests/test_block_programs.py` runs the committed Python programs, and compares with the same committed angles.
#[test]
fn each_example_ends_where_it_did_and_is_the_committed_python() {
    let examples = examples();
    assert!(examples.len() >= 6);
    for (workspace, path) in examples {
        let mut tab = Tab::new();
        let before = tab.registers();
        let (end, _) = tab.run(&workspace, |_, _| ());
        assert_eq!(end, ProgramProgress::Over, "{}", path.display());
        tab.pass(30);
        assert_eq!(tab.registers(), before, "speeds and times are those of before");
        let angles = tab.angles();
        let text = angles.map(|angle| format!("{angle:.2}")).join(" ") + "\n";
        check_file(&path.with_extension("end.txt"), &text, |committed| {
            let committed: Vec<f64> =
                committed.split_whitespace().filter_map(|word| word.parse().ok()).collect();
            committed.len() == 7 && angles.iter().zip(committed).all(|(angle, end)| (angle - end).abs() < 0.5)
        });
        let program = Program::parse(&workspace).expect("a program");
        let python = block_programs::python(&program);
        check_file(&path.with_extension("py"), &python, |committed| committed == python);
    }
}

#[test]
fn a_program_ends_where_the_arm_does_not_carry_it_out() {
    for (action, word) in [
        ("fault 1=missing", "Joint 1 does not answer"),
        ("fault 1=stuck", "Joint 1 is blocked"),
        ("fault supply=off", "does not answer"),
        ("power-cycle", "restarted"),
        ("halt", "does not answer"),
        // The program does not move joint 7.
        ("trip 7", "overload"),
    ] {
        let mut tab = Tab::new();
        let (end, run) = tab.run(&long_move(), |picture, tab| {
            if picture == 60 {
                tab.act(action);
            }
        });
        let ProgramProgress::Failed(failure) = end else { panic!("{action}: {end:?}") };
        let words = program_failure(Language::English, &failure);
        assert!(words.contains(word), "{action}: {words}");
        assert_eq!(run.block().map(|block| &**block), Some("move"));
        assert_ne!(tab.client.stop_progress(), StopProgress::None, "{action}: the arm is told to hold");
    }
}

/// The program turns the joint at 19 degrees/s. With the restored speed the joint would continue at 114 degrees/s (D11).
#[test]
fn d11_a_joint_on_its_way_holds_when_another_joint_is_moved() {
    let mut tab = Tab::new();
    let before = tab.registers();
    let mut run = tab.begin(&long_move(), RunMode::Running);
    for _ in 0..60 {
        assert_eq!(run.poll(tab.arm.now(), &mut tab.client), ProgramProgress::Running);
        tab.pass(1);
    }
    let at_end = tab.angles()[0];
    run.end(tab.arm.now(), &mut tab.client);
    let (address, values) =
        crate::arm_state::target_frame(tab.client.registers(), 5, 120.0).expect("a target");
    tab.client.write(tab.arm.now(), address, &values);
    for _ in 0..120 {
        tab.pass(1);
        let now = tab.angles()[0];
        assert!((at_end - now).abs() < 2.0, "from {at_end} to {now}");
    }
    assert!((tab.angles()[4] - 120.0).abs() < 1.0, "{:?}", tab.angles());
    assert_eq!(tab.registers(), before);
}

/// A joint that something else moves arrives at another target than the program has written.
#[test]
fn a_move_does_not_count_as_done_if_something_else_moves_its_joint() {
    let mut tab = Tab::new();
    let (end, _) = tab.run(&long_move(), |picture, tab| {
        if picture == 60 {
            let (address, values) =
                crate::arm_state::target_frame(tab.client.registers(), 1, 95.0).expect("a target");
            tab.client.write(tab.arm.now(), address, &values);
        }
    });
    assert_eq!(end, ProgramProgress::Failed(ProgramFailure::OtherTargets(vec![Joint::ALL[0]])));
}

#[test]
fn a_tip_that_cannot_go_there_ends_the_program_and_nothing_moves() {
    for (kind, point, word) in [
        ("arm_move_tip", [0, 900, 0], "out of reach"),
        ("arm_move_tip", [0, 200, -90], "table"),
        ("arm_line", [0, 900, 0], "reach"),
    ] {
        let mut tab = Tab::new();
        let number =
            |number: i32| format!(r#"{{"block": {{"type": "math_number", "fields": {{"NUM": {number}}}}}}}"#);
        let [x, y, z] = point.map(number);
        let first = format!(
            r#"{{"type": "{kind}", "id": "tip", "fields": {{"TOOL": "DOWN"}}, "inputs": {{"X": {x}, "Y": {y}, "Z": {z}, "SPEED": {}}}}}"#,
            number(50)
        );
        let before = tab.angles();
        let (end, _) = tab.run(&workspace(&first), |_, _| ());
        let ProgramProgress::Failed(failure) = end else { panic!("{end:?}") };
        let words = program_failure(Language::English, &failure);
        assert!(words.contains(word), "{words}");
        assert!(!program_failure(Language::Chinese, &failure).is_empty());
        tab.pass(60);
        assert!(tab.angles().iter().zip(before).all(|(now, before)| (now - before).abs() < 0.5));
    }
}

#[test]
fn single_steps_wait_before_each_block() {
    let mut tab = Tab::new();
    let first = r#"{"type": "arm_vacuum", "id": "on", "fields": {"STATE": "ON"},
                    "next": {"block": {"type": "arm_vacuum", "id": "off", "fields": {"STATE": "OFF"}}}}"#;
    let mut run = tab.begin(&workspace(first), RunMode::SingleSteps);
    let mut lit = Vec::new();
    for _ in 0..600 {
        match run.poll(tab.arm.now(), &mut tab.client) {
            ProgramProgress::Waiting => {
                lit.push((run.block().map(|block| block.to_string()), tab.client.registers().at(31)));
                run.go_on(RunMode::SingleSteps);
            }
            ProgramProgress::Running => {}
            end => {
                assert_eq!(end, ProgramProgress::Over);
                break;
            }
        }
        tab.pass(1);
    }
    assert_eq!(lit, [(Some("on".to_owned()), 0), (Some("off".to_owned()), 1)]);
}

#[test]
fn an_endless_loop_lets_the_page_go_on() {
    let mut tab = Tab::new();
    let endless = r#"{"type": "controls_whileUntil", "id": "loop", "fields": {"MODE": "WHILE"}, "inputs": {"BOOL":
                      {"block": {"type": "logic_boolean", "fields": {"BOOL": "TRUE"}}}}}"#;
    let mut run = tab.begin(&workspace(endless), RunMode::Running);
    for _ in 0..300 {
        assert_eq!(run.poll(tab.arm.now(), &mut tab.client), ProgramProgress::Running);
        tab.pass(1);
    }
    assert_eq!(run.block().map(|block| &**block), Some("loop"));
    run.stop(tab.arm.now(), &mut tab.client);
    tab.pass(60);
    assert_eq!(tab.client.stop_progress(), StopProgress::Holds);
}

#[test]
fn a_page_that_pauses_ends_its_program() {
    let mut tab = Tab::new();
    let (end, _) = tab.run(&long_move(), |picture, tab| {
        if picture == 60 {
            for _ in 0..200 {
                tab.arm.advance(10_000.0, || true);
            }
        }
    });
    assert!(matches!(end, ProgramProgress::Failed(ProgramFailure::Arm(PlayFailure::Paused(_)))), "{end:?}");
}

/// The members of a block that moves the arm or switches the pump, without the braces of the block.
fn any_block() -> impl Strategy<Value = String> {
    let number =
        |number: i32| format!(r#"{{"block": {{"type": "math_number", "fields": {{"NUM": {number}}}}}}}"#);
    let joint = (1..=7, 40..=140, 2..=60).prop_map(move |(joint, angle, speed)| {
        let (angle, speed) = (number(angle), number(speed));
        format!(
            r#""type": "arm_move_joint", "fields": {{"JOINT": "{joint}"}}, "inputs": {{"ANGLE": {angle}, "SPEED": {speed}}}"#
        )
    });
    let tip = (prop::bool::ANY, -90..=90, 150..=220, 40..=120, 5..=60).prop_map(move |(is_line, x, y, z, speed)| {
        let kind = if is_line { "arm_line" } else { "arm_move_tip" };
        let [x, y, z, speed] = [x, y, z, speed].map(number);
        format!(
            r#""type": "{kind}", "fields": {{"TOOL": "DOWN"}}, "inputs": {{"X": {x}, "Y": {y}, "Z": {z}, "SPEED": {speed}}}"#
        )
    });
    let state = prop::bool::ANY.prop_map(|is_on| {
        format!(r#""type": "arm_vacuum", "fields": {{"STATE": "{}"}}"#, if is_on { "ON" } else { "OFF" })
    });
    let grip = Just(r#""type": "arm_grip", "fields": {"STATE": "CLOSE"}"#.to_owned());
    prop_oneof![4 => joint, 3 => tip, 1 => state, 1 => grip]
}

fn any_program() -> impl Strategy<Value = String> {
    vec(any_block(), 1..6).prop_map(|blocks| {
        let below = |below: String, block: &String| format!(r#"{{"block": {{{block}, "next": {below}}}}}"#);
        let stack = blocks.iter().rev().fold("null".to_owned(), below);
        let endless = format!(
            r#"{{"type": "controls_whileUntil", "id": "loop", "fields": {{"MODE": "WHILE"}}, "inputs": {{"BOOL":
               {{"block": {{"type": "logic_boolean", "fields": {{"BOOL": "TRUE"}}}}}}, "DO": {stack}}}}}"#
        );
        workspace(&endless)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever the program does, the arm holds soon after a stop and does not move again.
    #[test]
    fn after_a_stop_at_any_moment_the_arm_never_goes_on(workspace in any_program(), moment in 0_u32..900) {
        let mut tab = Tab::new();
        let before = tab.registers();
        let mut run = Some(tab.begin(&workspace, RunMode::Running));
        for _ in 0..moment {
            let progress = run.as_mut().map(|run| run.poll(tab.arm.now(), &mut tab.client));
            if progress.is_some_and(|progress| progress != ProgramProgress::Running) {
                run = None;
            }
            tab.pass(1);
        }
        let at_stop = tab.angles();
        // The arm may have refused a random target. Then the program is over, and the arm stands.
        if let Some(run) = run {
            run.stop(tab.arm.now(), &mut tab.client);
            tab.pass(40);
            prop_assert_eq!(tab.client.stop_progress(), StopProgress::Holds);
        }
        let held = tab.angles();
        tab.pass(300);
        for ((stop, held), end) in at_stop.iter().zip(held).zip(tab.angles()) {
            // 12 degrees: the distance at 60 degrees/s while the stop is on the line.
            prop_assert!((stop - held).abs() < 12.0, "{} to {}", stop, held);
            prop_assert!((held - end).abs() < 0.7, "{} to {}", held, end);
        }
        prop_assert_eq!(tab.registers(), before);
    }
}
