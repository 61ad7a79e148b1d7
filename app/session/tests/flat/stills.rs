//! A display that waits.

use crate::stage::{BLACK, avatar, camera, expected, needs, pose, psnr, run};
use app_pipeline::stage::Stage;
use app_pipeline::timeline::LatencyMode;
use app_session::display::{Still, StillsDisplay};
use app_session::participant::Participant;
use glam::Affine3A;
use test_support::{onnx, vulkan};

#[test]
fn every_still_shows_its_own_pose_exactly_whatever_came_before() {
    let (Some(gpu), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    let views: Vec<(f32, f32)> = (0..12)
        .map(|k| (0.9 * (k as f32).sin(), 0.2 * k as f32))
        .collect();
    let stills = views.iter().map(|(swing, aside)| Still {
        motion: pose(*swing),
        cameras: vec![camera(*aside)],
    });
    let mut pictures = Vec::new();
    let mut display = StillsDisplay::new(needs(&gpu), stills, |number, still| {
        assert_eq!(number, pictures.len(), "in order");
        pictures.push(still.renderer.read_back(0).expect("a picture").over(BLACK));
        Ok(true)
    });
    let person = Participant {
        avatar: avatar(),
        sits: false,
        origin: display.origin(),
    };
    let report = run(&runtime, LatencyMode::Newest, vec![person], &mut display);
    drop(display);
    assert_eq!(pictures.len(), views.len(), "a picture each");
    for (picture, (swing, aside)) in pictures.iter().zip(&views) {
        let people = [(pose(*swing), Affine3A::IDENTITY)];
        let own = psnr(
            picture,
            &expected((&gpu, &runtime), &people, camera(*aside)),
        );
        assert!(own > 45.0, "{own:.1} dB like its pose {swing}");
        let people = [(pose(swing + 0.1), Affine3A::IDENTITY)];
        let other = psnr(
            picture,
            &expected((&gpu, &runtime), &people, camera(*aside)),
        );
        assert!(
            other < own - 6.0,
            "{other:.1} dB like another, {own:.1} like its own"
        );
    }
    let collector = &report.people[0].collector;
    for stage in [Stage::Kinematics, Stage::Inference, Stage::Raster] {
        let times = collector.spans().filter(|span| span.stage == stage).count();
        assert_eq!(times, views.len(), "{stage:?} is timed once for each");
    }
}
