//! Sizes, errors and times of the codecs on real motion:
//! `cargo run -p link-codec --example codec_sizes -- PACKAGE.m3a FILE..` prints them for each file and for the
//! built-in performance. Feedback arrives 40 ms late and reports every third frame.

use link_codec::{Codec, Decoder, Encoder, Micros, MotionFrame};
use spmm3::{Avatar, Joint, LoadOptions, MotionClip, MotionParams, Playback, Skeleton};
use std::{collections::VecDeque, error::Error, path::Path, time::Instant};

/// Bytes that an IPv4 packet has besides the message.
const HEADERS: usize = 85;
const SESSION: u32 = 0x5eed_cafe;

#[derive(Default)]
struct Figures {
    bytes: Vec<usize>,
    /// Largest and summed errors: degrees, millimetres of the root, expression, millimetres of head, hands and feet.
    worst: [f32; 4],
    sums: [f64; 4],
    encode_us: f64,
    decode_us: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let package = arguments
        .next()
        .ok_or("say which avatar package: codec_sizes PACKAGE.m3a FILE..")?;
    let avatar = Avatar::load(Path::new(&package))?;
    let mut clips = vec![MotionClip::built_in(
        &avatar.skeleton,
        &avatar.expressions,
        30.0,
        120.0,
    )?];
    for file in arguments {
        clips.push(MotionClip::load(
            Path::new(&file),
            &avatar.skeleton,
            &LoadOptions::default(),
        )?);
    }
    println!(
        "{:22} {:8} {:>3} {:>6} {:>4} {:>4} {:>7}  degrees max/mean  root mm     coefficient   extremity mm   enc us dec us",
        "motion", "codec", "Hz", "mean B", "p95", "max", "kbit/s"
    );
    for clip in &clips {
        print_arrangement(clip);
        for (codec, rate) in [
            (Codec::Paper, 30),
            (Codec::Compact, 30),
            (Codec::Compact, 60),
        ] {
            let mut f = measure(clip, &avatar.skeleton, codec, rate);
            f.bytes.sort_unstable();
            let frames = f.bytes.len();
            let mean = f.bytes.iter().sum::<usize>() as f64 / frames as f64;
            let error = |i: usize| format!("{:6.4}/{:6.4}", f.worst[i], f.sums[i] / frames as f64);
            println!(
                "{:22} {:8} {:3} {:6.1} {:4} {:4} {:7.2}  {}  {}  {}  {}  {:5.1} {:5.1}",
                clip.name,
                codec.to_string(),
                rate,
                mean,
                f.bytes[frames * 95 / 100],
                f.bytes[frames - 1],
                (mean + HEADERS as f64) * 8.0 * f64::from(rate) / 1000.0,
                error(0),
                error(1),
                error(2),
                error(3),
                f.encode_us / frames as f64,
                f.decode_us / frames as f64,
            );
        }
    }
    Ok(())
}

/// The size of a `paper` body under LZ4 in other arrangements.
fn print_arrangement(clip: &MotionClip) {
    let mut sums = [0; 4];
    for motion in &clip.frames {
        let body = |resolution: f32| -> Vec<u8> {
            let round =
                |value: &f32| half::f16::from_f32((value * resolution).round() / resolution);
            let values = motion
                .values()
                .iter()
                .flat_map(|value| round(value).to_le_bytes());
            let root = motion.root_translation.to_array().map(f32::to_le_bytes);
            values.chain(root.into_iter().flatten()).collect()
        };
        let planes = |body: Vec<u8>| -> Vec<u8> {
            let (values, root) = body.split_at(body.len() - 12);
            let plane = |at: usize| values.iter().skip(at).step_by(2);
            plane(1).chain(plane(0)).chain(root).copied().collect()
        };
        let (exact, rounded) = (body(65536.0), body(1024.0));
        let bodies = [
            exact.clone(),
            planes(exact),
            rounded.clone(),
            planes(rounded),
        ];
        for (sum, body) in sums.iter_mut().zip(bodies) {
            *sum += lz4_flex::block::compress(&body).len();
        }
    }
    let [plain, planes, rounded, both] = sums.map(|sum| sum as f64 / clip.frames.len() as f64);
    println!(
        "{:22} 442 B of FP16 with LZ4: {plain:.1}, in byte planes {planes:.1}, rounded {rounded:.1}, both {both:.1}",
        clip.name
    );
}

fn measure(clip: &MotionClip, skeleton: &Skeleton, codec: Codec, rate: u32) -> Figures {
    let (mut encoder, mut decoder) = (Encoder::new(codec, SESSION), Decoder::new(SESSION));
    let mut figures = Figures::default();
    let mut message = Vec::new();
    let mut under_way = VecDeque::new();
    let period = 1.0 / f64::from(rate);
    let mut sequence = 0;
    // Timers wake up a little late.
    let mut lateness = fastrand::Rng::with_seed(1);
    loop {
        let time = f64::from(sequence) * period;
        if time > clip.duration() {
            return figures;
        }
        sequence += 1;
        while under_way.front().is_some_and(|(due, _, _)| *due <= time) {
            if let Some((_, newest, received)) = under_way.pop_front() {
                encoder.acknowledge(newest, received);
            }
        }
        let micros = std::time::Duration::from_secs_f64(10.0 + time).as_micros();
        let captured = Micros(u64::try_from(micros).unwrap_or(u64::MAX) + lateness.u64(0..100));
        let motion = clip.sample(time, Playback::Clamp);
        let frame = MotionFrame {
            sequence,
            captured,
            motion,
        };
        let start = Instant::now();
        encoder.encode(&frame, &mut message);
        let encoded = Instant::now();
        let shown = decoder.decode(&message);
        figures.decode_us += encoded.elapsed().as_secs_f64() * 1e6;
        figures.encode_us += (encoded - start).as_secs_f64() * 1e6;
        let shown = shown.expect("an undisturbed stream decodes");
        figures.bytes.push(message.len());
        let errors = errors(&frame.motion, &shown.motion, skeleton);
        for ((worst, sum), error) in figures.worst.iter_mut().zip(&mut figures.sums).zip(errors) {
            *worst = worst.max(error);
            *sum += f64::from(error);
        }
        if sequence % 3 == 0 {
            let (newest, received) = decoder.feedback();
            under_way.push_back((time + 0.04, newest, received));
        }
    }
}

/// The worst of a frame: see [`Figures::worst`].
fn errors(truth: &MotionParams, shown: &MotionParams, skeleton: &Skeleton) -> [f32; 4] {
    let most = |errors: &mut dyn Iterator<Item = f32>| errors.fold(0.0, f32::max);
    let [a, b] = [truth, shown].map(|motion| skeleton.pose(motion));
    [
        most(&mut Joint::ALL.into_iter().map(|joint| {
            let between = truth.rotation(joint).conjugate() * shown.rotation(joint);
            (2.0 * between.xyz().length().min(1.0).asin()).to_degrees()
        })),
        1000.0 * truth.root_translation.distance(shown.root_translation),
        most(
            &mut truth
                .expression()
                .iter()
                .zip(shown.expression())
                .map(|(a, b)| (a - b).abs()),
        ),
        most(
            &mut [
                Joint::Head,
                Joint::LeftMiddle1,
                Joint::RightMiddle1,
                Joint::LeftFoot,
                Joint::RightFoot,
            ]
            .into_iter()
            .map(|joint| 1000.0 * a.position(joint).distance(b.position(joint))),
        ),
    ]
}
