//! Calls between homes behind NAT, in network namespaces of this machine, measured: how long joining takes, and how long motion stops when
//! an address changes. For the figures in `docs/call-reference.md`:
//!
//! ```sh
//! eval "$(./run env)"; cargo build -p mon3tr --bin mon3tr --example homes
//! target/debug/examples/homes joins 1000
//! target/debug/examples/homes moves 5
//! ```

use serde_json::Value;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use test_support::internet::{CallWorld, Home, HomeKind, Receiving};

/// Viewers that join at the same time.
const AT_ONCE: usize = 4;

/// When a viewer that has not joined counts as one that cannot.
const LONGEST: Duration = Duration::from_secs(30);

/// What a viewer says once it has joined.
const JOINED: &str = "joined (session";

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

/// A viewer that is to join, see motion for a second, and leave.
struct Visit {
    viewer: Receiving,
    begun: Instant,
    /// When it was asked to end.
    asked: Option<Instant>,
}

impl Visit {
    /// How it went, once it is over.
    fn outcome(&mut self) -> Option<Result<Value, String>> {
        if let Some(over) = self.viewer.outcome(Duration::ZERO) {
            return Some(over);
        }
        let late = self.begun.elapsed() > LONGEST;
        match self.asked {
            None if late || self.viewer.program.said().contains(JOINED) => {
                self.asked = Some(Instant::now());
            }
            Some(asked) if asked.elapsed() > Duration::from_secs(1) => {
                self.viewer.program.ask_to_end();
                self.asked = Some(Instant::now());
            }
            _ => {}
        }
        None
    }
}

/// Viewers behind a symmetric NAT join a sender behind another one, some at a time, each with a process and a cache of its own.
fn joins(world: &mut CallWorld, number: usize) {
    let [here, there] = [(); 2].map(|()| world.internet().home(HomeKind::Symmetric));
    let mut sending = world.send(&here, &[]);
    let mut visits: Vec<Visit> = Vec::new();
    let (mut begun, mut relayed) = (0, 0);
    let mut first_ms = Vec::new();
    while begun < number || !visits.is_empty() {
        while begun < number && visits.len() < AT_ONCE {
            visits.push(Visit {
                viewer: world.receive(&there, &sending.link, &[]),
                begun: Instant::now(),
                asked: None,
            });
            begun += 1;
        }
        visits.retain_mut(|visit| {
            let call = match visit.outcome() {
                None => return true,
                Some(Ok(call)) => call,
                Some(Err(why)) => {
                    eprintln!("{why}");
                    return false;
                }
            };
            match call["first_frame_ms"].as_f64() {
                Some(ms) => first_ms.push(ms),
                None => eprintln!("no motion came:\n{}", visit.viewer.program.said()),
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
        "{number} joins, {AT_ONCE} at a time, symmetric NAT on both sides: {} saw motion, {relayed} by the relay; to the first motion {}",
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
        receiving.program.says(JOINED, 1);
        sending.program.says("a viewer has joined", 1);
        std::thread::sleep(Duration::from_secs(2));
        (self.moves)(&mut homes[usize::from(self.viewer)]);
        let begun = Instant::now();
        let joined = |said: &str| said.matches(JOINED).count() > 1;
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
