//! Which way is up in a scene, as `--up` says it.

use anyhow::anyhow;
use glam::Quat;
use serde::Serialize;
use splat_scene::cameras::Cameras;
use splat_scene::{Scene, UpAxis};
use std::path::Path;
use std::str::FromStr;

/// An axis of the scene's file, or what can be found out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum UpChoice {
    /// What the file states, its cameras or its ground show, or its format usually has.
    #[default]
    Auto,
    /// This one.
    Axis(UpAxis),
}

impl std::fmt::Display for UpChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Axis(axis) => axis.fmt(f),
        }
    }
}

impl FromStr for UpChoice {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let axis: Result<UpAxis, _> = text.parse();
        axis.map(Self::Axis)
            .map_err(|error| anyhow!("{error}, or auto"))
    }
}

/// What is told of a scene's up.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct UpFigures {
    /// The axis of the file that points up.
    pub(crate) up: String,
    /// How that is known.
    pub(crate) up_from: String,
}

/// A scene's up, and the turn about the origin that its cameras take with it.
pub(crate) struct Raised {
    pub(crate) up: UpFigures,
    pub(crate) turn: Quat,
}

impl UpChoice {
    /// Turns a scene as it was read from `file` upright. Its cameras are those of the file `cameras`, else of the
    /// cameras.json that 3DGS left with it.
    pub(crate) fn raise(
        self,
        scene: &mut Scene,
        file: &Path,
        cameras: Option<&Path>,
    ) -> anyhow::Result<Raised> {
        let (axis, up_from) = match self {
            Self::Axis(axis) => (axis, "as --up says".to_owned()),
            Self::Auto => {
                let cameras = match cameras {
                    Some(cameras) => Some(Cameras::load(cameras)?),
                    None => cameras_beside(file),
                };
                let detected = scene.detect_up(cameras.as_ref());
                (detected.axis, detected.evidence.to_string())
            }
        };
        let turn = scene.turn_up(axis);
        let up = axis.to_string();
        log::info!("{}: {up} is up, {up_from}", file.display());
        Ok(Raised {
            up: UpFigures { up, up_from },
            turn,
        })
    }
}

/// The cameras that lie with a scene, unless they cannot be read: they were not asked for.
fn cameras_beside(file: &Path) -> Option<Cameras> {
    let cameras = Cameras::beside(file)?;
    Cameras::load(&cameras)
        .inspect_err(|error| log::warn!("the scene's cameras are passed over: {error}"))
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_up_is_auto_or_an_axis() {
        for text in ["auto", "+x", "-x", "+y", "-y", "+z", "-z"] {
            let choice: UpChoice = text.parse().expect("an up");
            assert_eq!(choice.to_string(), text, "comes back");
        }
        for text in ["", "up", "z", "+w", "--y"] {
            let error = text.parse::<UpChoice>().expect_err("no up");
            let error = error.to_string();
            assert!(
                error.contains("+z and -z") && error.contains("auto"),
                "{error}"
            );
        }
    }
}
