//! Tests of the serial line with a model of a USART and a bus (RM0090, section 30.3, figures of the TC and TXE behaviour).

use std::cell::RefCell;
use std::rc::Rc;

use super::*;

/// The time of a byte at 1 Mbaud, in microseconds.
const BYTE: u64 = 10;

/// A USART, and the wire behind it.
#[derive(Debug, Default)]
struct Chip {
    now: u64,
    /// The byte in the transmitter's data register.
    data: Option<u8>,
    /// The byte in the shift register, and the time when its stop bit has left.
    shift: Option<(u8, u64)>,
    complete: bool,
    /// SR was read at least once. The model does not ask for a read before each access to DR.
    status_was_read: bool,
    event: Option<TransmitEvent>,
    /// The byte in the receiver's data register with its status bits.
    received: Option<(u8, u16)>,
    direction_is_transmit: bool,
    /// Sent bytes with the times of their start and end.
    sent: Vec<(u8, u64, u64)>,
    /// Times at which the direction changed.
    transmit_at: Vec<u64>,
    receive_at: Vec<u64>,
}

impl Chip {
    /// Lets time pass until `now`: bytes whose stop bit has left by then are sent.
    fn advance(&mut self, now: u64) {
        while let Some((byte, end)) = self.shift.filter(|&(_, end)| end <= now) {
            self.sent.push((byte, end - BYTE, end));
            self.shift = self.data.take().map(|next| (next, end + BYTE));
            self.complete |= self.shift.is_none();
        }
        self.now = now;
    }

    fn write(&mut self, byte: u8) {
        assert!(self.data.is_none(), "the byte before is overwritten");
        if self.status_was_read {
            self.complete = false;
        }
        match self.shift {
            None => self.shift = Some((byte, self.now + BYTE)),
            Some(_) => self.data = Some(byte),
        }
    }

    fn status(&self) -> u16 {
        let flag = |is_set: bool, bit: u16| if is_set { bit } else { 0 };
        self.received.map_or(0, |(_, bits)| bits)
            | flag(self.complete, status::COMPLETE)
            | flag(self.data.is_none(), status::EMPTY)
    }

    /// Does the USART raise its interrupt?
    fn is_raised(&self) -> bool {
        self.received.is_some()
            || match self.event {
                Some(TransmitEvent::Empty) => self.data.is_none(),
                Some(TransmitEvent::Complete) => self.complete,
                _ => false,
            }
    }
}

/// The chip behind both traits of the line. The test keeps a copy, to observe the same chip.
#[derive(Clone, Debug, Default)]
struct Shared(Rc<RefCell<Chip>>);

impl UsartRegisters for Shared {
    fn status(&self) -> u16 {
        let mut chip = self.0.borrow_mut();
        chip.status_was_read = true;
        chip.status()
    }

    fn read(&mut self) -> u8 {
        let mut chip = self.0.borrow_mut();
        assert!(chip.status_was_read, "the errors would stay");
        chip.received.take().map_or(0, |(byte, _)| byte)
    }

    fn write(&mut self, byte: u8) {
        self.0.borrow_mut().write(byte);
    }

    fn interrupt_on(&mut self, event: TransmitEvent) {
        self.0.borrow_mut().event = Some(event);
    }
}

impl BusDirection for Shared {
    const IS_SWITCHED: bool = true;

    fn transmit(&mut self) {
        let mut chip = self.0.borrow_mut();
        assert!(!chip.direction_is_transmit, "switched twice");
        chip.direction_is_transmit = true;
        let now = chip.now;
        chip.transmit_at.push(now);
    }

    fn receive(&mut self) {
        let mut chip = self.0.borrow_mut();
        chip.direction_is_transmit = false;
        let now = chip.now;
        chip.receive_at.push(now);
    }
}

/// A line as after a reset: TC is set.
fn line<D: BusDirection>(chip: &Shared, direction: D) -> SerialLine<Shared, D, 64, 64> {
    chip.0.borrow_mut().complete = true;
    SerialLine::new(chip.clone(), direction)
}

/// Runs the interrupt handler `latency` microseconds after each interrupt is raised, until `end`.
fn run<D: BusDirection>(chip: &Shared, line: &mut SerialLine<Shared, D, 64, 64>, latency: u64, end: u64) {
    let start = chip.0.borrow().now;
    let mut serve_at = None;
    for now in start..=end {
        chip.0.borrow_mut().advance(now);
        if serve_at.is_none() && chip.0.borrow().is_raised() {
            serve_at = Some(now + latency);
        }
        if serve_at.is_some_and(|at| at <= now) {
            serve_at = None;
            assert!(line.serve());
        }
    }
}

fn receive<D: BusDirection>(chip: &Shared, line: &mut SerialLine<Shared, D, 64, 64>, byte: u8, errors: u16) {
    chip.0.borrow_mut().received = Some((byte, status::RECEIVED | errors));
    assert!(line.serve());
}

/// Takes everything: the bytes, with `None` for damage.
fn drain<D: BusDirection>(line: &mut SerialLine<Shared, D, 64, 64>) -> Vec<Option<u8>> {
    let (mut all, mut bytes) = (Vec::new(), [0; 4]);
    loop {
        match line.take(&mut bytes) {
            Taken::Bytes(0) => return all,
            Taken::Bytes(count) => all.extend(bytes[..count].iter().copied().map(Some)),
            Taken::Damage => all.push(None),
        }
    }
}

#[test]
fn the_direction_covers_a_frame_from_its_first_to_its_last_bit() {
    for (length, latency) in [1, 2, 3, 8, 57].into_iter().flat_map(|n| (0..25).map(move |l| (n, l))) {
        let chip = Shared::default();
        let mut line = line(&chip, chip.clone());
        chip.0.borrow_mut().advance(100);
        let frame: Vec<u8> = (0..length).collect();
        assert_eq!(line.push(&frame), frame.len());
        assert!(chip.0.borrow().direction_is_transmit, "before the first byte");
        chip.0.borrow_mut().event = Some(TransmitEvent::Empty); // As the main loop pends it.
        run(&chip, &mut line, latency, 5_000);
        let chip = chip.0.borrow();
        assert_eq!(chip.sent.iter().map(|sent| sent.0).collect::<Vec<_>>(), frame);
        let (first, last) = (chip.sent[0].1, chip.sent[frame.len() - 1].2);
        assert_eq!(chip.transmit_at, [100]);
        assert!(chip.transmit_at[0] <= first);
        assert_eq!(
            chip.receive_at,
            [last + latency],
            "{length} bytes, released when the last stop bit has left"
        );
        assert!(!line.is_sending() && chip.event == Some(TransmitEvent::Never));
    }
}

#[test]
fn a_frame_behind_another_keeps_the_direction() {
    let chip = Shared::default();
    let mut line = line(&chip, chip.clone());
    line.push(&[1, 2]);
    line.serve();
    run(&chip, &mut line, 1, 15);
    line.push(&[3]);
    line.serve();
    run(&chip, &mut line, 1, 100);
    let chip = chip.0.borrow();
    assert_eq!(chip.sent, [(1, 0, 10), (2, 10, 20), (3, 20, 30)]);
    assert_eq!((chip.transmit_at.as_slice(), chip.receive_at.as_slice()), ([0].as_slice(), [31].as_slice()));
}

/// In the emulator TC and TXE are always set: the direction is released in the interrupt that sends.
#[test]
fn a_transmitter_that_is_always_ready_is_served_by_one_interrupt() {
    #[derive(Clone, Debug, Default)]
    struct Emulated(Rc<RefCell<Vec<u8>>>);
    impl UsartRegisters for Emulated {
        fn status(&self) -> u16 {
            status::COMPLETE | status::EMPTY
        }
        fn read(&mut self) -> u8 {
            unreachable!("nothing is received")
        }
        fn write(&mut self, byte: u8) {
            self.0.borrow_mut().push(byte);
        }
        fn interrupt_on(&mut self, event: TransmitEvent) {
            assert_eq!(event, TransmitEvent::Never);
        }
    }
    let (chip, usart) = (Shared::default(), Emulated::default());
    let mut line = SerialLine::<_, _, 64, 64>::new(usart.clone(), chip.clone());
    line.push(&[1, 2, 3]);
    assert!(line.serve() && !line.is_sending() && !chip.0.borrow().direction_is_transmit);
    assert_eq!(*usart.0.borrow(), [1, 2, 3]);
}

#[test]
fn without_a_direction_the_transmission_ends_with_the_last_byte_passed_on() {
    let chip = Shared::default();
    let mut line = line(&chip, NoDirection);
    line.push(&[1, 2]);
    line.serve();
    assert!(!line.is_sending(), "one byte is shifted out, one is in the data register");
    run(&chip, &mut line, 0, 100);
    assert_eq!(chip.0.borrow().sent, [(1, 0, 10), (2, 10, 20)]);
}

#[test]
fn a_damaged_byte_is_dropped_and_its_place_is_kept() {
    for error in [status::PARITY, status::FRAMING, status::NOISE, status::FRAMING | status::OVERRUN] {
        let chip = Shared::default();
        let mut line = line(&chip, NoDirection);
        for byte in 1..=9 {
            receive(&chip, &mut line, byte, if byte == 6 { error } else { 0 });
        }
        assert_eq!(line.waiting(), 9);
        let expected = [1, 2, 3, 4, 5, 0, 7, 8, 9].map(|byte| (byte != 0).then_some(byte));
        assert_eq!(drain(&mut line), expected, "{error}");
        assert_eq!(line.waiting(), 0);
    }
}

#[test]
fn a_lost_byte_leaves_a_gap_behind_the_good_one() {
    let chip = Shared::default();
    let mut line = line(&chip, NoDirection);
    receive(&chip, &mut line, 1, status::OVERRUN);
    receive(&chip, &mut line, 3, 0);
    assert_eq!(drain(&mut line), [Some(1), None, Some(3)]);
    assert_eq!(line.errors().overruns, 1);
}

/// If the loop is late, the queue may receive two damaged bytes. Then the bytes between them are dropped, too.
#[test]
fn bytes_between_two_damaged_ones_never_join_others() {
    let chip = Shared::default();
    let mut line = line(&chip, NoDirection);
    for (byte, errors) in [(1, 0), (2, status::NOISE), (3, 0), (4, status::FRAMING), (5, 0)] {
        receive(&chip, &mut line, byte, errors);
    }
    assert_eq!(drain(&mut line), [Some(1), None, Some(5)]);
    for (byte, errors) in [(1, status::NOISE), (2, 0)] {
        receive(&chip, &mut line, byte, errors);
    }
    assert_eq!(drain(&mut line), [None, Some(2)], "damage at the front of the queue");
}

#[test]
fn a_full_queue_leaves_the_byte_in_the_usart() {
    let chip = Shared::default();
    let mut line = line(&chip, NoDirection);
    (0..64).for_each(|byte| receive(&chip, &mut line, byte, 0));
    chip.0.borrow_mut().received = Some((64, status::RECEIVED));
    assert!(!line.serve() && chip.0.borrow().received.is_some());
    assert_eq!(drain(&mut line).len(), 64);
    assert!(line.serve());
    assert_eq!(drain(&mut line), [Some(64)]);
}
