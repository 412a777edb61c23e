//! What happens when the program cannot go on: pump off, servos' torque off, a word to the log, a restart.
//!
//! Nothing here needs a heap, a lock, an interrupt or a sound stack, and nothing waits for ever. What ended
//! the run is kept in memory that a restart does not clear, and told in the status block afterwards.

use core::arch::naked_asm;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use firmware_stm32::feeding::Feeding;
use firmware_stm32::rates::{self, Source};
use firmware_stm32::restart::Ending;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{FrameBuffer, register, sync_write};
use stm32f4::stm32f405 as pac;

use crate::board;

/// The fault path has been entered: a fault inside it restarts at once.
static ENTERED: AtomicBool = AtomicBool::new(false);
/// What ended the last run. Not set at start, so that it outlives a restart.
// SAFETY: the section is RAM that nobody else uses; any bits are a valid value.
#[unsafe(link_section = ".uninit.ENDING")]
static ENDING: AtomicU32 = AtomicU32::new(0);

/// The same three times: a servo that listens to the rest of a broken frame misses the first.
const REPEATS: usize = 3;
/// Pause before each, in core cycles: 2 ms at 168 MHz, longer than the longest frame and its answer.
const PAUSE_CYCLES: u32 = 336_000;
/// Looks at a flag before it counts as never coming. A byte takes 1,680 cycles.
const PATIENCE: u32 = 10_000;

/// What the last run left, if it ended in a fault. It is told once.
pub(crate) fn take_ending() -> Option<Ending> {
    Ending::from_record(ENDING.swap(0, Ordering::Relaxed))
}

/// Makes the arm safe and restarts it.
pub(crate) fn restart(ending: Ending) -> ! {
    if make_safe(ending) {
        defmt::error!("restart: {}", ending);
    }
    SCB::sys_reset()
}

/// Makes the arm safe; false if that has been tried before, and better not be again.
fn make_safe(ending: Ending) -> bool {
    cortex_m::interrupt::disable();
    if ENTERED.swap(true, Ordering::Relaxed) {
        return false;
    }
    ENDING.store(ending as u32, Ordering::Relaxed);
    board::PUMP.drive(board::VACUUM_ACTIVE.level(false));
    board::VALVE.drive(board::VACUUM_ACTIVE.level(false));
    stop_servos();
    true
}

/// Puts all servos into state 0, damping: the arm sinks, it does not drop.
fn stop_servos() {
    // SAFETY: interrupts are off and nothing else runs any more.
    let (usart, rcc) = unsafe { (pac::USART2::steal(), pac::RCC::steal()) };
    keep_rate(&usart, &rcc);
    let mut frame = FrameBuffer::new();
    let code = board::TORQUE_CODES.code(Torque::Damping);
    sync_write(&mut frame, register::TORQUE_SWITCH, (0..board::SERVOS).map(|id| (id, [code])));
    for _ in 0..REPEATS {
        cortex_m::asm::delay(PAUSE_CYCLES);
        for &byte in &frame {
            let _ = comes_true(|| usart.sr().read().txe().bit_is_set());
            usart.dr().write(|w| w.dr().set(u16::from(byte)));
        }
        let _ = comes_true(|| usart.sr().read().tc().bit_is_set());
    }
}

/// The crystal may just have stopped: the chip runs on its internal oscillator then, with the bus still
/// divided for the PLL.
fn keep_rate(usart: &pac::USART2, rcc: &pac::RCC) {
    if rcc.cfgr().read().sws().is_hsi() {
        rcc.cfgr().modify(|_, w| w.ppre1().div1());
        let divisor = rates::usart_divisor(Source::Internal.rates().apb1, board::SERVO_BAUD);
        usart.brr().write(|w| w.div_mantissa().set(divisor >> 4));
    }
}

fn comes_true(flag: impl Fn() -> bool) -> bool {
    (0..PATIENCE).any(|_| flag())
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    if make_safe(Ending::Panic)
        && let Some(place) = info.location()
    {
        defmt::error!("panic at {=str}:{=u32}", place.file(), place.line());
    }
    SCB::sys_reset()
}

/// A hard fault may come of a stack that overflowed: first of all, a sound one.
///
/// # Safety
/// For the vector table alone.
// SAFETY: the name is what cortex-m-rt puts into the vector table.
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

/// `frame` is where the registers were pushed, if there was a stack to push them to.
extern "C" fn hard_fault(frame: *const u32) -> ! {
    if make_safe(Ending::HardFault) {
        // SAFETY: reading it changes nothing.
        let status = unsafe { &*SCB::PTR }.cfsr.read();
        defmt::error!("hard fault at {=u32:#010x}, CFSR {=u32:#010x}", pushed_pc(frame), status);
    }
    SCB::sys_reset()
}

/// Where it happened; 0 where nobody knows.
fn pushed_pc(frame: *const u32) -> u32 {
    let stack = (&raw const _stack_end).addr()..(&raw const _stack_start).addr() - 32;
    if !stack.contains(&frame.addr()) || !frame.is_aligned() {
        return 0;
    }
    // SAFETY: eight registers were pushed there, PC is the seventh; aligned, and within the stack.
    unsafe { frame.add(6).read_volatile() }
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    const NON_MASKABLE: i16 = -14;
    restart(if number == NON_MASKABLE { Ending::ClockFailure } else { Ending::Unexpected })
}

/// The independent watchdog.
pub(crate) struct Watchdog(pac::IWDG);

impl Watchdog {
    /// Starts it. It cannot be stopped.
    pub(crate) fn start(registers: pac::IWDG, dbgmcu: &pac::DBGMCU) -> Self {
        // A debugger that halts the core is no hang.
        dbgmcu.apb1_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        // Its oscillator has to run before the registers take a value (RM0090, section 21.3).
        registers.kr().write(|w| w.key().start());
        registers.kr().write(|w| w.key().unlock());
        registers.pr().write(|w| w.pr().divide_by64());
        registers.rlr().write(|w| w.rl().set(board::WATCHDOG_TURNS));
        Self(registers)
    }

    /// Feeds it, come what may: for start only.
    pub(crate) fn feed(&self) {
        self.0.kr().write(|w| w.key().feed());
    }

    /// Feeds it if everybody has run who should.
    pub(crate) fn feed_if_due(&self, feeding: &mut Feeding) {
        if feeding.is_due() {
            self.feed();
        }
    }
}
