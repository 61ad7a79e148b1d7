//! Each target, a bounded number of times, on inputs that are changed at random from those that make sense. The seed is the same each time; more, and by
//! coverage, with cargo-fuzz.

use fuzz_targets::{TARGETS, Target};
use std::panic::catch_unwind;

/// An input, changed as a stranger might: bits turned, bytes that are often special, parts cut out, doubled or taken from another one.
fn changed(random: &mut fastrand::Rng, seeds: &[Vec<u8>]) -> Vec<u8> {
    const SPECIAL: [u8; 8] = [0, 1, 0x7f, 0x80, 0xff, b'\n', b'"', b'-'];
    let mut bytes = random.choice(seeds).cloned().unwrap_or_default();
    for _ in 0..=random.usize(0..6) {
        if bytes.is_empty() {
            bytes.push(random.u8(..));
        }
        let at = random.usize(0..bytes.len());
        let to = random.usize(at..=bytes.len().min(at + 64));
        match random.u8(0..7) {
            0 => bytes[at] ^= 1 << random.u8(0..8),
            1 => bytes[at] = *random.choice(SPECIAL.iter()).unwrap_or(&0),
            2 => bytes[at] = random.u8(..),
            3 => drop(bytes.drain(at..to)),
            4 => {
                let part = bytes[at..to].to_vec();
                bytes.splice(at..at, part);
            }
            5 => bytes.truncate(at),
            _ => {
                let other = random.choice(seeds).map_or(&[][..], Vec::as_slice);
                let from = random.usize(0..=other.len());
                let until = random.usize(from..=other.len().min(from + 64));
                bytes.splice(at..at, other[from..until].iter().copied());
            }
        }
    }
    bytes
}

fn run(target: &Target) {
    let seeds = (target.seeds)();
    for seed in &seeds {
        (target.run)(seed);
    }
    let mut random = fastrand::Rng::with_seed(20);
    for time in 0..target.times {
        let input = changed(&mut random, &seeds);
        if catch_unwind(|| (target.run)(&input)).is_err() {
            let text: String = input.iter().map(|byte| format!("{byte:02x}")).collect();
            panic!("{}, time {time}: {text}", target.name);
        }
    }
    println!("{}: {} inputs", target.name, target.times);
}

macro_rules! each {
    ($($name:ident)*) => {$(
        #[test]
        fn $name() {
            let target = TARGETS.iter().find(|target| target.name == stringify!($name));
            run(target.expect("a target of that name"));
        }
    )*

        #[test]
        fn none_is_left_out() {
            assert_eq!(TARGETS.map(|target| target.name), [$(stringify!($name)),*]);
        }
    };
}

each!(messages frames json links voice keys package scene motion);

#[test]
fn cargo_fuzz_has_the_same_targets() {
    let manifest = include_str!("../cargo-fuzz/Cargo.toml");
    for target in &TARGETS {
        let line = format!("name = \"{}\"", target.name);
        assert!(manifest.contains(&line), "{line}");
    }
}
