//! MediaPipe's three operators that look again at lips and eyes: a transform from landmarks, a part of the picture by it, landmarks by it.
//!
//! Source: mediapipe/util/tflite/operations/ (landmarks_to_transform_matrix.cc, transform_tensor_bilinear.cc, transform_landmarks.cc). A
//! transform is a matrix of 4x4 whose upper left 2x2 and whose last column act on x and y, in pixels of the picture.

use super::Emitter;
use crate::error::ConvertError;
use crate::flexbuffer::Map;
use crate::graph::{Builder, Value};
use crate::model::Operator;
use onnx_schema::Attribute;

impl Builder {
    fn binary(&mut self, op: &str, a: Value, b: Value) -> Value {
        self.node(op, &[a, b], Vec::new())
    }

    /// The elements `indices` along `axis`.
    fn gather(&mut self, value: Value, indices: &[i64], axis: i64) -> Value {
        let indices = self.ints(indices);
        let axis = vec![Attribute::int("axis", axis)];
        self.node("Gather", &[value, indices], axis)
    }

    /// From `begin` to before `end`, along as many of `axes`.
    fn slice(&mut self, value: Value, begin: &[i64], end: &[i64], axes: &[i64]) -> Value {
        let [begin, end, axes] = [begin, end, axes].map(|list| self.ints(list));
        self.node("Slice", &[value, begin, end, axes], Vec::new())
    }

    fn concat(&mut self, values: &[Value], axis: i64) -> Value {
        self.node("Concat", values, vec![Attribute::int("axis", axis)])
    }

    /// Points (1, n, 2) by a transform (1, 4, 4).
    fn transformed(&mut self, points: Value, transform: Value) -> Value {
        let matrix = self.slice(transform, &[0, 0], &[2, 2], &[1, 2]);
        let shift = self.slice(transform, &[0, 3], &[2, 4], &[1, 2]);
        let [matrix, shift] = [matrix, shift].map(|value| self.transpose(value, &[0, 2, 1]));
        let turned = self.binary("MatMul", points, matrix);
        self.binary("Add", turned, shift)
    }
}

/// The settings of Landmarks2TransformMatrix.
struct Settings {
    left: i64,
    right: i64,
    subset: Vec<i64>,
    /// Of the part to the landmarks' box, and of the part in pixels: x and y.
    scale: [f32; 2],
    size: [f32; 2],
}

impl Settings {
    fn read(
        emitter: &Emitter<'_>,
        op: &Operator<'_>,
        landmarks: usize,
    ) -> Result<Self, ConvertError> {
        let map = Map::read(op.custom)?;
        let strange =
            |name: &str| emitter.unsupported(format!("its setting {name} is out of range"));
        let positive = |name: &str| {
            let value = map.number(name)?;
            // An f32 is all that the graph holds.
            #[expect(clippy::cast_possible_truncation, reason = "rounded on purpose")]
            let value = value as f32;
            if value > 0.0 && value < 65536.0 {
                Ok(value)
            } else {
                Err(strange(name))
            }
        };
        let index = |value: i64, name: &str| {
            usize::try_from(value)
                .ok()
                .filter(|index| *index < landmarks)
                .map(|_| value)
                .ok_or_else(|| strange(name))
        };
        let one = |name: &str| index(map.integer(name)?, name);
        if map.number("target_rotation_radians")? != 0.0 {
            return Err(emitter.unsupported("its part of the picture is turned on purpose"));
        }
        let subset = map.integers("subset_idxs")?;
        if subset.is_empty() {
            return Err(strange("subset_idxs"));
        }
        Ok(Self {
            left: one("left_rotation_idx")?,
            right: one("right_rotation_idx")?,
            subset: subset
                .into_iter()
                .map(|value| index(value, "subset_idxs"))
                .collect::<Result<_, _>>()?,
            scale: [positive("scale_x")?, positive("scale_y")?],
            size: [positive("output_width")?, positive("output_height")?],
        })
    }
}

/// Landmarks2TransformMatrix: the box around some landmarks, upright when the line between two of them is, enlarged; the transform takes
/// pixels of the part that is cut out to pixels of the picture.
pub(super) fn landmarks_to_transform(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let (landmarks, _) = list_of_landmarks(emitter, input)?;
    let settings = Settings::read(emitter, op, landmarks)?;
    let points = emitter.value(input)?;
    let g = &mut emitter.graph;
    // Everything below is of the shape (1, 1, 1), but for lists of landmarks.
    let mut end = |index: i64| {
        let end = g.gather(points, &[index], 1);
        g.gather(end, &[0, 1], 2)
    };
    let (right, left) = (end(settings.right), end(settings.left));
    let line = g.binary("Sub", right, left);
    let squares = g.binary("Mul", line, line);
    let axis = g.ints(&[2]);
    let sum = g.node(
        "ReduceSum",
        &[squares, axis],
        vec![Attribute::int("keepdims", 1)],
    );
    let length = g.node("Sqrt", &[sum], Vec::new());
    // Two landmarks at one place have no direction: zero is one that keeps all results finite.
    let tiny = g.scalar(f32::MIN_POSITIVE);
    let length = g.binary("Max", length, tiny);
    let unit = g.binary("Div", line, length);
    let cos = g.gather(unit, &[0], 2);
    // The box is turned against the line.
    let sin = g.gather(unit, &[1], 2);
    let sin = g.node("Neg", &[sin], Vec::new());

    let subset = g.gather(points, &settings.subset, 1);
    let (x, y) = (g.gather(subset, &[0], 2), g.gather(subset, &[1], 2));
    let turned = [
        rotated(g, "Sub", [x, cos], [y, sin]),
        rotated(g, "Add", [x, sin], [y, cos]),
    ];
    let half = g.scalar(0.5);
    let mut sizes = [half; 2];
    let mut centres = [half; 2];
    for (k, list) in turned.into_iter().enumerate() {
        let axis = g.ints(&[1]);
        let [high, low] = ["ReduceMax", "ReduceMin"]
            .map(|op| g.node(op, &[list, axis], vec![Attribute::int("keepdims", 1)]));
        let extent = g.binary("Sub", high, low);
        let scale = g.scalar(settings.scale[k]);
        sizes[k] = g.binary("Mul", extent, scale);
        let sum = g.binary("Add", high, low);
        centres[k] = g.binary("Mul", sum, half);
    }
    let [cx, cy] = centres;
    // The centre, turned back.
    let qx = rotated(g, "Add", [cx, cos], [cy, sin]);
    let qy = rotated(g, "Sub", [cy, cos], [cx, sin]);

    // Shift to the centre, turn back, scale to the box, shift by half, scale from the part's pixels.
    let [width, height] = sizes;
    let cos_w = g.binary("Mul", cos, width);
    let sin_w = g.binary("Mul", sin, width);
    let cos_h = g.binary("Mul", cos, height);
    let sin_h = g.binary("Mul", sin, height);
    let minus_sin_w = g.node("Neg", &[sin_w], Vec::new());
    let zero = g.floats(&[1, 1, 1], &[0.0]);
    let [per_x, per_y] = settings.size.map(|size| g.scalar(1.0 / size));
    let mut row = |first, second, corner: &str, of: [Value; 2], centre| {
        let a = g.binary("Mul", first, per_x);
        let b = g.binary("Mul", second, per_y);
        let corner = g.binary(corner, of[0], of[1]);
        let corner = g.binary("Mul", corner, half);
        let shift = g.binary("Sub", centre, corner);
        g.concat(&[a, b, zero, shift], 2)
    };
    let first = row(cos_w, sin_h, "Add", [cos_w, sin_h], qx);
    let second = row(minus_sin_w, cos_h, "Sub", [cos_h, sin_w], qy);
    let rest = g.floats(&[1, 2, 4], &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    Ok(g.concat(&[first, second, rest], 1))
}

/// How many landmarks `tensor` is a list of, and how many numbers each has.
fn list_of_landmarks(emitter: &Emitter<'_>, tensor: usize) -> Result<(usize, usize), ConvertError> {
    match *emitter.shape(tensor) {
        [1, landmarks, numbers] if numbers >= 2 => Ok((landmarks, numbers)),
        _ => Err(emitter.unsupported("its input is no list of landmarks")),
    }
}

/// The sum or difference of two products.
fn rotated(g: &mut Builder, op: &str, first: [Value; 2], second: [Value; 2]) -> Value {
    let first = g.node("Mul", &first, Vec::new());
    let second = g.node("Mul", &second, Vec::new());
    g.binary(op, first, second)
}

/// TransformTensorBilinear: the part of a picture that a transform leads to, zero outside the picture.
pub(super) fn transform_tensor(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let (input, transform) = (emitter.input(op, 0)?, emitter.input(op, 1)?);
    let [_, height, width, _] = emitter.picture(emitter.shape(input))?;
    let [number, rows, columns, _] = emitter.picture(emitter.output_shape(op))?;
    if number != 1
        || emitter.shape(transform) != [1, 4, 4]
        || [height, width, rows, columns]
            .iter()
            .any(|side| *side > 4096)
    {
        return Err(emitter.unsupported("it is for one picture and one transform"));
    }
    emitter.graph.reserve(8 * rows * columns)?;
    let (value, transform) = (emitter.value(input)?, emitter.value(transform)?);
    let g = &mut emitter.graph;
    let centres: Vec<f32> = (0..rows)
        .flat_map(|y| (0..columns).flat_map(move |x| [x, y]))
        .map(|k| small(k) + 0.5)
        .collect();
    let centres = g.floats(&[1, rows * columns, 2], &centres);
    let pixels = g.transformed(centres, transform);
    // GridSample has the picture from -1 to 1, from its first pixel's outer edge to its last one's.
    let scale = g.floats(&[2], &[2.0 / small(width), 2.0 / small(height)]);
    let one = g.scalar(1.0);
    let grid = g.binary("Mul", pixels, scale);
    let grid = g.binary("Sub", grid, one);
    let grid = g.reshape(grid, &[1, rows, columns, 2]);
    Ok(g.node(
        "GridSample",
        &[value, grid],
        vec![
            Attribute::string("mode", "linear"),
            Attribute::string("padding_mode", "zeros"),
            Attribute::int("align_corners", 0),
        ],
    ))
}

/// A side of a picture, or an index below it.
fn small(value: usize) -> f32 {
    u16::try_from(value).map_or(f32::MAX, f32::from)
}

/// TransformLandmarks: x and y by a transform, the rest as it is.
pub(super) fn transform_landmarks(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let (input, transform) = (emitter.input(op, 0)?, emitter.input(op, 1)?);
    let (_, numbers) = list_of_landmarks(emitter, input)?;
    if emitter.shape(transform) != [1, 4, 4] {
        return Err(emitter.unsupported("it is for one transform"));
    }
    let (points, transform) = (emitter.value(input)?, emitter.value(transform)?);
    let g = &mut emitter.graph;
    if numbers == 2 {
        return Ok(g.transformed(points, transform));
    }
    let flat = g.slice(points, &[0], &[2], &[2]);
    let rest = g.slice(points, &[2], &[i32::MAX.into()], &[2]);
    let moved = g.transformed(flat, transform);
    Ok(g.concat(&[moved, rest], 2))
}
