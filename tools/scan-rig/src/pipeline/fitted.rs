//! The first half of the way: the person found, and the body model registered.

use super::RigOptions;
use super::report::Placement;
use super::steps::Steps;
use crate::RigError;
use crate::body::{BodyModel, FitReport, Hint, Observed, Registered, register};
use crate::prepare::{Networks, Prepared, prepare};
use crate::sight::Sight;
use crate::stopwatch::StepSeconds;
use crate::surface::{Surface, Survey, survey};
use glam::{DQuat, DVec3};
use splat_scene::Scene;

/// A scan's person, and the body model as it was registered to it: what an avatar is made of.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The person, upright.
    pub prepared: Prepared,
    /// What is seen of the person.
    pub seen: Survey,
    /// The body model.
    pub model: BodyModel,
    /// Its registration.
    pub registered: Registered,
    /// How well it fits.
    pub fit: FitReport,
    /// Gaussians of the scene.
    pub(super) scene_gaussians: usize,
    pub(super) placement: Placement,
    pub(super) steps: Vec<StepSeconds>,
}

/// The first half of [`super::rig`]: finds the person and registers the body model.
///
/// # Errors
/// As [`super::rig`].
pub fn fitted(
    scene: &Scene,
    options: &RigOptions,
    sight: &mut Sight,
    networks: &mut Networks,
    told: &dyn Fn(&'static str),
) -> Result<Fitted, RigError> {
    let mut steps = Steps::after(Vec::new(), told);
    let mut prepared = steps.run(|| prepare(scene, &options.person, sight, networks))?;
    let mut seen = steps.run(|| Ok(survey(&prepared.scan)))?;
    let (model, mut registered, fit) = steps.run(|| {
        let model = BodyModel::load(&options.makehuman)?;
        let hints: Vec<Hint> = (options.person.joints.iter())
            .map(|(joint, place)| Hint {
                joint: *joint,
                position: (prepared.person_from_scene)
                    .point(scene.point_of_file(*place).as_dvec3()),
            })
            .collect();
        let (registered, fit) = register(
            &model,
            &Observed {
                body: &prepared.body,
                face: prepared.face.as_deref(),
                points: &seen.surface.points,
                normals: &seen.surface.normals,
                hints: &hints,
            },
        )?;
        Ok((model, registered, fit))
    })?;
    face_forwards(&mut prepared, &mut seen.surface, &mut registered);
    Ok(Fitted {
        placement: placement(scene, &prepared, options.person.height.is_some()),
        prepared,
        seen,
        model,
        registered,
        fit,
        scene_gaussians: scene.len(),
        steps: steps.done(),
    })
}

/// Turns the person until the fitted body faces +z. The landmarks that [`prepare`] went by are each off by centimetres; the body is held by all
/// of the surface.
fn face_forwards(prepared: &mut Prepared, surface: &mut Surface, registered: &mut Registered) {
    let Some(front) = registered.facing() else {
        return;
    };
    let yaw = front.x.atan2(front.z);
    log::debug!("turned by {:.1} degrees", -yaw.to_degrees());
    let turn = DQuat::from_rotation_y(-yaw);
    prepared.turn(turn);
    registered.turn(turn);
    let vectors = surface.points.iter_mut().chain(&mut surface.normals);
    vectors.for_each(|vector| *vector = turn.as_quat() * *vector);
}

/// How the person stands in the file.
fn placement(scene: &Scene, prepared: &Prepared, height_given: bool) -> Placement {
    let scene_from_person = prepared.person_from_scene.rotation.inverse();
    let in_file = |direction: DVec3| {
        let direction = (scene_from_person * direction).as_vec3();
        scene.point_in_file(direction).to_array()
    };
    Placement {
        up: in_file(DVec3::Y),
        facing: in_file(DVec3::Z),
        metres_per_unit: prepared.person_from_scene.scale,
        height: prepared.height,
        height_given,
    }
}
