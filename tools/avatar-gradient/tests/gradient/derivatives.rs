//! Derivatives by every kind of parameter and by the pose, against central differences in f64.

use crate::people::{Person, TINY, random_attributes, random_numbers};
use crate::reference::{Numbers, Outcome, align, pose};
use avatar_gradient::{Derivatives, Parameters, PoseCorrection};
use splat_gradient::Attributes;
use spmm3::{MotionParams, PARAMS};
use std::ops::Range;
use synthetic_person::Random;

/// Step of the differences: all numbers are between 1e-4 and 10.
const STEP: f64 = 1e-5;
/// Numbers of an array that are tried: the one with the greatest derivative, and others.
const TRIED: usize = 30;
/// Greatest error, as a share of the greatest derivative, and of all.
const MOST: f64 = 5e-4;

/// What a loss weighs.
struct Weights {
    gaussians: Attributes,
    vertices: Vec<f32>,
    offsets: Vec<f32>,
}

impl Weights {
    fn new(person: &Person, random: &mut Random) -> Self {
        let sizes = person.model.sizes();
        let scaled = |count: usize, by: f32, random: &mut Random| -> Vec<f32> {
            random_numbers(count, random)
                .into_iter()
                .map(|x| by * x)
                .collect()
        };
        Self {
            gaussians: random_attributes(sizes.gaussians, random),
            vertices: scaled(3 * sizes.vertices, 1.0, random),
            // Millimetres count as much as the rest.
            offsets: scaled(3 * sizes.controllers, 100.0, random),
        }
    }

    fn loss(&self, outcome: &Outcome) -> f64 {
        let n = outcome.gaussians.len();
        let gaussians = outcome.gaussians.iter().enumerate().flat_map(|(i, all)| {
            let numbers = all.iter().enumerate();
            numbers.map(move |(plane, x)| x * f64::from(self.gaussians.numbers()[plane * n + i]))
        });
        let planar = |points: &[[f64; 3]], weights: &[f32]| -> f64 {
            let count = points.len();
            let all = points.iter().enumerate();
            all.map(|(v, x)| {
                (0..3)
                    .map(|axis| x[axis] * f64::from(weights[axis * count + v]))
                    .sum::<f64>()
            })
            .sum()
        };
        let offsets = outcome.offsets.as_flattened().iter().zip(&self.offsets);
        gaussians.sum::<f64>()
            + planar(&outcome.vertices, &self.vertices)
            + offsets
                .map(|(x, weight)| x * f64::from(*weight))
                .sum::<f64>()
    }
}

/// Demands that derivatives (the model's, the difference's) of one kind agree.
fn assert_alike(kind: &str, pairs: &[(f64, f64)]) {
    let size: f64 = pairs.iter().map(|(_, expected)| expected * expected).sum();
    let error: f64 = pairs
        .iter()
        .map(|(got, expected)| (got - expected).powi(2))
        .sum();
    let greatest = pairs
        .iter()
        .fold(0.0f64, |most, pair| most.max(pair.1.abs()));
    let worst = pairs.iter().fold(0.0f64, |most, (got, expected)| {
        most.max((got - expected).abs() / greatest)
    });
    let whole = (error / size).sqrt();
    println!(
        "{kind}: {whole:.1e} of the whole, {worst:.1e} at most, of {}",
        pairs.len()
    );
    assert!(size > 0.0, "{kind}: nothing to compare");
    assert!(
        whole <= MOST && worst <= MOST,
        "{kind}: {whole:e}, {worst:e}: {pairs:?}"
    );
}

struct Case {
    person: Person,
    motion: MotionParams,
    weights: Weights,
    gradients: Parameters,
    by_pose: PoseCorrection,
    quaternions: [Vec<f32>; 4],
}

impl Case {
    fn new(person: Person, motion: MotionParams) -> Self {
        let weights = Weights::new(&person, &mut Random::new(31));
        let mut posed = person.posed(&motion);
        person
            .model
            .controller_offsets(&person.parameters, &mut posed)
            .expect("posed");
        let mut gradients = Parameters::zeros(person.model.sizes());
        let by = Derivatives {
            gaussians: Some(&weights.gaussians),
            vertices: Some(&weights.vertices),
            offsets: Some(&weights.offsets),
        };
        let by_pose = person
            .model
            .backward(&person.parameters, &mut posed, &by, &mut gradients)
            .expect("everything fits");
        let quaternions = [3, 4, 5, 6].map(|k| posed.gaussians().plane(k).to_vec());
        Self {
            person,
            motion,
            weights,
            gradients,
            by_pose,
            quaternions,
        }
    }

    fn difference(&self, change: impl Fn(&mut Numbers, f64)) -> f64 {
        let numbers = Numbers::new(&self.person, &self.motion);
        let side = |step: f64| {
            let mut changed = numbers.clone();
            change(&mut changed, step);
            let mut outcome = pose(&self.person, &changed);
            align(
                &mut outcome,
                self.quaternions.each_ref().map(|plane| &plane[..]),
            );
            self.weights.loss(&outcome)
        };
        (side(STEP) - side(-STEP)) / (2.0 * STEP)
    }

    /// Tries some numbers of a part of an array.
    fn check(&self, kind: &str, array: usize, part: Range<usize>) {
        let got = &self.gradients.arrays()[array].1;
        let mut random = Random::new(5);
        let greatest = part
            .clone()
            .max_by(|a, b| got[*a].abs().total_cmp(&got[*b].abs()));
        let others = (1..TRIED.min(part.len())).map(|_| part.start + random.below(part.len()));
        let pairs: Vec<(f64, f64)> = greatest
            .into_iter()
            .chain(others)
            .map(|k| {
                let expected = self.difference(|numbers, step| numbers.arrays[array][k] += step);
                (f64::from(got[k]), expected)
            })
            .collect();
        assert_alike(kind, &pairs);
    }

    fn check_pose(&self) {
        let p = (0..PARAMS).map(|k| {
            let expected = self.difference(|numbers, step| numbers.p[k] += step);
            (f64::from(self.by_pose.0[k]), expected)
        });
        let p: Vec<_> = p.collect();
        assert_alike("body", &p[..75]);
        assert_alike("expression", &p[75..125]);
        assert_alike("hands", &p[125..]);
        let root = (0..3).map(|axis| {
            let expected = self.difference(|numbers, step| numbers.root[axis] += step);
            (f64::from(self.by_pose.0[PARAMS + axis]), expected)
        });
        assert_alike("root", &root.collect::<Vec<_>>());
    }
}

/// Rotations of any length, as a trainer may leave them.
fn stretched(size: synthetic_person::PuppetSize) -> Person {
    let mut person = Person::new(size);
    let (n, mut random) = (size.gaussians, Random::new(9));
    for i in 0..n {
        let stretch = 0.5 + random.unit();
        for plane in 3..7 {
            person.parameters.gaussians[plane * n + i] *= stretch;
        }
    }
    person
}

#[test]
fn derivatives_by_every_parameter_are_its_differences() {
    let case = Case::new(stretched(TINY), Random::new(3).motion(0.6));
    let names: Vec<&str> = case
        .gradients
        .arrays()
        .iter()
        .map(|(name, _)| *name)
        .collect();
    let kinds = [
        ("position", 0..3),
        ("rotation", 3..7),
        ("log scale", 7..10),
        ("opacity", 10..11),
        ("colour", 11..14),
    ];
    for (array, name) in names.into_iter().enumerate() {
        let length = case.gradients.arrays()[array].1.len();
        if array < 2 {
            for (kind, planes) in kinds.clone() {
                let plane = length / 14;
                let part = planes.start * plane..planes.end * plane;
                case.check(&format!("{name}, {kind}"), array, part);
            }
        } else {
            case.check(name, array, 0..length);
        }
    }
}

#[test]
fn derivatives_by_a_bent_pose_are_its_differences() {
    Case::new(stretched(TINY), Random::new(4).motion(0.8)).check_pose();
}

#[test]
fn derivatives_by_the_t_pose_are_its_differences() {
    let case = Case::new(Person::new(TINY), MotionParams::default());
    case.check_pose();
}

#[test]
fn a_correction_is_a_change_of_the_motion() {
    let person = Person::new(TINY);
    let mut random = Random::new(12);
    let motion = random.motion(0.4);
    let mut correction = PoseCorrection::default();
    for number in &mut correction.0 {
        *number = 0.05 * random.signed();
    }
    let mut corrected = avatar_gradient::Posed::new();
    person
        .model
        .pose(
            &person.parameters,
            &motion,
            Some(&correction),
            &mut corrected,
        )
        .expect("the parameters fit");
    let direct = person.posed(&correction.applied(&motion));
    assert_eq!(corrected.gaussians(), direct.gaussians(), "one pose");
    let moved = corrected.root() - motion.root_translation;
    assert!(
        (moved - correction.shift()).length() < 1e-6,
        "the root moved by {moved}"
    );
}

#[test]
fn derivatives_of_several_poses_add_up() {
    let person = Person::new(TINY);
    let by = random_attributes(TINY.gaussians, &mut Random::new(2));
    let by = Derivatives {
        gaussians: Some(&by),
        ..Derivatives::default()
    };
    let mut posed = person.posed(&Random::new(7).motion(0.5));
    let mut once = Parameters::zeros(person.model.sizes());
    let model = &person.model;
    let first = model.backward(&person.parameters, &mut posed, &by, &mut once);
    let mut twice = once.clone();
    let second = model.backward(&person.parameters, &mut posed, &by, &mut twice);
    assert_eq!(
        first.expect("fits"),
        second.expect("fits"),
        "the pose's are not added"
    );
    for ((name, once), (_, twice)) in once.arrays().into_iter().zip(twice.arrays()) {
        for (once, twice) in once.iter().zip(twice) {
            assert!(
                (2.0 * once - twice).abs() <= 1e-5 * twice.abs().max(1e-3),
                "{name}: {once}, {twice}"
            );
        }
    }
}

#[test]
fn parts_that_are_off_have_no_derivatives() {
    let mut person = Person::new(TINY);
    person.model.parts = avatar_gradient::Parts {
        mesh: false,
        attributes: false,
    };
    let mut posed = person.posed(&Random::new(7).motion(0.5));
    assert_eq!(
        posed.local(),
        &person.parameters.gaussians[..],
        "no residuals"
    );
    let by = random_attributes(TINY.gaussians, &mut Random::new(2));
    let by = Derivatives {
        gaussians: Some(&by),
        ..Derivatives::default()
    };
    let mut gradients = Parameters::zeros(person.model.sizes());
    let by_pose = person
        .model
        .backward(&person.parameters, &mut posed, &by, &mut gradients)
        .expect("fits");
    for (name, array) in gradients.arrays() {
        let learnt = array.iter().any(|x| *x != 0.0);
        assert_eq!(learnt, matches!(name, "gaussians" | "mesh.mean"), "{name}");
    }
    assert!(
        by_pose.parameters()[..75].iter().any(|x| *x != 0.0),
        "the joints'"
    );
    assert!(
        by_pose.parameters()[75..125].iter().all(|x| *x == 0.0),
        "no network saw it"
    );
}
