//! Ten programs of three kinds share one arm in real time: each reply reaches the program that asked for it.
//!
//! The test lasts `SERVE_LOAD_SECONDS`, by default 5 s. A quarter of an hour:
//!
//! ```sh
//! SERVE_LOAD_SECONDS=900 cargo test -p system-tests --test system serve::load -- --nocapture
//! ```

use std::fmt::Debug;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::ops::AddAssign;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use system_tests::frames::{reply, with_checksum};
use system_tests::registers::{FEEDBACK_FREQUENCY, PRESENT_POSITION, SPEED, TIME};
use system_tests::{ArmClient, read_request, write_request};

use super::line_history::LineHistory;
use super::served::{LOCAL_PAGE, Served, WebClient, names};

/// A reply that has not come after this time is lost.
const LOST: Duration = Duration::from_secs(30);
/// Register of the rate of angle reports in map 2.1. The reports hold the registers behind it.
const ANGLE_FEEDBACK_FREQUENCY: u8 = 82;

/// The most faults of a program that are described. After one crossed reply, all following replies are wrong, too.
const MOST_DESCRIBED: usize = 5;

/// What one program, or all of them, sent and received.
#[derive(Clone, Debug, Default)]
struct Tally {
    /// Writes and reads.
    requests: usize,
    /// Replies with the value that the program wrote directly before.
    replies: usize,
    reports: usize,
    /// Requests without a reply.
    lost: usize,
    /// Replies of another program, and reports that the program did not ask for.
    crossed: usize,
    /// The first faults, in words.
    faults: Vec<String>,
}

/// A read, and what was written directly before.
struct Asked<'a> {
    kind: &'static str,
    register: u8,
    value: u8,
    sent: Instant,
    history: &'a LineHistory,
}

impl Tally {
    /// Counts and describes a fault: a lost reply (`None`), or a frame that is not the reply to the request.
    fn fault(&mut self, asked: &Asked<'_>, received: Option<&dyn Debug>) {
        let (lost, crossed) = if received.is_some() { (0, 1) } else { (1, 0) };
        (self.lost, self.crossed) = (self.lost + lost, self.crossed + crossed);
        if self.faults.len() < MOST_DESCRIBED {
            let Asked { kind, register, value, sent, history } = asked;
            let received = received.map_or("nothing".to_owned(), |received| format!("{received:02x?}"));
            self.faults.push(format!(
                "{kind}, turn {}: {received} for register {register}, {value:02x} written, after {:?}; {}",
                self.replies + self.lost + self.crossed,
                sent.elapsed(),
                history.told(*sent, (*register, 1))
            ));
        }
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.requests += other.requests;
        self.replies += other.replies;
        self.reports += other.reports;
        self.lost += other.lost;
        self.crossed += other.crossed;
        self.faults.extend(other.faults);
    }
}

trait Wire: Send {
    fn send(&mut self, bytes: &[u8]);
    /// The next frame; `None` if none arrives within [`LOST`].
    fn frame(&mut self) -> Option<Vec<u8>>;
}

impl Wire for ArmClient {
    fn send(&mut self, bytes: &[u8]) {
        Self::send(self, bytes);
    }

    fn frame(&mut self) -> Option<Vec<u8>> {
        self.frame_within(LOST)
    }
}

impl Wire for TcpStream {
    fn send(&mut self, bytes: &[u8]) {
        self.write_all(bytes).expect("the server takes bytes");
    }

    fn frame(&mut self) -> Option<Vec<u8>> {
        let mut frame = vec![0; 5];
        self.read_exact(&mut frame).ok()?;
        frame.resize(7 + usize::from(frame[4]), 0);
        self.read_exact(&mut frame[5..]).ok()?;
        Some(frame)
    }
}

/// The map that a program uses: it decides the function code of writes, and the registers and form of reports.
#[derive(Clone, Copy)]
enum Map {
    V22,
    V21,
}

impl Map {
    fn write(self, address: u8, value: u8) -> Vec<u8> {
        match self {
            Self::V22 => write_request(address, &[value]),
            Self::V21 => with_checksum(&[0xAA, 0x77, 4, address, 1, value]),
        }
    }

    /// The write that asks for reports.
    fn subscribe(self, hertz: u8) -> Vec<u8> {
        match self {
            Self::V22 => self.write(FEEDBACK_FREQUENCY, hertz),
            Self::V21 => self.write(ANGLE_FEEDBACK_FREQUENCY, hertz),
        }
    }

    /// The first bytes of a report.
    const fn report(self) -> [u8; 5] {
        match self {
            Self::V22 => [0xAA, 0x77, 3, PRESENT_POSITION, 7],
            Self::V21 => [0xAA, 0x77, 5, ANGLE_FEEDBACK_FREQUENCY + 1, 7],
        }
    }
}

/// A program that writes its own register and reads it back until `end`. `hertz` is the rate of its reports; 0: no reports.
fn frame_program(
    mut wire: impl Wire,
    own: u8,
    (map, hertz): (Map, u8),
    end: Instant,
    history: &LineHistory,
) -> Tally {
    let mut tally = Tally { requests: 1, ..Tally::default() };
    wire.send(&map.subscribe(hertz));
    for value in (1..=100).cycle().take_while(|_| Instant::now() < end) {
        wire.send(&[map.write(own, value), read_request(own, 1)].concat());
        let kind = if matches!(map, Map::V22) { "frames of map 2.2" } else { "frames of map 2.1" };
        let asked = Asked { kind, register: own, value, sent: Instant::now(), history };
        tally.requests += 2;
        match next_reply(&mut wire, map, hertz, &mut tally.reports) {
            None => tally.fault(&asked, None),
            Some(frame) if frame == reply(own, &[value]) => tally.replies += 1,
            Some(frame) => tally.fault(&asked, Some(&frame)),
        }
    }
    tally
}

/// The next frame that is no report; `None` if none arrives within [`LOST`], even if reports do.
fn next_reply(wire: &mut impl Wire, map: Map, hertz: u8, reports: &mut usize) -> Option<Vec<u8>> {
    let end = Instant::now() + LOST;
    while Instant::now() < end {
        let frame = wire.frame()?;
        if hertz == 0 || !frame.starts_with(&map.report()) {
            return Some(frame);
        }
        *reports += 1;
    }
    None
}

/// A program over the WebSocket. A page also gets an answer to each write.
fn web_program(mut client: WebClient, own: u8, is_page: bool, end: Instant, history: &LineHistory) -> Tally {
    let mut tally = Tally::default();
    for value in (1..=100_u8).cycle().take_while(|_| Instant::now() < end) {
        client.send(&format!(r#"{{"cmd":"write","id":{own},"num":1,"value":[{value}]}}"#));
        client.send(&format!(r#"{{"cmd":"read","id":{own},"num":1}}"#));
        let kind = if is_page { "page" } else { "maker's program" };
        let asked = Asked { kind, register: own, value, sent: Instant::now(), history };
        tally.requests += 2;
        if is_page {
            match client.receive() {
                Some(answer) if answer["message"] == "Values written" => {}
                other => tally.fault(&asked, other.as_ref().map(|it| it as _)),
            }
        }
        match client.receive() {
            None => tally.fault(&asked, None),
            Some(answer) if answer["data"] == serde_json::json!([value]) => tally.replies += 1,
            Some(answer) => tally.fault(&asked, Some(&answer)),
        }
    }
    tally
}

#[test]
fn ten_clients_of_three_kinds_lose_nothing_and_cross_nothing() {
    let seconds = std::env::var("SERVE_LOAD_SECONDS").map_or(5, |text| text.parse().expect("a number"));
    let history = Arc::new(LineHistory::default());
    let watching = Arc::clone(&history);
    let served = Served::start_watched(4, &[], Box::new(move |passing| watching.note(passing)));
    let history = &*history;
    let end = Instant::now() + Duration::from_secs(seconds);
    let tallies: Vec<(&str, Tally)> = thread::scope(|scope| {
        let mut programs = Vec::new();
        let forms = [(Map::V22, 0), (Map::V21, 0), (Map::V22, 50), (Map::V21, 30)];
        for ((name, own), (map, hertz)) in names(4).zip(SPEED..).zip(forms) {
            let wire = served.open(&name);
            let run = move || ("pseudo-terminal", frame_program(wire, own, (map, hertz), end, history));
            programs.push(scope.spawn(run));
        }
        for ((map, hertz), own) in
            [(Map::V22, 0), (Map::V22, 20), (Map::V21, 10)].into_iter().zip(SPEED + 4..)
        {
            let wire = served.connect();
            wire.set_read_timeout(Some(LOST)).expect("a timeout");
            programs.push(scope.spawn(move || ("TCP", frame_program(wire, own, (map, hertz), end, history))));
        }
        for (is_page, own) in [false, false, true].into_iter().zip(TIME..) {
            let headers: &[_] = if is_page { &[LOCAL_PAGE] } else { &[] };
            let client = WebClient::connect(&served, headers).expect("accepted");
            programs
                .push(scope.spawn(move || ("WebSocket", web_program(client, own, is_page, end, history))));
        }
        programs.into_iter().map(|program| program.join().expect("no program fails")).collect()
    });
    let mut total = Tally::default();
    for (kind, tally) in &tallies {
        println!("{kind:>15}: {tally:?}");
        total += tally.clone();
    }
    println!("{seconds} s, all: {total:?}");
    assert_eq!((total.lost, total.crossed), (0, 0), "lost and crossed: {:#?}", total.faults);
    assert!(tallies.iter().all(|(_, tally)| tally.replies > 0));
    assert!(tallies.iter().filter(|(_, tally)| tally.reports > 0).count() == 4, "four programs want reports");
}
