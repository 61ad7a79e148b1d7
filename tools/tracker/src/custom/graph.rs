//! What an ONNX file declares, and the same file with a batch of one and only the outputs that are used.
//!
//! Exports leave the batch open as a rule, and give more than is wanted: the runtime computes nothing for outputs that are gone. All but
//! the declarations is copied as it is.

use npu_runtime::TensorSpec;
use onnx_schema::data_type::FLOAT;
use onnx_schema::{Dimension, ValueInfo};
use prost::Message;

/// Numbers of the largest output that is read: over three times those of 133 landmarks as bins of 2048 pixels, 16 a pixel.
const MOST_NUMBERS: usize = 1 << 24;
/// `ModelProto.graph`.
const GRAPH: u64 = 7;
/// `GraphProto.initializer`, `.input` and `.output`.
const INITIALIZER: u64 = 5;
const INPUT: u64 = 11;
const OUTPUT: u64 = 12;
/// Protobuf's wire type of what has a length.
const LENGTH: u64 = 2;

/// Of an initializer, its name: [`onnx_schema::Tensor`] would copy its weights.
#[derive(Clone, PartialEq, Message)]
struct Named {
    #[prost(string, tag = "8")]
    name: String,
}

/// A network as it is to be loaded.
#[derive(Debug)]
pub(super) struct Narrowed {
    pub(super) onnx: Vec<u8>,
    pub(super) input: TensorSpec,
    /// In the order that was asked for; none has more than [`MOST_NUMBERS`].
    pub(super) outputs: Vec<TensorSpec>,
}

/// Gives `onnx` the `input` and the outputs of these names; says why it cannot.
pub(super) fn narrow(onnx: &[u8], input: TensorSpec, outputs: &[&str]) -> Result<Narrowed, String> {
    let graph = fields(onnx)
        .find_map(|field| match field {
            Ok(field) if field.number == GRAPH => field.content.map(Ok),
            Ok(_) => None,
            Err(why) => Some(Err(why)),
        })
        .ok_or_else(|| NO_ONNX.to_owned())??;
    let (mut declared, mut given, mut constants) = (Vec::new(), Vec::new(), Vec::new());
    for field in fields(graph) {
        let field = field?;
        let content = field.content.unwrap_or_default();
        let broken = |_| NO_ONNX.to_owned();
        match field.number {
            INPUT => declared.push(ValueInfo::decode(content).map_err(broken)?),
            OUTPUT => given.push(ValueInfo::decode(content).map_err(broken)?),
            INITIALIZER => constants.push(Named::decode(content).map_err(broken)?.name),
            _ => {}
        }
    }
    // Files of old versions list constants among the inputs.
    let is_constant = |one: &ValueInfo| constants.iter().any(|constant| constant == one.name());
    let free: Vec<_> = declared.iter().filter(|one| !is_constant(one)).collect();
    check_input(&free, &input)?;
    let mut specs = Vec::new();
    for wanted in outputs {
        let found = given.iter().find(|one| one.name() == *wanted);
        let found =
            found.ok_or_else(|| format!("it has no output {wanted}, but {}", list(&given)))?;
        specs.push(static_output(found)?);
    }

    let mut narrowed = Vec::with_capacity(graph.len());
    let named = declared.iter().filter(|one| is_constant(one));
    for field in fields(graph) {
        let field = field?;
        if ![INPUT, OUTPUT].contains(&field.number) {
            narrowed.extend_from_slice(field.whole);
        }
    }
    put(&mut narrowed, INPUT, &value_info(&input).encode_to_vec());
    for constant in named {
        put(&mut narrowed, INPUT, &constant.encode_to_vec());
    }
    for output in &specs {
        put(&mut narrowed, OUTPUT, &value_info(output).encode_to_vec());
    }
    let mut all = Vec::with_capacity(onnx.len());
    for field in fields(onnx) {
        let field = field?;
        if field.number == GRAPH {
            put(&mut all, GRAPH, &narrowed);
        } else {
            all.extend_from_slice(field.whole);
        }
    }
    Ok(Narrowed {
        onnx: all,
        input,
        outputs: specs,
    })
}

fn check_input(free: &[&ValueInfo], input: &TensorSpec) -> Result<(), String> {
    let [one] = free else {
        return Err(format!(
            "it has {} inputs ({}), but one picture is all that it is given: bind the others when it is exported",
            free.len(),
            list(free.iter().copied())
        ));
    };
    let sides = sides(one);
    let fits = sides.as_ref().is_none_or(|sides| {
        sides.len() == input.shape.len()
            && sides
                .iter()
                .zip(&input.shape)
                .all(|(got, need)| got.is_none_or(|got| got == *need))
    });
    if one.name() != input.name || !fits || element(one) != Some(FLOAT) {
        return Err(format!(
            "its input is {}, but the description's is {}: float{:?}",
            list([*one]),
            input.name,
            input.shape
        ));
    }
    Ok(())
}

fn static_output(one: &ValueInfo) -> Result<TensorSpec, String> {
    if element(one) != Some(FLOAT) {
        return Err(format!(
            "its output {} is not of 32-bit floats: cast it when it is exported",
            list([one])
        ));
    }
    let open = || {
        format!(
            "its output {} has an open shape: export it with a fixed input size",
            list([one])
        )
    };
    let shape: Option<Vec<usize>> = sides(one)
        .ok_or_else(open)?
        .into_iter()
        .enumerate()
        // The first side is the batch.
        .map(|(at, side)| side.or((at == 0).then_some(1)))
        .collect();
    let shape = shape.ok_or_else(open)?;
    shape
        .iter()
        .try_fold(1_usize, |count, side| count.checked_mul(*side))
        .filter(|count| *count <= MOST_NUMBERS)
        .ok_or_else(|| {
            format!(
                "its output {} has more than {MOST_NUMBERS} numbers, which is more than any meaning needs",
                list([one])
            )
        })?;
    Ok(TensorSpec::new(one.name(), &shape))
}

fn element(one: &ValueInfo) -> Option<i32> {
    one.r#type.as_ref()?.tensor_type.as_ref()?.elem_type
}

/// The sides of a tensor, nothing where they are open.
fn sides(one: &ValueInfo) -> Option<Vec<Option<usize>>> {
    let tensor = one.r#type.as_ref()?.tensor_type.as_ref()?;
    let side = |side: &Dimension| {
        side.dim_value
            .and_then(|v| usize::try_from(v).ok())
            .filter(|v| *v > 0)
    };
    Some(tensor.shape.as_ref()?.dim.iter().map(side).collect())
}

fn list<'a>(all: impl IntoIterator<Item = &'a ValueInfo>) -> String {
    let one = |one: &ValueInfo| {
        let kind = match element(one) {
            Some(FLOAT) => "float",
            _ => "other than float",
        };
        let sides = sides(one).map_or("[..]".to_owned(), |sides| {
            let sides: Vec<_> = sides
                .iter()
                .map(|side| side.map_or("?".to_owned(), |side| side.to_string()))
                .collect();
            format!("[{}]", sides.join(", "))
        });
        format!("{}: {kind}{sides}", one.name())
    };
    let all: Vec<_> = all.into_iter().map(one).collect();
    if all.is_empty() {
        "none".to_owned()
    } else {
        all.join(", ")
    }
}

fn value_info(spec: &TensorSpec) -> ValueInfo {
    let sides = spec.shape.iter().map(|side| i64::try_from(*side));
    // Each side is that of an input of at most 2048 pixels, or was an i64.
    let sides: Vec<i64> = sides.map(|side| side.unwrap_or(i64::MAX)).collect();
    ValueInfo::float(&spec.name, &sides)
}

const NO_ONNX: &str = "it is no ONNX file, or a damaged one";

/// One field of a protobuf message.
struct Field<'a> {
    number: u64,
    /// With its key.
    whole: &'a [u8],
    /// Of a field that has a length.
    content: Option<&'a [u8]>,
}

/// The fields of a message; ends after the first that is broken.
fn fields(message: &[u8]) -> impl Iterator<Item = Result<Field<'_>, String>> {
    let mut rest = Some(message);
    std::iter::from_fn(move || {
        let from = rest.take().filter(|from| !from.is_empty())?;
        let field = next_field(from);
        if let Some((_, after)) = &field {
            rest = Some(after);
        }
        Some(field.map(|(field, _)| field).ok_or(NO_ONNX.to_owned()))
    })
}

fn next_field(from: &[u8]) -> Option<(Field<'_>, &[u8])> {
    let mut rest = from;
    let key = prost::encoding::decode_varint(&mut rest).ok()?;
    let mut content = None;
    match key & 7 {
        0 => {
            prost::encoding::decode_varint(&mut rest).ok()?;
        }
        1 => rest = rest.get(8..)?,
        LENGTH => {
            let length = prost::encoding::decode_varint(&mut rest).ok()?;
            let (inside, after) = rest.split_at_checked(usize::try_from(length).ok()?)?;
            content = Some(inside);
            rest = after;
        }
        5 => rest = rest.get(4..)?,
        _ => return None,
    }
    let field = Field {
        number: key >> 3,
        whole: from.get(..from.len() - rest.len())?,
        content,
    };
    Some((field, rest))
}

/// Writes a field that has a length.
fn put(to: &mut Vec<u8>, number: u64, content: &[u8]) {
    prost::encoding::encode_varint(number << 3 | LENGTH, to);
    prost::encoding::encode_varint(content.len() as u64, to);
    to.extend_from_slice(content);
}
