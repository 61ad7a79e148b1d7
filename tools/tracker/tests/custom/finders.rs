//! Models that find what a test says, and a picture to find it in.

use glam::{Vec2, Vec3};
use motion_fit::landmarks::{BodyLandmarks, BodyPoint, FaceLandmarks, HandLandmarks};
use tracker::TrackerError;
use tracker::models::{
    BodyEstimate, BodyModel, FaceEstimate, FaceHint, FaceModel, HandEstimate, HandHint, HandModel,
    Side,
};
use tracker::picture::PictureView;

/// The side of the picture.
pub(crate) const SIDE: usize = 64;
/// What is found fills this square: its middle and its side.
pub(crate) const MIDDLE: Vec2 = Vec2::new(32.0, 24.0);
pub(crate) const SIZE: f32 = 16.0;

/// Red grows to the right, green down, blue is even.
pub(crate) fn picture() -> Vec<u8> {
    let shade = |at: usize| u8::try_from(at * 4).unwrap();
    (0..SIDE * SIDE)
        .flat_map(|at| [shade(at % SIDE), shade(at / SIDE), 100])
        .collect()
}

pub(crate) fn view(rgb: &[u8]) -> PictureView<'_> {
    PictureView::new(SIDE, SIDE, rgb).unwrap()
}

/// Points along the square's diagonal, from its left and top to its right and bottom.
fn along(at: usize, of: usize) -> Vec2 {
    MIDDLE + SIZE * (at as f32 / (of - 1) as f32 - 0.5)
}

pub(crate) fn body() -> BodyLandmarks {
    let mut points = [BodyPoint::default(); 33];
    for (at, point) in points.iter_mut().enumerate() {
        *point = BodyPoint {
            pixel: along(at, 33),
            metres: Vec3::splat(at as f32),
            confidence: 0.75,
        };
    }
    BodyLandmarks { points }
}

pub(crate) fn hand() -> HandLandmarks {
    HandLandmarks {
        pixels: std::array::from_fn(|at| along(at, 21)),
        metres: [Vec3::ONE; 21],
        confidence: 0.75,
    }
}

pub(crate) fn face() -> FaceLandmarks {
    let mut points = Box::new([Vec3::ZERO; 478]);
    for (at, point) in points.iter_mut().enumerate() {
        *point = along(at.min(467), 468).extend(5.0);
    }
    FaceLandmarks {
        points,
        confidence: 0.75,
    }
}

pub(crate) const HINT: HandHint = HandHint {
    wrist: Vec2::ONE,
    index: Vec2::ONE,
    little: Vec2::ONE,
    confidence: 1.0,
};

pub(crate) struct Finder;

impl BodyModel for Finder {
    fn run(&mut self, _: PictureView<'_>, _: f64) -> Result<Option<BodyEstimate>, TrackerError> {
        Ok(Some(body().into()))
    }
}

impl HandModel for Finder {
    fn follow(
        &mut self,
        _: PictureView<'_>,
        _: Side,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        Ok(None)
    }

    fn find(
        &mut self,
        _: PictureView<'_>,
        _: Side,
        _: &HandHint,
        _: Option<HandEstimate>,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        Ok(Some(hand().into()))
    }

    fn forget(&mut self, _: Side) {}
}

impl FaceModel for Finder {
    fn follow(&mut self, _: PictureView<'_>) -> Result<Option<FaceEstimate>, TrackerError> {
        Ok(None)
    }

    fn find(
        &mut self,
        _: PictureView<'_>,
        _: Option<&FaceHint>,
        _: Option<FaceEstimate>,
    ) -> Result<Option<FaceEstimate>, TrackerError> {
        Ok(Some(face().into()))
    }
}
