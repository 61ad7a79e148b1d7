//! The optional members: the deform graph compiled for a chip's NPU, one member a chip.

use super::archive::Archive;
use super::manifest::{CompiledEntry, MANIFEST};
use super::members::{self, Packed};
use super::{Manifest, PackageError};
use crate::networks::{CompiledGraph, GraphSignature, check_compiled};
use std::io::{Read, Seek};

/// Most compiled graphs of a package.
pub const MAX_COMPILED: usize = 4;
/// Most bytes of one: the demo person's, of 60,000 Gaussians, has 140 MB.
pub const MAX_COMPILED_BYTES: u64 = 384 << 20;

/// The member that holds the graph compiled for `target`.
fn member_name(target: &str) -> String {
    format!("deform.qnn-{target}.onnx")
}

/// Members and manifest entries of `graphs`, which must have the plain graph's inputs and outputs.
pub(super) fn pack(
    graphs: &[CompiledGraph],
    plain: &GraphSignature,
) -> Result<Vec<(Packed, CompiledEntry)>, PackageError> {
    let one = |graph: &CompiledGraph| {
        let member = member_name(&graph.target);
        let qnn = check_compiled(&graph.onnx, plain)
            .map_err(|e| PackageError::member(&member, e.to_string()))?;
        let entry = CompiledEntry {
            member,
            target: graph.target.clone(),
            onnx_runtime: graph.onnx_runtime.clone(),
            qnn,
        };
        Ok(((graph.onnx.clone(), members::ports(plain)), entry))
    };
    let packed = graphs.iter().map(one).collect::<Result<Vec<_>, _>>()?;
    let entries: Vec<&CompiledEntry> = packed.iter().map(|(_, entry)| entry).collect();
    check_entries(&entries).map_err(|e| PackageError::member(MANIFEST, e))?;
    Ok(packed)
}

/// Refuses entries that are too many, of one chip, or not named as their target is.
pub(super) fn check_entries(entries: &[&CompiledEntry]) -> Result<(), String> {
    if entries.len() > MAX_COMPILED {
        return Err(format!("more than {MAX_COMPILED} compiled graphs"));
    }
    for (at, entry) in entries.iter().enumerate() {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let target = &entry.target;
        if target.is_empty() || target.len() > 32 || !target.chars().all(plain) {
            return Err(format!(
                "a compiled graph has the unusable target {target:?}"
            ));
        }
        if entry.member != member_name(target) {
            return Err(format!(
                "the graph compiled for {target} is not in {}",
                member_name(target)
            ));
        }
        if entries[..at].iter().any(|other| other.target == *target) {
            return Err(format!("two graphs are compiled for {target}"));
        }
    }
    Ok(())
}

/// The compiled graphs, each with the inputs and outputs of `plain` and compiled by what the manifest says.
pub(super) fn unpack<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
    plain: &GraphSignature,
) -> Result<Vec<CompiledGraph>, PackageError> {
    let mut graphs = Vec::with_capacity(manifest.compiled.len());
    for entry in &manifest.compiled {
        let refused = |reason: String| PackageError::member(&entry.member, reason);
        let (onnx, listed) = members::unpack(archive, manifest, &entry.member, MAX_COMPILED_BYTES)?;
        let qnn = check_compiled(&onnx, plain).map_err(|e| refused(e.to_string()))?;
        if qnn != entry.qnn {
            return Err(refused(format!(
                "QNN {qnn} compiled it, but the manifest says {}",
                entry.qnn
            )));
        }
        if *listed != members::ports(plain) {
            return Err(refused(
                "its inputs and outputs are not those the manifest lists".into(),
            ));
        }
        graphs.push(CompiledGraph {
            target: entry.target.clone(),
            onnx_runtime: entry.onnx_runtime.clone(),
            onnx,
        });
    }
    Ok(graphs)
}
