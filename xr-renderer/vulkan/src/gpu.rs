//! The opened Vulkan device, with one queue for graphics and compute.

use std::ffi::CStr;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ash::{ext, khr, vk};

use crate::calibration::Calibration;
use crate::choice::{GpuChoice, first_usable, rank};
use crate::error::{VkContext, VulkanError};
use crate::factory::{OwnFactory, VulkanFactory};
use crate::instance::{Instance, contains};
use crate::physical::{Candidate, Capabilities, DeviceInfo, Subgroup};
use crate::validation::Messenger;

/// A Vulkan device, its queue and its instance. Every object made with it holds an `Arc` of it.
pub struct Gpu {
    // Dropped in this order.
    device: Device,
    messenger: Option<Messenger>,
    pub(crate) instance: Instance,
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    pub(crate) memory: vk::PhysicalDeviceMemoryProperties,
    pub(crate) subgroup: Subgroup,
    pub(crate) queue_family: u32,
    /// Bits of a timestamp that count; 0 where the queue has none.
    pub(crate) timestamp_bits: u32,
    /// Reads the device's clock, where that can be done.
    pub(crate) calibration: Option<Calibration>,
    pub(crate) has_swapchain: bool,
    features: Features,
    /// Bytes of device memory taken by what was made with this device.
    pub(crate) memory_taken: AtomicU64,
    /// Whether work is refused, as by a lost device.
    declared_lost: AtomicBool,
    /// Whether a test declared it a headset's.
    declared_headsets: AtomicBool,
    /// Whether a headset's runtime made it, with what the runtime itself needs.
    belongs_to_headset: bool,
    /// How it was opened, to open it again.
    choice: GpuChoice,
    queue: Mutex<vk::Queue>,
    info: DeviceInfo,
}

/// Optional features of a device that are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Features {
    /// Whether a subgroup's lanes exchange values by broadcasts rather than through shared memory.
    pub broadcasts: bool,
    /// Whether shaders read what the host writes in place, as a software driver's do, rather than a copy.
    pub shares_memory: bool,
    /// Whether pictures can be drawn coarser where a density map says so: only asked of a headset's device.
    pub density_maps: bool,
}

struct Device(ash::Device);

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: every object made from the device holds an `Arc<Gpu>`, so none is left.
        unsafe { self.0.destroy_device(None) };
    }
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gpu")
            .field("info", &self.info)
            .field("subgroup", &self.subgroup)
            .finish()
    }
}

impl Gpu {
    /// Opens the chosen device, with the validation layer's messages logged and counted if asked for.
    ///
    /// # Errors
    /// No loader, no device, no device of that name, a device that lacks what the shaders need, or no
    /// validation layer: each says what to do.
    pub fn open(choice: &GpuChoice, validation: bool) -> Result<Arc<Self>, VulkanError> {
        Self::open_with(&OwnFactory, choice, validation)
    }

    /// As [`Self::open`], with an instance and a device that the factory makes.
    ///
    /// # Errors
    /// As there, and why the factory fails.
    pub fn open_with<F: VulkanFactory>(
        factory: &F,
        choice: &GpuChoice,
        validation: bool,
    ) -> Result<Arc<Self>, F::Error> {
        let instance = Instance::new(factory, validation)?;
        let messenger = validation
            .then(|| Messenger::new(&instance.entry, &instance.handle))
            .transpose()?;
        let wanted = factory.wanted_device(&instance.handle)?;
        let (chosen, capabilities) = match wanted {
            Some(handle) => {
                let candidate = Candidate::read(&instance.handle, handle)?;
                let capabilities = candidate.capabilities(&instance.handle)?;
                (candidate, capabilities)
            }
            None => choose(&instance, choice)?,
        };
        let capabilities = Capabilities {
            broadcasts: capabilities.broadcasts && !factory.adds_features(),
            density_maps: capabilities.density_maps && wanted.is_some(),
            ..capabilities
        };
        let Capabilities {
            subgroup,
            queue_family,
            timestamp_bits,
            broadcasts,
            density_maps,
        } = capabilities;
        let has_swapchain = instance.surface_extensions.contains(&khr::surface::NAME)
            && contains(&chosen.extensions, khr::swapchain::NAME);
        let clock = (timestamp_bits > 0)
            .then(|| Calibration::extension(&instance, chosen.handle, &chosen.extensions))
            .flatten();
        let optional = [
            has_swapchain.then_some(khr::swapchain::NAME),
            clock,
            density_maps.then_some(ext::fragment_density_map::NAME),
        ];
        let device = open_device(factory, &instance, &chosen, &capabilities, optional)?;
        let calibration = clock.map(|name| Calibration::new(&instance, &device.0, name));
        // SAFETY: the family and its first queue were asked for when the device was made.
        let queue = unsafe { device.0.get_device_queue(queue_family, 0) };
        // SAFETY: the handle belongs to this instance.
        let memory = unsafe {
            instance
                .handle
                .get_physical_device_memory_properties(chosen.handle)
        };
        log::info!(
            "Vulkan device: {} ({}, Vulkan {}, subgroups of {})",
            chosen.info.name,
            chosen.info.driver,
            chosen.info.api_version,
            subgroup.size
        );
        Ok(Arc::new(Self {
            device,
            messenger,
            physical: chosen.handle,
            limits: chosen.limits,
            memory,
            subgroup,
            queue_family,
            timestamp_bits,
            calibration,
            has_swapchain,
            features: Features {
                broadcasts,
                shares_memory: chosen.info.is_cpu,
                density_maps,
            },
            memory_taken: AtomicU64::new(0),
            declared_lost: AtomicBool::new(false),
            declared_headsets: AtomicBool::new(false),
            belongs_to_headset: wanted.is_some(),
            choice: choice.clone(),
            queue: Mutex::new(queue),
            info: chosen.info,
            instance,
        }))
    }

    /// Opens a device again as this one was opened: what to do after [`VulkanError::DeviceLost`]. If the device is gone,
    /// another may answer to the same choice.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn reopen(&self) -> Result<Arc<Self>, VulkanError> {
        Self::open(&self.choice, self.messenger.is_some())
    }

    /// Whether a headset's runtime made it: pictures for the headset are drawn on no other, and when it is lost the headset
    /// has to be opened again.
    pub fn belongs_to_headset(&self) -> bool {
        self.belongs_to_headset || self.declared_headsets.load(Ordering::Relaxed)
    }

    /// Makes [`Self::belongs_to_headset`] true for any device: for tests of what follows from that.
    pub fn declare_headsets(&self) {
        self.declared_headsets.store(true, Ordering::Relaxed);
    }

    /// Makes all further work on this device fail with [`VulkanError::DeviceLost`]: for tests of recovery.
    pub fn declare_lost(&self) {
        self.declared_lost.store(true, Ordering::Relaxed);
    }

    /// Whether work is to be refused.
    pub(crate) fn is_declared_lost(&self) -> bool {
        self.declared_lost.load(Ordering::Relaxed)
    }

    /// Bytes of device memory taken by what was made with this device and is still there.
    pub fn memory_taken(&self) -> u64 {
        self.memory_taken.load(Ordering::Relaxed)
    }

    /// The device's name, driver and version.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Invocations in a subgroup of this device.
    pub fn subgroup_size(&self) -> u32 {
        self.subgroup.size
    }

    /// Whether the device can time what it does.
    pub fn has_clock(&self) -> bool {
        self.timestamp_bits > 0
    }

    /// How many warnings and errors the validation layer has given so far; 0 without the layer.
    pub fn validation_messages(&self) -> u32 {
        self.messenger.as_ref().map_or(0, Messenger::count)
    }

    /// Waits until all that was submitted is done.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn wait_idle(&self) -> Result<(), VulkanError> {
        // SAFETY: the queue is the device's, and locked.
        self.with_queue(|queue| unsafe { self.device().queue_wait_idle(queue) })
            .during("vkQueueWaitIdle")
    }

    /// Nanoseconds from one of the device's stamps to a later one.
    #[must_use]
    pub fn nanoseconds(&self, from: u64, to: u64) -> f64 {
        let mask = u64::MAX >> (64 - self.timestamp_bits.clamp(1, 64));
        #[expect(clippy::cast_precision_loss, reason = "differences of seconds at most")]
        let ticks = (to.wrapping_sub(from) & mask) as f64;
        ticks * f64::from(self.limits.timestamp_period)
    }

    /// The device's functions.
    #[must_use]
    pub fn device(&self) -> &ash::Device {
        &self.device.0
    }

    /// The instance's functions.
    #[must_use]
    pub fn instance(&self) -> &ash::Instance {
        &self.instance.handle
    }

    /// The physical device.
    #[must_use]
    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.physical
    }

    /// The family of its queue.
    #[must_use]
    pub fn queue_family(&self) -> u32 {
        self.queue_family
    }

    /// The device's limits.
    pub fn limits(&self) -> &vk::PhysicalDeviceLimits {
        &self.limits
    }

    /// The optional features in use.
    #[must_use]
    pub fn features(&self) -> Features {
        self.features
    }

    /// Turns off features that the device has, for objects made from now on: for tests and measurements. What the device lacks
    /// cannot be turned on.
    pub fn features_mut(&mut self) -> &mut Features {
        &mut self.features
    }

    /// Locks the queue and runs `use_queue` with it: Vulkan wants submissions to a queue one at a time.
    pub fn with_queue<T>(&self, use_queue: impl FnOnce(vk::Queue) -> T) -> T {
        use_queue(*self.queue.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// As [`Self::wait_idle`], but logs an error instead of returning it: for destructors, which must wait for the queue before
    /// they destroy what it uses. A lost device returns at once.
    pub fn wait_idle_or_warn(&self) {
        // SAFETY: the queue is locked.
        let waited = unsafe { self.with_queue(|queue| self.device().queue_wait_idle(queue)) };
        if let Err(result) = waited {
            log::warn!("waiting for the Vulkan queue failed: {result}");
        }
    }
}

/// The best of the devices that the choice allows and that can draw.
fn choose(
    instance: &Instance,
    choice: &GpuChoice,
) -> Result<(Candidate, Capabilities), VulkanError> {
    // SAFETY: no preconditions.
    let handles = unsafe { instance.handle.enumerate_physical_devices() }
        .during("vkEnumeratePhysicalDevices")?;
    let mut candidates = handles
        .into_iter()
        .map(|handle| Candidate::read(&instance.handle, handle))
        .collect::<Result<Vec<_>, _>>()?;
    if candidates.is_empty() {
        return Err(VulkanError::NoDevice);
    }
    candidates.sort_by_key(|candidate| rank(candidate.kind));
    let present = candidates
        .iter()
        .map(|candidate| candidate.info.name.clone())
        .collect();
    let accepted = candidates
        .into_iter()
        .filter(|candidate| choice.accepts(&candidate.info.name, candidate.driver_id))
        .map(|candidate| {
            let capabilities = candidate.capabilities(&instance.handle)?;
            Ok((candidate, capabilities))
        });
    first_usable(accepted).unwrap_or_else(|| {
        Err(VulkanError::NoSuchDevice {
            wanted: choice.to_string(),
            present,
        })
    })
}

fn open_device<F: VulkanFactory>(
    factory: &F,
    instance: &Instance,
    chosen: &Candidate,
    capabilities: &Capabilities,
    optional: [Option<&'static CStr>; 3],
) -> Result<Device, F::Error> {
    let &Capabilities {
        subgroup,
        queue_family,
        broadcasts,
        density_maps,
        ..
    } = capabilities;
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(queue_family)
        .queue_priorities(&priorities)];
    let mut extensions: Vec<&CStr> = optional.into_iter().flatten().collect();
    if subgroup.can_be_required && chosen.api_version < vk::API_VERSION_1_3 {
        extensions.push(ext::subgroup_size_control::NAME);
    }
    let extensions: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    let mut control = vk::PhysicalDeviceSubgroupSizeControlFeatures::default()
        .subgroup_size_control(true)
        .compute_full_subgroups(true);
    // Every Vulkan 1.1 device has it.
    let mut multiview = vk::PhysicalDeviceMultiviewFeatures::default().multiview(true);
    let mut info = vk::DeviceCreateInfo::default()
        .push_next(&mut multiview)
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions);
    if subgroup.can_be_required {
        info = info.push_next(&mut control);
    }
    let mut broadcast =
        vk::PhysicalDeviceVulkan12Features::default().subgroup_broadcast_dynamic_id(true);
    if broadcasts {
        info = info.push_next(&mut broadcast);
    }
    let mut maps = vk::PhysicalDeviceFragmentDensityMapFeaturesEXT::default()
        .fragment_density_map(true)
        .fragment_density_map_non_subsampled_images(true);
    if density_maps {
        info = info.push_next(&mut maps);
    }
    // Its features were checked to be there.
    factory
        .device(&instance.entry, &instance.handle, chosen.handle, &info)
        .map(Device)
}
