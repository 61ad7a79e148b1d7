//! What a session is made from: the plain graph, and forms of it that were compiled before.

use crate::QnnTarget;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;
use std::path::Path;

/// A graph compiled for one chip: an ONNX model whose only node holds the compiled form.
#[derive(Debug, Clone, Copy)]
pub struct Precompiled<'a> {
    /// The chip, as the compiled graph's metadata states it.
    pub target: QnnTarget,
    /// The model.
    pub onnx: &'a [u8],
}

/// The available forms of a graph.
#[derive(Debug, Clone, Copy, Default)]
pub struct Graph<'a> {
    /// The plain ONNX model of static shapes, which every provider takes; empty if there are only compiled forms.
    pub onnx: &'a [u8],
    /// Forms that came with it, from someone whom the caller trusts: nothing here can check what they compute.
    pub precompiled: &'a [Precompiled<'a>],
    /// The folder for graphs compiled here; without it, QNN compiles for every session.
    pub cache: Option<&'a Path>,
}

impl<'a> From<&'a [u8]> for Graph<'a> {
    fn from(onnx: &'a [u8]) -> Self {
        Self {
            onnx,
            ..Self::default()
        }
    }
}

impl<'a> From<&'a Vec<u8>> for Graph<'a> {
    fn from(onnx: &'a Vec<u8>) -> Self {
        Self::from(&onnx[..])
    }
}

impl<'a> From<&'a Cow<'_, [u8]>> for Graph<'a> {
    fn from(onnx: &'a Cow<'_, [u8]>) -> Self {
        Self::from(&onnx[..])
    }
}

/// Which form a session runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// The plain graph.
    Plain,
    /// The plain graph, compiled for this session.
    Compiled,
    /// A compiled form from the cache.
    Cached,
    /// A compiled form that came with the graph.
    Precompiled,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Plain => "the plain graph",
            Self::Compiled => "compiled just now",
            Self::Cached => "compiled before, from the cache",
            Self::Precompiled => "compiled in the package",
        })
    }
}
