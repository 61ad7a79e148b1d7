//! Writes the Gaussians of an avatar in one pose of the built-in motion as a standard 3DGS PLY, so that other people's
//! renderers can be shown the same person: `cargo run --release -p app-pipeline --example posed_ply -- AVATAR.m3a SECONDS OUT.ply`.
//!
//! As captured scenes have it, y points down and the person faces -z: the world turned by half a turn about x.

use app_kernels::state::{GaussianState, plane};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::deform::Deformer;
use app_pipeline::inference::Inference;
use app_pipeline::plan::Plan;
use app_pipeline::profile::Profile;
use npu_runtime::{Provider, Runtime};
use spmm3::networks::GraphParts;
use spmm3::{Avatar, LOOP_SECONDS, MotionClip, Playback, SH_C0};
use std::error::Error;
use std::f32::consts::LN_2;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// The clip's own rate, frames per second.
const RATE: f64 = 30.0;

/// In the order in which [`write`] gives them.
const PROPERTIES: [&str; 17] = [
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
];

fn write(state: &GaussianState, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    writeln!(out, "element vertex {}", state.len())?;
    for name in PROPERTIES {
        writeln!(out, "property float {name}")?;
    }
    writeln!(out, "end_header")?;
    let three = |planes: Range<usize>, i| {
        let mut values = planes.map(|one| state.plane(one)[i]);
        [(); 3].map(|()| values.next().unwrap_or_default())
    };
    for i in 0..state.len() {
        let [x, y, z] = three(plane::POSITION, i);
        let [r, g, b] = three(plane::COLOUR, i).map(|value| (value - 0.5) / SH_C0);
        let [sx, sy, sz] = three(plane::LOG2_SCALE, i).map(|octaves| octaves * LN_2);
        // (1, 0, 0, 0) * q, the half turn; then w first, as 3DGS writes it.
        let [qx, qy, qz] = three(plane::ROTATION, i);
        let qw = state.plane(plane::ROTATION.end - 1)[i];
        let opacity = state.plane(plane::OPACITY)[i];
        let logit = (opacity / (1.0 - opacity)).ln();
        let row = [
            x, -y, -z, 0.0, 0.0, 0.0, r, g, b, logit, sx, sy, sz, -qx, qw, -qz, qy,
        ];
        for value in row {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    out.flush()
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [package, seconds, ply] = arguments.as_slice() else {
        return Err("usage: posed_ply AVATAR.m3a SECONDS OUT.ply".into());
    };
    let avatar = Avatar::load(Path::new(package))?;
    let clip = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, LOOP_SECONDS, RATE)?;
    let motion = clip.sample(seconds.parse()?, Playback::Clamp);
    let runtime = Runtime::open(None)?;
    let avatar = Arc::new(avatar);
    let plan = Plan::CpuTail;
    let providers = [Provider::Cpu { threads: 1 }];
    let inference = Inference::open(
        &runtime,
        &avatar,
        GraphParts::Skinned,
        &providers,
        &CompiledSources::default(),
    )?;
    let mut deformer = Deformer::new(&avatar, inference, plan)?;
    let gaussians = deformer.deform(&motion, &mut Profile::default())?;
    write(gaussians, &mut BufWriter::new(std::fs::File::create(ply)?))?;
    println!("{ply}: {} Gaussians", gaussians.len());
    Ok(())
}
