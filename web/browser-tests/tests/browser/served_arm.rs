//! The page with an arm that it does not simulate: behind `sevenbot view`, and on a serial port of the browser.

use browser_tests::{Page, Viewed};
use system_tests::wait::wait_until;

/// Imitates a port of Web Serial, because the browser of a test has no ports. The bytes go through the server to `host-sim`. The
/// line is slow: each reply comes 150 ms late.
const SERIAL_PORT: &str = "
    class Port {
      async open({ baudRate }) {
        window.baudRate = baudRate;
        const socket = new WebSocket('ws://' + location.host + '/frames' + location.search);
        socket.binaryType = 'arraybuffer';
        await new Promise((done, failed) => { socket.onopen = done; socket.onerror = failed; });
        this.readable = new ReadableStream({
          start(stream) {
            socket.onmessage = ({ data }) => setTimeout(() => {
              stream.enqueue(new Uint8Array(data));
              window.usesPort = true;
            }, 150);
          },
        });
        this.writable = new WritableStream({ write: bytes => socket.send(bytes) });
        this.socket = socket;
      }
      async close() { this.socket.close(); }
    }
    Object.defineProperty(navigator, 'serial', { value: { requestPort: async () => new Port() } });";

/// Turns joint 1 by the keyboard, waits until it has turned, and stops the arm. On a slow line the page undoes some presses,
/// because a target that it reads may be older than the last press.
fn check_it_moves(page: &mut Page) {
    let start = page.measured()[0];
    page.focus("#joint-1");
    wait_until("joint 1 turns", || {
        page.keys("ArrowRight", 30);
        page.measured()[0] > start + 5.0
    });
    page.key(" ");
    page.wait_for_text("#state", "Stopped: the arm holds.");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn the_page_shows_moves_and_stops_the_arm_behind_the_server() {
    let viewed = Viewed::with_arm();
    let mut page = viewed.open();
    assert_eq!(page.evaluate("document.querySelector('#source').value"), "server");
    check_it_moves(&mut page);
    let sockets: Vec<_> = page.requests().into_iter().filter(|url| url.starts_with("ws:")).collect();
    assert!(!sockets.is_empty());
    assert!(
        sockets.iter().all(|url| url.starts_with(&viewed.origin().replace("http:", "ws:"))),
        "{sockets:?}"
    );
}

#[test]
fn an_arm_on_a_serial_port_is_shown_moved_and_left() {
    let viewed = Viewed::with_arm();
    let mut page = Page::open_after(&viewed.url, SERIAL_PORT);
    page.key("Escape");
    page.choose("#source", "usb");
    // Until then the page shows the arm behind the server.
    wait_until("the page uses the port", || page.evaluate("window.usesPort") == true);
    page.wait_until_ready();
    assert_eq!(page.evaluate("window.baudRate"), 115_200);
    check_it_moves(&mut page);
    page.choose("#source", "simulator");
    page.wait_until_ready();
    assert!((page.measured()[0] - 90.0).abs() < 1.0, "the simulated arm did not move");
}

#[test]
fn a_browser_without_serial_ports_says_what_to_do() {
    let viewed = Viewed::without_arm();
    let mut page = Page::open_after(&viewed.url, "delete Navigator.prototype.serial");
    page.choose("#source", "usb");
    page.wait_for_text("#notice", "This browser cannot open USB ports.");
    assert_eq!(page.evaluate("document.querySelector('#source').value"), "simulator");
}

#[test]
fn a_page_without_a_token_moves_no_arm() {
    let viewed = Viewed::with_arm();
    let mut page = Page::open(&format!("{}/", viewed.origin()));
    assert_eq!(page.evaluate("document.querySelector('#source').value"), "simulator");
    page.choose("#source", "server");
    page.wait_for_text("#notice", "There is no arm at this address, or the address is an old one.");
    let shown = ["#angle-1", "#tip", "#health"].map(|place| page.text(place));
    assert_eq!(shown, ["unknown", "Tip: unknown", ""], "no value is invented");
    assert_eq!(
        page.evaluate("document.querySelectorAll('[data-action=motors][aria-pressed=true]').length"),
        0
    );
}

#[test]
fn a_page_that_may_only_watch_says_so_and_has_no_controls() {
    let viewed = Viewed::read_only();
    let mut page = Page::open(&viewed.url);
    page.key("Escape");
    let watches = "This page only watches: its server was started with --read-only.";
    page.wait_for_text("#state", watches);
    page.wait_for_state("the arm answers", |state| state["connected"] == true);
    let live =
        "[...document.querySelectorAll('#stop, #joints input, [data-action=home], [data-action=play]')]
        .filter(control => !control.disabled).length";
    assert_eq!(page.evaluate(live), 0);
    page.key(" ");
    page.wait_for_text("#notice", watches);
    assert!(!page.text("#state").contains("Stopped"), "{}", page.text("#state"));
    // The controls of the simulated arm are live.
    page.choose("#source", "simulator");
    page.wait_until_ready();
    assert!(page.number(live) > 7.0);
}

#[test]
fn a_server_that_ends_is_told_with_what_to_do_and_the_notice_can_be_closed() {
    let mut viewed = Viewed::with_arm();
    let mut page = viewed.open();
    viewed.end_server();
    page.wait_for_text("#notice", "The connection ended: `sevenbot view` has ended");
    page.click("[data-action=close-notice]");
    page.pass(0.5);
    assert_eq!(page.text("#notice"), "");
}
