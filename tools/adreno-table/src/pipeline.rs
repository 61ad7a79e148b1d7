//! Compiling a compute shader, or a vertex and a fragment shader together, and asking for the driver's statistics.

use std::collections::BTreeMap;

use anyhow::{Context, ensure};
use ash::vk;

use crate::constants::{self, Setting};
use crate::device::Device;
use crate::module::{Module, Stage};

/// Most bytes of push constants that every device has.
const PUSH_BYTES: u32 = 128;

/// The splats' attachments: colour, and depth.
const ATTACHMENTS: [vk::Format; 2] = [vk::Format::R16G16B16A16_SFLOAT, vk::Format::R16_SFLOAT];

/// The attachments of the subpass that reads them: a compositor's colour and depth.
const SHOWN: vk::Format = vk::Format::R8G8B8A8_SRGB;
const SHOWN_DEPTH: vk::Format = vk::Format::D32_SFLOAT;

/// One stage of a compiled pipeline.
pub(crate) struct Compiled {
    /// The driver's name for it: `vs`, `fs`, `cs` or the like.
    pub(crate) stage: String,
    pub(crate) subgroup: u32,
    /// The driver's statistics by their names.
    pub(crate) statistics: BTreeMap<String, u64>,
    /// The compiler's stages and the machine code.
    pub(crate) code: String,
}

/// Compiles a compute shader for subgroups of a size, or a pair for whatever the driver prefers.
pub(crate) fn compile(
    device: &Device,
    modules: &[&Module],
    subgroup: u32,
    settings: &[Setting],
) -> anyhow::Result<Vec<Compiled>> {
    let layout = layout(device, modules)?;
    let specialisations: Vec<_> = modules
        .iter()
        .map(|module| Specialisation::new(&constants::values(module, subgroup, settings)))
        .collect();
    let infos: Vec<_> = specialisations.iter().map(Specialisation::info).collect();
    let mut required = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
        .required_subgroup_size(subgroup);
    let mut required = Some(&mut required);
    let mut stages = Vec::new();
    for (module, info) in modules.iter().zip(&infos) {
        let code = vk::ShaderModuleCreateInfo::default().code(module.shader.words);
        // SAFETY: the words are SPIR-V that glslang wrote.
        let handle = unsafe { device.handle.create_shader_module(&code, None) }
            .context("vkCreateShaderModule")?;
        let mut stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(module.stage.flag())
            .module(handle)
            .name(c"main")
            .specialization_info(info);
        if let Some(required) = required.take_if(|_| module.stage == Stage::Compute) {
            // As the renderer does for shaders that are written for a size.
            if module.constants.values().any(|name| name == "SUBGROUP") {
                stage = stage.flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS);
            }
            stage = stage.push_next(required);
        }
        stages.push(stage);
    }

    let flags = vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR
        | vk::PipelineCreateFlags::CAPTURE_INTERNAL_REPRESENTATIONS_KHR;
    let pipeline = match stages.as_slice() {
        [stage] => compute(device, *stage, layout, flags)?,
        _ => graphics(device, modules, &stages, layout, flags)?,
    };
    let mut compiled = report(device, pipeline)?;
    for stage in &stages {
        // SAFETY: pipelines do not need their modules once made.
        unsafe { device.handle.destroy_shader_module(stage.module, None) };
    }
    // SAFETY: nothing was submitted, so nothing is in use.
    unsafe {
        device.handle.destroy_pipeline(pipeline, None);
        device.handle.destroy_pipeline_layout(layout, None);
    }
    compiled.sort_by(|a, b| b.stage.cmp(&a.stage));
    Ok(compiled)
}

/// The constants of one stage, as Vulkan takes them.
struct Specialisation {
    entries: Vec<vk::SpecializationMapEntry>,
    values: Vec<u32>,
}

impl Specialisation {
    fn new(values: &BTreeMap<u32, u32>) -> Self {
        let entries = (0u32..).zip(values.keys());
        Self {
            entries: entries
                .map(|(index, number)| vk::SpecializationMapEntry {
                    constant_id: *number,
                    offset: index * 4,
                    size: 4,
                })
                .collect(),
            values: values.values().copied().collect(),
        }
    }

    fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default()
            .map_entries(&self.entries)
            .data(bytemuck::cast_slice(&self.values))
    }
}

fn layout(device: &Device, modules: &[&Module]) -> anyhow::Result<vk::PipelineLayout> {
    let stages = modules
        .iter()
        .fold(vk::ShaderStageFlags::empty(), |all, module| {
            all | module.stage.flag()
        });
    let kinds: BTreeMap<_, _> = modules.iter().flat_map(|module| &module.bindings).collect();
    let bindings: Vec<_> = kinds
        .into_iter()
        .map(|(binding, kind)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(*binding)
                .descriptor_type(*kind)
                .descriptor_count(1)
                .stage_flags(stages)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: the structure is complete.
    let set = unsafe { device.handle.create_descriptor_set_layout(&info, None) }
        .context("vkCreateDescriptorSetLayout")?;
    let sets = [set];
    let push = [vk::PushConstantRange {
        stage_flags: stages,
        offset: 0,
        size: PUSH_BYTES,
    }];
    let info = vk::PipelineLayoutCreateInfo::default()
        .set_layouts(&sets)
        .push_constant_ranges(&push);
    // SAFETY: the set layout is alive.
    let layout = unsafe { device.handle.create_pipeline_layout(&info, None) }
        .context("vkCreatePipelineLayout")?;
    // SAFETY: a pipeline layout keeps what it needs of its set layouts.
    unsafe { device.handle.destroy_descriptor_set_layout(set, None) };
    Ok(layout)
}

fn compute(
    device: &Device,
    stage: vk::PipelineShaderStageCreateInfo<'_>,
    layout: vk::PipelineLayout,
    flags: vk::PipelineCreateFlags,
) -> anyhow::Result<vk::Pipeline> {
    let info = [vk::ComputePipelineCreateInfo::default()
        .flags(flags)
        .stage(stage)
        .layout(layout)];
    // SAFETY: module, layout and specialisation live until the call returns.
    let made = unsafe {
        device
            .handle
            .create_compute_pipelines(vk::PipelineCache::null(), &info, None)
    };
    let pipelines = made
        .map_err(|(_, why)| why)
        .context("vkCreateComputePipelines")?;
    pipelines.first().copied().context("no pipeline")
}

/// Triangles from storage buffers alone, blended over one another, to both eyes if the shaders are for both.
fn graphics(
    device: &Device,
    modules: &[&Module],
    stages: &[vk::PipelineShaderStageCreateInfo<'_>],
    layout: vk::PipelineLayout,
    flags: vk::PipelineCreateFlags,
) -> anyhow::Result<vk::Pipeline> {
    let outputs = modules
        .iter()
        .flat_map(|module| module.outputs.last())
        .max()
        .map_or(0, |last| *last as usize + 1);
    let inputs = modules
        .iter()
        .flat_map(|module| module.inputs.last())
        .max()
        .map_or(0, |last| *last as usize + 1);
    let written = ATTACHMENTS
        .get(..if inputs == 0 { outputs } else { inputs })
        .with_context(|| {
            format!(
                "the table knows {} attachments, not {outputs} to write or {inputs} to read",
                ATTACHMENTS.len()
            )
        })?;
    ensure!(
        inputs == 0 || outputs == 1,
        "of shaders that read attachments only those are handled that write one, not {outputs}"
    );
    let over = vk::PipelineColorBlendAttachmentState::default()
        .blend_enable(inputs == 0)
        .src_color_blend_factor(vk::BlendFactor::ONE)
        .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .color_write_mask(vk::ColorComponentFlags::RGBA);
    let blends = vec![over; outputs];
    let blending = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
    let vertices = vk::PipelineVertexInputStateCreateInfo::default();
    let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
        .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
    let viewport = vk::PipelineViewportStateCreateInfo::default()
        .viewport_count(1)
        .scissor_count(1);
    let rasterisation = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
    let samples = vk::PipelineMultisampleStateCreateInfo::default()
        .rasterization_samples(vk::SampleCountFlags::TYPE_1);
    let writes_depth = modules.iter().any(|module| module.writes_depth);
    let depth = vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(writes_depth)
        .depth_write_enable(writes_depth)
        .depth_compare_op(vk::CompareOp::ALWAYS);
    let states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&states);
    let both_eyes = modules.iter().any(|module| module.multiview);
    let view_mask = if both_eyes { 0b11 } else { 0 };
    let mut rendering = vk::PipelineRenderingCreateInfo::default()
        .view_mask(view_mask)
        .color_attachment_formats(written);
    let mut info = vk::GraphicsPipelineCreateInfo::default()
        .flags(flags)
        .stages(stages)
        .vertex_input_state(&vertices)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&rasterisation)
        .multisample_state(&samples)
        .depth_stencil_state(&depth)
        .color_blend_state(&blending)
        .dynamic_state(&dynamic)
        .layout(layout);
    // Only a render pass has subpasses.
    let pass = match inputs {
        0 => None,
        _ => Some(two_subpasses(device, written, writes_depth, view_mask)?),
    };
    info = match pass {
        None => info.push_next(&mut rendering),
        Some(pass) => info.render_pass(pass).subpass(1),
    };
    // SAFETY: modules, layout, specialisations and states live until the call returns.
    let made = unsafe {
        device
            .handle
            .create_graphics_pipelines(vk::PipelineCache::null(), &[info], None)
    };
    if let Some(pass) = pass {
        // SAFETY: pipelines do not need the pass that they were made for.
        unsafe { device.handle.destroy_render_pass(pass, None) };
    }
    let pipelines = made
        .map_err(|(_, why)| why)
        .context("vkCreateGraphicsPipelines")?;
    pipelines.first().copied().context("no pipeline")
}

/// A pass whose first subpass writes `pictures` and whose second reads them and writes what is shown, with its depth or without.
fn two_subpasses(
    device: &Device,
    pictures: &[vk::Format],
    depth: bool,
    view_mask: u32,
) -> anyhow::Result<vk::RenderPass> {
    let formats = pictures
        .iter()
        .copied()
        .chain([SHOWN])
        .chain(depth.then_some(SHOWN_DEPTH));
    let attachments: Vec<_> = formats
        .map(|format| {
            vk::AttachmentDescription::default()
                .format(format)
                .samples(vk::SampleCountFlags::TYPE_1)
                .final_layout(vk::ImageLayout::GENERAL)
        })
        .collect();
    let general = |attachment| vk::AttachmentReference {
        attachment,
        layout: vk::ImageLayout::GENERAL,
    };
    let pictures: Vec<_> = (0u32..).zip(pictures).map(|(at, _)| general(at)).collect();
    let at = pictures.last().map_or(0, |last| last.attachment + 1);
    let (shown, shown_depth) = ([general(at)], general(at + 1));
    let bind_point = vk::PipelineBindPoint::GRAPHICS;
    let draws = vk::SubpassDescription::default()
        .pipeline_bind_point(bind_point)
        .color_attachments(&pictures);
    let mut shows = vk::SubpassDescription::default()
        .pipeline_bind_point(bind_point)
        .input_attachments(&pictures)
        .color_attachments(&shown);
    if depth {
        shows = shows.depth_stencil_attachment(&shown_depth);
    }
    let subpasses = [draws, shows];
    let dependencies = [vk::SubpassDependency::default()
        .dst_subpass(1)
        .src_stage_mask(vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT)
        .dst_stage_mask(vk::PipelineStageFlags::FRAGMENT_SHADER)
        .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
        .dst_access_mask(vk::AccessFlags::INPUT_ATTACHMENT_READ)
        .dependency_flags(vk::DependencyFlags::BY_REGION)];
    let masks = [view_mask; 2];
    let mut multiview = vk::RenderPassMultiviewCreateInfo::default().view_masks(&masks);
    let mut info = vk::RenderPassCreateInfo::default()
        .attachments(&attachments)
        .subpasses(&subpasses)
        .dependencies(&dependencies);
    if view_mask != 0 {
        info = info.push_next(&mut multiview);
    }
    // SAFETY: the structures are complete, and live until the call returns.
    unsafe { device.handle.create_render_pass(&info, None) }.context("vkCreateRenderPass")
}

fn report(device: &Device, pipeline: vk::Pipeline) -> anyhow::Result<Vec<Compiled>> {
    let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
    // SAFETY: the pipeline is alive.
    let executables = unsafe { device.executables.get_pipeline_executable_properties(&info) }
        .context("vkGetPipelineExecutablePropertiesKHR")?;
    let mut compiled = Vec::new();
    for (index, executable) in (0..).zip(&executables) {
        let info = vk::PipelineExecutableInfoKHR::default()
            .pipeline(pipeline)
            .executable_index(index);
        // SAFETY: the pipeline is alive, was made to capture statistics, and has an executable of this index.
        let found = unsafe { device.executables.get_pipeline_executable_statistics(&info) }
            .context("vkGetPipelineExecutableStatisticsKHR")?;
        let mut statistics = BTreeMap::new();
        for one in &found {
            if one.format == vk::PipelineExecutableStatisticFormatKHR::UINT64 {
                // SAFETY: the format says which member the driver wrote.
                statistics.insert(text(one.name_as_c_str()), unsafe { one.value.u64 });
            }
        }
        compiled.push(Compiled {
            stage: stage_name(executable.stages).to_owned(),
            subgroup: executable.subgroup_size,
            statistics,
            code: code(device, &info)?,
        });
    }
    Ok(compiled)
}

/// A stage's name in the table.
pub(crate) fn stage_name(stages: vk::ShaderStageFlags) -> &'static str {
    match stages {
        vk::ShaderStageFlags::VERTEX => "vertex",
        vk::ShaderStageFlags::FRAGMENT => "fragment",
        vk::ShaderStageFlags::COMPUTE => "compute",
        _ => "other",
    }
}

fn text(bytes: Result<&std::ffi::CStr, std::ffi::FromBytesUntilNulError>) -> String {
    bytes
        .map(|text| text.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// All internal representations of an executable, the machine code last.
fn code(device: &Device, info: &vk::PipelineExecutableInfoKHR<'_>) -> anyhow::Result<String> {
    let get = device
        .executables
        .fp()
        .get_pipeline_executable_internal_representations_khr;
    let handle = device.handle.handle();
    let during = "vkGetPipelineExecutableInternalRepresentationsKHR";
    let mut count = 0;
    // SAFETY: the pipeline is alive and was made to capture these; with no array it only counts.
    unsafe { get(handle, info, &mut count, std::ptr::null_mut()) }
        .result()
        .context(during)?;
    let mut parts =
        vec![vk::PipelineExecutableInternalRepresentationKHR::default(); count as usize];
    // SAFETY: as above; the array has room for `count`, whose texts it only measures.
    unsafe { get(handle, info, &mut count, parts.as_mut_ptr()) }
        .result()
        .context(during)?;
    let mut texts: Vec<_> = parts.iter().map(|part| vec![0u8; part.data_size]).collect();
    for (part, text) in parts.iter_mut().zip(&mut texts) {
        part.p_data = text.as_mut_ptr().cast();
    }
    // SAFETY: as above, and every text has the room that was asked for.
    unsafe { get(handle, info, &mut count, parts.as_mut_ptr()) }
        .result()
        .context(during)?;
    let mut all = String::new();
    for (part, bytes) in parts.iter().zip(&texts) {
        let body = String::from_utf8_lossy(bytes);
        all += &format!(
            "==== {}\n{}\n",
            text(part.name_as_c_str()),
            body.trim_end_matches('\0')
        );
    }
    Ok(all)
}
