//! The bounding boxes of a scene.

/// An axis-aligned box in the scene's units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The least coordinate on each axis.
    pub min: [f32; 3],
    /// The greatest coordinate on each axis.
    pub max: [f32; 3],
}

impl Bounds {
    /// The smallest box around all positions, or nothing where there are none.
    pub(crate) fn around(positions: &[[f32; 3]]) -> Option<Self> {
        let (&first, rest) = positions.split_first()?;
        let mut bounds = Self {
            min: first,
            max: first,
        };
        for position in rest {
            for (least, value) in bounds.min.iter_mut().zip(position) {
                *least = least.min(*value);
            }
            for (greatest, value) in bounds.max.iter_mut().zip(position) {
                *greatest = greatest.max(*value);
            }
        }
        Some(bounds)
    }

    /// The box that leaves out the `share` (0 to 0.5) of the positions that lie lowest and highest on each axis.
    pub(crate) fn around_most(positions: &[[f32; 3]], share: f64) -> Option<Self> {
        let last = positions.len().checked_sub(1)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a share of at most half of a count of at most 2^22"
        )]
        let cut = (share.clamp(0.0, 0.5) * last as f64) as usize;
        let mut bounds = Self::around(positions)?;
        let mut values = Vec::with_capacity(positions.len());
        for axis in 0..3 {
            values.clear();
            values.extend(positions.iter().map(|position| position[axis]));
            let (_, &mut low, _) = values.select_nth_unstable_by(cut, f32::total_cmp);
            let (_, &mut high, _) = values.select_nth_unstable_by(last - cut, f32::total_cmp);
            bounds.min[axis] = low;
            bounds.max[axis] = high;
        }
        Some(bounds)
    }
}
