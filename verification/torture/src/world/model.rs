//! What the registers must hold, from docs/protocol.md alone: the host's idea of the arm.
//!
//! Slow and plain. What only the arm can know (where joints are, which servos answer) it leaves open.

use motion_core::Storage;
use protocol_core::registers::map::{
    BAUD_RATE, EEPROM_LOCK, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL,
    LAST_REFUSED_REGISTER, MAP, MOTOR_STATE, PRESENT_POSITION, TARGET_POSITION, motor_state, refusal,
};
use protocol_core::registers::{Access, Image, Joint, Region, Register, RegisterFile};

use super::asked::Asked;
use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// The first address of the EEPROM region, and the first behind it.
const EEPROM: (u8, u8) = (8, 28);

/// What has to follow from a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// It is answered with this many registers from here on.
    Answer { address: u8, count: u8 },
    /// Nothing that the host hears of at once. It was accepted or not.
    Silence { accepted: bool },
    /// This is to be saved.
    Save(Image),
}

/// The registers.
#[derive(Debug)]
pub(super) struct Model {
    values: [u8; 256],
    rules: Vec<Option<&'static Register>>,
    storage: Storage,
    accepted: u16,
    refused: u16,
    /// Joints whose target was named by the host since they were last released, lost, or found elsewhere.
    pub(super) aimed: PerJoint<bool>,
}

/// The registers whose values follow from requests alone, in runs: first and last.
const KNOWN: &[(u8, u8)] = &[(0, 45), (53, 53), (61, 240), (244, 247), (250, 251)];

impl Model {
    /// An arm after power-up with what the storage held.
    pub(super) fn new(chip_id: [u8; 6], stored: Option<&Image>, storage: Storage) -> Self {
        let rules: Vec<_> = (0..=255).map(protocol_core::registers::map::find).collect();
        let mut model =
            Self { values: [0; 256], rules, storage, accepted: 0, refused: 0, aimed: PerJoint::all(false) };
        for row in MAP {
            (row.address..=row.address + (row.count - 1)).for_each(|at| model.set(at, row.default_at(at)));
        }
        (2..).zip(chip_id).for_each(|(at, byte)| model.set(at, byte));
        stored.into_iter().for_each(|image| model.load(image));
        model
    }

    /// A stored value outside its range counts as its default (D19), and reserved registers read 0.
    fn load(&mut self, image: &Image) {
        for (at, byte) in (EEPROM.0..EEPROM.1).zip(image.0) {
            if self.rule(at).is_some_and(|row| row.access == Access::ReadWrite && row.range.contains(byte)) {
                self.set(at, byte);
            }
        }
    }

    fn rule(&self, at: u8) -> Option<&'static Register> {
        self.rules.get(usize::from(at)).copied().flatten()
    }

    pub(super) fn get(&self, at: u8) -> u8 {
        self.values.get(usize::from(at)).copied().unwrap_or(0)
    }

    fn set(&mut self, at: u8, value: u8) {
        self.values.get_mut(usize::from(at)).into_iter().for_each(|slot| *slot = value);
    }

    pub(super) fn is_servo(&self) -> bool {
        self.get(MOTOR_STATE.address) == motor_state::SERVO
    }

    pub(super) fn baud_code(&self) -> u8 {
        self.get(BAUD_RATE.address)
    }

    pub(super) fn set_storage(&mut self, storage: Storage) {
        self.storage = storage;
    }

    /// The settings as they stand.
    pub(super) fn image(&self) -> Image {
        let mut image = Image([0; Image::LENGTH]);
        image.0.iter_mut().zip(EEPROM.0..EEPROM.1).for_each(|(byte, at)| *byte = self.get(at));
        image
    }

    /// Carries out a request.
    pub(super) fn take(&mut self, asked: &Asked) -> Effect {
        match asked {
            Asked::Read { address, count } if usize::from(*address) + usize::from(*count) > 256 => {
                self.refuse(refusal::MALFORMED_RANGE, *address)
            }
            Asked::Write { address, values } if usize::from(*address) + values.len() > 256 => {
                self.refuse(refusal::MALFORMED_RANGE, *address)
            }
            Asked::Read { address, count } => {
                self.accept();
                Effect::Answer { address: *address, count: *count }
            }
            Asked::Write { address, values } => self.write(*address, values),
        }
    }

    fn accept(&mut self) {
        self.accepted = self.accepted.wrapping_add(1);
        let [low, high] = self.accepted.to_le_bytes();
        self.set(FRAMES_ACCEPTED.address, low);
        self.set(FRAMES_ACCEPTED.address + 1, high);
    }

    fn refuse(&mut self, reason: u8, at: u8) -> Effect {
        self.refused = self.refused.wrapping_add(1);
        let [low, high] = self.refused.to_le_bytes();
        self.set(FRAMES_REFUSED.address, low);
        self.set(FRAMES_REFUSED.address + 1, high);
        self.set(LAST_REFUSAL.address, reason);
        self.set(LAST_REFUSED_REGISTER.address, at);
        Effect::Silence { accepted: false }
    }

    /// The registers that a write would change, were all values right.
    fn effective<'a>(&self, address: u8, values: &'a [u8]) -> impl Iterator<Item = (u8, u8)> + use<'a> {
        let is_open = self.get(EEPROM_LOCK.address) == 0;
        let rules = self.rules.clone();
        (address..=255).zip(values.iter().copied()).filter(move |(at, _)| {
            rules.get(usize::from(*at)).copied().flatten().is_some_and(|row| {
                row.access == Access::ReadWrite && (row.region != Region::Eeprom || is_open)
            })
        })
    }

    fn write(&mut self, address: u8, values: &[u8]) -> Effect {
        let mut items = self.effective(address, values);
        let wrong = items.find(|(at, value)| self.rule(*at).is_some_and(|row| !row.range.contains(*value)));
        if let Some((at, _)) = wrong {
            return self.refuse(refusal::OUT_OF_RANGE, at);
        }
        let is_setting = |at| (EEPROM.0..EEPROM.1).contains(&at);
        let mut items = self.effective(address, values);
        let changed = items.find(|(at, value)| is_setting(*at) && self.get(*at) != *value);
        if let (Some((at, _)), Storage::Full) = (changed, self.storage) {
            return self.refuse(refusal::STORAGE_FULL, at);
        }
        self.apply(address, values);
        self.accept();
        if changed.is_some() { Effect::Save(self.image()) } else { Effect::Silence { accepted: true } }
    }

    fn apply(&mut self, address: u8, values: &[u8]) {
        let was_servo = self.is_servo();
        let items: Vec<_> = self.effective(address, values).collect();
        items.iter().for_each(|(at, value)| self.set(*at, *value));
        if self.is_servo() != was_servo {
            self.aimed = PerJoint::all(false);
        }
        for (at, _) in items {
            if let Some(joint) = TARGET_POSITION.joint_at(at) {
                self.aimed[joint] = self.is_servo();
            }
        }
    }

    /// How often reports are wanted, in Hz.
    pub(super) fn frequency(&self) -> u8 {
        self.get(FEEDBACK_FREQUENCY.address)
    }

    /// Compares with the arm's own registers.
    pub(super) fn compare(&self, arm: &RegisterFile) -> Check {
        for (first, last) in KNOWN {
            let range = usize::from(*first)..=usize::from(*last);
            let ours = self.values.get(range).unwrap_or(&[]);
            let theirs = arm.read(*first, last - first + 1);
            ensure(ours == theirs, || {
                let differs = (*first..).zip(ours.iter().zip(theirs)).find(|(_, (a, b))| a != b);
                let (at, (wanted, found)) = differs.unwrap_or((0, (&0, &0)));
                format!("register {at} holds {found}, and {wanted} is right")
            })?;
        }
        Ok(())
    }

    /// A target that the host did not name is where the joint was measured (D12, D13).
    pub(super) fn compare_targets(&mut self, arm: &RegisterFile) -> Check {
        for joint in Joint::ALL {
            let (at, found) = (TARGET_POSITION.of(joint), arm.get(TARGET_POSITION.of(joint)));
            if found == self.get(at) {
                continue;
            }
            let present = arm.get(PRESENT_POSITION.of(joint));
            ensure(found == present, || {
                let wanted = self.get(at);
                let number = joint.number();
                format!("target {number} is {found}; the host said {wanted}, and the joint was at {present}")
            })?;
            self.set(at, found);
            self.aimed[joint] = false;
        }
        Ok(())
    }
}
