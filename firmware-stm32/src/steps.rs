//! The steps of the self-test.

use core::fmt::{self, Write as _};

use embedded_io::{BufRead, Write as _};
use firmware_stm32::chip::board;
use firmware_stm32::chip::clock::{self, Clock};
use firmware_stm32::chip::gpio::{DigitalOutput, Switch};
use firmware_stm32::chip::host_link::HostUart;
use firmware_stm32::chip::uart::Received;
use firmware_stm32::chip::watchdog::Watchdog;
use firmware_stm32::clock_rates::ClockSource;
use firmware_stm32::question::{BusQuestion, Echoes};
use firmware_stm32::reset_cause::ResetCause;
use firmware_stm32::{led_pattern, vdd};
use motion_core::servo_bus::Reading;
use protocol_core::registers::JOINTS;

use crate::read_only_bus::ReadOnlyBus;

/// Frames that step b sends, unless the bus gives no echo.
const ECHOES: u16 = 1_000;
/// Questions whose answers step c counts.
const QUESTIONS: u16 = 100;
/// Time for which step c searches for a servo.
const SEARCH_MICROS: u32 = 2_000_000;
/// Shortest time between two rounds of step d.
const LINE_MICROS: u32 = 500_000;
/// Shown instead of the value of a servo that did not answer.
const UNKNOWN: i16 = -1;
/// Value of the torque switch with torque on, the same in both published tables.
const TORQUE_ON: i16 = 1;
/// The value of register 29 (forceless) that this image corresponds to.
const MOTOR_STATE: u8 = 2;

/// Writes a line to the host link and to the log.
macro_rules! say {
    ($to:expr, $($words:tt)*) => {{
        defmt::info!($($words)*);
        let _ = write!(HostText(&mut $to.host), $($words)*);
        let _ = HostText(&mut $to.host).write_str("\r\n");
    }};
}

/// Facts about the board, read at start.
pub(crate) struct Board {
    pub(crate) source: ClockSource,
    /// The crystal as measured at start.
    pub(crate) crystal_khz: Option<u32>,
    pub(crate) flags: u32,
    pub(crate) cause: Option<ResetCause>,
    pub(crate) brown_out_level: u8,
    /// Reading of the internal reference in the factory.
    pub(crate) calibration: Option<u16>,
    /// Present reading of the internal reference.
    pub(crate) reference: Option<u16>,
}

pub(crate) struct SelfTest {
    pub(crate) board: Board,
    pub(crate) clock: Clock,
    pub(crate) host: HostUart,
    pub(crate) servos: ReadOnlyBus,
    pub(crate) led: Switch<DigitalOutput>,
    pub(crate) watchdog: Watchdog,
    /// Shown by the LED: the last step, and whether it passed.
    pub(crate) shown: (u8, bool),
}

/// The host link as an output for text.
struct HostText<'a>(&'a mut HostUart);

impl fmt::Write for HostText<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let Ok(()) = self.0.write_all(text.as_bytes());
        Ok(())
    }
}

impl SelfTest {
    /// Runs step a, then each step whose letter arrives.
    pub(crate) fn run(mut self) -> ! {
        say!(self, "self-test, last run ended in {:?}", self.board.cause);
        say!(self, "motor state {}: the servos are asked and never driven", MOTOR_STATE);
        self.board_alone();
        loop {
            match self.command() {
                b'a' => self.board_alone(),
                b'b' => self.echoes(),
                b'c' => self.one_servo(),
                b'd' => self.seven_servos(),
                b'e' => say!(self, "e: p panic, h hard fault, o stack overflow, w hang"),
                #[allow(clippy::panic, reason = "purpose of the command")]
                b'p' => panic!("on command"),
                b'h' => cortex_m::asm::udf(),
                b'o' => drop(overflow(0)),
                b'w' => self.hang(),
                _ => say!(self, "a board, b echoes, c one servo, d seven servos, e crashes"),
            }
        }
    }

    /// Waits for a letter. Updates the LED and feeds the watchdog meanwhile.
    fn command(&mut self) -> u8 {
        loop {
            if let Received::Bytes(&[letter, ..]) = self.host.received() {
                self.host.consume(1);
                return letter;
            }
            self.feed_and_blink();
            cortex_m::asm::wfi();
        }
    }

    fn feed_and_blink(&mut self) {
        let (step, passed) = self.shown;
        self.led.set(led_pattern::is_on(step, passed, self.clock.now().as_micros()));
        self.watchdog.feed();
    }

    fn show(&mut self, step: u8, letter: char, passed: bool) {
        self.shown = (step, passed);
        let result = if passed { "passed" } else { "FAILED" };
        say!(self, "{}: {}", letter, result);
    }

    fn board_alone(&mut self) {
        let Board { source, crystal_khz, flags, brown_out_level, calibration, reference, .. } = self.board;
        say!(self, "a: clock {:?}, RCC_CSR {:08x}, brown-out level {}", source, flags, brown_out_level);
        say!(self, "a: crystal {:?} kHz", crystal_khz);
        let supply = calibration.zip(reference).and_then(|(then, now)| vdd::millivolts(then, now));
        say!(self, "a: VDD {:?} mV", supply);
        let [a, b, c, d, e, f] = board::chip_id(source);
        say!(self, "a: chip id {:02x}{:02x}{:02x}{:02x}{:02x}{:02x}", a, b, c, d, e, f);
        let is_emulated = source == ClockSource::Emulated;
        let clock_is_good = is_emulated || source == ClockSource::Crystal;
        // The emulator has no internal reference.
        let supply_is_good = supply.map_or(is_emulated, vdd::is_good);
        self.show(1, 'a', clock_is_good && supply_is_good && brown_out_level == 3);
    }

    fn echoes(&mut self) {
        let before = self.servos.errors();
        let mut echoes = Echoes::default();
        while echoes.sent() < ECHOES && !echoes.is_silent() {
            let question = BusQuestion::to_absent_servo(echoes.sent());
            let received = self.servos.echo(&question);
            echoes.count(question.frame(), &received);
            self.feed_and_blink();
        }
        let errors = self.servos.errors();
        if echoes.is_silent() {
            say!(self, "b: no echo: the emulator gives none; else PA2 or the pull-up");
        } else {
            let Echoes { right, wrong, missing } = echoes;
            say!(self, "b: {} echoes right, {} wrong, {} missing, {:?}", right, wrong, missing, errors);
        }
        self.show(2, 'b', echoes.right == ECHOES && errors == before);
    }

    fn one_servo(&mut self) {
        let Some(id) = self.find_servo() else {
            say!(self, "c: no servo with an id of 0 to 6 answers");
            return self.show(3, 'c', false);
        };
        let (mut answers, mut longest) = (0, 0);
        for _ in 0..QUESTIONS {
            self.feed_and_blink();
            if let Some((_, micros)) = self.servos.ask(&BusQuestion::measure(id)) {
                answers += 1;
                longest = longest.max(micros);
            }
        }
        say!(self, "c: servo {}: {} of {} answers, the longest after {} us", id, answers, QUESTIONS, longest);
        let reading = self.measure(id);
        let torque = self.torque_switch(id);
        if let Some(Reading { position_counts, voltage_decivolts, temperature_celsius, .. }) = reading {
            say!(
                self,
                "c: {} counts, {} x 0.1 V, {} degrees C, torque switch {}",
                position_counts,
                voltage_decivolts,
                temperature_celsius,
                torque
            );
        }
        self.show(3, 'c', answers == QUESTIONS && reading.is_some() && torque != TORQUE_ON);
    }

    /// Returns the first id that answers; `None` after [`SEARCH_MICROS`]. A servo answers some 200 ms after its supply is
    /// switched on.
    fn find_servo(&mut self) -> Option<u8> {
        let start = clock::micros();
        while clock::micros().wrapping_sub(start) < SEARCH_MICROS {
            for id in 0..board::SERVOS {
                self.feed_and_blink();
                if self.servos.ask(&BusQuestion::ping(id)).is_some() {
                    return Some(id);
                }
            }
        }
        None
    }

    /// Reads all servos every [`LINE_MICROS`], until the next command arrives.
    fn seven_servos(&mut self) {
        loop {
            let start = clock::micros();
            let (mut counts, mut torque) = ([UNKNOWN; JOINTS], [UNKNOWN; JOINTS]);
            for ((id, count), torque) in (0..board::SERVOS).zip(&mut counts).zip(&mut torque) {
                self.feed_and_blink();
                let reading = self.measure(id);
                *count = reading.map_or(UNKNOWN, |reading| reading.position_counts.cast_signed());
                *torque = self.torque_switch(id);
            }
            let answering = counts.iter().filter(|counts| **counts != UNKNOWN).count();
            say!(self, "d: counts {:?}, torque switches {:?}", counts, torque);
            self.show(4, 'd', answering == JOINTS && !torque.contains(&TORQUE_ON));
            while clock::micros().wrapping_sub(start) < LINE_MICROS {
                self.feed_and_blink();
            }
            if self.host.has_received() {
                return;
            }
        }
    }

    fn measure(&mut self, id: u8) -> Option<Reading> {
        self.servos.ask(&BusQuestion::measure(id)).and_then(|(answer, _)| Reading::parse(&answer))
    }

    fn torque_switch(&mut self, id: u8) -> i16 {
        let answer = self.servos.ask(&BusQuestion::torque_switch(id));
        answer.and_then(|(answer, _)| answer.first().copied()).map_or(UNKNOWN, i16::from)
    }

    /// Hangs until the watchdog restarts the chip. In the emulator, which has no watchdog, it returns.
    fn hang(&mut self) {
        if self.board.source == ClockSource::Emulated {
            say!(self, "w: the emulator has no watchdog");
            return;
        }
        say!(self, "w: restart within 1.4 to 3.8 s");
        loop {
            cortex_m::asm::nop();
        }
    }
}

/// Recurses until the stack overflows.
#[allow(unconditional_recursion, reason = "purpose of the command")]
#[inline(never)]
fn overflow(depth: u32) -> u32 {
    let frame = core::hint::black_box([depth; 16]);
    overflow(depth + 1) + frame.iter().sum::<u32>()
}
