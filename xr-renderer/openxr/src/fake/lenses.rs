//! `XR_KHR_visibility_mask`: what the lenses hide, as the test says.

use openxr::sys::{self, Result as XrResult};
use openxr::{ViewConfigurationType, VisibilityMaskTypeKHR};

use super::call;
use super::pointers::{change, read, values};

/// A view's mask.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lens {
    /// x and y on the plane one metre before the eye.
    pub(crate) corners: Vec<[f32; 2]>,
    /// Three for each triangle that is hidden.
    pub(crate) indices: Vec<u32>,
    /// Corners and indices that it says it has before it is asked for them, if not as many as it has.
    pub(crate) says: Option<[u32; 2]>,
}

impl Lens {
    /// A ring around these corners, as wide as they are from their middle.
    pub(crate) fn around(corners: &[[f32; 2]]) -> Self {
        let count = corners.len() as u32;
        let middle = [0, 1].map(|axis| {
            let sum: f32 = corners.iter().map(|corner| corner[axis]).sum();
            sum / corners.len() as f32
        });
        let outer = |corner: &[f32; 2]| [0, 1].map(|axis| 2.0 * corner[axis] - middle[axis]);
        Self {
            corners: corners
                .iter()
                .copied()
                .chain(corners.iter().map(outer))
                .collect(),
            indices: (0..count)
                .flat_map(|from| {
                    let to = (from + 1) % count;
                    [from, to, count + from, to, count + to, count + from]
                })
                .collect(),
            says: None,
        }
    }

    /// A rectangle from one corner to the opposite one.
    pub(crate) fn rectangle(low: [f32; 2], high: [f32; 2]) -> Self {
        Self {
            corners: vec![low, [high[0], low[1]], high, [low[0], high[1]]],
            indices: vec![0, 1, 2, 0, 2, 3],
            says: None,
        }
    }
}

pub(super) unsafe extern "system" fn get_visibility_mask(
    session: sys::Session,
    _views: ViewConfigurationType,
    view: u32,
    kind: VisibilityMaskTypeKHR,
    mask: *mut sys::VisibilityMaskKHR,
) -> XrResult {
    let asked = read(mask);
    let said = format!(
        "view {view}, {kind:?}, room for {} and {}",
        asked.vertex_capacity_input, asked.index_capacity_input
    );
    call(session, "xrGetVisibilityMaskKHR", said, |world| {
        let Some(lens) = world.lenses.get(view as usize) else {
            return XrResult::ERROR_VALIDATION_FAILURE;
        };
        if kind != VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH {
            return XrResult::ERROR_VALIDATION_FAILURE;
        }
        let corners: Vec<_> = lens
            .corners
            .iter()
            .map(|[x, y]| sys::Vector2f { x: *x, y: *y })
            .collect();
        let mut counts = [0; 2];
        let [corner_count, index_count] = &mut counts;
        let given = [
            values(
                asked.vertex_capacity_input,
                corner_count,
                asked.vertices,
                &corners,
            ),
            values(
                asked.index_capacity_input,
                index_count,
                asked.indices,
                &lens.indices,
            ),
        ];
        if let Some(says) = lens.says.filter(|_| asked.vertex_capacity_input == 0) {
            counts = says;
        }
        change(mask, |to| {
            [to.vertex_count_output, to.index_count_output] = counts;
        });
        let failed = given.into_iter().find(|it| *it != XrResult::SUCCESS);
        failed.unwrap_or(XrResult::SUCCESS)
    })
}
