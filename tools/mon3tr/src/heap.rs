//! How much memory glibc's allocator keeps of what was freed. By itself it makes up to eight arenas for each processor,
//! and returns no page that lies between allocations: people who came to a call and left had a member grow by 1.4 MB an
//! hour.

/// Has all threads that begin from now on share two arenas, unless the user has set another number.
pub(crate) fn limit_arenas() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const ARENAS: std::ffi::c_int = 2;
        if std::env::var_os("MALLOC_ARENA_MAX").is_none() {
            // SAFETY: mallopt may be called at any time. Where it refuses, there are as many arenas as before.
            unsafe { libc::mallopt(libc::M_ARENA_MAX, ARENAS) };
        }
    }
}

/// Returns free pages to the system. It takes some milliseconds, in which other threads may have to wait for memory.
pub(crate) fn trim() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: malloc_trim may be called at any time, by any thread.
    unsafe {
        libc::malloc_trim(0);
    };
}
