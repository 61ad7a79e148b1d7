//! What two seconds of standing tell of a camera and a person, to be held from then on.
//!
//! Without it the camera's tilt and height, the person's proportions and their neutral face are learnt while the person moves, and follow
//! slowly ever after: a long stoop and a long smile creep into them. A person who stands upright and looks calm tells them at once, and no
//! other posture is mixed in. Limbs are straight and across the line of sight, where a network's metres are good.
//!
//! The field of view is not among it. A standing body is nearly a plane before the camera, and of a plane one picture tells only how
//! large the focal length is against the distance.

pub use crate::body::Calibration;
use crate::body::{StandingBody, upright_axes};
use crate::landmarks::blazepose::{ANKLES, HIPS, KNEES, SHOULDERS};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks, Camera};
use glam::DVec2;
use nalgebra::{Matrix3, Vector3};
use spmm3::Skeleton;

/// For so long the person has to stand, seconds, in so many pictures at least.
const STANDING: f64 = 2.0;
const LEAST_PICTURES: u32 = 6;
/// A gap in what is seen begins it anew, seconds.
const LONGEST_GAP: f64 = 1.0;
/// A landmark less sure than this is not seen.
const SEEN: f32 = 0.5;
/// Knees and hips are straight from this cosine on: in one picture 60 degrees, as a network's depth errs, on average 50.
const STRAIGHT_NOW: f64 = 0.5;
const STRAIGHT: f64 = 0.64;
/// The body's axis against the picture's upright: cosine of 45 degrees, more than cameras are tilted and people lean.
const UPRIGHT: f64 = 0.71;
/// A person who stands moves less than this share of their height from their mean place.
const STILL: f64 = 0.06;

/// All that must be seen.
const WHOLE: [[usize; 2]; 4] = [SHOULDERS, HIPS, KNEES, ANKLES];

/// What is missing for a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// Shoulders, hips, knees and ankles are not all seen.
    WholeBody,
    /// The person does not stand upright with straight legs.
    Standing,
    /// The person moves about.
    Stillness,
}

/// How far a calibration is.
#[derive(Debug, Clone, PartialEq)]
pub enum Progress {
    /// It waits for this.
    Waiting(Missing),
    /// The person stands, and has to for so many seconds more.
    Standing(f64),
    /// It is done.
    Done(Calibration),
}

/// Watches a person until they have stood for two seconds.
#[derive(Debug, Clone)]
pub struct Calibrator {
    camera: Camera,
    body: StandingBody,
    sums: Sums,
    begun: Option<f64>,
    last: f64,
}

/// Sums over the pictures of a stance.
#[derive(Debug, Clone, Copy)]
struct Sums {
    pictures: u32,
    /// Metres (the camera's axes with y up and z towards it) times, pixels times, and confidence.
    points: [(Vector3<f64>, [f64; 2], f64); BODY_LANDMARKS],
    /// Of the hips' middle, pixels: mean.
    place: [f64; 2],
}

impl Default for Sums {
    fn default() -> Self {
        Self {
            pictures: 0,
            points: [(Vector3::zeros(), [0.0; 2], 0.0); BODY_LANDMARKS],
            place: [0.0; 2],
        }
    }
}

impl Calibrator {
    /// For a person who is fitted by `skeleton`, before `camera`.
    #[must_use]
    pub fn new(skeleton: &Skeleton, camera: Camera) -> Self {
        Self {
            camera,
            body: StandingBody::of(skeleton),
            sums: Sums::default(),
            begun: None,
            last: f64::NEG_INFINITY,
        }
    }

    /// The pictures are another camera's from now on, or of another size: it begins anew.
    pub fn set_camera(&mut self, camera: Camera) {
        self.camera = camera;
        self.begin_anew();
    }

    /// Takes what was seen of the body at `seconds` on the source's clock.
    pub fn see(&mut self, seconds: f64, body: Option<&BodyLandmarks>) -> Progress {
        if !seconds.is_finite() {
            return Progress::Waiting(Missing::WholeBody);
        }
        if seconds - self.last > LONGEST_GAP {
            self.begin_anew();
        }
        let picture = match body.ok_or(Missing::WholeBody).and_then(Stance::of) {
            Ok(picture) => picture,
            Err(missing) => return Progress::Waiting(missing),
        };
        self.last = seconds;
        if self.sums.moves(&picture) {
            self.begin_anew();
            self.last = seconds;
            self.begun = Some(seconds);
            self.sums.add(&picture, &self.camera);
            return Progress::Waiting(Missing::Stillness);
        }
        let begun = *self.begun.get_or_insert(seconds);
        self.sums.add(&picture, &self.camera);
        let left = STANDING - (seconds - begun);
        if left > 0.0 || self.sums.pictures < LEAST_PICTURES {
            return Progress::Standing(left.max(0.0));
        }
        match self.result() {
            Some(calibration) => Progress::Done(calibration),
            None => {
                self.begin_anew();
                Progress::Waiting(Missing::Standing)
            }
        }
    }

    /// Whether the last picture was the first of a stance: what was learnt in the one before does not count.
    #[must_use]
    pub fn begins(&self) -> bool {
        self.sums.pictures == 1
    }

    fn begin_anew(&mut self) {
        self.sums = Sums::default();
        self.begun = None;
        self.last = f64::NEG_INFINITY;
    }

    /// From the means of all pictures.
    fn result(&self) -> Option<Calibration> {
        let metres = |point: usize| self.sums.metres(point);
        let middle = |pair: [usize; 2]| {
            let [a, b] = pair.map(metres);
            Some((a? + b?) / 2.0)
        };
        let straight = is_straight(|point| metres(point).unwrap_or_default(), STRAIGHT);
        if !straight {
            return None;
        }
        let up = (middle(SHOULDERS)? - middle(ANKLES)?).try_normalize(1e-3)?;
        let lengths = self.body.lengths(metres);
        let scale = self.body.scale(&lengths)?;
        // Where the body is: x / z of each landmark is as in the picture. Weighted least squares in the three unknowns.
        let focal = f64::from(self.camera.focal);
        let centre = self.camera.centre.as_dvec2();
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for point in SHOULDERS.into_iter().chain(KNEES).chain(ANKLES).chain(HIPS) {
            let (at, pixel) = (metres(point)?, self.sums.pixel(point)?);
            let aside = [
                (pixel[0] - centre.x) / focal,
                -(pixel[1] - centre.y) / focal,
            ];
            for (axis, aside) in aside.into_iter().enumerate() {
                // (at + place)[axis] = -aside * (at + place).z
                let mut row = Vector3::new(0.0, 0.0, aside);
                row[axis] = 1.0;
                let value = -(at[axis] + aside * at.z);
                normal += row * row.transpose();
                right += row * value;
            }
        }
        let place = normal.try_inverse()? * right;
        let soles = self.body.soles(scale, metres, &up)?;
        let height = -scale * place.dot(&up) - soles;
        let calibration = Calibration {
            up,
            height_metres: height,
            lengths,
        };
        let usual = place.z < -0.3 && (-2.0..6.0).contains(&height) && up.y > UPRIGHT;
        usual.then_some(calibration)
    }
}

impl Sums {
    fn add(&mut self, picture: &Stance<'_>, camera: &Camera) {
        self.pictures += 1;
        let axes = upright_axes(camera.line_of_sight(DVec2::from_array(picture.place)));
        for (place, now) in self.place.iter_mut().zip(picture.place) {
            *place += (now - *place) / f64::from(self.pictures);
        }
        for (sum, point) in self.points.iter_mut().zip(&picture.body.points) {
            let sure = f64::from(point.confidence.clamp(0.0, 1.0));
            let finite = point.metres.is_finite() && point.pixel.is_finite();
            if finite && point.confidence >= SEEN {
                let pixel = point.pixel.as_dvec2();
                sum.0 += axes * metres(point.metres) * sure;
                sum.1[0] += pixel.x * sure;
                sum.1[1] += pixel.y * sure;
                sum.2 += sure;
            }
        }
    }

    fn moves(&self, picture: &Stance<'_>) -> bool {
        let [x, y] = [0, 1].map(|axis| picture.place[axis] - self.place[axis]);
        self.pictures > 0 && x.hypot(y) > STILL * picture.tall
    }

    fn metres(&self, point: usize) -> Option<Vector3<f64>> {
        let (sum, _, sure) = self.points.get(point)?;
        (*sure > 0.0).then(|| sum / *sure)
    }

    fn pixel(&self, point: usize) -> Option<[f64; 2]> {
        let (_, sum, sure) = self.points.get(point)?;
        (*sure > 0.0).then(|| sum.map(|v| v / *sure))
    }
}

/// One picture of a person who stands.
struct Stance<'a> {
    body: &'a BodyLandmarks,
    /// The hips' middle, pixels.
    place: [f64; 2],
    /// From shoulders to ankles, pixels.
    tall: f64,
}

impl<'a> Stance<'a> {
    fn of(body: &'a BodyLandmarks) -> Result<Self, Missing> {
        let is_seen = |point: usize| {
            let point = &body.points[point];
            point.confidence >= SEEN && point.pixel.is_finite() && point.metres.is_finite()
        };
        if !WHOLE.into_iter().flatten().all(is_seen) {
            return Err(Missing::WholeBody);
        }
        if !is_straight(|point| metres(body.points[point].metres), STRAIGHT_NOW) {
            return Err(Missing::Standing);
        }
        let pixel = |pair: [usize; 2]| {
            let [a, b] = pair.map(|point| body.points[point].pixel.as_dvec2());
            (a + b) / 2.0
        };
        Ok(Self {
            body,
            place: pixel(HIPS).to_array(),
            tall: (pixel(SHOULDERS) - pixel(ANKLES)).length(),
        })
    }
}

/// Whether landmarks that are `at` these places stand upright, with legs and trunk straight up to that cosine.
fn is_straight(at: impl Fn(usize) -> Vector3<f64>, least: f64) -> bool {
    let middle = |pair: [usize; 2]| (at(pair[0]) + at(pair[1])) / 2.0;
    let cosine = |a: Vector3<f64>, b: Vector3<f64>| {
        let lengths = a.norm() * b.norm();
        if lengths > 1e-6 {
            a.dot(&b) / lengths
        } else {
            -1.0
        }
    };
    let legs = [0, 1].into_iter().all(|side| {
        let [hip, knee, ankle] = [HIPS, KNEES, ANKLES].map(|pair| at(pair[side]));
        cosine(knee - hip, ankle - knee) > least
    });
    let axis = middle(SHOULDERS) - middle(ANKLES);
    let trunk = middle(SHOULDERS) - middle(HIPS);
    let below = middle(HIPS) - middle(ANKLES);
    legs && cosine(axis, Vector3::y()) > UPRIGHT && cosine(trunk, below) > least
}

/// From the camera's axes to those with y up and z towards it.
fn metres(at: glam::Vec3) -> Vector3<f64> {
    Vector3::new(f64::from(at.x), -f64::from(at.y), -f64::from(at.z))
}
