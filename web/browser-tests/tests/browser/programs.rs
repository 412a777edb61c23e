//! Programs of blocks: every kind of block, stops, reloads of the page, files and links.

use std::path::{Path, PathBuf};

use browser_tests::{Page, Viewed};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use system_tests::wait::wait_for;

/// The id of the lit block; empty if no block is lit.
pub(crate) const LIT: &str = "document.querySelector('.blocklyHighlighted')?.dataset.id ?? ''";
/// A program that turns joint 1 to 180 degrees at 1.9 degrees/s: from 90 degrees it takes 47 s.
pub(crate) const SLOW: &str = r#"{"blocks": {"blocks": [{"type": "arm_start", "id": "start", "next": {"block":
    {"type": "arm_move_joint", "id": "turn", "fields": {"JOINT": "1"}, "inputs": {
    "ANGLE": {"block": {"type": "math_number", "fields": {"NUM": 180}}},
    "SPEED": {"block": {"type": "math_number", "fields": {"NUM": 2}}}}}}}]}}"#;

/// Opens the programs, and waits until the editor is there.
pub(crate) fn open_programs(page: &mut Page) {
    page.click("[data-action=programs]");
    wait_for("the editor is there", || {
        let blocks = page.evaluate("document.querySelectorAll('#blocks .blocklyDraggable').length");
        if blocks.as_u64() > Some(0) { Ok(()) } else { Err(format!("{blocks} blocks; {:?}", page.errors())) }
    });
}

/// Opens the page and the editor of programs.
pub(crate) fn programs(viewed: &Viewed) -> Page {
    let mut page = viewed.open();
    open_programs(&mut page);
    page
}

/// Opens a program, and waits until it is shown as Python with this part.
pub(crate) fn open_file(page: &mut Page, file: &Path, part: &str) {
    page.choose_file("#open-program", &file.canonicalize().expect("a file"));
    wait_for(&format!("the program is shown as {part}"), || {
        let python = page.text("#python");
        if python.contains(part) {
            Ok(())
        } else {
            Err(format!("{python}; {}; {:?}", page.text("#notice"), page.errors()))
        }
    });
}

pub(crate) fn open_text(viewed: &Viewed, page: &mut Page, program: &str, part: &str) {
    let file = viewed.path("program-to-open.json");
    std::fs::write(&file, program).expect("a file");
    open_file(page, &file, part);
}

pub(crate) fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../block-programs/examples");
    let files = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    files.filter(|path| path.extension().is_some_and(|extension| extension == "json")).collect()
}

/// A test of `block-programs` checks that the examples have every kind of block.
#[test]
fn every_block_does_in_the_page_what_its_python_does() {
    let viewed = Viewed::without_arm();
    for example in examples() {
        let mut page = programs(&viewed);
        page.click("[data-action=speed][data-value='1000']");
        let python = std::fs::read_to_string(example.with_extension("py")).expect("a file");
        open_file(&mut page, &example, &python);
        page.click("[data-action=run]");
        page.wait_for_text("#program-state", "The program has ended.");
        assert_eq!(page.text("#notice"), "", "{}", example.display());
        page.pass(1.0);
        let end = std::fs::read_to_string(example.with_extension("end.txt")).expect("a file");
        let end = end.split_whitespace().map(|word| word.parse::<f64>().expect("an angle"));
        for (measured, end) in page.measured().iter().zip(end) {
            assert!((measured - end).abs() < 0.5, "{}: {measured} {end}", example.display());
        }
        assert_eq!(page.errors(), [""; 0]);
    }
}

#[test]
fn a_step_runs_one_block_and_the_next_one_is_lit() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    let program = r#"{"blocks": {"blocks": [{"type": "arm_start", "id": "start", "next": {"block":
        {"type": "arm_vacuum", "id": "one", "fields": {"STATE": "ON"}, "next": {"block":
        {"type": "arm_vacuum", "id": "two", "fields": {"STATE": "OFF"}}}}}}]}}"#;
    open_text(&viewed, &mut page, program, "vacuum");
    for (lit, pump) in [("one", 0), ("two", 1)] {
        page.click("[data-action=step]");
        wait_for_lit(&mut page, lit);
        page.wait_for_text("#program-state", "The program waits before the lit block.");
        assert_eq!(page.state()["registers"][31], pump);
    }
    page.click("[data-action=step]");
    page.wait_for_text("#program-state", "The program has ended.");
    assert_eq!((page.evaluate(LIT), page.state()["registers"][31].as_u64()), ("".into(), Some(0)));
}

/// Begins [`SLOW`], and waits until joint 1 turns.
fn run_slowly(viewed: &Viewed, page: &mut Page) {
    open_text(viewed, page, SLOW, "speed=2");
    page.click("[data-action=run]");
    page.wait_for_state("joint 1 turns", |state| state["measured"][0].as_f64() > Some(91.0));
    wait_for_lit(page, "turn");
}

fn wait_for_lit(page: &mut Page, block: &str) {
    wait_for("the block is lit", || {
        let found = page.evaluate(LIT);
        if found == block { Ok(()) } else { Err(found.to_string()) }
    });
}

/// Checks that the program was ended, and that the arm stands.
fn check_it_stands(page: &mut Page) {
    page.wait_for_text("#program-state", "The program was ended.");
    page.pass(0.5);
    let held = page.measured();
    page.pass(2.0);
    let angles = held.into_iter().zip(page.measured());
    assert!(angles.into_iter().all(|(held, now)| (held - now).abs() < 1.0), "{held:?}");
}

#[test]
fn the_space_bar_and_the_button_stop_a_program_from_within_the_editor() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    for is_key in [true, false] {
        run_slowly(&viewed, &mut page);
        page.focus("#blocks .blocklySvg, #blocks [tabindex]");
        if is_key {
            page.key(" ");
        } else {
            page.click("#program [data-action=stop]");
        }
        page.wait_for_text("#state", "Stopped: the arm holds.");
        check_it_stands(&mut page);
        page.click("[data-action=home]");
        page.wait_until_joint_rests(1, 90.0);
    }
}

#[test]
fn a_program_that_loops_without_end_leaves_the_page_alive_and_a_stop_ends_it_at_any_moment() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    let endless = |body: &str| {
        format!(
            r#"{{"blocks": {{"blocks": [{{"type": "arm_start", "id": "start", "next": {{"block":
            {{"type": "controls_whileUntil", "id": "loop", "fields": {{"MODE": "WHILE"}}, "inputs": {{"BOOL":
            {{"block": {{"type": "logic_boolean", "fields": {{"BOOL": "TRUE"}}}}}}{body}}}}}}}}}]}}}}"#
        )
    };
    open_text(&viewed, &mut page, &endless(""), "while True:\n        pass");
    page.click("[data-action=run]");
    let frames = page.number("window.sevenbot.frame_count()");
    wait_for("pictures go on", || {
        let now = page.number("window.sevenbot.frame_count()");
        if now > frames + 20.0 { Ok(()) } else { Err(format!("{now}")) }
    });
    page.key(" ");
    page.wait_for_text("#program-state", "The program was ended.");
    // No program begins before the stop is confirmed.
    page.wait_for_text("#state", "Stopped: the arm holds.");

    let number =
        |number: u32| format!(r#"{{"block": {{"type": "math_number", "fields": {{"NUM": {number}}}}}}}"#);
    let turn = |angle: u32, next: &str| {
        format!(
            r#"{{"block": {{"type": "arm_move_joint", "fields": {{"JOINT": "1"}}, "inputs": {{"ANGLE": {}, "SPEED": {}}}{next}}}}}"#,
            number(angle),
            number(60)
        )
    };
    let back_and_forth = turn(60, &format!(r#", "next": {}"#, turn(120, "")));
    open_text(&viewed, &mut page, &endless(&format!(r#", "DO": {back_and_forth}"#)), "speed=60");
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    for _ in 0..5 {
        page.click("[data-action=run]");
        page.wait_until_said("#state", "A program runs.");
        page.pass(f64::from(random.next_u32() % 3_000) / 1e3);
        page.key(" ");
        page.wait_for_text("#state", "Stopped: the arm holds.");
        check_it_stands(&mut page);
    }
}

#[test]
fn what_else_moves_the_arm_ends_a_program_and_a_program_ends_that() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    run_slowly(&viewed, &mut page);
    page.focus("#joint-1");
    page.keys("ArrowLeft", 10);
    page.wait_for_text("#program-state", "The program was ended.");
    page.pass(1.0);
    page.click("[data-action=park]");
    page.wait_until_said("#state", "The arm is being parked.");
    page.wait_for_text("#notice", "Parked: the motors are off");
    page.click("[data-action=motors][data-value='1']");
    page.wait_until_ready();
    // Both clicks at once: on a busy machine the arm may be parked before a second click.
    page.evaluate("['park', 'run'].forEach(name => document.querySelector(`[data-action=${name}]`).click())");
    page.wait_for_text("#state", "A program runs.");
    page.click("[data-action=park]");
    page.wait_for_text("#program-state", "The program was ended.");
    page.wait_for_text("#notice", "Parked: the motors are off");
}

#[test]
fn a_stop_of_another_program_ends_a_program() {
    let viewed = Viewed::with_arm();
    let mut page = programs(&viewed);
    open_text(&viewed, &mut page, SLOW, "speed=2");
    viewed.stop_by_another_program(&mut page, "run");
    check_it_stands(&mut page);
}

#[test]
fn a_program_is_kept_over_a_reload_saved_and_opened_by_a_link() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    let example = examples().into_iter().find(|path| path.ends_with("functions.json")).expect("it is there");
    let python = std::fs::read_to_string(example.with_extension("py")).expect("a file");
    open_file(&mut page, &example, &python);
    page.download_to(&viewed.path(""));
    for (action, name) in [("save-program", "program.json"), ("save-python", "program.py")] {
        page.click(&format!("[data-action={action}]"));
        let saved = wait_for("the file is saved", || {
            std::fs::read_to_string(viewed.path(name))
                .ok()
                .filter(|text| !text.is_empty())
                .ok_or("not yet".to_owned())
        });
        assert!(saved == python || saved.contains("arm_start"), "{saved}");
    }
    page.click("[data-action=share]");
    wait_for("the link is there", || {
        if page.evaluate("document.querySelector('#link-row').hidden") == false {
            Ok(())
        } else {
            Err("not yet".to_owned())
        }
    });
    let link = page.evaluate("document.querySelector('#program-link').value");
    let link = link.as_str().expect("a link").to_owned();
    assert!(
        link.starts_with(viewed.origin()) && link.contains("/#program=") && !link.contains("token"),
        "{link}"
    );
    println!("a link with {} characters", link.len());
    assert!(link.len() < 1_500, "{} characters", link.len());

    page.reload();
    open_programs(&mut page);
    page.wait_for_text("#python", &python);

    // The next page waits until this one is closed.
    drop(page);
    let mut other = Page::open(&link);
    other.key("Escape");
    other.wait_for_text("#python", &python);
    assert_eq!(other.evaluate("location.hash"), "");
    let requests = other.requests();
    let is_own = |url: &String| url.starts_with(viewed.origin()) || url.starts_with("data:");
    assert!(requests.iter().all(is_own), "{requests:?}");
    assert_eq!(other.errors(), [""; 0]);
    drop(other);
    let mut cut_off = Page::open(&link[..link.len() - 20]);
    cut_off.wait_for_text("#notice", "This address holds no program");
}

#[test]
fn a_block_is_dragged_a_pose_recorded_and_a_mistake_told_at_its_block() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    page.click("[data-action=add-pose]");
    page.wait_for_text("#python", "arm.pose(90");
    page.click("#blocks .blocklyToolboxCategory");
    let flyout = "#blocks .blocklyFlyout .blocklyDraggable";
    wait_for("the blocks to choose from are there", || {
        let count = page.evaluate(&format!("document.querySelectorAll('{flyout}').length"));
        if count.as_u64() > Some(5) { Ok(()) } else { Err(count.to_string()) }
    });
    let place = |page: &mut Page, script: &str| {
        let place = page.evaluate(script);
        [place[0].as_f64().expect("a number"), place[1].as_f64().expect("a number")]
    };
    // The first block of the list is "move joint". It goes below the pose.
    let from = place(
        &mut page,
        &format!("(r => [r.x + 12, r.y + 12])(document.querySelector('{flyout}').getBoundingClientRect())"),
    );
    let to = place(
        &mut page,
        "(r => [r.x + 16, r.bottom + 16])(Blockly.getMainWorkspace().getBlocksByType('arm_pose')[0].getSvgRoot().getBoundingClientRect())",
    );
    page.drag(from, to);
    page.wait_for_text("#python", "speed=60");
    page.evaluate(
        "Blockly.getMainWorkspace().getBlocksByType('arm_move_joint')[0].getInputTargetBlock('ANGLE').setFieldValue(999, 'NUM')",
    );
    page.wait_for_text("#python", "999");
    page.click("[data-action=speed][data-value='1000']");
    page.click("[data-action=run]");
    page.wait_for_text("#notice", "The program ended early: 999 is out of range: use 0 to 180 °.");
    let warned = page.evaluate(
        "Blockly.getMainWorkspace().getBlocksByType('arm_move_joint')[0].getIcon('warning')?.getText()",
    );
    assert!(warned.as_str().is_some_and(|text| text.contains("out of range")), "{warned}");
    assert_eq!(page.errors(), [""; 0]);
}
