//! The frames on the host link as text, for `--trace`. `sevenbot sniff` shows them with the same words.
//!
//! ```text
//!   -> read present-position 1..7
//!   <- answer present-position 1..7 = 90 90 65 90 90 90 80 °
//!   -> write eeprom-lock = 0 (open), motor-state = 1 (servo)
//!   -> 3 bytes that are no frame: 01 02 03
//! ```
//!
//! The trace has deframers of its own, so it does not change the traffic. It does not show the effects of requests.

use arm_sim::tap::Tap;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{
    Defect, Deframer, Direction, Frame, FrameBuffer, MAX_LENGTH, ToArm, ToHost, frame,
};
use sevenbot::traffic::Traffic;

/// After this many bytes without a frame, the bytes are noise.
const MAX_PENDING: usize = 2 * MAX_LENGTH;

/// Both directions of the host link as text.
pub struct Trace {
    from_host: LineTrace<ToArm>,
    to_host: LineTrace<ToHost>,
    sink: Box<dyn FnMut(&str) + Send>,
}

impl Trace {
    /// Passes a line for each frame, and for bytes that are no frame, to `sink`.
    #[must_use]
    pub fn new(sink: Box<dyn FnMut(&str) + Send>) -> Self {
        let gap = Duration::ZERO;
        Self { from_host: LineTrace::new("->", gap), to_host: LineTrace::new("<-", gap), sink }
    }
}

impl Tap for Trace {
    /// Drops unfinished frames.
    fn restart(&mut self, gap: Duration) {
        self.from_host = LineTrace::new("->", gap);
        self.to_host = LineTrace::new("<-", gap);
    }

    fn received(&mut self, now: Instant, bytes: &[u8]) {
        self.from_host.push(now, bytes, &mut self.sink);
    }

    fn sent(&mut self, now: Instant, bytes: &[u8]) {
        self.to_host.push(now, bytes, &mut self.sink);
    }
}

impl std::fmt::Debug for Trace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Trace").finish_non_exhaustive()
    }
}

/// One direction of the host link as text.
struct LineTrace<D> {
    arrow: &'static str,
    deframer: Deframer<D>,
    /// Bytes that are not yet part of a frame or of noise.
    pending: Vec<u8>,
}

impl<D: Direction> LineTrace<D> {
    const fn new(arrow: &'static str, gap: Duration) -> Self {
        Self { arrow, deframer: Deframer::new(gap), pending: Vec::new() }
    }

    fn push(&mut self, now: Instant, bytes: &[u8], sink: &mut dyn FnMut(&str)) {
        self.pending.extend(bytes);
        let mut rest = bytes;
        loop {
            let taken = self.deframer.push(now, rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            while let Some(found) = self.deframer.pull() {
                let line = match found {
                    Ok(frame) => {
                        remove_frame(&mut self.pending, self.arrow, &frame, sink);
                        Traffic::from_frame::<D>(&frame).to_string()
                    }
                    Err(defect) => defect_text(defect).to_owned(),
                };
                sink(&format!("{} {line}", self.arrow));
            }
            if rest.is_empty() || taken == 0 {
                break;
            }
        }
        if self.deframer.deadline().is_none() || self.pending.len() > MAX_PENDING {
            print_noise(&self.pending, self.arrow, sink);
            self.pending.clear();
        }
    }
}

/// Removes a frame and the noise before it from the pending bytes.
fn remove_frame(pending: &mut Vec<u8>, arrow: &str, found: &Frame<'_>, sink: &mut dyn FnMut(&str)) {
    let mut bytes = FrameBuffer::new();
    frame::encode(&mut bytes, found.function, found.address, found.count, found.data);
    let start = pending.windows(bytes.len()).position(|window| window == bytes.as_slice());
    let Some(start) = start else { return };
    let noise: Vec<u8> = pending.drain(..start + bytes.len()).take(start).collect();
    print_noise(&noise, arrow, sink);
}

fn print_noise(bytes: &[u8], arrow: &str, sink: &mut dyn FnMut(&str)) {
    if !bytes.is_empty() {
        sink(&format!("{arrow} {}", Traffic::Noise(bytes.to_vec())));
    }
}

const fn defect_text(defect: Defect) -> &'static str {
    match defect {
        Defect::WrongCrc => "a frame with a wrong CRC",
        Defect::MalformedRange { .. } => "a frame that reaches past register 255: refused",
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use protocol_core::request::{Reply, Request};
    use protocol_core::wire::deframer::{ABANDON_AFTER, gap};

    use super::*;

    struct TraceRecorder {
        trace: Trace,
        lines: Arc<Mutex<Vec<String>>>,
        now: Instant,
    }

    fn session() -> TraceRecorder {
        let lines = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&lines);
        let sink = Box::new(move |line: &str| heard.lock().unwrap().push(line.to_owned()));
        let mut trace = Trace::new(sink);
        trace.restart(gap(115_200));
        TraceRecorder { trace, lines, now: Instant::ZERO }
    }

    impl TraceRecorder {
        fn host(&mut self, bytes: &[u8]) -> Vec<String> {
            self.trace.received(self.now, bytes);
            std::mem::take(&mut self.lines.lock().unwrap())
        }

        fn silence(&mut self) -> Vec<String> {
            for _ in 0..3 {
                self.now = self.now + ABANDON_AFTER;
                self.trace.received(self.now, &[]);
            }
            std::mem::take(&mut self.lines.lock().unwrap())
        }

        fn arm(&mut self, address: u8, values: &[u8]) -> Vec<String> {
            let mut bytes = FrameBuffer::new();
            Reply { address, values }.encode(&mut bytes);
            self.trace.sent(self.now, &bytes);
            std::mem::take(&mut self.lines.lock().unwrap())
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
        assert!(session.trace.from_host.pending.len() <= MAX_PENDING);
    }
}
