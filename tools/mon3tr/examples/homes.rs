//! Calls between homes behind NAT, in network namespaces of this machine, measured: how long joining takes, and how long motion stops when
//! an address changes. For the figures in `docs/calls.md`:
//!
//! ```sh
//! eval "$(./run env)"; cargo build --release -p mon3tr --bin mon3tr --example homes
//! target/release/examples/homes joins 1000
//! target/release/examples/homes moves 5
//! ```

use serde_json::Value;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use test_support::internet::{CallWorld, Home, HomeKind, Receiving};

/// Viewers that join at the same time.
const AT_ONCE: usize = 4;

/// When a viewer that has not joined counts as one that cannot.
const LONGEST: Duration = Duration::from_secs(30);

const USAGE: &str = "usage: homes joins N | homes moves N";

fn main() {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [what, number] = &arguments[..] else {
        panic!("{USAGE}")
    };
    let number: usize = number.parse().expect(USAGE);
    let mut world = CallWorld::open(&mon3tr()).expect("network namespaces");
    match what.as_str() {
        "joins" => joins(&mut world, number),
        "moves" => moves(&mut world, number),
        _ => panic!("{USAGE}"),
    }
}

/// The command, built beside this example.
fn mon3tr() -> PathBuf {
    let here = std::env::current_exe().expect("the path of this program");
    let built = here.parent().and_then(|examples| examples.parent());
    let mon3tr = built.expect("a folder of examples").join("mon3tr");
    assert!(mon3tr.exists(), "{} is not built", mon3tr.display());
    mon3tr
}

/// Viewers behind a symmetric NAT join a sender behind another one, some at a time, each with a process and a cache of its own.
fn joins(world: &mut CallWorld, number: usize) {
    let [here, there] = [(); 2].map(|()| world.internet().home(HomeKind::Symmetric));
    let mut sending = world.send(&here, &[]);
    let link = sending.link.clone();
    let mut running: Vec<(Instant, Receiving)> = Vec::new();
    let (mut begun, mut failed, mut relayed) = (0, 0, 0);
    let mut first_ms = Vec::new();
    while begun < number || !running.is_empty() {
        while begun < number && running.len() < AT_ONCE {
            let viewer = world.receive(&there, &link, &["--seconds", "1"]);
            running.push((Instant::now(), viewer));
            begun += 1;
        }
        running.retain_mut(|(since, viewer)| {
            let call = match viewer.outcome(Duration::ZERO) {
                Some(Ok(call)) => call,
                None if since.elapsed() < LONGEST => return true,
                Some(Err(why)) => {
                    failed += 1;
                    eprintln!("{why}");
                    return false;
                }
                None => {
                    failed += 1;
                    eprintln!("not joined after {LONGEST:?}:\n{}", viewer.program.said());
                    return false;
                }
            };
            match call["first_frame_ms"].as_f64() {
                Some(ms) => first_ms.push(ms),
                None => failed += 1,
            }
            let path = &call["received"]["path"];
            let relay = ["local", "remote"].map(|end| path[end]["kind"] == "relay");
            relayed += usize::from(relay.contains(&true));
            false
        });
        std::thread::sleep(Duration::from_millis(10));
    }
    sending.hang_up();
    println!(
        "{number} joins, {AT_ONCE} at a time, symmetric NAT on both sides: {} saw motion ({relayed} relayed), {failed} did not; to the first motion {}",
        first_ms.len(),
        spread(&mut first_ms)
    );
}

/// One case of a change of address.
struct Case {
    who: &'static str,
    kind: HomeKind,
    moves: fn(&mut Home),
    viewer: bool,
}

/// A call for each case, `number` times; in the middle of it an address changes.
fn moves(world: &mut CallWorld, number: usize) {
    let machine: fn(&mut Home) = Home::move_machine;
    let router: fn(&mut Home) = Home::move_router;
    for kind in [HomeKind::Cone, HomeKind::Symmetric, HomeKind::UdpBlocked] {
        for (who, moves, viewer) in [
            ("the viewer's machine", machine, true),
            ("the sender's machine", machine, false),
            ("the viewer's router", router, true),
            ("the sender's router", router, false),
        ] {
            let case = Case {
                who,
                kind,
                moves,
                viewer,
            };
            case.run(world, number);
        }
    }
}

impl Case {
    fn run(&self, world: &mut CallWorld, number: usize) {
        let mut homes = [(); 2].map(|()| world.internet().home(self.kind));
        let mut gaps = Vec::new();
        for _ in 0..number {
            gaps.extend(self.gap(world, &mut homes));
        }
        println!(
            "{}, {} on both sides: motion came again in {} of {number} calls, after {}",
            self.who,
            self.kind,
            gaps.len(),
            spread(&mut gaps)
        );
    }

    /// The longest time without motion in a call, in milliseconds; nothing if it did not come again.
    fn gap(&self, world: &CallWorld, homes: &mut [Home; 2]) -> Option<f64> {
        let mut sending = world.send(&homes[0], &[]);
        let mut receiving = world.receive(&homes[1], &sending.link, &[]);
        receiving.program.says("joined (session", 1);
        sending.program.says("a viewer has joined", 1);
        std::thread::sleep(Duration::from_secs(2));
        (self.moves)(&mut homes[usize::from(self.viewer)]);
        let begun = Instant::now();
        let joined = |said: &str| said.matches("joined (session").count() > 1;
        while begun.elapsed() < LONGEST && !joined(&receiving.program.said()) {
            std::thread::sleep(Duration::from_millis(20));
        }
        std::thread::sleep(Duration::from_secs(1));
        sending.hang_up();
        match receiving.outcome(LONGEST) {
            Some(Ok(call)) => longest_gap(&call),
            Some(Err(why)) => {
                eprintln!("{why}");
                None
            }
            None => {
                eprintln!("it does not end:\n{}", receiving.program.said());
                None
            }
        }
    }
}

fn longest_gap(call: &Value) -> Option<f64> {
    let gaps = call["gaps"].as_array()?.iter();
    gaps.filter_map(|gap| gap["ms"].as_f64()).reduce(f64::max)
}

/// Median and worst of milliseconds, in words.
fn spread(ms: &mut [f64]) -> String {
    ms.sort_by(f64::total_cmp);
    match (ms.get(ms.len() / 2), ms.last()) {
        (Some(median), Some(worst)) => {
            let (median, worst) = (median / 1e3, worst / 1e3);
            format!("{median:.2} s (median), {worst:.2} s (worst)")
        }
        _ => "nothing".to_owned(),
    }
}
