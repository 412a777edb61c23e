//! Frames in words, for `--trace`: what went over the host link, by the names of the register table.
//!
//! ```text
//!   -> read present_position 1..7
//!   <- present_position 1..7 = 90 90 65 90 90 90 80 °
//!   -> write eeprom_lock = 0, motor_state = 1
//!   -> 3 bytes that are no frame: 01 02 03
//! ```
//!
//! It listens with deframers of its own, so that looking changes nothing. Knows no register but by the
//! table, and not what becomes of a request.

use std::fmt::Write as _;

use arm_sim::world::Tap;
use protocol_core::registers::Register;
use protocol_core::registers::map::find;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{
    Defect, Deframer, Direction, Frame, FrameBuffer, Function, MAX_LENGTH, ToArm, ToHost, frame,
};

/// Bytes that no frame explains by the time so many more have come never will be explained.
const LONGEST_DOUBT: usize = 2 * MAX_LENGTH;
/// A read of more rows than this is named by its ends.
const ROWS_NAMED: usize = 3;
/// Of a long stretch of noise so many bytes are shown.
const NOISE_SHOWN: usize = 32;

/// Both directions of the host link, in words.
pub struct Trace {
    from_host: Listener<ToArm>,
    to_host: Listener<ToHost>,
    sink: Box<dyn FnMut(&str)>,
}

impl Trace {
    /// Tells `sink` one line a frame.
    #[must_use]
    pub fn new(sink: Box<dyn FnMut(&str)>) -> Self {
        let gap = Duration::ZERO;
        Self { from_host: Listener::new("->", gap), to_host: Listener::new("<-", gap), sink }
    }
}

impl Tap for Trace {
    /// Unfinished frames are forgotten.
    fn restart(&mut self, gap: Duration) {
        self.from_host = Listener::new("->", gap);
        self.to_host = Listener::new("<-", gap);
    }

    fn received(&mut self, now: Instant, bytes: &[u8]) {
        self.from_host.hear(now, bytes, &mut self.sink);
    }

    fn sent(&mut self, now: Instant, bytes: &[u8]) {
        self.to_host.hear(now, bytes, &mut self.sink);
    }
}

impl std::fmt::Debug for Trace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Trace").finish_non_exhaustive()
    }
}

/// One direction.
struct Listener<D> {
    arrow: &'static str,
    deframer: Deframer<D>,
    /// Bytes that belong to no frame so far.
    unexplained: Vec<u8>,
}

impl<D: Direction> Listener<D> {
    const fn new(arrow: &'static str, gap: Duration) -> Self {
        Self { arrow, deframer: Deframer::new(gap), unexplained: Vec::new() }
    }

    fn hear(&mut self, now: Instant, bytes: &[u8], sink: &mut dyn FnMut(&str)) {
        self.unexplained.extend(bytes);
        let mut rest = bytes;
        loop {
            let taken = self.deframer.push(now, rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            while let Some(found) = self.deframer.pull() {
                let line = match found {
                    Ok(frame) => {
                        explain(&mut self.unexplained, self.arrow, &frame, sink);
                        frame_in_words::<D>(&frame)
                    }
                    Err(defect) => defect_in_words(defect).to_owned(),
                };
                sink(&format!("{} {line}", self.arrow));
            }
            if rest.is_empty() || taken == 0 {
                break;
            }
        }
        if self.deframer.deadline().is_none() || self.unexplained.len() > LONGEST_DOUBT {
            tell_noise(&self.unexplained, self.arrow, sink);
            self.unexplained.clear();
        }
    }
}

/// Strikes a frame, and whatever stands before it, off the unexplained bytes.
fn explain(unexplained: &mut Vec<u8>, arrow: &str, found: &Frame<'_>, sink: &mut dyn FnMut(&str)) {
    let mut bytes = FrameBuffer::new();
    frame::encode(&mut bytes, found.function, found.address, found.count, found.data);
    let place = unexplained.windows(bytes.len()).position(|window| window == bytes.as_slice());
    let Some(start) = place else { return };
    let noise: Vec<u8> = unexplained.drain(..start + bytes.len()).take(start).collect();
    tell_noise(&noise, arrow, sink);
}

fn tell_noise(bytes: &[u8], arrow: &str, sink: &mut dyn FnMut(&str)) {
    if bytes.is_empty() {
        return;
    }
    let what = if bytes.len() == 1 { "byte that is" } else { "bytes that are" };
    let mut line = format!("{arrow} {} {what} no frame:", bytes.len());
    for byte in bytes.iter().take(NOISE_SHOWN) {
        // Writing to a String cannot fail.
        let _ = write!(line, " {byte:02x}");
    }
    if bytes.len() > NOISE_SHOWN {
        line.push_str(" ..");
    }
    sink(&line);
}

const fn defect_in_words(defect: Defect) -> &'static str {
    match defect {
        Defect::WrongCrc => "a frame with a wrong CRC",
        Defect::MalformedRange { .. } => "a frame that reaches past register 255: refused",
    }
}

fn frame_in_words<D: Direction>(frame: &Frame<'_>) -> String {
    let places = places(frame.address, frame.count);
    let carries_data = D::data_length(frame.function, frame.count) > 0;
    match frame.function {
        Function::Read if carries_data => values_in_words(&places, frame),
        Function::Read if frame.count > 0 => format!("read {}", names(&places)),
        Function::Read => format!("read no register at {}", frame.address),
        Function::Write if carries_data => format!("write {}", values_in_words(&places, frame)),
        Function::Write => format!("write no register at {}", frame.address),
    }
}

/// A stretch of registers inside one row of the table, or inside one of its holes.
struct Place {
    row: Option<&'static Register>,
    first: u8,
    last: u8,
}

/// `count` registers from `address` on, row by row.
fn places(address: u8, count: u8) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for at in (address..=u8::MAX).take(usize::from(count)) {
        let row = find(at);
        match places.last_mut() {
            Some(place) if place.row == row => place.last = at,
            _ => places.push(Place { row, first: at, last: at }),
        }
    }
    places
}

impl Place {
    /// `target_position 1..7`, `device_id`, `unused 61..63`: joints count from 1, the rest by address.
    fn name(&self) -> String {
        let Some(row) = self.row else { return format!("unused {}", span(self.first, self.last)) };
        let name = row.name.to_ascii_lowercase();
        match (row.joint_at(self.first), row.joint_at(self.last)) {
            (Some(first), Some(last)) => format!("{name} {}", span(first.number(), last.number())),
            _ if self.last - self.first + 1 < row.count => {
                format!("{name} (register {})", span(self.first, self.last))
            }
            _ => name,
        }
    }
}

fn span(first: u8, last: u8) -> String {
    if first == last { first.to_string() } else { format!("{first}..{last}") }
}

fn names(places: &[Place]) -> String {
    match places {
        [first, .., last] if places.len() > ROWS_NAMED => {
            format!("{} to {} (registers {})", first.name(), last.name(), span(first.first, last.last))
        }
        _ => places.iter().map(Place::name).collect::<Vec<_>>().join(", "),
    }
}

fn values_in_words(places: &[Place], frame: &Frame<'_>) -> String {
    let mut rest = frame.data;
    let mut words = Vec::with_capacity(places.len());
    for place in places {
        let length = usize::from(place.last - place.first) + 1;
        let (values, others) = rest.split_at_checked(length).unwrap_or((rest, &[]));
        rest = others;
        words.push(format!("{} = {}", place.name(), numbers(place.row, values)));
    }
    words.join(", ")
}

fn numbers(row: Option<&Register>, values: &[u8]) -> String {
    let number = |&value: &u8| row.map_or(i16::from(value), |row| row.range.decode(value)).to_string();
    let mut words: Vec<String> = values.iter().map(number).collect();
    words.extend(row.map(|row| row.unit.symbol().to_owned()).filter(|unit| !unit.is_empty()));
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use protocol_core::request::{Reply, Request};
    use protocol_core::wire::deframer::{ABANDON_AFTER, gap};

    use super::*;

    struct Session {
        trace: Trace,
        lines: Rc<RefCell<Vec<String>>>,
        now: Instant,
    }

    fn session() -> Session {
        let lines = Rc::new(RefCell::new(Vec::new()));
        let heard = Rc::clone(&lines);
        let sink = Box::new(move |line: &str| heard.borrow_mut().push(line.to_owned()));
        let mut trace = Trace::new(sink);
        trace.restart(gap(115_200));
        Session { trace, lines, now: Instant::ZERO }
    }

    impl Session {
        fn host(&mut self, bytes: &[u8]) -> Vec<String> {
            self.trace.received(self.now, bytes);
            self.lines.take()
        }

        fn silence(&mut self) -> Vec<String> {
            for _ in 0..3 {
                self.now = self.now + ABANDON_AFTER;
                self.trace.received(self.now, &[]);
            }
            self.lines.take()
        }

        fn arm(&mut self, address: u8, values: &[u8]) -> Vec<String> {
            let mut bytes = FrameBuffer::new();
            Reply { address, values }.encode(&mut bytes);
            self.trace.sent(self.now, &bytes);
            self.lines.take()
        }
    }

    fn request(request: Request<'_>) -> FrameBuffer {
        let mut bytes = FrameBuffer::new();
        request.encode(&mut bytes);
        bytes
    }

    #[test]
    fn the_golden_frames_in_words() {
        let mut session = session();
        let lines = session.host(b"\xaa\x77\x03\x36\x07\x81\xce");
        assert_eq!(lines, ["-> read present_position 1..7"]);
        let lines = session.arm(54, &[90, 90, 65, 90, 90, 90, 80]);
        assert_eq!(lines, ["<- present_position 1..7 = 90 90 65 90 90 90 80 °"]);
        assert_eq!(session.host(b"\xaa\x77\x06\x1c\x01\x00\x2c\xc4"), ["-> write eeprom_lock = 0"]);
        let lines = session.host(b"\xaa\x77\x06\x35\x01\x1e\x7d\x04");
        assert_eq!(lines, ["-> write feedback_frequency = 30 Hz"]);
        assert_eq!(session.host(b"\xaa\x77\x03\x0a\x00\xd1\x0c"), ["-> read no register at 10"]);
    }

    #[test]
    fn parts_of_rows_holes_signs_and_many_rows() {
        let mut session = session();
        let lines = session.host(&request(Request::Write { address: 13, values: &[0x85, 3] }));
        assert_eq!(lines, ["-> write offset 1..2 = -5 3 °"]);
        let lines = session.host(&request(Request::Read { address: 60, count: 3 }));
        assert_eq!(lines, ["-> read present_position 7, unused 61..62"]);
        let lines = session.host(&request(Request::Read { address: 3, count: 2 }));
        assert_eq!(lines, ["-> read chip_id (register 3..4)"]);
        let lines = session.host(&request(Request::Read { address: 0, count: 61 }));
        assert_eq!(lines, ["-> read device_code to present_position 1..7 (registers 0..60)"]);
        assert_eq!(
            session.arm(254, &[74, 31]),
            ["<- supply_voltage = 74 × 0.1 V, servo_temperature = 31 °C"]
        );
    }

    #[test]
    fn noise_and_damage_are_shown_and_the_good_frame_behind_them_too() {
        let mut session = session();
        let lines = session.host(b"\x01\x02\xaa\x77\x03\x36\x07\x81\xce");
        assert_eq!(lines, ["-> 2 bytes that are no frame: 01 02", "-> read present_position 1..7"]);
        let lines = session.host(b"\xaa\x77\x03\x36\x07\x81\xcf");
        assert_eq!(
            lines,
            ["-> a frame with a wrong CRC", "-> 7 bytes that are no frame: aa 77 03 36 07 81 cf"]
        );
        assert_eq!(session.host(b"\xaa\x77\x06"), [""; 0], "it may still become a frame");
        assert_eq!(session.silence(), ["-> 3 bytes that are no frame: aa 77 06"]);
    }

    #[test]
    fn a_frame_in_pieces_is_one_line_and_long_noise_does_not_pile_up() {
        let mut session = session();
        assert_eq!(session.host(b"\xaa\x77\x03\x36"), [""; 0]);
        assert_eq!(session.host(b"\x07\x81\xce"), ["-> read present_position 1..7"]);
        for _ in 0..1_000 {
            session.host(b"\xaa\x77\x06\x00\xff");
        }
        assert!(session.trace.from_host.unexplained.len() <= LONGEST_DOUBT);
    }
}
