//! The crash handler: pump and valve off, servos damped, one log line, restart. After the restart the controller sends only
//! questions until the servos are measured ([D12](protocol_core::decisions#d12)), so they stay damped until then.
//!
//! This file needs no heap, no lock and no interrupt, and after a hard fault no intact stack. Each of its loops has a limit. It
//! stores the cause in RAM that a restart does not clear; after the restart the log names the cause, and register 241 shows a
//! watchdog restart.

use core::arch::naked_asm;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{ServoFrameBuffer, register, sync_write};
use stm32f4::stm32f405 as pac;

use super::board;
use super::servo_link::ServoDirection;
use crate::clock_rates::{self, ClockRates, ClockSource};
use crate::reset_cause::ResetCause;
use crate::serial_line::BusDirection;
use crate::wait::wait_for;

/// Set when the crash handler runs. A second fault while it is set restarts at once.
static ENTERED: AtomicBool = AtomicBool::new(false);
/// Why the last run ended. Start-up code does not initialise it, so it survives a restart.
// SAFETY: the section is RAM that no other item uses, and every bit pattern is a valid value.
#[unsafe(link_section = ".uninit.RESET_CAUSE")]
static RESET_CAUSE: AtomicU32 = AtomicU32::new(0);

/// How often the frame is sent. A crash may interrupt a frame of goals: a servo that has received the length byte may wait
/// for 53 more bytes. If no pause ends this wait, the servo takes two frames of 22 bytes and a part of the third as
/// those bytes, and parses the fourth. A servo that receives none of the four holds its goal.
const REPEATS: usize = 4;
/// Pause before each frame, in microseconds: longer than the longest frame (57 bytes), and longer than a servo's wait
/// and its answer.
const PAUSE_MICROS: u32 = 1_000 + board::servo_micros(100);
/// Limit on the polls until a byte is sent, which takes 1,680 cycles at 168 MHz.
const SEND_POLLS: u32 = 20_000;

/// Returns and logs why the chip started: RCC_CSR, and the recorded cause if the last run ended in a crash. Clears both,
/// because the next start would report them again.
pub fn take_cause(rcc: &pac::RCC) -> (u32, Option<ResetCause>) {
    let flags = rcc.csr().read().bits();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    let cause = ResetCause::from_record(RESET_CAUSE.swap(0, Ordering::Relaxed));
    defmt::info!("start: RCC_CSR {=u32:#010x}, last run ended in {}", flags, cause);
    (flags, cause)
}

/// Makes the arm safe and restarts the chip.
pub fn restart(cause: ResetCause) -> ! {
    if make_safe(cause) {
        defmt::error!("restart: {}", cause);
    }
    SCB::sys_reset()
}

/// Makes the arm safe. Returns false, and does nothing, if a crash inside the crash handler led here again.
fn make_safe(cause: ResetCause) -> bool {
    cortex_m::interrupt::disable();
    if ENTERED.swap(true, Ordering::Relaxed) {
        return false;
    }
    RESET_CAUSE.store(cause as u32, Ordering::Relaxed);
    board::PUMP.drive(board::VACUUM_ACTIVE.level(false));
    board::VALVE.drive(board::VACUUM_ACTIVE.level(false));
    stop_servos();
    true
}

/// Sets all servos to damping (state 0), so that the arm sinks slowly.
fn stop_servos() {
    // SAFETY: interrupts are off, and the code that owns these registers does not run again.
    let (usart, rcc) = unsafe { (pac::USART2::steal(), pac::RCC::steal()) };
    let rates = keep_rate(&usart, &rcc);
    let mut frame = ServoFrameBuffer::new();
    let code = board::TORQUE_CODES.code(Torque::Damping);
    sync_write(&mut frame, register::TORQUE_SWITCH, (0..board::SERVOS).map(|id| (id, [code])));
    let mut direction = ServoDirection;
    for _ in 0..REPEATS {
        // A servo may still answer.
        direction.receive();
        // Not timed by TIM2: after a failure of the clock it counts at another rate, and early in a start it stands still.
        cortex_m::asm::delay(clock_rates::delay_steps(rates.core, PAUSE_MICROS));
        direction.transmit();
        for &byte in &frame {
            let _ = wait_for(SEND_POLLS, || usart.sr().read().txe().bit_is_set());
            usart.dr().write(|w| w.dr().set(u16::from(byte)));
        }
        let _ = wait_for(SEND_POLLS, || usart.sr().read().tc().bit_is_set());
        direction.receive();
    }
}

/// Corrects the baud rate if the chip runs on its internal oscillator: if the crystal has just stopped, the bus divider is still
/// set for the PLL. Returns the present rates.
fn keep_rate(usart: &pac::USART2, rcc: &pac::RCC) -> ClockRates {
    if !rcc.cfgr().read().sws().is_hsi() {
        return ClockSource::Crystal.rates();
    }
    let rates = ClockSource::Internal.rates();
    rcc.cfgr().modify(|_, w| w.ppre1().div1());
    let divisor = clock_rates::usart_divisor(rates.apb1, board::SERVO_BAUD);
    usart.brr().write(|w| w.div_mantissa().set(divisor >> 4).div_fraction().set((divisor & 0xF) as u8));
    rates
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    if make_safe(ResetCause::Panic)
        && let Some(place) = info.location()
    {
        defmt::error!("panic at {=str}:{=u32}", place.file(), place.line());
    }
    SCB::sys_reset()
}

/// Resets the stack pointer first, because a stack overflow may have caused the hard fault.
///
/// # Safety
/// Only the vector table may refer to it.
// SAFETY: cortex-m-rt puts the function of this name into the vector table.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn HardFault() {
    naked_asm!(
        "mrs r0, msp",
        "ldr r1, ={stack}",
        "msr msp, r1",
        "b {handler}",
        stack = sym _stack_start,
        handler = sym hard_fault,
    )
}

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// `frame` is the address of the exception frame. It is valid only if the stack had room for it.
extern "C" fn hard_fault(frame: *const u32) -> ! {
    if make_safe(ResetCause::HardFault) {
        // SAFETY: reading CFSR has no side effect.
        let status = unsafe { &*SCB::PTR }.cfsr.read();
        defmt::error!("hard fault at {=u32:#010x}, CFSR {=u32:#010x}", pushed_pc(frame), status);
    }
    SCB::sys_reset()
}

/// The program counter from the exception frame; 0 if `frame` is not valid.
fn pushed_pc(frame: *const u32) -> u32 {
    let stack = (&raw const _stack_end).addr()..(&raw const _stack_start).addr() - 32;
    if !stack.contains(&frame.addr()) || !frame.is_aligned() {
        return 0;
    }
    // SAFETY: the frame is aligned and within the stack; it holds eight registers, PC is the seventh.
    unsafe { frame.add(6).read_volatile() }
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    const NON_MASKABLE: i16 = -14;
    restart(if number == NON_MASKABLE { ResetCause::ClockFailure } else { ResetCause::Unexpected })
}
