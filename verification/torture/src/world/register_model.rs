//! A model of the registers, from docs/protocol.md alone. It does not model measured values, such as positions and
//! missing servos.

use motion_core::Storage;
use protocol_core::registers::map::{
    BAUD_RATE, EEPROM_LOCK, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL,
    LAST_REFUSED_REGISTER, MAP, MOTOR_STATE, PRESENT_POSITION, TARGET_POSITION, motor_state, refusal,
};
use protocol_core::registers::{Access, Image, Joint, MAP_21, Region, Register, RegisterFile};

use super::host_request::HostRequest;
use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// The first address of the EEPROM region, and the first after it.
const EEPROM: (u8, u8) = (8, 28);

/// The required effect of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RequestEffect {
    /// A reply with `count` registers from `address` on.
    Reply { address: u8, count: u8 },
    /// Neither a reply nor a save.
    NoReply { accepted: bool },
    /// A save of these settings.
    Save(Image),
}

/// The modelled registers.
#[derive(Debug)]
pub(super) struct RegisterModel {
    values: [u8; 256],
    rows: Vec<Option<&'static Register>>,
    storage: Storage,
    accepted: u16,
    refused: u16,
    /// True if the host's last target is in force: no release, loss of the servo or correction by the arm followed it.
    pub(super) has_host_target: PerJoint<bool>,
}

/// The first and last addresses of the registers whose values follow from requests alone.
const MODELLED: &[(u8, u8)] = &[(0, 45), (53, 53), (61, 82), (90, 90), (98, 240), (244, 247), (250, 251)];

impl RegisterModel {
    /// The registers after power-up with the stored settings.
    pub(super) fn new(chip_id: [u8; 6], stored: Option<&Image>, storage: Storage) -> Self {
        let rows: Vec<_> = (0..=255).map(protocol_core::registers::map::find).collect();
        let mut model = Self {
            values: [0; 256],
            rows,
            storage,
            accepted: 0,
            refused: 0,
            has_host_target: PerJoint::all(false),
        };
        for row in MAP_21.iter().chain(MAP) {
            (row.address..=row.address + (row.count - 1)).for_each(|at| model.set(at, row.default_at(at)));
        }
        (2..).zip(chip_id).for_each(|(at, byte)| model.set(at, byte));
        stored.into_iter().for_each(|image| model.load(image));
        model
    }

    /// Loads stored settings. A value outside its range is replaced by its default (D19), and reserved registers read 0.
    fn load(&mut self, image: &Image) {
        for (at, byte) in (EEPROM.0..EEPROM.1).zip(image.0) {
            if self
                .row(at)
                .is_some_and(|row| row.access == Access::ReadWrite && row.range.contains(byte.into()))
            {
                self.set(at, byte);
            }
        }
    }

    fn row(&self, at: u8) -> Option<&'static Register> {
        self.rows.get(usize::from(at)).copied().flatten()
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

    /// The present settings.
    pub(super) fn image(&self) -> Image {
        let mut image = Image([0; Image::LENGTH]);
        image.0.iter_mut().zip(EEPROM.0..EEPROM.1).for_each(|(byte, at)| *byte = self.get(at));
        image
    }

    /// Executes a request.
    pub(super) fn execute(&mut self, request: &HostRequest) -> RequestEffect {
        match request {
            HostRequest::Read { address, count } if usize::from(*address) + usize::from(*count) > 256 => {
                self.refuse(refusal::MALFORMED_RANGE, *address)
            }
            HostRequest::Write { address, values } if usize::from(*address) + values.len() > 256 => {
                self.refuse(refusal::MALFORMED_RANGE, *address)
            }
            HostRequest::Read { address, count } => {
                self.accept();
                RequestEffect::Reply { address: *address, count: *count }
            }
            HostRequest::Write { address, values } => self.write(*address, values),
        }
    }

    fn accept(&mut self) {
        self.accepted = self.accepted.wrapping_add(1);
        let [low, high] = self.accepted.to_le_bytes();
        self.set(FRAMES_ACCEPTED.address, low);
        self.set(FRAMES_ACCEPTED.address + 1, high);
    }

    fn refuse(&mut self, reason: u8, at: u8) -> RequestEffect {
        self.refused = self.refused.wrapping_add(1);
        let [low, high] = self.refused.to_le_bytes();
        self.set(FRAMES_REFUSED.address, low);
        self.set(FRAMES_REFUSED.address + 1, high);
        self.set(LAST_REFUSAL.address, reason);
        self.set(LAST_REFUSED_REGISTER.address, at);
        RequestEffect::NoReply { accepted: false }
    }

    /// The registers that a write changes if all values are in range.
    fn effective<'a>(&self, address: u8, values: &'a [u8]) -> impl Iterator<Item = (u8, u8)> + use<'a> {
        let is_open = self.get(EEPROM_LOCK.address) == 0;
        let rows = self.rows.clone();
        (address..=255).zip(values.iter().copied()).filter(move |(at, _)| {
            rows.get(usize::from(*at)).copied().flatten().is_some_and(|row| {
                row.access == Access::ReadWrite && (row.region != Region::Eeprom || is_open)
            })
        })
    }

    fn write(&mut self, address: u8, values: &[u8]) -> RequestEffect {
        let mut items = self.effective(address, values);
        let refused =
            items.find(|(at, value)| self.row(*at).is_some_and(|row| !row.range.contains((*value).into())));
        if let Some((at, _)) = refused {
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
        if changed.is_some() {
            RequestEffect::Save(self.image())
        } else {
            RequestEffect::NoReply { accepted: true }
        }
    }

    fn apply(&mut self, address: u8, values: &[u8]) {
        let was_servo = self.is_servo();
        let items: Vec<_> = self.effective(address, values).collect();
        items.iter().for_each(|(at, value)| self.set(*at, *value));
        if self.is_servo() != was_servo {
            self.has_host_target = PerJoint::all(false);
        }
        for (at, _) in items {
            if let Some(joint) = TARGET_POSITION.joint_at(at) {
                self.has_host_target[joint] = self.is_servo();
            }
        }
    }

    /// The report frequency in Hz.
    pub(super) fn frequency(&self) -> u8 {
        self.get(FEEDBACK_FREQUENCY.address)
    }

    /// Compares the model with the registers of the arm.
    pub(super) fn compare(&self, registers: &RegisterFile) -> Check {
        for (first, last) in MODELLED {
            let range = usize::from(*first)..=usize::from(*last);
            let ours = self.values.get(range).unwrap_or(&[]);
            let theirs = registers.read(*first, last - first + 1);
            ensure(ours == theirs, || {
                let differs = (*first..).zip(ours.iter().zip(theirs)).find(|(_, (a, b))| a != b);
                let (at, (wanted, found)) = differs.unwrap_or((0, (&0, &0)));
                format!("register {at} holds {found} instead of {wanted}")
            })?;
        }
        Ok(())
    }

    /// A target that differs from the model is the measured position (D12, D13). The model takes it over.
    pub(super) fn compare_targets(&mut self, registers: &RegisterFile) -> Check {
        for joint in Joint::ALL {
            let (at, found) = (TARGET_POSITION.of(joint), registers.get(TARGET_POSITION.of(joint)));
            if found == self.get(at) {
                continue;
            }
            let present = registers.get(PRESENT_POSITION.of(joint));
            ensure(found == present, || {
                let wanted = self.get(at);
                let number = joint.number();
                format!("target {number} is {found}: the host wrote {wanted}, and the joint was at {present}")
            })?;
            self.set(at, found);
            self.has_host_target[joint] = false;
        }
        Ok(())
    }
}
