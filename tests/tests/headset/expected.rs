//! What pictures have to be, in f64 and written apart from renderer and shaders: poses as the runtime gives them become views, views
//! become pixels, a splatted colour becomes what a compositor takes.

use glam::{Affine3A, DMat3, DQuat, DVec3, Mat3A};
use image::RgbaImage;
use mon3tr_tests::monado::{Pose, Scripted};
use mon3tr_tests::splat_reference::ReferencePicture;
use serde_json::Value;
use xr_renderer::Camera;

use crate::program::numbers;

/// An eye's view: where it is, how it is turned, and the picture it sees.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    /// Columns: the eye's right, up and back, in floor space.
    pub(crate) floor_from_eye: DMat3,
    /// Metres, floor space.
    pub(crate) place: DVec3,
    /// Pixels to the right and downwards for a slope of 1.
    pub(crate) focal: [f64; 2],
    /// Where the eye's axis meets the picture, pixels from its upper left corner.
    pub(crate) centre: [f64; 2],
    pub(crate) size: [u32; 2],
}

fn exact(pose: &Pose) -> (DQuat, DVec3) {
    let turn = pose.rotation.to_array().map(f64::from);
    (
        DQuat::from_array(turn).normalize(),
        pose.position.as_dvec3(),
    )
}

impl View {
    /// Both eyes of a scripted head. The stage's origin is the floor's.
    pub(crate) fn of(scripted: &Scripted, size: [u32; 2]) -> [Self; 2] {
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
    pub(crate) fn seen(&self, point: DVec3) -> DVec3 {
        self.floor_from_eye.transpose() * (point - self.place)
    }

    /// Where a point in front of the eye lies in the picture, pixels from the upper left corner.
    pub(crate) fn pixel(&self, point: DVec3) -> [f64; 2] {
        let seen = self.seen(point);
        [
            self.centre[0] + self.focal[0] * seen.x / -seen.z,
            self.centre[1] - self.focal[1] * seen.y / -seen.z,
        ]
    }

    /// The way that the eye looks through a pixel's centre, by its own axes; not of length 1.
    pub(crate) fn toward(&self, x: u32, y: u32) -> DVec3 {
        DVec3::new(
            (f64::from(x) + 0.5 - self.centre[0]) / self.focal[0],
            (self.centre[1] - f64::from(y) - 0.5) / self.focal[1],
            -1.0,
        )
    }

    /// As the splatting reference takes it.
    #[expect(clippy::cast_possible_truncation, reason = "cameras are in f32")]
    pub(crate) fn camera(&self) -> Camera {
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

    /// Demands that the camera a program drew with is this view: angles, directions and metres to 1e-4.
    pub(crate) fn assert_is(&self, told: &Value, what: &str) {
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
pub(crate) fn light(value: f64) -> f64 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}

/// The sRGB value of light.
pub(crate) fn display(light: f64) -> f64 {
    if light <= 0.003_130_8 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

/// What a compositor that blends light takes for a premultiplied display colour: once decoded it is light times alpha.
pub(crate) fn composed(pixel: [f64; 4]) -> [f64; 4] {
    let [red, green, blue, alpha] = pixel.map(|value| value.clamp(0.0, 1.0));
    if alpha == 0.0 {
        return [0.0; 4];
    }
    let channel = |value: f64| display(light((value / alpha).min(1.0)) * alpha);
    [channel(red), channel(green), channel(blue), alpha]
}

/// Mean squared differences of colours and alpha (0 to 1) over some pixels, as PSNR in dB. Nothing where there are no pixels.
pub(crate) fn psnr(
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
