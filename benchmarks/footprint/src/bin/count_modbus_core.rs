//! Counts the instructions of the peer `modbus-core`.

#![no_std]
#![no_main]

footprint::count_program!(peers::ModbusCoreServer, peers::work::MODBUS_RTU);
