//! Windows that move over pictures: convolutions and pools.

use super::{Operator, Read, Reader, only, sides};
use crate::emitter::Emitter;
use crate::shape::i64s;
use onnx_schema::Attribute;

/// Most steps that a window takes before it no longer overlaps itself, along one axis.
const MOST_OVERLAPS: usize = 8;
/// Most of a stride, or of a window's side.
const MOST_SIDE: usize = 1 << 12;

/// Rows and columns of a picture [n, channels, rows, columns].
const PLANE: [usize; 2] = [2, 3];

/// How a window moves: rows, then columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Window {
    sides: [usize; 2],
    strides: [usize; 2],
    /// Pixels of nothing before the picture.
    before: [usize; 2],
    /// And after it.
    after: [usize; 2],
}

/// How a pool's window moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Pool(Window);

impl Window {
    fn read(node: &Reader<'_>, sides: [usize; 2]) -> Result<Self, String> {
        let padded = node.attribute("auto_pad").and_then(|one| one.s.as_deref());
        if !matches!(padded, None | Some(b"NOTSET" | b"VALID")) {
            return Err("it has auto_pad: export it with pads".to_owned());
        }
        only(node, "dilations", &[1, 1])?;
        let strides = match node.attribute("strides") {
            Some(attribute) => self::sides(&attribute.ints).ok_or("its strides are not two")?,
            None => [1, 1],
        };
        let pads = match node.attribute("pads") {
            Some(attribute) => self::sides(&attribute.ints).ok_or("its pads are not four")?,
            None => [0; 4],
        };
        let possible = sides.iter().chain(&strides);
        if !possible.clone().all(|side| (1..=MOST_SIDE).contains(side))
            || pads.iter().any(|pad| *pad > MOST_SIDE)
        {
            return Err("its window's side, stride or pad is out of range".to_owned());
        }
        let [top, left, bottom, right] = pads;
        Ok(Self {
            sides,
            strides,
            before: [top, left],
            after: [bottom, right],
        })
    }

    /// Steps along an axis of so many pixels; with `ceil`, one that the window begins within the picture and ends beyond it as well.
    fn steps(&self, axis: usize, pixels: usize, ceil: bool) -> Result<usize, String> {
        let padded = pixels
            .saturating_add(self.before[axis])
            .saturating_add(self.after[axis]);
        let room = padded
            .checked_sub(self.sides[axis])
            .ok_or("its window is larger than the picture")?;
        let stride = self.strides[axis];
        if !ceil {
            return Ok(room / stride + 1);
        }
        let steps = room.div_ceil(stride) + 1;
        if (steps - 1) * stride >= pixels + self.before[axis] {
            return Err("its last window begins beyond the picture".to_owned());
        }
        Ok(steps)
    }
}

/// A picture's shape.
fn picture(shape: &[usize]) -> Result<[usize; 4], String> {
    <[usize; 4]>::try_from(shape).map_err(|_| format!("it is not of pictures, but of {shape:?}"))
}

/// `Conv`.
pub(super) fn conv(node: &Reader<'_>) -> Result<Read, String> {
    only(node, "group", &[1])?;
    let [count, channels, rows, columns] = picture(node.shape(0)?)?;
    let [outer, inner, high, wide] = picture(node.shape(1)?)?;
    if inner != channels {
        return Err(format!(
            "its weights are for {inner} channels, its picture has {channels}"
        ));
    }
    let window = Window::read(node, [high, wide])?;
    let shape = vec![
        count,
        outer,
        window.steps(0, rows, false)?,
        window.steps(1, columns, false)?,
    ];
    Ok(Read::new(Operator::Conv(window), shape))
}

/// `MaxPool`.
pub(super) fn max_pool(node: &Reader<'_>) -> Result<Read, String> {
    only(node, "storage_order", &[0])?;
    let [count, channels, rows, columns] = picture(node.shape(0)?)?;
    let kernel = node.attribute("kernel_shape").map(|one| &one.ints[..]);
    let kernel = sides(kernel.unwrap_or_default()).ok_or("its window has not two sides")?;
    let window = Window::read(node, kernel)?;
    let ceil = node.int("ceil_mode", 0) != 0;
    let shape = vec![
        count,
        channels,
        window.steps(0, rows, ceil)?,
        window.steps(1, columns, ceil)?,
    ];
    Ok(Read::new(Operator::MaxPool(Pool(window)), shape))
}

impl Window {
    /// The derivatives by a convolution's picture. Shapes are those of the picture and of what the convolution gives.
    ///
    /// Where each step is one pixel they are a convolution as well, with the weights turned about: the runtime folds their turning when it loads the
    /// network, and has its fastest code for convolutions.
    pub(super) fn pull_back_conv(
        &self,
        emitter: &mut Emitter,
        weights: &str,
        [picture, given]: [&[usize]; 2],
        by_output: &str,
    ) -> Result<String, String> {
        // What the others pad by so that the picture has its size again.
        let mirrored = |pads: [usize; 2]| -> Option<Vec<usize>> {
            (pads.iter().zip(self.sides))
                .map(|(pad, side)| (side - 1).checked_sub(*pad))
                .collect()
        };
        if let (Some(before), Some(after), [1, 1]) =
            (mirrored(self.before), mirrored(self.after), self.strides)
        {
            let mut turned = emitter.transposed(weights, &[1, 0, 2, 3]);
            if self.sides != [1, 1] {
                turned = emitter.reversed(&turned, &PLANE);
            }
            let settings = [
                Attribute::ints("kernel_shape", &i64s(&self.sides)),
                Attribute::ints("pads", &i64s(&[before, after].concat())),
            ];
            return Ok(emitter.node("Conv", &[by_output, &turned], &settings));
        }
        let mut lacking = [0; 2];
        for (axis, lacking) in lacking.iter_mut().enumerate() {
            let reached = (given[PLANE[axis]] - 1) * self.strides[axis] + self.sides[axis];
            let whole = picture[PLANE[axis]] + self.before[axis] + self.after[axis];
            *lacking = whole.checked_sub(reached).ok_or("its shape is another")?;
        }
        let settings = [
            Attribute::ints("kernel_shape", &i64s(&self.sides)),
            Attribute::ints("strides", &i64s(&self.strides)),
            Attribute::ints("pads", &i64s(&[self.before, self.after].concat())),
            // Pixels at the end that no window reaches.
            Attribute::ints("output_padding", &i64s(&lacking)),
        ];
        Ok(emitter.node("ConvTranspose", &[by_output, weights], &settings))
    }
}

impl Pool {
    /// The derivatives by a pool's picture: each goes to the pixel that was the largest of its window. Shapes are those of the picture and of what the pool gives.
    ///
    /// `MaxUnpool` puts numbers where they belong but does not add them up, so windows that overlap are taken apart into sets of windows that do not.
    pub(super) fn pull_back(
        &self,
        emitter: &mut Emitter,
        (input, settings): (&str, &[Attribute]),
        [picture, given]: [&[usize]; 2],
        by_output: &str,
    ) -> Result<String, String> {
        let overlaps = [0, 1].map(|axis| self.0.sides[axis].div_ceil(self.0.strides[axis]));
        if overlaps.iter().any(|overlaps| *overlaps > MOST_OVERLAPS) {
            return Err(format!(
                "its window overlaps itself by more than {MOST_OVERLAPS} steps"
            ));
        }
        let places = emitter.second("MaxPool", &[input], settings);
        let size = emitter.sides(picture);
        let one = [
            Attribute::ints("kernel_shape", &[1, 1]),
            Attribute::ints("strides", &[1, 1]),
        ];
        let ends = [given[PLANE[0]], given[PLANE[1]]];
        let mut parts = Vec::new();
        for row in 0..overlaps[0].min(ends[0]) {
            for column in 0..overlaps[1].min(ends[1]) {
                let mut set = |values: &str| {
                    if overlaps == [1, 1] {
                        return values.to_owned();
                    }
                    emitter.slice(values, &PLANE, &[row, column], &ends, &overlaps)
                };
                let (numbers, places) = (set(by_output), set(&places));
                parts.push(emitter.node("MaxUnpool", &[&numbers, &places, &size], &one));
            }
        }
        emitter
            .sum(&parts)
            .ok_or_else(|| "it gives nothing".to_owned())
    }
}
