//! The functions `_Unwind_...` that Rust's standard library expects of `libunwind.a`.
#![no_std]

use core::panic::PanicInfo;
use unwinding as _;

/// Nothing here panics; a `no_std` library has to say what would happen.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}
