//! Convolutions and pools: a window that moves over a picture.

use super::{Emitter, STORED};
use crate::array::Array;
use crate::error::ConvertError;
use crate::graph::{Value, i64_of};
use crate::model::Operator;
use onnx_schema::Attribute;

/// Most of a stride, dilation or window's side.
const MAX_SIDE: usize = 1 << 12;

/// A window along one axis.
#[derive(Debug, Clone, Copy)]
struct Axis {
    input: usize,
    window: usize,
    stride: usize,
    dilation: usize,
}

impl Axis {
    /// How many steps it takes, and the zeros before and after the input. With `same`, as many zeros as let every stride begin within the
    /// input, the odd one at the end; else none (TensorFlow's "SAME" and "VALID": tf.nn.convolution). Nothing if it does not fit.
    fn steps(self, same: bool) -> Option<(usize, [usize; 2])> {
        let extent = self.window.checked_sub(1)? * self.dilation + 1;
        if !same {
            let room = self.input.checked_sub(extent)?;
            return Some((room / self.stride + 1, [0, 0]));
        }
        let steps = self.input.div_ceil(self.stride);
        let zeros = (steps.checked_sub(1)? * self.stride + extent).saturating_sub(self.input);
        Some((steps, [zeros / 2, zeros - zeros / 2]))
    }
}

/// A window's movement as ONNX's attributes, after a check that it gives the output's size. `strides` and `dilations` are the settings'
/// height and width.
fn movement(
    emitter: &Emitter<'_>,
    op: &Operator<'_>,
    window: [usize; 2],
    strides: [i32; 2],
    dilations: [i32; 2],
) -> Result<Vec<Attribute>, ConvertError> {
    let sides = |values: [i32; 2]| -> Option<[usize; 2]> {
        let [h, w] = values.map(|value| usize::try_from(value).ok());
        Some([h?, w?]).filter(|sides| sides.iter().all(|side| (1..=MAX_SIDE).contains(side)))
    };
    let strange = || emitter.unsupported("its window's size, stride or dilation is out of range");
    let strides = sides(strides).ok_or_else(strange)?;
    let dilations = sides(dilations).ok_or_else(strange)?;
    let [_, height, width, _] = emitter.picture(emitter.shape(emitter.input(op, 0)?))?;
    let [_, steps_y, steps_x, _] = emitter.picture(emitter.output_shape(op))?;
    let same = match op.byte(0)? {
        0 => true,
        1 => false,
        other => return Err(emitter.unsupported(format!("padding {other} is not known"))),
    };
    let axis = |input, k: usize| Axis {
        input,
        window: window[k],
        stride: strides[k],
        dilation: dilations[k],
    };
    let (y, x) = (axis(height, 0).steps(same), axis(width, 1).steps(same));
    let (Some((found_y, [top, bottom])), Some((found_x, [left, right]))) = (y, x) else {
        return Err(emitter.unsupported("its window is larger than the picture"));
    };
    if [found_y, found_x] != [steps_y, steps_x] || window.iter().any(|side| *side > MAX_SIDE) {
        return Err(emitter.unsupported("its result has another size than its window gives"));
    }
    let mut attributes = vec![
        Attribute::ints("kernel_shape", &window.map(i64_of)),
        Attribute::ints("strides", &strides.map(i64_of)),
        Attribute::ints("pads", &[top, left, bottom, right].map(i64_of)),
    ];
    if dilations != [1, 1] {
        attributes.push(Attribute::ints("dilations", &dilations.map(i64_of)));
    }
    Ok(attributes)
}

/// CONV_2D. Its settings: padding, stride's width and height, activation, dilation's width and height.
pub(super) fn convolve(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let weights = emitter.input(op, 1)?;
    // Of each output channel: height, width, input channels.
    let weights = emitter.floats(weights)?.permuted(STORED)?;
    let dilations = [op.int(5, 1)?, op.int(4, 1)?];
    weighted(emitter, op, weights, dilations, op.byte(3)?)
}

/// DEPTHWISE_CONV_2D. Its settings: padding, stride's width and height, outputs of each channel, activation, dilation's width and height.
pub(super) fn convolve_depthwise(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let weights = emitter.input(op, 1)?;
    // One, height, width, output channels.
    let weights = emitter.floats(weights)?.permuted([3, 0, 1, 2])?;
    let dilations = [op.int(6, 1)?, op.int(5, 1)?];
    weighted(emitter, op, weights, dilations, op.byte(4)?)
}

/// A convolution with `weights`: output channels, input channels of each, height, width.
fn weighted(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
    weights: Array,
    dilations: [i32; 2],
    activation: u8,
) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let [_, _, _, channels] = emitter.picture(emitter.shape(input))?;
    let [_, _, _, results] = emitter.picture(emitter.output_shape(op))?;
    let [outer, inner, height, width] = emitter.picture(&weights.shape)?;
    let groups = channels / inner;
    if groups == 0 || channels % inner != 0 || outer % groups != 0 || outer != results {
        return Err(emitter.unsupported(format!(
            "its weights are for {inner} to {outer} channels, its picture has {channels}, its result {results}"
        )));
    }
    let mut attributes = movement(
        emitter,
        op,
        [height, width],
        [op.int(2, 0)?, op.int(1, 0)?],
        dilations,
    )?;
    if groups != 1 {
        attributes.push(Attribute::int("group", i64_of(groups)));
    }
    let mut inputs = vec![
        emitter.value(input)?,
        emitter.graph.floats(&weights.shape, &weights.values),
    ];
    if let Some(bias) = Emitter::optional(op, 2) {
        let bias = emitter.floats(bias)?;
        if bias.values.len() != outer {
            return Err(emitter.unsupported("its bias has another length than its result"));
        }
        inputs.push(emitter.graph.floats(&[outer], &bias.values));
    }
    let value = emitter.graph.node("Conv", &inputs, attributes);
    emitter.activate(value, activation)
}

/// MAX_POOL_2D or AVERAGE_POOL_2D, ONNX's `kind`. Their settings: padding, stride's width and height, window's width and height,
/// activation. Neither TensorFlow Lite's average nor ONNX's counts the zeros around the picture.
pub(super) fn pool(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
    kind: &str,
) -> Result<Value, ConvertError> {
    let window = [op.int(4, 0)?, op.int(3, 0)?].map(|side| usize::try_from(side).unwrap_or(0));
    let strides = [op.int(2, 0)?, op.int(1, 0)?];
    let attributes = movement(emitter, op, window, strides, [1, 1])?;
    let input = emitter.input(op, 0)?;
    let input = emitter.value(input)?;
    let value = emitter.graph.node(kind, &[input], attributes);
    emitter.activate(value, op.byte(5)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(input: usize, window: usize, stride: usize, dilation: usize) -> Axis {
        Axis {
            input,
            window,
            stride,
            dilation,
        }
    }

    /// What tf.nn.max_pool2d and tf.nn.conv2d give.
    #[test]
    fn padding_is_tensorflows() {
        assert_eq!(
            axis(224, 3, 2, 1).steps(true),
            Some((112, [0, 1])),
            "even, stride 2"
        );
        assert_eq!(
            axis(225, 3, 2, 1).steps(true),
            Some((113, [1, 1])),
            "odd, stride 2"
        );
        assert_eq!(
            axis(14, 5, 1, 1).steps(true),
            Some((14, [2, 2])),
            "stride 1"
        );
        assert_eq!(
            axis(8, 2, 2, 1).steps(true),
            Some((4, [0, 0])),
            "no overlap"
        );
        assert_eq!(
            axis(7, 1, 2, 1).steps(true),
            Some((4, [0, 0])),
            "a window below the stride"
        );
        assert_eq!(axis(16, 3, 1, 2).steps(true), Some((16, [2, 2])), "dilated");
        assert_eq!(
            axis(16, 3, 1, 2).steps(false),
            Some((12, [0, 0])),
            "dilated, valid"
        );
        assert_eq!(
            axis(225, 3, 2, 1).steps(false),
            Some((112, [0, 0])),
            "valid"
        );
        assert_eq!(axis(2, 3, 1, 1).steps(false), None, "too small");
        assert_eq!(axis(4, 0, 1, 1).steps(false), None, "no window");
    }

    /// Every step of a padded window lies within the padded input, and one more would not.
    #[test]
    fn a_window_ends_where_the_padded_picture_ends() {
        for input in 1..40 {
            for (window, stride, dilation) in
                (0..60).map(|k| (1 + k % 5, 1 + k / 5 % 4, 1 + k / 20))
            {
                let axis = axis(input, window, stride, dilation);
                for same in [false, true] {
                    let Some((steps, [before, after])) = axis.steps(same) else {
                        continue;
                    };
                    let extent = (window - 1) * dilation + 1;
                    let end = (steps - 1) * stride + extent;
                    let room = input + before + after;
                    assert!(end <= room && room < end + stride, "{axis:?} {same}");
                }
            }
        }
    }
}
