//! Mode of the floating-point unit: rounding, and the treatment of subnormal numbers. Code built with `-ffast-math` may
//! change this mode for the whole thread, when the code is loaded or later; all later results would change silently.

#![expect(unsafe_code, reason = "the mode is a register of the processor")]

use std::arch::asm;

/// Mode of the floating-point unit of this thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rounding(u64);

/// Bits of MXCSR that only count exceptions.
#[cfg(target_arch = "x86_64")]
const EXCEPTIONS: u32 = 0x3f;

impl Rounding {
    /// Mode in which a process begins, and in which all results are computed.
    pub const USUAL: Self = Self(if cfg!(target_arch = "x86_64") { 0x1f80 } else { 0 });

    /// Reads the mode.
    #[cfg(target_arch = "x86_64")]
    pub fn now() -> Self {
        let mut mxcsr = 0_u32;
        // SAFETY: `stmxcsr` writes the four bytes that the pointer names, and nothing else.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut mxcsr, options(nostack, preserves_flags)) };
        Self(u64::from(mxcsr & !EXCEPTIONS))
    }

    /// Sets the mode.
    #[cfg(target_arch = "x86_64")]
    pub fn set(self) {
        let mxcsr = self.0 as u32;
        // SAFETY: the value is one that `now` read from this register, so no reserved bit is set.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const mxcsr, options(nostack, preserves_flags, readonly)) };
    }

    /// Reads the mode.
    #[cfg(target_arch = "aarch64")]
    pub fn now() -> Self {
        let fpcr: u64;
        // SAFETY: reading FPCR has no effect.
        unsafe { asm!("mrs {}, fpcr", out(reg) fpcr, options(nomem, nostack, preserves_flags)) };
        Self(fpcr)
    }

    /// Sets the mode.
    #[cfg(target_arch = "aarch64")]
    pub fn set(self) {
        // SAFETY: the value is one that `now` read from this register.
        unsafe { asm!("msr fpcr, {}", in(reg) self.0, options(nostack, preserves_flags)) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_mode_is_seen_and_set_back() {
        let usual = Rounding::now();
        let flush_to_zero = if cfg!(target_arch = "x86_64") { 1 << 15 } else { 1 << 24 };
        Rounding(usual.0 | flush_to_zero).set();
        let changed = Rounding::now();
        usual.set();
        assert_ne!(changed, usual);
        assert_eq!(Rounding::now(), usual);
    }
}
