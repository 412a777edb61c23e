//! The register file against a model with its own tables, written from `docs/protocol.md` and `docs/registers.md`.

use arbitrary::Arbitrary;
use protocol_core::registers::map::{FRAMES_ACCEPTED, FRAMES_CORRUPTED};
use protocol_core::registers::{Image, Map, RegisterFile};

/// The steps of a run: requests, measured values, counts and restarts.
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
    WriteMap21 {
        address: u8,
        values: &'a [u8],
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
    assert_eq!(arm.file.read(0, 255), &arm.model.shown()[..255]);
    assert_eq!(arm.file.get(255), arm.model.shown()[255]);
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
            RegisterStep::Write { address, values } => {
                self.write(Map::V22, address, &values[..values.len().min(255)])
            }
            RegisterStep::WriteMap21 { address, values } => {
                self.write(Map::V21, address, &values[..values.len().min(255)]);
            }
            RegisterStep::Read { address, count } => {
                let start = usize::from(address);
                let shown = self.model.shown();
                let expected = shown.get(start..start + usize::from(count)).unwrap_or(&[]);
                assert_eq!(self.file.read(address, count), expected);
            }
            RegisterStep::Measure { joint, degrees } => {
                self.file.set(54 + joint % 7, degrees);
                self.model.values[usize::from(54 + joint % 7)] = degrees;
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

    fn write(&mut self, map: Map, address: u8, values: &[u8]) {
        let expected = self.model.after(map, address, values);
        let checked = match map {
            Map::V22 => self.file.check(address, values),
            Map::V21 => self.file.check_map21(address, values),
        };
        let accepted = match checked {
            Ok(accepted) => accepted,
            Err(refused) => {
                assert_eq!(expected.err(), Some((refused.reason, refused.address)));
                return;
            }
        };
        let after = expected.expect("the model refuses this write");
        let (now, then) = (&self.model.values, &after.values);
        let changes = (8..=27_u8).find(|&at| then[usize::from(at)] != now[usize::from(at)]);
        assert_eq!(self.file.first_changed_setting(&accepted), changes);
        let end = usize::from(address) + values.len();
        for at in (address.saturating_sub(1)..=255).take_while(|at| usize::from(*at) <= end) {
            let value = at.checked_sub(address).and_then(|offset| values.get(usize::from(offset))).copied();
            let value = value.filter(|_| self.model.takes_effect(map, at));
            assert_eq!(accepted.value_at(at), value.map(|value| stored(map, at, value)), "register {at}");
        }
        self.file.apply(&accepted);
        self.model = after;
    }

    fn count(&mut self, corrupted: bool, times: u16) {
        let (row, low) = if corrupted { (FRAMES_CORRUPTED, 248) } else { (FRAMES_ACCEPTED, 246) };
        (0..times).for_each(|_| self.file.increment(&row));
        let counter = &mut self.model.values[low..low + 2];
        let count = u16::from_le_bytes([counter[0], counter[1]]).wrapping_add(times);
        counter.copy_from_slice(&count.to_le_bytes());
    }
}

/// The values of all 256 registers.
#[derive(Clone)]
struct TableModel {
    /// Offsets are in sign and magnitude, whatever `offsets_in` says.
    values: [u8; 256],
    /// The encoding in which a read shows the offsets: the map of the last accepted write, or before it the map of register 20
    /// (M5).
    offsets_in: Map,
}

impl TableModel {
    fn new(chip_id: [u8; 6], stored: &[u8; Image::LENGTH]) -> Self {
        let mut values = [0; 256];
        values[..2].copy_from_slice(&[7, 30]);
        values[2..8].copy_from_slice(&chip_id);
        for (at, &value) in (8..).zip(stored) {
            if (11..=19).contains(&at) && is_in_range(Map::V22, at, value) || at == 20 && value <= 3 {
                values[usize::from(at)] = value;
            }
        }
        values[28..30].copy_from_slice(&[1, 1]);
        values[32..39].copy_from_slice(&[60; 7]);
        values[46..53].copy_from_slice(&[90, 90, 65, 90, 90, 90, 80]);
        values[66] = 1;
        values[91..98].copy_from_slice(&[128; 7]);
        for (place, target) in (128..).step_by(2).zip([9_000_u16, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000]) {
            values[place..place + 2].copy_from_slice(&target.to_le_bytes());
        }
        values[142..156].copy_from_slice(&[0xFF; 14]);
        values[191..195].copy_from_slice(&[1, 1, 70, 40]);
        values[199] = 1;
        values[240] = 1;
        let offsets_in = if values[20] % 2 == 1 { Map::V21 } else { Map::V22 };
        Self { values, offsets_in }
    }

    fn takes_effect(&self, map: Map, address: u8) -> bool {
        match (address, map) {
            (11..=19, _) | (20, Map::V21) => self.values[28] == 0,
            (28..=52, _)
            | (53 | 128..=141 | 184..=189 | 192..=194, Map::V22)
            | (54..=66 | 68..=73 | 82 | 90, Map::V21) => true,
            _ => false,
        }
    }

    /// The values after a write, or the reason and the first register of a refusal (D15 to D17, D22).
    fn after(&self, map: Map, address: u8, values: &[u8]) -> Result<Self, (u8, u8)> {
        let mut after = self.clone();
        after.offsets_in = map;
        for (at, &value) in (address..=255).zip(values).filter(|(at, _)| self.takes_effect(map, *at)) {
            let byte = |at: u8| values.get(usize::from(at.checked_sub(address)?)).copied();
            match word_at(at).map(|low| (low, byte(low), byte(low + 1))) {
                None if !is_in_range(map, at, value) => return Err((2, at)),
                Some((low, Some(first), Some(second)))
                    if !is_word(low, u16::from_le_bytes([first, second])) =>
                {
                    return Err((2, low));
                }
                Some((low, None, _) | (low, _, None)) => return Err((4, low)),
                _ => {}
            }
            // A write to 54..60 in map 2.1 does not change them: they hold the present positions.
            if !(54..=60).contains(&at) {
                after.values[usize::from(at)] = stored(map, at, value);
            }
        }
        Ok(after)
    }

    /// The values that a read returns.
    fn shown(&self) -> [u8; 256] {
        let mut shown = self.values;
        if self.offsets_in == Map::V21 {
            for offset in &mut shown[13..20] {
                *offset = if *offset < 128 { 128 + *offset } else { 0u8.wrapping_sub(*offset) };
            }
        }
        shown
    }

    fn settings(&self) -> &[u8] {
        &self.values[8..=27]
    }
}

/// The byte that a write stores: an offset in sign and magnitude.
fn stored(map: Map, address: u8, value: u8) -> u8 {
    match (map, address, value) {
        (Map::V21, 13..=19, 128..=144) => value - 128,
        (Map::V21, 13..=19, 112..=127) => 0x80 | (128 - value),
        (Map::V21, 13..=19, 240..=255) => 0x80 | (255 - value + 1),
        _ => value,
    }
}

/// The address of the low byte of the writable two-byte register that holds `address`; `None` if there is none.
fn word_at(address: u8) -> Option<u8> {
    matches!(address, 128..=141 | 184..=185).then_some(address & !1)
}

/// True if `word` is in the range of the writable two-byte register at `low`, according to `docs/protocol.md`.
fn is_word(low: u8, word: u16) -> bool {
    if low == 184 { word == 0 || (5..=1_000).contains(&word) } else { word <= 18_000 }
}

/// True if `value` is in the range of the writable one-byte register at `address`, according to `docs/registers.md` and, for map
/// 2.1, section 8 of `docs/protocol.md`.
fn is_in_range(map: Map, address: u8, value: u8) -> bool {
    let max = match (map, address) {
        (_, 12) => 7,
        (Map::V22, 13..=19) => return value & 0x7F <= 16,
        (Map::V21, 13..=19) => return matches!(value, 0..=16 | 112..=144 | 240..=255),
        (_, 20) => 3,
        (_, 28 | 30 | 31 | 66 | 187) => 1,
        (_, 29 | 189) => 2,
        (_, 188) => 3,
        (_, 32..=45 | 82 | 90) => 100,
        (_, 46..=52) => 180,
        (_, 192) => 1,
        (_, 193) => return (20..=100).contains(&value),
        (_, 194) => return (10..=100).contains(&value),
        (_, 53) => 50,
        _ => 255,
    };
    value <= max
}
