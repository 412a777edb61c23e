//! A reading of the chip's internal voltage reference. `crate::vdd` computes the supply from it.

use stm32f4::stm32f405 as pac;

use super::delay::delay_micros;
use crate::clock_rates::ClockSource;
use crate::wait::wait_for;

/// Channel of the internal reference (RM0090, section 13.10).
const REFERENCE: u8 = 17;
/// Start-up time: the reference needs 10 microseconds, the converter 3 (DS8626).
const START_UP_MICROS: u32 = 20;
/// Limit on the polls for the end of the conversion, which takes 24 microseconds with the PLL, 123 without it.
const DONE_POLLS: u32 = 10_000;

/// The factory's reading of the internal reference at 3.3 V (DS8626); `None` in the emulator.
pub fn calibration(source: ClockSource) -> Option<u16> {
    const ADDRESS: *const u16 = 0x1FFF_7A2A as *const _;
    // SAFETY: every STM32F405 has this read-only memory. The emulator lacks it and is excluded here.
    (source != ClockSource::Emulated).then(|| unsafe { ADDRESS.read_volatile() })
}

/// Reads the reference; `None` if the conversion does not end.
pub fn read_reference(rcc: &pac::RCC, adc: &pac::ADC1, common: &pac::ADC_COMMON) -> Option<u16> {
    rcc.apb2enr().modify(|_, w| w.adc1en().enabled());
    let _ = rcc.apb2enr().read();
    common.ccr().modify(|_, w| w.adcpre().div4().tsvrefe().enabled());
    // 480 cycles at 21 MHz, the highest clock here, are 23 microseconds; the reference needs at least 10.
    adc.smpr1().modify(|_, w| w.smp17().cycles480());
    // SAFETY: channel 17 exists; the channels are 0 to 18.
    adc.sqr3().write(|w| unsafe { w.sq1().bits(REFERENCE) });
    adc.cr2().modify(|_, w| w.adon().enabled());
    delay_micros(START_UP_MICROS);
    adc.cr2().modify(|_, w| w.swstart().start());
    let is_done = wait_for(DONE_POLLS, || adc.sr().read().eoc().bit_is_set());
    is_done.then(|| adc.dr().read().data().bits())
}
