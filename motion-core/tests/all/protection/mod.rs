//! The protection of the arm: obstacles, servos that let go, and a lost supply (D27 to D29).

mod free_motion;
mod let_go;
mod obstacles;
mod supply;

use crate::rig::Rig;
use arm_sim::plant::Wall;
use protocol_core::registers::Joint;

const BLOCKED: u8 = 195;
const LET_GO: u8 = 196;
const ALARMS: u8 = 197;
const SUPPLY_LOST: u8 = 198;

fn joint(number: u8) -> Joint {
    Joint::new(number).expect("1 to 7")
}

fn stiff_wall(degrees: i32) -> Option<Wall> {
    Some(Wall { millidegrees: degrees * 1_000, stiffness: None })
}

fn bit(number: u8) -> u8 {
    1 << (number - 1)
}

/// Runs a stream of points of a joint, one each 20 ms, in hundredths of a degree.
fn stream(rig: &mut Rig, number: u8, points: impl Iterator<Item = u16>) {
    for point in points {
        rig.write(126 + 2 * number, &point.to_le_bytes());
        rig.run_ms(20);
    }
}
