//! A whole recording of several cameras: each frame solved by what they saw in it, and by the frames beside it.

use super::super::bindings::{self, Binding, COUNT};
use super::super::chain::{Attachment, BODY_JOINTS, Chain, Posture};
use super::super::lengths::Places;
use super::super::prior::PosePrior;
use super::super::reading::Exchange;
use super::super::solver::SkeletonSolver;
use super::super::terms::{Term, View};
use super::super::triangulate::{LocatedBody, pixel};
use super::begin;
use super::between::{ahead, all_filled, between, filled, stretches};
use super::pose::{RoomPose, Sight};
use crate::landmarks::blazepose::{HIPS, SHOULDERS};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks};
use glam::{Quat, Vec3};
use nalgebra::Matrix3;
use spmm3::{Joint, Skeleton};
use std::ops::Range;

/// Standard deviation of a landmark's pixel, metres at its depth, and its bounds in pixels.
const PIXEL: f64 = 0.02;
const PIXELS: (f64, f64) = (0.5, 40.0);
/// How far one camera's landmark may be off before it counts less, standard deviations.
const ROBUST: f64 = 2.0;
/// What a pose is like beforehand counts this much of what it does for one camera: several cameras see depth.
const PRIOR: f64 = 0.01;
/// How fast a joint's turn and the pelvis' move may change: standard deviations in a frame per second of its length, rad/s and m/s.
const TURN_CHANGE: f64 = 4.0;
const MOVE_CHANGE: f64 = 1.5;
/// Iterations of a frame that nothing leads to, of one that others lead to, and of each of the sweeps that smooth.
const FIRST: usize = 60;
const FURTHER: usize = 12;
const SWEEP: usize = 5;
/// Iterations of a frame that is posed for its lengths.
const ALONE: usize = 30;
/// Where the trunk is so far from where cameras agree that it is, or the pelvis from where the frames before lead, the recording is cut or the pose was lost, metres;
/// what is found anew is no further off than this.
const LOST: f64 = 0.3;
const FOUND: f64 = 0.1;
/// The same of a trunk that faces so far away from where the frames before lead, radians: nobody turns that far in a frame.
const TURNED: f64 = std::f64::consts::FRAC_PI_2;

/// What the cameras saw, and the skeleton that follows it.
pub(super) struct Recording<'a> {
    bindings: [Binding; COUNT],
    solver: SkeletonSolver,
    frames: &'a [Vec<Option<BodyLandmarks>>],
    labels: &'a [Vec<Exchange>],
    located: &'a [LocatedBody],
    sights: Vec<Sight>,
    step: f64,
}

/// The postures that cameras tell, and the frames at which one does not continue the one before.
#[derive(Debug)]
pub(super) struct Followed {
    known: Vec<Option<Posture>>,
    breaks: Vec<bool>,
}

impl<'a> Recording<'a> {
    /// `labels` and `located` of each frame, whose pixels are on `views`; frames are `step` seconds apart.
    pub(super) fn new(
        skeleton: &Skeleton,
        views: &[View],
        frames: &'a [Vec<Option<BodyLandmarks>>],
        labels: &'a [Vec<Exchange>],
        located: &'a [LocatedBody],
        step: f64,
    ) -> Self {
        let sights = (frames.iter().zip(located))
            .map(|(seen, located)| Sight::of(&seen[..seen.len().min(views.len())], located))
            .collect();
        Self {
            bindings: bindings::bind(skeleton),
            solver: solver(skeleton, views),
            frames,
            labels,
            located,
            sights,
            step,
        }
    }

    /// Goes on with another skeleton.
    pub(super) fn set_skeleton(&mut self, skeleton: &Skeleton) {
        self.bindings = bindings::bind(skeleton);
        self.solver = solver(skeleton, &self.solver.views);
    }

    /// The frames in which cameras agree.
    pub(super) fn agreed(&self) -> Vec<usize> {
        (self.sights.iter().enumerate())
            .filter_map(|(frame, sight)| (*sight == Sight::Agreed).then_some(frame))
            .collect()
    }

    /// The landmarks on the skeleton, posed by one frame alone.
    pub(super) fn places(&mut self, frame: usize) -> Places {
        let mut posture = begin::by_several(&self.solver, &self.bindings, &self.located[frame]);
        self.pixel_terms(frame, &posture);
        self.solver.solve(&mut posture, ALONE);
        let placed = self.solver.chain().place(&posture);
        let mut places = [None; BODY_LANDMARKS];
        for binding in &self.bindings {
            if let Some(place) = places.get_mut(binding.landmark) {
                *place = Some(placed.point(&binding.drawn));
            }
        }
        places
    }

    /// Each stretch of frames that the person is seen in, from a frame in which cameras agree to both of its ends; then those in which they never do.
    pub(super) fn follow(&mut self) -> Followed {
        let mut followed = Followed {
            known: vec![None; self.frames.len()],
            breaks: vec![false; self.frames.len()],
        };
        let seen: Vec<bool> = self.sights.iter().map(|s| *s != Sight::Unseen).collect();
        let stretches = stretches(&seen);
        let agreed = |frame: &usize| self.sights[*frame] == Sight::Agreed;
        let begins: Vec<Option<usize>> = (stretches.iter())
            .map(|stretch| stretch.clone().find(agreed))
            .collect();
        for (stretch, begun) in stretches.iter().zip(&begins) {
            let Some(begun) = *begun else { continue };
            let near = begin::by_several(&self.solver, &self.bindings, &self.located[begun]);
            followed.known[begun] = Some(self.begun(begun, near));
            self.walk(begun + 1..stretch.end, None, begun, &mut followed);
            // Backwards at the speed that came out.
            let after = followed.known.get(begun + 1).copied().flatten();
            self.walk((stretch.start..begun).rev(), after, begun, &mut followed);
        }
        // Of each doubtful stretch, the frame that is known after it.
        let mut after = None;
        let mut doubtful: Vec<(usize, Option<usize>)> = Vec::new();
        for (index, begun) in begins.iter().enumerate().rev() {
            if begun.is_some() {
                after = Some(stretches[index].start);
            } else {
                doubtful.push((index, after));
            }
        }
        // From the first to the last: the frame before each is known by then.
        for (index, after) in doubtful.into_iter().rev() {
            let before = index.checked_sub(1).map(|index| stretches[index].end - 1);
            self.follow_doubtful(&stretches[index], before, after, &mut followed);
        }
        followed
    }

    /// A stretch in which no two cameras agree: as near to where the person was in the known frame `before` it and will be in the one `after` it as what is seen
    /// allows; with no such frame, as one camera sees the trunk.
    fn follow_doubtful(
        &mut self,
        stretch: &Range<usize>,
        before: Option<usize>,
        after: Option<usize>,
        followed: &mut Followed,
    ) {
        let begun = stretch.start;
        let known = |frame: Option<usize>| Some((frame?, followed.known[frame?]?));
        let posture = if let Some(near) = filled(known(before), known(after), begun) {
            // Infinite where the recording ends first: one of the two is not.
            let away = |frame: Option<usize>| {
                frame.map_or(f64::INFINITY, |frame| frame.abs_diff(begun) as f64)
            };
            let mut posture = near;
            self.pixel_terms(begun, &near);
            self.near_terms(&near, away(before).min(away(after)));
            self.solver.solve(&mut posture, FIRST);
            posture
        } else {
            let near = self.surest(begun).unwrap_or_else(|| {
                begin::by_several(&self.solver, &self.bindings, &self.located[begun])
            });
            self.begun(begun, near)
        };
        followed.known[begun] = Some(posture);
        self.walk(begun + 1..stretch.end, None, begun, followed);
    }

    /// As the camera whose landmarks are the surest sees the trunk.
    fn surest(&self, frame: usize) -> Option<Posture> {
        let cameras = (self.frames[frame].iter())
            .zip(&self.labels[frame])
            .zip(&self.solver.views);
        let sure = |seen: &BodyLandmarks| -> f64 {
            let points = 0..BODY_LANDMARKS;
            points.map(|k| pixel(Some(seen), k, Exchange::NONE).1).sum()
        };
        (cameras.filter_map(|((seen, exchange), view)| {
            let seen = seen.as_ref()?;
            let posture = begin::by_one(&self.solver, &self.bindings, view, seen, *exchange)?;
            Some((sure(seen), posture))
        }))
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, posture)| posture)
    }

    /// A frame by what is seen in it alone.
    fn begun(&mut self, frame: usize, near: Posture) -> Posture {
        let mut posture = near;
        self.pixel_terms(frame, &near);
        self.solver.solve(&mut posture, FIRST);
        posture
    }

    /// Frame after frame from the known frame `begun`, `before` which there was this posture, each near to where the ones before lead.
    fn walk(
        &mut self,
        frames: impl Iterator<Item = usize>,
        mut before: Option<Posture>,
        begun: usize,
        followed: &mut Followed,
    ) {
        let Some(mut last) = followed.known[begun] else {
            return;
        };
        for frame in frames {
            let predicted = before.map_or(last, |before| ahead(&before, &last));
            before = Some(last);
            last = predicted;
            if self.sights[frame] == Sight::Unseen {
                continue;
            }
            self.pixel_terms(frame, &last);
            self.near_terms(&predicted, 1.0);
            self.solver.solve(&mut last, FURTHER);
            if let Some(anew) = self.found_anew(frame, &predicted, &last) {
                last = anew;
                before = None;
                followed.breaks[frame] = true;
            }
            followed.known[frame] = Some(last);
        }
    }

    /// The pose by one frame alone where `posture` is not where cameras agree that the person is, or not where it was `predicted`, as after a cut of the
    /// recording.
    fn found_anew(
        &mut self,
        frame: usize,
        predicted: &Posture,
        posture: &Posture,
    ) -> Option<Posture> {
        let off = self.off(frame, posture)?;
        let jumped = (posture.position - predicted.position).norm() > LOST;
        let turned = begin::turn_of_trunk(&self.located[frame])
            .is_some_and(|turn| turn.angle_to(&predicted.rotations[0]) > TURNED);
        if self.sights[frame] != Sight::Agreed || off < LOST && !jumped && !turned {
            return None;
        }
        let near = begin::by_several(&self.solver, &self.bindings, &self.located[frame]);
        let anew = self.begun(frame, near);
        (self.off(frame, &anew)? < FOUND.max(off / 2.0)).then_some(anew)
    }

    /// Mean distance of the trunk's landmarks from where cameras agree that they are, metres; `None` where none is located.
    fn off(&self, frame: usize, posture: &Posture) -> Option<f64> {
        let placed = self.solver.chain().place(posture);
        let trunk = |binding: &&Binding| {
            HIPS.contains(&binding.landmark) || SHOULDERS.contains(&binding.landmark)
        };
        let (mut sum, mut count) = (0.0, 0.0);
        for binding in self.bindings.iter().filter(trunk) {
            if let Some(located) = &self.located[frame][binding.landmark] {
                sum += (placed.point(&binding.drawn) - located.place).norm();
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum / count)
    }

    /// Each frame that is seen once more, near to the middle of its neighbours.
    pub(super) fn smooth(&mut self, followed: &mut Followed) {
        for frame in (1..self.frames.len().saturating_sub(1)).rev() {
            let Some(mut posture) = followed.known[frame] else {
                continue;
            };
            let Some(middle) = followed.middle(frame) else {
                continue;
            };
            self.pixel_terms(frame, &posture);
            // Half of the change from frame to frame.
            self.near_terms(&middle, 0.5);
            self.solver.solve(&mut posture, SWEEP);
            followed.known[frame] = Some(posture);
        }
    }

    /// A pose for every frame.
    pub(super) fn poses(&self, followed: &Followed) -> Vec<RoomPose> {
        let postures = all_filled(&followed.known).into_iter().enumerate();
        postures
            .map(|(frame, posture)| {
                let posture = posture.unwrap_or_else(|| self.solver.prior.posture());
                self.pose(frame, &posture)
            })
            .collect()
    }

    fn pose(&self, frame: usize, posture: &Posture) -> RoomPose {
        let placed = self.solver.chain().place(posture);
        let (frames, labels) = (&self.frames[frame], &self.labels[frame]);
        let reprojection_px = (self.solver.views.iter().zip(labels).enumerate())
            .map(|(camera, (view, exchange))| {
                let seen = frames.get(camera).and_then(Option::as_ref);
                let (mut sum, mut weights) = (0.0, 0.0);
                for binding in &self.bindings {
                    let (target, sure) = pixel(seen, binding.landmark, *exchange);
                    let off = view.project(&placed.point(&binding.drawn)) - target;
                    let weight = sure * binding.pixel;
                    sum += weight * off.norm_squared();
                    weights += weight;
                }
                (weights > 0.0).then(|| f64::sqrt(sum / weights))
            })
            .collect();
        RoomPose {
            pelvis: Vec3::from_array(posture.position.map(single).into()),
            rotations: posture.rotations.map(|q| {
                let [x, y, z, w] = [q.i, q.j, q.k, q.w].map(single);
                Quat::from_xyzw(x, y, z, w).normalize()
            }),
            sight: self.sights[frame],
            reprojection_px,
            exchanged: labels.iter().map(|e| *e != Exchange::NONE).collect(),
        }
    }

    /// The terms of what all cameras see in a frame, instead of those before.
    fn pixel_terms(&mut self, frame: usize, near: &Posture) {
        self.solver.terms.clear();
        let placed = self.solver.chain().place(near);
        let (frames, labels) = (&self.frames[frame], &self.labels[frame]);
        for (index, (seen, exchange)) in frames.iter().zip(labels).enumerate() {
            let Some(view) = self.solver.views.get(index).copied() else {
                continue;
            };
            for binding in &self.bindings {
                let (target, sure) = pixel(seen.as_ref(), binding.landmark, *exchange);
                if sure <= 0.0 {
                    continue;
                }
                let at = placed.point(&binding.drawn);
                let depth = (view.camera_from_world * at + view.translation).z;
                let deviation = (PIXEL * view.focal / depth.max(0.2)).clamp(PIXELS.0, PIXELS.1);
                self.solver.terms.push(Term::Pixel {
                    point: binding.drawn,
                    view: index,
                    target,
                    information: (sure * binding.pixel / deviation).powi(2),
                    robust: Some(ROBUST),
                });
            }
        }
    }

    /// Adds the terms that hold a frame near to `posture`, which is so many frames away.
    fn near_terms(&mut self, posture: &Posture, frames: f64) {
        let turn = (TURN_CHANGE * self.step * frames).powi(-2);
        let shift = (MOVE_CHANGE * self.step * frames).powi(-2);
        for joint in Joint::ALL.into_iter().take(BODY_JOINTS) {
            self.solver.terms.push(Term::Rotation {
                joint,
                target: posture.rotations[joint.index()],
                information: Matrix3::identity() * turn,
                robust: None,
            });
        }
        let pelvis = Attachment::centre(Joint::Pelvis);
        let shift = Matrix3::identity() * shift;
        self.solver
            .terms
            .push(Term::at(pelvis, posture.position, shift));
    }
}

impl Followed {
    /// Where the neighbours of a frame say that it is: those next to it, or behind a single frame that is not known. `None` at the ends and beside longer gaps and
    /// breaks, where one side is not known.
    fn middle(&self, frame: usize) -> Option<Posture> {
        let near = |frames: [Option<usize>; 2]| {
            (frames.into_iter().flatten())
                .find_map(|k| Some((k, self.known.get(k).copied().flatten()?)))
        };
        let (a, before) = near([frame.checked_sub(1), frame.checked_sub(2)])?;
        let (b, after) = near([Some(frame + 1), Some(frame + 2)])?;
        if self.breaks[a + 1..=b].contains(&true) {
            return None;
        }
        let share = (frame - a) as f64 / (b - a) as f64;
        Some(between(&before, &after, share))
    }
}

/// A solver of the skeleton's bones for several views.
fn solver(skeleton: &Skeleton, views: &[View]) -> SkeletonSolver {
    let mut solver = SkeletonSolver::new(Chain::new(skeleton), PosePrior::default());
    solver.views = views.to_vec();
    solver.prior_weight = PRIOR;
    solver
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "metres and quaternions of motion are f32"
)]
fn single(value: f64) -> f32 {
    value as f32
}
