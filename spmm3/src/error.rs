//! What can be wrong with a person's data.

/// A person's data that contradicts itself. Every constructor of this crate checks; afterwards the type is right.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PersonError {
    /// Two arrays that must have one length do not.
    #[error("{what} has {got} entries where {expected} are needed")]
    Count {
        /// The array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length it must have.
        expected: usize,
    },
    /// An index points past what it indexes.
    #[error("{what} number {at} is {index}, but there are only {bound}")]
    Index {
        /// The array of indices.
        what: &'static str,
        /// The position in it.
        at: usize,
        /// The offending index.
        index: usize,
        /// The count it must stay below.
        bound: usize,
    },
    /// An index stands twice where each may stand once.
    #[error("{what} number {at} is {index}, which stands there before")]
    Repeated {
        /// The array of indices.
        what: &'static str,
        /// The position in it.
        at: usize,
        /// The index that is there a second time.
        index: usize,
    },
    /// A Gaussian's heir is left out before it.
    #[error("the place of Gaussian {gaussian} goes to {heir}, which is less important")]
    Heir {
        /// The Gaussian.
        gaussian: usize,
        /// Its heir.
        heir: usize,
    },
    /// A number is NaN, infinite or outside its range.
    #[error("{what} number {at} is {value}, outside {range}")]
    Value {
        /// The array.
        what: &'static str,
        /// The position in it.
        at: usize,
        /// The offending value.
        value: f32,
        /// The range it must lie in, in words.
        range: &'static str,
    },
    /// The name of an expression basis cannot be printed.
    #[error(
        "the name of an expression basis must be 1 to 64 letters, digits, `-`, `_` or `.`, for example flame-2020"
    )]
    BasisName,
}

impl PersonError {
    /// Refuses an array whose length is not `expected`.
    pub(crate) fn check_count(what: &'static str, got: usize, expected: usize) -> Result<(), Self> {
        if got == expected {
            Ok(())
        } else {
            Err(Self::Count {
                what,
                got,
                expected,
            })
        }
    }

    /// Refuses an array that holds an index of `bound` or more.
    pub(crate) fn check_indices(
        what: &'static str,
        indices: impl IntoIterator<Item = usize>,
        bound: usize,
    ) -> Result<(), Self> {
        match indices
            .into_iter()
            .enumerate()
            .find(|(_, index)| *index >= bound)
        {
            None => Ok(()),
            Some((at, index)) => Err(Self::Index {
                what,
                at,
                index,
                bound,
            }),
        }
    }

    /// Refuses an array that holds a number outside `low..=high` (NaN and infinities included).
    pub(crate) fn check_range(
        what: &'static str,
        values: &[f32],
        low: f32,
        high: f32,
        range: &'static str,
    ) -> Result<(), Self> {
        match values
            .iter()
            .enumerate()
            .find(|(_, v)| !(low..=high).contains(*v))
        {
            None => Ok(()),
            Some((at, value)) => Err(Self::Value {
                what,
                at,
                value: *value,
                range,
            }),
        }
    }
}
