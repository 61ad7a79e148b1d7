//! Threads for work that is done by several at once, which end with it: those of rayon's own pool never end, and an app on a headset
//! may outlive many calls.

use crate::error::ReceiverError;

/// Does `work` in a pool of its own, one thread for each core, whose names begin so.
///
/// # Errors
/// [`ReceiverError::Thread`] if there are no threads.
pub fn in_own_pool<T: Send>(
    name: &str,
    work: impl FnOnce() -> T + Send,
) -> Result<T, ReceiverError> {
    let name = name.to_owned();
    rayon::ThreadPoolBuilder::new()
        .thread_name(move |at| format!("{name} {at}"))
        .build_scoped(|thread| thread.run(), |pool| pool.install(work))
        .map_err(|error| ReceiverError::Thread(std::io::Error::other(error)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

    #[test]
    fn the_threads_end_with_the_work() {
        thread_local! {
            static COUNTED: Counted = Counted::new();
        }
        static ALIVE: AtomicUsize = AtomicUsize::new(0);
        struct Counted;
        impl Counted {
            fn new() -> Self {
                ALIVE.fetch_add(1, SeqCst);
                Self
            }
        }
        impl Drop for Counted {
            fn drop(&mut self) {
                ALIVE.fetch_sub(1, SeqCst);
            }
        }
        let names = in_own_pool("of a test", || {
            rayon::broadcast(|_| {
                COUNTED.with(|_| ());
                std::thread::current().name().map(str::to_owned)
            })
        });
        let names = names.expect("there are threads");
        assert_eq!(names.len(), names.iter().flatten().count(), "all named");
        assert_eq!(names[0].as_deref(), Some("of a test 0"), "as it was asked");
        // A scope ends a moment before destructors of its threads' own values do.
        let begun = std::time::Instant::now();
        while ALIVE.load(SeqCst) != 0 && begun.elapsed().as_secs() < 10 {
            std::thread::yield_now();
        }
        assert_eq!(ALIVE.load(SeqCst), 0, "none is left");
    }
}
