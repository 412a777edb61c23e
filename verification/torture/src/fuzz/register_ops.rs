//! The register file against a model with its own table, written from `docs/protocol.md`, section 3, alone.

use arbitrary::Arbitrary;
use protocol_core::registers::map::{FRAMES_ACCEPTED, FRAMES_CORRUPTED};
use protocol_core::registers::{Image, RegisterFile};

/// The input of a run.
#[derive(Arbitrary, Debug)]
pub struct Input<'a> {
    steps: Vec<RegisterStep<'a>>,
}

#[derive(Arbitrary, Debug)]
enum RegisterStep<'a> {
    Write {
        address: u8,
        values: &'a [u8],
    },
    Read {
        address: u8,
        count: u8,
    },
    /// The arm sets a measured value.
    Measure {
        joint: u8,
        degrees: u8,
    },
    Count {
        corrupted: bool,
        times: u16,
    },
    /// A restart with the saved settings.
    Restart {
        chip_id: [u8; 6],
    },
    /// A restart with the settings of a faulty flash.
    RestartWith {
        stored: [u8; Image::LENGTH],
    },
}

/// Runs the operations. Panics if the register file differs from the model.
pub fn run(input: &Input<'_>) {
    let mut arm = FileAndModel::new([0; 6], &[0xFF; Image::LENGTH]);
    for step in &input.steps {
        arm.step(step);
    }
    assert_eq!(arm.file.read(0, 255), &arm.model.0[..255]);
    assert_eq!(arm.file.get(255), arm.model.0[255]);
}

/// The register file and its model.
struct FileAndModel {
    file: RegisterFile,
    model: TableModel,
}

impl FileAndModel {
    fn new(chip_id: [u8; 6], stored: &[u8; Image::LENGTH]) -> Self {
        Self {
            file: RegisterFile::new(chip_id, Some(&Image(*stored))),
            model: TableModel::new(chip_id, stored),
        }
    }

    fn step(&mut self, step: &RegisterStep<'_>) {
        match *step {
            RegisterStep::Write { address, values } => self.write(address, &values[..values.len().min(255)]),
            RegisterStep::Read { address, count } => {
                let start = usize::from(address);
                let expected = self.model.0.get(start..start + usize::from(count)).unwrap_or(&[]);
                assert_eq!(self.file.read(address, count), expected);
            }
            RegisterStep::Measure { joint, degrees } => {
                self.file.set(54 + joint % 7, degrees);
                self.model.0[usize::from(54 + joint % 7)] = degrees;
            }
            RegisterStep::Count { corrupted, times } => self.count(corrupted, times % 300),
            RegisterStep::Restart { chip_id } => {
                let Image(stored) = self.file.image();
                assert_eq!(stored, self.model.settings());
                *self = Self::new(chip_id, &stored);
            }
            RegisterStep::RestartWith { stored } => *self = Self::new([9; 6], &stored),
        }
    }

    fn write(&mut self, address: u8, values: &[u8]) {
        let expected = self.model.after(address, values);
        let accepted = match self.file.check(address, values) {
            Ok(accepted) => accepted,
            Err(wrong) => {
                assert_eq!(expected.err(), Some(wrong.address));
                assert_eq!(wrong.value, values[usize::from(wrong.address - address)]);
                return;
            }
        };
        let after = expected.expect("the model refuses this write");
        let changes = (8..=27_u8).find(|&at| after.0[usize::from(at)] != self.model.0[usize::from(at)]);
        assert_eq!(self.file.first_changed_setting(&accepted), changes);
        let end = usize::from(address) + values.len();
        for at in (address.saturating_sub(1)..=255).take_while(|at| usize::from(*at) <= end) {
            let value = at.checked_sub(address).and_then(|offset| values.get(usize::from(offset))).copied();
            assert_eq!(accepted.value_at(at), value.filter(|_| self.model.takes_effect(at)), "register {at}");
        }
        self.file.apply(&accepted);
        self.model = after;
    }

    fn count(&mut self, corrupted: bool, times: u16) {
        let (row, low) = if corrupted { (FRAMES_CORRUPTED, 248) } else { (FRAMES_ACCEPTED, 246) };
        (0..times).for_each(|_| self.file.increment(&row));
        let counter = &mut self.model.0[low..low + 2];
        let count = u16::from_le_bytes([counter[0], counter[1]]).wrapping_add(times);
        counter.copy_from_slice(&count.to_le_bytes());
    }
}

/// The values of all 256 registers.
#[derive(Clone)]
struct TableModel([u8; 256]);

impl TableModel {
    fn new(chip_id: [u8; 6], stored: &[u8; Image::LENGTH]) -> Self {
        let mut values = [0; 256];
        values[..2].copy_from_slice(&[7, 30]);
        values[2..8].copy_from_slice(&chip_id);
        for (at, &value) in (8..).zip(stored) {
            if (11..=19).contains(&at) && is_in_range(at, value) {
                values[usize::from(at)] = value;
            }
        }
        values[28..30].copy_from_slice(&[1, 1]);
        values[32..39].copy_from_slice(&[60; 7]);
        values[46..53].copy_from_slice(&[90, 90, 65, 90, 90, 90, 80]);
        values[240] = 1;
        Self(values)
    }

    fn takes_effect(&self, address: u8) -> bool {
        match address {
            11..=19 => self.0[28] == 0,
            28..=53 => true,
            _ => false,
        }
    }

    /// The values after a write, or the first register that is out of range (D15 to D17).
    fn after(&self, address: u8, values: &[u8]) -> Result<Self, u8> {
        let mut after = self.clone();
        for (at, &value) in (address..=255).zip(values).filter(|(at, _)| self.takes_effect(*at)) {
            if !is_in_range(at, value) {
                return Err(at);
            }
            after.0[usize::from(at)] = value;
        }
        Ok(after)
    }

    fn settings(&self) -> &[u8] {
        &self.0[8..=27]
    }
}

/// The column "range" of the writable registers.
fn is_in_range(address: u8, value: u8) -> bool {
    let max = match address {
        12 => 7,
        13..=19 => return value & 0x7F <= 16,
        28 | 30 | 31 => 1,
        29 => 2,
        32..=45 => 100,
        46..=52 => 180,
        53 => 50,
        _ => 255,
    };
    value <= max
}
