//! The kernels against f64 references, `spmm3`'s plain versions and one another, on every level of this processor.

use super::Detail;
use super::{Attributes, Blend, PoseInputs, Poser, Skinner};
use crate::state::{GaussianState, STATE_PLANES, StateChange, plane};
use bytemuck::Zeroable;
use fearless_simd::Level;
use glam::Vec3;
use shaders_spirv::{LOG2_MOST_SCALE, PackedGaussian};
use spmm3::{ATTRIBUTES, GaussianSet, MotionParams, PlanarVertices, SH_C0, SkinningTransforms};
use synthetic_person::reference;
use synthetic_person::{Puppet, PuppetSize, Random};

/// This processor's SIMD levels, the narrowest first.
pub(super) fn levels() -> Vec<Level> {
    let new = Level::new();
    #[cfg(target_arch = "x86_64")]
    let more = [
        new.as_sse4_2().map(Level::Sse4_2),
        new.as_avx2().map(Level::Avx2),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let more: [Option<Level>; 0] = [];
    [Level::baseline(), new]
        .into_iter()
        .chain(more.into_iter().flatten())
        .collect()
}

#[cfg(target_arch = "aarch64")]
#[test]
fn on_arm64_the_kernels_run_on_neon() {
    use fearless_simd::{Neon, dispatch, prelude::*};
    fn token<S: Simd>(_: S) -> &'static str {
        std::any::type_name::<S>()
    }
    for level in levels() {
        assert!(level.as_neon().is_some(), "{level:?} is not NEON");
        let token = dispatch!(level, simd => token(simd));
        assert_eq!(token, std::any::type_name::<Neon>(), "{level:?}");
    }
}

const ROOT: Vec3 = Vec3::new(0.4, -0.2, 1.3);

/// A puppet in some pose, by the f64 reference, with the deform graph's results for it.
struct Posed {
    puppet: Puppet,
    wanted: Vec<reference::ReferenceGaussian>,
    residuals: Vec<f32>,
    potentials: Vec<f32>,
    vertices: Vec<f32>,
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "as the graph would round it"
)]
fn narrow(value: f64) -> f32 {
    value as f32
}

impl Posed {
    fn new(motion: &MotionParams) -> Self {
        Self::of(Puppet::small(), motion)
    }

    /// More bases than a vector holds, and more Gaussians than one thread takes.
    fn large(motion: &MotionParams) -> Self {
        let size = PuppetSize {
            gaussians: 9_001,
            bases: 21,
            ..PuppetSize::SMALL
        };
        Self::of(Puppet::new(size), motion)
    }

    fn of(puppet: Puppet, motion: &MotionParams) -> Self {
        let p = motion.values();
        let rest = puppet.skeleton.rest_positions();
        let mesh = reference::posed_mesh(&puppet.template, rest, &puppet.mesh, p);
        let residuals = reference::residuals(&puppet.attributes, &puppet.controllers, p);
        let controllers = puppet.controllers.vertices().len();
        let potentials = reference::potentials(&puppet.attributes, controllers, p).concat();
        let wanted = reference::gaussians_on_mesh(
            &puppet.template,
            &puppet.gaussians,
            &mesh,
            Some(&residuals),
            reference::wide(ROOT),
        );
        let planes = |axis: usize| mesh.iter().map(move |v| narrow(v[axis]));
        let plane = |plane: usize| residuals.iter().map(move |r| narrow(r[plane]));
        Self {
            wanted,
            vertices: (0..3).flat_map(planes).collect(),
            residuals: (0..ATTRIBUTES).flat_map(plane).collect(),
            potentials: potentials.into_iter().map(narrow).collect(),
            puppet,
        }
    }

    fn inputs<'a>(&'a self, attributes: Attributes<'a>) -> PoseInputs<'a> {
        PoseInputs {
            vertices: &self.vertices,
            attributes,
            root: ROOT,
        }
    }

    fn poser(&self) -> Poser {
        Poser::with_tail(&self.puppet.avatar()).expect("the puppet's graph is ours")
    }
}

fn all(poser: &Poser, inputs: &PoseInputs<'_>) -> GaussianState {
    let mut state = GaussianState::new(poser.gaussians());
    poser
        .pose(inputs, 0..poser.gaussians(), None, &mut state)
        .expect("the inputs fit");
    state
}

fn at<const N: usize>(state: &GaussianState, first: usize, i: usize) -> [f32; N] {
    std::array::from_fn(|k| state.plane(first + k)[i])
}

/// The state's greatest errors against the reference: metres, the rotation matrix' numbers, log2 scale, opacity, colour.
fn errors(state: &GaussianState, wanted: &[reference::ReferenceGaussian]) -> [f64; 5] {
    let mut worst = [0.0f64; 5];
    let mut note = |which: usize, error: f64| worst[which] = worst[which].max(error);
    for (i, want) in wanted.iter().enumerate() {
        let position = at::<3>(state, plane::POSITION.start, i).map(f64::from);
        note(0, reference::norm(reference::sub(position, want.position)));
        let quaternion = at::<4>(state, plane::ROTATION.start, i).map(f64::from);
        let length = quaternion.iter().map(|x| x * x).sum::<f64>();
        note(1, (length - 1.0).abs());
        let matrix = reference::quaternion_matrix(quaternion);
        for (row, want) in matrix.iter().zip(want.rotation) {
            note(1, reference::norm(reference::sub(*row, want)));
        }
        let scale = at::<3>(state, plane::LOG2_SCALE.start, i);
        for (got, want) in scale.iter().zip(want.log_scale) {
            note(2, (f64::from(*got) - want * std::f64::consts::LOG2_E).abs());
        }
        let opacity = f64::from(state.plane(plane::OPACITY)[i]);
        note(
            3,
            (opacity - 1.0 / (1.0 + (-want.opacity_logit).exp())).abs(),
        );
        let colour = at::<3>(state, plane::COLOUR.start, i);
        for (got, want) in colour.iter().zip(want.colour) {
            note(4, (f64::from(*got) - 0.5 - want * f64::from(SH_C0)).abs());
        }
    }
    worst
}

#[test]
fn the_poser_poses_as_in_f64_from_residuals_and_from_potentials_on_every_level() {
    for seed in 0..3 {
        let posed = Posed::new(&Random::new(seed).motion(0.6));
        for level in levels() {
            let poser = posed.poser().at_level(level);
            for attributes in [
                Attributes::Residuals(&posed.residuals),
                Attributes::Potentials(&posed.potentials),
            ] {
                let state = all(&poser, &posed.inputs(attributes));
                let worst = errors(&state, &posed.wanted);
                println!("{level:?}: {:?}", worst.map(|e| format!("{e:.1e}")));
                let most = [5e-6, 5e-5, 1e-5, 1e-6, 1e-5];
                for (error, most) in worst.iter().zip(most) {
                    assert!(*error <= most, "{worst:?} at {level:?}");
                }
            }
        }
    }
}

#[test]
fn the_tail_alone_gives_the_residuals() {
    let posed = Posed::large(&Random::new(9).motion(0.6));
    for level in levels() {
        let poser = posed.poser().at_level(level);
        let mut got = vec![f32::NAN; posed.residuals.len()];
        poser
            .residuals(&posed.potentials, &mut got)
            .expect("the sizes fit");
        let count = poser.gaussians();
        for (got, want) in got.chunks(count).zip(posed.residuals.chunks(count)) {
            let reach = want.iter().fold(0.0f32, |most, x| most.max(x.abs()));
            for (got, want) in got.iter().zip(want) {
                assert!((got - want).abs() <= 1e-5 * reach, "{got}, not {want}");
            }
        }
    }
}

#[test]
fn collapsed_triangles_and_vanished_rotations_are_posed_as_spmm3_poses_them() {
    let mut posed = Posed::new(&Random::new(4).motion(0.6));
    let count = posed.wanted.len();
    let vertices = posed.vertices.len() / 3;
    // Every third Gaussian's triangle becomes a point, every third a line; some rotations cancel out.
    for (i, [a, b, c]) in posed.puppet.gaussians.corners().iter().enumerate() {
        let [a, b, c] = [*a, *b, *c].map(|v| v as usize);
        for axis in (0..3).map(|axis| axis * vertices) {
            match i % 9 {
                0 => {
                    posed.vertices[axis + b] = posed.vertices[axis + a];
                    posed.vertices[axis + c] = posed.vertices[axis + a];
                }
                3 => {
                    let (a, b) = (posed.vertices[axis + a], posed.vertices[axis + b]);
                    posed.vertices[axis + c] = a + 2.0 * (b - a);
                }
                _ => {}
            }
        }
        if i % 5 == 0 {
            for axis in plane::ROTATION {
                posed.residuals[axis * count + i] =
                    -posed.puppet.gaussians.attributes()[axis * count + i];
            }
        }
    }
    let mut plain = GaussianSet::zeroed(count);
    let mesh = PlanarVertices::new(&posed.vertices, vertices).expect("three planes");
    posed
        .puppet
        .gaussians
        .pose(mesh, Some(&posed.residuals), ROOT, &mut plain)
        .expect("the sizes fit");
    for level in levels() {
        let poser = posed.poser().at_level(level);
        let state = all(
            &poser,
            &posed.inputs(Attributes::Residuals(&posed.residuals)),
        );
        let (mut alike, mut slivers) = (0, 0);
        for i in 0..count {
            let position = Vec3::from_array(at(&state, plane::POSITION.start, i));
            assert!(position.is_finite(), "Gaussian {i} is at {position}");
            let rotation = glam::Quat::from_array(at(&state, plane::ROTATION.start, i));
            assert!(rotation.is_normalized(), "Gaussian {i}: {rotation}");
            let near = position.distance(plain.positions[i]) < 1e-4
                && rotation.dot(plain.rotations[i]).abs() > 1.0 - 1e-5;
            // A line's normal is nothing but rounding, and differs with it.
            let [a, b, c] = posed.puppet.gaussians.corners()[i].map(|v| {
                let v = v as usize;
                Vec3::from_array([0, 1, 2].map(|axis| posed.vertices[axis * vertices + v]))
            });
            let across = (b - a).normalize_or_zero().cross(c - a).length();
            let point = a == b && a == c;
            if across < 1e-5 && !point {
                slivers += 1;
            } else {
                assert!(near, "Gaussian {i} at {level:?}: {position} {rotation}");
                alike += 1;
            }
        }
        assert!(alike > count / 2, "{alike} alike, {slivers} slivers");
    }
}

#[test]
fn ranges_that_split_anywhere_give_the_same_state_and_change() {
    let posed = Posed::large(&Random::new(1).motion(0.6));
    let poser = posed.poser();
    let before = all(
        &poser,
        &posed.inputs(Attributes::Residuals(&posed.residuals)),
    );
    let moved = Posed::large(&Random::new(2).motion(0.6));
    let inputs = moved.inputs(Attributes::Potentials(&moved.potentials));
    let count = poser.gaussians();
    let mut whole = GaussianState::new(count);
    let change = poser
        .pose(&inputs, 0..count, Some(&before), &mut whole)
        .expect("the inputs fit");
    let mut random = Random::new(3);
    for _ in 0..10 {
        let mut cuts: Vec<usize> = (0..9).map(|_| random.below(count + 1)).collect();
        cuts.extend([0, count, count]);
        cuts.sort_unstable();
        let mut pieces = GaussianState::new(count);
        let mut joined = StateChange::default();
        for range in cuts.windows(2).map(|cut| cut[0]..cut[1]) {
            let change = poser.pose(&inputs, range, Some(&before), &mut pieces);
            joined = joined.join(change.expect("the inputs fit"));
        }
        assert!(pieces == whole, "cut at {cuts:?}");
        assert_eq!(joined, change, "cut at {cuts:?}");
    }
    let far = |first: usize, planes: usize, i: usize| {
        let differences = (first..first + planes)
            .map(|p| f64::from(whole.plane(p)[i]) - f64::from(before.plane(p)[i]));
        differences.map(|d| d * d).sum::<f64>().sqrt()
    };
    let most = |first: usize, planes: usize| {
        (0..count)
            .map(|i| far(first, planes, i))
            .fold(0.0, f64::max)
    };
    let octaves = plane::LOG2_SCALE.map(|p| most(p, 1)).fold(0.0, f64::max);
    for (got, want) in [
        (change.moved, most(0, 3)),
        (change.octaves, octaves),
        (change.opacity, most(plane::OPACITY, 1)),
    ] {
        assert!(want > 0.0, "the pose changed");
        assert!(
            (f64::from(got) - want).abs() < 1e-5 * want,
            "{got}, not {want}"
        );
    }
    let still = poser.pose(
        &inputs,
        0..count,
        Some(&whole),
        &mut GaussianState::new(count),
    );
    assert_eq!(
        still.expect("the inputs fit"),
        StateChange::default(),
        "still"
    );
}

#[test]
fn inputs_of_the_wrong_size_are_refused() {
    let posed = Posed::new(&MotionParams::default());
    let poser = Poser::new(&posed.puppet.avatar());
    let count = poser.gaussians();
    let mut state = GaussianState::new(count);
    let inputs = posed.inputs(Attributes::Potentials(&posed.potentials));
    let refused = poser.pose(&inputs, 0..count, None, &mut state);
    assert!(refused.is_err(), "potentials without a tail");
    let inputs = posed.inputs(Attributes::Residuals(&posed.residuals[1..]));
    assert!(
        poser.pose(&inputs, 0..count, None, &mut state).is_err(),
        "short residuals"
    );
    let inputs = posed.inputs(Attributes::Residuals(&posed.residuals));
    assert!(
        poser.pose(&inputs, 0..count + 1, None, &mut state).is_err(),
        "past the end"
    );
    let short = &mut GaussianState::new(count - 1);
    assert!(
        poser.pose(&inputs, 0..1, None, short).is_err(),
        "a short state"
    );
    let inputs = PoseInputs {
        vertices: &posed.vertices[3..],
        ..inputs
    };
    assert!(
        poser.pose(&inputs, 0..1, None, &mut state).is_err(),
        "short vertices"
    );
}

#[test]
fn skinning_is_as_in_f64_on_every_level() {
    let puppet = Puppet::small();
    let count = puppet.template.vertices().len();
    for seed in 0..3 {
        let motion = Random::new(seed).motion(0.8);
        let joints =
            reference::forward_kinematics(puppet.skeleton.rest_positions(), motion.values());
        let moves = reference::posed_from_rest(puppet.skeleton.rest_positions(), &joints);
        let shape: Vec<_> = puppet
            .template
            .vertices()
            .iter()
            .map(|v| reference::wide(*v))
            .collect();
        let wanted = reference::skin(&puppet.template, &shape, &moves);
        let canonical: Vec<f32> = (0..3)
            .flat_map(|axis| puppet.template.vertices().iter().map(move |v| v[axis]))
            .collect();
        let mut transforms = SkinningTransforms::default();
        puppet
            .skeleton
            .skinning(&puppet.skeleton.pose(&motion), &mut transforms);
        for level in levels() {
            let mut posed = vec![f32::NAN; 3 * count];
            Skinner::new(&puppet.template)
                .at_level(level)
                .skin(&canonical, &transforms, &mut posed)
                .expect("the sizes fit");
            for (v, want) in wanted.iter().enumerate() {
                let got = [0, 1, 2].map(|axis| f64::from(posed[axis * count + v]));
                let error = reference::norm(reference::sub(*want, got));
                assert!(error < 5e-6, "vertex {v} is {error} m off");
            }
        }
    }
}

/// A state of Gaussians that could be a person's.
fn likely_state(count: usize, seed: u64) -> GaussianState {
    let mut random = Random::new(seed);
    let mut state = GaussianState::new(count);
    for i in 0..count {
        let mut rotation: [f32; 4] = std::array::from_fn(|_| random.normal());
        let length = rotation.iter().map(|x| x * x).sum::<f32>().sqrt();
        rotation = rotation.map(|x| x / length);
        for p in 0..STATE_PLANES {
            state.plane_mut(p)[i] = match p {
                0..3 => 2.0 * random.signed(),
                3..7 => rotation[p - 3],
                7..10 => -7.0 + random.normal(),
                10 => random.unit(),
                _ => random.unit(),
            };
        }
    }
    state
}

fn packed_alone(state: &GaussianState, i: usize) -> PackedGaussian {
    PackedGaussian::new(
        at(state, plane::POSITION.start, i),
        at(state, plane::ROTATION.start, i),
        at(state, plane::LOG2_SCALE.start, i).map(no_larger),
        state.plane(plane::OPACITY)[i],
        at(state, plane::COLOUR.start, i),
    )
}

/// The scale, or the largest that a person's Gaussian may have. What is no number stays none.
fn no_larger(log2_scale: f32) -> f32 {
    if log2_scale > LOG2_MOST_SCALE {
        LOG2_MOST_SCALE
    } else {
        log2_scale
    }
}

fn pack(blend: &Blend<'_>, count: usize) -> Vec<PackedGaussian> {
    let mut out = vec![PackedGaussian::zeroed(); count];
    blend.pack(0..count, &mut out).expect("the sizes fit");
    out
}

#[test]
fn two_equal_states_are_packed_as_that_state_at_any_time() {
    let count = 1_003;
    let mut state = likely_state(count, 1);
    for (i, odd) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, 0.0, 1e30]
        .into_iter()
        .enumerate()
    {
        for p in 0..STATE_PLANES {
            state.plane_mut(p)[20 * p + i] = odd;
        }
    }
    let wanted: Vec<PackedGaussian> = (0..count).map(|i| packed_alone(&state, i)).collect();
    for alpha in [0.0, 0.3, 1.0, 1.9, 2.0, 7.0, -1.0, f32::NAN] {
        for level in levels() {
            let blend = Blend::new(&state, &state, alpha)
                .expect("one length")
                .at_level(level);
            for (i, (got, want)) in pack(&blend, count).iter().zip(&wanted).enumerate() {
                // Infinity less infinity is no number: such a Gaussian is not drawn, and need not be alike else.
                let finite = (0..STATE_PLANES).all(|p| state.plane(p)[i].abs() < 1e20);
                if finite || *want == PackedGaussian::zeroed() {
                    assert_eq!(got, want, "Gaussian {i} at {alpha}, {level:?}");
                } else {
                    assert!(
                        *got == PackedGaussian::zeroed() || got == want,
                        "Gaussian {i}"
                    );
                }
            }
        }
    }
}

#[test]
fn between_two_states_each_gaussian_is_as_in_f64() {
    let count = 3_001;
    let (from, to) = (likely_state(count, 2), likely_state(count, 3));
    for alpha in [0.0f32, 0.25, 0.9, 1.0, 1.5] {
        for level in levels() {
            let blend = Blend::new(&from, &to, alpha)
                .expect("one length")
                .at_level(level);
            let t = f64::from(alpha);
            for (i, got) in pack(&blend, count).iter().enumerate() {
                let lerp = |p: usize| {
                    let (a, b) = (f64::from(from.plane(p)[i]), f64::from(to.plane(p)[i]));
                    narrow(a + t * (b - a))
                };
                let a = glam::DQuat::from_array(at(&from, 3, i).map(f64::from)).normalize();
                let b = glam::DQuat::from_array(at(&to, 3, i).map(f64::from)).normalize();
                let b = if a.dot(b) < 0.0 { -b } else { b };
                let angle = a.dot(b).clamp(-1.0, 1.0).acos();
                let turned = a * (((1.0 - t) * angle).sin() / angle.sin())
                    + b * ((t * angle).sin() / angle.sin());
                let want = PackedGaussian::new(
                    [0, 1, 2].map(lerp),
                    turned.to_array().map(narrow),
                    [7, 8, 9].map(lerp).map(no_larger),
                    lerp(10),
                    [11, 12, 13].map(lerp),
                );
                let position = Vec3::from_array(got.position());
                assert!(
                    position.distance(Vec3::from_array(want.position())) < 2e-6,
                    "Gaussian {i} at {position}"
                );
                assert!(
                    steps_apart(got, &want),
                    "{got:?}, not {want:?} at {alpha}, {level:?}"
                );
            }
        }
    }
}

/// Whether everything behind the position is alike but for the last step of each number.
fn steps_apart(got: &PackedGaussian, want: &PackedGaussian) -> bool {
    let fields = |gaussian: &PackedGaussian| {
        let [_, _, _, d, e, f, g, h]: [u32; 8] = bytemuck::cast(*gaussian);
        let low = |word: u32| i64::from(word & 0xFFFF);
        let high = |word: u32| i64::from(word >> 16);
        let rotation = [f & 0x7FFF, (f >> 15) & 0x7FFF, g & 0x7FFF, f >> 30].map(i64::from);
        let others = [low(d), high(d), low(e), high(e), high(g), low(h), high(h)];
        (others, rotation)
    };
    let ((got, got_turn), (want, want_turn)) = (fields(got), fields(want));
    let near = |a: &[i64], b: &[i64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 2);
    // Where two of the rotation's numbers are equally great, either may be left out.
    let same_form = got_turn[3] == want_turn[3];
    let edge = |turn: [i64; 4]| turn[..3].iter().any(|step| !(4..32_763).contains(step));
    near(&got, &want)
        && (near(&got_turn, &want_turn) || (!same_form && edge(got_turn) && edge(want_turn)))
}

#[test]
fn any_range_and_any_choice_of_gaussians_is_packed_as_in_the_whole() {
    let count = 9_001;
    let (from, to) = (likely_state(count, 4), likely_state(count, 5));
    let mut random = Random::new(6);
    for level in levels() {
        let blend = Blend::new(&from, &to, 0.37)
            .expect("one length")
            .at_level(level);
        let whole = pack(&blend, count);
        for _ in 0..20 {
            let mut ends = [random.below(count + 1), random.below(count + 1)];
            ends.sort_unstable();
            let range = ends[0]..ends[1];
            let mut out = vec![PackedGaussian::zeroed(); range.len()];
            blend.pack(range.clone(), &mut out).expect("the range fits");
            assert!(out == whole[range.clone()], "{range:?}");
        }
        for share in [0.02, 0.5, 0.9, 1.0] {
            let kept: Vec<u32> = (0..9_001).filter(|_| random.unit() <= share).collect();
            let mut out = vec![PackedGaussian::zeroed(); kept.len()];
            let none = vec![0.0; kept.len()];
            let detail = Detail::new(9_001, kept.clone(), &none).expect("the choice fits");
            blend.pack_kept(&detail, &mut out).expect("the choice fits");
            for (index, got) in kept.iter().zip(&out) {
                assert_eq!(*got, whole[*index as usize], "Gaussian {index}");
            }
            let growth: Vec<f32> = kept.iter().map(|_| random.unit()).collect();
            let detail = Detail::new(9_001, kept.clone(), &growth).expect("the choice fits");
            blend.pack_kept(&detail, &mut out).expect("the choice fits");
            for ((index, got), growth) in kept.iter().zip(&out).zip(growth) {
                let (got, plain) = (got.unpacked(), whole[*index as usize].unpacked());
                assert_eq!(got.position, plain.position, "place of {index}");
                for (got, plain) in got.scale.iter().zip(plain.scale) {
                    let grown = (got / plain).log2();
                    assert!((grown - growth).abs() < 1e-3, "{index} grew by {grown}");
                }
            }
        }
    }
    let blend = Blend::new(&from, &to, 0.37).expect("one length");
    let mut out = [PackedGaussian::zeroed(); 2];
    assert!(
        Detail::new(9_001, vec![5, 5], &[0.0; 2]).is_err(),
        "twice the same"
    );
    assert!(
        Detail::new(9_001, vec![5, 9_001], &[0.0; 2]).is_err(),
        "past the end"
    );
    let other = Detail::new(9_000, vec![5, 6], &[0.0; 2]).expect("two of them");
    assert!(blend.pack_kept(&other, &mut out).is_err(), "of others");
    assert!(blend.pack(3..6, &mut out).is_err(), "three into two");
    assert!(
        Blend::new(&from, &GaussianState::new(3), 0.5).is_err(),
        "two lengths"
    );
}

#[test]
fn a_gaussian_with_nan_in_either_state_is_never_drawn() {
    let count = 64;
    let good = likely_state(count, 7);
    for p in 0..STATE_PLANES {
        for odd in [f32::NAN, f32::INFINITY] {
            let mut bad = good.clone();
            bad.plane_mut(p)[9] = odd;
            for level in levels() {
                for (from, to) in [(&bad, &good), (&good, &bad)] {
                    let blend = Blend::new(from, to, 0.5)
                        .expect("one length")
                        .at_level(level);
                    let packed = pack(&blend, count);
                    assert_eq!(packed[9], PackedGaussian::zeroed(), "{odd} in plane {p}");
                    assert_ne!(packed[8], PackedGaussian::zeroed(), "its neighbour");
                }
            }
        }
    }
}

#[test]
fn gaussians_are_no_larger_than_a_persons_between_two_states_and_beyond() {
    assert_eq!(LOG2_MOST_SCALE.exp2(), spmm3::MOST_SCALE, "one bound");
    let count = 64;
    let from = likely_state(count, 8);
    let mut to = from.clone();
    // 4 m on the way to it, 90 m beyond.
    to.plane_mut(plane::LOG2_SCALE.start)[9] = 3.0;
    let detail = Detail::new(count, (0..64).collect(), &[0.5; 64]).expect("all of them");
    for level in levels() {
        for (share, grows) in [(0.9, false), (1.35, false), (0.9, true)] {
            let blend = Blend::new(&from, &to, share)
                .expect("one length")
                .at_level(level);
            let mut packed = pack(&blend, count);
            if grows {
                blend.pack_kept(&detail, &mut packed).expect("as many");
            }
            let got = packed[9].unpacked().scale[0];
            assert!((got - spmm3::MOST_SCALE).abs() < 1e-3, "{got} m at {share}");
            let small = packed[8].unpacked().scale[0];
            assert!(small < 0.2, "its neighbour: {small} m");
        }
    }
}
