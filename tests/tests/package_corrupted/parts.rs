//! Takes a package apart and puts it together wrongly.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::io::{Cursor, Read, Write};
use zip::write::SimpleFileOptions;

pub(crate) const TEMPLATE: &str = "template.safetensors";
pub(crate) const GAUSSIANS: &str = "gaussians.safetensors";
pub(crate) const BINDING: &str = "binding.safetensors";
pub(crate) const CONTROLLERS: &str = "controllers.safetensors";
pub(crate) const GRAPH: &str = "deform.onnx";
pub(crate) const MANIFEST: &str = "manifest.json";

/// A package taken apart, to be put together wrongly.
#[derive(Clone)]
pub(crate) struct Parts {
    pub(crate) manifest: Value,
    pub(crate) members: Vec<(String, Vec<u8>)>,
}

impl Parts {
    pub(crate) fn of(package: &[u8]) -> Self {
        let mut zip = zip::ZipArchive::new(Cursor::new(package)).expect("the puppet's package");
        let mut members = Vec::new();
        for index in 0..zip.len() {
            let mut file = zip.by_index(index).expect("a member");
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).expect("a whole member");
            members.push((file.name().expect("a name").into_owned(), bytes));
        }
        let (_, manifest) = members.remove(0);
        let manifest = serde_json::from_slice(&manifest).expect("the manifest");
        Self { manifest, members }
    }

    pub(crate) fn member(&mut self, name: &str) -> &mut Vec<u8> {
        let found = self.members.iter_mut().find(|(n, _)| n == name);
        &mut found.expect("a known member").1
    }

    /// The manifest's entry of a member.
    pub(crate) fn entry(&mut self, name: &str) -> &mut Value {
        let entries = self.manifest["members"].as_array_mut().expect("a list");
        let found = entries.iter_mut().find(|entry| entry["name"] == name);
        found.expect("a listed member")
    }

    /// Makes sizes and hashes true again, so that only what was changed is wrong.
    pub(crate) fn rehash(mut self) -> Self {
        for (name, bytes) in self.members.clone() {
            let entry = self.entry(&name);
            entry["bytes"] = json!(bytes.len());
            entry["sha256"] = json!(hash(&bytes));
        }
        self
    }

    pub(crate) fn pack(&self) -> Vec<u8> {
        let manifest = serde_json::to_vec(&self.manifest).expect("the manifest");
        let mut files = vec![(MANIFEST.to_owned(), manifest)];
        files.extend(self.members.iter().cloned());
        pack(&files)
    }
}

pub(crate) fn hash(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(crate) fn pack(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(name.as_str(), SimpleFileOptions::default())
            .expect("a new member");
        zip.write_all(bytes).expect("memory");
    }
    zip.finish().expect("memory").into_inner()
}

/// Header and data of a safetensors file, taken apart without that format's crate, which refuses to write wrong ones.
pub(crate) struct Tensors {
    pub(crate) header: Value,
    pub(crate) data: Vec<u8>,
}

impl Tensors {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let length = u64::from_le_bytes(*bytes.first_chunk().expect("a length"));
        let (header, data) = bytes[8..].split_at(usize::try_from(length).expect("a length"));
        Self {
            header: serde_json::from_slice(header).expect("a header"),
            data: data.to_vec(),
        }
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let header = self.header.to_string().into_bytes();
        let length = (header.len() as u64).to_le_bytes();
        [&length[..], &header, &self.data].concat()
    }

    /// Element 0 of a tensor of elements of `size` bytes.
    pub(crate) fn first(&self, tensor: &str, size: usize) -> Vec<u8> {
        let start = self.header[tensor]["data_offsets"][0].as_u64();
        let start = usize::try_from(start.expect("an offset")).expect("an offset");
        self.data[start..start + size].to_vec()
    }

    /// Overwrites element `at` of a tensor.
    pub(crate) fn set(&mut self, tensor: &str, at: usize, value: &[u8]) {
        let start = self.header[tensor]["data_offsets"][0].as_u64();
        let start = usize::try_from(start.expect("an offset")).expect("an offset");
        let at = start + at * value.len();
        self.data[at..at + value.len()].copy_from_slice(value);
    }
}
