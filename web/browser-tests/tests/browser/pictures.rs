//! The pictures of the documents: `cargo test -p browser-tests --test browser -- pictures --ignored`.

use std::path::Path;

use browser_tests::page::{DARK, DESKTOP, PHONE};
use browser_tests::picture::{Picture, write_animation};
use browser_tests::{Page, Viewed};

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
