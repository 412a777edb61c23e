//! Counts the instructions of the peer `postcard` with `cobs`.

#![no_std]
#![no_main]

footprint::count_program!(peers::PostcardServer, peers::work::POSTCARD);
