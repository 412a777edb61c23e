//! Counts the instructions of the peer `mavlink`.

#![no_std]
#![no_main]

footprint::count_program!(peers::MavlinkServer, peers::work::MAVLINK);
