//! Why a file cannot be converted.

/// A TensorFlow Lite file that cannot be converted. The text does not repeat the file's path: the caller names it in its own error.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// The bytes do not begin as a TensorFlow Lite file does.
    #[error(
        "this is no TensorFlow Lite model: it lacks the mark TFL3; `./run setup` fetches the networks that this program knows"
    )]
    NotTflite,
    /// The file is cut short or damaged.
    #[error("the TensorFlow Lite model is damaged ({what}); fetch it again")]
    Damaged {
        /// What does not fit.
        what: String,
    },
    /// The file asks for more than a converter should give.
    #[error(
        "the TensorFlow Lite model is too large: {what}, and at most {limit} are converted; this converter is for small networks"
    )]
    TooLarge {
        /// What there is too much of, with its number.
        what: String,
        /// How much is allowed.
        limit: usize,
    },
    /// The file has something that this converter does not know.
    #[error(
        "operator {operator} of the TensorFlow Lite model ({name}) cannot be converted: {why}; use a network made of the operators that \
         the documentation of the crate tflite-to-onnx lists, in 32-bit or 16-bit floats"
    )]
    Unsupported {
        /// Its place in the file's list of operators.
        operator: usize,
        /// Its kind.
        name: String,
        /// What is not known.
        why: String,
    },
    /// An input or output is of a kind that this converter does not know.
    #[error("{port} of the TensorFlow Lite model cannot be converted: it is not of 32-bit floats")]
    Port {
        /// Which one: "input 0".
        port: String,
    },
    /// The caller asked for outputs that there are not.
    #[error(
        "the outputs {asked:?} were asked for, and the TensorFlow Lite model has {count}, numbered from 0: ask for one or more of them, \
         each once and in order"
    )]
    Outputs {
        /// What was asked for.
        asked: Vec<usize>,
        /// How many there are.
        count: usize,
    },
}

impl ConvertError {
    pub(crate) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged { what: what.into() }
    }
}
