//! The measurements of a servo, as its registers hold them.

/// The measurements of a servo: the answer to a read of [`Reading::REGISTERS`] registers from
/// [`PRESENT_POSITION`](super::register::PRESENT_POSITION) on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// The position, 0 to 1023.
    pub position_counts: u16,
    /// The speed, in counts per second.
    pub speed: i16,
    /// The load, in 0.1 % of the maximum.
    pub load: i16,
    /// The supply voltage, in 0.1 V.
    pub voltage_decivolts: u8,
    /// The temperature, in degrees Celsius.
    pub temperature_celsius: u8,
}

impl Reading {
    /// How many registers a reading takes.
    pub const REGISTERS: u8 = 8;
    /// The highest position of a servo.
    pub const MAX_POSITION: u16 = 1023;
    const SPEED_SIGN: u16 = 1 << 15;
    const LOAD_SIGN: u16 = 1 << 10;

    /// Parses the parameters of an answer; `None` if their number is wrong or the position is above
    /// [`Reading::MAX_POSITION`].
    #[must_use]
    pub fn parse(params: &[u8]) -> Option<Self> {
        let &[p1, p0, s1, s0, l1, l0, voltage_decivolts, temperature_celsius] = params else { return None };
        let position_counts = u16::from_be_bytes([p1, p0]);
        (position_counts <= Self::MAX_POSITION).then_some(Self {
            position_counts,
            speed: signed(u16::from_be_bytes([s1, s0]), Self::SPEED_SIGN),
            load: signed(u16::from_be_bytes([l1, l0]), Self::LOAD_SIGN),
            voltage_decivolts,
            temperature_celsius,
        })
    }

    /// The parameters of an answer. A magnitude is limited to the highest value of its field.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::REGISTERS as usize] {
        let [p1, p0] = self.position_counts.to_be_bytes();
        let [s1, s0] = sign_and_magnitude(self.speed, Self::SPEED_SIGN).to_be_bytes();
        let [l1, l0] = sign_and_magnitude(self.load, Self::LOAD_SIGN).to_be_bytes();
        [p1, p0, s1, s0, l1, l0, self.voltage_decivolts, self.temperature_celsius]
    }
}

/// Decodes sign and magnitude. `sign` is the sign bit; the bits below it are the magnitude.
fn signed(field: u16, sign: u16) -> i16 {
    let magnitude = (field & (sign - 1)).cast_signed();
    if field & sign == 0 { magnitude } else { -magnitude }
}

fn sign_and_magnitude(number: i16, sign: u16) -> u16 {
    let magnitude = number.unsigned_abs().min(sign - 1);
    if number < 0 { magnitude | sign } else { magnitude }
}
