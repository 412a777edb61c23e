//! Counts the instructions of kinematics: the largest count over many poses. Also checks that the results have the same bits
//! as on the host.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::meter::Meter;
use footprint::opaque;
use footprint::poses::{BITS, mix, poses};
use kinematics::{forward, ik5, ik6, ik7};

#[entry]
fn main() -> ! {
    let meter = Meter::default();
    let mut most = [0; 4];
    for pose in poses() {
        let (pose, frames) = (opaque(pose), opaque(forward(pose)));
        let hand = frames.hand;
        let counts = [
            meter.count(|| _ = opaque(forward(pose))),
            meter.count(|| _ = opaque(ik5(frames.arm.wrist))),
            meter.count(|| _ = opaque(ik6(hand.tip, hand.tool))),
            meter.count(|| _ = opaque(ik7(hand.tip, hand.tool, hand.disc))),
        ];
        most.iter_mut().zip(counts).for_each(|(most, count)| *most = count.max(*most));
    }
    let names =
        ["forward kinematics", "inverse kinematics IK5", "inverse kinematics IK6", "inverse kinematics IK7"];
    names.into_iter().zip(most).for_each(|(name, count)| meter.print(name, count));
    meter.print("kinematics give the bits of the host", u32::from(poses().fold(0, mix) == BITS));
    meter.end()
}
