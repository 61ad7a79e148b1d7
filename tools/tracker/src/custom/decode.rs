//! What a network's outputs say, in the picture's own coordinates.

use super::description::{Axes, Frame, MetricUnit, Number, Output, PixelUnit, Representation};
use super::orders::Order;
use super::plan::Plan;
use crate::crop::Region;
use crate::networks::sigmoid;
use glam::{Affine2, Mat3, Quat, Vec2, Vec3};
use motion_fit::estimates::JointRotation;
use std::f32::consts::PI;

/// Pixels and metres beyond are none.
const LIMIT: f32 = 1e6;

/// What one look gave.
#[derive(Debug, Clone)]
pub(super) struct Decoded {
    /// Probability that there is what was looked for.
    pub(super) confidence: f32,
    /// In the fit's order.
    pub(super) marks: Vec<Mark>,
    /// The root in camera axes, others in their parents' frames; [`JointRotation::UNKNOWN`] where the network says nothing.
    pub(super) joints: Vec<JointRotation>,
    pub(super) weights: Option<Vec<f32>>,
    pub(super) eyelids: Option<[f32; 2]>,
}

/// What is known of a landmark.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mark {
    pub(super) pixel: Option<Vec2>,
    /// Away from the camera, in pixels of the picture.
    pub(super) depth: Option<f32>,
    pub(super) metres: Option<Vec3>,
    pub(super) confidence: Option<f32>,
}

/// Where the network looked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look<'a> {
    pub(super) region: &'a Region,
    /// Whether it saw the region mirrored.
    pub(super) mirrored: bool,
}

impl Decoded {
    /// Whether any joint is turned.
    pub(super) fn turns(&self) -> bool {
        self.joints.iter().any(|joint| joint.known().is_some())
    }
}

/// Reads outputs; nothing if the network is not sure, or a number is not finite, or no rotation can be made of it.
pub(super) fn decode<'a>(
    plan: &Plan,
    output: impl Fn(usize) -> &'a [f32],
    look: Look<'_>,
) -> Option<Decoded> {
    let mut decoding = Decoding::new(plan, look);
    let outputs = plan.description.outputs.iter().zip(&plan.places);
    for (at, (described, joints)) in outputs.enumerate() {
        let values = output(at);
        if values.is_empty() || !values.iter().all(|v| v.is_finite()) {
            return None;
        }
        decoding.read(described, joints, values)?;
    }
    decoding.finish()
}

/// What was decoded so far.
struct Decoding<'a> {
    plan: &'a Plan,
    place: Place,
    seen: Decoded,
    /// Of each joint, whether its rotation is in camera axes.
    in_camera: Vec<bool>,
    /// The probability of the whole, where an output has it.
    overall: Option<f32>,
    /// Whether landmarks are still in the input's pixels, because their axes come one by one.
    in_input: bool,
}

impl<'a> Decoding<'a> {
    fn new(plan: &'a Plan, look: Look<'_>) -> Self {
        Self {
            plan,
            place: Place::new(plan, look),
            seen: Decoded {
                confidence: 1.0,
                marks: vec![Mark::default(); plan.part.landmarks()],
                joints: vec![JointRotation::UNKNOWN; plan.part.joints()],
                weights: None,
                eyelids: None,
            },
            in_camera: vec![false; plan.part.joints()],
            overall: None,
            in_input: false,
        }
    }

    /// Reads one output, which turns `joints` if it holds rotations. Nothing if one of them is none.
    fn read(&mut self, output: &Output, joints: &[usize], values: &[f32]) -> Option<()> {
        match output {
            Output::Landmarks2d {
                order,
                unit,
                numbers,
                ..
            } => self.landmarks_2d(*order, *unit, numbers, values),
            Output::Landmarks3d {
                order,
                unit,
                axes,
                numbers,
                ..
            } => self.landmarks_3d(*order, (*unit, *axes), numbers, values),
            Output::SimccX {
                order,
                bins_per_pixel,
                ..
            } => self.bins(*order, *bins_per_pixel, 0, values),
            Output::SimccY {
                order,
                bins_per_pixel,
                ..
            } => self.bins(*order, *bins_per_pixel, 1, values),
            Output::Confidence { logit, order, .. } => self.confidence(*order, *logit, values),
            Output::Rotations {
                representation,
                frame,
                axes,
                ..
            } => {
                let camera = (*frame == Frame::Camera).then_some(*axes);
                return self.rotations(joints, *representation, camera, values);
            }
            Output::Jaw { representation, .. } => {
                return self.rotations(joints, *representation, None, values);
            }
            Output::Expression { .. } => self.seen.weights = Some(values.to_vec()),
            Output::Eyelids { .. } => self.seen.eyelids = values.try_into().ok(),
        }
        Some(())
    }

    /// The mark of landmark `from` of a network's order, if the fit has one.
    fn mark(&mut self, order: Order, from: usize) -> Option<&mut Mark> {
        let to = order.target(from)?;
        self.seen.marks.get_mut(to)
    }

    fn landmarks_2d(&mut self, order: Order, unit: PixelUnit, numbers: &[Number], values: &[f32]) {
        for (from, values) in values.chunks_exact(numbers.len().max(1)).enumerate() {
            let read = Read::new(numbers, values);
            let pixel = self.place.pixel(read.at.truncate(), unit);
            let depth = read.has_z.then(|| self.place.depth(read.at.z, unit));
            if let Some(mark) = self.mark(order, from) {
                mark.pixel = Some(pixel);
                mark.depth = depth;
                mark.confidence = read.confidence.or(mark.confidence);
            }
        }
    }

    fn landmarks_3d(
        &mut self,
        order: Order,
        (unit, axes): (MetricUnit, Axes),
        numbers: &[Number],
        values: &[f32],
    ) {
        for (from, values) in values.chunks_exact(numbers.len().max(1)).enumerate() {
            let read = Read::new(numbers, values);
            let metres = self.place.metres(read.at, unit, axes);
            if let Some(mark) = self.mark(order, from) {
                mark.metres = Some(metres);
                mark.confidence = read.confidence.or(mark.confidence);
            }
        }
    }

    /// Landmarks as bins along `axis`. The other axis is filled in when its output is read, and both are brought into the picture at the
    /// end.
    fn bins(&mut self, order: Order, bins_per_pixel: f32, axis: usize, values: &[f32]) {
        self.in_input = true;
        let bins = values.len() / order.count();
        for (from, values) in values.chunks_exact(bins.max(1)).enumerate() {
            let Some(mark) = self.mark(order, from) else {
                continue;
            };
            let (bin, best) = highest(values);
            mark.pixel.get_or_insert(Vec2::ZERO)[axis] = bin as f32 / bins_per_pixel;
            let sure = best.clamp(0.0, 1.0);
            mark.confidence = Some(mark.confidence.map_or(sure, |c| c.min(sure)));
        }
    }

    /// Of each landmark in `order`, or of the whole.
    fn confidence(&mut self, order: Option<Order>, logit: bool, values: &[f32]) {
        let probability = |value: f32| {
            let value = if logit { sigmoid(value) } else { value };
            value.clamp(0.0, 1.0)
        };
        let Some(order) = order else {
            self.overall = values.first().map(|value| probability(*value));
            return;
        };
        for (from, value) in values.iter().enumerate() {
            if let Some(mark) = self.mark(order, from) {
                mark.confidence = Some(probability(*value));
            }
        }
    }

    /// Of each of `joints`: in these `camera` axes, or in its parent's frame.
    fn rotations(
        &mut self,
        joints: &[usize],
        representation: Representation,
        camera: Option<Axes>,
        values: &[f32],
    ) -> Option<()> {
        let each = values.chunks_exact(representation.numbers());
        for (joint, values) in joints.iter().zip(each) {
            let to = self.seen.joints.get_mut(*joint)?;
            to.rotation = self
                .place
                .rotation(rotation(representation, values)?, camera);
            to.confidence = 1.0;
            *self.in_camera.get_mut(*joint)? = camera.is_some();
        }
        Some(())
    }

    /// Once all outputs were read; nothing if the network is not sure, or its numbers are beyond all bounds.
    fn finish(self) -> Option<Decoded> {
        let Self {
            plan,
            place,
            mut seen,
            in_camera,
            overall,
            in_input,
        } = self;
        if in_input {
            for mark in &mut seen.marks {
                mark.pixel = mark.pixel.map(|p| place.pixel(p, PixelUnit::Pixels));
            }
        }
        let sane = seen.marks.iter().all(|mark| {
            let pixel = mark.pixel.unwrap_or_default().abs().max_element();
            let metres = mark.metres.unwrap_or_default().abs().max_element();
            pixel <= LIMIT && metres <= LIMIT && mark.depth.unwrap_or_default().abs() <= LIMIT
        });
        let known = seen.marks.iter().filter_map(|mark| mark.confidence);
        let (sum, count) = known.fold((0.0f32, 0.0f32), |(sum, n), c| (sum + c, n + 1.0));
        // A body half hidden is a body all the same: only its landmarks' own probabilities are small.
        let (confidence, judged) = match overall {
            Some(overall) => (overall, true),
            None if count > 0.0 => (sum / count, false),
            None => (1.0, false),
        };
        if !sane || (judged && confidence < plan.description.least_confidence) {
            return None;
        }
        seen.confidence = confidence;
        lower(plan, &mut seen, &in_camera)?;
        for joint in &mut seen.joints {
            joint.confidence *= confidence;
        }
        Some(seen)
    }
}

/// Puts joints in camera axes into their parents' frames, but for the root.
fn lower(plan: &Plan, seen: &mut Decoded, in_camera: &[bool]) -> Option<()> {
    let mut all: Vec<Option<Quat>> = vec![None; seen.joints.len()];
    for place in 0..seen.joints.len() {
        let joint = seen.joints.get_mut(place)?;
        let Some(rotation) = joint.known() else {
            continue;
        };
        let parent = plan
            .part
            .parent(place)
            .and_then(|parent| all.get(parent).copied().flatten());
        let stands = *in_camera.get(place)?;
        *all.get_mut(place)? = match parent {
            _ if stands => Some(rotation),
            Some(parent) => Some(parent * rotation),
            None => None,
        };
        if let (true, Some(parent)) = (stands, parent) {
            joint.rotation = parent.inverse() * rotation;
        }
    }
    Some(())
}

/// One landmark's numbers.
struct Read {
    at: Vec3,
    has_z: bool,
    confidence: Option<f32>,
}

impl Read {
    fn new(numbers: &[Number], values: &[f32]) -> Self {
        let mut read = Self {
            at: Vec3::ZERO,
            has_z: false,
            confidence: None,
        };
        for (number, value) in numbers.iter().zip(values) {
            match number {
                Number::X => read.at.x = *value,
                Number::Y => read.at.y = *value,
                Number::Z => {
                    read.at.z = *value;
                    read.has_z = true;
                }
                Number::Confidence => read.confidence = Some(value.clamp(0.0, 1.0)),
                Number::Logit => read.confidence = Some(sigmoid(*value)),
                Number::Unused => {}
            }
        }
        read
    }
}

/// From the input's coordinates to the picture's.
struct Place {
    sides: Vec2,
    /// The side of the square of which the input is the middle, in the input's pixels.
    square: f32,
    picture_from_region: Affine2,
    side: f32,
    radians: f32,
    mirrored: bool,
}

impl Place {
    fn new(plan: &Plan, look: Look<'_>) -> Self {
        let [width, height] = plan.description.input.sides();
        let sides = Vec2::new(width as f32, height as f32);
        Self {
            sides,
            square: sides.max_element(),
            picture_from_region: look.region.picture_from_region(),
            side: look.region.side(),
            radians: look.region.radians(),
            mirrored: look.mirrored,
        }
    }

    fn pixel(&self, at: Vec2, unit: PixelUnit) -> Vec2 {
        let mut at = match unit {
            PixelUnit::Pixels => at,
            PixelUnit::ZeroToOne => at * self.sides,
            PixelUnit::Centred => (at + 1.0) * 0.5 * self.sides,
            PixelUnit::Halves => (at + 0.5) * self.sides,
        };
        if self.mirrored {
            at.x = self.sides.x - at.x;
        }
        // The input is the middle of the square, as far as whole pixels can be.
        let edge = ((Vec2::splat(self.square) - self.sides) * 0.5).floor();
        let at = (at + edge) / self.square;
        self.picture_from_region.transform_point2(at)
    }

    fn depth(&self, z: f32, unit: PixelUnit) -> f32 {
        let pixels = match unit {
            PixelUnit::Pixels => z,
            PixelUnit::ZeroToOne | PixelUnit::Halves => z * self.sides.x,
            PixelUnit::Centred => z * 0.5 * self.sides.x,
        };
        pixels / self.square * self.side
    }

    fn metres(&self, at: Vec3, unit: MetricUnit, axes: Axes) -> Vec3 {
        let mut at = match unit {
            MetricUnit::Metres => at,
            MetricUnit::Millimetres => at * 1e-3,
        };
        if axes == Axes::YUp {
            at = Vec3::new(at.x, -at.y, -at.z);
        }
        if self.mirrored {
            at.x = -at.x;
        }
        Quat::from_rotation_z(self.radians) * at
    }

    /// `axes` of a rotation in camera axes; nothing for one in its parent's frame.
    fn rotation(&self, rotation: Quat, axes: Option<Axes>) -> Quat {
        let mut rotation = match axes {
            Some(Axes::YUp) => Quat::from_rotation_x(PI) * rotation,
            _ => rotation,
        };
        if self.mirrored {
            // The mirror swaps the person's sides, also in the T-pose that the rotation begins from.
            let [x, y, z, w] = rotation.to_array();
            rotation = Quat::from_xyzw(x, -y, -z, w);
        }
        if axes.is_some() {
            rotation = Quat::from_rotation_z(self.radians) * rotation;
        }
        rotation
    }
}

/// A rotation of its numbers, if they are one.
fn rotation(representation: Representation, n: &[f32]) -> Option<Quat> {
    let (a, b) = match (representation, n) {
        (Representation::AxisAngle, [x, y, z]) => {
            let axis = Vec3::new(*x, *y, *z);
            return Some(Quat::from_scaled_axis(axis)).filter(|q| q.is_finite());
        }
        (Representation::SixD, [a, b, c, d, e, f]) => {
            (Vec3::new(*a, *b, *c), Vec3::new(*d, *e, *f))
        }
        (Representation::SixDInterleaved, [a, d, b, e, c, f]) => {
            (Vec3::new(*a, *b, *c), Vec3::new(*d, *e, *f))
        }
        (Representation::SixDRows, [a, b, c, d, e, f]) => {
            let rows = orthonormal(Vec3::new(*a, *b, *c), Vec3::new(*d, *e, *f))?;
            return Some(Quat::from_mat3(&rows.transpose()).normalize());
        }
        (Representation::Matrix, [a, d, g, b, e, h, c, f, i]) => {
            let columns = [
                Vec3::new(*a, *b, *c),
                Vec3::new(*d, *e, *f),
                Vec3::new(*g, *h, *i),
            ];
            // A mirror is no rotation.
            if Mat3::from_cols(columns[0], columns[1], columns[2]).determinant() <= 0.1 {
                return None;
            }
            (columns[0], columns[1])
        }
        _ => return None,
    };
    Some(Quat::from_mat3(&orthonormal(a, b)?).normalize())
}

/// The rotation whose first column is along `a`, and whose second is nearest to `b`.
fn orthonormal(a: Vec3, b: Vec3) -> Option<Mat3> {
    let first = a.try_normalize()?;
    let second = b.reject_from_normalized(first).try_normalize()?;
    Some(Mat3::from_cols(first, second, first.cross(second)))
}

fn highest(values: &[f32]) -> (usize, f32) {
    let mut best = (0, f32::NEG_INFINITY);
    for (at, value) in values.iter().enumerate() {
        if *value > best.1 {
            best = (at, *value);
        }
    }
    best
}
