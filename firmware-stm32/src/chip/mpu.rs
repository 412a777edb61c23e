//! Sets up the memory protection unit, so that a stack overflow causes a hard fault.

use cortex_m::peripheral::MPU;

use crate::stack_guard;

unsafe extern "C" {
    /// Start of the guard region below the stack, from `memory.x`.
    static _guard_start: u32;
}

/// Denies access to the guard region. An access then causes a memory management fault. Its handler is disabled, so it
/// escalates to a hard fault.
pub fn protect_stack(mpu: &MPU) {
    let start = u32::try_from((&raw const _guard_start).addr()).unwrap_or(0);
    // SAFETY: no variable lies in the region. The default memory map stays in force for all other addresses.
    unsafe {
        mpu.rbar.write(stack_guard::base(start));
        mpu.rasr.write(stack_guard::attributes());
        mpu.ctrl.write(stack_guard::CONTROL);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
