//! The layout the 3DGS trainer writes (`GaussianModel.save_ply`): opacity as a logit, scales as logarithms, quaternions
//! w x y z, SH coefficients above degree 0 channel by channel, COLMAP's axes. Properties may stand in any order and type,
//! and others between them are passed over.

use super::body::{Columns, table};
use super::header::Header;
use crate::source::Source;
use crate::{Format, Scene, SceneBuilder, SceneError, Splat, frame};

const FORMAT: Format = Format::Ply;

/// What each Gaussian must have besides its SH coefficients above degree 0.
const ATTRIBUTES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
    "rot_0", "rot_1", "rot_2", "rot_3",
];

pub(super) fn read(source: &Source<'_>, header: &Header, body: &[u8]) -> Result<Scene, SceneError> {
    let stated = header.element("vertex").map_or(0, |vertex| vertex.count);
    let count = source.checked_count(stated)?;
    let table = table(source, FORMAT, header, body, "vertex")?;
    let rest_values = table.element.rest_properties();
    let sh_degree = sh_degree(source, FORMAT, rest_values)?;
    let per_channel = rest_values / 3;
    let mut names: Vec<String> = ATTRIBUTES.iter().map(|&name| name.to_owned()).collect();
    for coefficient in 0..per_channel {
        for channel in 0..3 {
            names.push(format!("f_rest_{}", channel * per_channel + coefficient));
        }
    }
    let columns = Columns::new(source, FORMAT, &table, &names)?;

    let mut builder = SceneBuilder::new(sh_degree)?;
    builder.reserve(count)?;
    let mut attributes = [0.0; ATTRIBUTES.len()];
    let mut sh_rest = vec![0.0; rest_values];
    for row in table.rows() {
        columns.read(row, &mut attributes, &mut sh_rest);
        let [x, y, z, red, green, blue, logit, a, b, c, qw, qx, qy, qz] = attributes;
        let mut splat = Splat {
            position: [x, y, z],
            rotation: [qx, qy, qz, qw],
            log_scale: [a, b, c],
            opacity: 1.0 / (1.0 + (-logit).exp()),
            colour: [red, green, blue],
        };
        frame::turn(&mut splat, &mut sh_rest);
        builder.push(&splat, &sh_rest)?;
    }
    Ok(builder.finish_as(FORMAT, false))
}

/// The SH degree that so many `f_rest_` properties make.
pub(super) fn sh_degree(
    source: &Source<'_>,
    format: Format,
    rest_values: usize,
) -> Result<u8, SceneError> {
    match rest_values {
        0 => Ok(0),
        9 => Ok(1),
        24 => Ok(2),
        45 => Ok(3),
        72 => Err(source.unsupported(
            format,
            "SH degree 4",
            "cut its spherical harmonics to degree 3",
        )),
        other => Err(source.damaged(
            format,
            format!("it has {other} properties `f_rest_`, where 0, 9, 24 or 45 make an SH degree"),
        )),
    }
}
