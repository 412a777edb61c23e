//! A model of the registers, from docs/protocol.md alone. It does not model measured values, such as positions and
//! missing servos.

use motion_core::Storage;
use motion_core::calibration::MicroDegrees;
use protocol_core::registers::map::{
    BAUD_RATE, EEPROM_LOCK, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL,
    LAST_REFUSED_REGISTER, MAP, MOTOR_STATE, OFFSET, PRESENT_POSITION, TARGET_POSITION, motor_state, refusal,
};
use protocol_core::registers::{Access, Image, Joint, MAP_21, Region, Register, RegisterFile};

use super::host_request::HostRequest;
use super::map21_model::{self, OutOfReach};
use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// The options of map 2.1: bit 0 biased offsets, bit 1 alarms (M6).
const OPTIONS: u8 = 20;
/// The report frequencies of map 2.1 (M4).
const ANGLE_FREQUENCY: u8 = 82;
const LOAD_FREQUENCY: u8 = 90;
/// The bytes of an alarm.
const ALARM_LENGTH: usize = 7;
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
    /// An alarm of this kind. The request was refused.
    Alarm { kind: u8 },
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
    /// Offsets are shown as 128 + offset (M5). `values` has them in sign and magnitude.
    has_biased_offsets: bool,
    /// A target from inverse kinematics, with its fraction (M7).
    fine_targets: PerJoint<Option<MicroDegrees>>,
}

/// The first and last addresses of the registers whose values follow from requests alone. The host writes none of the
/// extended block, 128 to 191.
const MODELLED: &[(u8, u8)] =
    &[(0, 45), (53, 53), (61, 82), (90, 90), (98, 127), (192, 240), (244, 247), (250, 251)];

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
            has_biased_offsets: false,
            fine_targets: PerJoint::all(None),
        };
        let bytes_of_21 = MAP_21.iter().filter(|row| row.region == Region::Ram);
        for row in bytes_of_21.chain(MAP) {
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
            if at == OPTIONS && byte <= 3 {
                self.set(at, byte);
            }
        }
        self.has_biased_offsets = self.get(OPTIONS) & 1 != 0;
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

    /// Executes a request. An alarm needs `room` bytes on the link.
    pub(super) fn execute(&mut self, request: &HostRequest, room: usize) -> RequestEffect {
        match request {
            HostRequest::Read { address, count } if usize::from(*address) + usize::from(*count) > 256 => {
                self.refuse(refusal::MALFORMED_RANGE, *address)
            }
            HostRequest::Write { address, values } | HostRequest::WriteMap21 { address, values }
                if usize::from(*address) + values.len() > 256 =>
            {
                self.refuse(refusal::MALFORMED_RANGE, *address)
            }
            HostRequest::Read { address, count } => {
                self.accept();
                RequestEffect::Reply { address: *address, count: *count }
            }
            HostRequest::Write { address, values } => {
                let items: Vec<_> = self.effective(*address, values).collect();
                let is_wrong =
                    |at, value| self.row(at).is_some_and(|row| !row.range.contains(u16::from(value)));
                match items.iter().find(|(at, value)| is_wrong(*at, *value)) {
                    Some((at, _)) => self.refuse(refusal::OUT_OF_RANGE, *at),
                    None => self.write(&items),
                }
            }
            HostRequest::WriteMap21 { address, values } => self.write_map21(*address, values, room),
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

    /// The first setting that a write changes.
    fn first_changed_setting(&self, items: &[(u8, u8)]) -> Option<u8> {
        let is_setting = |at| (EEPROM.0..EEPROM.1).contains(&at);
        items.iter().find(|(at, value)| is_setting(*at) && self.get(*at) != *value).map(|(at, _)| *at)
    }

    fn write(&mut self, items: &[(u8, u8)]) -> RequestEffect {
        let changed = self.first_changed_setting(items);
        if let (Some(at), Storage::Full) = (changed, self.storage) {
            return self.refuse(refusal::STORAGE_FULL, at);
        }
        self.apply(items);
        self.has_biased_offsets = false;
        if items.iter().any(|(at, _)| *at == FEEDBACK_FREQUENCY.address) {
            [ANGLE_FREQUENCY, LOAD_FREQUENCY].into_iter().for_each(|at| self.set(at, 0));
        }
        self.accept();
        if changed.is_some() {
            RequestEffect::Save(self.image())
        } else {
            RequestEffect::NoReply { accepted: true }
        }
    }

    /// Executes a write of map 2.1 (M2, M4, M5, M7, M8).
    fn write_map21(&mut self, address: u8, values: &[u8], room: usize) -> RequestEffect {
        let is_open = self.get(EEPROM_LOCK.address) == 0;
        let reach = |at| map21_model::is_writable(at) && (is_open || !(EEPROM.0..EEPROM.1).contains(&at));
        let items: Vec<_> =
            (address..=255).zip(values.iter().copied()).filter(|(at, _)| reach(*at)).collect();
        if let Some((at, _)) = items.iter().find(|(at, value)| !map21_model::is_in_range(*at, *value)) {
            return self.refuse(refusal::OUT_OF_RANGE, *at);
        }
        // 54 to 60 go on showing the present positions (M3).
        let items = items.into_iter().filter(|(at, _)| !PRESENT_POSITION.holds(*at));
        let items: Vec<_> = items.map(|(at, value)| (at, map21_model::stored(at, value))).collect();
        if self.storage == Storage::Full
            && let Some(at) = self.first_changed_setting(&items)
        {
            return self.refuse(refusal::STORAGE_FULL, at);
        }
        let angles = match map21_model::angles(address, values) {
            Ok(angles) => angles,
            Err(OutOfReach { address, kind }) => {
                let refused = self.refuse(refusal::OUT_OF_REACH, address);
                let has_alarm = self.get(OPTIONS) & 2 != 0 && room >= ALARM_LENGTH;
                return if has_alarm { RequestEffect::Alarm { kind } } else { refused };
            }
        };
        let effect = self.write(&items);
        self.has_biased_offsets = true;
        self.set(FEEDBACK_FREQUENCY.address, 0);
        self.aim(&angles);
        effect
    }

    /// Sets the targets from inverse kinematics.
    fn aim(&mut self, angles: &[Option<f32>; 7]) {
        for (joint, angle) in Joint::ALL.into_iter().zip(angles) {
            if let Some(angle) = angle {
                let target = MicroDegrees::nearest(*angle);
                self.set(TARGET_POSITION.of(joint), target.nearest_degree());
                self.fine_targets[joint] = Some(target);
                self.has_host_target[joint] = self.is_servo();
            }
        }
    }

    fn apply(&mut self, items: &[(u8, u8)]) {
        let was_servo = self.is_servo();
        items.iter().for_each(|(at, value)| self.set(*at, *value));
        if self.is_servo() != was_servo {
            self.has_host_target = PerJoint::all(false);
        }
        for (at, _) in items {
            if let Some(joint) = TARGET_POSITION.joint_at(*at) {
                self.fine_targets[joint] = None;
                self.has_host_target[joint] = self.is_servo();
            }
        }
    }

    /// The report frequencies in Hz: registers 53, 82 and 90.
    pub(super) fn frequencies(&self) -> [u8; 3] {
        [FEEDBACK_FREQUENCY.address, ANGLE_FREQUENCY, LOAD_FREQUENCY].map(|at| self.get(at))
    }

    /// A joint's offset in degrees.
    pub(super) fn offset(&self, joint: Joint) -> i8 {
        i8::try_from(OFFSET.range.decode_byte(self.get(OFFSET.of(joint)))).unwrap_or(0)
    }

    /// The target with its fraction, if inverse kinematics set it and it is in force.
    pub(super) fn fine_target(&self, joint: Joint) -> Option<MicroDegrees> {
        self.fine_targets[joint].filter(|_| self.has_host_target[joint])
    }

    /// The values that a read shows.
    fn shown(&self, first: u8, last: u8) -> Vec<u8> {
        let shown = |at| match self.has_biased_offsets {
            true => map21_model::shown(at, self.get(at)),
            false => self.get(at),
        };
        (first..=last).map(shown).collect()
    }

    /// Compares the model with the registers of the arm.
    pub(super) fn compare(&self, registers: &RegisterFile) -> Check {
        for (first, last) in MODELLED {
            let ours = self.shown(*first, *last);
            let theirs = registers.read(*first, last - first + 1);
            ensure(ours == theirs, || {
                let differs = (*first..).zip(ours.iter().zip(theirs)).find(|(_, (a, b))| a != b);
                let (at, (wanted, found)) = differs.unwrap_or((0, (&0, &0)));
                format!("register {at} holds {found} instead of {wanted}")
            })?;
        }
        let [angles, positions] = [83, 54].map(|first| registers.read(first, 7));
        ensure(angles == positions, || format!("angles {angles:?} of positions {positions:?}"))?;
        let loads = registers.read(91, 7);
        ensure(loads.iter().all(|load| (3..=253).contains(load)), || format!("loads {loads:?}"))
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
            self.fine_targets[joint] = None;
            self.has_host_target[joint] = false;
        }
        Ok(())
    }
}
