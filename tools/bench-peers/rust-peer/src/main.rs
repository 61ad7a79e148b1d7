//! wgpu-3dgs-viewer as a peer of bench.mjs: `rust-peer SCENE.ply CAMERAS.json ID`.
//!
//! Loads the scene once and says so in a line of JSON. Then each line of standard input, `{"frames": 9, "picture": "FILE.png"}`, is a turn: so
//! many frames, timed, answered with a line of JSON, and the last one's picture. Between turns it waits and uses no processor.

use anyhow::{Context, Result, anyhow, bail};
use serde::Deserialize;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;
use std::sync::mpsc;
use std::time::Instant;
use wgpu_3dgs_viewer::core::glam::{Mat3, Mat4, UVec2, Vec3, Vec4};
use wgpu_3dgs_viewer::core::{
    Gaussian, GaussianDisplayMode, GaussianMaxStdDev, GaussianPod,
    GaussianPodWithShNoneCov3dSingleConfigs, GaussianShDegree, PlyGaussians, PlyHeader,
    ReadIterGaussian,
};
use wgpu_3dgs_viewer::{CameraTrait, DefaultGaussianPod, Viewer};

const NEAR_METRES: f32 = 0.05;
const FAR_METRES: f32 = 1000.0;

/// Linear 8 bits: the colours of 3DGS are stored as they are shown.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const BYTES_PER_PIXEL: u32 = 4;

/// The viewer's shader draws a splat of standard deviation s as exp(-8 d²/(m s)²) and ends it where that is exp(-m²), with m this
/// setting. So only sqrt(8) draws the Gaussian that the file means, exp(-d²/2s²), to four standard deviations.
const MAX_STD_DEV: f32 = 2.0 * std::f32::consts::SQRT_2;

/// One camera of a cameras.json as 3DGS writes it: `rotation` is world from camera, row by row, of a camera with x right, y down, z
/// forward; the centre of projection is the picture's.
#[derive(Deserialize)]
struct Pinhole {
    id: u32,
    width: u32,
    height: u32,
    position: [f32; 3],
    rotation: [[f32; 3]; 3],
    fx: f32,
    fy: f32,
}

impl CameraTrait for Pinhole {
    /// The viewer's cameras have y up and z backward.
    fn view(&self) -> Mat4 {
        let camera_from_world = Mat3::from_cols_array_2d(&self.rotation);
        let view_from_camera = Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0));
        let rotation = view_from_camera * camera_from_world;
        Mat4::from_translation(-(rotation * Vec3::from_array(self.position)))
            * Mat4::from_mat3(rotation)
    }

    fn projection(&self, _aspect_ratio: f32) -> Mat4 {
        let depth = FAR_METRES / (NEAR_METRES - FAR_METRES);
        Mat4::from_cols(
            Vec4::X * (2.0 * self.fx / self.width as f32),
            Vec4::Y * (2.0 * self.fy / self.height as f32),
            Vec4::new(0.0, 0.0, depth, -1.0),
            Vec4::Z * (NEAR_METRES * depth),
        )
    }
}

fn read_camera(file: &Path, id: u32) -> Result<Pinhole> {
    let cameras: Vec<Pinhole> = serde_json::from_reader(BufReader::new(File::open(file)?))?;
    cameras
        .into_iter()
        .find(|camera| camera.id == id)
        .with_context(|| format!("there is no camera {id}"))
}

/// The Gaussians and the degree of their spherical harmonics.
fn read_scene(file: &Path) -> Result<(Vec<Gaussian>, u8)> {
    let mut reader = BufReader::new(File::open(file)?);
    let rest = match PlyGaussians::read_header(&mut reader)? {
        PlyHeader::Inria(..) => 45,
        PlyHeader::Custom(header) => header.elements.get("vertex").map_or(0, |vertex| {
            let names = vertex.properties.keys();
            names.filter(|name| name.starts_with("f_rest_")).count()
        }),
    };
    let (degree, per_channel) = match rest {
        0 => (0, 0),
        9 => (1, 3),
        24 => (2, 8),
        45 => (3, 15),
        other => bail!("{other} f_rest properties are no whole degree of spherical harmonics"),
    };
    let mut scene = PlyGaussians::read_from_file(file)?;
    // The reader takes each channel to have the 15 coefficients of degree 3.
    for gaussian in &mut scene.0 {
        let packed = gaussian.sh;
        gaussian.sh = [0.0; 45];
        for channel in 0..3 {
            let (from, to) = (channel * per_channel, channel * 15);
            gaussian.sh[to..to + per_channel].copy_from_slice(&packed[from..from + per_channel]);
        }
    }
    Ok((scene.iter().map(Gaussian::from_ply).collect(), degree))
}

/// The viewer with what it draws into and what its picture is read through.
struct Stage<G: GaussianPod> {
    device: wgpu::Device,
    queue: wgpu::Queue,
    viewer: Viewer<G>,
    camera: Pinhole,
    target: wgpu::Texture,
    view: wgpu::TextureView,
    readback: wgpu::Buffer,
}

impl<G: GaussianPod> Stage<G> {
    fn new(
        (device, queue): (wgpu::Device, wgpu::Queue),
        camera: Pinhole,
        gaussians: &Vec<Gaussian>,
        degree: u8,
    ) -> Result<Self> {
        let viewer = Viewer::<G>::new(&device, FORMAT, gaussians)?;
        viewer.gaussian_transform_buffer.update(
            &queue,
            1.0,
            GaussianDisplayMode::Splat,
            GaussianShDegree::new(degree).context("the viewer's degrees are 0 to 3")?,
            false,
            GaussianMaxStdDev::new(MAX_STD_DEV).context("the viewer's splats end before 3")?,
        );
        let target = device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width: camera.width,
                height: camera.height,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let readback = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(bytes_per_row(camera.width)) * u64::from(camera.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Ok(Self {
            view: target.create_view(&wgpu::TextureViewDescriptor::default()),
            device,
            queue,
            viewer,
            camera,
            target,
            readback,
        })
    }

    /// Draws one frame and returns the milliseconds until the GPU has finished it: camera, cull, sort, draw.
    fn frame(&mut self) -> Result<f64> {
        let started = Instant::now();
        let size = UVec2::new(self.camera.width, self.camera.height);
        self.viewer.update_camera(&self.queue, &self.camera, size);
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.viewer.render(&mut encoder, &self.view);
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        Ok(1000.0 * started.elapsed().as_secs_f64())
    }

    /// Writes the last frame, which is over black, as PNG.
    fn write_picture(&self, file: &Path) -> Result<()> {
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            self.target.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.readback,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(bytes_per_row(self.camera.width)),
                    rows_per_image: None,
                },
            },
            self.target.size(),
        );
        self.queue.submit([encoder.finish()]);
        let (mapped, wait) = mpsc::channel();
        self.readback
            .map_async(wgpu::MapMode::Read, .., move |result| {
                // Nobody waits any more only if the wait below has failed.
                let _ = mapped.send(result);
            });
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        wait.recv()??;
        let mut rgb = Vec::new();
        {
            let rows = self.readback.get_mapped_range(..)?;
            let used = (BYTES_PER_PIXEL * self.camera.width) as usize;
            for row in rows.chunks_exact(bytes_per_row(self.camera.width) as usize) {
                for pixel in row[..used].chunks_exact(BYTES_PER_PIXEL as usize) {
                    rgb.extend_from_slice(&pixel[..3]);
                }
            }
        }
        self.readback.unmap();
        let out = BufWriter::new(File::create(file)?);
        let mut encoder = png::Encoder::new(out, self.camera.width, self.camera.height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&rgb)?;
        writer.finish()?;
        Ok(())
    }
}

/// Rows are padded in a buffer that a texture is copied into.
fn bytes_per_row(width: u32) -> u32 {
    (BYTES_PER_PIXEL * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

#[derive(Deserialize)]
struct Turn {
    frames: u32,
    picture: Option<String>,
}

/// Answers turns until standard input ends.
fn serve<G: GaussianPod>(mut stage: Stage<G>, ready: &Value) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let mut say = |line: &Value| writeln!(out, "{line}").and_then(|()| out.flush());
    say(ready)?;
    for line in std::io::stdin().lock().lines() {
        let turn: Turn = serde_json::from_str(&line?).context("a turn")?;
        let total_ms = (0..turn.frames)
            .map(|_| stage.frame())
            .collect::<Result<Vec<f64>>>()?;
        if let Some(file) = turn.picture {
            stage
                .write_picture(Path::new(&file))
                .with_context(|| format!("the picture {file}"))?;
        }
        say(&json!({ "total_ms": total_ms }))?;
    }
    Ok(())
}

fn main() -> Result<()> {
    let [scene, cameras, id] = std::env::args()
        .skip(1)
        .collect::<Vec<_>>()
        .try_into()
        .map_err(|_| anyhow!("Usage: rust-peer SCENE.ply CAMERAS.json ID"))?;
    let id = id.parse().with_context(|| format!("the camera {id}"))?;
    let camera = read_camera(Path::new(&cameras), id).with_context(|| cameras.clone())?;
    let (gaussians, degree) = read_scene(Path::new(&scene)).with_context(|| scene.clone())?;

    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter =
        pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    // As the viewer's own examples do.
    let gpu = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_limits: adapter.limits(),
        ..Default::default()
    }))?;
    let info = adapter.get_info();
    let ready = json!({
        "gaussians": gaussians.len(),
        "sh_degree": degree,
        "device": format!("{:?} on {}, {}", info.backend, info.name, info.driver_info),
    });
    // The viewer's packing for scenes without harmonics is a quarter of the other's size.
    match degree {
        0 => serve(
            Stage::<GaussianPodWithShNoneCov3dSingleConfigs>::new(gpu, camera, &gaussians, degree)?,
            &ready,
        ),
        _ => serve(
            Stage::<DefaultGaussianPod>::new(gpu, camera, &gaussians, degree)?,
            &ready,
        ),
    }
}
