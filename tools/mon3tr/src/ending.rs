//! Ctrl-C ends a call within two seconds, whatever its threads wait for.
//!
//! A call looks between two pictures whether it is time to leave, then says goodbye and writes what was measured. A picture that does not end, or a graph that is
//! being loaded, keeps it from looking, and nothing interrupts a device. So another thread ends the process where the call has not noticed in time: without
//! goodbye, which others notice by themselves, and without a report. A call that has noticed is left to end by itself, for a while.

use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::Duration;

/// From Ctrl-C to the end of a process that has not noticed it.
const UNNOTICED: Duration = Duration::from_millis(1500);

/// What goodbyes, and writing what was measured and drawn, may take after that.
const ORDERLY: Duration = Duration::from_secs(10);

/// Whether the call is ending by itself.
static NOTICED: AtomicBool = AtomicBool::new(false);

/// The call has noticed that it is time to leave, and does so now.
pub(crate) fn noticed() {
    NOTICED.store(true, SeqCst);
}

/// Ends the process with this status if it does not end by itself in time.
pub(crate) fn end_soon(status: i32) {
    let wait = move || {
        std::thread::sleep(UNNOTICED);
        if NOTICED.load(SeqCst) {
            std::thread::sleep(ORDERLY);
        }
        eprintln!(
            "left without goodbye and without a report: what was being drawn, loaded or written did not end in time"
        );
        end_now(status)
    };
    let begun = std::thread::Builder::new().name("ending".to_owned());
    if let Err(error) = begun.spawn(wait) {
        log::warn!(
            "Ctrl-C waits for what is being drawn, for there is no thread to end it: {error}"
        );
    }
}

/// Ends the process without the work that libraries have at exit: they would wait for, or take away what is used by, threads that are still at work.
pub(crate) fn end_now(status: i32) -> ! {
    #[cfg(unix)]
    // SAFETY: it takes nothing but a number, and does not return.
    unsafe {
        libc::_exit(status)
    }
    #[cfg(not(unix))]
    std::process::exit(status)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Stdio;
    use std::time::Instant;
    use test_support::program::through_runner;

    /// Makes this test's own process the one that hangs.
    const HANGS: &str = "MON3TR_TEST_HANGS";

    #[test]
    fn a_process_that_does_not_notice_ends_with_its_status_all_the_same() {
        if std::env::var_os(HANGS).is_some() {
            end_soon(130);
            // As a device that does not come to an end.
            std::thread::sleep(Duration::from_secs(600));
        }
        let name =
            "ending::tests::a_process_that_does_not_notice_ends_with_its_status_all_the_same";
        let begun = Instant::now();
        // Not the running program's file, which may be the loader that the runner starts it by.
        let this = std::env::args_os().next().expect("this test");
        let mut child = through_runner(this)
            .args(["--exact", name])
            .env(HANGS, "1")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it can be started");
        let status = child.wait().expect("it ends");
        assert_eq!(status.code(), Some(130), "{status}");
        let took = begun.elapsed();
        println!("ended after {took:?}");
        assert!(took >= UNNOTICED, "it had time to notice");
        // Starting the program is in it, on a busy machine.
        assert!(took < UNNOTICED + Duration::from_secs(8), "{took:?}");
    }
}
