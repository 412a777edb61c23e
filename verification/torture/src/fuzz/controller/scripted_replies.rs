//! Scripted replies in place of seven servos: each position is the last goal, or the one that a hand step set. There is no time
//! and no motion.

use motion_core::servo_bus::frame::{Decoder, Instruction, Reading, ServoFrameBuffer, register, status};

/// The largest number of registers in a read that begins at the position.
const MOST_FROM_POSITION: u8 = 11;

/// A decoded command. Servo numbers start at 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ServoCommand {
    /// A read: the servo and the number of registers. A read of up to 11 registers starts at the position,
    /// a longer one at the torque switch.
    Read(u8, u8),
    /// The torque code for each servo in the frame.
    Torque([Option<u8>; 7]),
    Goals(Vec<(u8, u16)>),
}

pub struct ScriptedReplies {
    /// The servos that reply: bit n for servo n.
    pub responding: u8,
    pub counts: [u16; 7],
    /// The code in each servo's torque switch.
    torque: [u8; 7],
    /// The position in each servo's last reply, in counts.
    pub reported_positions: [u16; 7],
}

impl ScriptedReplies {
    pub const fn new() -> Self {
        Self { responding: 0x7F, counts: [512; 7], torque: [0; 7], reported_positions: [512; 7] }
    }

    /// Executes a command. Returns the reply.
    pub fn execute(&mut self, command: &ServoCommand) -> Option<ServoFrameBuffer> {
        match command {
            ServoCommand::Read(id, count) if self.responding >> id & 1 == 1 => Some(self.answer(*id, *count)),
            ServoCommand::Goals(goals) => {
                goals.iter().for_each(|&(id, counts)| self.counts[usize::from(id)] = counts);
                None
            }
            ServoCommand::Torque(codes) => {
                for (torque, code) in self.torque.iter_mut().zip(codes) {
                    *torque = code.unwrap_or(*torque);
                }
                None
            }
            ServoCommand::Read(..) => None,
        }
    }

    fn answer(&mut self, id: u8, count: u8) -> ServoFrameBuffer {
        self.reported_positions[usize::from(id)] = self.counts[usize::from(id)];
        let reading = Reading {
            position_counts: self.counts[usize::from(id)],
            speed: 0,
            load: 0,
            voltage_decivolts: 74,
            temperature_celsius: 30,
        };
        let mut frame = ServoFrameBuffer::new();
        let mut values = Vec::new();
        if count > MOST_FROM_POSITION {
            let [high, low] = self.counts[usize::from(id)].to_be_bytes();
            values.extend([self.torque[usize::from(id)], 0, high, low]);
            values.resize(usize::from(register::PRESENT_POSITION - register::TORQUE_SWITCH), 0);
        }
        values.extend(reading.to_bytes());
        values.resize(count.into(), 0);
        status(&mut frame, id, 0, &values);
        frame
    }
}

/// Decodes a command of the controller. Panics unless `bytes` are exactly one frame of one of the three kinds.
pub fn decode(bytes: &[u8]) -> ServoCommand {
    let mut decoder = Decoder::new();
    decoder.push(bytes);
    let frame = decoder.pull().expect("a complete frame").expect("a valid checksum");
    assert_eq!(frame.params.len() + 6, bytes.len(), "exactly one frame");
    match (Instruction::from_code(frame.code), frame.params) {
        (
            Some(Instruction::Read),
            [register::PRESENT_POSITION, count @ 8..=MOST_FROM_POSITION]
            | [register::TORQUE_SWITCH, count @ 24..=27],
        ) => ServoCommand::Read(frame.id, *count),
        (Some(Instruction::SyncWrite), [register::TORQUE_SWITCH, 1, items @ ..]) => {
            assert!(!items.is_empty() && items.len().is_multiple_of(2));
            let mut codes = [None; 7];
            items.chunks_exact(2).for_each(|item| codes[usize::from(item[0])] = Some(item[1]));
            ServoCommand::Torque(codes)
        }
        (Some(Instruction::SyncWrite), [register::GOAL_POSITION, 6, items @ ..]) => {
            assert!(!items.is_empty() && items.len() % 7 == 0);
            let item = |item: &[u8]| (item[0], u16::from_be_bytes([item[1], item[2]]));
            ServoCommand::Goals(items.chunks_exact(7).map(item).collect())
        }
        other => panic!("the controller sent {other:?}"),
    }
}
