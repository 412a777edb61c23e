//! The commands that the servos receive, decoded from the bytes on their wire.

use std::collections::VecDeque;

use motion_core::calibration::{MicroDegrees, angle_from_counts};
use motion_core::servo_bus::frame::{Decoder, Instruction, register};
use protocol_core::registers::Joint;

/// The number of sent frames that are kept for comparison. A servo may decode a frame late, after noise.
const MAX_SENT_FRAMES: usize = 8;

/// Decodes the bytes that reach the servos.
#[derive(Debug)]
pub(super) struct ReceivedCommands {
    decoder: Decoder,
    /// The last frames of the controller, the newest one first.
    sent: VecDeque<Vec<u8>>,
}

impl ReceivedCommands {
    pub(super) const fn new() -> Self {
        Self { decoder: Decoder::new(), sent: VecDeque::new() }
    }

    /// Forgets the bytes of an incomplete frame, because all servos lost their power.
    pub(super) fn clear(&mut self) {
        self.decoder.clear();
    }

    /// The commands in `received`: the frame `sent`, as the servos receive it after disturbances.
    pub(super) fn of_frame(&mut self, sent: &[u8], received: &[u8]) -> Vec<DecodedCommand> {
        let is_full = self.sent.len() == MAX_SENT_FRAMES;
        let mut kept = is_full.then(|| self.sent.pop_back()).flatten().unwrap_or_default();
        kept.clear();
        kept.extend_from_slice(sent);
        self.sent.push_front(kept);
        let mut commands = Vec::new();
        for piece in received.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            while let Some(decoded) = self.next_commands() {
                commands.extend(decoded);
            }
        }
        commands
    }

    /// The commands in the next received frame; `None` if there is no complete frame.
    fn next_commands(&mut self) -> Option<Vec<DecodedCommand>> {
        let Self { decoder, sent, .. } = self;
        let Ok(frame) = decoder.pull()? else { return Some(Vec::new()) };
        let is_own = sent.iter().any(|own| {
            matches!(own.as_slice(), [_, _, id, _, code, params @ .., _]
            if *id == frame.id && *code == frame.code && params == frame.params)
        });
        Some(match (Instruction::from_code(frame.code), frame.params) {
            (Some(Instruction::SyncWrite), [register::GOAL_POSITION, 6, items @ ..]) if is_own => {
                items.chunks_exact(7).filter_map(goal).collect()
            }
            (Some(Instruction::SyncWrite | Instruction::Write), _) if !is_own => {
                Joint::ALL.map(DecodedCommand::Noise).to_vec()
            }
            _ => Vec::new(),
        })
    }
}

/// The effect of a frame on one servo.
#[derive(Clone, Copy, Debug)]
pub(super) enum DecodedCommand {
    /// A goal, in millidegrees.
    Goal(Joint, i32),
    /// A command that the controller did not send.
    Noise(Joint),
}

fn goal(item: &[u8]) -> Option<DecodedCommand> {
    let &[id, high, low, ..] = item else { return None };
    let counts = u16::from_be_bytes([high, low]);
    Joint::from_index(id).map(|joint| DecodedCommand::Goal(joint, millidegrees(joint, counts)))
}

/// The angle of a joint for a position of its servo, without the joint's offset.
pub(super) fn millidegrees(joint: Joint, counts: u16) -> i32 {
    let MicroDegrees(angle) = angle_from_counts(joint, counts, 0);
    angle / 1_000
}
