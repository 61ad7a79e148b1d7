//! Writers of each format for the tests: written from the formats' descriptions, apart from the readers.

use std::fmt::Write as _;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::expected::Raw;

/// What a standard PLY file may have besides what is needed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Dress {
    /// As the trainer writes it.
    Plain,
    /// Properties in another order with strangers of other types between them, and elements before and after.
    Strange,
    /// As text.
    Text,
}

fn logit(opacity: f32) -> f32 {
    (opacity / (1.0 - opacity)).ln()
}

/// Name and value of each property.
fn properties(raw: &Raw) -> Vec<(String, f32)> {
    let mut all = Vec::new();
    let mut put = |name: &str, values: &[f32]| {
        for (index, value) in values.iter().enumerate() {
            all.push((format!("{name}{index}"), *value));
        }
    };
    put("f_dc_", &raw.colour);
    let planar: Vec<f32> = (0..3)
        .flat_map(|channel| raw.rest.iter().map(move |rest| rest[channel]))
        .collect();
    put("f_rest_", &planar);
    put("scale_", &raw.log_scale);
    put("rot_", &raw.rotation);
    all.push(("opacity".to_owned(), logit(raw.opacity)));
    for (name, value) in ["x", "y", "z"].into_iter().zip(raw.position) {
        all.push((name.to_owned(), value));
    }
    all
}

pub(crate) fn ply(raws: &[Raw], dress: Dress) -> Vec<u8> {
    let like = raws.first().map(properties).unwrap_or_default();
    let encoding = if dress == Dress::Text {
        "ascii"
    } else {
        "binary_little_endian"
    };
    let mut header = format!("ply\nformat {encoding} 1.0\ncomment of a test\n");
    if dress == Dress::Strange {
        header += "element face 2\nproperty list uchar int vertex_index\nproperty uchar flag\n";
        header += "element info 1\nproperty double when\n";
    }
    writeln!(header, "element vertex {}", raws.len()).unwrap();
    for (index, (name, _)) in like.iter().rev().enumerate() {
        if dress == Dress::Strange && index % 5 == 0 {
            writeln!(header, "property uchar stranger_{index}").unwrap();
        }
        let kind = if dress == Dress::Strange && index % 7 == 0 {
            "double"
        } else {
            "float"
        };
        writeln!(header, "property {kind} {name}").unwrap();
    }
    if dress == Dress::Strange {
        header += "element tail 1000000\nproperty float not_there\n";
    }
    header += "end_header\n";
    let mut file = header.into_bytes();
    if dress == Dress::Strange {
        file.extend([3, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 9]);
        file.extend([0, 8]);
        file.extend(1.5_f64.to_le_bytes());
    }
    for raw in raws {
        let mut line = String::new();
        for (index, (_, value)) in properties(raw).iter().rev().enumerate() {
            if dress == Dress::Strange && index % 5 == 0 {
                file.push(77);
            }
            if dress == Dress::Strange && index % 7 == 0 {
                file.extend(f64::from(*value).to_le_bytes());
            } else if dress == Dress::Text {
                write!(line, "{value} ").unwrap();
            } else {
                file.extend(value.to_le_bytes());
            }
        }
        if dress == Dress::Text {
            line += "\n";
            file.extend(line.as_bytes());
        }
    }
    file
}

fn byte(value: f32) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let byte = value.round().clamp(0.0, 255.0) as u8;
    byte
}

fn unorm(value: f32, bits: u32) -> u32 {
    let most = f64::from((1_u32 << bits) - 1);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let word = (f64::from(value) * most).round().clamp(0.0, most) as u32;
    word
}

fn normalised(rotation: [f32; 4]) -> [f32; 4] {
    let length = rotation.iter().map(|v| v * v).sum::<f32>().sqrt();
    rotation.map(|v| v / length)
}

/// The index of the greatest of the four, and all with the sign that makes it positive.
fn greatest(rotation: [f32; 4]) -> (usize, [f32; 4]) {
    let at = (0..4)
        .max_by(|&a, &b| rotation[a].abs().total_cmp(&rotation[b].abs()))
        .unwrap();
    let sign = rotation[at].signum();
    (at, rotation.map(|v| v * sign))
}

pub(crate) fn compressed_ply(raws: &[Raw], colour_bounds: bool) -> Vec<u8> {
    const CHUNK: usize = 256;
    let rgb = |raw: &Raw| raw.colour.map(|c| 0.5 + 0.282_094_79 * c);
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    writeln!(header, "element chunk {}", raws.len().div_ceil(CHUNK)).unwrap();
    let mut bounds = vec!["x", "y", "z", "scale_x", "scale_y", "scale_z"];
    if colour_bounds {
        bounds.extend(["r", "g", "b"]);
    }
    for three in bounds.chunks(3) {
        for end in ["min", "max"] {
            for name in three {
                writeln!(header, "property float {end}_{name}").unwrap();
            }
        }
    }
    writeln!(header, "element vertex {}", raws.len()).unwrap();
    for name in ["position", "rotation", "scale", "color"] {
        writeln!(header, "property uint packed_{name}").unwrap();
    }
    let rest = raws.first().map_or(0, |raw| raw.rest.len());
    if rest > 0 {
        writeln!(header, "element sh {}", raws.len()).unwrap();
        for index in 0..3 * rest {
            writeln!(header, "property uchar f_rest_{index}").unwrap();
        }
    }
    header += "end_header\n";
    let mut file = header.into_bytes();
    let mut words: Vec<u8> = Vec::new();
    for chunk in raws.chunks(CHUNK) {
        let range = |of: &dyn Fn(&Raw) -> [f32; 3]| {
            let all: Vec<[f32; 3]> = chunk.iter().map(of).collect();
            let min = all.iter().fold([f32::MAX; 3], |a, b| {
                std::array::from_fn(|i| a[i].min(b[i]))
            });
            let max = all.iter().fold([f32::MIN; 3], |a, b| {
                std::array::from_fn(|i| a[i].max(b[i]))
            });
            [min, max]
        };
        let share = |v: [f32; 3], [min, max]: [[f32; 3]; 2]| -> [f32; 3] {
            std::array::from_fn(|i| {
                if max[i] > min[i] {
                    (v[i] - min[i]) / (max[i] - min[i])
                } else {
                    0.0
                }
            })
        };
        let position = range(&|raw| raw.position);
        let scale = range(&|raw| raw.log_scale);
        let colour = if colour_bounds {
            range(&rgb)
        } else {
            [[0.0; 3], [1.0; 3]]
        };
        let stored = if colour_bounds {
            vec![position, scale, colour]
        } else {
            vec![position, scale]
        };
        for value in stored.as_flattened().as_flattened() {
            file.extend(value.to_le_bytes());
        }
        for raw in chunk {
            let pack = |[x, y, z]: [f32; 3]| unorm(x, 11) << 21 | unorm(y, 10) << 11 | unorm(z, 11);
            let (at, rotation) = greatest(normalised(raw.rotation));
            let mut packed = u32::try_from(at).unwrap();
            for (index, value) in rotation.iter().enumerate() {
                if index != at {
                    packed = packed << 10 | unorm(value / std::f32::consts::SQRT_2 + 0.5, 10);
                }
            }
            let [r, g, b] = share(rgb(raw), colour);
            let colour =
                unorm(r, 8) << 24 | unorm(g, 8) << 16 | unorm(b, 8) << 8 | unorm(raw.opacity, 8);
            words.extend(pack(share(raw.position, position)).to_le_bytes());
            words.extend(packed.to_le_bytes());
            words.extend(pack(share(raw.log_scale, scale)).to_le_bytes());
            words.extend(colour.to_le_bytes());
        }
    }
    file.extend(words);
    for raw in raws {
        for channel in 0..3 {
            file.extend(
                raw.rest
                    .iter()
                    .map(|rest| byte(((rest[channel] / 8.0 + 0.5) * 256.0).floor())),
            );
        }
    }
    file
}

pub(crate) fn splat(raws: &[Raw]) -> Vec<u8> {
    let mut file = Vec::new();
    for raw in raws {
        for value in raw.position {
            file.extend(value.to_le_bytes());
        }
        for value in raw.log_scale {
            file.extend(value.exp().to_le_bytes());
        }
        file.extend(raw.colour.map(|c| byte(255.0 * (0.5 + 0.282_094_79 * c))));
        file.push(byte(255.0 * raw.opacity));
        file.extend(normalised(raw.rotation).map(|v| byte(v * 128.0 + 128.0)));
    }
    file
}

/// The bytes inside an .spz file's gzip; the Gaussians' numbers go in as they are, in OpenXR's axes.
pub(crate) fn spz_payload(raws: &[Raw], version: u32, fractional_bits: u8, flags: u8) -> Vec<u8> {
    let mut file = b"NGSP".to_vec();
    file.extend(version.to_le_bytes());
    file.extend(u32::try_from(raws.len()).unwrap().to_le_bytes());
    let degree = match raws.first().map_or(0, |raw| raw.rest.len()) {
        0 => 0,
        3 => 1,
        8 => 2,
        _ => 3,
    };
    file.extend([degree, fractional_bits, flags, 0]);
    for raw in raws {
        for value in raw.position {
            #[expect(clippy::cast_possible_truncation, reason = "tests keep within 24 bits")]
            let fixed = (f64::from(value) * f64::from(fractional_bits).exp2()).round() as i32;
            file.extend(&fixed.to_le_bytes()[..3]);
        }
    }
    file.extend(raws.iter().map(|raw| byte(255.0 * raw.opacity)));
    for raw in raws {
        file.extend(raw.colour.map(|c| byte(255.0 * (0.5 + 0.15 * c))));
    }
    for raw in raws {
        file.extend(raw.log_scale.map(|s| byte((s + 10.0) * 16.0)));
    }
    for raw in raws {
        let [w, x, y, z] = normalised(raw.rotation);
        if version == 2 {
            let sign = if w < 0.0 { -1.0 } else { 1.0 };
            file.extend([x, y, z].map(|v| byte(127.5 + 127.5 * sign * v)));
        } else {
            let (at, rotation) = greatest([x, y, z, w]);
            let mut word = u32::try_from(at).unwrap();
            for (index, value) in rotation.iter().enumerate() {
                if index != at {
                    let sign = u32::from(*value < 0.0);
                    word =
                        word << 10 | sign << 9 | unorm(value.abs() * std::f32::consts::SQRT_2, 9);
                }
            }
            file.extend(word.to_le_bytes());
        }
    }
    for raw in raws {
        for value in raw.rest.as_flattened() {
            file.push(byte(value * 128.0 + 128.0));
        }
    }
    file
}

pub(crate) fn gzip(payload: &[u8]) -> Vec<u8> {
    let mut stream = GzEncoder::new(Vec::new(), Compression::fast());
    stream.write_all(payload).unwrap();
    stream.finish().unwrap()
}
