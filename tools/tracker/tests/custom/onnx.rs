//! Tiny ONNX files, written field by field.

/// What an output gives.
#[derive(Clone)]
pub(crate) enum Gives {
    /// These numbers, whatever is seen.
    Constant(Vec<f32>),
    /// The input's first numbers.
    Input(usize),
}

/// An output: its name, its shape (0: open) and what it gives.
pub(crate) type Output<'a> = (&'a str, &'a [i64], Gives);

pub(crate) fn constant<'a>(name: &'a str, shape: &'a [i64], values: &[f32]) -> Output<'a> {
    (name, shape, Gives::Constant(values.to_vec()))
}

/// A network with one input.
pub(crate) fn network(input: (&str, &[i64]), outputs: &[Output<'_>]) -> Vec<u8> {
    let mut graph = text(2, "test");
    for (name, shape, gives) in outputs {
        let nodes = match gives {
            Gives::Constant(values) => {
                let kept = format!("{name}.kept");
                let shape: Vec<i64> = shape.iter().map(|side| (*side).max(1)).collect();
                let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
                graph.extend(field(5, &tensor(&kept, &shape, 1, &bytes)));
                vec![node("Identity", &[&kept], name)]
            }
            Gives::Input(count) => {
                let [flat, from, to, along, shape_name, first] =
                    ["flat", "from", "to", "along", "shape", "first"]
                        .map(|s| format!("{name}.{s}"));
                let shape: Vec<i64> = shape.iter().map(|side| (*side).max(1)).collect();
                for (name, values) in [
                    (&from, vec![0]),
                    (&to, vec![i64::try_from(*count).unwrap()]),
                    (&along, vec![1]),
                    (&shape_name, shape),
                ] {
                    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
                    let sides = [i64::try_from(values.len()).unwrap()];
                    graph.extend(field(5, &tensor(name, &sides, 7, &bytes)));
                }
                vec![
                    node("Flatten", &[input.0], &flat),
                    node("Slice", &[&flat, &from, &to, &along], &first),
                    node("Reshape", &[&first, &shape_name], name),
                ]
            }
        };
        for node in nodes {
            graph.extend(field(1, &node));
        }
        graph.extend(field(12, &value_info(name, shape)));
    }
    graph.extend(field(11, &value_info(input.0, input.1)));
    let mut model = number(1, 9);
    model.extend(field(8, &number(2, 13)));
    model.extend(field(7, &graph));
    model
}

fn node(operator: &str, inputs: &[&str], output: &str) -> Vec<u8> {
    let mut node: Vec<u8> = inputs.iter().flat_map(|input| text(1, input)).collect();
    node.extend(text(2, output));
    node.extend(text(4, operator));
    node
}

fn tensor(name: &str, shape: &[i64], kind: u64, bytes: &[u8]) -> Vec<u8> {
    let sides = shape.iter().map(|side| u64::try_from(*side).unwrap());
    let mut tensor: Vec<u8> = sides.flat_map(|side| number(1, side)).collect();
    tensor.extend(number(2, kind));
    tensor.extend(text(8, name));
    tensor.extend(field(9, bytes));
    tensor
}

fn value_info(name: &str, shape: &[i64]) -> Vec<u8> {
    let side = |side: &i64| match u64::try_from(*side) {
        Ok(0) | Err(_) => field(1, &text(2, "batch")),
        Ok(side) => field(1, &number(1, side)),
    };
    let shape: Vec<u8> = shape.iter().flat_map(side).collect();
    let mut kind = number(1, 1);
    kind.extend(field(2, &shape));
    let mut info = text(1, name);
    info.extend(field(2, &field(1, &kind)));
    info
}

fn text(number: u64, text: &str) -> Vec<u8> {
    field(number, text.as_bytes())
}

fn field(number: u64, content: &[u8]) -> Vec<u8> {
    let mut field = varint(number << 3 | 2);
    field.extend(varint(content.len() as u64));
    field.extend(content);
    field
}

fn number(field: u64, value: u64) -> Vec<u8> {
    let mut number = varint(field << 3);
    number.extend(varint(value));
    number
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value > 0x7f {
        bytes.push(value.to_le_bytes()[0] | 0x80);
        value >>= 7;
    }
    bytes.push(value.to_le_bytes()[0]);
    bytes
}
