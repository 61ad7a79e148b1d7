//! The reference of a headset's pictures in f64, independent of renderer and shaders: the runtime's poses become views, views
//! become pixels, a splatted colour becomes a compositor's pixel.

use glam::{Affine3A, DMat3, DQuat, DVec3, Mat3A};
use image::RgbaImage;
use renderer_splat::camera::Camera;
use serde_json::Value;

use crate::monado::{Pose, Scripted};
use crate::splat_reference::ReferencePicture;

/// An eye's view: where it is, how it is turned, and the picture it sees.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Columns: the eye's right, up and back, in floor space.
    pub floor_from_eye: DMat3,
    /// Metres, floor space.
    pub place: DVec3,
    /// Pixels to the right and downwards for a slope of 1.
    pub focal: [f64; 2],
    /// Where the eye's axis meets the picture, pixels from its upper left corner.
    pub centre: [f64; 2],
    /// Width and height, pixels.
    pub size: [u32; 2],
}

fn exact(pose: &Pose) -> (DQuat, DVec3) {
    let turn = pose.rotation.to_array().map(f64::from);
    (
        DQuat::from_array(turn).normalize(),
        pose.position.as_dvec3(),
    )
}

impl View {
    /// Both eyes of a scripted head, left and right. The stage's origin is the floor's.
    #[must_use]
    pub fn of(scripted: &Scripted, size: [u32; 2]) -> [Self; 2] {
        let (head_turn, head_place) = exact(&scripted.stage_from_head);
        scripted.eyes.map(|eye| {
            let (eye_turn, eye_place) = exact(&eye.head_from_eye);
            let slopes = [eye.fov.left, eye.fov.right, eye.fov.up, eye.fov.down];
            let [left, right, up, down] = slopes.map(|angle| f64::from(angle).tan());
            let focal = [
                f64::from(size[0]) / (right - left),
                f64::from(size[1]) / (up - down),
            ];
            Self {
                floor_from_eye: DMat3::from_quat(head_turn * eye_turn),
                place: head_place + head_turn * eye_place,
                focal,
                centre: [-left * focal[0], up * focal[1]],
                size,
            }
        })
    }

    /// A point as the eye sees it: right, up, back; metres.
    #[must_use]
    pub fn seen(&self, point: DVec3) -> DVec3 {
        self.floor_from_eye.transpose() * (point - self.place)
    }

    /// Where a point in front of the eye lies in the picture, pixels from the upper left corner.
    #[must_use]
    pub fn pixel(&self, point: DVec3) -> [f64; 2] {
        let seen = self.seen(point);
        [
            self.centre[0] + self.focal[0] * seen.x / -seen.z,
            self.centre[1] - self.focal[1] * seen.y / -seen.z,
        ]
    }

    /// The eye's ray through a pixel's centre, by its own axes; not of length 1.
    #[must_use]
    pub fn toward(&self, x: u32, y: u32) -> DVec3 {
        DVec3::new(
            (f64::from(x) + 0.5 - self.centre[0]) / self.focal[0],
            (self.centre[1] - f64::from(y) - 0.5) / self.focal[1],
            -1.0,
        )
    }

    /// As the splatting reference takes it.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "cameras are in f32")]
    pub fn camera(&self) -> Camera {
        let turn = self.floor_from_eye.transpose();
        Camera {
            camera_from_world: Affine3A {
                matrix3: Mat3A::from(turn.as_mat3()),
                translation: (-(turn * self.place)).as_vec3a(),
            },
            fx: self.focal[0] as f32,
            fy: self.focal[1] as f32,
            cx: self.centre[0] as f32,
            cy: self.centre[1] as f32,
            width: self.size[0],
            height: self.size[1],
            near: 0.05,
        }
    }

    /// Asserts that the camera a program drew with is this view: angles, directions and metres to 1e-4.
    ///
    /// # Panics
    /// If it is another.
    pub fn assert_is(&self, told: &Value, what: &str) {
        let near = |got: f64, wanted: f64| (got - wanted).abs() < 1e-4;
        let turn = self.floor_from_eye.transpose();
        let rotation = numbers(&told["rotation"]);
        for (got, wanted) in rotation.iter().zip(turn.to_cols_array()) {
            assert!(near(*got, wanted), "{what}: turned by {rotation:?}");
        }
        let place = DMat3::from_cols_slice(&rotation).transpose()
            * -DVec3::from_slice(&numbers(&told["translation"]));
        assert!(
            (place - self.place).abs().max_element() < 1e-4,
            "{what}: at {place}"
        );
        assert_eq!(numbers(&told["size"]), self.size.map(f64::from), "{what}");
        let (focal, centre) = (numbers(&told["focal"]), numbers(&told["centre"]));
        for axis in 0..2 {
            let angles = |focal: f64, centre: f64| {
                let far = f64::from(self.size[axis]) - centre;
                [(-centre / focal).atan(), (far / focal).atan()]
            };
            let got = angles(focal[axis], centre[axis]);
            let wanted = angles(self.focal[axis], self.centre[axis]);
            for (got, wanted) in got.iter().zip(wanted) {
                assert!(
                    near(*got, wanted),
                    "{what}: an edge at {got} instead of {wanted} radians"
                );
            }
        }
    }
}

/// Light of an sRGB value (IEC 61966-2-1).
#[must_use]
pub fn light(value: f64) -> f64 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}

/// The sRGB value of light.
#[must_use]
pub fn display(light: f64) -> f64 {
    if light <= 0.003_130_8 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

/// A premultiplied display colour for a compositor that blends light: once decoded it is light times alpha.
#[must_use]
pub fn composed(pixel: [f64; 4]) -> [f64; 4] {
    let [red, green, blue, alpha] = pixel.map(|value| value.clamp(0.0, 1.0));
    if alpha == 0.0 {
        return [0.0; 4];
    }
    let channel = |value: f64| display(light((value / alpha).min(1.0)) * alpha);
    [channel(red), channel(green), channel(blue), alpha]
}

/// Mean squared differences of colours and alpha (0 to 1) over some pixels, as PSNR in dB. Nothing where there are no pixels.
pub fn psnr(
    got: &RgbaImage,
    expected: &ReferencePicture,
    within: impl Fn(u32, u32) -> bool,
) -> Option<f64> {
    let (mut squares, mut count) = (0.0, 0u32);
    let expected = expected.pixels.iter();
    for ((x, y, got), expected) in got.enumerate_pixels().zip(expected) {
        if !within(x, y) {
            continue;
        }
        for (got, expected) in got.0.iter().zip(composed(*expected)) {
            squares += (f64::from(*got) / 255.0 - expected).powi(2);
        }
        count += 4;
    }
    (count > 0).then(|| -10.0 * (squares / f64::from(count)).log10())
}

const SKY: [f64; 3] = [0.80, 0.83, 0.87];
const HORIZON: [f64; 3] = [0.90, 0.91, 0.92];
const FLOOR: [f64; 3] = [0.70, 0.71, 0.73];

/// The display colour that an eye sees along a ray in the studio that surrounds a person where the room is not shown: a floor
/// at y = 0 that melts into the horizon's colour 14 m away by the root of the distance, a wall that reaches the sky's where the way
/// rises 0.625 of its length.
#[must_use]
pub fn studio(eye: DVec3, way: DVec3) -> [f64; 3] {
    let rise = way.y / way.length();
    let (from, to, share) = if rise < 0.0 {
        (FLOOR, HORIZON, (eye.y / -rise / 14.0).min(1.0).sqrt())
    } else {
        (HORIZON, SKY, (rise / 0.625).min(1.0))
    };
    std::array::from_fn(|channel| from[channel] + share * (to[channel] - from[channel]))
}

/// A list of numbers.
///
/// # Panics
/// If it is no list.
#[must_use]
pub fn numbers(list: &Value) -> Vec<f64> {
    let list = list
        .as_array()
        .unwrap_or_else(|| panic!("{list} is no list"));
    list.iter().filter_map(Value::as_f64).collect()
}
