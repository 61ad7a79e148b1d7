//! Morph targets: one binary of vertex offsets, little-endian int16 in thousandths of a decimetre, a row a target. The
//! rows stand in the order of the target list's sorted names.

use super::package::read_json;
use super::{Macros, Package};
use crate::ReconstructError;
use glam::Vec3;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

/// Decimetres of one step.
const STEP: f32 = 1e-3;

/// The morph targets of one body.
#[derive(Debug)]
pub struct Targets {
    rows: BTreeMap<String, u64>,
    file: File,
    path: PathBuf,
    vertices: usize,
}

#[derive(Deserialize)]
struct TargetList {
    // A BTreeMap sorts by bytes, which is the rows' order.
    targets: BTreeMap<String, IgnoredAny>,
}

impl Targets {
    /// Opens the package's targets for a body of `vertices` vertices.
    ///
    /// # Errors
    /// If the list or the binary cannot be read, or the binary's size is not the list's rows of such a body.
    pub fn open(package: &Package, vertices: usize) -> Result<Self, ReconstructError> {
        let list: TargetList = read_json(&package.file("src/json/targets/target-list.json"))?;
        let path = package.data("targets/targets.bin");
        let read = |source| ReconstructError::Read {
            path: path.clone(),
            source,
        };
        let file = File::open(&path).map_err(read)?;
        let size = file.metadata().map_err(read)?.len();
        let expected = list.targets.len() as u64 * row_bytes(vertices) as u64;
        if size != expected {
            let what = format!(
                "{size} bytes, but {} targets of {vertices} vertices take {expected}",
                list.targets.len()
            );
            return Err(ReconstructError::content(&path, what));
        }
        let rows = list
            .targets
            .into_keys()
            .zip(0..)
            .map(|(name, row)| (short(&name).to_owned(), row))
            .collect();
        Ok(Self {
            rows,
            file,
            path,
            vertices,
        })
    }

    /// Row of a target, e.g. `macrodetails/caucasian-male-young`.
    #[must_use]
    pub fn row(&self, name: &str) -> Option<u64> {
        self.rows.get(name).copied()
    }

    /// Names of all targets, sorted, without `data/targets/` and the file ending.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.rows.keys().map(String::as_str)
    }

    /// Reads a target: one offset a vertex, decimetres.
    ///
    /// # Errors
    /// If there is no such target or its row cannot be read.
    pub fn read(&mut self, name: &str) -> Result<Vec<Vec3>, ReconstructError> {
        let row = self.row(name).ok_or_else(|| {
            ReconstructError::content(&self.path, format!("there is no target {name}"))
        })?;
        let mut bytes = vec![0; row_bytes(self.vertices)];
        self.file
            .seek(SeekFrom::Start(row * bytes.len() as u64))
            .and_then(|_| self.file.read_exact(&mut bytes))
            .map_err(|source| ReconstructError::Read {
                path: self.path.clone(),
                source,
            })?;
        let number = |b: &[u8]| f32::from(i16::from_le_bytes([b[0], b[1]])) * STEP;
        Ok(bytes
            .chunks_exact(6)
            .map(|c| Vec3::new(number(&c[..2]), number(&c[2..4]), number(&c[4..])))
            .collect())
    }

    /// Adds the targets that `macros` select to `body`.
    ///
    /// # Errors
    /// If a row cannot be read.
    pub fn apply_macros(
        &mut self,
        macros: &Macros,
        body: &mut [Vec3],
    ) -> Result<(), ReconstructError> {
        let wanted: Vec<(String, f32)> = self
            .names()
            .filter_map(|name| macros.weight(name).map(|w| (name.to_owned(), w)))
            .collect();
        for (name, weight) in wanted {
            self.apply(&name, weight, body)?;
        }
        Ok(())
    }

    /// Adds `weight` times a target to `body`.
    ///
    /// # Errors
    /// If there is no such target or its row cannot be read.
    pub fn apply(
        &mut self,
        name: &str,
        weight: f32,
        body: &mut [Vec3],
    ) -> Result<(), ReconstructError> {
        for (vertex, offset) in body.iter_mut().zip(self.read(name)?) {
            *vertex += weight * offset;
        }
        Ok(())
    }
}

fn row_bytes(vertices: usize) -> usize {
    vertices * 3 * size_of::<i16>()
}

fn short(name: &str) -> &str {
    let name = name.strip_prefix("data/targets/").unwrap_or(name);
    name.strip_suffix(".target").unwrap_or(name)
}
