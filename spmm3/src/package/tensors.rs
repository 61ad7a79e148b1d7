//! Members that are safetensors files: written from typed arrays, read back only when type and shape are as expected.

use super::{PackageError, TensorEntry};
use bytemuck::Pod;
use half::f16;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::BTreeMap;

/// Most bytes of a member's own header: a handful of tensors need a few hundred.
const MAX_HEADER: u64 = 64 << 10;

/// An element type a member may hold. All are little-endian, as this crate's targets are.
pub(super) trait Element: Pod {
    const DTYPE: Dtype;
}

impl Element for f32 {
    const DTYPE: Dtype = Dtype::F32;
}
impl Element for f16 {
    const DTYPE: Dtype = Dtype::F16;
}
impl Element for u32 {
    const DTYPE: Dtype = Dtype::U32;
}
impl Element for u16 {
    const DTYPE: Dtype = Dtype::U16;
}
impl Element for u8 {
    const DTYPE: Dtype = Dtype::U8;
}

/// Tensors on their way into a member.
pub(super) struct Writer<'a> {
    member: &'a str,
    tensors: Vec<(&'a str, TensorView<'a>)>,
}

impl<'a> Writer<'a> {
    pub(super) fn new(member: &'a str) -> Self {
        Self {
            member,
            tensors: Vec::new(),
        }
    }

    pub(super) fn add<T: Element>(
        mut self,
        name: &'a str,
        shape: &[usize],
        values: &'a [T],
    ) -> Result<Self, PackageError> {
        let view = TensorView::new(T::DTYPE, shape.to_vec(), bytemuck::cast_slice(values))
            .map_err(|e| PackageError::member(self.member, format!("tensor {name}: {e}")))?;
        self.tensors.push((name, view));
        Ok(self)
    }

    /// The member's bytes and what the manifest says of its tensors.
    pub(super) fn finish(self) -> Result<(Vec<u8>, BTreeMap<String, TensorEntry>), PackageError> {
        let entries = self
            .tensors
            .iter()
            .map(|(name, view)| ((*name).to_owned(), entry(view)))
            .collect();
        let bytes = safetensors::serialize(self.tensors, None)
            .map_err(|e| PackageError::member(self.member, e.to_string()))?;
        Ok((bytes, entries))
    }
}

/// A member's tensors, all of which the manifest lists with the same type and shape.
pub(super) struct Reader<'a> {
    member: &'a str,
    tensors: SafeTensors<'a>,
}

impl<'a> Reader<'a> {
    pub(super) fn new(
        member: &'a str,
        bytes: &'a [u8],
        listed: &BTreeMap<String, TensorEntry>,
    ) -> Result<Self, PackageError> {
        let refused = |reason: String| PackageError::member(member, reason);
        let header = bytes
            .first_chunk()
            .map_or(u64::MAX, |length| u64::from_le_bytes(*length));
        if header > MAX_HEADER {
            return Err(refused("not a safetensors file with a short header".into()));
        }
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| refused(e.to_string()))?;
        let found: BTreeMap<String, TensorEntry> = tensors
            .iter()
            .map(|(name, view)| (name.to_owned(), entry(&view)))
            .collect();
        if found != *listed {
            let reason = "its tensors are not those the manifest lists".to_owned();
            return Err(refused(reason));
        }
        Ok(Self { member, tensors })
    }

    /// The elements of tensor `name`, which must have `shape`.
    pub(super) fn get<T: Element>(
        &self,
        name: &str,
        shape: &[usize],
    ) -> Result<Vec<T>, PackageError> {
        let refused = |reason: String| PackageError::member(self.member, reason);
        let view = self
            .tensors
            .tensor(name)
            .map_err(|_| refused(format!("tensor {name} is missing")))?;
        let (found, needed) = (
            entry(&view),
            TensorEntry {
                dtype: T::DTYPE.to_string(),
                shape: shape.to_vec(),
            },
        );
        if found != needed {
            return Err(refused(format!(
                "tensor {name} is {}, but the manifest's counts need {}",
                found.describe(),
                needed.describe()
            )));
        }
        // The shape matched, so the elements fill the bytes exactly; a copy, because the bytes may be unaligned.
        let mut values = vec![T::zeroed(); view.data().len() / size_of::<T>()];
        bytemuck::cast_slice_mut(&mut values).copy_from_slice(view.data());
        Ok(values)
    }

    /// Refuses tensors beyond the `expected` ones.
    pub(super) fn only(&self, expected: usize) -> Result<(), PackageError> {
        if self.tensors.len() == expected {
            return Ok(());
        }
        Err(PackageError::member(
            self.member,
            format!("{} tensors, not {expected}", self.tensors.len()),
        ))
    }
}

fn entry(view: &TensorView<'_>) -> TensorEntry {
    TensorEntry {
        dtype: view.dtype().to_string(),
        shape: view.shape().to_vec(),
    }
}
