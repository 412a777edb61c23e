//! Parts of motion-core, called directly, also with inputs that the controller never passes to them.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::{any_bytes, any_time, opaque};
use motion_core::calibration::{MicroDegrees, angle_from_counts, counts_from_angle};
use motion_core::drive::Drive;
use motion_core::motor_state::MotorState;
use motion_core::position_filter::PositionFilter;
use motion_core::push_limiter::{PushLimit, PushLimiter, PushSample};
use motion_core::report_timer::ReportTimer;
use motion_core::servo_bus::frame::{self, Decoder, Instruction, Reading, ServoFrameBuffer};
use motion_core::servo_bus::{Bus, ByteTime, Question, Torque, TorqueCodes};
use motion_core::trajectory::Trajectory;
use motion_core::vacuum::VacuumControl;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::Duration;

#[entry]
fn main() -> ! {
    loop {
        calibration();
        one_joint();
        push();
        timers();
        servo_frames();
        decoder();
        bus();
    }
}

fn calibration() {
    for joint in Joint::ALL {
        opaque(counts_from_angle(joint, MicroDegrees(opaque(0)), opaque(0)));
        opaque(angle_from_counts(joint, opaque(0), opaque(0)).nearest_degree());
    }
    opaque(MicroDegrees::from_degrees(opaque(0)));
}

fn one_joint() {
    let mut trajectory = opaque(Trajectory::holding(MicroDegrees(opaque(0))));
    trajectory.move_to(MicroDegrees(opaque(0)), opaque(0));
    trajectory.stream_to(MicroDegrees(opaque(0)), any_time(), Duration::from_micros(opaque(0)));
    trajectory.advance(any_time(), opaque(0));
    trajectory.hold_back(MicroDegrees(opaque(0)));
    opaque((trajectory.set_point(), trajectory.is_moving()));
    let mut drive = opaque(Drive::RELEASED);
    drive.wait();
    drive.set_target(MicroDegrees(opaque(0)), opaque(0));
    opaque(drive.engage(MicroDegrees(opaque(0))));
    drive.rebase_offset(MicroDegrees(opaque(0)), MicroDegrees(opaque(0)), opaque(0));
    drive.stream_to(MicroDegrees(opaque(0)), any_time(), Duration::from_micros(opaque(0)));
    drive.advance(any_time(), opaque(0));
    drive.hold_back(MicroDegrees(opaque(0)));
    drive.hold();
    opaque((drive.is_driven(), drive.is_moving(), drive.set_point()));
    drive.mark_silent();
    drive.release();
    let mut filter = opaque(PositionFilter::UNKNOWN);
    opaque(filter.answered(any_time(), opaque(0), opaque(0)));
    opaque(filter.failed(any_time()));
    opaque((filter.is_known(), filter.position(), filter.wants_asking(any_time())));
}

fn push() {
    let mut limiter = opaque(PushLimiter::FREE);
    let sample = PushSample { angle: MicroDegrees(opaque(0)), push: opaque(0), is_saturated: opaque(true) };
    limiter.measured(any_time(), sample, MicroDegrees(opaque(0)), PushLimit::Arm(opaque(0)));
    opaque((limiter.hold_back(MicroDegrees(opaque(0))), limiter.is_limiting()));
}

fn timers() {
    let mut reports = opaque(ReportTimer::OFF);
    reports.set(any_time(), opaque(0), opaque(0));
    opaque((reports.poll_due(any_time()), reports.due()));
    let mut vacuum = opaque(VacuumControl::default());
    vacuum.set(any_time(), opaque(true));
    opaque((vacuum.poll(any_time()), vacuum.deadline()));
    opaque(MotorState::from_register(opaque(0)).torque());
}

fn servo_frames() {
    let mut buffer = ServoFrameBuffer::new();
    frame::ping(&mut buffer, opaque(0));
    frame::read(&mut buffer, opaque(0), opaque(0), opaque(0));
    frame::write(&mut buffer, opaque(0), opaque(0), any_bytes());
    frame::status(&mut buffer, opaque(0), opaque(0), any_bytes());
    let items = any_bytes().iter().map(|&id| (id, opaque([0; 6])));
    frame::sync_write(&mut buffer, opaque(0), items);
    opaque(buffer.as_slice());
    opaque(Instruction::from_code(opaque(0)));
}

fn decoder() {
    let mut decoder = opaque(Decoder::new());
    decoder.push(any_bytes());
    while let Some(found) = decoder.pull() {
        if let Ok(frame) = opaque(found) {
            opaque(Reading::parse(frame.params).map(|reading| opaque(reading).to_bytes()));
        }
    }
    decoder.clear();
}

fn bus() {
    let codes = opaque(TorqueCodes::DampingOnFree);
    let (timeout, guard_time) = (Duration::from_millis(opaque(0)), Duration::from_micros(opaque(0)));
    let mut bus = opaque(Bus::new(opaque(0), timeout, guard_time, codes));
    opaque(ByteTime::at_baud(opaque(0)).count_within(timeout));
    bus.bytes(any_time(), any_bytes());
    opaque(bus.poll(any_time()));
    opaque((bus.is_asking(), bus.is_free(any_time()), bus.deadline(any_time())));
    bus.ask(any_time(), Joint::from_index(opaque(0)).unwrap_or(Joint::ALL[0]), Question::TorqueAndReading);
    bus.set_torque(any_time(), Joint::ALL.into_iter().zip(opaque([Torque::Free; JOINTS])));
    bus.set_goals(any_time(), Joint::ALL.into_iter().zip(core::iter::repeat_with(|| opaque(0))));
    opaque(bus.frame());
}
