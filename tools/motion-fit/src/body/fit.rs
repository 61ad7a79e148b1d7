//! [`BodyFit`]: landmarks of one camera become the pose of the avatar's skeleton, picture by picture.

use super::{
    bindings,
    chain::{Chain, Posture, wide},
    evidence::{Body, Parts, Scene, stands},
    pose::{BodyPose, CameraPose, Limb},
    prior::PosePrior,
    proportions::Proportions,
    reading::{Exchange, Reading},
    so3,
    soles::soles,
    solver::SkeletonSolver,
    standing::Calibration,
    terms::View,
    track::Track,
    upright::Upright,
};
use crate::landmarks::blazepose::{ANKLES, KNEES, SHOULDERS};
use crate::landmarks::{BodyLandmarks, Camera};
use glam::{Mat3, Quat, Vec3};
use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
use spmm3::{Joint, Skeleton};

/// What a fit is told beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitConfig {
    /// The camera that sees the body.
    pub camera: Camera,
    /// Which parts of the fit are used: all, but for studies.
    pub parts: Parts,
}

impl FitConfig {
    /// All parts, for a camera of known lens.
    #[must_use]
    pub fn new(camera: Camera) -> Self {
        Self {
            camera,
            parts: Parts::default(),
        }
    }
}

/// Pictures after which one of two accounts is dropped.
const TRIAL: u32 = 10;
/// How much better the unlikely account must be.
const CLEARLY: f64 = 0.85;
/// Left and right exchanged for so long without a break: perhaps the account is the mistaken one, seconds.
const DOUBTFUL: f64 = 0.7;
const LONGEST_PATIENCE: f64 = 20.0;
/// A body gone for so long is met anew, seconds.
const GONE: f64 = 1.0;
/// A body gone for so long eases to rest, and how fast, seconds.
const LINGER: f64 = 0.4;
const EASE: f64 = 0.6;
/// A body stands upright while its shoulders are so high above its feet, as a share of the most of late, and how long that counts, seconds.
const UPRIGHT: f64 = 0.95;
const TALLEST_MEMORY: f64 = 60.0;
/// Steps of time that are believed, seconds.
const SHORTEST: f64 = 0.002;
const LONGEST: f64 = 0.25;

/// Follows one body in one camera's pictures.
#[derive(Debug, Clone)]
pub struct BodyFit {
    config: FitConfig,
    body: Body,
    solver: SkeletonSolver,
    /// The pelvis above the template's floor at rest, metres.
    pelvis: Vector3<f64>,
    upright: Upright,
    /// The account that is shown, and perhaps another that may be true.
    track: Option<Track>,
    rival: Option<Track>,
    /// The point of the floor, x and z, that is the avatar's origin.
    origin: Option<Vector2<f64>>,
    proportions: Proportions,
    /// The longest way from feet to shoulders of late, metres.
    tallest: f64,
    last_seconds: Option<f64>,
    unseen: f64,
    /// After a rival lost, the next may come later, seconds.
    patience: f64,
    confidence: [f64; 6],
}

impl BodyFit {
    /// A fit of `skeleton` that has seen nothing.
    #[must_use]
    pub fn new(skeleton: &Skeleton, config: FitConfig) -> Self {
        let at = |joint: Joint| wide(skeleton.rest_positions()[joint.index()]);
        let ease = spmm3::at_ease(skeleton);
        let bindings = bindings::bind(skeleton);
        let rest = std::array::from_fn(|joint| {
            let joint = Joint::ALL.get(joint);
            joint.map_or(UnitQuaternion::identity(), |joint| {
                so3::exp(&wide(ease.axis_angle(*joint)))
            })
        });
        let chain = Chain::new(skeleton);
        let proportions = Proportions::new(chain.clone(), &bindings);
        Self {
            config: FitConfig {
                camera: usable(config.camera),
                ..config
            },
            body: Body {
                bindings,
                soles: soles(skeleton),
                parts: config.parts,
                rest,
            },
            solver: SkeletonSolver::new(chain, PosePrior::default()),
            pelvis: at(Joint::Pelvis),
            upright: Upright::default(),
            track: None,
            rival: None,
            origin: None,
            proportions,
            tallest: 0.0,
            last_seconds: None,
            unseen: 0.0,
            patience: DOUBTFUL,
            confidence: [0.0; 6],
        }
    }

    /// The pictures are another camera's from now on, or of another size.
    pub fn set_camera(&mut self, camera: Camera) {
        self.config.camera = usable(camera);
    }

    /// Fits one picture, whose light fell at `seconds`. Never fails: without a body the pose coasts, comes to rest and waits.
    pub fn fit(&mut self, seconds: f64, body: Option<&BodyLandmarks>) -> BodyPose {
        let since = self.last_seconds.map_or(1.0 / 30.0, |last| seconds - last);
        let step = if since.is_finite() {
            // A pause of the pictures is time in which the person was not seen.
            self.unseen += (since - LONGEST).max(0.0);
            since.clamp(SHORTEST, LONGEST)
        } else {
            1.0 / 30.0
        };
        if seconds.is_finite() {
            self.last_seconds = Some(seconds);
        }
        let seconds = self.last_seconds.unwrap_or(0.0);
        let reading = body.and_then(|body| Reading::new(body, &self.config.camera));
        match &reading {
            Some(reading) => self.update(seconds, step, reading),
            None => self.coast(step),
        }
        self.fade_confidence(reading.as_ref(), step);
        self.body_pose(reading.as_ref())
    }

    /// Holds what a calibration found: tilt and height of the camera, and the person's proportions.
    pub fn hold(&mut self, calibration: &Calibration) {
        let before = self.upright.level();
        let Calibration {
            up,
            height_metres,
            lengths,
        } = calibration;
        self.upright.hold(up, *height_metres);
        self.proportions.hold(lengths);
        self.relevel(&before);
    }

    /// Turns the accounts and the origin from the level `before` into the present one.
    fn relevel(&mut self, before: &Matrix3<f64>) {
        let turn = self.upright.level() * before.transpose();
        for track in self.track.iter_mut().chain(&mut self.rival) {
            track.turn(&turn);
        }
        if let Some(origin) = &mut self.origin {
            let floor = -self.upright.height();
            let at = turn * Vector3::new(origin.x, floor, origin.y);
            *origin = Vector2::new(at.x, at.z);
        }
    }

    fn update(&mut self, seconds: f64, step: f64, reading: &Reading) {
        if self.unseen > GONE {
            self.track = None;
            self.rival = None;
        }
        self.unseen = 0.0;
        self.proportions.measure(step, reading);
        if self.config.parts.proportions {
            self.proportions.shape(self.solver.chain_mut());
        }
        if self.config.parts.upright {
            self.update_tilt(step, reading);
        }
        let level = self.upright.level();
        let levelled = reading.levelled(&level, self.proportions.scale());
        let scene = Scene {
            seconds,
            step,
            view: self.view(&level),
            floor: -self.upright.height(),
        };
        let first = self.track.is_none();
        let posture = self.solver.prior.posture();
        let mut track = self.track.take().unwrap_or_else(|| Track::new(posture));
        let given = first.then_some(Exchange::NONE);
        track.follow(&self.body, &mut self.solver, &scene, &levelled, given);
        if first && self.config.parts.labels {
            self.rival = Some(Track::new(posture));
        }
        if let Some(rival) = &mut self.rival {
            // One that begins later takes the labels as they are: the account that is shown exchanges all.
            let opposite = if first {
                Exchange::BOTH
            } else {
                Exchange::NONE
            };
            let given = (rival.costs.1 == 0).then_some(opposite);
            rival.follow(&self.body, &mut self.solver, &scene, &levelled, given);
        }
        if first && self.origin.is_none() {
            let back = level.transpose();
            let placed = self.solver.chain().place(&track.posture);
            let lowest = self.lowest(&track);
            for sole in self.body.soles.map(|sole| placed.point(&sole)) {
                if sole.y <= lowest {
                    self.upright.touch(&(back * sole), 0.1, 1.0);
                }
            }
        }
        self.choose_track(&mut track);
        self.update_floor(&track, step, &levelled);
        let at = track.posture.position;
        self.origin.get_or_insert(Vector2::new(at.x, at.z));
        self.track = Some(track);
    }

    /// Shows the better of two accounts, ends their trial, or begins one.
    fn choose_track(&mut self, track: &mut Track) {
        let Some(rival) = &mut self.rival else {
            if track.exchanged_seconds > self.patience {
                // It doubles while rivals lose: perhaps the network is wrong for long.
                self.patience = (self.patience * 2.0).min(LONGEST_PATIENCE);
                track.costs = (0.0, 0);
                self.rival = Some(Track::new(self.solver.prior.posture()));
            }
            return;
        };
        // Accounts that began together are told apart by their first picture; one that begins later fits it more freely.
        let together = track.age == rival.age;
        let trial = if together { 1 } else { TRIAL / 2 };
        if rival.costs.1 >= trial && rival.mean_cost() < CLEARLY * track.mean_cost() {
            std::mem::swap(track, rival);
            self.patience = DOUBTFUL;
        }
        if rival.costs.1 >= TRIAL {
            track.exchanged_seconds = 0.0;
            self.rival = None;
        }
    }

    fn coast(&mut self, step: f64) {
        self.unseen += step;
        let ease = if self.unseen > LINGER {
            1.0 - (-step / EASE).exp()
        } else {
            0.0
        };
        let Some(track) = &mut self.track else {
            return;
        };
        // Upright, but facing where the person faced.
        let forward = track.posture.rotations[0] * Vector3::z();
        let yaw = forward.x.atan2(forward.z);
        let mut rest = self.body.rest;
        rest[0] = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw);
        track.coast(step, &rest, ease);
        if ease > 0.0 {
            // Standing at rest puts the pelvis at its height.
            let stand = self.pelvis.y - self.upright.height();
            track.posture.position.y += (stand - track.posture.position.y) * ease;
        }
        self.rival = None;
    }

    /// Takes a standing body's axis into the estimate of the camera's tilt, and turns the accounts into the new level.
    fn update_tilt(&mut self, step: f64, reading: &Reading) {
        let before = self.upright.level();
        self.upright.forget(step);
        let axis = reading.middle(SHOULDERS) - reading.middle(ANKLES);
        self.tallest *= (-step / TALLEST_MEMORY).exp();
        if stands(reading) {
            self.tallest = self.tallest.max(axis.norm());
        }
        // One who squats or bends leans, too.
        if stands(reading) && axis.norm() > UPRIGHT * self.tallest {
            // The first look counts as long as it takes to be news.
            let seconds = if self.track.is_none() { 0.7 } else { step };
            self.upright.stance(&axis, seconds);
        }
        self.relevel(&before);
    }

    fn lowest(&self, track: &Track) -> f64 {
        let placed = self.solver.chain().place(&track.posture);
        self.body
            .soles
            .iter()
            .map(|sole| placed.point(sole).y)
            .fold(f64::INFINITY, f64::min)
    }

    /// Takes standing soles into the estimate of the floor.
    fn update_floor(&mut self, track: &Track, step: f64, reading: &Reading) {
        let placed = self.solver.chain().place(&track.posture);
        let back = self.upright.level().transpose();
        let floor = -self.upright.height();
        let lowest = self.lowest(track);
        // Legs that are not in the picture stand straight: slowly, the floor is where they reach.
        let legs_unseen = KNEES
            .into_iter()
            .chain(ANKLES)
            .all(|p| reading.points[p].confidence < 0.3);
        for (sole, contact) in self.body.soles.iter().zip(&track.contacts) {
            let at = placed.point(sole);
            let near = (at.y - floor).abs() < 0.2;
            if contact.stands() && near {
                self.upright.touch(&(back * at), step, 1.0);
            } else if at.y <= lowest && (near || at.y < floor) {
                // Some sole is mostly on the floor.
                self.upright.touch(&(back * at), step, 0.5);
            } else if at.y <= lowest && legs_unseen {
                self.upright.touch(&(back * at), step, 0.05);
            }
        }
    }

    /// By how much the avatar's pelvis must be higher than the person's for its soles to be as high, metres.
    fn leg_difference(&self, posture: &Posture) -> f64 {
        let lowest = |chain: &Chain| {
            let placed = chain.place(posture);
            let heights = self.body.soles.iter().map(|sole| placed.point(sole).y);
            heights.fold(f64::INFINITY, f64::min)
        };
        lowest(self.solver.chain()) - lowest(self.proportions.avatar())
    }

    fn fade_confidence(&mut self, reading: Option<&Reading>, step: f64) {
        let follow = 1.0 - (-step / 0.08_f64).exp();
        for (limb, confidence) in Limb::ALL.into_iter().zip(&mut self.confidence) {
            let now = reading.map_or(0.0, |reading| {
                let landmarks = limb.landmarks();
                landmarks
                    .iter()
                    .map(|p| reading.points[*p].confidence)
                    .sum::<f64>()
                    / landmarks.len() as f64
            });
            *confidence += (now - *confidence) * follow;
        }
    }

    fn view(&self, level: &Matrix3<f64>) -> View {
        let camera = &self.config.camera;
        let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        View {
            camera_from_world: flip * level.transpose(),
            translation: Vector3::zeros(),
            focal: f64::from(camera.focal),
            centre: Vector2::new(f64::from(camera.centre.x), f64::from(camera.centre.y)),
        }
    }

    fn body_pose(&self, reading: Option<&Reading>) -> BodyPose {
        let seen = reading.is_some();
        // A leg that is not in the picture stands.
        let unseen = |foot: usize| {
            reading.is_some_and(|r| {
                [KNEES[foot], ANKLES[foot]]
                    .iter()
                    .all(|p| r.points[*p].confidence < 0.3)
            })
        };
        let level = self.upright.level();
        let view = self.view(&level);
        let floor = -self.upright.height();
        let rest = Track::new(Posture {
            position: Vector3::new(0.0, self.pelvis.y + floor, 0.0),
            rotations: self.body.rest,
        });
        let track = self.track.as_ref().unwrap_or(&rest);
        let at = track.posture.position;
        let origin = self.origin.unwrap_or(Vector2::new(at.x, at.z));
        let origin = Vector3::new(origin.x - self.pelvis.x, floor, origin.y - self.pelvis.z);
        let mut root = at - origin - self.pelvis;
        root.y += self.leg_difference(&track.posture);
        let forward = view.camera_from_world.row(2).transpose();
        BodyPose {
            root_translation: narrow(&root),
            rotations: track.posture.rotations.map(|q| {
                let [x, y, z, w] = [q.i, q.j, q.k, q.w].map(single);
                Quat::from_xyzw(x, y, z, w).normalize()
            }),
            confidence: self.confidence.map(single),
            reprojection_px: single(track.reprojection),
            swapped: track.exchange != Exchange::NONE && seen,
            camera: CameraPose {
                pitch_radians: single((-forward.y).clamp(-1.0, 1.0).asin()),
                height_metres: single(self.upright.height()),
                camera_from_world: Mat3::from_cols(
                    narrow(&view.camera_from_world.column(0).into_owned()),
                    narrow(&view.camera_from_world.column(1).into_owned()),
                    narrow(&view.camera_from_world.column(2).into_owned()),
                ),
                position: narrow(&-origin),
            },
            standing: [0, 1].map(|foot| {
                let stands = |sole: usize| track.contacts[2 * foot + sole].stands();
                [0, 1].map(|sole| seen && (unseen(foot) || stands(sole)))
            }),
            seen,
        }
    }
}

/// The camera, or for a lens that cannot be, [`Camera::guessed`].
fn usable(camera: Camera) -> Camera {
    let good = |v: f32| v.is_finite() && v > 1.0 && v < 1e6;
    let size = if good(camera.size.x) && good(camera.size.y) {
        camera.size
    } else {
        glam::Vec2::new(640.0, 480.0)
    };
    Camera {
        size,
        focal: if good(camera.focal) {
            camera.focal
        } else {
            Camera::guessed(size).focal
        },
        centre: if camera.centre.is_finite() {
            camera.centre
        } else {
            size / 2.0
        },
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "metres, radians and quaternions of the avatar are f32"
)]
fn single(value: f64) -> f32 {
    value as f32
}

fn narrow(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(single(v.x), single(v.y), single(v.z))
}
