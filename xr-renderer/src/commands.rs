//! Recording commands, handing them to the queue and waiting until they are done.

use std::sync::Arc;

use ash::vk;

use crate::error::{RenderError, VkContext};
use crate::gpu::Gpu;

/// Longer than any picture on a software driver, short enough that a hung driver becomes an error.
const PATIENCE_SECONDS: u64 = 120;

/// One command buffer that is recorded anew for each use.
pub(crate) struct Commands {
    gpu: Arc<Gpu>,
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    fence: vk::Fence,
}

impl Commands {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, RenderError> {
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(gpu.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the family is the device's.
        let pool = unsafe { gpu.device().create_command_pool(&info, None) }
            .during("vkCreateCommandPool")?;
        let mut commands = Self {
            gpu: Arc::clone(gpu),
            pool,
            buffer: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
        };
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool is ours.
        let buffers = unsafe { gpu.device().allocate_command_buffers(&info) }
            .during("vkAllocateCommandBuffers")?;
        commands.buffer = buffers.first().copied().unwrap_or_default();
        // SAFETY: no preconditions.
        commands.fence = unsafe {
            gpu.device()
                .create_fence(&vk::FenceCreateInfo::default(), None)
        }
        .during("vkCreateFence")?;
        Ok(commands)
    }

    /// Records, submits and waits. `what` names the work in errors.
    pub(crate) fn run(
        &mut self,
        what: &'static str,
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), RenderError> {
        self.run_between(what, &[], &[], record)
    }

    /// As [`Self::run`]; the device's copies begin after `wait` and its end signals `signal`.
    pub(crate) fn run_between(
        &mut self,
        what: &'static str,
        wait: &[vk::Semaphore],
        signal: &[vk::Semaphore],
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), RenderError> {
        let device = self.gpu.device();
        let begin = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is not in use: every run waits for its own end.
        unsafe {
            device
                .reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
                .during("vkResetCommandPool")?;
            device
                .begin_command_buffer(self.buffer, &begin)
                .during("vkBeginCommandBuffer")?;
        }
        record(self.buffer);
        let buffers = [self.buffer];
        let stages = vec![vk::PipelineStageFlags::TRANSFER; wait.len()];
        let submit = [vk::SubmitInfo::default()
            .wait_semaphores(wait)
            .wait_dst_stage_mask(&stages)
            .signal_semaphores(signal)
            .command_buffers(&buffers)];
        let fences = [self.fence];
        // SAFETY: the buffer is recorded, the fence unsignalled, the queue locked.
        unsafe {
            device
                .end_command_buffer(self.buffer)
                .during("vkEndCommandBuffer")?;
            self.gpu
                .with_queue(|queue| device.queue_submit(queue, &submit, self.fence))
                .during(what)?;
            match device.wait_for_fences(&fences, true, PATIENCE_SECONDS * 1_000_000_000) {
                Err(vk::Result::TIMEOUT) => {
                    return Err(RenderError::Timeout {
                        what,
                        seconds: PATIENCE_SECONDS,
                    });
                }
                done => done.during(what)?,
            }
            device.reset_fences(&fences).during("vkResetFences")
        }
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        // SAFETY: after an error work may still be under way: wait for it. A lost device returns at once.
        unsafe {
            if let Err(result) = self
                .gpu
                .with_queue(|queue| self.gpu.device().queue_wait_idle(queue))
            {
                log::warn!("waiting for the Vulkan queue failed: {result}");
            }
            self.gpu.device().destroy_fence(self.fence, None);
            self.gpu.device().destroy_command_pool(self.pool, None);
        }
    }
}

/// Makes all that compute and copies wrote visible to the compute, copies and host reads that follow.
pub(crate) fn barrier(gpu: &Gpu, commands: vk::CommandBuffer) {
    use vk::{AccessFlags as Access, PipelineStageFlags as Stage};
    let work = Stage::COMPUTE_SHADER | Stage::TRANSFER;
    let barriers = [vk::MemoryBarrier::default()
        .src_access_mask(Access::SHADER_WRITE | Access::SHADER_READ | Access::TRANSFER_WRITE)
        .dst_access_mask(
            Access::SHADER_READ
                | Access::SHADER_WRITE
                | Access::TRANSFER_READ
                | Access::TRANSFER_WRITE
                | Access::HOST_READ,
        )];
    // SAFETY: the command buffer is being recorded.
    unsafe {
        gpu.device().cmd_pipeline_barrier(
            commands,
            work,
            work | Stage::HOST,
            vk::DependencyFlags::empty(),
            &barriers,
            &[],
            &[],
        );
    }
}
