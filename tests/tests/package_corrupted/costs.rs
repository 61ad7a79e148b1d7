//! Packages that are sound, and would cost those who look at the person too much.

use crate::parts::{GAUSSIANS, Parts, Tensors};
use crate::{Court, HELD, PEAK, causes};
use half::f16;
use serde_json::json;
use spmm3::package::PackageLimits;
use spmm3::{Avatar, attribute};
use std::io::Cursor;
use std::sync::atomic::Ordering::Relaxed;
use synthetic_person::hostile::{cloud, hollow};

/// What reading another person's package may take: its largest graph, decoded to be checked, and as much again for the rest.
const MOST_HELD: usize = 512 << 20;

pub(crate) fn dear_packages(court: &mut Court) {
    for count in [3_000, 30_000] {
        let mut parts = Parts::of(&cloud(count, 0.01).to_bytes().expect("a small cloud"));
        let mut tensors = Tensors::of(parts.member(GAUSSIANS));
        let large = f16::from_f32(7.0_f32.ln()).to_le_bytes();
        for at in attribute::LOG_SCALE.start * count..attribute::LOG_SCALE.end * count {
            tensors.set("attributes", at, &large);
        }
        *parts.member(GAUSSIANS) = tensors.bytes();
        let package = parts.rehash().pack();
        let what = format!("{count} Gaussians of 7 m");
        court.refuse(&what, &package, "a person's may have 0.5 m");
    }
    // What a builder's package would be, too.
    let refused = cloud(3_000, 0.49).to_bytes().expect_err("it is read back");
    let said = causes(&refused);
    assert!(said.contains("cover 12288000 screen tiles"), "{said}");
    cloud(2_000, 7.0)
        .to_bytes()
        .expect("held at the largest size");
}

/// What others bring is held to less than what is one's own.
pub(crate) fn packages_of_others(court: &mut Court, parts: &Parts) {
    let mut many = parts.clone();
    many.manifest["counts"]["gaussians"] = json!(250_001);
    let (error, held) = read_as_anothers(&many.pack()).expect_err("too many");
    assert!(error.contains("250001 Gaussians"), "{error}");
    assert!(held < 4 << 20, "{held} bytes for a refusal");

    let zeros = hollow(8_000).to_bytes().expect("a package");
    println!("{} bytes hold 64 million zeros", zeros.len());
    Avatar::read(Cursor::new(&zeros)).expect("one's own may be as large");
    let (error, held) = read_as_anothers(&zeros).expect_err("too large");
    assert!(error.contains("bytes of networks"), "{error}");
    assert!(held < 4 << 20, "{held} bytes for a refusal");

    let largest = hollow(6_500).to_bytes().expect("a package");
    let held = read_as_anothers(&largest).expect("within the limits");
    println!(
        "{} bytes of another person's package take {:.0} MiB while they are read",
        largest.len(),
        held as f64 / f64::from(1 << 20)
    );
    assert!(held < MOST_HELD, "{held} bytes");
    court.cases += 3;
}

/// Bytes held at most; with the error's text where it is refused.
fn read_as_anothers(package: &[u8]) -> Result<usize, (String, usize)> {
    let before = HELD.load(Relaxed);
    PEAK.store(before, Relaxed);
    let outcome = Avatar::read_within(Cursor::new(package), &PackageLimits::OTHERS);
    let held = PEAK.load(Relaxed) - before;
    match outcome {
        Ok(_) => Ok(held),
        Err(error) => Err((causes(&error), held)),
    }
}
