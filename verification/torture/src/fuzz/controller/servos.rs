//! Seven servos without inertia: each is where its last goal was, and answers at once if it is there at all.
//!
//! What they are told is handed to the watch in words. Knows nothing of time.

use motion_core::servo_bus::frame::{Decoder, FrameBuffer, Instruction, Reading, register, status};

/// A frame for the servos, taken apart. Servos count from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// Which servo, and how many registers from its position on.
    Ask(u8, u8),
    /// The code for each servo that is named.
    Torque([Option<u8>; 7]),
    Goals(Vec<(u8, u16)>),
}

pub struct Servos {
    /// Bit n for servo n.
    pub answering: u8,
    pub counts: [u16; 7],
    /// The position in each servo's last answer, in counts.
    pub told: [u16; 7],
}

impl Servos {
    pub const fn new() -> Self {
        Self { answering: 0x7F, counts: [512; 7], told: [512; 7] }
    }

    /// Takes a command; what is said to it.
    pub fn take(&mut self, command: &Command) -> Option<FrameBuffer> {
        match command {
            Command::Ask(id, count) if self.answering >> id & 1 == 1 => Some(self.answer(*id, *count)),
            Command::Goals(goals) => {
                goals.iter().for_each(|&(id, counts)| self.counts[usize::from(id)] = counts);
                None
            }
            _ => None,
        }
    }

    fn answer(&mut self, id: u8, count: u8) -> FrameBuffer {
        self.told[usize::from(id)] = self.counts[usize::from(id)];
        let reading = Reading {
            position_counts: self.counts[usize::from(id)],
            speed: 0,
            load: 0,
            voltage_decivolts: 74,
            temperature_celsius: 30,
        };
        let mut frame = FrameBuffer::new();
        let mut values = reading.to_bytes().to_vec();
        values.resize(count.into(), 0);
        status(&mut frame, id, 0, &values);
        frame
    }
}

/// What the controller says to the servos: always one whole frame, and one of three.
pub fn decode(bytes: &[u8]) -> Command {
    let mut decoder = Decoder::new();
    decoder.push(bytes);
    let frame = decoder.pull().expect("a whole frame").expect("a right checksum");
    assert_eq!(frame.params.len() + 6, bytes.len(), "one frame and no more");
    match (Instruction::from_code(frame.code), frame.params) {
        (Some(Instruction::Read), [register::PRESENT_POSITION, count @ 8..=11]) => {
            Command::Ask(frame.id, *count)
        }
        (Some(Instruction::SyncWrite), [register::TORQUE_SWITCH, 1, items @ ..]) => {
            assert!(!items.is_empty() && items.len().is_multiple_of(2));
            let mut codes = [None; 7];
            items.chunks_exact(2).for_each(|item| codes[usize::from(item[0])] = Some(item[1]));
            Command::Torque(codes)
        }
        (Some(Instruction::SyncWrite), [register::GOAL_POSITION, 6, items @ ..]) => {
            assert!(!items.is_empty() && items.len() % 7 == 0);
            let item = |item: &[u8]| (item[0], u16::from_be_bytes([item[1], item[2]]));
            Command::Goals(items.chunks_exact(7).map(item).collect())
        }
        other => panic!("the controller said {other:?}"),
    }
}
