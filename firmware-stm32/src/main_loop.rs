//! The main loop: it passes bytes and time to the controller and carries out its outputs. It does not parse the bytes.

use core::convert::Infallible;

use embedded_io::{BufRead, Write};
use firmware_stm32::bus_pause::PauseWait;
use firmware_stm32::chip::board;
use firmware_stm32::chip::clock::{self, Clock};
use firmware_stm32::chip::flash_registers::ChipFlashRegisters;
use firmware_stm32::chip::host_link::HostUart;
use firmware_stm32::chip::outputs::Outputs;
use firmware_stm32::chip::servo_link::ServoUart;
use firmware_stm32::chip::uart::{CHUNK, Received};
use firmware_stm32::chip::watchdog::Watchdog;
use firmware_stm32::flash::Flash;
use firmware_stm32::watchdog_gate::WatchdogGate;
use motion_core::{Controller, Output, Vacuum};
use protocol_core::registers::map::{FAULTS, fault as fault_bit};
use protocol_core::settings::Settings;
use protocol_core::time::Instant;

use crate::log::Log;

/// The bit of the time in microseconds that makes the LED blink: on for 262 ms, off for 262 ms.
const BLINK: u64 = 1 << 18;

/// The drivers that the loop connects to the controller.
pub(crate) struct MainLoop<'a> {
    pub(crate) clock: Clock,
    pub(crate) host: HostUart,
    pub(crate) servos: ServoUart,
    pub(crate) settings: Settings<Flash<ChipFlashRegisters<'a>>>,
    pub(crate) outputs: Outputs,
    pub(crate) watchdog: &'a Watchdog,
    pub(crate) watchdog_gate: WatchdogGate,
    pub(crate) log: Log,
}

impl MainLoop<'_> {
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
            if self.log.is_due(now) {
                self.log.poll(now, &self.host, &self.servos, &mut arm);
            }
            self.sleep(until, arm.host_bytes_wanted());
        }
    }

    /// Carries out the outputs that are due at `now`, up to a save. Returns the time of the next poll.
    fn act(&mut self, now: Instant, arm: &mut Controller) -> Instant {
        loop {
            match arm.poll(now, self.host.room()) {
                Output::ToHost(bytes) => {
                    send(&mut self.host, bytes);
                    self.log.note_bytes(now);
                }
                Output::ToServos(bytes) => {
                    send(&mut self.servos, bytes);
                    self.log.note_bytes(now);
                    self.watchdog_gate.control_cycle_ran();
                }
                Output::Vacuum(vacuum) => self.switch(vacuum),
                Output::Save(image) => {
                    self.wait_for_pause();
                    let storage = self.settings.save(&image);
                    self.log.note_save(storage, self.settings.room());
                    arm.set_storage(storage);
                    // The wait and the save may take more than 5 ms, so read the clock again before the next poll.
                    return now;
                }
                Output::Wait(until) => return until,
            }
        }
    }

    /// Waits for a pause before a save, because programming the flash stops the core: nothing is received, and nothing is sent to
    /// the servos. The controller sends nothing meanwhile; bytes to the host that are already queued go on. Bytes from the host
    /// stay in the queue.
    fn wait_for_pause(&self) {
        let (quiet, timeout) = (board::SAVE_QUIET_MICROS, board::SAVE_TIMEOUT_MICROS);
        let mut pause = PauseWait::new(clock::micros(), quiet, timeout);
        let received = || self.host.waiting() + self.servos.waiting();
        while !pause.is_over(clock::micros(), received(), self.servos.is_sending()) {}
    }

    fn receive(&mut self, now: Instant, arm: &mut Controller) {
        loop {
            let Received::Bytes(bytes) = self.host.received() else {
                arm.host_byte_damaged();
                continue;
            };
            let taken = arm.host_bytes(now, bytes);
            if taken > 0 || bytes.is_empty() {
                self.watchdog_gate.host_link_ran();
            }
            if taken > 0 {
                self.log.note_bytes(now);
            }
            self.host.consume(taken);
            // Less than a whole chunk: the queue is empty, or the controller takes no more, or the next pass takes the rest.
            if taken < CHUNK {
                break;
            }
        }
        loop {
            let Received::Bytes(bytes) = self.servos.received() else {
                arm.servo_byte_damaged(now);
                continue;
            };
            let count = bytes.len();
            if count == 0 {
                break;
            }
            arm.servo_bytes(now, bytes);
            self.servos.consume(count);
            self.log.note_bytes(now);
        }
    }

    fn switch(&mut self, vacuum: Vacuum) {
        self.outputs.pump.set(vacuum.pump);
        self.outputs.valve.set(vacuum.valve);
        self.log.note_vacuum(vacuum);
    }

    /// Lights the LED: steady without a fault, blinking while register 241 shows one.
    fn update_led(&mut self, now: Instant, arm: &Controller) {
        let is_well = arm.registers().get(FAULTS.address) == 0;
        self.outputs.led.set(is_well || now.as_micros() & BLINK == 0);
    }

    /// Sleeps until `until`, the next tick of the system timer, a byte from the servos, or enough bytes from the host. Fewer
    /// bytes from the host, and interrupts that send, do not end the sleep. Wake one byte early, so that only the last of
    /// the `wanted` bytes is left to process.
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

/// Queues bytes for sending. The queue has room: the caller passes the room of the host link to `poll`, and the servo bus is
/// idle before each frame.
fn send(line: &mut impl Write<Error = Infallible>, bytes: &[u8]) {
    let Ok(()) = line.write_all(bytes);
}
