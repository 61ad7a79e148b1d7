//! What a pipeline's description needs of a compiled shader: its stage, bindings, outputs, specialisation constants.
//!
//! Reads just the SPIR-V that glslang writes for this project's shaders: buffers and input attachments, no other images, no vertex
//! attributes.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, bail, ensure};
use ash::vk;
use shaders_spirv::Shader;

const OP_NAME: u16 = 5;
const OP_ENTRY_POINT: u16 = 15;
const OP_EXECUTION_MODE: u16 = 16;
const OP_CAPABILITY: u16 = 17;
const OP_TYPE_IMAGE: u16 = 25;
const OP_TYPE_POINTER: u16 = 32;
const OP_VARIABLE: u16 = 59;
const OP_DECORATE: u16 = 71;

const CAPABILITY_MULTI_VIEW: u32 = 4439;

const MODE_DEPTH_REPLACING: u32 = 12;
const DIM_SUBPASS_DATA: u32 = 6;

const DECORATION_SPEC_ID: u32 = 1;
const DECORATION_BUFFER_BLOCK: u32 = 3;
const DECORATION_LOCATION: u32 = 30;
const DECORATION_BINDING: u32 = 33;
const DECORATION_DESCRIPTOR_SET: u32 = 34;
const DECORATION_INPUT_ATTACHMENT_INDEX: u32 = 43;

const CLASS_UNIFORM_CONSTANT: u32 = 0;
const CLASS_INPUT: u32 = 1;
const CLASS_UNIFORM: u32 = 2;
const CLASS_OUTPUT: u32 = 3;
const CLASS_STORAGE_BUFFER: u32 = 12;

/// Where in the pipeline a shader runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stage {
    Vertex,
    Fragment,
    Compute,
}

impl Stage {
    pub(crate) fn flag(self) -> vk::ShaderStageFlags {
        match self {
            Self::Vertex => vk::ShaderStageFlags::VERTEX,
            Self::Fragment => vk::ShaderStageFlags::FRAGMENT,
            Self::Compute => vk::ShaderStageFlags::COMPUTE,
        }
    }
}

/// A shader, and what is read from it.
pub(crate) struct Module {
    pub(crate) shader: Shader,
    pub(crate) stage: Stage,
    /// Drawn for both eyes at once.
    pub(crate) multiview: bool,
    /// Kinds of buffer, or of attachment, by binding number in set 0.
    pub(crate) bindings: BTreeMap<u32, vk::DescriptorType>,
    /// Numbers and names of the specialisation constants.
    pub(crate) constants: BTreeMap<u32, String>,
    /// Colour attachments a fragment shader writes.
    pub(crate) outputs: BTreeSet<u32>,
    /// Attachments of an earlier subpass that a fragment shader reads.
    pub(crate) inputs: BTreeSet<u32>,
    /// Whether a fragment shader writes its depth.
    pub(crate) writes_depth: bool,
}

impl Module {
    pub(crate) fn read(shader: Shader) -> anyhow::Result<Self> {
        let words = shader.words;
        Self::parse(shader, words).with_context(|| format!("shader {}", shader.name))
    }

    fn parse(shader: Shader, words: &[u32]) -> anyhow::Result<Self> {
        let mut stage = None;
        let mut multiview = false;
        let mut names = BTreeMap::new();
        let mut decorations = BTreeMap::new();
        let mut writes_depth = false;
        let mut subpass_images = BTreeSet::new();
        let mut pointees = BTreeMap::new();
        let mut variables = Vec::new();
        for instruction in instructions(words)? {
            match instruction {
                (OP_NAME, [id, name @ ..]) => _ = names.insert(*id, text(name)),
                (OP_ENTRY_POINT, [model, ..]) => stage = Some(*model),
                (OP_CAPABILITY, [CAPABILITY_MULTI_VIEW]) => multiview = true,
                (OP_EXECUTION_MODE, [_, MODE_DEPTH_REPLACING, ..]) => writes_depth = true,
                (OP_TYPE_IMAGE, [id, _, DIM_SUBPASS_DATA, ..]) => {
                    subpass_images.insert(*id);
                }
                (OP_DECORATE, [id, decoration, value @ ..]) => {
                    let value = value.first().copied().unwrap_or_default();
                    decorations.insert((*id, *decoration), value);
                }
                (OP_TYPE_POINTER, [id, _, pointee]) => _ = pointees.insert(*id, *pointee),
                (OP_VARIABLE, [kind, id, class, ..]) => variables.push((*id, *kind, *class)),
                _ => {}
            }
        }
        let stage = match stage {
            Some(0) => Stage::Vertex,
            Some(4) => Stage::Fragment,
            Some(5) => Stage::Compute,
            other => bail!("execution model {other:?} is not handled"),
        };
        let mut bindings = BTreeMap::new();
        let mut outputs = BTreeSet::new();
        let mut inputs = BTreeSet::new();
        for (id, kind, class) in variables {
            let of = |decoration| decorations.get(&(id, decoration)).copied();
            let name = || names.get(&id).cloned().unwrap_or_default();
            match (class, of(DECORATION_LOCATION), of(DECORATION_BINDING)) {
                (CLASS_OUTPUT, Some(location), _) if stage == Stage::Fragment => {
                    outputs.insert(location);
                }
                (CLASS_INPUT, Some(_), _) if stage == Stage::Vertex => {
                    bail!("vertex attributes are not handled ({})", name())
                }
                (_, _, Some(binding)) => {
                    ensure!(
                        of(DECORATION_DESCRIPTOR_SET).unwrap_or_default() == 0,
                        "descriptor sets but the first are not handled ({})",
                        name()
                    );
                    let pointee = pointees.get(&kind).copied().unwrap_or_default();
                    let old_storage = decorations.contains_key(&(pointee, DECORATION_BUFFER_BLOCK));
                    let descriptor = match class {
                        CLASS_STORAGE_BUFFER => vk::DescriptorType::STORAGE_BUFFER,
                        CLASS_UNIFORM if old_storage => vk::DescriptorType::STORAGE_BUFFER,
                        CLASS_UNIFORM => vk::DescriptorType::UNIFORM_BUFFER,
                        CLASS_UNIFORM_CONSTANT if subpass_images.contains(&pointee) => {
                            inputs.insert(of(DECORATION_INPUT_ATTACHMENT_INDEX).with_context(
                                || format!("{} has no input_attachment_index", name()),
                            )?);
                            vk::DescriptorType::INPUT_ATTACHMENT
                        }
                        _ => bail!(
                            "only buffers and input attachments are handled, not {}",
                            name()
                        ),
                    };
                    bindings.insert(binding, descriptor);
                }
                _ => {}
            }
        }
        let mut constants = BTreeMap::new();
        for ((id, decoration), number) in &decorations {
            if *decoration == DECORATION_SPEC_ID {
                // glslang leaves the one behind `local_size_x_id` without a name, and without a twin where
                // nothing else reads it.
                let name = constants
                    .entry(*number)
                    .or_insert_with(|| "GROUP".to_owned());
                if let Some(own) = names.get(id) {
                    name.clone_from(own);
                }
            }
        }
        Ok(Self {
            shader,
            stage,
            multiview,
            bindings,
            constants,
            outputs,
            inputs,
            writes_depth,
        })
    }
}

/// Opcodes and operands, after the five words of the header.
fn instructions(words: &[u32]) -> anyhow::Result<Vec<(u16, &[u32])>> {
    let mut found = Vec::new();
    let mut rest = words.get(5..).unwrap_or_default();
    while let Some(head) = rest.first() {
        let length = (head >> 16) as usize;
        let operands = rest.get(1..length).context("this is not whole SPIR-V")?;
        found.push(((head & 0xFFFF) as u16, operands));
        rest = &rest[length..];
    }
    Ok(found)
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words
        .iter()
        .flat_map(|word| word.to_le_bytes())
        .take_while(|byte| *byte != 0)
        .collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bindings_and_constants_are_read_as_the_shader_declares_them() {
        let raster = Module::read(shaders_spirv::RASTER).expect("a shader of ours");
        assert_eq!(raster.stage, Stage::Compute, "raster.comp");
        assert_eq!(
            raster.bindings.get(&0),
            Some(&vk::DescriptorType::UNIFORM_BUFFER),
            "cameras and sizes"
        );
        assert_eq!(
            raster.bindings.get(&1),
            Some(&vk::DescriptorType::STORAGE_BUFFER),
            "splats"
        );
        assert_eq!(
            raster.constants.get(&0).map(String::as_str),
            Some("SUBGROUP"),
            "constant 0"
        );
    }

    #[test]
    fn a_workgroup_size_that_nothing_else_reads_is_found_without_its_name() {
        let count = Module::read(shaders_spirv::SORT_COUNT).expect("a shader of ours");
        let constants: Vec<_> = count.constants.into_iter().collect();
        assert_eq!(constants, [(0, "GROUP".to_owned())], "sort_count.comp");
    }

    #[test]
    fn every_shader_can_be_put_into_the_table() {
        for shader in shaders_spirv::ALL {
            if let Err(why) = Module::read(*shader) {
                panic!("{why:#}");
            }
        }
    }

    /// A fragment shader with one image of a dimension, as glslang writes it but for the names: no body, which the reader skips.
    fn with_an_image(dimension: u32) -> Shader {
        let op = |code: u16, operands: &[u32]| {
            let length = u32::try_from(operands.len()).expect("a short one") + 1;
            let mut words = vec![length << 16 | u32::from(code)];
            words.extend(operands);
            words
        };
        let words = [
            vec![0x0723_0203, 0x0001_0300, 0, 20, 0],
            op(OP_ENTRY_POINT, &[4, 1, 0]),
            op(OP_EXECUTION_MODE, &[1, 7]),
            op(OP_EXECUTION_MODE, &[1, MODE_DEPTH_REPLACING]),
            op(OP_NAME, &[9, u32::from_le_bytes(*b"eye\0")]),
            op(OP_DECORATE, &[9, DECORATION_INPUT_ATTACHMENT_INDEX, 3]),
            op(OP_DECORATE, &[9, DECORATION_BINDING, 5]),
            op(OP_DECORATE, &[9, DECORATION_DESCRIPTOR_SET, 0]),
            op(OP_TYPE_IMAGE, &[6, 2, dimension, 0, 0, 0, 2, 0]),
            op(OP_TYPE_POINTER, &[7, CLASS_UNIFORM_CONSTANT, 6]),
            op(OP_VARIABLE, &[7, 9, CLASS_UNIFORM_CONSTANT]),
        ];
        Shader {
            name: "made_up",
            words: words.concat().leak(),
        }
    }

    #[test]
    fn an_input_attachment_is_bound_as_one_and_found_by_its_index() {
        let module = Module::read(with_an_image(DIM_SUBPASS_DATA)).expect("a shader");
        let bound = vk::DescriptorType::INPUT_ATTACHMENT;
        assert_eq!(module.bindings.get(&5), Some(&bound), "binding 5");
        assert_eq!(module.inputs, BTreeSet::from([3]), "attachment 3");
        assert!(module.writes_depth, "it replaces depth");
    }

    #[test]
    fn an_image_that_is_no_input_attachment_is_refused_by_its_name() {
        let why = Module::read(with_an_image(1))
            .err()
            .map(|why| format!("{why:#}"));
        let why = why.expect("a plain image");
        assert!(why.contains("not eye") && why.contains("made_up"), "{why}");
    }

    #[test]
    fn half_a_module_is_refused() {
        // After the header, an instruction that claims three words and has two.
        let torn = Shader {
            name: "torn",
            words: &[0x0723_0203, 0x0001_0300, 0, 8, 0, 3 << 16 | 17, 1],
        };
        assert!(Module::read(torn).is_err(), "a word is missing");
    }
}
