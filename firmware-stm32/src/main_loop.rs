//! The main loop: it passes bytes and time to the controller and carries out its outputs. It does not parse the bytes.

use core::convert::Infallible;

use embedded_io::{BufRead, Write};
use firmware_stm32::bus_pause::PauseWait;
use firmware_stm32::flash::Flash;
use firmware_stm32::watchdog_gate::WatchdogGate;
use motion_core::{Controller, Output, Vacuum};
use protocol_core::registers::map::{FAULTS, fault as fault_bit};
use protocol_core::settings::Settings;
use protocol_core::time::{Duration, Instant};

use crate::board;
use crate::clock::{self, Clock};
use crate::flash_registers::ChipFlashRegisters;
use crate::host_link::HostLink;
use crate::outputs::Outputs;
use crate::servo_link::ServoLink;
use crate::uart::CHUNK;
use crate::watchdog::Watchdog;

/// Half the period of the blinking LED, in microseconds.
const BLINK_MICROS: u64 = 250_000;
/// Time between two log lines about the serial lines.
const LOG_PERIOD: Duration = Duration::from_millis(1_000);

/// The drivers that the loop connects to the controller.
pub(crate) struct MainLoop<'a> {
    pub(crate) clock: Clock,
    pub(crate) host: HostLink,
    pub(crate) servos: ServoLink,
    pub(crate) settings: Settings<Flash<ChipFlashRegisters<'a>>>,
    pub(crate) outputs: Outputs,
    pub(crate) watchdog: &'a Watchdog,
    pub(crate) watchdog_gate: WatchdogGate,
    pub(crate) next_log: Instant,
}

impl MainLoop<'_> {
    /// Runs the controller forever.
    pub(crate) fn run(mut self, mut arm: Controller) -> ! {
        loop {
            let now = self.clock.now();
            self.receive(now, &mut arm);
            let until = self.act(now, &mut arm);
            if self.host.has_overrun() {
                arm.raise_faults(fault_bit::RECEIVE_OVERRUN);
            }
            self.watchdog.feed_through(&mut self.watchdog_gate);
            self.update_led(now, &arm);
            if now >= self.next_log {
                self.log_lines(now, &mut arm);
            }
            self.sleep(until, arm.host_bytes_wanted());
        }
    }

    /// Carries out all outputs that are due at `now`. Returns the time of the next poll.
    fn act(&mut self, now: Instant, arm: &mut Controller) -> Instant {
        let mut begun = 0;
        loop {
            match arm.poll(now, self.host.room()) {
                Output::ToHost(bytes) => send(&mut self.host, bytes),
                Output::ServoFrameStart(bytes) => {
                    send(&mut self.servos, bytes);
                    begun = bytes.len();
                }
                Output::ToServos(bytes) => {
                    send(&mut self.servos, bytes.get(begun..).unwrap_or(&[]));
                    begun = 0;
                    self.watchdog_gate.control_cycle_ran();
                }
                Output::Vacuum(vacuum) => self.switch(vacuum),
                Output::Save(image) => {
                    self.wait_for_pause();
                    let storage = self.settings.save(&image);
                    defmt::info!("save: {}, room for {=usize}", storage, self.settings.room());
                    arm.set_storage(storage);
                    // The save took up to 5 ms, so read the clock again before the next poll.
                    return now;
                }
                Output::Wait(until) => return until,
            }
        }
    }

    /// Waits for a pause on both lines before a save, because programming the flash stops the core. The controller sends
    /// nothing to the servos meanwhile. Bytes from the host stay in the queue.
    fn wait_for_pause(&self) {
        let (quiet, timeout) = (board::SAVE_QUIET_MICROS, board::SAVE_TIMEOUT_MICROS);
        let mut pause = PauseWait::new(clock::micros(), quiet, timeout);
        let received = || self.host.waiting() + self.servos.waiting();
        while !pause.is_over(clock::micros(), received(), self.servos.is_sending()) {}
    }

    fn receive(&mut self, now: Instant, arm: &mut Controller) {
        loop {
            let bytes = self.host.received();
            let taken = arm.host_bytes(now, bytes);
            if taken > 0 || bytes.is_empty() {
                self.watchdog_gate.host_link_ran();
            }
            self.host.consume(taken);
            // Less than a whole chunk: the queue is empty, or the controller takes no more.
            if taken < CHUNK {
                break;
            }
        }
        loop {
            let bytes = self.servos.received();
            let count = bytes.len();
            if count == 0 {
                break;
            }
            arm.servo_bytes(now, bytes);
            self.servos.consume(count);
        }
    }

    fn switch(&mut self, vacuum: Vacuum) {
        self.outputs.pump.set(vacuum.pump);
        self.outputs.valve.set(vacuum.valve);
        defmt::info!("{}", vacuum);
    }

    /// Lights the LED: steady without a fault, blinking while register 241 shows one.
    fn update_led(&mut self, now: Instant, arm: &Controller) {
        let is_well = arm.registers().get(FAULTS.address) == 0;
        self.outputs.led.set(is_well || (now.as_micros() / BLINK_MICROS).is_multiple_of(2));
    }

    /// Logs the errors of both lines once a second, and the longest answer time of each servo. An overrun is a byte that
    /// was not read in time. Framing errors and noise come from bad edges.
    fn log_lines(&mut self, now: Instant, arm: &mut Controller) {
        self.next_log = now + LOG_PERIOD;
        let (host, servos) = (self.host.errors(), self.servos.errors());
        let answers = arm.take_longest_answers();
        defmt::info!("host {}, servos {}, longest answers {} us", host, servos, answers);
    }

    /// Sleeps until `until`, the next tick of the system timer, or the arrival of enough bytes. Fewer bytes, and interrupts
    /// that send, do not end the sleep. Wake one byte early, so that only the last of the `wanted` bytes is left to
    /// process.
    fn sleep(&mut self, until: Instant, wanted: usize) {
        let enough = wanted.saturating_sub(1).max(1);
        let _ = self.clock.has_ticked();
        let now = self.clock.now();
        if now >= until {
            return;
        }
        self.clock.tick_within(until - now);
        loop {
            // Interrupts are masked, so one that arrives between the check and WFI stays pending and ends WFI.
            let is_over = critical_section::with(|_| {
                let is_over =
                    self.clock.has_ticked() || self.servos.has_received() || self.host.waiting() >= enough;
                if !is_over {
                    cortex_m::asm::wfi();
                }
                is_over
            });
            if is_over {
                return;
            }
        }
    }
}

/// Queues bytes for sending. The queue has room: `poll` was told how much, and the servo bus is idle before each frame.
fn send(line: &mut impl Write<Error = Infallible>, bytes: &[u8]) {
    let Ok(()) = line.write_all(bytes);
}
