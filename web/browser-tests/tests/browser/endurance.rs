//! The memory of the page after ten minutes of virtual time.

use browser_tests::Viewed;
use serde_json::json;

/// How much the memory may grow, in bytes.
const GROWTH: f64 = 3e6;

#[test]
fn ten_minutes_of_the_arm_need_no_more_memory_than_one() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.evaluate("document.querySelectorAll('details').forEach(panel => panel.open = true)");
    page.click("[data-action=speed][data-value='1000']");
    let mut memory = || {
        // The arm moves back and forth, so that frames, plots and pictures are made.
        for key in ["End", "Home"] {
            page.focus("#joint-1");
            page.key(key);
            page.pass(30.0);
        }
        page.call("HeapProfiler.collectGarbage", json!({}));
        page.number("performance.memory.usedJSHeapSize + (await import('/sevenbot_web.js')).memory_size()")
    };
    let first = memory();
    let last = (1..10).map(|_| memory()).last().expect("minutes");
    assert!(last < first + GROWTH, "{first} bytes after one minute, {last} after ten");
    assert_eq!(page.errors(), [""; 0]);
}
