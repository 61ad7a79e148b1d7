//! The person's motion from what all cameras saw.
//!
//! The body is one solve over the 2-D landmarks of all cameras. Fingers, jaw, eyes and expression are those of the cameras that see hand and face best.

use capture::{Camera, FramePose};
use glam::{DAffine3, DMat3, DVec2, Quat, Vec2, Vec3};
use motion_fit::body::several::{self, RoomMotion, Sight};
use motion_fit::body::terms::View;
use motion_fit::landmarks::{self, BodyLandmarks, Observation};
use motion_fit::{Fitted, Subject, fit_recording};
use spmm3::{Joint, MotionParams, Skeleton};

/// A recording's motion in the cameras' world.
#[derive(Debug, Clone)]
pub struct Motion {
    /// One for each frame.
    pub poses: Vec<FramePose>,
    /// A skeleton as long as the person, as far as that is known: for drawing and comparing, not the avatar's.
    pub skeleton: Skeleton,
    /// By frame, then by camera: root mean square distance of the landmarks from the fitted pose, pixels; `None` where no body was seen.
    pub reprojection_px: Vec<Vec<Option<f64>>>,
    /// By frame, then by camera: whether the network had left and right exchanged.
    pub exchanged: Vec<Vec<bool>>,
    /// By frame: how its pose is known.
    pub sights: Vec<Sight>,
    /// Where a single camera stands, which the fit found.
    pub camera_from_world: Option<DAffine3>,
}

impl Motion {
    /// How many frames are known so.
    #[must_use]
    pub fn frames_of(&self, sight: Sight) -> usize {
        self.sights.iter().filter(|of| **of == sight).count()
    }
}

/// Fits the motion to `observations[camera][frame]`, pixels on the cameras' pinholes. `posed` says that the cameras' poses are known.
#[must_use]
pub fn fit_motion(
    subject: &Subject<'_>,
    cameras: &[Camera],
    observations: &[Vec<Observation>],
    frame_rate: f64,
    posed: bool,
) -> Motion {
    let singles: Vec<Vec<Fitted>> = (cameras.iter().zip(observations))
        .map(|(camera, seen)| fit_recording(subject, pinhole(camera), seen))
        .collect();
    if let ([camera], [single]) = (cameras, singles.as_slice()) {
        return alone(subject, camera, single, posed);
    }
    let views: Vec<View> = cameras.iter().map(view_of).collect();
    let frames = observations.iter().map(Vec::len).min().unwrap_or(0);
    let seen: Vec<Vec<Option<BodyLandmarks>>> = (0..frames)
        .map(|frame| {
            (cameras.iter().zip(observations))
                .map(|(camera, seen)| Some(on_view(camera, seen[frame].body_landmarks()?)))
                .collect()
        })
        .collect();
    let RoomMotion {
        poses, skeleton, ..
    } = several::fit(subject.skeleton, &views, &seen, 1.0 / frame_rate);
    let mut motion = Motion {
        poses: Vec::with_capacity(frames),
        skeleton,
        reprojection_px: Vec::with_capacity(frames),
        exchanged: Vec::with_capacity(frames),
        sights: poses.iter().map(|pose| pose.sight).collect(),
        camera_from_world: None,
    };
    for (frame, pose) in poses.into_iter().enumerate() {
        let seen: Vec<&Fitted> = singles.iter().filter_map(|s| s.get(frame)).collect();
        let mut parameters = details(&seen);
        pose.write(&mut parameters);
        motion.poses.push(FramePose {
            parameters,
            pelvis: pose.pelvis,
        });
        motion.reprojection_px.push(pose.reprojection_px);
        motion.exchanged.push(pose.exchanged);
    }
    motion
}

/// One camera's motion in a room in which the camera stands still: where its pose is not known, as the last frame has it.
fn alone(subject: &Subject<'_>, camera: &Camera, fitted: &[Fitted], posed: bool) -> Motion {
    let found = fitted.last().map(|last| {
        let pose = last.camera_from_room;
        DAffine3 {
            matrix3: pose.matrix3.as_dmat3(),
            translation: pose.translation.as_dvec3(),
        }
    });
    let still = if posed {
        camera.camera_from_world
    } else {
        found.unwrap_or(camera.camera_from_world)
    };
    let rest = subject.skeleton.rest_positions()[Joint::Pelvis.index()].as_dvec3();
    let poses = (fitted.iter())
        .map(|fitted| {
            let camera_from_room = DAffine3 {
                matrix3: fitted.camera_from_room.matrix3.as_dmat3(),
                translation: fitted.camera_from_room.translation.as_dvec3(),
            };
            let world_from_room = still.inverse() * camera_from_room;
            let pelvis = rest + fitted.motion.root_translation.as_dvec3();
            let mut parameters = fitted.motion.clone();
            parameters.root_translation = Vec3::ZERO;
            let turn = glam::DQuat::from_mat3(&orthonormal(&world_from_room.matrix3)).as_quat();
            let root = turn * parameters.rotation(Joint::Pelvis);
            parameters.set_rotation(Joint::Pelvis, root);
            FramePose {
                parameters,
                pelvis: world_from_room.transform_point3(pelvis).as_vec3(),
            }
        })
        .collect();
    let error = |fitted: &Fitted| {
        fitted
            .sees_person
            .then_some(f64::from(fitted.reprojection_px))
    };
    Motion {
        poses,
        skeleton: subject.skeleton.clone(),
        reprojection_px: fitted.iter().map(|fitted| vec![error(fitted)]).collect(),
        exchanged: fitted.iter().map(|fitted| vec![fitted.swapped]).collect(),
        sights: (fitted.iter())
            .map(|fitted| match fitted.sees_person {
                true => Sight::Doubtful,
                false => Sight::Unseen,
            })
            .collect(),
        camera_from_world: (!posed).then_some(still),
    }
}

/// Fingers, jaw, eyes and expression of one frame: a mean over the cameras in which the surest counts by far the most, so that nothing jumps where
/// another one becomes the surest.
fn details(seen: &[&Fitted]) -> MotionParams {
    let mut out = MotionParams::default();
    let weigh = |confidence: f32| confidence.clamp(0.0, 1.0).powi(6) + 1e-6;
    let mut mean = |joint: Joint, confidence: &dyn Fn(&Fitted) -> f32| {
        let mut sum = glam::Vec4::ZERO;
        for fitted in seen {
            let turn = glam::Vec4::from(fitted.motion.rotation(joint));
            let same = if sum.dot(turn) < 0.0 { -turn } else { turn };
            sum += same * weigh(confidence(fitted));
        }
        let turn = Quat::from_vec4(sum.normalize_or(glam::Vec4::W));
        out.set_rotation(joint, turn);
    };
    for joint in Joint::ALL {
        let name = joint.name();
        if joint.index() > Joint::RightEye.index() {
            let side = usize::from(name.starts_with("right"));
            mean(joint, &|fitted| fitted.hands[side]);
        } else if matches!(joint, Joint::Jaw | Joint::LeftEye | Joint::RightEye) {
            mean(joint, &|fitted| fitted.face);
        }
    }
    let whole: f32 = seen.iter().map(|fitted| weigh(fitted.face)).sum();
    for fitted in seen {
        let share = weigh(fitted.face) / whole.max(f32::MIN_POSITIVE);
        let from = fitted.motion.expression();
        for (to, from) in out.expression_mut().iter_mut().zip(from) {
            *to += share * from;
        }
    }
    out
}

/// A camera as the fit's view: one focal length, the horizontal one.
#[must_use]
pub fn view_of(camera: &Camera) -> View {
    several::view(
        camera.camera_from_world.matrix3,
        camera.camera_from_world.translation,
        camera.focal[0],
        DVec2::from(camera.centre),
    )
}

/// Landmarks of a pinhole whose pixels may be oblong, on its [`view_of`].
pub(crate) fn on_view(camera: &Camera, seen: &BodyLandmarks) -> BodyLandmarks {
    let mut out = seen.clone();
    for point in &mut out.points {
        let y = (f64::from(point.pixel.y) - camera.centre[1]) / camera.focal[1];
        point.pixel.y = narrow(y * camera.focal[0] + camera.centre[1]);
    }
    out
}

fn pinhole(camera: &Camera) -> landmarks::Camera {
    landmarks::Camera {
        size: Vec2::new(camera.size[0] as f32, camera.size[1] as f32),
        focal: narrow(camera.focal[0]),
        centre: Vec2::new(narrow(camera.centre[0]), narrow(camera.centre[1])),
    }
}

/// Single precision's rotations multiplied are rotations nearly.
fn orthonormal(matrix: &DMat3) -> DMat3 {
    (0..3).fold(*matrix, |m, _| (m + m.inverse().transpose()) * 0.5)
}

#[expect(clippy::cast_possible_truncation, reason = "pixels are f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}
