//! Draws an avatar in a capture's poses as the capture's cameras see it, by the renderer of calls.

use anyhow::Context;
use app_session::display::Still;
use capture::{Camera, Capture};
use glam::{Affine3A, DMat3, DVec3, Mat3A};
use mon3tr::size::{Size, Views};
use mon3tr::stills::{RenderSettings, StillRenderer};
use renderer_splat::camera::{Camera as View, DEFAULT_NEAR};
use renderer_splat::options::Filter;
use renderer_splat::picture::Image;
use spmm3::{Avatar, MotionParams};
use std::collections::BTreeMap;

/// The renderer's view of a capture's camera: the pinhole that photographs have.
pub(super) fn view(camera: &Camera) -> View {
    let pinhole = camera.undistorted();
    // A capture's y down and z away become the renderer's y up and z back.
    let turned = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let pose = pinhole.camera_from_world;
    let matrix = turned * pose.matrix3;
    let translation = turned * pose.translation;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the renderer computes in single precision"
    )]
    let [fx, fy, cx, cy] = [
        pinhole.focal[0],
        pinhole.focal[1],
        pinhole.centre[0],
        pinhole.centre[1],
    ]
    .map(|number| number as f32);
    View {
        camera_from_world: Affine3A {
            matrix3: Mat3A::from(matrix.as_mat3()),
            translation: translation.as_vec3().into(),
        },
        fx,
        fy,
        cx,
        cy,
        width: pinhole.size[0],
        height: pinhole.size[1],
        near: DEFAULT_NEAR,
    }
}

/// The avatar's motion in every frame of a capture.
///
/// # Errors
/// A capture without poses.
pub(super) fn motions(capture: &Capture, avatar: &Avatar) -> anyhow::Result<Vec<MotionParams>> {
    let poses = capture.poses().with_context(|| {
        format!(
            "{} has no motion.npz: an avatar can be compared in known poses only",
            capture.folder().display()
        )
    })?;
    let mut motions: Vec<MotionParams> =
        poses.iter().map(|pose| pose.on(&avatar.skeleton)).collect();
    if let Some(basis) = capture.expression_basis() {
        let to = &avatar.expression_basis;
        let mut moves = true;
        for motion in &mut motions {
            moves &= spmm3::fit_expression(motion, basis, to, &avatar.expressions);
        }
        if !moves {
            log::warn!(
                "the capture's expressions are of the basis {basis}, the avatar's of {to}: the face is drawn at rest"
            );
        }
    }
    Ok(motions)
}

/// Draws the avatar for `pictures` (cameras and frames) and hands each picture with its index to `drawn`, in any order: cameras of one
/// size share a renderer.
pub(super) fn draw(
    renderer: &StillRenderer<'_>,
    capture: &Capture,
    motions: &[MotionParams],
    pictures: &[(usize, usize)],
    mut drawn: impl FnMut(usize, &Image) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut of_size: BTreeMap<[u32; 2], Vec<(usize, Still)>> = BTreeMap::new();
    for (index, (camera, frame)) in pictures.iter().enumerate() {
        let (camera, motion) = (capture.cameras().get(*camera))
            .zip(motions.get(*frame))
            .context("a camera or a frame is not there")?;
        let still = Still {
            motion: motion.clone(),
            cameras: vec![view(camera)],
        };
        of_size.entry(camera.size).or_default().push((index, still));
    }
    for ([width, height], stills) in of_size {
        let setting = RenderSettings {
            size: Size { width, height },
            views: Views::Mono,
            background: None,
            filter: Filter::Dilation,
        };
        let (indices, stills): (Vec<usize>, Vec<Still>) = stills.into_iter().unzip();
        renderer.splat(&setting, stills, |number, views| {
            let view = views.first().context("the renderer drew nothing")?;
            drawn(indices[number], view)
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    #[test]
    fn a_point_is_where_the_captures_camera_sees_it() {
        let turn = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_x(2.9);
        let camera = Camera {
            name: "one".to_owned(),
            size: [640, 480],
            focal: [700.0, 690.0],
            centre: [300.0, 250.0],
            distortion: [0.0; 5],
            camera_from_world: DAffine3 {
                matrix3: turn,
                translation: DVec3::new(0.1, 0.9, 3.0),
            },
        };
        let view = view(&camera);
        let point = DVec3::new(0.3, 1.2, 0.2);
        let wanted = camera.project(point).expect("in front of the camera");
        let seen = view.camera_from_world.transform_point3(point.as_vec3());
        // The renderer's camera looks along its -z.
        let x = view.fx * seen.x / -seen.z + view.cx;
        let y = view.fy * -seen.y / -seen.z + view.cy;
        assert!(
            (f64::from(x) - wanted.x).abs() < 1e-3,
            "{x}, not {}",
            wanted.x
        );
        assert!(
            (f64::from(y) - wanted.y).abs() < 1e-3,
            "{y}, not {}",
            wanted.y
        );
    }
}
