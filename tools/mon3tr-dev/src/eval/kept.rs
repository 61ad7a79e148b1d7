//! What networks saw, as JSON: the fit can be worked on without drawing and looking again.

use anyhow::Context;
use glam::{Vec2, Vec3};
use motion_fit::landmarks::{
    BODY_LANDMARKS, BodyLandmarks, BodyPoint, FACE_LANDMARKS, FaceLandmarks, HAND_LANDMARKS,
    HandLandmarks, Observation,
};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use spmm3::MotionParams;
use std::path::Path;

/// Names and contents of the networks in `folder` that look at pictures, as a short text: two folders with the same text see the same.
pub(super) fn networks(folder: &Path, names: &[&str]) -> anyhow::Result<String> {
    let mut all = Sha256::new();
    for name in names {
        let file = folder.join(format!("{name}.tflite"));
        let bytes =
            std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
        all.update(name);
        all.update(Sha256::digest(&bytes));
    }
    Ok(format!("{} ({})", names.join(", "), short(all)))
}

/// An avatar's package, by its contents.
pub(super) fn package(file: &Path) -> anyhow::Result<String> {
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    Ok(short(Sha256::new_with_prefix(bytes)))
}

/// A motion, by its frames.
pub(super) fn motion(frames: &[MotionParams]) -> String {
    let mut all = Sha256::new();
    for frame in frames {
        all.update(bytemuck::cast_slice::<f32, u8>(frame.values()));
        all.update(bytemuck::bytes_of(&frame.root_translation.to_array()));
    }
    short(all)
}

fn short(hash: Sha256) -> String {
    (hash.finalize().iter().take(8))
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// What was seen in one motion's pictures.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct KeptFile {
    /// The avatar and the length of the motions that were drawn.
    pub(super) of: String,
    /// The networks that looked, as [`networks`] names them; nothing in a file from before they were named.
    #[serde(default)]
    pub(super) networks: String,
    pub(super) frames: Vec<Kept>,
}

/// One [`Observation`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Kept {
    seconds: f64,
    /// Pixel, metres, confidence of each landmark.
    body: Option<Vec<[f32; 6]>>,
    hands: [Option<KeptHand>; 2],
    face: Option<KeptFace>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct KeptHand {
    confidence: f32,
    /// Pixel and metres of each landmark.
    points: Vec<[f32; 5]>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct KeptFace {
    confidence: f32,
    points: Vec<[f32; 3]>,
}

impl From<&Observation> for Kept {
    fn from(seen: &Observation) -> Self {
        let body = seen.body_landmarks().map(|body| {
            let point = |p: &BodyPoint| {
                let (u, m) = (p.pixel, p.metres);
                [u.x, u.y, m.x, m.y, m.z, p.confidence]
            };
            body.points.iter().map(point).collect()
        });
        let hand = |hand: &HandLandmarks| KeptHand {
            confidence: hand.confidence,
            points: (hand.pixels.iter().zip(&hand.metres))
                .map(|(u, m)| [u.x, u.y, m.x, m.y, m.z])
                .collect(),
        };
        let face = seen.face_landmarks().map(|face| KeptFace {
            confidence: face.confidence,
            points: face.points.iter().map(Vec3::to_array).collect(),
        });
        Self {
            seconds: seen.seconds,
            body,
            hands: seen.hand_landmarks().map(|one| one.map(hand)),
            face,
        }
    }
}

impl From<&Kept> for Observation {
    fn from(kept: &Kept) -> Self {
        let body = kept.body.as_ref().map(|from| {
            let mut points = [BodyPoint::default(); BODY_LANDMARKS];
            for (to, [u, v, x, y, z, confidence]) in points.iter_mut().zip(from) {
                *to = BodyPoint {
                    pixel: Vec2::new(*u, *v),
                    metres: Vec3::new(*x, *y, *z),
                    confidence: *confidence,
                };
            }
            BodyLandmarks { points }
        });
        let hand = |from: &KeptHand| {
            let mut hand = HandLandmarks {
                pixels: [Vec2::ZERO; HAND_LANDMARKS],
                metres: [Vec3::ZERO; HAND_LANDMARKS],
                confidence: from.confidence,
            };
            let both = hand.pixels.iter_mut().zip(&mut hand.metres);
            for ((pixel, metres), [u, v, x, y, z]) in both.zip(&from.points) {
                *pixel = Vec2::new(*u, *v);
                *metres = Vec3::new(*x, *y, *z);
            }
            hand
        };
        let face = kept.face.as_ref().map(|from| {
            let mut points = Box::new([Vec3::ZERO; FACE_LANDMARKS]);
            for (to, from) in points.iter_mut().zip(&from.points) {
                *to = Vec3::from_array(*from);
            }
            FaceLandmarks {
                points,
                confidence: from.confidence,
            }
        });
        Self {
            seconds: kept.seconds,
            body: body.map(Into::into),
            hands_skipped: [false; 2],
            hands: (kept.hands.each_ref()).map(|one| one.as_ref().map(hand).map(Into::into)),
            face: face.map(Into::into),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_networks_have_another_text_and_missing_ones_an_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).expect("written");
        };
        write("body.tflite", b"one");
        write("face.tflite", b"two");
        let of = |names: &[&str]| networks(folder.path(), names).expect("there");
        let before = of(&["body", "face"]);
        assert_eq!(before, of(&["body", "face"]), "the same again");
        assert_ne!(before, of(&["body"]), "fewer");
        write("face.tflite", b"three");
        assert_ne!(before, of(&["body", "face"]), "another face");
        assert!(before.starts_with("body, face ("), "{before}");
        let missing = networks(folder.path(), &["hand"]).expect_err("no such file");
        assert!(
            format!("{missing:#}").contains("hand.tflite"),
            "{missing:#}"
        );
    }
}
