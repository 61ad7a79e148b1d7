//! 300 and more broken packages: each is refused with an error that says what is wrong (or, for a flip in a byte that
//! means nothing, reads as the avatar it was), without a panic and within a gigabyte.

mod archives;
mod contents;
mod costs;
mod graphs;
mod parts;

use parts::Parts;
use spmm3::Avatar;
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Cursor;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use synthetic_person::{Puppet, Random};

/// The system's allocator, counting the bytes in use and their maximum.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator unchanged; only numbers are kept beside.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(
            HELD.fetch_add(layout.size(), Relaxed) + layout.size(),
            Relaxed,
        );
        // SAFETY: the caller keeps GlobalAlloc's contract, which is System's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as above; `pointer` came from `System.alloc` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Reads broken packages and counts the refusals.
struct Court {
    original: Avatar,
    cases: usize,
    harmless: usize,
    peak: usize,
}

impl Court {
    /// Reads `package`; gives the error's text, or `None` where it read as the avatar it was.
    fn read(&mut self, what: &str, package: &[u8]) -> Option<String> {
        self.cases += 1;
        let before = HELD.load(Relaxed);
        PEAK.store(before, Relaxed);
        let outcome = std::panic::catch_unwind(|| Avatar::read(Cursor::new(package)));
        let used = PEAK.load(Relaxed) - before;
        self.peak = self.peak.max(used);
        assert!(used < 1 << 30, "{what} took {used} bytes");
        match outcome {
            Err(_) => panic!("{what} made the reader panic"),
            Ok(Err(e)) => Some(causes(&e)),
            Ok(Ok(avatar)) => {
                assert!(avatar == self.original, "{what} gave another avatar");
                self.harmless += 1;
                None
            }
        }
    }

    /// `package` must be refused with a text that has `reason`.
    fn refuse(&mut self, what: &str, package: &[u8], reason: &str) {
        match self.read(what, package) {
            None => panic!("{what} was accepted"),
            Some(error) => assert!(
                error.contains(reason),
                "{what} should be refused for {reason:?}, not: {error}"
            ),
        }
    }
}

/// The error and its causes, as the command prints them; none may repeat the next one.
fn causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let cause_text = cause.to_string();
        assert!(
            !text.contains(&cause_text),
            "said twice: {text}: {cause_text}"
        );
        text = format!("{text}: {cause_text}");
        next = cause.source();
    }
    assert!(
        !text.chars().any(char::is_control),
        "a terminal would obey {text:?}"
    );
    text
}

#[test]
fn three_hundred_broken_packages_are_refused_and_none_takes_a_gigabyte() {
    let original = Puppet::small().avatar();
    let package = original.to_bytes().expect("the puppet packs");
    let parts = Parts::of(&package);
    let mut court = Court {
        original,
        cases: 0,
        harmless: 0,
        peak: 0,
    };
    let mut random = Random::new(300);
    let repacked = Avatar::read(Cursor::new(parts.pack()));
    assert!(
        repacked.is_ok_and(|avatar| avatar == court.original),
        "the tools of this test break packages by themselves"
    );

    archives::flips_and_cuts(&mut court, &package, &mut random);
    contents::wrong_numbers(&mut court, &parts, &mut random);
    contents::wrong_shapes(&mut court, &parts);
    contents::wrong_manifests(&mut court, &parts);
    contents::unprintable_texts(&mut court, &parts);
    graphs::wrong_graphs(&mut court, &parts);
    graphs::graphs_of_their_own(&mut court, &parts);
    archives::wrong_archives(&mut court, &package, &parts);
    archives::bombs(&mut court, &parts);
    costs::dear_packages(&mut court);
    costs::packages_of_others(&mut court, &parts);

    println!(
        "{} broken packages, {} of them harmless; at most {:.1} MiB held",
        court.cases,
        court.harmless,
        court.peak as f64 / f64::from(1 << 20)
    );
    assert!(court.cases >= 300, "only {} cases", court.cases);
}
