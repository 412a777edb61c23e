//! Counts the instructions of this project's parse-and-reply path.

#![no_std]
#![no_main]

footprint::count_program!(peers::OurServer, peers::work::SEVEN_BOT);
