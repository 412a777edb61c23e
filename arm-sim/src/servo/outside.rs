//! A joint that another simulation moves: its measurements come in, and its set-point goes out.

use super::Servo;

impl Servo {
    /// Lets another simulation move the joint from now on. The arguments are its measurements: the position in millionths of a
    /// count, the distance in a step, and the load in 0.1 %.
    pub(crate) fn measure(&mut self, position: i64, moved: i64, load: i16) {
        self.update_reading();
        self.motor.measure(position, moved, i64::from(load) * 1_000);
    }

    /// This simulation moves the joint again.
    pub(crate) const fn move_inside(&mut self) {
        self.motor.move_inside();
    }

    /// The position that the control aims at, in millionths of a count.
    pub(crate) const fn set_point(&self) -> i64 {
        self.motor.set_point()
    }
}
