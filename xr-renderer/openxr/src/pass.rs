//! The render pass that draws directly into a headset's images, in two subpasses: the first blends quads, the second makes the
//! compositor's picture of them. On a tile-based GPU the first subpass's pictures never reach memory.

use std::sync::Arc;

use ash::vk;
use renderer_splat::quad_pass::{DEPTH, PICTURE, QuadPass};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;

/// Both eyes, in either part.
const VIEWS: [u32; 2] = [0b11; 2];

/// What a pass draws into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PassKind {
    /// The format of the compositor's images.
    pub(crate) colour: vk::Format,
    /// Of its depth images, if depth is drawn.
    pub(crate) depth: Option<vk::Format>,
    /// Whether a density map tells where it is drawn coarser.
    pub(crate) foveated: bool,
}

impl PassKind {
    /// The pass. Its attachments, in order: the quads' picture, their depth, the compositor's image, its depth image, and the
    /// density map; those that there are.
    pub(crate) fn pass(self, gpu: &Arc<Gpu>) -> Result<QuadPass, VulkanError> {
        self.described(|info| QuadPass::new(gpu, info, self.depth.is_some()))
    }

    /// The number of pictures that the first part draws and the second reads; the compositor gets as many.
    fn pictures(self) -> u32 {
        1 + u32::from(self.depth.is_some())
    }

    fn described<T>(self, make: impl FnOnce(&vk::RenderPassCreateInfo<'_>) -> T) -> T {
        use vk::ImageLayout as Layout;
        let pictures = self.pictures();
        // Cleared, for what nobody sees is not drawn: on a tile-based GPU that is no more work than leaving them as they are.
        let shown = |format, left_in| {
            vk::AttachmentDescription::default()
                .format(format)
                .samples(vk::SampleCountFlags::TYPE_1)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::STORE)
                .initial_layout(Layout::UNDEFINED)
                .final_layout(left_in)
        };
        let passing = |format| {
            shown(format, Layout::SHADER_READ_ONLY_OPTIMAL)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
        };
        let map = vk::AttachmentDescription::default()
            .format(vk::Format::R8G8_UNORM)
            .samples(vk::SampleCountFlags::TYPE_1)
            .load_op(vk::AttachmentLoadOp::LOAD)
            .store_op(vk::AttachmentStoreOp::DONT_CARE)
            .initial_layout(Layout::FRAGMENT_DENSITY_MAP_OPTIMAL_EXT)
            .final_layout(Layout::FRAGMENT_DENSITY_MAP_OPTIMAL_EXT);
        let mut attachments = vec![passing(PICTURE)];
        attachments.extend(self.depth.map(|_| passing(DEPTH)));
        attachments.push(shown(self.colour, Layout::COLOR_ATTACHMENT_OPTIMAL));
        let depth_layout = Layout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL;
        attachments.extend(self.depth.map(|format| shown(format, depth_layout)));
        attachments.extend(self.foveated.then_some(map));

        let at = |place, layout| {
            vk::AttachmentReference::default()
                .attachment(place)
                .layout(layout)
        };
        let all = |layout| (0..pictures).map(move |place| at(place, layout));
        let blended: Vec<_> = all(Layout::COLOR_ATTACHMENT_OPTIMAL).collect();
        let read: Vec<_> = all(Layout::SHADER_READ_ONLY_OPTIMAL).collect();
        let colours = [at(pictures, Layout::COLOR_ATTACHMENT_OPTIMAL)];
        let depths = at(pictures + 1, depth_layout);
        let graphics =
            vk::SubpassDescription::default().pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS);
        let mut shows = graphics
            .input_attachments(&read)
            .color_attachments(&colours);
        if self.depth.is_some() {
            shows = shows.depth_stencil_attachment(&depths);
        }
        let subpasses = [graphics.color_attachments(&blended), shows];
        let dependencies = dependencies();
        let mut multiview = vk::RenderPassMultiviewCreateInfo::default()
            .view_masks(&VIEWS)
            .correlation_masks(&VIEWS[..1]);
        let map_at = at(2 * pictures, Layout::FRAGMENT_DENSITY_MAP_OPTIMAL_EXT);
        let mut density = vk::RenderPassFragmentDensityMapCreateInfoEXT::default()
            .fragment_density_map_attachment(map_at);
        let mut info = vk::RenderPassCreateInfo::default()
            .attachments(&attachments)
            .subpasses(&subpasses)
            .dependencies(&dependencies)
            .push_next(&mut multiview);
        if self.foveated {
            info = info.push_next(&mut density);
        }
        make(&info)
    }
}

fn dependencies() -> [vk::SubpassDependency; 4] {
    use vk::{AccessFlags as Access, PipelineStageFlags as Stage};
    let outside = vk::SUBPASS_EXTERNAL;
    let from_to = |from, to| {
        vk::SubpassDependency::default()
            .src_subpass(from)
            .dst_subpass(to)
    };
    [
        // The sort's and the projection's results, and the last picture that was drawn in passing.
        from_to(outside, 0)
            .src_stage_mask(Stage::COMPUTE_SHADER | Stage::TRANSFER | Stage::FRAGMENT_SHADER)
            .src_access_mask(Access::SHADER_WRITE | Access::TRANSFER_WRITE)
            .dst_stage_mask(
                Stage::DRAW_INDIRECT | Stage::VERTEX_SHADER | Stage::COLOR_ATTACHMENT_OUTPUT,
            )
            .dst_access_mask(
                Access::INDIRECT_COMMAND_READ
                    | Access::SHADER_READ
                    | Access::UNIFORM_READ
                    | Access::COLOR_ATTACHMENT_READ
                    | Access::COLOR_ATTACHMENT_WRITE,
            ),
        // The compositor, which was waited for when the images were acquired.
        from_to(outside, 1)
            .src_stage_mask(Stage::ALL_COMMANDS)
            .dst_stage_mask(
                Stage::COLOR_ATTACHMENT_OUTPUT
                    | Stage::EARLY_FRAGMENT_TESTS
                    | Stage::LATE_FRAGMENT_TESTS,
            )
            .dst_access_mask(
                Access::COLOR_ATTACHMENT_WRITE
                    | Access::DEPTH_STENCIL_ATTACHMENT_READ
                    | Access::DEPTH_STENCIL_ATTACHMENT_WRITE,
            ),
        from_to(0, 1)
            .src_stage_mask(Stage::COLOR_ATTACHMENT_OUTPUT)
            .src_access_mask(Access::COLOR_ATTACHMENT_WRITE)
            // Discarding the first part's pictures counts as writing them.
            .dst_stage_mask(Stage::FRAGMENT_SHADER | Stage::COLOR_ATTACHMENT_OUTPUT)
            .dst_access_mask(Access::INPUT_ATTACHMENT_READ | Access::COLOR_ATTACHMENT_WRITE)
            .dependency_flags(vk::DependencyFlags::BY_REGION | vk::DependencyFlags::VIEW_LOCAL),
        from_to(1, outside)
            .src_stage_mask(Stage::COLOR_ATTACHMENT_OUTPUT | Stage::LATE_FRAGMENT_TESTS)
            .src_access_mask(
                Access::COLOR_ATTACHMENT_WRITE | Access::DEPTH_STENCIL_ATTACHMENT_WRITE,
            )
            .dst_stage_mask(Stage::ALL_COMMANDS)
            .dst_access_mask(Access::MEMORY_READ | Access::MEMORY_WRITE),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLOUR: vk::Format = vk::Format::R8G8B8A8_SRGB;
    const DEPTHS: vk::Format = vk::Format::D32_SFLOAT;

    /// What a pass' description says: its attachments' formats, and which of them its chain names as the density map, in what
    /// layout.
    fn said(kind: PassKind) -> (Vec<vk::Format>, Option<(u32, vk::ImageLayout)>) {
        kind.described(|info| {
            let count = info.attachment_count as usize;
            // SAFETY: the description is alive, with as many attachments as it counts and a chain of typed structures.
            unsafe {
                let attachments = std::slice::from_raw_parts(info.p_attachments, count);
                let mut map = None;
                let mut next = info.p_next.cast::<vk::BaseInStructure<'_>>();
                while let Some(it) = next.as_ref() {
                    if it.s_type
                        == vk::StructureType::RENDER_PASS_FRAGMENT_DENSITY_MAP_CREATE_INFO_EXT
                    {
                        let info = next.cast::<vk::RenderPassFragmentDensityMapCreateInfoEXT<'_>>();
                        let vk::AttachmentReference { attachment, layout } =
                            (*info).fragment_density_map_attachment;
                        map = Some((attachment, layout));
                    }
                    next = it.p_next;
                }
                let formats = attachments.iter().map(|attachment| attachment.format);
                (formats.collect(), map)
            }
        })
    }

    #[test]
    fn only_a_foveated_pass_has_a_density_map_as_its_last_attachment() {
        let plain = |depth| PassKind {
            colour: COLOUR,
            depth,
            foveated: false,
        };
        for (depth, drawn) in [
            (None, vec![PICTURE, COLOUR]),
            (Some(DEPTHS), vec![PICTURE, DEPTH, COLOUR, DEPTHS]),
        ] {
            assert_eq!(said(plain(depth)), (drawn.clone(), None), "plain");
            let foveated = PassKind {
                foveated: true,
                ..plain(depth)
            };
            let (formats, map) = said(foveated);
            let last = u32::try_from(drawn.len()).expect("a handful");
            let layout = vk::ImageLayout::FRAGMENT_DENSITY_MAP_OPTIMAL_EXT;
            assert_eq!(map, Some((last, layout)), "the last attachment");
            let mut expected = drawn;
            expected.push(vk::Format::R8G8_UNORM);
            assert_eq!(formats, expected, "foveated");
        }
    }
}
