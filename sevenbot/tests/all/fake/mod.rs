//! Scripted arms on real pseudo-terminals.

// The tests of sevenbot-cli use a part of it.
#![allow(dead_code)]

use std::io::{ErrorKind, Read, Write};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;

use protocol_core::request::{Reply, Request};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, FrameBuffer, ToArm};
use serialport::{SerialPort, TTYPort};

/// Registers 0 to 7 of an arm with this project's firmware.
pub(crate) const IDENTITY: [u8; 8] = [7, 30, 1, 2, 3, 4, 5, 6];

/// The present positions in [`moving_registers`].
pub(crate) const POSE: [u8; 7] = [120, 90, 65, 90, 90, 90, 0];

pub(crate) fn reply(address: u8, values: &[u8]) -> Vec<u8> {
    let mut frame = FrameBuffer::new();
    Reply { address, values }.encode(&mut frame);
    frame.to_vec()
}

/// Starts an arm that answers each read with the bytes from `script`: number of the read (from 0), address, count.
pub(crate) fn answering_arm(
    mut script: impl FnMut(usize, u8, u8) -> Vec<u8> + Send + 'static,
) -> (String, TTYPort) {
    let mut reads = 0;
    scripted_arm(move |_, request| match request {
        Request::Read { address, count } => {
            reads += 1;
            script(reads - 1, *address, *count)
        }
        Request::Write { .. } | Request::WriteMap21 { .. } => Vec::new(),
    })
}

/// Starts an arm that answers each request with the bytes from `script`. It ends when its port is closed.
pub(crate) fn scripted_arm(
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
            // No test sends more than the deframer holds.
            assert_eq!(deframer.push(Instant::ZERO, &chunk[..length]), length);
            while let Some(found) = deframer.pull() {
                if let Ok(request) = found.map(Request::from_frame) {
                    let answer = script(&master, &request);
                    master.write_all(&answer).unwrap();
                }
            }
        }
    });
    // While the caller holds this end, the port stays open.
    (name, slave)
}

/// An arm with the maker's firmware 2.2: no ranges, no status block, and its servos are at their targets at once.
pub(crate) fn makers_arm() -> (String, TTYPort) {
    let mut registers = [0; 256];
    registers[..8].copy_from_slice(&[7, 22, 1, 2, 3, 4, 5, 6]);
    registers[28..30].copy_from_slice(&[1, 1]);
    registers[32..39].fill(60);
    registers[54..61].copy_from_slice(&[90, 90, 65, 90, 90, 90, 80]);
    scripted_arm(move |_, request| match *request {
        Request::Read { address, count } => {
            assert!(address < 240, "the status block is not asked for");
            let first = usize::from(address);
            reply(address, &registers[first..first + usize::from(count)])
        }
        Request::Write { address, values } | Request::WriteMap21 { address, values } => {
            let first = usize::from(address);
            registers[first..first + values.len()].copy_from_slice(values);
            registers.copy_within(46..53, 54);
            Vec::new()
        }
    })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LineFault {
    Lost,
    Garbled,
    /// A reply arrives together with the next one. A request is lost.
    Late,
}

/// Registers of an arm in the servo state. Joints 1 and 7 are moving; joint 7 is at 0 degrees.
pub(crate) fn moving_registers() -> Arc<Mutex<[u8; 256]>> {
    let mut registers = [0; 256];
    registers[..8].copy_from_slice(&IDENTITY);
    registers[28..30].copy_from_slice(&[1, 1]);
    registers[46..53].copy_from_slice(&[170, 90, 65, 90, 90, 90, 80]);
    registers[54..61].copy_from_slice(&POSE);
    registers[240] = 1;
    registers[243] = 0b100_0001;
    Arc::new(Mutex::new(registers))
}

/// Carries out a request and returns the reply. A write ends all motion.
pub(crate) fn execute(registers: &mut [u8; 256], request: &Request<'_>) -> Vec<u8> {
    match *request {
        Request::Read { address, count } => {
            let first = usize::from(address);
            reply(address, &registers[first..first + usize::from(count)])
        }
        Request::Write { address, values } | Request::WriteMap21 { address, values } => {
            let first = usize::from(address);
            registers[first..first + values.len()].copy_from_slice(values);
            registers[243] = 0;
            Vec::new()
        }
    }
}

/// An arm with these registers. The line damages frame number `faulty_frame`, counted over requests and replies.
pub(crate) fn arm_on_faulty_line(
    registers: &Arc<Mutex<[u8; 256]>>,
    faulty_frame: usize,
    fault: LineFault,
) -> (String, TTYPort) {
    let registers = Arc::clone(registers);
    let (mut frame, mut late) = (0, Vec::new());
    let mut is_faulty = move || {
        frame += 1;
        frame - 1 == faulty_frame
    };
    scripted_arm(move |_, request| {
        let mut registers = registers.lock().unwrap();
        if is_faulty() {
            registers[248] += u8::from(fault == LineFault::Garbled);
            return Vec::new();
        }
        let mut bytes = execute(&mut registers, request);
        if !bytes.is_empty() && is_faulty() {
            match fault {
                LineFault::Lost => bytes.clear(),
                LineFault::Garbled => bytes[5] ^= 1,
                LineFault::Late => late = std::mem::take(&mut bytes),
            }
            return bytes;
        }
        [std::mem::take(&mut late), bytes].concat()
    })
}

/// An arm that loses all writes after the first `takes` writes. The receiver gets a message for each write, lost or not.
pub(crate) fn arm_that_loses_writes_after(takes: usize) -> (String, TTYPort, mpsc::Receiver<()>) {
    let registers = moving_registers();
    let (report_write, writes) = mpsc::channel();
    let mut count = 0;
    let (name, port) = scripted_arm(move |_, request| {
        let mut registers = registers.lock().unwrap();
        if matches!(request, Request::Write { .. }) {
            count += 1;
            let _ = report_write.send(());
            if count > takes {
                return Vec::new();
            }
        }
        let reply = execute(&mut registers, request);
        // The joints never arrive.
        registers[243] = 0b100_0001;
        reply
    });
    (name, port, writes)
}
