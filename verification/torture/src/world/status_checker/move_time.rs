//! How long a joint may move, and what may make it move.

use protocol_core::registers::map::{OFFSET, SPEED, TIME};
use protocol_core::registers::map21::WRIST_POSITION;
use protocol_core::registers::{Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use crate::world::extended_model;
use crate::world::register_model::RegisterModel;

/// How much longer a move may take than its distance divided by its speed.
const MOVE_MARGIN: Duration = Duration::from_millis(1_000);
/// The longest time until a point of a stream is reached: two of the longest periods and a control cycle (D23), and 10 ms more.
const MAX_STREAM_TIME: Duration = Duration::from_millis(2_020);
/// More than any move of a set-point, in counts: from one end of a servo's range of 1,023 counts to a target beyond its other
/// end. The range of joint 7 ends at 68 degrees with the offset -16, and its targets go up to 180 degrees.
pub(super) const WHOLE_RANGE: u16 = 1_450;
/// The largest value of a time register.
const MAX_TIME_UNITS: u8 = {
    let (_, most) = TIME.range.bounds();
    most.to_le_bytes()[0]
};

/// The largest distance that a joint may have to move from its goal, if it has one, to its target, in counts.
pub(super) fn distance(goal: Option<u16>, target: u16) -> u16 {
    match goal {
        // A set-point may lie beyond the end of the servo's range.
        Some(goal @ 1..1_023) if (1..1_023).contains(&target) => goal.abs_diff(target) + 5,
        _ => WHOLE_RANGE,
    }
}

/// The time that a joint may take for this distance in counts.
fn move_time(joint: Joint, distance: u16, registers: &RegisterFile) -> Duration {
    let degrees = u64::from(distance) * 180 / if joint.number() < 5 { 850 } else { 625 } + 2;
    let speed = u64::from(registers.get(SPEED.of(joint)));
    let at_speed = |tenths: u64| Duration::from_millis(degrees * 10_000 / tenths);
    match speed {
        // The time register applies as it was when the target was written, so assume the largest time.
        0 => at_speed(3_720).max(Duration::from_millis(u64::from(MAX_TIME_UNITS) * 100)),
        _ => at_speed(speed * 19),
    }
}

/// The time by which a joint that has to move by this distance, in counts, has to be at rest.
pub(super) fn rest_by(
    now: Instant,
    joint: Joint,
    distance: u16,
    registers: &RegisterFile,
    model: &RegisterModel,
) -> Instant {
    let stream = if model.has_streams() { MAX_STREAM_TIME } else { Duration::ZERO };
    now + move_time(joint, distance, registers) + MOVE_MARGIN + stream
}

/// True if a write to these registers, in any map, can move joints.
pub(crate) fn affects_motion(first: u8, count: usize) -> bool {
    let last = usize::from(first) + count;
    let (from, to) = (OFFSET.address, WRIST_POSITION.address + WRIST_POSITION.count);
    let is_extended =
        first <= extended_model::REPORT_CONTENT && last > usize::from(extended_model::FINE_TARGETS.0);
    (first < to && last > usize::from(from)) || is_extended
}
