//! The whole way from a scene to an avatar, and what is told of it.

use crate::RigError;
use crate::bind::{BindOptions, BindReport, Bound, bind};
use crate::body::{BodyModel, FitReport, Hint, Observed, Registered, register};
use crate::figures::coverage::{self, Coverage, coverage};
use crate::figures::likeness::{person_psnr, six_views};
use crate::finish::{FinishOptions, JointPose, Material, Poser, avatar};
use crate::prepare::{self, Networks, Prepared, Similarity, prepare};
use crate::scan::Scan;
use crate::shell::{Hands, ShellOptions, ShellReport, Textures, complete};
use crate::sight::Sight;
use crate::surface::look;
use glam::{DVec3, Vec3};
use serde::Serialize;
use splat_scene::{Scene, UpAxis};
use spmm3::{Avatar, JOINTS, Joint, MotionParams};
use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

/// What a user may decide about a rig.
#[derive(Debug, Clone)]
pub struct RigOptions {
    /// The folder of MakeHuman's raw material.
    pub makehuman: PathBuf,
    /// The person's height, metres; nothing: an adult's mean.
    pub height: Option<f64>,
    /// Opposite corners of the box that holds the person, in the file's own units and axes; nothing: found.
    pub within: Option<[[f32; 3]; 2]>,
    /// Which axis of the file points up; nothing: found.
    pub up: Option<UpAxis>,
    /// Joints whose places are known, in the file's own units and axes.
    pub joints: Vec<(Joint, Vec3)>,
    /// Whether what the person holds or wears is recognised, and moves as one piece.
    pub accessories: bool,
    /// The hands: left, right.
    pub hands: [Hands; 2],
    /// Name, licence and size of the avatar.
    pub finish: FinishOptions,
}

/// The steps of a rig, in their order.
pub const STEPS: [&str; 6] = [
    "finding the person",
    "measuring the surface",
    "fitting the body model",
    "binding the Gaussians",
    "completing face and hands",
    "assembling the avatar",
];

/// What is known of one joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFigures {
    /// SMPL-X's name.
    pub name: &'static str,
    /// Where it is in the scan, metres, in the person's space.
    pub position: [f64; 3],
    /// How sure that is, 0..=1.
    pub confidence: f64,
}

/// The time of one step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepSeconds {
    /// Its name, of [`STEPS`].
    pub step: &'static str,
    /// Seconds.
    pub seconds: f64,
}

/// How well the body model fits.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct FitFigures {
    /// Root mean square distance of the surface from the posed and shaped model, metres.
    pub surface: f64,
    /// Root mean square miss of the body's landmarks, metres.
    pub key_points: f64,
    /// Median distance of the displaced model from the surface, metres.
    pub displaced: f64,
    /// Median distance of the face's landmarks from their vertices, metres; none without a face.
    pub face: Option<f64>,
}

/// How good the avatar is: measured on demand, by [`measure`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Peak signal-to-noise ratio of the avatar in the scan's pose against the scan, over the person, dB: six views from the front on, counter-
    /// clockwise seen from above.
    pub scan_db: Vec<f64>,
    /// How the Gaussians cover the body in the scan's pose.
    pub scan_pose: Coverage,
    /// How they cover it in T-pose.
    pub t_pose: Coverage,
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let views: Vec<String> = self.scan_db.iter().map(|db| format!("{db:.1}")).collect();
        let mean = self.scan_db.iter().sum::<f64>() / self.scan_db.len().max(1) as f64;
        write!(
            f,
            "in the scan's pose {mean:.1} dB against the scan ({})",
            views.join(" ")
        )?;
        for (pose, covers) in [("there", &self.scan_pose), ("in T-pose", &self.t_pose)] {
            let Coverage { spill, holes } = covers;
            let (spill, holes) = (spill * 100.0, holes * 100.0);
            write!(f, "; {pose} spill {spill:.2} %, holes {holes:.2} %")?;
        }
        Ok(())
    }
}

/// What a rig found and measured.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RigReport {
    /// Gaussians of the scene.
    pub scene_gaussians: usize,
    /// Gaussians of the avatar.
    pub gaussians: usize,
    /// Vertices of the template.
    pub vertices: usize,
    /// The joints of the body, without the fingers'.
    pub joints: Vec<JointFigures>,
    /// How well the body model fits.
    pub fit: FitFigures,
    /// What binding did.
    pub bind: BindReport,
    /// What completing did.
    pub shell: ShellReport,
    /// How good the avatar is, where that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
    /// What the user should look at, in words.
    pub warnings: Vec<String>,
    /// The steps' times.
    pub steps: Vec<StepSeconds>,
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

/// Tells which step begins, and how long each took.
struct Steps<'a> {
    told: &'a dyn Fn(&'static str),
    current: Option<(&'static str, Instant)>,
    done: Vec<StepSeconds>,
}

impl<'a> Steps<'a> {
    fn new(told: &'a dyn Fn(&'static str)) -> Self {
        Self {
            told,
            current: None,
            done: Vec::new(),
        }
    }

    fn begin(&mut self, step: usize) {
        self.end();
        if let Some(step) = STEPS.get(step).copied() {
            (self.told)(step);
            self.current = Some((step, Instant::now()));
        }
    }

    fn end(&mut self) {
        if let Some((step, began)) = self.current.take() {
            let seconds = began.elapsed().as_secs_f64();
            log::debug!("{step}: {seconds:.2} s");
            self.done.push(StepSeconds { step, seconds });
        }
    }
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
    let mut steps = Steps::new(told);
    steps.begin(0);
    let prepared = prepared(scene, options, sight, networks)?;
    steps.begin(1);
    let seen = look(&prepared.scan);
    steps.begin(2);
    let model = BodyModel::load(&options.makehuman)?;
    let hints: Vec<Hint> = (options.joints.iter())
        .map(|(joint, place)| Hint {
            joint: *joint,
            position: (prepared.person_from_scene).point(scene.point_of_file(*place).as_dvec3()),
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
    steps.begin(3);
    let choices = BindOptions {
        accessories: options.accessories,
        ..BindOptions::default()
    };
    let mut bound = bind(&prepared.scan, &seen, &model, &registered, &choices)?;
    drop(seen);
    steps.begin(4);
    let textures = Textures::load(&options.makehuman)?;
    let choices = ShellOptions {
        hands: options.hands,
        ..ShellOptions::default()
    };
    let shell = complete(&mut bound, &model, &registered, &textures, &choices)?;
    steps.begin(5);
    let finished = finished(&bound, &model, &registered, &shell, &options.finish)?;
    steps.end();
    let report = RigReport {
        scene_gaussians: scene.len(),
        gaussians: finished.avatar.gaussians.len(),
        vertices: finished.avatar.template.vertices().len(),
        joints: joint_figures(&registered),
        warnings: warnings(&prepared, &fit),
        fit: FitFigures {
            surface: fit.surface,
            key_points: fit.key_points,
            displaced: fit.displaced,
            face: fit.face,
        },
        bind: bound.report.clone(),
        shell,
        quality: None,
        steps: steps.done,
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

fn prepared(
    scene: &Scene,
    options: &RigOptions,
    sight: &mut Sight,
    networks: &mut Networks,
) -> Result<Prepared, RigError> {
    let choices = prepare::Options {
        height: options.height,
        within: options.within,
        up: options.up,
    };
    prepare(scene, &choices, sight, networks)
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

fn joint_figures(registered: &Registered) -> Vec<JointFigures> {
    (Joint::ALL.into_iter().take(Joint::Jaw.index()))
        .map(|joint| JointFigures {
            name: joint.name(),
            position: registered.joints[joint.index()].to_array(),
            confidence: registered.confidence[joint.index()],
        })
        .collect()
}

fn warnings(prepared: &Prepared, fit: &FitReport) -> Vec<String> {
    let all = prepared.figures.doubts.iter().chain(&fit.warnings);
    all.cloned().collect()
}

/// Measures an avatar: against its scan, and how it covers the body. Takes seconds.
///
/// # Errors
/// None that a finished rig could cause.
pub fn measure(rigged: &Rigged) -> Result<Quality, RigError> {
    let poser = Poser::new(&rigged.avatar)?;
    let views = six_views(rigged.height);
    let again = poser.scan(&rigged.scan_motion)?;
    let faces = rigged.avatar.template.faces();
    let faces = faces.get(..rigged.body_faces).unwrap_or(faces);
    // What is held stands beside the body, and has every right to.
    let of_body: Vec<bool> = (rigged.avatar.gaussians.triangles().iter())
        .map(|triangle| (*triangle as usize) < rigged.model_faces)
        .collect();
    let covers = |scan: &Scan, motion: &MotionParams| {
        let scan = scan.filtered(&of_body);
        let vertices: Vec<DVec3> = (poser.vertices(motion).iter())
            .map(|v| v.as_dvec3())
            .collect();
        let views = coverage::views(&vertices, 6);
        coverage(&scan, &vertices, faces, &views)
    };
    let straight = MotionParams::default();
    Ok(Quality {
        scan_db: person_psnr(&rigged.scan, &again, &views),
        scan_pose: covers(&again, &rigged.scan_motion),
        t_pose: covers(&poser.scan(&straight)?, &straight),
    })
}
