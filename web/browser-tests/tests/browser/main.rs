//! The page in real browsers: one program, which `cargo xtask test` runs by its name.

mod class;
mod controls;
mod editor;
mod endurance;
mod exercises;
mod faults;
mod figures;
mod firefox;
mod moving;
mod page;
mod parts;
mod pictures;
mod pixels;
mod programs;
mod recording;
mod served_arm;
mod time_line;
