//! The editor of block programs: how it is loaded, and how it looks.

use browser_tests::Viewed;
use browser_tests::page::{DARK, DESKTOP, PHONE};
use serde_json::json;
use system_tests::wait::wait_for;

use super::programs::{examples, open_file, open_programs, programs};

#[test]
fn an_editor_that_cannot_be_loaded_is_told_and_loaded_once_at_the_next_attempt() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.call("Network.enable", json!({}));
    page.call("Network.setBlockedURLs", json!({"urls": ["*programs.js"]}));
    page.click("[data-action=programs]");
    page.wait_for_text("#notice", "The editor of programs cannot be loaded.");
    page.call("Network.setBlockedURLs", json!({"urls": []}));
    // Close, open and close the editor, and open it again, while the script is being loaded.
    page.evaluate("[1, 2, 3].forEach(() => document.querySelector('[data-action=programs]').click())");
    open_programs(&mut page);
    assert_eq!(page.number("document.querySelectorAll('#blocks .injectionDiv').length"), 1.0);
}

#[test]
fn the_editor_speaks_chinese_and_fits_a_phone() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    page.click("[data-action=add-pose]");
    page.wait_for_text("#python", "arm.pose(90");
    page.click("[data-action=language]");
    page.wait_for_text("#blocks", "机械臂");
    page.wait_for_text("#python", "arm.pose(90");
    page.show_on(PHONE);
    let width = page.number("document.documentElement.scrollWidth");
    assert!(width <= f64::from(PHONE.width), "the page is {width} wide");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn the_editor_has_the_colours_that_the_user_prefers() {
    let viewed = Viewed::without_arm();
    let mut page = programs(&viewed);
    // The numbers of a pose are fields of the block itself.
    let pose = examples().into_iter().find(|path| path.ends_with("joints.json")).expect("it is there");
    open_file(&mut page, &pose, "arm.pose");
    for (screen, colour) in
        [(DESKTOP, "rgb(255, 255, 255)"), (DARK, "rgb(27, 33, 42)"), (DESKTOP, "rgb(255, 255, 255)")]
    {
        page.show_on(screen);
        wait_for("the editor has its colours", || {
            let ground = "getComputedStyle(document.querySelector('#blocks .blocklySvg')).backgroundColor";
            let found = page.evaluate(ground);
            if found == colour { Ok(()) } else { Err(format!("{found} on {screen:?}")) }
        });
        let fields = "[...new Set([...document.querySelectorAll('.blocklyNumberField')].flatMap(field =>
            [...field.querySelectorAll('rect, text')].map(part => getComputedStyle(part).fill)))].sort().join(' ')";
        // White fields with grey text.
        assert_eq!(page.evaluate(fields), "rgb(255, 255, 255) rgb(87, 94, 117)", "{screen:?}");
    }
}
