//! What the person does: a motion from a file or the built-in one, sampled at the motion rate.

use anyhow::{Context, bail};
use glam::{Quat, Vec3};
use spmm3::{Avatar, Joint, MotionParams};
use spmm3::{LOOP_SECONDS, LoadOptions, MotionClip, Playback};
use std::ffi::OsString;
use std::path::Path;

/// Motion frames per second that are sent. The paper's receiver deforms at this rate; its sender captures about 58.
pub const MOTION_RATE: f64 = 30.0;

/// The motion that needs no file.
const BUILT_IN: &str = "built-in";

/// Most frames of one run: 11 minutes at 30 Hz, 18 MB in memory.
const MOST_FRAMES: usize = 20_000;

/// Options that choose a motion.
#[derive(Debug, Clone, clap::Args)]
pub struct MotionOptions {
    /// A .bvh or SMPL-X/AMASS .npz file, or built-in
    #[arg(long, value_name = "FILE", default_value = "built-in")]
    motion: String,
    /// Metres per unit of the .bvh file [default: found out from the skeleton's size]
    #[arg(long, value_name = "METRES")]
    bvh_scale: Option<f32>,
    /// Frames of the motion at 30 Hz to show, e.g. 0..90, 90 or 30.. [default: all]
    #[arg(long, value_name = "A..B|N", value_parser = parse_range)]
    frames: Option<(usize, Option<usize>)>,
}

/// A motion at 30 Hz.
#[derive(Debug)]
pub struct Performance {
    /// What it is called.
    pub name: String,
    /// One each 30th of a second.
    pub frames: Vec<MotionParams>,
}

impl MotionOptions {
    /// Whether any of the options was given.
    pub(crate) fn is_given(&self) -> bool {
        self.motion != BUILT_IN || self.bvh_scale.is_some() || self.frames.is_some()
    }

    /// How many frames were asked for, if their number is known without the motion.
    pub(crate) fn count(&self) -> Option<usize> {
        let (first, end) = self.frames?;
        Some(end? - first)
    }

    /// What it is called: a file or built-in.
    pub fn name(&self) -> &str {
        &self.motion
    }

    /// The same choice as arguments for another process.
    pub fn arguments(&self) -> Vec<OsString> {
        let mut arguments = vec!["--motion".into(), (&self.motion).into()];
        if let Some(scale) = self.bvh_scale {
            arguments.extend(["--bvh-scale".into(), scale.to_string().into()]);
        }
        if let Some((first, end)) = self.frames {
            let end = end.map_or_else(String::new, |end| end.to_string());
            arguments.extend(["--frames".into(), format!("{first}..{end}").into()]);
        }
        arguments
    }

    /// Refuses a motion file that is not there, before anything long begins.
    pub fn check(&self) -> anyhow::Result<()> {
        if self.motion != BUILT_IN && !Path::new(&self.motion).is_file() {
            bail!(
                "cannot use the motion {}: there is no such file",
                self.motion
            );
        }
        Ok(())
    }

    /// Loads the motion and fits it to `avatar`'s skeleton; what is built in has `built_in_rate` frames a second, a file's motion its own.
    pub fn clip(&self, avatar: &Avatar, built_in_rate: f64) -> anyhow::Result<MotionClip> {
        let mut clip = if self.motion == BUILT_IN {
            MotionClip::built_in(
                &avatar.skeleton,
                &avatar.expressions,
                LOOP_SECONDS,
                built_in_rate,
            )
            .context("cannot perform the built-in motion")?
        } else {
            let options = LoadOptions {
                bvh_scale: self.bvh_scale,
            };
            MotionClip::load(Path::new(&self.motion), &avatar.skeleton, &options)
                .with_context(|| format!("cannot use the motion {}", self.motion))?
        };
        if let Some(line) = clip.fit_expression(&avatar.expression_basis, &avatar.expressions) {
            println!("{}: {line}", clip.name);
        }
        if let Some(unmapped) = clip.unmapped_summary() {
            println!("{}: {unmapped}", clip.name);
        }
        for note in &clip.notes {
            log::info!("{}: {note}", clip.name);
        }
        if let Some((first, end)) = self.frames {
            let count = frames_at_motion_rate(&clip);
            let end = end.unwrap_or(count).min(count);
            if first >= end {
                let name = &clip.name;
                bail!("no frame at {first}: the motion {name} has the frames 0..{count} at 30 Hz");
            }
            clip.frames = (first..end)
                .map(|k| clip.sample(k as f64 / MOTION_RATE, Playback::Clamp))
                .collect();
            clip.frame_seconds = 1.0 / MOTION_RATE;
        }
        Ok(clip)
    }

    /// Loads the motion, fits it to `avatar`'s skeleton and samples it at 30 Hz.
    pub fn load(&self, avatar: &Avatar) -> anyhow::Result<Performance> {
        Performance::of(&self.clip(avatar, MOTION_RATE)?)
    }
}

impl Performance {
    /// The clip sampled at 30 Hz.
    pub(crate) fn of(clip: &MotionClip) -> anyhow::Result<Self> {
        let count = frames_at_motion_rate(clip);
        if count > MOST_FRAMES {
            bail!(
                "the motion {} has {count} frames at 30 Hz: choose at most {MOST_FRAMES} with --frames A..B",
                clip.name
            );
        }
        let frames = (0..count)
            .map(|k| clip.sample(k as f64 / MOTION_RATE, Playback::Clamp))
            .collect();
        Ok(Self {
            name: clip.name.clone(),
            frames,
        })
    }
}

/// At least one.
fn frames_at_motion_rate(clip: &MotionClip) -> usize {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a clip's frames fit memory"
    )]
    let count = (clip.duration() * MOTION_RATE).round() as usize;
    count.max(1)
}

impl Performance {
    /// Each frame's motion with the floor point that a camera keeps to.
    pub(crate) fn followed<'a>(
        &'a self,
        avatar: &Avatar,
    ) -> impl ExactSizeIterator<Item = (&'a MotionParams, Vec3)> {
        self.frames.iter().zip(self.path(avatar))
    }

    /// Where the person stands in each frame: metres on the floor, low-passed so that a camera that follows does not
    /// sway with every step.
    fn path(&self, avatar: &Avatar) -> Vec<Vec3> {
        /// Share of the way to the person that the camera makes up in one frame at 30 Hz.
        const FOLLOW: f32 = 0.12;
        let pelvis = avatar.skeleton.rest_positions()[Joint::Pelvis.index()];
        let floor = |m: &MotionParams| Vec3::new(1.0, 0.0, 1.0) * (m.root_translation + pelvis);
        let mut at = self.frames.first().map_or(Vec3::ZERO, floor);
        let mut follow = |m: &MotionParams| {
            at += (floor(m) - at) * FOLLOW;
            at
        };
        self.frames.iter().map(&mut follow).collect()
    }

    /// Where the person first stands, on the floor.
    pub fn start(&self, avatar: &Avatar) -> Vec3 {
        self.path(avatar).first().copied().unwrap_or_default()
    }

    /// Which way the person faces on average, as a turn about y from +z.
    pub fn heading(&self) -> Quat {
        let forward: Vec3 = self
            .frames
            .iter()
            .map(|m| m.rotation(Joint::Pelvis) * Vec3::Z)
            .sum();
        Quat::from_rotation_y(forward.x.atan2(forward.z))
    }
}

fn parse_range(text: &str) -> Result<(usize, Option<usize>), String> {
    // A number alone is how many, from the beginning.
    let (first, end) = text.split_once("..").unwrap_or(("", text));
    if first.is_empty() && end.is_empty() && text.is_empty() {
        return Err("write A..B or a number of frames, e.g. 0..90 or 90".to_owned());
    }
    let number = |text: &str| {
        text.parse::<usize>()
            .map_err(|_| format!("{text} is not a frame number"))
    };
    let first = if first.is_empty() { 0 } else { number(first)? };
    let end = if end.is_empty() {
        None
    } else {
        Some(number(end)?)
    };
    if end.is_some_and(|end| end <= first) {
        return Err(format!("{text} holds no frame"));
    }
    Ok((first, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_ranges_may_be_open_at_either_side() {
        assert_eq!(parse_range("3..9"), Ok((3, Some(9))));
        assert_eq!(parse_range("..9"), Ok((0, Some(9))));
        assert_eq!(parse_range("3.."), Ok((3, None)));
        assert_eq!(parse_range("300"), Ok((0, Some(300))), "how many");
        assert!(parse_range("").is_err(), "nothing");
        assert!(parse_range("9..3").is_err(), "an empty range");
        assert!(parse_range("three").is_err(), "no range at all");
    }
}
