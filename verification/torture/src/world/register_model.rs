//! A model of the registers without measured values such as positions. Its rules come from docs/protocol.md, and most of its
//! addresses, ranges and defaults from the register map; `map21_model` and `extended_model` have their own.

mod comparison;
pub(crate) mod limits;
mod own_target;
mod targets;

use motion_core::Storage;
use motion_core::calibration::MicroDegrees;
use protocol_core::registers::map::{
    BAUD_RATE, EEPROM_LOCK, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL,
    LAST_REFUSED_REGISTER, MAP, MOTOR_STATE, OFFSET, PRESENT_POSITION, TARGET_POSITION, motor_state, refusal,
};
use protocol_core::registers::{Access, Image, Joint, MAP_21, Region, Register};

use super::extended_model;
use super::host_request::HostRequest;
use super::map21_model::{self, OutOfReach};
use super::protection_model;
use super::written_targets::WrittenTargets;
use crate::per_joint::PerJoint;
pub(crate) use own_target::OwnTarget;

/// The options of map 2.1: bit 0 biased offsets, bit 1 alarms (M6).
const OPTIONS: u8 = 20;
/// The report frequencies of map 2.1 (M4).
const ANGLE_FREQUENCY: u8 = 82;
const LOAD_FREQUENCY: u8 = 90;
/// The length of an alarm frame in bytes.
const ALARM_LENGTH: usize = 7;
/// The first address of the EEPROM region, and the first after it.
const EEPROM: (u8, u8) = (8, 28);

/// The required effect of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RequestEffect {
    /// A reply with `count` registers from `address` on.
    Reply { address: u8, count: u8 },
    /// Neither a reply nor a save.
    NoReply { accepted: bool },
    /// A save of these settings.
    Save(Image),
    /// An alarm of this kind. The request was refused.
    Alarm { kind: u8 },
}

#[derive(Clone, Debug)]
pub(crate) struct RegisterModel {
    values: [u8; 256],
    rows: Vec<Option<&'static Register>>,
    storage: Storage,
    accepted: u16,
    refused: u16,
    /// True if the host's last target is in force: since the host wrote it, the joint was not released, its servo was not lost,
    /// and the arm did not replace the target.
    pub(crate) has_host_target: PerJoint<bool>,
    /// Offsets are shown as 128 + offset (M5). `values` has them in sign and magnitude.
    has_biased_offsets: bool,
    /// The targets as the host wrote them, while no measured position can have replaced them.
    pub(crate) targets: PerJoint<Option<MicroDegrees>>,
    has_streams: bool,
    /// The last targets that were not points of a stream, in degrees. A joint that is let go takes only these (D28).
    firm_targets: PerJoint<u8>,
    /// How often the host wrote each target.
    pub(crate) target_writes: PerJoint<u64>,
    /// The goals that servos with torque held when the controller started, in degrees. They may become targets (D12).
    pub(crate) held_targets: PerJoint<Option<u8>>,
    /// The targets that the arm may have set itself (D27, D28).
    pub(crate) own_targets: PerJoint<OwnTarget>,
    /// The outcome of the next write under the limits, if the arm's registers tell it. `Some(Some(register))`: a refusal names this
    /// register. `Some(None)`: the limits allow the write.
    pub(crate) told: Option<Option<u8>>,
    /// The possible outcomes of the last request under the limits.
    outcomes: Vec<Option<u8>>,
}

impl RegisterModel {
    /// The registers after power-up with the stored settings.
    pub(crate) fn new(chip_id: [u8; 6], stored: Option<&Image>, storage: Storage) -> Self {
        let rows: Vec<_> = (0..=255).map(protocol_core::registers::map::find).collect();
        let mut model = Self {
            values: [0; 256],
            rows,
            storage,
            accepted: 0,
            refused: 0,
            has_host_target: PerJoint::all(false),
            has_biased_offsets: false,
            targets: PerJoint::all(None),
            has_streams: false,
            firm_targets: PerJoint::all(0),
            target_writes: PerJoint::all(0),
            held_targets: PerJoint::all(None),
            own_targets: PerJoint::all(OwnTarget::Measured),
            told: None,
            outcomes: vec![None],
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
            let is_stored =
                |row: &Register| row.access == Access::ReadWrite && row.range.contains(byte.into());
            if self.row(at).is_some_and(is_stored) || at == OPTIONS && byte <= 3 {
                self.set(at, byte);
            }
        }
        self.has_biased_offsets = self.get(OPTIONS) & 1 != 0;
    }

    fn row(&self, at: u8) -> Option<&'static Register> {
        self.rows.get(usize::from(at)).copied().flatten()
    }

    pub(crate) fn get(&self, at: u8) -> u8 {
        self.values.get(usize::from(at)).copied().unwrap_or(0)
    }

    fn set(&mut self, at: u8, value: u8) {
        self.values.get_mut(usize::from(at)).into_iter().for_each(|slot| *slot = value);
    }

    pub(crate) fn is_servo(&self) -> bool {
        self.get(MOTOR_STATE.address) == motor_state::SERVO
    }

    pub(crate) fn baud_code(&self) -> u8 {
        self.get(BAUD_RATE.address)
    }

    pub(crate) fn set_storage(&mut self, storage: Storage) {
        self.storage = storage;
    }

    /// The present settings.
    pub(crate) fn image(&self) -> Image {
        let mut image = Image([0; Image::LENGTH]);
        image.0.iter_mut().zip(EEPROM.0..EEPROM.1).for_each(|(byte, at)| *byte = self.get(at));
        image
    }

    /// Executes a request. `room` is the number of free bytes on the link: an alarm that does not fit is skipped (M8).
    pub(crate) fn execute(&mut self, request: &HostRequest, room: usize) -> RequestEffect {
        self.outcomes = vec![None];
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
                match self.first_offence(&items) {
                    Some((reason, at)) => self.refuse(reason, at),
                    None => {
                        self.write(&WrittenTargets { items: &items, reached: PerJoint::all(None), block: 0 })
                    }
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

    /// The reason why a write has to be refused, and the register that the refusal names (D16, D22).
    fn first_offence(&self, items: &[(u8, u8)]) -> Option<(u8, u8)> {
        items.iter().find_map(|&(at, value)| {
            let is_wrong = self.row(at).is_some_and(|row| !row.range.contains(u16::from(value)));
            match extended_model::is_word(at) {
                true => extended_model::word_offence(items, at),
                false => is_wrong.then_some((refusal::OUT_OF_RANGE, at)),
            }
        })
    }

    /// The first setting that a write changes.
    fn first_changed_setting(&self, items: &[(u8, u8)]) -> Option<u8> {
        let is_setting = |at| (EEPROM.0..EEPROM.1).contains(&at);
        items.iter().find(|(at, value)| is_setting(*at) && self.get(*at) != *value).map(|(at, _)| *at)
    }

    fn write(&mut self, written: &WrittenTargets<'_>) -> RequestEffect {
        let items = written.items;
        let changed = self.first_changed_setting(items);
        if let (Some(at), Storage::Full) = (changed, self.storage) {
            return self.refuse(refusal::STORAGE_FULL, at);
        }
        self.outcomes = self.limit_outcomes(written);
        if let Some(at) = self.told.or(self.outcomes.first().copied()).flatten() {
            return self.refuse(refusal::AGAINST_A_LIMIT, at);
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
        let reached = PerJoint(angles.map(|angle| angle.map(MicroDegrees::nearest)));
        let block = map21_model::block_of(address, values);
        let effect = self.write(&WrittenTargets { items: &items, reached, block });
        if effect == (RequestEffect::NoReply { accepted: false }) {
            return effect;
        }
        self.has_biased_offsets = true;
        self.set(FEEDBACK_FREQUENCY.address, 0);
        self.aim(&reached);
        effect
    }

    /// Sets the targets from inverse kinematics.
    fn aim(&mut self, reached: &PerJoint<Option<MicroDegrees>>) {
        for (joint, target) in Joint::ALL.into_iter().zip(reached.0) {
            let Some(target) = target else { continue };
            self.set_target(joint, target);
            self.firm_targets[joint] = target.nearest_degree();
        }
    }

    /// True if the set-point period was above 0 since power-up, so that fine targets may be points of a stream (D23).
    pub(crate) const fn has_streams(&self) -> bool {
        self.has_streams
    }

    fn apply(&mut self, items: &[(u8, u8)]) {
        let was_servo = self.is_servo();
        items.iter().for_each(|(at, value)| self.set(*at, *value));
        if items.iter().any(|(at, _)| *at == MOTOR_STATE.address) {
            self.set(protection_model::SUPPLY_LOST, 0);
        }
        self.state_changed(was_servo);
        for (at, value) in items {
            if let Some(joint) = TARGET_POSITION.joint_at(*at) {
                self.set_target(joint, MicroDegrees::from_degrees(*value));
                self.firm_targets[joint] = *value;
            }
        }
        self.has_streams |= items.iter().any(|(at, value)| matches!(at, 184 | 185) && *value != 0);
        let is_stream = [184, 185].into_iter().any(|at| self.get(at) != 0);
        for (joint, hundredths) in extended_model::fine_targets(items) {
            let target = extended_model::angle(hundredths);
            self.set_target(joint, target);
            if !is_stream {
                self.firm_targets[joint] = target.nearest_degree();
            }
        }
    }

    /// The report frequencies in Hz: registers 53, 82 and 90.
    pub(crate) fn frequencies(&self) -> [u8; 3] {
        [FEEDBACK_FREQUENCY.address, ANGLE_FREQUENCY, LOAD_FREQUENCY].map(|at| self.get(at))
    }

    /// The content of the reports of register 53: register 189 (D26).
    pub(crate) fn report_content(&self) -> u8 {
        self.get(extended_model::REPORT_CONTENT)
    }

    /// The limit of a joint's push in 0.1 % of the stall torque; `None` without protection or outside motor state servo (D27).
    pub(crate) fn push_limit(&self, joint: Joint) -> Option<i16> {
        protection_model::limit(joint, |at| self.get(at)).filter(|_| self.is_servo())
    }

    /// A joint's offset in degrees.
    pub(crate) fn offset(&self, joint: Joint) -> i8 {
        i8::try_from(OFFSET.range.decode_byte(self.get(OFFSET.of(joint)))).unwrap_or(0)
    }
}
