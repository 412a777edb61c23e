//! What was tried in worlds, in numbers.

use std::ops::AddAssign;

/// Counts of one world, or of many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Virtual time, in microseconds.
    pub micros: u64,
    /// Requests that were whole when they came.
    pub requests: u64,
    /// Answers, all of them right.
    pub answers: u64,
    /// Reports.
    pub reports: u64,
    /// Bursts of requests with damage between or in them.
    pub damaged_bursts: u64,
    /// Frames to the servos, each checked.
    pub commands: u64,
    /// Frames damaged or held up on the servo bus.
    pub damaged_servo_frames: u64,
    /// Damaged answers that no checksum spoke against.
    pub deceptions: u64,
    /// Servos that were made faulty, well again, or to start again.
    pub servo_faults: u64,
    /// Times the shell was late.
    pub stalls: u64,
    /// Power cuts in all.
    pub cuts: u64,
    /// Of these, during a start.
    pub cut_starts: u64,
    /// Of these, during a save.
    pub cut_saves: u64,
    /// Settings saved.
    pub saves: u64,
    /// Times a joint was engaged.
    pub engagements: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        let Self { micros, requests, answers, reports, damaged_bursts, commands, .. } = other;
        let Self { damaged_servo_frames, deceptions, servo_faults, stalls, cuts, .. } = other;
        let Self { cut_starts, cut_saves, saves, engagements, .. } = other;
        self.micros += micros;
        self.requests += requests;
        self.answers += answers;
        self.reports += reports;
        self.damaged_bursts += damaged_bursts;
        self.commands += commands;
        self.damaged_servo_frames += damaged_servo_frames;
        self.deceptions += deceptions;
        self.servo_faults += servo_faults;
        self.stalls += stalls;
        self.cuts += cuts;
        self.cut_starts += cut_starts;
        self.cut_saves += cut_saves;
        self.saves += saves;
        self.engagements += engagements;
    }
}
