//! Counts the instructions of the peer `rmodbus`.

#![no_std]
#![no_main]

footprint::count_program!(peers::RmodbusServer, peers::work::MODBUS_RTU);
