//! Counts instructions, in the emulator only: under `-icount shift=0` TIM2, without a prescaler, gains one tick with
//! each instruction. Figures leave by USART1, a line each: name, tab, number.

use core::sync::atomic::{Ordering, compiler_fence};

use crate::opaque;

/// Bytes as they are written to a register of a peripheral.
type Register = *mut u32;

/// TIM2 (RM0090, section 18.4): enable, count.
const TIM2_CR1: Register = 0x4000_0000 as Register;
const TIM2_CNT: Register = 0x4000_0024 as Register;
/// USART1 (RM0090, section 30.6): data, enable of the whole and of the transmitter.
const USART1_DR: Register = 0x4001_1004 as Register;
const USART1_CR1: Register = 0x4001_100C as Register;
const ENABLE_TRANSMITTER: u32 = 1 << 13 | 1 << 3;

/// A running count.
pub struct Meter {
    /// What counting nothing costs.
    overhead: u32,
}

impl Default for Meter {
    /// Starts it.
    fn default() -> Self {
        write(TIM2_CR1, 1);
        write(USART1_CR1, ENABLE_TRANSMITTER);
        let mut meter = Self { overhead: 0 };
        meter.overhead = meter.count(|| ());
        meter
    }
}

impl Meter {
    /// How many instructions `act` takes. What it does must not depend on what the compiler knows: see [`opaque`].
    #[inline(always)]
    pub fn count(&self, act: impl FnOnce()) -> u32 {
        let start = count_so_far();
        compiler_fence(Ordering::SeqCst);
        act();
        compiler_fence(Ordering::SeqCst);
        count_so_far().wrapping_sub(start).wrapping_sub(self.overhead)
    }

    /// Tells a figure.
    #[inline(never)]
    pub fn tell(&self, name: &str, figure: u32) {
        name.bytes().for_each(send);
        send(b'\t');
        let mut place = 1_000_000_000;
        while place > 0 {
            let [digit, ..] = (figure / place % 10).to_le_bytes();
            if figure >= place || place == 1 {
                send(b'0' + digit);
            }
            place /= 10;
        }
        send(b'\n');
    }

    /// Says that there are no more figures.
    pub fn end(&self) -> ! {
        "end\n".bytes().for_each(send);
        loop {
            opaque(());
        }
    }
}

fn send(byte: u8) {
    write(USART1_DR, u32::from(byte));
}

fn count_so_far() -> u32 {
    // SAFETY: a register of every STM32F405; reading it changes nothing.
    unsafe { TIM2_CNT.read_volatile() }
}

fn write(register: Register, value: u32) {
    // SAFETY: one of the registers above, of peripherals that nobody else here uses.
    unsafe { register.write_volatile(value) }
}
