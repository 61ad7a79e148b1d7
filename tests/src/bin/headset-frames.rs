//! A headset program that does as little as one can: draws a figure that stands still, and says what became of it. Tests run it
//! against a real runtime, whose environment a process has for itself.
//!
//! `headset-frames FRAMES FOLDER [FRAME..]`: the frames after which both eyes' pictures are written to FOLDER, with the cameras
//! they were drawn from. Prints a line of JSON when it has ended.

use glam::{Affine3A, Vec3};
use mon3tr_tests::splat_scenes::standing_figure;
use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use xr_renderer::xr::{
    Eyes, Frame, Headset, HeadsetOptions, Over, Runtime, Session, SessionOptions, Surround, XrError,
};
use xr_renderer::{Camera, PackedGaussian, RendererOptions, SplatRenderer};

fn main() -> Result<(), Box<dyn Error>> {
    env_logger::init();
    let mut arguments = std::env::args().skip(1);
    let frames: u64 = arguments.next().ok_or("how many frames?")?.parse()?;
    let folder = arguments.next().ok_or("where to?")?;
    let reads: Vec<u64> = arguments
        .map(|frame| frame.parse())
        .collect::<Result<_, _>>()?;
    let runtime = Runtime::load()?;
    let headset = Headset::open(
        &runtime,
        HeadsetOptions {
            eye_size: Some([640, 480]),
            validation: std::env::var_os("VK_LAYER_PATH").is_some(),
        },
    )?;
    let mut session = Session::new(
        &headset,
        SessionOptions {
            room: false,
            read_back: !reads.is_empty(),
        },
    )?;
    let [width, height] = headset.info().eye_size;
    let gaussians: Vec<PackedGaussian> = standing_figure(20_000)
        .iter()
        .map(PackedGaussian::from)
        .collect();
    let options = RendererOptions {
        depth: session.takes_depth(),
        ..RendererOptions::new(u32::try_from(gaussians.len())?, width, height, 2)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(headset.gpu()), &options)?;
    renderer.set_foreground(&gaussians)?;

    let mut shown = 0;
    let mut unseen = 0;
    let mut predictions = Vec::new();
    let mut written = Vec::new();
    let deadline = Instant::now() + Duration::from_secs(240);
    loop {
        if Instant::now() > deadline {
            return Err("the runtime keeps us waiting".into());
        }
        match session.poll()?.over {
            Some(Over::Left) => break,
            Some(Over::Lost) => return Err("the runtime lost the session".into()),
            None => {}
        }
        if !session.life().is_running() {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        }
        let frame = session.wait()?;
        let eyes = session.look(&frame)?;
        let (true, Some(eyes)) = (frame.should_render && shown < frames, eyes) else {
            session.skip(frame)?;
            unseen += 1;
            continue;
        };
        renderer.draw(&eyes.cameras)?;
        let is_read = reads.contains(&shown);
        let pictures = show(&mut session, frame, &eyes, &renderer, is_read)?;
        predictions.push(frame.predicted);
        for (eye, picture) in ["left", "right"].iter().zip(pictures.iter().flatten()) {
            let file = Path::new(&folder).join(format!("{shown}-{eye}.png"));
            image::save_buffer(
                &file,
                &picture.rgba,
                picture.width,
                picture.height,
                image::ColorType::Rgba8,
            )?;
        }
        if is_read {
            written.push(json!({
                "frame": shown,
                "eyes": eyes.cameras.map(|camera| told(&camera)),
            }));
        }
        shown += 1;
        if shown == frames {
            session.request_exit()?;
        }
    }
    let rises = predictions.windows(2).all(|pair| pair[1] > pair[0]);
    let passed: Vec<String> = session
        .life()
        .passed()
        .iter()
        .map(ToString::to_string)
        .collect();
    println!(
        "{}",
        json!({
            "runtime": headset.info().runtime,
            "headset": headset.info().name,
            "device": headset.gpu().info().name,
            "size": [width, height],
            "floor": session.floor().to_string(),
            "granted": headset.extensions().granted(),
            "missing": headset.extensions().missing(),
            "states": passed,
            "shown": shown,
            "unseen": unseen,
            "predictions_rise": rises,
            "has_depth": session.takes_depth(),
            "written": written,
            "validation_messages": headset.gpu().validation_messages(),
        })
    );
    Ok(())
}

fn show(
    session: &mut Session,
    frame: Frame,
    eyes: &Eyes,
    renderer: &SplatRenderer,
    reads: bool,
) -> Result<Option<[xr_renderer::xr::EyePicture; 2]>, XrError> {
    session.show(frame, eyes, renderer, Surround::Room, reads)
}

/// A camera as numbers.
fn told(camera: &Camera) -> Value {
    let Affine3A {
        matrix3,
        translation,
    } = camera.camera_from_world;
    json!({
        "rotation": matrix3.to_cols_array(),
        "translation": Vec3::from(translation).to_array(),
        "focal": [camera.fx, camera.fy],
        "centre": [camera.cx, camera.cy],
    })
}
