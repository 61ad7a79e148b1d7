//! The core's functions of swapchains.

use openxr::sys::{self, Handle, Result as XrResult};

use super::call;
use super::pointers::{chained, change, describe, give, list, read, values};
use super::world::FakeSwapchain;

const OK: XrResult = XrResult::SUCCESS;

/// Images of a swapchain.
const IMAGES: u32 = 3;

pub(super) unsafe extern "system" fn enumerate_formats(
    session: sys::Session,
    capacity: u32,
    count: *mut u32,
    out: *mut i64,
) -> XrResult {
    call(session, "xrEnumerateSwapchainFormats", "", |world| {
        values(capacity, count, out, &world.formats)
    })
}

pub(super) unsafe extern "system" fn create_swapchain(
    session: sys::Session,
    info: *const sys::SwapchainCreateInfo,
    swapchain: *mut sys::Swapchain,
) -> XrResult {
    let info = read(info);
    let (width, height, chain) = (info.width, info.height, describe(info.next));
    let said = format!(
        "{width}x{height}x{} format {} {:?}{chain}",
        info.array_size, info.format, info.usage_flags
    );
    call(session, "xrCreateSwapchain", said, |world| {
        if !world.formats.contains(&info.format) {
            return XrResult::ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED;
        }
        if info.usage_flags.intersects(world.refused_usage) {
            return XrResult::ERROR_FEATURE_UNSUPPORTED;
        }
        let images = world
            .device
            .as_ref()
            .map(|device| device.images(&info, IMAGES));
        let foveated = chain.contains("FOVEATION");
        let maps = (world.device.as_ref())
            .filter(|_| foveated)
            .map(|device| device.maps(map_size(width, height), info.array_size, IMAGES));
        let handle = world.make("swapchain", swapchain);
        world.swapchains.insert(
            handle,
            FakeSwapchain {
                width,
                height,
                density_maps: foveated,
                acquired: 0,
                images,
                maps,
            },
        );
        OK
    })
}

/// Of a density map.
fn map_size(width: u32, height: u32) -> [u32; 2] {
    [width.div_ceil(32), height.div_ceil(32)]
}

pub(super) unsafe extern "system" fn destroy_swapchain(swapchain: sys::Swapchain) -> XrResult {
    call(swapchain, "xrDestroySwapchain", "", |world| {
        world.swapchains.remove(&swapchain.into_raw());
        OK
    })
}

pub(super) unsafe extern "system" fn enumerate_images(
    swapchain: sys::Swapchain,
    capacity: u32,
    count: *mut u32,
    out: *mut sys::SwapchainImageBaseHeader,
) -> XrResult {
    let out: *mut sys::SwapchainImageVulkanKHR = out.cast();
    let chain = if capacity > 0 {
        describe(read(out).next)
    } else {
        String::new()
    };
    call(swapchain, "xrEnumerateSwapchainImages", chain, |world| {
        let handle = swapchain.into_raw();
        let Some(it) = world.swapchains.get(&handle) else {
            return XrResult::ERROR_HANDLE_INVALID;
        };
        let numbers: Vec<u32> = (1..=IMAGES).collect();
        list(capacity, count, out, &numbers, |to, number| {
            let image = handle << 8 | u64::from(*number);
            let real = it.images.as_ref();
            let real = real.map(|images| images.handle(*number as usize - 1));
            change(to, |to| to.image = real.unwrap_or(image));
            for (ty, at) in chained(read(to).next) {
                if ty == sys::SwapchainImageFoveationVulkanFB::TYPE && it.density_maps {
                    change(at.cast::<sys::SwapchainImageFoveationVulkanFB>(), |map| {
                        let real = it.maps.as_ref();
                        let real = real.map(|maps| maps.handle(*number as usize - 1));
                        map.image = real.unwrap_or(image | 0x80);
                        [map.width, map.height] = map_size(it.width, it.height);
                    });
                }
            }
        })
    })
}

pub(super) unsafe extern "system" fn acquire_image(
    swapchain: sys::Swapchain,
    _info: *const sys::SwapchainImageAcquireInfo,
    index: *mut u32,
) -> XrResult {
    call(swapchain, "xrAcquireSwapchainImage", "", |world| {
        let Some(it) = world.swapchains.get_mut(&swapchain.into_raw()) else {
            return XrResult::ERROR_HANDLE_INVALID;
        };
        it.acquired += 1;
        give(index, (it.acquired - 1) % IMAGES)
    })
}

pub(super) unsafe extern "system" fn wait_image(
    swapchain: sys::Swapchain,
    _info: *const sys::SwapchainImageWaitInfo,
) -> XrResult {
    call(swapchain, "xrWaitSwapchainImage", "", |_| OK)
}

pub(super) unsafe extern "system" fn release_image(
    swapchain: sys::Swapchain,
    _info: *const sys::SwapchainImageReleaseInfo,
) -> XrResult {
    call(swapchain, "xrReleaseSwapchainImage", "", |_| OK)
}
