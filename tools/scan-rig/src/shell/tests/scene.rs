//! A scan of the body model: Gaussians on its posed skin in MakeHuman's colours, with eyes and a closed mouth.

use super::super::additions::Additions;
use super::super::cells::Patch;
use super::super::head::corners;
use crate::bind::{BindReport, Bound, Mesh};
use crate::body::{BodyModel, BodyPart, Registered, posing};
use crate::pinhole::Pinhole;
use crate::scan::Scan;
use crate::shell::{ShellOptions, ShellReport, Textures, complete};
use crate::surface::raster;
use glam::{DMat3, DVec2, DVec3, Vec3};
use spmm3::{JOINTS, Joint};
use std::path::Path;
use std::sync::OnceLock;
use synthetic_person::real_files::makehuman;

/// The body model with its textures.
pub(super) struct Data {
    pub(super) model: &'static BodyModel,
    pub(super) textures: Textures,
}

/// Reads the body model once; nothing if the machine lacks it.
pub(super) fn data() -> Option<&'static Data> {
    static DATA: OnceLock<Option<Data>> = OnceLock::new();
    DATA.get_or_init(|| {
        let model = crate::body::tests::model()?;
        let folder = makehuman()?;
        let textures = Textures::load(&folder).expect("the package is whole");
        Some(Data { model, textures })
    })
    .as_ref()
}

/// A body model that stands as scanned, and its scan, bound exactly.
pub(super) struct Scene {
    pub(super) bound: Bound,
    pub(super) registered: Registered,
}

/// A scanned face, and the same completed, for all tests that only look at it.
pub(super) struct Face {
    pub(super) data: &'static Data,
    pub(super) before: Scene,
    pub(super) after: Scene,
    pub(super) report: ShellReport,
}

/// Completes a face once; nothing if the machine lacks the body model.
pub(super) fn face() -> Option<&'static Face> {
    static FACE: OnceLock<Option<Face>> = OnceLock::new();
    FACE.get_or_init(|| {
        let data = data()?;
        let before = Scene::of_head(data, 0.006);
        let mut after = Scene {
            bound: before.bound.clone(),
            registered: before.registered.clone(),
        };
        let report = after.completed(data);
        Some(Face {
            data,
            before,
            after,
            report,
        })
    })
    .as_ref()
}

impl Scene {
    /// With Gaussians on the head alone.
    pub(super) fn of_head(data: &Data, spacing: f64) -> Self {
        let model = data.model;
        let near_head = |face: usize| model.head_share(model.faces[face][0] as usize) > 0.1;
        Self::new(data, spacing, near_head)
    }

    /// Completes face and hands.
    pub(super) fn completed(&mut self, data: &Data) -> ShellReport {
        let options = ShellOptions {
            unseen: false,
            ..ShellOptions::default()
        };
        complete(
            &mut self.bound,
            data.model,
            &self.registered,
            &data.textures,
            &options,
        )
        .expect("a shell")
    }

    /// With Gaussians on the faces that `take` chooses, in a stance with the arms half down, the head turned a little.
    pub(super) fn new(data: &Data, spacing: f64, take: impl Fn(usize) -> bool) -> Self {
        Self::standing(data, spacing, 0.0, take)
    }

    /// The same with the left arm lower by an angle, radians.
    pub(super) fn standing(
        data: &Data,
        spacing: f64,
        lower: f64,
        take: impl Fn(usize) -> bool,
    ) -> Self {
        let model = data.model;
        let shape: Vec<f64> = (0..model.shapes.len())
            .map(|k| if k % 5 == 1 { 0.15 } else { 0.0 })
            .collect();
        let (shaped, joints) = model.shaped(&shape);
        let mut rotations = [DMat3::IDENTITY; JOINTS];
        let turn = DMat3::from_rotation_y(0.15) * DMat3::from_rotation_x(-0.05);
        for joint in [Joint::Head, Joint::Jaw, Joint::LeftEye, Joint::RightEye] {
            rotations[joint.index()] = turn;
        }
        let is_arm = |joint: &Joint| {
            std::iter::successors(Some(*joint), |joint| joint.parent())
                .any(|joint| joint == Joint::LeftShoulder)
        };
        for joint in Joint::ALL.iter().filter(|joint| is_arm(joint)) {
            rotations[joint.index()] = DMat3::from_rotation_z(-lower);
        }
        let scale = 1.03;
        let posed = posing::chain(&rotations, joints[0] * scale, scale, &joints);
        let maps = posing::posed_from_rest(&rotations, &posed, scale, &joints);
        let vertices = posing::skinned(&model.weights, &maps, &shaped);
        let (scan, triangles) = paint(data, &vertices, spacing, take);
        let accessory = vec![0; triangles.len()];
        let bound = Bound {
            scan,
            triangles,
            mesh: Mesh {
                vertices: vertices.clone(),
                faces: model.faces.clone(),
                weights: model
                    .weights
                    .iter()
                    .map(|row| posing::kept(row).dense())
                    .collect(),
            },
            accessory,
            report: BindReport::default(),
        };
        let registered = Registered {
            shape,
            rotations,
            scale,
            joints: posed,
            vertices,
            confidence: [1.0; JOINTS],
        };
        Self { bound, registered }
    }

    /// The scan with the mesh at `vertices`, the body model's.
    pub(super) fn moved(&self, vertices: &[DVec3]) -> Scan {
        let bound = &self.bound;
        let posed: Vec<Vec3> = vertices.iter().map(|v| v.as_vec3()).collect();
        bound
            .carried()
            .posed(&bound.scan, &bound.triangles, &bound.mesh.faces, &posed)
    }

    /// A view of the face from `distance` metres, `azimuth` degrees to the person's left.
    pub(super) fn face_view(&self, distance: f64, azimuth: f64) -> Pinhole {
        let axes = self.registered.rotations[Joint::Head.index()];
        let eyes = [Joint::LeftEye, Joint::RightEye].map(|j| self.registered.joints[j.index()]);
        let target = 0.5 * (eyes[0] + eyes[1]) - 0.03 * axes.y_axis;
        let (sin, cos) = azimuth.to_radians().sin_cos();
        let eye = target + distance * (axes.z_axis * cos + axes.x_axis * sin);
        Pinhole::look_at(eye, target, axes.y_axis, 1800.0 * distance, 400, 440)
    }
}

/// Gaussians on the model's faces.
fn paint(
    data: &Data,
    vertices: &[DVec3],
    spacing: f64,
    take: impl Fn(usize) -> bool,
) -> (Scan, Vec<u32>) {
    let model = data.model;
    let mut additions = Additions::default();
    let mut cells = Vec::new();
    for quad in 0..model.faces.len() / 2 {
        let part = model.parts[2 * quad];
        let outer = corners(model, quad)
            .iter()
            .any(|v| model.outer[*v as usize]);
        if !outer
            || !take(2 * quad)
            || matches!(
                part,
                BodyPart::Teeth | BodyPart::Tongue | BodyPart::InnerMouth
            )
        {
            continue;
        }
        cells.clear();
        let fine = matches!(part, BodyPart::Face | BodyPart::Eyes);
        let patch = Patch {
            corners: corners(model, quad).map(|v| vertices[v as usize]),
            stretch: DVec2::ONE,
            first_triangle: u32::try_from(2 * quad).unwrap_or_default(),
        };
        patch.cells(if fine { 0.35 * spacing } else { spacing }, &mut cells);
        for cell in &cells {
            let uv: DVec2 = (model.uvs[cell.triangle as usize].iter().zip(cell.shares))
                .map(|(uv, share)| uv.as_dvec2() * share)
                .sum();
            let colour = if part == BodyPart::Eyes {
                eye_colour(data, vertices, cell.point)
            } else {
                data.textures.colour(part, uv.as_vec2())
            };
            let light = 0.7 + 0.3 * cell.normal.dot(DVec3::new(0.3, 0.6, 0.74)).max(-0.3);
            additions.push(cell, 0.0, colour * light, 0.96);
        }
    }
    (additions.scan, additions.triangles)
}

/// Blue irises on white, that look ahead in the head's direction.
fn eye_colour(data: &Data, vertices: &[DVec3], point: DVec3) -> DVec3 {
    let model = data.model;
    let side = |joint: Joint| -> (DVec3, f64) {
        let own: Vec<DVec3> = (model.body_vertices..model.rest.len())
            .filter(|v| model.weights[*v][joint.index()] > 0.5)
            .map(|v| vertices[v])
            .collect();
        let middle = own.iter().sum::<DVec3>() / own.len() as f64;
        (middle, middle.distance(point))
    };
    let (left, right) = (side(Joint::LeftEye), side(Joint::RightEye));
    let centre = if left.1 < right.1 { left.0 } else { right.0 };
    let ahead = DMat3::from_rotation_y(0.15) * DMat3::from_rotation_x(-0.05) * DVec3::Z;
    let angle = (point - centre).angle_between(ahead);
    if angle < 0.2 {
        DVec3::splat(0.03)
    } else if angle < 0.46 {
        DVec3::new(0.25, 0.42, 0.62)
    } else {
        DVec3::new(0.88, 0.85, 0.83)
    }
}

/// A picture over grey.
pub(super) fn picture(scan: &Scan, view: &Pinhole) -> Vec<Vec3> {
    raster::draw(scan, view).over(Vec3::splat(0.55))
}

/// Whether the environment asks for pictures, to be looked at.
pub(super) fn is_looked_at() -> bool {
    std::env::var_os("MON3TR_PICTURES").is_some()
}

/// Writes pictures side by side where the environment asks for it.
#[expect(clippy::cast_possible_truncation, reason = "clamped to a byte")]
pub(super) fn save(name: &str, pictures: &[Vec<Vec3>], view: &Pinhole) {
    let Ok(folder) = std::env::var("MON3TR_PICTURES") else {
        return;
    };
    let (width, height) = (view.width as usize, view.height as usize);
    let mut bytes = format!("P6\n{} {height}\n255\n", width * pictures.len()).into_bytes();
    for row in 0..height {
        for picture in pictures {
            for pixel in &picture[row * width..(row + 1) * width] {
                bytes.extend(
                    pixel
                        .to_array()
                        .map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8),
                );
            }
        }
    }
    std::fs::write(Path::new(&folder).join(format!("{name}.ppm")), bytes)
        .expect("a folder for pictures");
}

/// Peak signal-to-noise ratio, dB.
pub(super) fn psnr(a: &[Vec3], b: &[Vec3]) -> f64 {
    let error: f64 = a
        .iter()
        .zip(b)
        .map(|(a, b)| f64::from((*a - *b).length_squared()))
        .sum();
    -10.0 * (error / (3 * a.len()) as f64).max(1e-12).log10()
}
