//! The log of the main loop. defmt-rtt masks all interrupts for a whole log line. So the loop writes at most one in each pass,
//! while both serial lines pause or a debugger is attached. The flash driver logs its errors at once.

use cortex_m::peripheral::DCB;
use firmware_stm32::chip::host_link::HostUart;
use firmware_stm32::chip::servo_link::ServoUart;
use firmware_stm32::log_gate::LogGate;
use motion_core::{Controller, Storage, Vacuum};
use protocol_core::time::{Duration, Instant};

/// Time between two groups of log lines about the serial lines.
const PERIOD: Duration = Duration::from_millis(1_000);

/// The next log line about the serial lines. The three follow each other in this order.
#[derive(Clone, Copy)]
enum NextLine {
    /// Errors of the host link.
    Host,
    /// Errors of the servo bus.
    Servos,
    /// The longest answer time of each servo.
    Answers,
}

/// What is to be logged, and when.
pub(crate) struct Log {
    gate: LogGate,
    /// When the next line is due.
    due: Instant,
    /// When the next line about the serial lines is due.
    lines_due: Instant,
    next: NextLine,
    vacuum: Option<Vacuum>,
    save: Option<(Storage, usize)>,
}

impl Log {
    /// A log whose first line is due at once.
    pub(crate) const fn new() -> Self {
        let gate = LogGate::new(Instant::ZERO);
        Self {
            gate,
            due: Instant::ZERO,
            lines_due: Instant::ZERO,
            next: NextLine::Host,
            vacuum: None,
            save: None,
        }
    }

    /// Records that bytes were received or sent.
    pub(crate) const fn note_bytes(&mut self, now: Instant) {
        self.gate.note_bytes(now);
    }

    /// Logs the state of pump and valve in the next pause.
    pub(crate) const fn note_vacuum(&mut self, vacuum: Vacuum) {
        self.vacuum = Some(vacuum);
        self.due = Instant::ZERO;
    }

    /// Logs the result of a save and the room left, in the next pause.
    pub(crate) const fn note_save(&mut self, storage: Storage, room: usize) {
        self.save = Some((storage, room));
        self.due = Instant::ZERO;
    }

    /// True if a log line waits for a pause.
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        now >= self.due
    }

    /// Writes the next line if both serial lines are idle, or if a debugger is attached.
    #[inline(never)]
    pub(crate) fn poll(&mut self, now: Instant, host: &HostUart, servos: &ServoUart, arm: &mut Controller) {
        let is_sending = host.is_sending() || servos.is_sending();
        if self.gate.is_open(now, is_sending, DCB::is_debugger_attached()) {
            self.write(now, host, servos, arm);
        }
    }

    fn write(&mut self, now: Instant, host: &HostUart, servos: &ServoUart, arm: &mut Controller) {
        if let Some(vacuum) = self.vacuum.take() {
            return defmt::info!("{}", vacuum);
        }
        if let Some((storage, room)) = self.save.take() {
            return defmt::info!("save: {}, room for {=usize}", storage, room);
        }
        if now >= self.lines_due {
            self.write_about_lines(now, host, servos, arm);
        }
        self.due = self.lines_due;
    }

    fn write_about_lines(&mut self, now: Instant, host: &HostUart, servos: &ServoUart, arm: &mut Controller) {
        self.next = match self.next {
            NextLine::Host => {
                defmt::info!("host {}", host.errors());
                NextLine::Servos
            }
            NextLine::Servos => {
                defmt::info!("servos {}", servos.errors());
                NextLine::Answers
            }
            NextLine::Answers => {
                defmt::info!("longest answers {} us", arm.take_longest_answers());
                self.lines_due = now + PERIOD;
                NextLine::Host
            }
        };
    }
}
