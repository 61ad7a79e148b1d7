//! `XR_KHR_visibility_mask`: which part of each eye's picture the lens hides.
//!
//! The runtime gives it as triangles on the plane one metre before the eye. What they cover is not drawn. Without the extension, or with a mask
//! that cannot be right, all of the picture is drawn: an eye that sees a hole is worse than a tile too much. So the triangles are those of what
//! is hidden, not of what is seen, which the extension has too: where a view is wider than its mask (Monado's are those of the headset's
//! own field of view, whatever that of a frame is), the rest is drawn.

use std::fmt;

use glam::Vec2;
use openxr::sys::{self, Result as XrResult};
use openxr::{Session, VisibilityMaskTypeKHR, Vulkan};
use renderer_splat::camera::Camera;
use renderer_splat::visible_tiles::VisibleTiles;

use super::{Absent, outcome};
use crate::headset::VIEWS;

const EXTENSION: &str = "XR_KHR_visibility_mask";
const CALL: &str = "xrGetVisibilityMaskKHR";

/// The most triangles of a mask; headsets' have a few hundred.
const MOST_TRIANGLES: u32 = 2048;
/// Every lens shows at least so much of the picture.
const LEAST_SHARE: f64 = 0.5;

/// What is wrong with a mask.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wrong {
    Refused(XrResult),
    TooLarge { corners: u32, indices: u32 },
    NotTriangles { indices: u32 },
    NoSuchCorner { index: u32 },
    NotFinite,
    HidesMost { share: f64 },
    HidesAhead,
}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(result) => write!(f, "{CALL} failed: {result}"),
            Self::TooLarge { corners, indices } => {
                write!(f, "it has {corners} corners and {indices} indices")
            }
            Self::NotTriangles { indices } => {
                write!(f, "{indices} indices are no triangles")
            }
            Self::NoSuchCorner { index } => write!(f, "it has no corner {index}"),
            Self::NotFinite => f.write_str("a corner is infinite or no number"),
            Self::HidesMost { share } => {
                write!(f, "it shows only {:.0} % of the picture", share * 100.0)
            }
            Self::HidesAhead => f.write_str("it hides what is straight ahead"),
        }
    }
}

/// Triangles that an eye does not see: where rays go through the plane one metre before it, x to the right and y up, metres.
type Mesh = Vec<[Vec2; 3]>;

/// The lenses' masks, and what they leave of the pictures that are drawn now.
pub(crate) struct VisibilityMask {
    session: Session<Vulkan>,
    /// Left and right. Where there is none the whole picture is seen.
    meshes: [Option<Mesh>; 2],
    /// The cameras that `tiles` are for.
    cameras: Option<[Camera; 2]>,
    tiles: Option<[VisibleTiles; 2]>,
    has_warned: bool,
    has_told: bool,
}

impl VisibilityMask {
    /// The masks as they are now.
    ///
    /// # Errors
    /// [`Absent`] where the runtime lacks the extension.
    pub(crate) fn new(session: &Session<Vulkan>) -> Result<Self, Absent> {
        if session.instance().exts().khr_visibility_mask.is_none() {
            return Err(Absent::NotGranted(EXTENSION));
        }
        let mut this = Self {
            session: session.clone(),
            meshes: [None, None],
            cameras: None,
            tiles: None,
            has_warned: false,
            has_told: false,
        };
        this.renew(0);
        this.renew(1);
        Ok(this)
    }

    /// Takes a view's mask anew: the runtime said that it changed.
    pub(crate) fn renew(&mut self, view: u32) {
        let Some(place) = self.meshes.get_mut(view as usize) else {
            return;
        };
        let found = ask(&self.session, view);
        *place = found.as_ref().ok().filter(|mesh| !mesh.is_empty()).cloned();
        self.cameras = None;
        if let Err(wrong) = found {
            self.warn(wrong);
        }
    }

    /// Sets the cameras of the pictures that are drawn now, in the pictures' own size.
    pub(crate) fn set_cameras(&mut self, cameras: [Camera; 2]) {
        let lens = |camera: &Camera| {
            let Camera { fx, fy, cx, cy, .. } = *camera;
            ([fx, fy, cx, cy], [camera.width, camera.height])
        };
        let same = (self.cameras.as_ref())
            .is_some_and(|known| known.each_ref().map(lens) == cameras.each_ref().map(lens));
        if same {
            return;
        }
        self.cameras = Some(cameras);
        self.tiles = None;
        if self.meshes.iter().all(Option::is_none) {
            return;
        }
        let mut tiles = cameras.map(|camera| VisibleTiles::all(camera.width, camera.height));
        for ((tiles, camera), mesh) in tiles.iter_mut().zip(&cameras).zip(&mut self.meshes) {
            let Some(triangles) = mesh else { continue };
            *tiles = VisibleTiles::behind(camera, triangles.iter().copied());
        }
        let mut eyes = tiles.iter().zip(&cameras);
        if let Err(wrong) = eyes.try_for_each(|(tiles, camera)| believe(tiles, camera)) {
            self.meshes = [None, None];
            self.warn(wrong);
            return;
        }
        let shares = tiles.each_ref().map(VisibleTiles::share);
        if shares == [1.0; 2] {
            return;
        }
        if !std::mem::replace(&mut self.has_told, true) {
            let [left, right] = shares.map(|share| share * 100.0);
            log::info!(
                "the lenses show {left:.0} % of the left and {right:.0} % of the right picture, and only that is drawn"
            );
        }
        self.tiles = Some(tiles);
    }

    /// The tiles that the lenses show to those cameras; nothing where they show all.
    pub(crate) fn visible_tiles(&self) -> Option<&[VisibleTiles; 2]> {
        self.tiles.as_ref()
    }

    /// Once a session: a runtime that is wrong may be so with every frame.
    fn warn(&mut self, wrong: Wrong) {
        if !std::mem::replace(&mut self.has_warned, true) {
            log::warn!("the runtime's mask of a lens is not used: {wrong}");
        }
    }
}

/// Refuses what no lens is like: each shows half of the picture, and what is straight ahead.
fn believe(tiles: &VisibleTiles, camera: &Camera) -> Result<(), Wrong> {
    let share = tiles.share();
    if share < LEAST_SHARE {
        return Err(Wrong::HidesMost { share });
    }
    let tile = shaders_spirv::TILE_PIXELS as f32;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "of use only where the axis is in the picture"
    )]
    let [column, row] = [camera.cx, camera.cy].map(|centre| (centre / tile) as u32);
    let shows_axis = tiles
        .columns_of(row as usize)
        .is_some_and(|columns| columns.contains(&column));
    let axis_is_drawn = (0.0..camera.width as f32).contains(&camera.cx)
        && (0.0..camera.height as f32).contains(&camera.cy);
    if axis_is_drawn && !shows_axis {
        return Err(Wrong::HidesAhead);
    }
    Ok(())
}

/// The triangles that a view's lens hides; none where the runtime has no mask for it.
fn ask(session: &Session<Vulkan>, view: u32) -> Result<Mesh, Wrong> {
    let mut mask = empty();
    call(session, view, &mut mask)?;
    let [corners, indices] = counts(&mask)?;
    if corners == 0 || indices == 0 {
        return Ok(Mesh::new());
    }
    let mut vertices = vec![sys::Vector2f { x: 0.0, y: 0.0 }; corners];
    let mut places = vec![0; indices];
    mask.vertex_capacity_input = mask.vertex_count_output;
    mask.index_capacity_input = mask.index_count_output;
    mask.vertices = vertices.as_mut_ptr();
    mask.indices = places.as_mut_ptr();
    call(session, view, &mut mask)?;
    let [corners, indices] = counts(&mask)?;
    // A mask that grew in between does not fit, and the runtime says that it changed.
    vertices.truncate(corners);
    places.truncate(indices);
    checked(&vertices, &places)
}

fn empty() -> sys::VisibilityMaskKHR {
    sys::VisibilityMaskKHR {
        ty: sys::VisibilityMaskKHR::TYPE,
        next: std::ptr::null_mut(),
        vertex_capacity_input: 0,
        vertex_count_output: 0,
        vertices: std::ptr::null_mut(),
        index_capacity_input: 0,
        index_count_output: 0,
        indices: std::ptr::null_mut(),
    }
}

/// The call itself: the crate's own trusts the counts, which may be anything.
fn call(
    session: &Session<Vulkan>,
    view: u32,
    mask: &mut sys::VisibilityMaskKHR,
) -> Result<(), Wrong> {
    let Some(extension) = &session.instance().exts().khr_visibility_mask else {
        return Err(Wrong::Refused(XrResult::ERROR_FUNCTION_UNSUPPORTED));
    };
    // SAFETY: the session is alive; the structure is typed, and its arrays are null with no capacity, or have as many elements as it says.
    let result = unsafe {
        (extension.get_visibility_mask)(
            session.as_raw(),
            VIEWS,
            view,
            VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH,
            mask,
        )
    };
    outcome(result).map(drop).map_err(Wrong::Refused)
}

/// Corners and indices that the runtime has or gave, if they are as many as a mask can have.
fn counts(mask: &sys::VisibilityMaskKHR) -> Result<[usize; 2], Wrong> {
    let (corners, indices) = (mask.vertex_count_output, mask.index_count_output);
    if corners > 3 * MOST_TRIANGLES || indices > 3 * MOST_TRIANGLES {
        return Err(Wrong::TooLarge { corners, indices });
    }
    Ok([corners as usize, indices as usize])
}

/// The triangles, if all their corners are there and are numbers.
fn checked(corners: &[sys::Vector2f], indices: &[u32]) -> Result<Mesh, Wrong> {
    let corner = |index: &u32| {
        let corner = corners.get(*index as usize);
        let corner = corner.ok_or(Wrong::NoSuchCorner { index: *index })?;
        let corner = Vec2::new(corner.x, corner.y);
        corner.is_finite().then_some(corner).ok_or(Wrong::NotFinite)
    };
    let triangles = indices.chunks_exact(3);
    if !triangles.remainder().is_empty() {
        let indices = u32::try_from(indices.len()).unwrap_or(u32::MAX);
        return Err(Wrong::NotTriangles { indices });
    }
    triangles
        .map(|triangle| match triangle {
            [a, b, c] => Ok([corner(a)?, corner(b)?, corner(c)?]),
            // There are three.
            _ => Err(Wrong::NotTriangles { indices: 0 }),
        })
        .collect()
}
