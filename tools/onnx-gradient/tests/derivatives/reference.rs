//! ONNX's operators in f64, as the standard states them, one number after the other.

use onnx_schema::{Graph, Node, Tensor, data_type};
use std::collections::HashMap;

/// A value: its shape and its numbers, the last dimension's neighbours side by side. Integers are numbers as well.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f64>,
}

impl Array {
    pub(crate) fn new(shape: &[usize], values: Vec<f64>) -> Self {
        assert_eq!(values.len(), shape.iter().product::<usize>(), "as many");
        Self {
            shape: shape.to_vec(),
            values,
        }
    }

    fn of(shape: &[usize], value: impl Fn(&[usize]) -> f64) -> Self {
        let count = shape.iter().product();
        let values = (0..count).map(|flat| value(&place(flat, shape))).collect();
        Self::new(shape, values)
    }

    /// The number at a place whose dimensions are aligned at the end; one of 1 is repeated.
    fn at(&self, place: &[usize]) -> f64 {
        let place = &place[place.len() - self.shape.len()..];
        let sides = place.iter().zip(&self.shape);
        let flat = sides.fold(0, |flat, (at, side)| {
            flat * side + if *side == 1 { 0 } else { *at }
        });
        self.values[flat]
    }

    fn list(&self) -> Vec<i64> {
        #[expect(clippy::cast_possible_truncation, reason = "small integers")]
        self.values.iter().map(|value| *value as i64).collect()
    }
}

/// A side or index.
pub(crate) fn whole(number: i64) -> usize {
    usize::try_from(number).expect("no negative number")
}

fn place(mut flat: usize, shape: &[usize]) -> Vec<usize> {
    let mut place = vec![0; shape.len()];
    for (at, side) in place.iter_mut().zip(shape).rev() {
        *at = flat % side;
        flat /= side;
    }
    place
}

fn stored(tensor: &Tensor) -> Array {
    let shape: Vec<usize> = tensor.dims.iter().map(|side| whole(*side)).collect();
    let raw = tensor.raw_data.as_deref().expect("raw");
    let values = match tensor.data_type.expect("a type") {
        data_type::FLOAT => (raw.chunks_exact(4))
            .map(|bytes| f64::from(f32::from_le_bytes(bytes.try_into().expect("four"))))
            .collect(),
        data_type::INT64 => (raw.chunks_exact(8))
            .map(|bytes| i64::from_le_bytes(bytes.try_into().expect("eight")) as f64)
            .collect(),
        data_type::BOOL => raw.iter().map(|byte| f64::from(*byte)).collect(),
        other => panic!("type {other}"),
    };
    Array::new(&shape, values)
}

/// What the network gives for `inputs`.
pub(crate) fn run(graph: &Graph, inputs: &[(&str, &Array)]) -> f64 {
    let mut values: HashMap<&str, Array> = HashMap::new();
    for tensor in &graph.initializer {
        values.insert(tensor.name.as_deref().expect("a name"), stored(tensor));
    }
    for (name, value) in inputs {
        values.insert(name, (*value).clone());
    }
    for node in &graph.node {
        let taken: Vec<&Array> = (node.input.iter())
            .filter(|name| !name.is_empty())
            .map(|name| &values[name.as_str()])
            .collect();
        let given = operator(node, &taken);
        values.insert(&node.output[0], given);
    }
    let output = &values[graph.output[0].name.as_deref().expect("a name")];
    assert_eq!(output.values.len(), 1, "a number");
    output.values[0]
}

fn ints(node: &Node, name: &str) -> Option<Vec<i64>> {
    let mut all = node.attribute.iter();
    let found = all.find(|one| one.name.as_deref() == Some(name));
    found.map(|one| one.i.map_or_else(|| one.ints.clone(), |i| vec![i]))
}

fn int(node: &Node, name: &str, default: i64) -> i64 {
    ints(node, name).map_or(default, |list| list[0])
}

fn operator(node: &Node, x: &[&Array]) -> Array {
    let each = |function: &dyn Fn(f64) -> f64| {
        let values = x[0].values.iter().map(|value| function(*value)).collect();
        Array::new(&x[0].shape, values)
    };
    let axes = |at: usize, rank: usize| -> Option<Vec<usize>> {
        let list = ints(node, "axes").or_else(|| x.get(at).map(|list| list.list()))?;
        Some(
            list.iter()
                .map(|axis| whole(axis.rem_euclid(rank as i64)))
                .collect(),
        )
    };
    match node.op_type.as_deref().expect("an operator") {
        "Constant" => stored(node.attribute[0].t.as_ref().expect("a tensor")),
        "Identity" | "Dropout" => x[0].clone(),
        "Relu" => each(&|value| value.max(0.0)),
        "Sqrt" => each(&f64::sqrt),
        "Add" => two(x, |a, b| a + b),
        "Sub" => two(x, |a, b| a - b),
        "Mul" => two(x, |a, b| a * b),
        "Div" => two(x, |a, b| a / b),
        "Pow" => two(x, f64::powf),
        "ReduceSum" => reduced(node, x[0], axes(1, x[0].shape.len()), false),
        "ReduceMean" => reduced(node, x[0], axes(1, x[0].shape.len()), true),
        "Reshape" => {
            let wanted = x[1].list();
            let known: usize = (wanted.iter().enumerate())
                .filter(|(_, side)| **side != -1)
                .map(|(at, side)| {
                    if *side == 0 {
                        x[0].shape[at]
                    } else {
                        whole(*side)
                    }
                })
                .product();
            let shape: Vec<usize> = (wanted.iter().enumerate())
                .map(|(at, side)| match side {
                    0 => x[0].shape[at],
                    -1 => x[0].values.len() / known,
                    side => whole(*side),
                })
                .collect();
            Array::new(&shape, x[0].values.clone())
        }
        "Flatten" => {
            let axis = whole(int(node, "axis", 1).rem_euclid(x[0].shape.len() as i64 + 1));
            let sides = [&x[0].shape[..axis], &x[0].shape[axis..]];
            let shape = sides.map(|sides| sides.iter().product());
            Array::new(&shape, x[0].values.clone())
        }
        "Squeeze" => {
            let gone = axes(1, x[0].shape.len()).expect("axes");
            let shape = x[0].shape.iter().enumerate();
            let shape = shape.filter(|(at, _)| !gone.contains(at));
            let shape: Vec<usize> = shape.map(|(_, side)| *side).collect();
            Array::new(&shape, x[0].values.clone())
        }
        "Unsqueeze" => {
            let list = ints(node, "axes").unwrap_or_else(|| x[1].list());
            let mut shape = x[0].shape.clone();
            for axis in list {
                shape.insert(whole(axis), 1);
            }
            Array::new(&shape, x[0].values.clone())
        }
        "Concat" => concat(x, int(node, "axis", 0)),
        "Conv" => conv(node, x),
        "MaxPool" => max_pool(node, x[0]),
        other => panic!("{other}"),
    }
}

fn two(x: &[&Array], function: impl Fn(f64, f64) -> f64) -> Array {
    let rank = x[0].shape.len().max(x[1].shape.len());
    let mut shape = vec![1; rank];
    for array in x {
        let own = &mut shape[rank - array.shape.len()..];
        for (side, of) in own.iter_mut().zip(&array.shape) {
            *side = (*side).max(*of);
        }
    }
    Array::of(&shape, |place| function(x[0].at(place), x[1].at(place)))
}

fn reduced(node: &Node, x: &Array, axes: Option<Vec<usize>>, mean: bool) -> Array {
    let axes = axes.unwrap_or_else(|| (0..x.shape.len()).collect());
    let mut kept = x.shape.clone();
    for axis in &axes {
        kept[*axis] = 1;
    }
    let mut sums = vec![0.0; kept.iter().product()];
    for (flat, value) in x.values.iter().enumerate() {
        let place = place(flat, &x.shape);
        let to = place.iter().zip(&kept);
        let to = to.fold(0, |to, (at, side)| {
            to * side + if *side == 1 { 0 } else { *at }
        });
        sums[to] += value;
    }
    if mean {
        let count: usize = axes.iter().map(|axis| x.shape[*axis]).product();
        for sum in &mut sums {
            *sum /= count as f64;
        }
    }
    if int(node, "keepdims", 1) == 0 {
        let sides = kept.iter().enumerate();
        let sides = sides.filter(|(at, _)| !axes.contains(at));
        kept = sides.map(|(_, side)| *side).collect();
    }
    Array::new(&kept, sums)
}

fn concat(x: &[&Array], axis: i64) -> Array {
    let axis = whole(axis.rem_euclid(x[0].shape.len() as i64));
    let mut shape = x[0].shape.clone();
    shape[axis] = x.iter().map(|part| part.shape[axis]).sum();
    Array::of(&shape, |place| {
        let mut place = place.to_vec();
        for part in x {
            if place[axis] < part.shape[axis] {
                return part.at(&place);
            }
            place[axis] -= part.shape[axis];
        }
        panic!("beyond the last part")
    })
}

/// Strides, then pads: top, left, bottom, right.
fn movement(node: &Node) -> ([usize; 2], [usize; 4]) {
    let read = |name: &str, default: Vec<i64>| -> Vec<usize> {
        let list = ints(node, name).unwrap_or(default);
        list.iter().map(|side| whole(*side)).collect()
    };
    let strides = read("strides", vec![1; 2]);
    let pads = read("pads", vec![0; 4]);
    (
        strides.try_into().expect("two"),
        pads.try_into().expect("four"),
    )
}

/// The pixel of a padded picture, if it is within the picture.
fn within(at: usize, pad: usize, side: usize) -> Option<usize> {
    at.checked_sub(pad).filter(|at| *at < side)
}

fn conv(node: &Node, x: &[&Array]) -> Array {
    let ([down, across], [top, left, bottom, right]) = movement(node);
    let (picture, weights) = (x[0], x[1]);
    let [count, channels, rows, columns] = picture.shape[..].try_into().expect("a picture");
    let [outer, _, high, wide]: [usize; 4] = weights.shape[..].try_into().expect("weights");
    let steps = [
        (rows + top + bottom - high) / down + 1,
        (columns + left + right - wide) / across + 1,
    ];
    Array::of(&[count, outer, steps[0], steps[1]], |place| {
        let [n, o, y, x0] = place.try_into().expect("four");
        let mut sum = x.get(2).map_or(0.0, |bias| bias.values[o]);
        for c in 0..channels {
            for i in 0..high {
                for j in 0..wide {
                    let at = (
                        within(y * down + i, top, rows),
                        within(x0 * across + j, left, columns),
                    );
                    if let (Some(row), Some(column)) = at {
                        let pixel = ((n * channels + c) * rows + row) * columns + column;
                        let weight = ((o * channels + c) * high + i) * wide + j;
                        sum += picture.values[pixel] * weights.values[weight];
                    }
                }
            }
        }
        sum
    })
}

fn max_pool(node: &Node, picture: &Array) -> Array {
    let ([down, across], [top, left, bottom, right]) = movement(node);
    let kernel = ints(node, "kernel_shape").expect("a window");
    let [high, wide] = [whole(kernel[0]), whole(kernel[1])];
    let [count, channels, rows, columns] = picture.shape[..].try_into().expect("a picture");
    let steps = |room: usize, stride: usize| match int(node, "ceil_mode", 0) {
        0 => room / stride + 1,
        _ => room.div_ceil(stride) + 1,
    };
    let shape = [
        count,
        channels,
        steps(rows + top + bottom - high, down),
        steps(columns + left + right - wide, across),
    ];
    Array::of(&shape, |place| {
        let [n, c, y, x] = place.try_into().expect("four");
        let mut most = f64::NEG_INFINITY;
        for i in 0..high {
            for j in 0..wide {
                let at = (
                    within(y * down + i, top, rows),
                    within(x * across + j, left, columns),
                );
                if let (Some(row), Some(column)) = at {
                    most = most
                        .max(picture.values[((n * channels + c) * rows + row) * columns + column]);
                }
            }
        }
        most
    })
}
