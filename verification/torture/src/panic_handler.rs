//! The frames that the panic handler of the firmware sends to the servos.

use motion_core::TorqueCodes;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{ServoFrameBuffer, register, sync_write};
use protocol_core::registers::Joint;

/// The number of times that the panic handler sends the frame, with a pause before each.
pub(crate) const FRAMES: usize = 4;

/// The frame of the panic handler, which switches all servos to damping.
pub(crate) fn damping_frame(codes: TorqueCodes) -> ServoFrameBuffer {
    let mut frame = ServoFrameBuffer::new();
    let code = codes.code(Torque::Damping);
    let items = Joint::ALL.into_iter().map(|joint| (joint.index(), [code]));
    sync_write(&mut frame, register::TORQUE_SWITCH, items);
    frame
}
