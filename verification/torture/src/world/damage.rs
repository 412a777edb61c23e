//! What a line does to bytes.

use crate::dice::Dice;

/// Bytes that look like the beginning of something, on either line.
const LIKELY: [u8; 8] = [0xAA, 0x77, 0xAA, 0x77, 0x06, 0x03, 0xFF, 0xFF];

/// The bytes with one kind of damage done to them, and sometimes a second.
pub(super) fn damage(bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    damage_once(&mut bytes, dice);
    if dice.one_in(4) {
        damage_once(&mut bytes, dice);
    }
    bytes
}

fn damage_once(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let place = dice.below(bytes.len());
    match dice.below(7) {
        0 => bytes.get_mut(place).into_iter().for_each(|byte| *byte ^= 1 << dice.below(8)),
        1 => bytes.get_mut(place).into_iter().for_each(|byte| *byte = dice.byte()),
        2 => drop(bytes.drain(place..(place + 1).min(bytes.len()))),
        3 => bytes.get(place).copied().into_iter().for_each(|byte| bytes.insert(place, byte)),
        4 => bytes.truncate(place),
        5 => {
            let from = bytes.split_off(place);
            bytes.extend(noise(8, dice));
            bytes.extend(from);
        }
        _ => *bytes = noise(40, dice),
    }
}

/// Up to so many bytes out of nowhere.
pub(super) fn noise(most: usize, dice: &mut Dice) -> Vec<u8> {
    let count = 1 + dice.below(most);
    (0..count).map(|_| if dice.one_in(2) { dice.one_of(&LIKELY, 0) } else { dice.byte() }).collect()
}
