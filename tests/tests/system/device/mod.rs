//! The device itself: frames, registers, motion, settings, servo faults, and the self-test image.

mod maker_clients;
mod motion;
mod registers;
mod self_test;
mod servo_faults;
mod settings;
mod wire;
