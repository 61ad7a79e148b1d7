//! The whole way from a scene to an avatar, and what is told of it.

mod fitted;
mod report;
mod steps;

pub use fitted::{Fitted, fitted};
pub use report::{FitFigures, HintFigures, JointFigures, Placement, Quality, RigReport};
pub use steps::STEPS;

use crate::RigError;
use crate::bind::{BindOptions, Bound, bind};
use crate::body::posing::JointPose;
use crate::body::{BodyModel, Registered};
use crate::figures::coverage::{self, Coverage, coverage};
use crate::figures::likeness::{person_psnr, six_views};
use crate::finish::{FinishOptions, Material, Poser, avatar};
use crate::prepare::{self, Networks, Similarity};
use crate::scan::Scan;
use crate::shell::{Hands, ShellOptions, ShellReport, Textures, complete};
use crate::sight::Sight;
use glam::DVec3;
use splat_scene::Scene;
use spmm3::{Avatar, JOINTS, Joint, MotionParams};
use std::path::PathBuf;
use steps::Steps;

/// What a user may decide about a rig.
#[derive(Debug, Clone)]
pub struct RigOptions {
    /// The folder of MakeHuman's raw material.
    pub makehuman: PathBuf,
    /// What is known of the person and of the file's axes.
    pub person: prepare::Options,
    /// Whether what the person holds or wears is recognised, and moves as one piece.
    pub accessories: bool,
    /// The hands: left, right.
    pub hands: [Hands; 2],
    /// Name, licence and size of the avatar.
    pub finish: FinishOptions,
}

/// An avatar, the pose of its scan, and what is told of it.
#[derive(Debug, Clone)]
pub struct Rigged {
    /// The avatar.
    pub avatar: Avatar,
    /// The motion that poses it as the scan stands.
    pub scan_motion: MotionParams,
    /// The person's own Gaussians, cut out and upright, as they were before they were bound.
    pub scan: Scan,
    /// From the scene's axes and units to the person's space.
    pub person_from_scene: Similarity,
    /// The joints in the pose of the scan, metres, in the person's space.
    pub joints: [DVec3; JOINTS],
    /// The template's triangles that are the body's own: those of eyes, teeth, tongue and accessories follow.
    pub body_faces: usize,
    /// The template's triangles that are the body model's: those of accessories follow.
    pub model_faces: usize,
    /// The person's height, metres.
    pub height: f64,
    /// What was found and measured.
    pub report: RigReport,
}

/// Makes an avatar of the one person in `scene`. `told` is called with the name of each step (of [`STEPS`]) as it begins.
///
/// # Errors
/// If the scene is no scan of one whole person (the error says what to do), or a network or the renderer fails.
pub fn rig(
    scene: &Scene,
    options: &RigOptions,
    sight: &mut Sight,
    networks: &mut Networks,
    told: &dyn Fn(&'static str),
) -> Result<Rigged, RigError> {
    rigged(
        fitted(scene, options, sight, networks, told)?,
        options,
        told,
    )
}

/// The second half of [`rig`]: binds the Gaussians and completes the avatar.
///
/// # Errors
/// As [`rig`].
pub fn rigged(
    fitted: Fitted,
    options: &RigOptions,
    told: &dyn Fn(&'static str),
) -> Result<Rigged, RigError> {
    let Fitted {
        prepared,
        seen,
        model,
        registered,
        fit,
        scene_gaussians,
        placement,
        steps,
    } = fitted;
    let mut steps = Steps::after(steps, told);
    let mut bound = steps.run(|| {
        let choices = BindOptions {
            accessories: options.accessories,
        };
        bind(&prepared.scan, &seen, &model, &registered, &choices)
    })?;
    drop(seen);
    let shell = steps.run(|| {
        let textures = Textures::load(&options.makehuman)?;
        let choices = ShellOptions {
            hands: options.hands,
            ..ShellOptions::default()
        };
        complete(&mut bound, &model, &registered, &textures, &choices)
    })?;
    let finished = steps.run(|| finished(&bound, &model, &registered, &shell, &options.finish))?;
    let report = RigReport {
        scene_gaussians,
        all_gaussians: bound.scan.len(),
        gaussians: finished.avatar.gaussians.len(),
        vertices: finished.avatar.template.vertices().len(),
        joints: JointFigures::of(&registered),
        warnings: [prepared.figures.doubts.clone(), fit.warnings].concat(),
        placement,
        fit: FitFigures {
            surface: fit.surface,
            key_points: fit.key_points,
            displaced: fit.displaced,
            face: fit.face,
        },
        hints: fit.hints.iter().map(HintFigures::of).collect(),
        prepare: prepared.figures,
        bind: bound.report.clone(),
        shell,
        quality: None,
        steps: steps.done(),
    };
    Ok(Rigged {
        avatar: finished.avatar,
        scan_motion: finished.scan_motion,
        scan: prepared.scan,
        person_from_scene: prepared.person_from_scene,
        joints: registered.joints,
        body_faces: skin_faces(&model),
        model_faces: model.faces.len(),
        height: prepared.height,
        report,
    })
}

/// Assembles the avatar of what was bound and completed.
fn finished(
    bound: &Bound,
    model: &BodyModel,
    registered: &Registered,
    shell: &ShellReport,
    options: &FinishOptions,
) -> Result<crate::finish::Finished, RigError> {
    let mut scan_pose = JointPose::of_scan(registered);
    let mut tpose = JointPose::t_pose(model, registered);
    // Eyes turn about the middle of the eyeballs that were made.
    let head = Joint::Head.index();
    let to_tpose = tpose.maps_from(&scan_pose);
    for (joint, eye) in [Joint::LeftEye, Joint::RightEye]
        .into_iter()
        .zip(&shell.eyeballs)
    {
        if let Some(eye) = eye {
            let joint = joint.index();
            scan_pose.rotations[joint] = scan_pose.rotations[head];
            tpose.rotations[joint] = tpose.rotations[head];
            scan_pose.joints[joint] = eye.centre;
            tpose.joints[joint] = to_tpose[head].transform_point3(eye.centre);
        }
    }
    let (expressions, presets) = model.expressions();
    let casters: Vec<[u32; 3]> = (model.faces.iter())
        .filter(|face| {
            let outer = |v: &u32| model.outer.get(*v as usize).copied().unwrap_or(false);
            face.iter().all(outer)
        })
        .copied()
        .collect();
    avatar(
        &Material {
            scan: &bound.scan,
            triangles: &bound.triangles,
            vertices: &bound.mesh.vertices,
            faces: &bound.mesh.faces,
            weights: &bound.mesh.weights,
            body_vertices: model.body_vertices,
            scan_pose: &scan_pose,
            tpose: &tpose,
            expressions: &expressions,
            presets: &presets,
            scale: registered.scale,
            casters: &casters,
        },
        options,
    )
}

/// The faces before the first that is not of the body's own vertices.
fn skin_faces(model: &BodyModel) -> usize {
    let own = |face: &[u32; 3]| face.iter().all(|v| (*v as usize) < model.body_vertices);
    model.faces.iter().take_while(|face| own(face)).count()
}

/// Measures an avatar: against its scan, and how it covers the body. Takes seconds.
///
/// # Errors
/// None that a finished rig could cause.
pub fn measure(rigged: &Rigged) -> Result<Quality, RigError> {
    let poser = Poser::new(&rigged.avatar)?;
    let again = poser.scan(&rigged.scan_motion)?;
    let straight = MotionParams::default();
    Ok(Quality {
        scan_db: person_psnr(&rigged.scan, &again, &six_views(rigged.height)),
        scan_pose: covers(rigged, &poser, &again, &rigged.scan_motion),
        t_pose: covers(rigged, &poser, &poser.scan(&straight)?, &straight),
    })
}

/// How an avatar covers its body in motion, the mean over `motions`. Takes a second for each.
///
/// # Errors
/// None that a finished rig could cause.
pub fn measure_motion(rigged: &Rigged, motions: &[MotionParams]) -> Result<Coverage, RigError> {
    let poser = Poser::new(&rigged.avatar)?;
    let of_motions: Vec<Coverage> = (motions.iter())
        .map(|motion| Ok(covers(rigged, &poser, &poser.scan(motion)?, motion)))
        .collect::<Result<_, RigError>>()?;
    Ok(Coverage::mean(&of_motions))
}

/// How an avatar covers its body in a motion; `scan` are its Gaussians in it.
fn covers(rigged: &Rigged, poser: &Poser<'_>, scan: &Scan, motion: &MotionParams) -> Coverage {
    let faces = rigged.avatar.template.faces();
    let faces = faces.get(..rigged.body_faces).unwrap_or(faces);
    // What is held stands beside the body, and has every right to; what it hides is no hole.
    let of_body: Vec<bool> = (rigged.avatar.gaussians.triangles().iter())
        .map(|triangle| (*triangle as usize) < rigged.model_faces)
        .collect();
    let vertices: Vec<DVec3> = (poser.vertices(motion).iter())
        .map(|v| v.as_dvec3())
        .collect();
    let views = coverage::views(&vertices, 6);
    let body = coverage(&scan.filtered(&of_body), &vertices, faces, &views);
    Coverage {
        holes: coverage(scan, &vertices, faces, &views).holes,
        ..body
    }
}
