//! Counts instructions in the emulator: with `-icount shift=0` and without a prescaler, TIM2 counts one per instruction.
//! Each figure is a line on USART1: name, tab, number.

use core::sync::atomic::{Ordering, compiler_fence};

use crate::opaque;

type RegisterAddress = *mut u32;

/// TIM2 (RM0090, section 18.4): control register.
const TIM2_CR1: RegisterAddress = 0x4000_0000 as RegisterAddress;
/// TIM2: the counter.
const TIM2_CNT: RegisterAddress = 0x4000_0024 as RegisterAddress;
/// USART1 (RM0090, section 30.6): data register.
const USART1_DR: RegisterAddress = 0x4001_1004 as RegisterAddress;
/// USART1: control register.
const USART1_CR1: RegisterAddress = 0x4001_100C as RegisterAddress;
/// Bits UE and TE.
const ENABLE_TRANSMITTER: u32 = 1 << 13 | 1 << 3;

/// A running instruction counter.
pub struct Meter {
    /// Instructions counted for an empty function.
    overhead: u32,
}

impl Default for Meter {
    /// Starts the counter.
    fn default() -> Self {
        write(TIM2_CR1, 1);
        write(USART1_CR1, ENABLE_TRANSMITTER);
        let mut meter = Self { overhead: 0 };
        meter.overhead = meter.count(|| ());
        meter
    }
}

impl Meter {
    /// Counts the instructions of `act`. Pass its inputs and outputs through [`opaque`].
    #[inline(always)]
    pub fn count(&self, act: impl FnOnce()) -> u32 {
        let start = count_so_far();
        compiler_fence(Ordering::SeqCst);
        act();
        compiler_fence(Ordering::SeqCst);
        count_so_far().wrapping_sub(start).wrapping_sub(self.overhead)
    }

    /// Sends a line on USART1: the name, a tab, and the figure in decimal.
    #[inline(never)]
    pub fn print(&self, name: &str, figure: u32) {
        name.bytes().for_each(send);
        send(b'\t');
        let mut unit = 1_000_000_000;
        while unit > 0 {
            let [digit, ..] = (figure / unit % 10).to_le_bytes();
            if figure >= unit || unit == 1 {
                send(b'0' + digit);
            }
            unit /= 10;
        }
        send(b'\n');
    }

    /// Sends the end mark. Never returns.
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
    // SAFETY: every STM32F405 has this register, and reading it has no side effect.
    unsafe { TIM2_CNT.read_volatile() }
}

fn write(register: RegisterAddress, value: u32) {
    // SAFETY: `register` is one of the constants above, and no other code here uses these peripherals.
    unsafe { register.write_volatile(value) }
}
