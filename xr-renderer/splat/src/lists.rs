//! What the last picture was made of before it was blended, brought to the host: for counting work, not for drawing.

use std::sync::Arc;

use bytemuck::Pod;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::{Commands, barrier};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::SortState;
pub use shaders_spirv::{CLOSE_LOOK, Splat, TILE_PIXELS};

use crate::geometry_pass::GeometryPass;
use crate::target::Target;
use crate::tiles::Tiles;

/// The tile back end's lists of one picture.
#[derive(Debug, Clone)]
pub struct TileLists {
    /// Width of a view, pixels.
    pub width: u32,
    /// Height of a view, pixels.
    pub height: u32,
    /// Gaussians of foreground and background, seen or not.
    pub gaussians: u32,
    /// Indices of those that were sorted, least depth first.
    pub order: Vec<u32>,
    /// What each view saw, the left (or only) one first.
    pub views: Vec<ViewLists>,
}

/// The lists of one view.
#[derive(Debug, Clone)]
pub struct ViewLists {
    /// Splats by index. Those that the view does not see hold anything.
    pub splats: Vec<Splat>,
    /// First column, first row, last column and last row of the tiles that each splat may touch; none where the view does not see it. By index.
    pub tiles: Vec<Option<[u32; 4]>>,
    /// The tiles' lists, row by row: indices of splats, least depth first.
    pub lists: Vec<Vec<u32>>,
}

/// Brings buffers to the host, one by one.
struct Reader<'a> {
    gpu: &'a Arc<Gpu>,
    commands: &'a mut Commands,
}

impl Reader<'_> {
    /// The first `count` values of a buffer that holds as many.
    fn read<T: Pod>(&mut self, from: &Buffer, count: usize) -> Result<Vec<T>, VulkanError> {
        let bytes = (count * size_of::<T>()) as u64;
        if bytes == 0 {
            return Ok(Vec::new());
        }
        let usage = ash::vk::BufferUsageFlags::empty();
        let to = Buffer::new(
            self.gpu,
            "list read-back",
            bytes,
            usage,
            MemoryUsage::ReadBack,
        )?;
        self.commands.run("the lists' read-back", |commands| {
            from.record_copy(commands, &to, bytes);
            barrier(self.gpu, commands);
        })?;
        Ok(to.read(count))
    }
}

/// The lists of the picture that was just drawn by `tiles`. The device is idle.
pub(crate) fn read(
    gpu: &Arc<Gpu>,
    commands: &mut Commands,
    geometry: &GeometryPass,
    tiles: &Tiles,
    target: &Target,
) -> Result<TileLists, VulkanError> {
    let mut reader = Reader { gpu, commands };
    let shared = geometry.shared_buffers();
    let gaussians = geometry.total_count();
    let all = gaussians as usize;
    let sorted = match reader.read::<SortState>(&shared.state, 1)?.as_slice() {
        [state] => state.count.min(gaussians),
        _ => 0,
    };
    let views = target.layers as usize;
    let list_count = tiles.list_count(target) as usize;
    let starts: Vec<u32> = reader.read(tiles.starts(), list_count * views + 1)?;
    let pair_count = starts
        .last()
        .copied()
        .unwrap_or(0)
        .min(tiles.pair_capacity());
    let pairs: Vec<u32> = reader.read(tiles.pairs(), pair_count as usize)?;
    let rects: Vec<u32> = reader.read(&shared.rects, all * views)?;
    let seen = |view: usize, splats: Vec<Splat>| {
        let rects = rects.iter().skip(view * all).take(all);
        let ends = starts.get(view * list_count..).unwrap_or_default();
        let list = |ends: &[u32]| match *ends {
            [start, end] => pairs
                .get(start as usize..end as usize)
                .unwrap_or_default()
                .to_vec(),
            _ => Vec::new(),
        };
        ViewLists {
            splats,
            tiles: rects.map(|rect| touched(*rect)).collect(),
            lists: ends.windows(2).take(list_count).map(list).collect(),
        }
    };
    let mut seen_by = Vec::with_capacity(views);
    for (view, splats) in shared.splats.iter().take(views).enumerate() {
        let splats = reader.read(splats, all)?;
        seen_by.push(seen(view, splats));
    }
    Ok(TileLists {
        width: target.width,
        height: target.height,
        gaussians,
        order: reader.read(geometry.order(), sorted as usize)?,
        views: seen_by,
    })
}

/// A word of the rectangles' buffer; where nothing is touched, the first tile is behind the last.
fn touched(rect: u32) -> Option<[u32; 4]> {
    let rect @ [left, top, right, bottom] = rect.to_le_bytes().map(u32::from);
    (left <= right && top <= bottom).then_some(rect)
}
