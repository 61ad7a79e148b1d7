//! What is shown.

use crate::stage::BLACK;
use crate::stage::{CPU, Stage, Swing};
use app_pipeline::plan::Plan;
use std::time::Duration;
use test_support::vulkan;

#[test]
fn every_plan_shows_the_same_person() {
    let Some(gpu) = vulkan::gpu() else { return };
    let mut pictures = Vec::new();
    for plan in Plan::ALL {
        // At rest, so that all show one moment.
        let Some(mut stage) = Stage::new(&gpu, plan, &[CPU], Swing::new(30.0, 1000, 0.0)) else {
            return;
        };
        stage.run(Duration::from_millis(400));
        let image = stage.lanes.renderer().read_back(0).expect("a picture");
        let bytes = image.over(BLACK);
        assert!(bytes.iter().any(|byte| *byte > 40), "{plan}: nobody there");
        pictures.push((plan, bytes));
    }
    let (_, first) = &pictures[0];
    for (plan, picture) in &pictures[1..] {
        let worst = first.iter().zip(picture).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(2), "{plan} differs by {worst:?} of 255");
    }
}

#[test]
fn motion_goes_on_evenly_between_its_frames() {
    on_plan(Plan::Cpu);
}

#[test]
fn motion_goes_on_evenly_between_its_frames_on_the_device_too() {
    on_plan(Plan::Gpu);
}

fn on_plan(plan: Plan) {
    let Some(gpu) = vulkan::gpu() else { return };
    // In no simple ratio to the display's 90 Hz, and slower than a busy machine draws: where each picture takes as long as a motion
    // frame, all of them show a state as it is.
    let swing = Swing::new(11.3, 1000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, plan, &[CPU], swing) else {
        return;
    };
    stage.draw(120);
    let pictures: Vec<_> = stage.lanes.collector().pictures().copied().collect();
    let settled = &pictures[pictures.len() / 2..];
    let moments: Vec<f64> = settled
        .iter()
        .map(|picture| {
            let [from, to] = [picture.from, picture.to].map(|state| state.captured.expect("known"));
            let start = settled[0].displayed;
            let of = |at: std::time::Instant| {
                at.saturating_duration_since(start).as_secs_f64()
                    - start.saturating_duration_since(at).as_secs_f64()
            };
            let alpha = f64::from(picture.alpha);
            of(from) * (1.0 - alpha) + of(to) * alpha
        })
        .collect();
    assert!(
        moments.windows(2).all(|pair| pair[1] >= pair[0]),
        "motion never goes back: {moments:?}"
    );
    let between = settled
        .iter()
        .filter(|picture| (0.05..0.95).contains(&picture.alpha))
        .count();
    assert!(
        between * 5 > settled.len(),
        "{between} of {} pictures lie between two states",
        settled.len()
    );
    for picture in settled {
        assert!(
            picture.displayed >= picture.drawn,
            "shown after it is drawn"
        );
        assert!(
            picture.to.ready <= picture.interpolation[0],
            "from what was ready"
        );
        assert!(
            picture.to.inference[0] <= picture.to.inference[1],
            "in order"
        );
    }
}
