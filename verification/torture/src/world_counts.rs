//! The number of events in worlds.

use std::ops::AddAssign;

macro_rules! counts {
    ($(#[doc = $doc:literal] $name:ident,)*) => {
        /// The counts of one world, or of many.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct WorldCounts { $(#[doc = $doc] pub $name: u64,)* }

        impl AddAssign for WorldCounts {
            fn add_assign(&mut self, other: Self) {
                $(self.$name += other.$name;)*
            }
        }
    };
}

counts! {
    /// Virtual time, in microseconds.
    micros,
    /// Complete requests.
    requests,
    /// Checked replies.
    replies,
    /// Checked reports.
    reports,
    /// Checked alarms.
    alarms,
    /// Bursts of requests with corruption.
    corrupted_bursts,
    /// Checked frames to the servos.
    commands,
    /// Corrupted or delayed frames on the servo bus.
    disturbed_servo_frames,
    /// Corrupted replies of servos with a valid checksum.
    undetected_errors,
    /// Changes of a servo fault, and restarts of a servo.
    servo_faults,
    /// Walls, pushes, things and changes of the payload. A thing counts even if the claws have no room for it.
    obstacles,
    /// Alarms that were forced on servos, without the repeated overloads.
    servo_trips,
    /// Cuts of the supply of the servos alone.
    emergency_stops,
    /// Emergency stops after which the arm had to enter state 0.
    checked_stops,
    /// Stalls of the shell.
    stalls,
    /// Power cuts and restarts.
    power_cuts,
    /// Power cuts during a start.
    cut_starts,
    /// Power cuts during a save.
    cut_saves,
    /// Saves of settings, with those that a power cut interrupted.
    saves,
    /// Times that a joint was given torque.
    engagements,
}
