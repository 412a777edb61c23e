//! The pictures of the documents: `cargo test -p browser-tests --test browser -- pictures --ignored`.

use std::path::Path;

use browser_tests::page::{DARK, DESKTOP, PHONE};
use browser_tests::picture::{Picture, write_animation};
use browser_tests::{ClassRun, Page, Viewed};

use super::programs::{open_file, open_programs};

fn keep(page: &mut Page, name: &str) {
    std::fs::write(folder().join(name), page.screenshot()).expect("a file");
}

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs"))
}

#[test]
#[ignore = "writes docs/web-*.png"]
fn write_the_pictures() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.focus("#joint-1");
    page.keys("ArrowRight", 80);
    page.focus("#joint-3");
    page.keys("ArrowRight", 40);
    page.pass(3.0);
    keep(&mut page, "web-light.png");
    page.show_on(DARK);
    keep(&mut page, "web-dark.png");
    page.show_on(PHONE);
    page.pass(0.2);
    keep(&mut page, "web-phone.png");
    page.show_on(DESKTOP);
    page.choose("#fault-joint", "3");
    page.click("[data-action=break]");
    page.wait_for_text("#state", "oint 3");
    page.evaluate("scrollTo(0, 0)");
    page.pass(1.0);
    keep(&mut page, "web-fault.png");
}

#[test]
#[ignore = "writes docs/web-room.png"]
fn write_the_picture_of_a_room() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.click("[data-action=exercises]");
    page.choose("#exercise-choice", "7");
    page.click("[data-action=begin-exercise]");
    page.click("[data-action=solution]");
    page.wait_for_text("#python", "straight=True");
    page.click("[data-action=run]");
    page.wait_for_text("#exercise-goals", "✓ Blue stands on red");
    page.wait_for_text("#exercise-state", "Solved!");
    page.pass(2.0);
    page.centre("#scene");
    keep(&mut page, "web-room.png");
}

/// A preview half way, and the same in Chinese on a dark screen.
#[test]
#[ignore = "writes docs/web-programs.png and docs/web-chinese.png"]
fn write_the_pictures_of_programs() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    open_programs(&mut page);
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../block-programs/examples");
    open_file(&mut page, &examples.join("joints.json"), "arm.pose");
    page.click("[data-action=preview]");
    page.wait_for_text("#moment-text", " s · ");
    page.focus("#moment");
    page.keys("ArrowRight", 60);
    page.evaluate("scrollTo(0, 0)");
    page.pass(1.0);
    keep(&mut page, "web-programs.png");
    page.click("[data-action=language]");
    page.show_on(DARK);
    page.evaluate("scrollTo(0, 0)");
    page.pass(1.0);
    keep(&mut page, "web-chinese.png");
}

#[test]
#[ignore = "writes docs/web.png"]
fn write_the_animation() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.click("[data-action=speed][data-value='0.25']");
    page.evaluate("scrollTo(0, 0)");
    let mut pictures: Vec<Picture> = Vec::new();
    for (joint, key) in [(1, "End"), (3, "Home"), (1, "Home"), (3, "End")] {
        page.evaluate(&format!("document.querySelector('#joint-{joint}').focus({{preventScroll: true}})"));
        page.key(key);
        for _ in 0..6 {
            page.pass(0.15);
            pictures.push(page.picture_of([30.0, 141.0], [800.0, 430.0]).half());
        }
    }
    write_animation(&folder().join("web.png"), &pictures, 6);
}

#[test]
#[ignore = "writes docs/class-*.png"]
fn write_the_pictures_of_a_class() {
    let class = ClassRun::start(true);
    let mut teacher = class.open_teacher();
    let poses = [("Mia", 120), ("Leo", 60), ("Ida", 150), ("Lin", 90), ("Tom", 40), ("Zoe", 105)];
    let mut pupils = poses.map(|(name, base)| {
        let mut page = class.join(&teacher, name);
        page.type_into("#target-1", &base.to_string());
        page.type_into("#target-3", &(50 + base / 3).to_string());
        page
    });
    pupils[1].choose("#fault-joint", "2");
    pupils[1].choose("#fault-kind", "stuck");
    pupils[1].click("[data-action=break]");
    pupils[1].type_into("#target-2", "120");
    pupils[2].click("[data-action=exercises]");
    pupils[2].click("[data-action=begin-exercise]");
    teacher.wait_for_text("#arm-state", "nobody has it");
    teacher.click("#tiles li:first-child button");
    pupils[0].wait_for_text("#notice", "The teacher gave you the class's real arm.");
    pupils[0].wait_until_ready();
    pupils[1].wait_for_text("#state", "oint 2");
    teacher.type_into("#say", "Look at the real arm in front: Mia shows her program.");
    teacher.wait_for_text("#said", "Look at the real arm");
    teacher.wait_for_text("#tiles", "a joint is blocked");
    keep(&mut teacher, "class-teacher.png");
    pupils[0].wait_for_text("#class-text", "Look at the real arm");
    pupils[0].evaluate("scrollTo(0, 0)");
    keep(&mut pupils[0], "class-pupil.png");
}
