//! `mon3tr-dev eval capture`: an avatar's renders and real footage, tracked, against truth.

use super::fit_by::FitBy;
use super::observations::Keeper;
use super::renders::{self, RATE, Take};
use super::score::{Posed, Scores, score};
use super::table::{self, Row};
use super::{footage, kept, motions};
use anyhow::Context;
use mon3tr::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use mon3tr::device_options::{DeviceOptions, make_folder};
use mon3tr::report::{check_writable, write_json};
use mon3tr::stills::load_avatar;
use motion_fit::{Fitted, Subject};
use spmm3::{Avatar, LOOP_SECONDS, LoadOptions, MotionClip};
use std::path::PathBuf;
use std::time::Instant;
use tracker::mediapipe::BodyBy;

/// Frames at the beginning of a motion that are not counted: the person is being found.
const FINDING: usize = 5;

/// Options of `eval capture`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// The avatar that is drawn and tracked [default: the demo's]
    #[arg(long, value_name = "PACKAGE")]
    avatar: Option<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
    /// Another motion to draw, .bvh or .npz; may be given several times
    #[arg(long, value_name = "FILE")]
    motion: Vec<PathBuf>,
    /// Seconds of each motion, at most
    #[arg(long, value_name = "SECONDS", default_value = "4")]
    seconds: f64,
    /// Which networks see the body, as of track: full, heavy, or both and their mean. ./run fetches the heavy one (52 MB) when it is asked for
    #[arg(long, value_name = "full|heavy|both", default_value = BodyBy::Full.name())]
    body: BodyBy,
    /// Keep what the networks saw in this folder, and where it is there already, neither draw nor look: for work on the fit
    #[arg(long, value_name = "FOLDER")]
    observations: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    if let Some(folder) = &options.observations {
        make_folder(folder)?;
    }
    let package = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let (avatar, _) = load_avatar(&package)?;
    let mut clips = vec![MotionClip::built_in(
        &avatar.skeleton,
        &avatar.expressions,
        LOOP_SECONDS,
        RATE,
    )?];
    clips.extend(motions::made(&avatar, options.seconds));
    for file in &options.motion {
        let mut clip = MotionClip::load(file, &avatar.skeleton, &LoadOptions::default())
            .with_context(|| format!("cannot use the motion {}", file.display()))?;
        if let Some(line) = clip.fit_expression(&avatar.expression_basis, &avatar.expressions) {
            println!("{}: {line}", clip.name);
        }
        clips.push(clip);
    }
    let takes = renders::takes(&avatar, &clips, options.seconds)?;
    let mut rows = Vec::new();
    let contents = kept::package(&package)?;
    let mut keeper = Keeper::new(
        options.observations.as_deref(),
        &contents,
        options.body,
        device,
    );
    for take in &takes {
        let seen = keeper.take(take, &avatar)?;
        let subject = Subject::from(&*avatar);
        let pinhole = renders::pinhole(&take.camera);
        for by in FitBy::ALL {
            let fit_began = Instant::now();
            let fitted = by.fit(&subject, pinhole, &seen);
            let fit_ms = fit_began.elapsed().as_secs_f64() * 1e3 / seen.len().max(1) as f64;
            let row = Row {
                motion: take.motion.clone(),
                camera: take.camera_name,
                by,
                scores: compare(&avatar, take, &fitted),
                fit_ms,
            };
            table::print_scores(&row);
            rows.push(row);
        }
    }
    for by in FitBy::ALL {
        table::print_summary(by, &rows);
    }
    keeper.times().print();
    let footage = footage::evaluate(&avatar, &mut keeper)?;
    footage.print();
    write_json(
        options.json.as_deref(),
        &serde_json::json!({
            "renders": rows,
            "footage": footage,
            "stages": keeper.times(),
        }),
    )
}

fn compare(avatar: &Avatar, take: &Take, fitted: &[Fitted]) -> Scores {
    let pinhole = renders::pinhole(&take.camera);
    let sight = renders::sight_from_room(&take.camera);
    let truth: Vec<Posed> = (take.frames.iter())
        .map(|motion| renders::posed(avatar, motion, sight, &pinhole))
        .collect();
    let tracked: Vec<Option<Posed>> = (fitted.iter())
        .map(|fitted| {
            fitted
                .sees_person
                .then(|| renders::posed(avatar, &fitted.motion, fitted.camera_from_room, &pinhole))
        })
        .collect();
    score(&truth, &tracked, RATE, FINDING)
}
