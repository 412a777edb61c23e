//! Arms that are not ours, on real pseudo-terminals: each does what its test tells it to.

// Not every test asks for everything.
#![allow(dead_code)]

use std::io::{ErrorKind, Read, Write};
use std::thread;

use protocol_core::request::{Reply, Request};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, FrameBuffer, ToArm};
use serialport::{SerialPort, TTYPort};

/// Registers 0 to 7 of an arm like ours.
pub(crate) const IDENTITY: [u8; 8] = [7, 30, 1, 2, 3, 4, 5, 6];

/// The frame of a reply.
pub(crate) fn reply(address: u8, values: &[u8]) -> Vec<u8> {
    let mut frame = FrameBuffer::new();
    Reply { address, values }.encode(&mut frame);
    frame.to_vec()
}

/// An arm that answers the n-th read (the first is number 0) with whatever bytes the script says, on a port
/// of this name.
pub(crate) fn arm_of(mut script: impl FnMut(usize, u8, u8) -> Vec<u8> + Send + 'static) -> (String, TTYPort) {
    let mut reads = 0;
    arm_that(move |_, request| match request {
        Request::Read { address, count } => {
            reads += 1;
            script(reads - 1, *address, *count)
        }
        Request::Write { .. } => Vec::new(),
    })
}

/// An arm that does with each request what the script says, given its own end of the line too, on a port of
/// this name. It ends when nobody has the port open any more.
pub(crate) fn arm_that(
    mut script: impl FnMut(&TTYPort, &Request<'_>) -> Vec<u8> + Send + 'static,
) -> (String, TTYPort) {
    let (mut master, slave) = TTYPort::pair().unwrap();
    let name = slave.name().unwrap();
    thread::spawn(move || {
        let mut deframer = Deframer::<ToArm>::new(Duration::from_millis(2));
        let mut chunk = [0; 256];
        loop {
            let length = match master.read(&mut chunk) {
                Ok(length) => length,
                Err(error) if error.kind() == ErrorKind::TimedOut => continue,
                Err(_) => return,
            };
            // No test sends more than the deframer holds at once.
            assert_eq!(deframer.push(Instant::ZERO, &chunk[..length]), length);
            while let Some(found) = deframer.pull() {
                if let Ok(request) = found.map(Request::from_frame) {
                    let answer = script(&master, &request);
                    master.write_all(&answer).unwrap();
                }
            }
        }
    });
    // Whoever holds the other end keeps the port alive between two openings.
    (name, slave)
}

/// An arm with the maker's firmware 2.2: registers without rules, no status block, servos that are where
/// they are sent at once.
pub(crate) fn makers_arm() -> (String, TTYPort) {
    let mut registers = [0; 256];
    registers[..8].copy_from_slice(&[7, 22, 1, 2, 3, 4, 5, 6]);
    registers[28..30].copy_from_slice(&[1, 1]);
    registers[32..39].fill(60);
    registers[54..61].copy_from_slice(&[90, 90, 65, 90, 90, 90, 80]);
    arm_that(move |_, request| match *request {
        Request::Read { address, count } => {
            assert!(address < 240, "the status block is not asked for");
            let first = usize::from(address);
            reply(address, &registers[first..first + usize::from(count)])
        }
        Request::Write { address, values } => {
            let first = usize::from(address);
            registers[first..first + values.len()].copy_from_slice(values);
            registers.copy_within(46..53, 54);
            Vec::new()
        }
    })
}
