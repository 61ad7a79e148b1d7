//! Which way is up in a scan of a person: where a network sees a person who stands.

use super::landmarks::{ANKLES, HIPS, KNEES, NOSE, SHOULDERS};
use super::networks::Networks;
use super::views::Subject;
use crate::RigError;
use crate::sight::Sight;
use glam::{DVec2, DVec3};
use motion_fit::landmarks::BodyLandmarks;
use serde::{Serialize, Serializer};

/// Views for each candidate.
const VIEWS: u32 = 4;
/// Size of their pictures, as a share of the usual ones'.
const SHARE: f64 = 0.5;
/// With this score no other candidate need be looked at: the next best has a fifth of that as a rule.
const CERTAIN: f64 = 2.6;

/// A candidate for up, and how much it looks like a standing person.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UpScore {
    /// The candidate, of unit length, in the scene's axes.
    #[serde(serialize_with = "coordinates")]
    pub up: DVec3,
    /// 0 (none of four views shows a standing person) to 4.
    pub score: f64,
}

fn coordinates<S: Serializer>(vector: &DVec3, serializer: S) -> Result<S::Ok, S::Error> {
    vector.to_array().serialize(serializer)
}

/// The candidates that were looked at, in their order: all, or as many as it took to be certain. `sight` shows the scan.
///
/// # Errors
/// [`RigError`] if drawing or a network fails.
pub fn look_for_up(
    sight: &mut Sight,
    networks: &mut Networks,
    candidates: &[DVec3],
    subject: impl Fn(DVec3) -> Subject,
    behind: [f32; 3],
) -> Result<Vec<UpScore>, RigError> {
    let mut scores = Vec::new();
    for up in candidates {
        let mut score = 0.0;
        let front = up.any_orthonormal_vector();
        for view in subject(*up).around(VIEWS, front, SHARE) {
            if let Some(seen) = networks.body(&sight.picture(&view, behind)?)? {
                score += standing(&seen);
            }
        }
        scores.push(UpScore { up: *up, score });
        if score >= CERTAIN {
            break;
        }
    }
    Ok(scores)
}

/// How much a body in a picture is one that stands, 0..=1: the landmarks' visibility, less as the line from the ankles to the nose leans.
fn standing(seen: &BodyLandmarks) -> f64 {
    let counted = [SHOULDERS, HIPS, KNEES, ANKLES].concat();
    let visibility = |at: &usize| f64::from(seen.points[*at].confidence);
    #[expect(clippy::cast_precision_loss, reason = "there are eight")]
    let mean = counted.iter().map(visibility).sum::<f64>() / counted.len() as f64;
    let pixel = |at: usize| seen.points[at].pixel.as_dvec2();
    let ankles = (pixel(ANKLES[0]) + pixel(ANKLES[1])) / 2.0;
    let raised = (pixel(NOSE) - ankles).normalize_or_zero().dot(DVec2::NEG_Y);
    mean * raised.max(0.0).powi(2)
}
