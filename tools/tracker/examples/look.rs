//! Looks at pictures (PNG) as at those of a camera, 30 a second, and prints what is seen and the time of each stage; with `--out
//! FOLDER`, draws the landmarks into copies there. `--repeat N` shows each picture N times, `--every N` searches again in every N-th,
//! `--hands none|alternating|each` (each without it).
//!
//! `MON3TR_NETWORKS=FOLDER cargo run --release -p tracker --example look -- picture.png --repeat 20 --out /tmp/seen`

use image::{Rgb, RgbImage};
use motion_fit::landmarks::Observation;
use npu_runtime::Runtime;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use tracker::Tracker;
use tracker::mediapipe::{HandsBy, Options};
use tracker::networks::NetworkSet;
use tracker::source::Picture;

/// Collects what networks say of their times, by the rest of the line before the number.
struct Times(Mutex<BTreeMap<String, Vec<f64>>>);

static TIMES: Times = Times(Mutex::new(BTreeMap::new()));

impl log::Log for Times {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.target().starts_with("tracker::networks")
    }

    fn log(&self, record: &log::Record<'_>) {
        let text = record.args().to_string();
        let Some((name, parts)) = text
            .split_once(": ")
            .filter(|_| self.enabled(record.metadata()))
        else {
            return;
        };
        for part in parts.split(", ") {
            if let [what, ms, _] = part.split(' ').collect::<Vec<_>>()[..]
                && let (Ok(ms), Ok(mut times)) = (ms.parse(), self.0.lock())
            {
                times.entry(format!("{name} {what}")).or_default().push(ms);
            }
        }
    }

    fn flush(&self) {}
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut options = Options::default();
    let (mut files, mut out, mut repeat) = (Vec::new(), None, 1_usize);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--out" => out = Some(PathBuf::from(value()?)),
            "--repeat" => repeat = value()?.parse()?,
            "--every" => options.search_every = value()?.parse()?,
            "--hands" => {
                options.hands = match value()?.as_str() {
                    "none" => HandsBy::None,
                    "alternating" => HandsBy::Alternating,
                    "each" => HandsBy::Each,
                    other => {
                        return Err(
                            format!("--hands is none, alternating or each, not {other}").into()
                        );
                    }
                }
            }
            other if other.starts_with('-') => {
                return Err(format!("there is no option {other}; those that there are: --out, --repeat, --every, --hands").into());
            }
            _ => files.push(PathBuf::from(argument)),
        }
    }
    log::set_logger(&TIMES).map_err(|error| error.to_string())?;
    log::set_max_level(log::LevelFilter::Trace);
    let models = options.load(&NetworkSet::folder_of_environment()?, &Runtime::open(None)?)?;
    let mut tracker = Tracker::new(models)?;
    let mut times: [Vec<f32>; 5] = Default::default();
    let mut found = [0_usize; 4];
    let mut number = 0_u32;
    for file in &files {
        let pixels = image::open(file)?.to_rgb8();
        let mut last = None;
        for _ in 0..repeat {
            let picture = Arc::new(Picture {
                width: pixels.width(),
                height: pixels.height(),
                rgb: pixels.as_raw().clone(),
                seconds: f64::from(number) / 30.0,
                ..Picture::empty()
            });
            let seen = tracker.observe(&picture)?;
            let t = seen.times;
            for (list, ms) in times.iter_mut().zip([
                t.body_ms,
                t.hands_ms[0],
                t.hands_ms[1],
                t.face_ms,
                t.total_ms,
            ]) {
                list.push(ms);
            }
            let observation = seen.into_observation();
            let parts = [
                observation.body.is_some(),
                observation.hands[0].is_some(),
                observation.hands[1].is_some(),
                observation.face.is_some(),
            ];
            for (count, part) in found.iter_mut().zip(parts) {
                *count += usize::from(part);
            }
            number += 1;
            last = Some(observation);
        }
        if let (Some(folder), Some(observation)) = (&out, last) {
            std::fs::create_dir_all(folder)?;
            let mut drawn = pixels;
            draw(&mut drawn, &observation);
            drawn.save(folder.join(file.file_name().ok_or("a file has no name")?))?;
            let mut text = file.with_extension("txt");
            text = folder.join(text.file_name().ok_or("a file has no name")?);
            std::fs::write(text, list(&observation))?;
        }
    }
    println!(
        "{number} pictures; seen: body {}, left hand {}, right hand {}, face {}",
        found[0], found[1], found[2], found[3]
    );
    for (name, list) in ["body", "left hand", "right hand", "face", "all"]
        .iter()
        .zip(&mut times)
    {
        list.sort_by(f32::total_cmp);
        let at =
            |share: usize| list.get((list.len() * share / 100).min(list.len().saturating_sub(1)));
        if let (Some(least), Some(median), Some(most)) = (at(0), at(50), at(95)) {
            println!("{name:10} ms: least {least:6.2}  median {median:6.2}  95 % {most:6.2}");
        }
    }
    let times = TIMES.0.lock().map_err(|_| "a thread panicked")?;
    for (what, list) in times.iter() {
        let mut list = list.clone();
        list.sort_by(f64::total_cmp);
        if let (Some(least), Some(median)) = (list.first(), list.get(list.len() / 2)) {
            println!(
                "{what:42} ms: least {least:6.2}  median {median:6.2}  ({} runs)",
                list.len()
            );
        }
    }
    Ok(())
}

/// The landmarks as lines: part, number, x, y (and confidence of the body's).
fn list(seen: &Observation) -> String {
    let mut text = String::new();
    let mut line = |part: &str, index: usize, numbers: &[f32]| {
        text += &format!("{part} {index}");
        for number in numbers {
            text += &format!(" {number:.4}");
        }
        text.push('\n');
    };
    for (i, p) in seen
        .body_landmarks()
        .iter()
        .flat_map(|b| b.points.iter().enumerate())
    {
        line(
            "body",
            i,
            &[
                p.pixel.x,
                p.pixel.y,
                p.confidence,
                p.metres.x,
                p.metres.y,
                p.metres.z,
            ],
        );
    }
    for (name, hand) in ["left", "right"].iter().zip(seen.hand_landmarks()) {
        for (i, p) in hand.iter().flat_map(|h| h.pixels.iter().enumerate()) {
            line(name, i, &[p.x, p.y]);
        }
    }
    for (i, p) in seen
        .face_landmarks()
        .iter()
        .flat_map(|f| f.points.iter().enumerate())
    {
        line("face", i, &[p.x, p.y, p.z]);
    }
    text
}

fn draw(picture: &mut RgbImage, seen: &Observation) {
    let mut dot = |x: f32, y: f32, reach: i64, colour: [u8; 3]| {
        #[allow(clippy::cast_possible_truncation, reason = "casts saturate")]
        let (x, y) = (x as i64, y as i64);
        for (x, y) in
            (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (x + dx, y + dy)))
        {
            if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
                && let Some(pixel) = picture.get_pixel_mut_checked(x, y)
            {
                *pixel = Rgb(colour);
            }
        }
    };
    for p in seen.face_landmarks().iter().flat_map(|f| f.points.iter()) {
        dot(p.x, p.y, 0, [0, 255, 255]);
    }
    for p in seen.body_landmarks().iter().flat_map(|b| b.points.iter()) {
        let colour = if p.confidence > 0.5 {
            [0, 255, 0]
        } else {
            [255, 160, 0]
        };
        dot(p.pixel.x, p.pixel.y, 2, colour);
    }
    for (hand, colour) in seen.hand_landmarks().iter().zip([[255, 0, 0], [0, 0, 255]]) {
        for p in hand.iter().flat_map(|h| h.pixels.iter()) {
            dot(p.x, p.y, 1, colour);
        }
    }
}
