//! The specialisation constants that renderer-splat sets on this chip, by the names they have in the shaders.
//!
//! A constant that chooses between variants of a shader keeps the shader's default, and the table says so; `--set` chooses.

use std::collections::BTreeMap;
use std::str::FromStr;

use anyhow::{Context, Result};

use crate::module::Module;

/// `NAME=VALUE`, for every shader that has a constant of that name.
#[derive(Debug, Clone)]
pub(crate) struct Setting {
    name: String,
    value: u32,
}

impl FromStr for Setting {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, value) = text.split_once('=').context("NAME=VALUE is wanted")?;
        let value = value
            .parse()
            .with_context(|| format!("{value} is not a whole number"))?;
        Ok(Self {
            name: name.to_owned(),
            value,
        })
    }
}

/// Values by `constant_id`, with subgroups of `subgroup`.
pub(crate) fn values(module: &Module, subgroup: u32, settings: &[Setting]) -> BTreeMap<u32, u32> {
    module
        .constants
        .iter()
        .filter_map(|(number, name)| {
            let set = settings.iter().find(|setting| setting.name == *name);
            let value = set.map(|setting| setting.value);
            Some((
                *number,
                value.or_else(|| renderers(module, name, subgroup))?,
            ))
        })
        .collect()
}

/// Constants that choose a variant and were left alone.
pub(crate) fn open<'a>(module: &'a Module, settings: &[Setting]) -> Vec<&'a str> {
    module
        .constants
        .values()
        .map(String::as_str)
        .filter(|name| renderers(module, name, 64).is_none())
        .filter(|name| settings.iter().all(|setting| setting.name != *name))
        .collect()
}

fn renderers(module: &Module, constant: &str, subgroup: u32) -> Option<u32> {
    match (module.shader.name, constant) {
        (_, "SUBGROUP") => Some(subgroup),
        // options.rs: no depth unless it is asked for.
        (_, "DEPTH") => Some(0),
        (_, "QUADS_PER_INSTANCE") => Some(shaders_spirv::QUADS_PER_INSTANCE),
        // tiles.rs: few lanes, small groups.
        ("bin_count" | "bin_emit", "GROUP") => Some(32),
        // sort.rs.
        (sort, "GROUP") if sort.starts_with("sort_") => Some(256),
        (_, "SORT_GROUP") => Some(256),
        // Not left to the default, which glslang loses where the shader reads it nowhere.
        (_, "GROUP") => Some(64),
        _ => None,
    }
}
