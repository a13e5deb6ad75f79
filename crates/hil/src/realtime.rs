//! The raw calls of the operating system. Linux.

#![expect(unsafe_code, reason = "calls of the C library have no checked form")]

use core::mem::MaybeUninit;

/// Time of `CLOCK_MONOTONIC`, ns: shared by all processes of this machine, never set back.
#[must_use]
pub fn monotonic_ns() -> u64 {
    let mut t = MaybeUninit::<libc::timespec>::uninit();
    // SAFETY: `t` is writable and as large as the call expects; the clock exists on every Linux, and
    // a call that succeeds has filled `t`.
    let t = unsafe {
        let done = libc::clock_gettime(libc::CLOCK_MONOTONIC, t.as_mut_ptr());
        debug_assert_eq!(done, 0);
        t.assume_init()
    };
    t.tv_sec.unsigned_abs() * 1_000_000_000 + t.tv_nsec.unsigned_abs()
}
