//! The device itself: frames and registers, with any arm.

mod maker_clients;
mod motion;
mod registers;
mod self_test;
mod servo_faults;
mod settings;
mod wire;
