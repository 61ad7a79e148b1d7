//! Imports calibrated videos into a capture and prints how well the motion fits them: `import FOLDER OUT EVERY [PAGE.png]`, every EVERYth
//! picture of them.
//!
//! The skeleton is the tests' puppet's, so that nothing has to be baked; its lengths become the person's.

use capture::Capture;
use capture_completion::check::{MaskFacts, Shown, report};
use capture_completion::draw::{Drawing, Over, draw};
use capture_completion::{Networks, Pictures, Videos, complete};
use glam::DVec3;
use motion_fit::Subject;
use motion_fit::body::several::{Sight, fit};
use motion_fit::body::{LocatedBody, landmark_places};
use npu_runtime::Runtime;
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use synthetic_person::{Puppet, PuppetSize};

/// BlazePose's hips, knees, ankles, shoulders, elbows and wrists.
const LIMBS: [usize; 12] = [23, 24, 25, 26, 27, 28, 11, 12, 13, 14, 15, 16];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [folder, out, every, page @ ..] = arguments.as_slice() else {
        return Err("usage: import FOLDER OUT EVERY [PAGE.png]".into());
    };
    let avatar = Puppet::new(PuppetSize::SMALL).avatar();
    let every: usize = every.to_string_lossy().parse()?;
    let mut videos = Videos::calibrated(folder)?.every(every);
    for note in &videos.notes {
        println!("{note}");
    }
    let networks = Networks::new(None, Runtime::open(None)?)?;
    let start = Instant::now();
    let subject = Subject::from(&avatar);
    let done = complete(
        &mut videos,
        &subject,
        &networks,
        out,
        &capture::HeldOut::default(),
        &mut |_, _| {},
    )?;
    println!(
        "{} cameras, {} frames, {:.1} s",
        videos.cameras().len(),
        videos.frames(),
        start.elapsed().as_secs_f64()
    );
    for sight in [Sight::Agreed, Sight::Doubtful, Sight::Unseen] {
        println!("{sight:?} in {} frames", done.motion.frames_of(sight));
    }
    let capture = Capture::open(out)?;
    let mut shown: Vec<Vec<Shown>> = Vec::new();
    for (camera, seen) in done.observations.iter().enumerate() {
        let mut of = Vec::new();
        for (frame, seen) in seen.iter().enumerate() {
            let photograph = capture.photograph(camera, frame)?;
            of.push(Shown {
                landmarks: seen.body_landmarks().cloned(),
                mask: (photograph.mask.as_ref())
                    .map(|mask| MaskFacts::of(mask, photograph.size[0] as usize)),
            });
        }
        shown.push(of);
    }
    let poses = capture.poses().unwrap_or_default();
    let skeleton = &done.motion.skeleton;
    let report = report(capture.cameras(), &shown, poses, skeleton);
    for camera in &report.cameras {
        println!(
            "{}: a person in {} of {}, off by {:.1} px, {:.2} %, lag {}",
            camera.name,
            camera.seen,
            camera.frames,
            camera.error_px.unwrap_or(f64::NAN),
            camera.error_percent.unwrap_or(f64::NAN),
            camera.lag
        );
    }
    for finding in &report.findings {
        println!("{finding}");
    }
    // Against the same landmarks, triangulated frame by frame.
    let views: Vec<_> = capture
        .cameras()
        .iter()
        .map(capture_completion::view_of)
        .collect();
    let frames: Vec<Vec<_>> = (0..capture.frames())
        .map(|frame| shown.iter().map(|of| of[frame].landmarks.clone()).collect())
        .collect();
    let located: Vec<LocatedBody> = fit(
        &avatar.skeleton,
        &views,
        &frames,
        1.0 / capture.frame_rate(),
    )
    .located;
    let mut off: Vec<f32> = Vec::new();
    for (pose, located) in poses.iter().zip(&located) {
        let places = landmark_places(skeleton, &pose.on(skeleton));
        for landmark in LIMBS {
            if let (Some(place), Some(located)) = (places[landmark], located[landmark]) {
                let located = DVec3::from(<[f64; 3]>::from(located.place));
                off.push(place.distance(located.as_vec3()));
            }
        }
    }
    off.sort_by(f32::total_cmp);
    let mean = off.iter().sum::<f32>() / off.len().max(1) as f32;
    println!(
        "limbs against triangulated landmarks: mean {:.0} mm, median {:.0} mm of {}",
        1e3 * mean,
        1e3 * off.get(off.len() / 2).copied().unwrap_or(f32::NAN),
        off.len()
    );
    if let [page, ..] = page {
        let mut rows = Vec::new();
        for frame in [0, capture.frames() / 2, capture.frames() - 1] {
            let mut row = Vec::new();
            for (camera, lens) in capture.cameras().iter().enumerate() {
                let over = Over {
                    pose: poses.get(frame).map(|pose| (pose, skeleton)),
                    landmarks: shown[camera][frame].landmarks.as_ref(),
                };
                row.push(draw(&capture.photograph(camera, frame)?, lens, over, 640));
            }
            rows.push(row);
        }
        let drawing = Drawing::page(&rows);
        let [width, height] = drawing.size.map(|side| u32::try_from(side).unwrap_or(0));
        image::RgbImage::from_raw(width, height, drawing.rgb)
            .ok_or("an empty page")?
            .save(page)?;
    }
    Ok(())
}
