//! The page as it opens: requests, errors, names, the keyboard, colours and sizes.

use browser_tests::page::{DARK, DESKTOP, PHONE};
use browser_tests::{Page, Viewed};
use serde_json::json;
use system_tests::wait::wait_for;

/// Everything that a person can operate and see.
const CONTROLS: &str = "[...document.querySelectorAll('button, select, input, summary, [tabindex]')]\
                        .filter(e => !e.disabled && e.checkVisibility())";

#[test]
fn the_page_opens_without_errors_and_requests_nothing_from_elsewhere() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let requests = page.requests();
    assert!(requests.len() >= 5, "{requests:?}");
    assert!(requests.iter().all(|url| url.starts_with(viewed.origin())), "{requests:?}");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn light_and_dark_differ_and_a_phone_needs_no_sideways_scrolling() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let light = page.picture();
    assert!(light.colours() > 100, "{} colours", light.colours());
    page.show_on(DARK);
    wait_for("the picture is dark", || {
        let differences = light.differences(&page.picture());
        if differences > light.pixels.len() / 2 { Ok(()) } else { Err(format!("{differences} pixels")) }
    });
    page.show_on(PHONE);
    for language in ["English", "Chinese"] {
        let width = page.number("document.documentElement.scrollWidth");
        assert!(width <= f64::from(PHONE.width), "in {language} the page is {width} wide");
        page.click("[data-action=language]");
    }
}

/// Rules of WCAG 2 that need no judgement: names, structure and contrast, in both languages and both colour schemes.
#[test]
fn the_page_keeps_the_rules_of_accessibility() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.evaluate("document.querySelectorAll('details').forEach(panel => panel.open = true)");
    page.wait_for_text("#registers", "baud-rate");
    for _ in 0..2 {
        check_names(&mut page);
        check_structure(&mut page);
        for screen in [DESKTOP, DARK] {
            page.show_on(screen);
            check_contrast(&mut page);
        }
        page.click("[data-action=language]");
    }
    assert_eq!(page.evaluate("document.documentElement.lang"), "en");
}

/// Checks that a screen reader gets a name for each control and picture.
fn check_names(page: &mut Page) {
    const ROLES: [&str; 8] =
        ["button", "slider", "combobox", "textbox", "checkbox", "link", "spinbutton", "image"];
    let nodes = page.accessible();
    let controls: Vec<_> = nodes.iter().filter(|(role, _)| ROLES.contains(&role.as_str())).collect();
    assert!(controls.len() > 60, "{nodes:?}");
    let nameless: Vec<_> = controls.iter().filter(|(_, name)| name.is_empty()).collect();
    assert!(nameless.is_empty(), "{nameless:?}");
    for role in ["banner", "main", "status"] {
        assert!(nodes.iter().any(|(found, _)| found == role), "there is no {role}: {nodes:?}");
    }
}

fn check_structure(page: &mut Page) {
    let wrong = page.evaluate(&format!(
        "(() => {{ const wrong = [];\
         const ids = [...document.querySelectorAll('[id]')].map(e => e.id);\
         if (new Set(ids).size != ids.length) wrong.push('an id stands twice');\
         if (!/^(en|zh-CN)$/.test(document.documentElement.lang)) wrong.push('language');\
         if (!document.title) wrong.push('title');\
         if (document.querySelectorAll('h1').length != 1) wrong.push('one h1');\
         for (const e of document.querySelectorAll('[aria-labelledby]'))\
           if (!document.getElementById(e.getAttribute('aria-labelledby'))) wrong.push(e.outerHTML);\
         for (const e of document.querySelectorAll('[data-text]')) if (!e.textContent) wrong.push(e.outerHTML);\
         for (const e of {CONTROLS}) {{\
           if (e.tabIndex > 0) wrong.push('tabindex of ' + e.outerHTML);\
           const r = e.getBoundingClientRect();\
           if (!(e.type == 'file') && (r.width < 24 || r.height < 24)) wrong.push('small: ' + e.outerHTML);\
         }} return wrong; }})()"
    ));
    assert_eq!(wrong, json!([]));
}

/// Checks that each visible text has a contrast of at least 4.5 to its background. Texts in `.quiet` are only for screen readers.
fn check_contrast(page: &mut Page) {
    let wrong = page.evaluate(
        "(() => {\
         const context = Object.assign(document.createElement('canvas'), {width: 1, height: 1}).getContext('2d');\
         const rgba = css => { context.clearRect(0, 0, 1, 1); context.fillStyle = css; context.fillRect(0, 0, 1, 1);\
           return [...context.getImageData(0, 0, 1, 1).data]; };\
         const luminance = c => [0.2126, 0.7152, 0.0722].reduce((sum, share, i) => { const v = c[i] / 255;\
           return sum + share * (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); }, 0);\
         const behind = e => { for (; e; e = e.parentElement) { const c = rgba(getComputedStyle(e).backgroundColor);\
           if (c[3] == 255) return c; } return [255, 255, 255, 255]; };\
         const wrong = [];\
         const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);\
         for (let node; node = walker.nextNode();) { const e = node.parentElement;\
           if (!node.data.trim() || !e.checkVisibility() || e.closest('.quiet')) continue;\
           const [a, b] = [luminance(rgba(getComputedStyle(e).color)), luminance(behind(e))];\
           const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);\
           if (contrast < 4.5) wrong.push(node.data + ': ' + contrast); }\
         return wrong; })()",
    );
    assert_eq!(wrong, json!([]));
}

#[test]
fn the_tab_key_reaches_every_control_and_its_focus_is_seen() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let wanted = page.number(&format!("{CONTROLS}.length"));
    page.evaluate("(document.activeElement.blur(), window.reached = new Set(), window.unseen = [])");
    for _ in 0..=wanted as u32 {
        page.key("Tab");
        page.evaluate(
            "(e => { window.reached.add(e); const label = e.closest('.button') ?? e;\
             if (getComputedStyle(label).outlineStyle == 'none') window.unseen.push(e.outerHTML); })\
             (document.activeElement)",
        );
    }
    let missed =
        page.evaluate(&format!("{CONTROLS}.filter(e => !window.reached.has(e)).map(e => e.outerHTML)"));
    assert_eq!(missed, json!([]));
    assert_eq!(page.evaluate("window.unseen.filter(html => !html.startsWith('<body'))"), json!([]));
}

#[test]
fn a_chinese_browser_sees_chinese_and_the_tour_leads_through_the_page() {
    let viewed = Viewed::without_arm();
    let script = "Object.defineProperty(navigator, 'language', {value: 'zh-CN'})";
    let mut page = Page::open_after(&viewed.url, script);
    assert!(page.text("#stop").contains("停止"));
    page.click("[data-action=language]");
    let mut steps = vec![page.text("#tour-text")];
    while page.evaluate("document.querySelector('dialog').open") == true {
        page.click("[data-action=tour-next]");
        steps.push(page.text("#tour-text"));
    }
    steps.dedup();
    assert_eq!(steps.len(), 5, "{steps:?}");
    page.click("[data-action=tour]");
    assert_eq!(page.evaluate("document.querySelector('dialog').open"), true);
    assert_eq!(page.text("#tour-text"), steps[0]);
    assert_eq!(page.errors(), [""; 0]);
}
