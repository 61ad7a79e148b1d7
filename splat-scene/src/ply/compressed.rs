//! The compressed layout of PlayCanvas and `SuperSplat`: chunks of 256 Gaussians, each attribute packed into 32 bits between
//! the least and the greatest value of its chunk, and SH coefficients above degree 0 as bytes. Older files bound no colours.
//! Layout after playcanvas/splat-transform, `readers/decompress-ply.ts`.

use super::CHUNK;
use super::body::{Field, Table, table};
use super::header::{Header, Kind};
use super::standard::sh_degree;
use crate::source::Source;
use crate::{Format, SH_C0, Scene, SceneBuilder, SceneError, Splat, frame};

const FORMAT: Format = Format::CompressedPly;

pub(super) fn recognise(header: &Header) -> bool {
    header
        .element("vertex")
        .is_some_and(|vertex| vertex.has("packed_position"))
}

pub(super) fn read(source: &Source<'_>, header: &Header, body: &[u8]) -> Result<Scene, SceneError> {
    let stated = header.element("vertex").map_or(0, |vertex| vertex.count);
    let count = source.checked_count(stated)?;
    let vertices = table(source, FORMAT, header, body, "vertex")?;
    let words = [
        "packed_position",
        "packed_rotation",
        "packed_scale",
        "packed_color",
    ];
    let words = vertices.fields(source, FORMAT, words)?;
    if words.iter().any(|word| word.kind != Kind::U32) {
        return Err(source.damaged(FORMAT, "a packed property is not of type `uint`"));
    }
    let chunks = Chunks::new(source, table(source, FORMAT, header, body, "chunk")?)?;
    let need = count.div_ceil(CHUNK) as u64;
    if chunks.table.element.count < need {
        let have = chunks.table.element.count;
        return Err(source.damaged(
            FORMAT,
            format!("{count} Gaussians need {need} chunks, it has {have}"),
        ));
    }
    let harmonics = match header.element("sh") {
        Some(_) => Some(Harmonics::new(
            source,
            table(source, FORMAT, header, body, "sh")?,
            stated,
        )?),
        None => None,
    };
    let rest_values = harmonics.as_ref().map_or(0, |sh| sh.fields.len());
    let mut builder = SceneBuilder::new(sh_degree(source, FORMAT, rest_values)?)?;
    builder.reserve(count)?;
    let mut sh_rest = vec![0.0; rest_values];
    let mut chunk = Bounded::default();
    for (index, row) in vertices.rows().enumerate() {
        if index % CHUNK == 0 {
            chunk = chunks.at(index / CHUNK);
        }
        let mut splat = chunk.unpack(words.map(|word| word.u32(row)));
        if let Some(harmonics) = &harmonics {
            harmonics.unpack(index, &mut sh_rest);
        }
        frame::turn(&mut splat, &mut sh_rest);
        builder.push(&splat, &sh_rest)?;
    }
    Ok(builder.finish_as(FORMAT, false))
}

/// The bounds of all chunks.
struct Chunks<'a> {
    table: Table<'a>,
    position: [[Field; 3]; 2],
    log_scale: [[Field; 3]; 2],
    colour: Option<[[Field; 3]; 2]>,
}

impl<'a> Chunks<'a> {
    fn new(source: &Source<'_>, table: Table<'a>) -> Result<Self, SceneError> {
        let fields = |names| table.fields(source, FORMAT, names);
        Ok(Self {
            position: [
                fields(["min_x", "min_y", "min_z"])?,
                fields(["max_x", "max_y", "max_z"])?,
            ],
            log_scale: [
                fields(["min_scale_x", "min_scale_y", "min_scale_z"])?,
                fields(["max_scale_x", "max_scale_y", "max_scale_z"])?,
            ],
            colour: if table.element.has("min_r") {
                Some([
                    fields(["min_r", "min_g", "min_b"])?,
                    fields(["max_r", "max_g", "max_b"])?,
                ])
            } else {
                None
            },
            table,
        })
    }

    fn at(&self, index: usize) -> Bounded {
        let row = self.table.row(index).unwrap_or_default();
        let range = |fields: [[Field; 3]; 2]| fields.map(|bound| bound.map(|field| field.f32(row)));
        Bounded {
            position: range(self.position),
            log_scale: range(self.log_scale),
            colour: self.colour.map_or([[0.0; 3], [1.0; 3]], range),
        }
    }
}

/// The bounds of one chunk: least and greatest values.
#[derive(Debug, Clone, Copy, Default)]
struct Bounded {
    position: [[f32; 3]; 2],
    log_scale: [[f32; 3]; 2],
    colour: [[f32; 3]; 2],
}

impl Bounded {
    fn unpack(&self, [position, rotation, scale, colour]: [u32; 4]) -> Splat {
        let [red, green, blue, opacity] = colour.to_be_bytes().map(|v| f32::from(v) / 255.0);
        Splat {
            position: between(self.position, unpack_11_10_11(position)),
            rotation: unpack_rotation(rotation),
            log_scale: between(self.log_scale, unpack_11_10_11(scale)),
            opacity,
            colour: between(self.colour, [red, green, blue]).map(|v| (v - 0.5) / SH_C0),
        }
    }
}

fn between([least, greatest]: [[f32; 3]; 2], share: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|axis| least[axis] * (1.0 - share[axis]) + greatest[axis] * share[axis])
}

/// The lowest `bits` (16 at most) of a word as a number from 0 to 1.
fn share(word: u32, bits: u32) -> f32 {
    let most = (1_u32 << bits) - 1;
    #[expect(clippy::cast_precision_loss, reason = "at most 16 bits")]
    let share = (word & most) as f32 / most as f32;
    share
}

fn unpack_11_10_11(word: u32) -> [f32; 3] {
    [
        share(word >> 21, 11),
        share(word >> 11, 10),
        share(word, 11),
    ]
}

/// Two bits for which of w, x, y and z is the greatest, ten for each of the others.
fn unpack_rotation(word: u32) -> [f32; 4] {
    let small = [word >> 20, word >> 10, word]
        .map(|part| (share(part, 10) - 0.5) * std::f32::consts::SQRT_2);
    let [a, b, c] = small;
    let greatest = (1.0 - (a * a + b * b + c * c)).max(0.0).sqrt();
    match word >> 30 {
        0 => [a, b, c, greatest],
        1 => [greatest, b, c, a],
        2 => [b, greatest, c, a],
        _ => [b, c, greatest, a],
    }
}

/// The SH coefficients above degree 0, channel by channel as in the standard layout.
struct Harmonics<'a> {
    table: Table<'a>,
    /// In the scene's order: channels side by side.
    fields: Vec<Field>,
}

impl<'a> Harmonics<'a> {
    fn new(source: &Source<'_>, table: Table<'a>, vertices: u64) -> Result<Self, SceneError> {
        if table.element.count != vertices {
            let rows = table.element.count;
            return Err(source.damaged(
                FORMAT,
                format!("element `sh` has {rows} rows for {vertices} Gaussians"),
            ));
        }
        let rest_values = table.element.rest_properties();
        sh_degree(source, FORMAT, rest_values)?;
        let per_channel = rest_values / 3;
        let mut fields = Vec::new();
        for coefficient in 0..per_channel {
            for channel in 0..3 {
                let name = format!("f_rest_{}", channel * per_channel + coefficient);
                let field = table.field(source, FORMAT, &name)?;
                if field.kind != Kind::U8 {
                    return Err(source.damaged(FORMAT, format!("`{name}` is not of type `uchar`")));
                }
                fields.push(field);
            }
        }
        Ok(Self { table, fields })
    }

    fn unpack(&self, index: usize, sh_rest: &mut [f32]) {
        let row = self.table.row(index).unwrap_or_default();
        for (value, field) in sh_rest.iter_mut().zip(&self.fields) {
            let share = match field.u8(row) {
                0 => 0.0,
                255 => 1.0,
                byte => (f32::from(byte) + 0.5) / 256.0,
            };
            *value = (share - 0.5) * 8.0;
        }
    }
}
