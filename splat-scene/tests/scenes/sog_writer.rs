//! A writer of SOG scenes for the tests, of both versions: written from the format's description, apart from the reader.

use std::io::{Cursor, Write as _};

use image_webp::{ColorType, WebPEncoder};
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::expected::Raw;

/// Name and content of each file.
pub(crate) type Members = Vec<(String, Vec<u8>)>;

fn clamped(value: f64, most: u16) -> u16 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let word = value.round().clamp(0.0, f64::from(most)) as u16;
    word
}

fn byte(value: f64) -> u8 {
    clamped(value, 255).to_le_bytes()[0]
}

/// A picture of four bytes a pixel, in the format that scenes have.
pub(crate) fn webp(pixels: &[[u8; 4]], width: usize) -> Vec<u8> {
    let height = pixels.len().div_ceil(width).max(1);
    let mut bytes = pixels.as_flattened().to_vec();
    bytes.resize(4 * width * height, 0);
    let mut file = Vec::new();
    let [width, height] = [width, height].map(|side| u32::try_from(side).unwrap());
    WebPEncoder::new(&mut file)
        .encode(&bytes, width, height, ColorType::Rgba8)
        .unwrap();
    file
}

/// Least and greatest of many values.
fn range(values: impl Iterator<Item = f32>) -> [f32; 2] {
    values.fold([f32::MAX, f32::MIN], |[least, most], value| {
        [least.min(value), most.max(value)]
    })
}

fn share(value: f32, [low, high]: [f32; 2]) -> f64 {
    let span = f64::from(high) - f64::from(low);
    if span > 0.0 {
        (f64::from(value) - f64::from(low)) / span
    } else {
        0.0
    }
}

/// 256 values evenly over a range.
fn codebook([low, high]: [f32; 2]) -> Vec<f64> {
    let (low, high) = (f64::from(low), f64::from(high));
    (0..256)
        .map(|index| low + (high - low) * f64::from(index) / 255.0)
        .collect()
}

fn logarithmic(value: f32) -> f32 {
    value.abs().ln_1p().copysign(value)
}

fn logit(opacity: f32) -> f32 {
    (opacity / (1.0 - opacity)).ln()
}

fn quaternion([w, x, y, z]: [f32; 4]) -> [u8; 4] {
    let all = [w, x, y, z];
    let length = all.iter().map(|v| v * v).sum::<f32>().sqrt();
    let greatest = (0..4)
        .max_by(|&a: &usize, &b| all[a].abs().total_cmp(&all[b].abs()))
        .unwrap();
    let sign = all[greatest].signum();
    let mut rest = (0..4).filter(|&part| part != greatest).map(|part| {
        byte(255.0 * (0.5 + f64::from(sign * all[part] / length) * std::f64::consts::FRAC_1_SQRT_2))
    });
    let mut next = || rest.next().unwrap();
    [
        next(),
        next(),
        next(),
        252 + u8::try_from(greatest).unwrap(),
    ]
}

/// The files of a scene of at least one Gaussian.
pub(crate) fn members(raws: &[Raw], version: u32) -> Members {
    let width = raws.len().isqrt() + 3;
    let each = |of: &dyn Fn(&Raw) -> [u8; 4]| {
        let pixels: Vec<[u8; 4]> = raws.iter().map(of).collect();
        webp(&pixels, width)
    };
    let axes = [0, 1, 2];
    let positions = axes.map(|axis| range(raws.iter().map(|raw| logarithmic(raw.position[axis]))));
    let word = |raw: &Raw, axis: usize| {
        let share = share(logarithmic(raw.position[axis]), positions[axis]);
        clamped(65535.0 * share, u16::MAX).to_le_bytes()
    };
    let mean = |raw: &Raw, half: usize| {
        let [x, y, z] = axes.map(|axis| word(raw, axis)[half]);
        [x, y, z, 255]
    };
    // One range in version 2, one for each channel in version 1.
    let ranges = |of: &dyn Fn(&Raw) -> [f32; 3]| {
        let of_channels = axes.map(|axis| range(raws.iter().map(|raw| of(raw)[axis])));
        if version == 1 {
            of_channels
        } else {
            [range(of_channels.into_iter().flatten()); 3]
        }
    };
    let scales = ranges(&|raw| raw.log_scale);
    let colours = ranges(&|raw| raw.colour);
    let logits = range(raws.iter().map(|raw| logit(raw.opacity)));
    let bytes = |values: [f32; 3], ranges: [[f32; 2]; 3], fourth: u8| {
        let [x, y, z] = axes.map(|axis| byte(255.0 * share(values[axis], ranges[axis])));
        [x, y, z, fourth]
    };
    let opacity = |raw: &Raw| match version {
        1 => byte(255.0 * share(logit(raw.opacity), logits)),
        _ => byte(255.0 * f64::from(raw.opacity)),
    };
    let bounds = |ranges: &[[f32; 2]], files: &[&str]| {
        let ends = |end: usize| ranges.iter().map(|range| range[end]).collect::<Vec<_>>();
        json!({ "mins": ends(0), "maxs": ends(1), "files": files, "shape": [raws.len(), 3] })
    };
    let table = |ranges: &[[f32; 2]], files: &[&str]| match version {
        1 => bounds(ranges, files),
        _ => json!({ "codebook": codebook(ranges[0]), "files": files }),
    };
    let [red, green, blue] = colours;
    let mut meta = json!({
        "means": bounds(&positions, &["means_l.webp", "means_u.webp"]),
        "scales": table(&scales, &["scales.webp"]),
        "quats": { "files": ["quats.webp"] },
        "sh0": table(&[red, green, blue, logits], &["sh0.webp"]),
    });
    let mut members = vec![
        ("means_l.webp".to_owned(), each(&|raw| mean(raw, 0))),
        ("means_u.webp".to_owned(), each(&|raw| mean(raw, 1))),
        (
            "scales.webp".to_owned(),
            each(&|raw| bytes(raw.log_scale, scales, 255)),
        ),
        (
            "quats.webp".to_owned(),
            each(&|raw| quaternion(raw.rotation)),
        ),
        (
            "sh0.webp".to_owned(),
            each(&|raw| bytes(raw.colour, colours, opacity(raw))),
        ),
    ];
    let coefficients = raws[0].rest.len();
    if coefficients > 0 {
        let all = raws.iter().flat_map(|raw| raw.rest.as_flattened());
        let rest = range(all.copied());
        // Each Gaussian has an entry of its own, in the opposite order.
        let palette: Vec<[u8; 4]> = raws
            .iter()
            .rev()
            .flat_map(|raw| &raw.rest)
            .map(|&values| bytes(values, [rest; 3], 255))
            .collect();
        let labels: Vec<[u8; 4]> = (0..u16::try_from(raws.len()).unwrap())
            .rev()
            .map(|label| {
                let [low, high] = label.to_le_bytes();
                [low, high, 0, 255]
            })
            .collect();
        members.push((
            "shN_centroids.webp".to_owned(),
            webp(&palette, 64 * coefficients),
        ));
        members.push(("shN_labels.webp".to_owned(), webp(&labels, width)));
        let files = ["shN_centroids.webp", "shN_labels.webp"];
        let bands = match coefficients {
            3 => 1,
            8 => 2,
            _ => 3,
        };
        meta["shN"] = match version {
            1 => json!({ "mins": rest[0], "maxs": rest[1], "quantization": 8, "files": files }),
            _ => {
                json!({ "count": raws.len(), "bands": bands, "codebook": codebook(rest), "files": files })
            }
        };
    }
    if version != 1 {
        meta["version"] = json!(version);
        meta["count"] = json!(raws.len());
    }
    members.push(("meta.json".to_owned(), meta.to_string().into_bytes()));
    members
}

/// The members with their description changed.
pub(crate) fn with_meta(mut members: Members, change: impl FnOnce(&mut Value)) -> Members {
    let (_, meta) = members.last_mut().unwrap();
    let mut value = serde_json::from_slice(meta).unwrap();
    change(&mut value);
    *meta = value.to_string().into_bytes();
    members
}

/// The members with another content of one of them.
pub(crate) fn with_member(mut members: Members, name: &str, content: Vec<u8>) -> Members {
    let member = members.iter_mut().find(|(known, _)| known == name);
    member.expect("the scene has it").1 = content;
    members
}

pub(crate) fn bundle(members: &[(String, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, content) in members {
        zip.start_file(name.as_str(), options).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

pub(crate) fn sog(raws: &[Raw], version: u32) -> Vec<u8> {
    bundle(&members(raws, version), CompressionMethod::Stored)
}
