//! `XR_KHR_visibility_mask`: what the lenses show, as the test says.

use openxr::sys::{self, Result as XrResult};
use openxr::{ViewConfigurationType, VisibilityMaskTypeKHR};

use super::call;
use super::pointers::{change, read, values};

/// A view's mask.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lens {
    /// x and y on the plane one metre before the eye.
    pub(crate) corners: Vec<[f32; 2]>,
    /// Three for each triangle that is seen.
    pub(crate) indices: Vec<u32>,
    /// Corners and indices that it says it has before it is asked for them, if not as many as it has.
    pub(crate) says: Option<[u32; 2]>,
}

impl Lens {
    /// A fan around the eye's axis, through these corners.
    pub(crate) fn fan(corners: &[[f32; 2]]) -> Self {
        let count = corners.len() as u32;
        Self {
            corners: std::iter::once([0.0; 2])
                .chain(corners.iter().copied())
                .collect(),
            indices: (0..count)
                .flat_map(|index| [0, index + 1, (index + 1) % count + 1])
                .collect(),
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
        if kind != VisibilityMaskTypeKHR::VISIBLE_TRIANGLE_MESH {
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
