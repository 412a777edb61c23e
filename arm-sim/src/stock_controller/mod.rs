//! The controller of an arm as the maker delivers it: firmware 2.1.4 on the maker's ESP32 board, with map 2.1 only.
//!
//! ```text
//!   host ──▶ Parser ──▶ StockRegisters ──▶ ServoMaster ──▶ servos
//!   host ◀── frames ◀── StockRegisters ◀── ServoMaster ◀── servos
//! ```
//!
//! It exists to test host programs: it checks no range, refuses nothing, has no status block, sends text between its
//! frames, and executes no request while it beeps. The move to the standard pose at start and the timeout of a servo are
//! assumed. The WebSocket, the buttons and the defects of the maker's inverse kinematics are not simulated.

mod feedback;
mod goals;
mod inverse;
mod measurement;
mod parser;
mod registers;
mod servo_master;

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use motion_core::vacuum::VacuumControl;
use motion_core::{Config, Output};
use protocol_core::registers::map::{
    BAUD_RATE, MOTOR_STATE, TARGET_POSITION, VACUUM_PUMP, baud_rate, motor_state,
};
use protocol_core::registers::map21::{
    ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY, PRESENT_ANGLE, PRESENT_LOAD,
};
use protocol_core::registers::{Image, JOINTS, Joint};
use protocol_core::request::{Alarm, Reply, ReportMap21};
use protocol_core::settings::Storage;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;

use crate::controller::ArmController;
use feedback::Feedback;
use goals::LastGoals;
use inverse::Requested;
use measurement::Measurement;
use parser::{Parser, StockRequest};
use registers::StockRegisters;
use servo_master::{ReadOutcome, ServoMaster};

/// After power-up the arm executes no request for this long. Then it moves to the standard pose.
const BOOT_TIME: Duration = Duration::from_millis(500);
const WAKE_UP_MS: u16 = 2_000;
/// How long an alarm beeps. Meanwhile the arm executes no request and sends no feedback.
const BEEP: Duration = Duration::from_millis(100);
const BANNER: &[u8] = b"7Bot V2, firmware 2.1.4\r\n";
const BEEP_ON: &[u8] = b"Buzzer ON - Note: 2, Freq: 330\r\n";
const BEEP_OFF: &[u8] = b"Buzzer OFF\r\n";
/// The most bytes from the host that wait while the arm is busy.
const INPUT_BUFFER: usize = 256;
/// The baud code for 1 Mbaud. All others mean 115,200 baud.
const FAST: u8 = 3;

/// The controller of an arm with the maker's firmware, to test host programs.
#[derive(Clone, Debug)]
pub struct StockController {
    config: Config,
    registers: StockRegisters,
    stored: Image,
    to_save: Option<Image>,
    parser: Parser,
    from_host: VecDeque<u8>,
    to_host: VecDeque<u8>,
    sending: Vec<u8>,
    servos: ServoMaster,
    measurement: Option<Measurement>,
    angle_feedback: Feedback,
    load_feedback: Feedback,
    vacuum: VacuumControl,
    goals: LastGoals,
    requested: Requested,
    /// The servos get their first goals at this time. `None`: they have them.
    wake_up: Option<Instant>,
    /// The arm beeps until this time.
    beep_end: Option<Instant>,
    baud: u32,
}

impl ArmController for StockController {
    fn power_up(now: Instant, config: Config, stored: Option<&Image>, _storage: Storage) -> Self {
        let registers = StockRegisters::new(config.chip_id, stored);
        let goals = LastGoals::new(registers.joints(&TARGET_POSITION));
        let is_fast = registers.get(BAUD_RATE.address) == FAST;
        Self {
            servos: ServoMaster::new(config.servo_baud, config.servo_timeout, config.guard_time),
            stored: stored.copied().unwrap_or(Image([0xFF; Image::LENGTH])),
            to_save: None,
            parser: Parser::default(),
            from_host: VecDeque::new(),
            to_host: BANNER.iter().copied().collect(),
            sending: Vec::new(),
            measurement: None,
            angle_feedback: Feedback::default(),
            load_feedback: Feedback::default(),
            vacuum: VacuumControl::default(),
            goals,
            wake_up: Some(now + BOOT_TIME),
            requested: Requested::default(),
            beep_end: None,
            baud: if is_fast { baud_rate(FAST) } else { baud_rate(0) },
            config,
            registers,
        }
    }

    fn set_answer_delay(&mut self, delay: Duration) {
        let timeout = self.config.servo_timeout.as_micros() + delay.as_micros();
        self.servos.set_timeout(Duration::from_micros(timeout));
    }

    fn host_bytes(&mut self, _now: Instant, bytes: &[u8]) -> usize {
        let room = INPUT_BUFFER.saturating_sub(self.from_host.len());
        let taken = bytes.get(..room).unwrap_or(bytes);
        self.from_host.extend(taken);
        taken.len()
    }

    fn servo_bytes(&mut self, _now: Instant, bytes: &[u8]) {
        self.servos.bytes(bytes);
    }

    fn poll(&mut self, now: Instant, host_room: usize) -> Output<'_> {
        while self.has_no_output(now) && self.step(now) {}
        if self.servos.prepare_frame(now) {
            return Output::ToServos(self.servos.frame());
        }
        if !self.to_host.is_empty() && host_room > 0 {
            let count = self.to_host.len().min(host_room);
            self.sending = self.to_host.drain(..count).collect();
            return Output::ToHost(&self.sending);
        }
        if let Some(image) = self.to_save.take() {
            return Output::Save(image);
        }
        if let Some(vacuum) = self.vacuum.poll(now) {
            return Output::Vacuum(vacuum);
        }
        Output::Wait(self.deadline(now))
    }

    fn host_deadline(&self) -> Instant {
        self.angle_feedback.due().min(self.load_feedback.due())
    }

    fn set_storage(&mut self, _storage: Storage) {}

    /// No effect: the maker's controller continues its feedback.
    fn host_left(&mut self, _now: Instant) {}

    fn baud(&self) -> u32 {
        self.baud
    }
}

impl StockController {
    /// May the next request be executed? The firmware sends each frame before it does anything else.
    fn has_no_output(&self, now: Instant) -> bool {
        !self.servos.has_frame(now) && self.to_host.is_empty() && self.to_save.is_none()
    }

    /// Executes the next step. Returns whether there was one.
    fn step(&mut self, now: Instant) -> bool {
        if let Some(wake_up) = self.wake_up {
            if now >= wake_up {
                self.wake_up = None;
                self.servos.set_torque(motor_state::SERVO);
                self.servos.set_goals(self.goals.within(WAKE_UP_MS, &self.registers).into_iter());
            }
            return now >= wake_up;
        }
        if let Some(end) = self.beep_end {
            if now >= end {
                self.beep_end = None;
                self.to_host.extend(BEEP_OFF);
            }
            return now >= end;
        }
        if let Some(measurement) = self.measurement.take() {
            return self.measure(now, measurement);
        }
        if let Some(request) = self.next_request() {
            self.execute(now, request);
        } else if self.angle_feedback.take_due(now) {
            self.measurement = Some(Measurement::feedback(&PRESENT_ANGLE));
        } else if self.load_feedback.take_due(now) {
            self.measurement = Some(Measurement::feedback(&PRESENT_LOAD));
        } else {
            return false;
        }
        true
    }

    fn next_request(&mut self) -> Option<StockRequest> {
        while let Some(byte) = self.from_host.pop_front() {
            if let Some(request) = self.parser.push(byte) {
                return Some(request);
            }
        }
        None
    }

    fn execute(&mut self, now: Instant, request: StockRequest) {
        match request {
            StockRequest::Read { address, count } => {
                self.measurement = Some(Measurement::reply(address, count));
            }
            StockRequest::Write { address, values } => self.write(now, address, &values),
        }
    }

    /// Reads the next servo, or sends the frame after the last one. Returns whether there was something to do.
    fn measure(&mut self, now: Instant, mut measurement: Measurement) -> bool {
        if let Some(joint) = measurement.asked {
            let Some(outcome) = self.servos.take_outcome(now) else {
                self.measurement = Some(measurement);
                return false;
            };
            if let ReadOutcome::Measured(reading) = outcome {
                self.registers.measured(joint, &reading);
            }
        }
        measurement.asked = measurement.joints.pop_front();
        if let Some(joint) = measurement.asked {
            self.servos.ask(joint);
            self.measurement = Some(measurement);
        } else {
            let Measurement { is_report, first: address, count, .. } = measurement;
            let values = &self.registers.read(address, count);
            self.send(|frame| {
                if is_report {
                    ReportMap21 { address, values }.encode(frame);
                } else {
                    Reply { address, values }.encode(frame);
                }
            });
        }
        true
    }

    fn write(&mut self, now: Instant, first: u8, values: &[u8]) {
        self.registers.write(first, values);
        let is_written =
            |address: u8| address.checked_sub(first).is_some_and(|index| usize::from(index) < values.len());
        self.to_save = self.registers.image_after(self.stored, first, values.len());
        self.stored = self.to_save.unwrap_or(self.stored);
        if is_written(MOTOR_STATE.address) {
            self.servos.set_torque(self.registers.get(MOTOR_STATE.address));
        }
        if is_written(VACUUM_PUMP.address) {
            self.vacuum.set(now, self.registers.get(VACUUM_PUMP.address) == 1);
        }
        self.goals.set_pace(&self.registers, is_written);
        let targets = Joint::ALL.map(|joint| {
            let target = TARGET_POSITION.of(joint);
            is_written(target).then(|| self.registers.get(target))
        });
        self.move_to(targets);
        for (row, feedback) in [
            (&ANGLE_FEEDBACK_FREQUENCY, &mut self.angle_feedback),
            (&LOAD_FEEDBACK_FREQUENCY, &mut self.load_feedback),
        ] {
            if is_written(row.address) {
                feedback.set_frequency(now, self.registers.get(row.address));
            }
        }
        self.requested.note(is_written);
        self.solve(now);
    }

    /// Runs the requested solvers. Only IK6 and IK7 sound an alarm.
    fn solve(&mut self, now: Instant) {
        for solver in self.requested.take() {
            match solver.solve(&self.registers) {
                Some(targets) => self.move_to(targets),
                None => {
                    if let Some(kind) = solver.alarm() {
                        self.sound_alarm(now, kind);
                    }
                }
            }
        }
    }

    fn sound_alarm(&mut self, now: Instant, kind: u8) {
        self.to_host.extend(BEEP_ON);
        self.send(|frame| Alarm::out_of_reach(kind).encode(frame));
        self.beep_end = Some(now + BEEP);
    }

    /// Sends the targets that differ from the last ones to the servos.
    fn move_to(&mut self, targets: [Option<u8>; JOINTS]) {
        let goals = self.goals.change(targets, &self.registers);
        if !goals.is_empty() {
            self.servos.set_goals(goals.into_iter());
        }
    }

    fn send(&mut self, encode: impl FnOnce(&mut FrameBuffer)) {
        let mut frame = FrameBuffer::new();
        encode(&mut frame);
        self.to_host.extend(&frame);
    }

    fn deadline(&self, now: Instant) -> Instant {
        let feedback = self.host_deadline();
        let pause = self.beep_end.or(self.wake_up).unwrap_or(Instant::FAR_FUTURE);
        let busy = pause.min(self.servos.deadline());
        let next = if busy == Instant::FAR_FUTURE { feedback } else { busy };
        next.min(self.vacuum.deadline()).max(now)
    }
}
