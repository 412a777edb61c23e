//! The whole controller, called as the main loop of the firmware calls it, without its sleep and its log.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::{any_bytes, any_time, opaque};
use motion_core::{Config, Controller, Output, Storage, TorqueCodes};
use protocol_core::registers::Image;
use protocol_core::time::Duration;

#[entry]
fn main() -> ! {
    let config = Config {
        chip_id: opaque([0; 6]),
        faults: opaque(0),
        servo_baud: opaque(1_000_000),
        servo_timeout: opaque(Duration::from_millis(5)),
        guard_time: opaque(Duration::from_micros(100)),
        torque_codes: opaque(TorqueCodes::DampingOnFree),
    };
    let stored = opaque(Some(Image([0; Image::LENGTH])));
    let mut arm = Controller::new(any_time(), config, stored.as_ref(), opaque(Storage::Ready));
    loop {
        opaque(arm.host_bytes(any_time(), any_bytes()));
        arm.servo_bytes(any_time(), any_bytes());
        arm.servo_byte_damaged(any_time());
        arm.host_byte_damaged();
        if let Output::Save(image) = opaque(arm.poll(any_time(), opaque(512))) {
            opaque(image);
            arm.set_storage(opaque(Storage::Full));
        }
        arm.raise_faults(opaque(1));
        opaque(arm.baud());
        opaque(arm.registers().get(opaque(0)));
    }
}
