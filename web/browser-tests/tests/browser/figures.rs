//! The figures of docs/web.md: `taskset -c 0 cargo test -p browser-tests --test browser -- figures --ignored --nocapture` on one core.

use browser_tests::{Page, Viewed};
use system_tests::wait::wait_for;

/// Stores the time from the request of the page to its first picture, in milliseconds. After a reload, appends the new time.
const FIRST_PICTURE: &str = "
    (function look() {
      if (!(window.sevenbot?.frame_count() > 0)) return setTimeout(look, 1);
      sessionStorage.firstPictures = (sessionStorage.firstPictures ?? '') + ' ' + Math.round(performance.now());
    })();";
/// The time over which [`rate`] counts, in seconds.
const SECONDS: f64 = 5.0;

/// The increase of a counter of the page per second.
fn rate(page: &mut Page, counter: &str) -> f64 {
    let script = format!(
        "(async () => {{ const [time, count] = [performance.now(), {counter}]; \
         await new Promise(done => setTimeout(done, {SECONDS} * 1000)); \
         return ({counter} - count) / (performance.now() - time) * 1000; }})()"
    );
    page.number(&script)
}

/// Milliseconds from an input of a slider to the picture in which the arm has begun to move.
fn latency(page: &mut Page, degrees: u32) -> f64 {
    page.number(&format!(
        "new Promise(done => {{ const angle = () => JSON.parse(window.sevenbot.state()).measured[0]; \
         const slider = document.querySelector('#joint-1'); const [start, before] = [performance.now(), angle()]; \
         slider.value = {degrees}; slider.dispatchEvent(new Event('input', {{bubbles: true}})); \
         const look = () => Math.abs(angle() - before) > 0.05 \
           ? requestAnimationFrame(() => done(performance.now() - start)) : requestAnimationFrame(look); look(); }})"
    ))
}

#[test]
#[ignore = "measures"]
fn measure() {
    let viewed = Viewed::without_arm();
    let mut page = Page::open_after(&viewed.url, FIRST_PICTURE);
    page.evaluate("void setTimeout(() => location.reload(), 10)");
    let times = wait_for("two first pictures", || {
        let times = page.try_evaluate("sessionStorage.firstPictures.trim().split(' ').map(Number)")?;
        if times[1].is_number() { Ok(times) } else { Err(times.to_string()) }
    });
    println!("first picture: {} ms after the browser's start, {} ms when loaded again", times[0], times[1]);
    page.key("Escape");
    page.wait_for_text("#state", "The arm is ready.");
    let mut latencies: Vec<f64> = (0..20)
        .map(|turn| {
            let latency = latency(&mut page, if turn % 2 == 0 { 60 } else { 120 });
            page.pass(1.0);
            latency
        })
        .collect();
    latencies.sort_by(f64::total_cmp);
    println!("slider to moved picture: median {:.0} ms, worst {:.0} ms of 20", latencies[10], latencies[19]);
    page.evaluate(
        "void setInterval(() => { const slider = document.querySelector('#joint-1'); \
         slider.value = 180 - slider.value; slider.dispatchEvent(new Event('input', {bubbles: true})); }, 700)",
    );
    println!("while the arm moves: {:.0} pictures/s", rate(&mut page, "window.sevenbot.frame_count()"));
    page.click("[data-action=speed][data-value='1000']");
    let times = rate(&mut page, "JSON.parse(window.sevenbot.state()).time") / 1e6;
    let pictures = rate(&mut page, "window.sevenbot.frame_count()");
    println!("as fast as possible: {times:.0} times real time, {pictures:.0} pictures/s");
}
