//! The frames on the host link as text, for `--trace`. `sevenbot sniff` shows them with the same words.
//!
//! ```text
//!   -> read present-position 1..7
//!   <- answer present-position 1..7 = 90 90 65 90 90 90 80 °
//!   -> write eeprom-lock = 0 (open), motor-state = 1 (servo)
//!   -> 3 bytes that are no frame: 01 02 03
//! ```
//!
//! The trace has deframers of its own, so it does not change the traffic. It does not show the effect of a request.

use arm_sim::world::Tap;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{
    Defect, Deframer, Direction, Frame, FrameBuffer, MAX_LENGTH, ToArm, ToHost, frame,
};
use sevenbot::traffic::Traffic;

/// Bytes that no frame explains by the time so many more have come never will be explained.
const LONGEST_DOUBT: usize = 2 * MAX_LENGTH;

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
                        Traffic::from_frame::<D>(&frame).to_string()
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
    if !bytes.is_empty() {
        sink(&format!("{arrow} {}", Traffic::Noise(bytes.to_vec())));
    }
}

const fn defect_in_words(defect: Defect) -> &'static str {
    match defect {
        Defect::WrongCrc => "a frame with a wrong CRC",
        Defect::MalformedRange { .. } => "a frame that reaches past register 255: refused",
    }
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

    #[test]
    fn both_directions_are_traced_with_the_words_of_the_sniffer() {
        let mut session = session();
        let lines = session.host(b"\xaa\x77\x03\x36\x07\x81\xce");
        assert_eq!(lines, ["-> read present-position 1..7"]);
        let lines = session.arm(54, &[90, 90, 65, 90, 90, 90, 80]);
        assert_eq!(lines, ["<- answer present-position 1..7 = 90 90 65 90 90 90 80 °"]);
        assert_eq!(session.host(b"\xaa\x77\x06\x1c\x01\x00\x2c\xc4"), ["-> write eeprom-lock = 0 (open)"]);
        let mut malformed = FrameBuffer::new();
        Request::Read { address: 250, count: 7 }.encode(&mut malformed);
        assert_eq!(session.host(&malformed)[0], "-> a frame that reaches past register 255: refused");
    }

    #[test]
    fn noise_and_damage_are_shown_and_the_good_frame_behind_them_too() {
        let mut session = session();
        let lines = session.host(b"\x01\x02\xaa\x77\x03\x36\x07\x81\xce");
        assert_eq!(lines, ["-> 2 bytes that are no frame: 01 02", "-> read present-position 1..7"]);
        let lines = session.host(b"\xaa\x77\x03\x36\x07\x81\xcf");
        assert_eq!(
            lines,
            [
                "-> a frame with a wrong CRC",
                "-> a damaged frame or a part of one, 7 bytes: AA 77 03 36 07 81 CF"
            ]
        );
        assert_eq!(session.host(b"\xaa\x77\x06"), [""; 0], "it may still become a frame");
        assert_eq!(session.silence(), ["-> a damaged frame or a part of one, 3 bytes: AA 77 06"]);
    }

    #[test]
    fn a_frame_in_pieces_is_one_line_and_long_noise_does_not_pile_up() {
        let mut session = session();
        assert_eq!(session.host(b"\xaa\x77\x03\x36"), [""; 0]);
        assert_eq!(session.host(b"\x07\x81\xce"), ["-> read present-position 1..7"]);
        for _ in 0..1_000 {
            session.host(b"\xaa\x77\x06\x00\xff");
        }
        assert!(session.trace.from_host.unexplained.len() <= LONGEST_DOUBT);
    }
}
