//! Recording commands, submitting them to the queue and waiting until they are done.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;

use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;

/// Longer than any picture on a software driver, short enough that a hung driver becomes an error.
const TIMEOUT: Duration = Duration::from_secs(120);

/// One command buffer that is recorded anew for each use.
#[derive(Debug)]
pub struct Commands {
    gpu: Arc<Gpu>,
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    fence: vk::Fence,
    /// The work that was submitted and not yet seen to end: its buffer, its fence and all that it uses belong to the device.
    in_flight: Option<&'static str>,
    /// When work was last handed to the queue, and seen to end.
    last_run: [Instant; 2],
    timeout: Duration,
}

impl Commands {
    /// Makes the command buffer and its fence.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self, VulkanError> {
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
            in_flight: None,
            last_run: [Instant::now(); 2],
            timeout: TIMEOUT,
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

    /// Waits until the device no longer uses anything of these commands: after an error, that
    /// must come before the host touches any of it. Returns at once after a run that went well.
    ///
    /// # Errors
    /// [`VulkanError::Timeout`] after two minutes, or a device that fails.
    pub fn wait(&mut self) -> Result<(), VulkanError> {
        let Some(what) = self.in_flight else {
            return Ok(());
        };
        let device = self.gpu.device();
        let fences = [self.fence];
        let nanoseconds = u64::try_from(self.timeout.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the fence was given to the queue with the work; it is reset only once it is signalled.
        unsafe {
            match device.wait_for_fences(&fences, true, nanoseconds) {
                Err(vk::Result::TIMEOUT) => {
                    return Err(VulkanError::Timeout {
                        what,
                        seconds: self.timeout.as_secs(),
                    });
                }
                done => done.during(what)?,
            }
            device.reset_fences(&fences).during("vkResetFences")?;
        }
        self.in_flight = None;
        Ok(())
    }

    /// Records, submits and waits. `what` names the work in errors.
    ///
    /// # Errors
    /// As [`Self::wait`].
    pub fn run(
        &mut self,
        what: &'static str,
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), VulkanError> {
        self.run_between(what, None, None, record)
    }

    /// As [`Self::run`]; the device's copies begin after `wait`, if any, and its end signals `signal`.
    ///
    /// # Errors
    /// As [`Self::wait`].
    pub fn run_between(
        &mut self,
        what: &'static str,
        wait: Option<vk::Semaphore>,
        signal: Option<vk::Semaphore>,
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), VulkanError> {
        let start = self.begin(what, wait, signal, record)?;
        self.wait()?;
        self.last_run = [start, Instant::now()];
        Ok(())
    }

    /// Records and submits, without waiting: [`Self::wait`] does, before any of what the work uses is touched again.
    ///
    /// # Errors
    /// As [`Self::wait`].
    pub fn submit(
        &mut self,
        what: &'static str,
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), VulkanError> {
        self.begin(what, None, None, record).map(drop)
    }

    /// Hands recorded work to the queue; returns when.
    fn begin(
        &mut self,
        what: &'static str,
        wait: Option<vk::Semaphore>,
        signal: Option<vk::Semaphore>,
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<Instant, VulkanError> {
        self.wait()?;
        if self.gpu.is_declared_lost() {
            return Err(VulkanError::DeviceLost(what));
        }
        let device = self.gpu.device();
        let begin = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is not in use: no work is in flight.
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
        let stages = wait.map(|_| vk::PipelineStageFlags::TRANSFER);
        let submit = [vk::SubmitInfo::default()
            .wait_semaphores(wait.as_slice())
            .wait_dst_stage_mask(stages.as_slice())
            .signal_semaphores(signal.as_slice())
            .command_buffers(&buffers)];
        // SAFETY: the buffer is being recorded.
        unsafe { device.end_command_buffer(self.buffer) }.during("vkEndCommandBuffer")?;
        let start = Instant::now();
        // SAFETY: the buffer is recorded, the fence unsignalled, the queue locked.
        let submitted = unsafe {
            self.gpu
                .with_queue(|queue| device.queue_submit(queue, &submit, self.fence))
        };
        // A submission refused for want of memory leaves the fence alone and its wait would never end;
        // a device that is lost may have begun.
        self.in_flight = match submitted {
            Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST) => Some(what),
            Err(_) => None,
        };
        submitted.during(what)?;
        Ok(start)
    }

    /// When the work that last went well was handed to the queue, and when it was seen to have ended.
    pub fn last_run(&self) -> [Instant; 2] {
        self.last_run
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        self.gpu.wait_idle_or_warn();
        // SAFETY: after an error work may still have been under way: it was waited for.
        unsafe {
            self.gpu.device().destroy_fence(self.fence, None);
            self.gpu.device().destroy_command_pool(self.pool, None);
        }
    }
}

/// Makes all that compute and copies wrote visible to the compute, copies, indirect counts and host reads that
/// follow.
pub fn barrier(gpu: &Gpu, commands: vk::CommandBuffer) {
    use vk::{AccessFlags as Access, PipelineStageFlags as Stage};
    let work = Stage::COMPUTE_SHADER | Stage::TRANSFER | Stage::DRAW_INDIRECT;
    let barriers = [vk::MemoryBarrier::default()
        .src_access_mask(Access::SHADER_WRITE | Access::SHADER_READ | Access::TRANSFER_WRITE)
        .dst_access_mask(
            Access::SHADER_READ
                | Access::SHADER_WRITE
                | Access::TRANSFER_READ
                | Access::TRANSFER_WRITE
                | Access::INDIRECT_COMMAND_READ
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::open_gpu;

    #[test]
    fn work_that_timed_out_is_waited_for_before_its_commands_are_used_again() {
        let Some(gpu) = open_gpu() else { return };
        let device = gpu.device();
        // SAFETY: no preconditions.
        let go = unsafe { device.create_event(&vk::EventCreateInfo::default(), None) }
            .expect("an event");
        let mut commands = Commands::new(&gpu).expect("commands");
        commands.timeout = Duration::from_millis(50);
        let stuck = commands.run("waiting", |buffer| {
            use vk::PipelineStageFlags as Stage;
            let (from, to) = (Stage::HOST, Stage::TRANSFER);
            // SAFETY: the command buffer is being recorded; the host sets the event below.
            unsafe { device.cmd_wait_events(buffer, &[go], from, to, &[], &[], &[]) };
        });
        let mut recorded = 0;
        let again = commands.run("more", |_| recorded += 1);
        let before = gpu.validation_messages();
        // Before any assertion: the commands' drop waits for the device.
        // SAFETY: the event is alive, and one that the device waits for may be set.
        unsafe { device.set_event(go) }.expect("the event is set");
        // Some versions of the layer warn that the event is in use, which Vulkan allows.
        let after = gpu.validation_messages();
        for outcome in [stuck, again] {
            assert!(
                matches!(
                    outcome,
                    Err(VulkanError::Timeout {
                        what: "waiting",
                        ..
                    })
                ),
                "{outcome:?}"
            );
        }
        assert_eq!(recorded, 0, "recordings over commands in use");
        commands.timeout = TIMEOUT;
        commands
            .run("more", |_| recorded += 1)
            .expect("the device is free again");
        assert_eq!(recorded, 1, "recordings");
        drop(commands);
        // SAFETY: the commands' drop waited for the only work that uses the event.
        unsafe { device.destroy_event(go, None) };
        assert_eq!(before, 0, "validation messages while the device is busy");
        assert_eq!(
            gpu.validation_messages(),
            after,
            "validation messages once it is free"
        );
    }
}
