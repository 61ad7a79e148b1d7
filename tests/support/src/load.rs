//! How busy a machine is with other processes than a test's, and whether a measurement is valid then.
//!
//! The kernel counts the processors' time, by process too. Time that was neither idle nor of the processes under test was of others:
//! a slow program under test cannot increase it.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

/// The part of all processors' time that others may have had for a measurement to count against the program.
pub const BUSY: f64 = 0.1;

/// How often a disturbed measurement is repeated.
pub const ATTEMPTS: usize = 4;

/// How long the next measurement waits for a quiet machine.
const PAUSE: Duration = Duration::from_secs(30);

/// How often the kernel's counts are read.
const LOOK: Duration = Duration::from_millis(100);

/// Counts of the kernel's, in its ticks.
#[derive(Debug, Clone, Copy, Default)]
struct Ticks {
    all: u64,
    /// Not idle.
    busy: u64,
    /// Of the processes under test, and of all that they have started.
    ours: u64,
}

/// The load of others during a measurement.
#[derive(Debug)]
pub struct Load {
    over: Arc<AtomicBool>,
    looks: JoinHandle<f64>,
}

impl Load {
    /// From now on, with these processes under test. They may end meanwhile.
    #[must_use]
    pub fn watch(processes: impl IntoIterator<Item = u32>) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let mut ours: HashMap<u32, u64> = processes.into_iter().map(|id| (id, 0)).collect();
        let done = Arc::clone(&over);
        let looks = spawn(move || {
            let first = look(&mut ours);
            loop {
                let last = look(&mut ours);
                if done.load(Ordering::Relaxed) {
                    return others(first, last);
                }
                sleep(LOOK);
            }
        });
        Self { over, looks }
    }

    /// The part of all processors' time that others had, 0 to 1.
    ///
    /// # Panics
    /// If the kernel does not report it.
    #[must_use]
    pub fn others(self) -> f64 {
        self.over.store(true, Ordering::Relaxed);
        self.looks.join().expect("Linux tells")
    }
}

fn others(first: Ticks, last: Ticks) -> f64 {
    let all = last.all.saturating_sub(first.all).max(1);
    let busy = last.busy.saturating_sub(first.busy);
    let ours = last.ours.saturating_sub(first.ours);
    busy.saturating_sub(ours) as f64 / all as f64
}

/// The counts as they are. Of a process that has ended the last ones stay.
fn look(ours: &mut HashMap<u32, u64>) -> Ticks {
    let stat = std::fs::read_to_string("/proc/stat").expect("Linux");
    let line = stat.lines().next().unwrap_or_default();
    // user nice system idle iowait irq softirq steal; guests are part of user.
    let counts = line.split_whitespace().skip(1).take(8);
    let counts: Vec<u64> = counts.filter_map(|count| count.parse().ok()).collect();
    let all = counts.iter().sum();
    let idle: u64 = counts.iter().skip(3).take(2).sum();
    let processes = processes();
    for (root, ticks) in ours.iter_mut() {
        *ticks = (*ticks).max(ticks_below(*root, &processes));
    }
    Ticks {
        all,
        busy: all - idle,
        ours: ours.values().sum(),
    }
}

/// Every process: its parent, and the ticks that it and those it has waited for had.
fn processes() -> HashMap<u32, (u32, u64)> {
    let entries = std::fs::read_dir("/proc").expect("Linux");
    let read = entries.filter_map(|entry| {
        let entry = entry.ok()?;
        let id: u32 = entry.file_name().to_str()?.parse().ok()?;
        // It may have ended by now.
        let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
        // A name may have blanks and brackets; what follows has none.
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let number = |index: usize| fields.get(index)?.parse::<u64>().ok();
        let parent = fields.get(1)?.parse().ok()?;
        let ticks = (11..15).map(number).sum::<Option<u64>>()?;
        Some((id, (parent, ticks)))
    });
    read.collect()
}

fn ticks_below(root: u32, processes: &HashMap<u32, (u32, u64)>) -> u64 {
    let is_below = |mut id: u32| {
        // No chain is longer than there are processes.
        for _ in 0..processes.len() {
            if id == root {
                return true;
            }
            match processes.get(&id) {
                Some((parent, _)) => id = *parent,
                None => return false,
            }
        }
        false
    };
    let below = processes.iter().filter(|(id, _)| is_below(**id));
    below.map(|(_, (_, ticks))| ticks).sum()
}

/// The result of a measurement.
#[derive(Debug)]
pub struct Measured {
    /// What is wrong, if anything is.
    pub wrong: Option<String>,
    /// The part of all processors' time that others had meanwhile: of [`Load::others`].
    pub others: f64,
}

/// Asserts that a measurement is right. A wrong one on a machine that others kept busy does not count: that is a line `too busy: ..`, which
/// `./run test` counts, and it is measured again later. Where the machine is too busy each time, a line `not judged: ..` says so, and
/// on CI that is a failure.
///
/// # Panics
/// If something is wrong and others are not the reason.
pub fn judge(measure: impl FnMut() -> Option<Measured>) {
    let must = std::env::var("CI").as_deref() == Ok("true");
    judge_with(measure, wait_for_others, must);
}

fn judge_with(mut measure: impl FnMut() -> Option<Measured>, mut pause: impl FnMut(), must: bool) {
    for attempt in 1..=ATTEMPTS {
        let Some(Measured { wrong, others }) = measure() else {
            return;
        };
        let percent = 100.0 * others;
        let Some(why) = wrong else {
            println!("measured while others had {percent:.0} % of the processors' time");
            return;
        };
        assert!(others >= BUSY, "{why}");
        let busy = format!("too busy: others had {percent:.0} % of the processors' time: {why}");
        crate::tell(&busy);
        if attempt < ATTEMPTS {
            pause();
        }
    }
    assert!(!must, "this machine was too busy {ATTEMPTS} times to judge");
    crate::tell(&format!(
        "not judged: this machine was too busy {ATTEMPTS} times"
    ));
}

/// Until others leave the machine alone for two seconds, or for as long as it is worth waiting.
fn wait_for_others() {
    let begun = Instant::now();
    while begun.elapsed() < PAUSE {
        let load = Load::watch([]);
        sleep(Duration::from_secs(2));
        if load.others() < BUSY {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::process::{Child, Command};

    struct Busy(Child);

    impl Busy {
        /// A shell that keeps a processor busy by way of another.
        fn start() -> Self {
            let loops = Command::new("sh")
                .args(["-c", "sh -c 'while :; do :; done' & echo $!; wait"])
                .stdout(std::process::Stdio::null())
                .spawn();
            Self(loops.expect("a shell"))
        }
    }

    impl Drop for Busy {
        fn drop(&mut self) {
            let id = self.0.id();
            let below = processes()
                .into_iter()
                .filter(|(_, (parent, _))| *parent == id);
            for (child, _) in below {
                let pid = rustix::process::Pid::from_raw(child.cast_signed());
                let _ = rustix::process::kill_process(
                    pid.expect("a process"),
                    rustix::process::Signal::KILL,
                );
            }
            let _ = self.0.wait();
        }
    }

    #[test]
    fn a_busy_process_counts_unless_it_is_under_test() {
        let busy = Busy::start();
        let (as_others, as_ours) = (Load::watch([]), Load::watch([busy.0.id()]));
        sleep(Duration::from_secs(3));
        let (as_others, as_ours) = (as_others.others(), as_ours.others());
        println!("{as_others:.2} of all time as others', {as_ours:.2} as ours");
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        // On a machine where others fight for it, it has a fifth of one processor at least.
        let least = 0.2 / processors as f64;
        assert!(as_others >= as_ours + least, "{as_others} and {as_ours}");
    }

    /// Checks measurements, each wrong or not, with so much for others; returns how many were made, and whether it passed.
    fn checked(measurements: &[(bool, f64)], must: bool) -> (usize, bool) {
        let mut made = 0;
        let passed = catch_unwind(AssertUnwindSafe(|| {
            let measure = || {
                let (wrong, others) = measurements[made];
                made += 1;
                Some(Measured {
                    wrong: wrong.then(|| "a step is wrong".to_owned()),
                    others,
                })
            };
            judge_with(measure, || {}, must);
        }));
        (made, passed.is_ok())
    }

    #[test]
    fn a_wrong_measurement_counts_only_on_a_quiet_machine() {
        assert_eq!(checked(&[(true, 0.05)], false), (1, false), "a defect");
        assert_eq!(checked(&[(false, 0.9)], true), (1, true), "good anyway");
        let later = [(true, 0.5), (true, 0.5), (false, 0.0)];
        assert_eq!(checked(&later, true), (3, true), "measured later");
        let later = [(true, 0.5), (true, 0.0)];
        assert_eq!(checked(&later, false), (2, false), "a defect, seen later");
        let never = [(true, 0.5); ATTEMPTS];
        assert_eq!(checked(&never, false), (ATTEMPTS, true), "told, as skipped");
        assert_eq!(checked(&never, true), (ATTEMPTS, false), "not on CI");
    }
}
