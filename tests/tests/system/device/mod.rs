//! The device itself: frames, registers, motion, settings, servo faults, the calls of the maker's programs, and the self-test
//! image.

mod maker_clients;
mod motion;
mod registers;
mod self_test;
mod servo_faults;
mod settings;
mod wire;
