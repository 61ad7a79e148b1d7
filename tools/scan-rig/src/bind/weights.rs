//! Skinning weights of the body's mesh, made for clothes and for Gaussians that stand off the skin.

use crate::body::SkinRow;
use rayon::prelude::*;
use spmm3::Joint;

/// Rounds in which a vertex takes half of its weights from its neighbours. They spread over about two edges; after 25 rounds a lifted arm draws a web of
/// the flank with it.
const ROUNDS: usize = 8;

/// Gives the weights of the fingers to the wrists: hands as they were scanned.
pub(super) fn stiffen_fingers(rows: &mut [SkinRow]) {
    for row in rows {
        for finger in Joint::ALL {
            let Some(wrist) = wrist_of(finger) else {
                continue;
            };
            row[wrist as usize] += row[finger as usize];
            row[finger as usize] = 0.0;
        }
    }
}

/// The wrist of a finger's joint; nothing for other joints.
fn wrist_of(joint: Joint) -> Option<Joint> {
    let mut above = joint.parent()?;
    loop {
        if matches!(above, Joint::LeftWrist | Joint::RightWrist) {
            return Some(above);
        }
        above = above.parent()?;
    }
}

/// The joints of the head, whose weights stay as they are.
const OF_HEAD: [Joint; 4] = [Joint::Head, Joint::Jaw, Joint::LeftEye, Joint::RightEye];

/// Smooths weights along the mesh, so that no two neighbouring triangles part when a joint turns far. Along the mesh only: Gaussians
/// beside each other, on an arm and the trunk, must not share joints. The head keeps its own; `neighbours` gives the vertices beside one.
pub(super) fn smooth<'a>(rows: &mut [SkinRow], neighbours: impl Fn(usize) -> &'a [u32] + Sync) {
    let given = rows.to_vec();
    let mut before = rows.to_vec();
    for _ in 0..ROUNDS {
        rows.par_iter_mut().enumerate().for_each(|(vertex, row)| {
            let beside = neighbours(vertex);
            if beside.is_empty() {
                return;
            }
            let share = 0.5 / beside.len() as f32;
            let mut mean = before[vertex].map(|w| w * 0.5);
            for other in beside {
                for (sum, weight) in mean.iter_mut().zip(&before[*other as usize]) {
                    *sum += weight * share;
                }
            }
            *row = mean;
        });
        before.copy_from_slice(rows);
    }
    for (row, given) in rows.iter_mut().zip(given) {
        let head = OF_HEAD
            .iter()
            .map(|joint| given[*joint as usize])
            .sum::<f32>();
        let head = head.clamp(0.0, 1.0);
        for (weight, given) in row.iter_mut().zip(given) {
            *weight += (given - *weight) * head;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spmm3::JOINTS;

    #[test]
    fn fingers_move_with_their_wrists() {
        let mut rows = [[0.0; JOINTS]; 1];
        rows[0][Joint::LeftIndex3 as usize] = 0.7;
        rows[0][Joint::LeftElbow as usize] = 0.3;
        stiffen_fingers(&mut rows);
        assert_eq!(rows[0][Joint::LeftWrist as usize], 0.7, "the wrist's");
        assert_eq!(rows[0][Joint::LeftElbow as usize], 0.3, "the elbow's");
        assert_eq!(rows[0].iter().sum::<f32>(), 1.0, "all");
    }

    #[test]
    fn smoothing_keeps_sums_and_the_head_and_spreads_over_a_step() {
        let line: Vec<Vec<u32>> = (0..40_u32)
            .map(|v| {
                [v.wrapping_sub(1), v + 1]
                    .into_iter()
                    .filter(|n| *n < 40)
                    .collect()
            })
            .collect();
        let mut rows = vec![[0.0; JOINTS]; 40];
        for (at, row) in rows.iter_mut().enumerate() {
            let joint = if at < 20 {
                Joint::LeftKnee
            } else {
                Joint::LeftHip
            };
            row[joint as usize] = 1.0;
        }
        rows[39] = [0.0; JOINTS];
        rows[39][Joint::Head as usize] = 1.0;
        smooth(&mut rows, |v| &line[v]);
        for row in &rows {
            assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-5, "sum");
        }
        let knee = rows.map_knee();
        assert!(
            knee.windows(2).all(|w| w[0] >= w[1]),
            "not monotonous: {knee:?}"
        );
        assert!(
            knee[19] > 0.5 && knee[20] < 0.5 && knee[20] > 0.3,
            "{knee:?}"
        );
        assert!(knee[12] > 0.99 && knee[27] < 0.01, "too wide: {knee:?}");
        assert_eq!(rows[39][Joint::Head as usize], 1.0, "the head's");
        let skin = crate::body::posing::kept(&rows[20]).dense();
        assert!(
            (skin.iter().sum::<f32>() - 1.0).abs() < 1e-6,
            "four sum to 1"
        );
    }

    trait Knee {
        fn map_knee(&self) -> Vec<f32>;
    }
    impl Knee for Vec<SkinRow> {
        fn map_knee(&self) -> Vec<f32> {
            self.iter().map(|r| r[Joint::LeftKnee as usize]).collect()
        }
    }
}
